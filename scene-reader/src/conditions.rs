//! Conditions of the stages: what the scene says, and what stays of the stages before.
//!
//! A condition acts from its stage to the end of the run, unless a later stage replaces it (the same table and the same
//! name) or removes it. What stays on is held as it stood at the end of its stage: supports do not move any more, loads
//! keep the value that they have reached.

use super::document::Document;
use super::input_error::InputError;
use super::multi_point_constraints::{ConstraintTables, multi_point_constraints};
use super::sets::Sets;
use super::tables::{
    BodyForceTable, BoundaryTable, Components, FrictionTable, History, PressureTable, SceneFile, StageTable,
    TractionTable,
};
use keys::Located;
use macro_solver::problem::{Amplitude, Applied, Condition, Moment, Origin, Rate, RateHistory};
use std::ops::Range;

/// Where each condition of a stage is written, in the order in which the solver gets them.
pub(super) type ConditionPlaces = Vec<Range<usize>>;

/// The tables of one place, the top of the scene or a stage.
pub(super) struct ConditionTables<'a> {
    boundary: &'a [Located<BoundaryTable>],
    pressure: &'a [Located<PressureTable>],
    traction: &'a [Located<TractionTable>],
    body_force: &'a [Located<BodyForceTable>],
    friction: &'a [Located<FrictionTable>],
    constraints: ConstraintTables<'a>,
}

impl<'a> From<&'a SceneFile> for ConditionTables<'a> {
    fn from(file: &'a SceneFile) -> Self {
        Self {
            boundary: &file.boundary,
            pressure: &file.pressure,
            traction: &file.traction,
            body_force: &file.body_force,
            friction: &file.friction,
            constraints: ConstraintTables {
                tilting_platen: &file.tilting_platen,
                normal_displacement: &file.normal_displacement,
                radial_displacement: &file.radial_displacement,
                rigid_body: &file.rigid_body,
                periodic: &file.periodic,
                sum: &file.sum,
            },
        }
    }
}

impl<'a> From<&'a StageTable> for ConditionTables<'a> {
    fn from(stage: &'a StageTable) -> Self {
        Self {
            boundary: &stage.boundary,
            pressure: &stage.pressure,
            traction: &stage.traction,
            body_force: &stage.body_force,
            friction: &stage.friction,
            constraints: ConstraintTables {
                tilting_platen: &stage.tilting_platen,
                normal_displacement: &stage.normal_displacement,
                radial_displacement: &stage.radial_displacement,
                rigid_body: &stage.rigid_body,
                periodic: &stage.periodic,
                sum: &stage.sum,
            },
        }
    }
}

/// Which table a condition stands in: a name belongs to one of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Table {
    Boundary,
    Pressure,
    Traction,
    BodyForce,
    Friction,
    Linked,
}

impl Table {
    /// Its name in messages: in input files too, except of multi-point constraints, which have several tables.
    fn name(self) -> &'static str {
        match self {
            Self::Boundary => "boundary",
            Self::Pressure => "pressure",
            Self::Traction => "traction",
            Self::BodyForce => "body_force",
            Self::Friction => "friction",
            Self::Linked => "multi-point constraints",
        }
    }
}

/// A condition that acts, and how it is called.
#[derive(Clone, Debug, PartialEq)]
struct Acting {
    table: Table,
    name: String,
    applied: Applied,
    /// Where it is written: its set.
    place: Range<usize>,
}

/// The conditions of the stage under construction.
#[derive(Clone, Debug, Default)]
pub(super) struct Conditions(Vec<Acting>);

impl Conditions {
    /// What the solver gets.
    pub(super) fn applied(&self) -> Vec<Applied> {
        self.0.iter().map(|acting| acting.applied.clone()).collect()
    }

    /// Where each of [`Conditions::applied`] is written.
    pub(super) fn places(&self) -> ConditionPlaces {
        self.0.iter().map(|acting| acting.place.clone()).collect()
    }

    /// Ends a stage of this duration, s: everything stays as it is then.
    pub(super) fn settle(&mut self, duration: f64) {
        let end = Moment { load: 1.0, time: duration };
        for acting in &mut self.0 {
            acting.applied = settled(&acting.applied, end);
        }
        self.0.retain(|acting| !is_idle(&acting.applied.condition));
    }

    /// Adds the conditions of tables; they replace those of the same table and name that acted before. A load that ramps
    /// to its value begins at what it replaces.
    ///
    /// # Errors
    /// A set that does not exist, or keys that do not fit together.
    pub(super) fn add(
        &mut self,
        document: &Document,
        sets: &Sets<'_>,
        tables: &ConditionTables<'_>,
    ) -> Result<(), InputError> {
        let mut added = read(document, sets, tables)?;
        for new in &mut added {
            let earlier = self.0.iter().find(|earlier| new.table == earlier.table && new.name == earlier.name);
            if let Some(earlier) = earlier {
                go_on_from(&mut new.applied.condition, &earlier.applied);
            }
        }
        let replacing =
            |earlier: &Acting| added.iter().find(|new| new.table == earlier.table && new.name == earlier.name);
        self.0.retain_mut(|earlier| match replacing(earlier) {
            None => true,
            Some(new) => fades(&mut earlier.applied, &new.applied),
        });
        self.0.extend(added);
        Ok(())
    }

    /// Ends the conditions of these names.
    ///
    /// # Errors
    /// There is none of that name, or conditions of several tables are called so.
    pub(super) fn remove(&mut self, document: &Document, names: &[Located<String>]) -> Result<(), InputError> {
        for name in names {
            if !self.0.iter().any(|acting| acting.name == *name.get_ref()) {
                let mut known: Vec<&str> = Vec::new();
                for acting in &self.0 {
                    if !known.contains(&acting.name.as_str()) {
                        known.push(&acting.name);
                    }
                }
                return Err(document
                    .error_at(name.span(), format!("no condition '{}' acts that could be removed", name.get_ref()))
                    .hint(format!(
                        "these act: {}; without `name` a condition is called as its set",
                        known.join(", ")
                    )));
            }
            let mut tables: Vec<&str> = Vec::new();
            for acting in self.0.iter().filter(|acting| acting.name == *name.get_ref()) {
                if !tables.contains(&acting.table.name()) {
                    tables.push(acting.table.name());
                }
            }
            if tables.len() > 1 {
                return Err(document
                    .error_at(
                        name.span(),
                        format!("several conditions are called '{}': of {}", name.get_ref(), tables.join(" and of ")),
                    )
                    .hint(
                        "give each a `name` of its own where it is written, and remove the one that is meant by it",
                    ));
            }
            self.0.retain(|acting| acting.name != *name.get_ref());
        }
        Ok(())
    }
}

/// Whether a load that is replaced leaves bit by bit, while another ramps up in its place; it does so from now on.
fn fades(earlier: &mut Applied, new: &Applied) -> bool {
    let from = earlier.history.factor(START);
    if is_support(&earlier.condition) || matches!(earlier.condition, Condition::Friction { .. }) {
        return false;
    }
    let Some(fading) = new.history.fading(from) else { return false };
    earlier.history = fading;
    from != 0.0
}

/// Friction changes from what it was: at the end of a stage its last value, before any stage what its history begins with.
fn go_on_from(new: &mut Condition, earlier: &Applied) {
    if let (Condition::Friction { from, .. }, Condition::Friction { from: first, to: last, .. }) =
        (new, &earlier.condition)
    {
        *from = first + (last - first) * earlier.history.factor(START);
    }
}

/// The moment at which a stage begins.
const START: Moment = Moment { load: 0.0, time: 0.0 };

/// Whether it prescribes displacements.
fn is_support(condition: &Condition) -> bool {
    matches!(
        condition,
        Condition::Displacement { .. } | Condition::Platen { .. } | Condition::MultiPointConstraint(_)
    )
}

/// The condition as it stands at the end of its stage, for the stages that follow.
fn settled(applied: &Applied, end: Moment) -> Applied {
    let factor = applied.history.factor(end);
    let mut condition = applied.condition.clone();
    match &mut condition {
        // Displacements count from the beginning of the next stage.
        Condition::Displacement { value, .. } => *value = 0.0,
        Condition::Platen { displacement, .. } => *displacement = 0.0,
        Condition::MultiPointConstraint(link) => *link = link.held(),
        Condition::Pressure { value, .. } => *value *= factor,
        Condition::Traction { value, .. } | Condition::BodyForce { value, .. } => {
            value.iter_mut().for_each(|component| *component *= factor);
        }
        Condition::Friction { from, to, .. } => {
            *to = *from + (*to - *from) * factor;
            *from = *to;
        }
    }
    Applied::new(condition, Amplitude::Constant)
}

/// Whether a load is no load any more.
fn is_idle(condition: &Condition) -> bool {
    match condition {
        Condition::Displacement { .. } | Condition::Platen { .. } | Condition::MultiPointConstraint(_) => false,
        Condition::Friction { to, .. } => *to == 1.0,
        Condition::Pressure { value, .. } => *value == 0.0,
        Condition::Traction { value, .. } | Condition::BodyForce { value, .. } => *value == [0.0; 3],
    }
}

fn read(document: &Document, sets: &Sets<'_>, tables: &ConditionTables<'_>) -> Result<Vec<Acting>, InputError> {
    let mut found = Vec::new();
    let mut push = |table, name: &Option<String>, set: &Located<String>, applied| {
        let name = name.as_ref().unwrap_or(set.get_ref()).clone();
        found.push(Acting { table, name, applied, place: set.span() });
    };
    for boundary in tables.boundary.iter().map(Located::get_ref) {
        let (components, rate) = prescribed(document, boundary)?;
        let history = match rate {
            None => history(document, &boundary.history, Amplitude::RAMP)?,
            Some(rate) => {
                let history = history(document, &boundary.history, Amplitude::Constant)?;
                Amplitude::Rate(Box::new(RateHistory::new(rate, history)))
            }
        };
        for condition in boundary_conditions(document, sets, boundary, components)? {
            let applied = Applied { condition, history: history.clone(), origin: boundary.from };
            push(Table::Boundary, &boundary.name, &boundary.set, applied);
        }
    }
    for pressure in tables.pressure.iter().map(Located::get_ref) {
        let sides = sets.side_set(document, &pressure.set)?;
        let condition = Condition::Pressure { sides, value: pressure.value, kind: pressure.kind };
        let history = history(document, &pressure.history, Amplitude::Constant)?;
        push(Table::Pressure, &pressure.name, &pressure.set, Applied::new(condition, history));
    }
    for traction in tables.traction.iter().map(Located::get_ref) {
        let condition =
            Condition::Traction { sides: sets.side_set(document, &traction.set)?, value: or_zero(traction.value) };
        let history = history(document, &traction.history, Amplitude::RAMP)?;
        push(Table::Traction, &traction.name, &traction.set, Applied::new(condition, history));
    }
    for force in tables.body_force.iter().map(Located::get_ref) {
        let condition = Condition::BodyForce {
            elements: sets.element_set_or_region(document, &force.set)?,
            value: or_zero(force.value),
        };
        let history = history(document, &force.history, Amplitude::RAMP)?;
        push(Table::BodyForce, &force.name, &force.set, Applied::new(condition, history));
    }
    for friction in tables.friction.iter().map(Located::get_ref) {
        let elements = sets.element_set_or_region(document, &friction.set)?;
        let to = friction.factor;
        let history = history(document, &friction.history, Amplitude::RAMP)?;
        let applied = Applied::new(Condition::Friction { elements, from: 1.0, to }, history);
        push(Table::Friction, &friction.name, &friction.set, applied);
    }
    let linked = multi_point_constraints(document, sets, &tables.constraints)?.into_iter();
    found.extend(linked.map(|link| Acting {
        table: Table::Linked,
        name: link.name,
        applied: link.applied,
        place: link.place,
    }));
    Ok(found)
}

fn or_zero(components: Components) -> [f64; 3] {
    components.by_axis().map(|(_, component)| component.unwrap_or(0.0))
}

/// The history that a key gives, or the usual one.
///
/// # Errors
/// What is given is not usable.
pub(super) fn history(
    document: &Document,
    given: &Option<Located<History>>,
    otherwise: Amplitude,
) -> Result<Amplitude, InputError> {
    let Some(given) = given else { return Ok(otherwise) };
    let amplitude = Amplitude::from(given.get_ref());
    match amplitude.defect() {
        None => Ok(amplitude),
        Some(defect) => Err(document.error_at(given.span(), "this history is not usable").hint(defect)),
    }
}

/// What a table prescribes: displacements, or the rate given in place of them.
///
/// # Errors
/// Not one of them exactly, or a rate that is to lead somewhere.
fn prescribed<'a>(
    document: &Document,
    boundary: &'a BoundaryTable,
) -> Result<(&'a Located<Components>, Option<Rate>), InputError> {
    let kinds = [
        (&boundary.displacement, None),
        (&boundary.velocity, Some(Rate::Velocity)),
        (&boundary.acceleration, Some(Rate::Acceleration)),
    ];
    let given: Vec<_> = kinds.into_iter().filter_map(|(key, rate)| Some((key.as_ref()?, rate))).collect();
    let (components, rate) = match given[..] {
        [one] => one,
        [] => {
            return Err(document
                .error_at(boundary.set.span(), "a [[boundary]] prescribes displacement, velocity or acceleration")
                .hint("add for example displacement = { y = 0.0 }"));
        }
        [_, (second, _), ..] => {
            return Err(document
                .error_at(second.span(), "a [[boundary]] prescribes one of displacement, velocity and acceleration")
                .hint("keep one of the keys, or give each a [[boundary]] of its own"));
        }
    };
    if rate.is_some() && boundary.from == Origin::Run {
        return Err(document
            .error_at(
                components.span(),
                "from = \"run\" leads to a displacement, not to a velocity or an acceleration",
            )
            .hint("write displacement, or leave `from` out"));
    }
    Ok((components, rate))
}

fn boundary_conditions(
    document: &Document,
    sets: &Sets<'_>,
    boundary: &BoundaryTable,
    prescribed: &Located<Components>,
) -> Result<Vec<Condition>, InputError> {
    let nodes = sets.node_set(document, &boundary.set)?;
    let components = *prescribed.get_ref();
    let Some(contact) = boundary.platen else {
        let conditions: Vec<Condition> = components
            .by_axis()
            .into_iter()
            .filter_map(|(axis, value)| Some(Condition::Displacement { nodes: nodes.clone(), axis, value: value? }))
            .collect();
        if conditions.is_empty() {
            return Err(document
                .error_at(prescribed.span(), "no component is prescribed")
                .hint("write for example displacement = { y = 0.0 }"));
        }
        return Ok(conditions);
    };
    let given: Vec<_> = components.by_axis().into_iter().filter_map(|(axis, value)| Some((axis, value?))).collect();
    let [(axis, displacement)] = given[..] else {
        return Err(document
            .error_at(prescribed.span(), "a platen moves along its normal only")
            .hint("write for example displacement = { y = ... } only; platen = \"rough\" also holds the others"));
    };
    Ok(vec![Condition::Platen { nodes, contact, axis, displacement }])
}
