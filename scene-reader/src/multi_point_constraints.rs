//! `[[tilting_platen]]`, `[[normal_displacement]]`, `[[radial_displacement]]`, `[[rigid_body]]`, `[[periodic]]` and `[[sum]]`: displacements
//! that are tied to one another.

use super::conditions::history;
use super::document::Document;
use super::input_error::InputError;
use super::sets::Sets;
use super::tables::{
    Components, History, NormalDisplacementTable, PeriodicTable, RadialDisplacementTable, RigidBodyTable, SumTable,
    TiltingPlatenTable,
};
use keys::Located;
use macro_solver::problem::{Amplitude, Applied, Condition, ConstraintTerm, Directions, MultiPointConstraint};
use std::ops::Range;

/// The tables of one place.
#[derive(Clone, Copy)]
pub(super) struct ConstraintTables<'a> {
    pub(super) tilting_platen: &'a [Located<TiltingPlatenTable>],
    pub(super) normal_displacement: &'a [Located<NormalDisplacementTable>],
    pub(super) radial_displacement: &'a [Located<RadialDisplacementTable>],
    pub(super) rigid_body: &'a [Located<RigidBodyTable>],
    pub(super) periodic: &'a [Located<PeriodicTable>],
    pub(super) sum: &'a [Located<SumTable>],
}

/// A multi-point constraint as the scene has it.
pub(super) struct Link {
    pub(super) name: String,
    pub(super) applied: Applied,
    /// Where it is written: its first set.
    pub(super) place: Range<usize>,
}

/// All of them.
///
/// # Errors
/// A set that does not exist, or a history that is not usable.
pub(super) fn multi_point_constraints(
    document: &Document,
    sets: &Sets<'_>,
    tables: &ConstraintTables<'_>,
) -> Result<Vec<Link>, InputError> {
    let mut found = Vec::new();
    let mut push = |name: String, place: Range<usize>, constraint, given: &Option<Located<History>>| {
        let history = history(document, given, Amplitude::RAMP)?;
        let applied = Applied::new(Condition::MultiPointConstraint(constraint), history);
        found.push(Link { name, applied, place });
        Ok(())
    };
    let called = |name: &Option<String>, set: &str| name.clone().unwrap_or_else(|| set.to_owned());
    for table in tables.tilting_platen.iter().map(Located::get_ref) {
        let nodes = sets.node_set(document, &table.set)?;
        let (axis, displacement, rotation) = (table.normal, table.displacement, by_axis(table.rotation));
        push(
            called(&table.name, &nodes),
            table.set.span(),
            MultiPointConstraint::TiltingPlaten { nodes, axis, displacement, rotation },
            &table.history,
        )?;
    }
    for table in tables.normal_displacement.iter().map(Located::get_ref) {
        let sides = sets.side_set(document, &table.set)?;
        let (name, displacement) = (called(&table.name, &sides), table.displacement);
        let along = Directions::Normal { sides };
        push(name, table.set.span(), MultiPointConstraint::Guided { along, displacement }, &table.history)?;
    }
    for table in tables.radial_displacement.iter().map(Located::get_ref) {
        let nodes = sets.node_set(document, &table.set)?;
        let (name, displacement) = (called(&table.name, &nodes), table.displacement);
        let along = Directions::Radial { nodes, centre: table.centre };
        push(name, table.set.span(), MultiPointConstraint::Guided { along, displacement }, &table.history)?;
    }
    for table in tables.rigid_body.iter().map(Located::get_ref) {
        let nodes = sets.node_set(document, &table.set)?;
        let (displacement, rotation) = (by_axis(table.displacement), by_axis(table.rotation));
        push(
            called(&table.name, &nodes),
            table.set.span(),
            MultiPointConstraint::RigidBody { nodes, displacement, rotation },
            &table.history,
        )?;
    }
    for table in tables.periodic.iter().map(Located::get_ref) {
        let (from, to) = (sets.node_set(document, &table.from)?, sets.node_set(document, &table.to)?);
        push(
            called(&table.name, &from),
            table.from.span(),
            MultiPointConstraint::Periodic { from, to, jump: by_axis(table.jump) },
            &table.history,
        )?;
    }
    for (place, table) in tables.sum.iter().map(|table| (table.span(), table.get_ref())) {
        let mut terms = Vec::new();
        for term in &table.terms {
            let nodes = sets.node_set(document, &term.set)?;
            terms.push(ConstraintTerm { nodes, axis: term.component, coefficient: term.coefficient });
        }
        let sum = MultiPointConstraint::Sum { terms, value: table.value };
        push(table.name.clone(), place, sum, &table.history)?;
    }
    Ok(found)
}

fn by_axis(components: Components) -> [Option<f64>; 3] {
    components.by_axis().map(|(_, component)| component)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scene;
    use macro_solver::problem::Axis;
    use std::path::Path;

    /// The constraints of a block with one more table.
    fn constraints(table: &str) -> Vec<MultiPointConstraint> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/biaxial-small.toml");
        let scene = Scene::load(&path, &[table.to_owned()]).unwrap();
        let conditions = scene.problem.stages[0].conditions.iter();
        let linked = conditions.filter_map(|applied| match &applied.condition {
            Condition::MultiPointConstraint(constraint) => Some(constraint.clone()),
            _ => None,
        });
        linked.collect()
    }

    #[test]
    fn every_table_becomes_its_constraint() {
        let right = || "right".to_owned();
        let terms = vec![
            ConstraintTerm { nodes: right(), axis: Axis::X, coefficient: 2.0 },
            ConstraintTerm { nodes: "left".to_owned(), axis: Axis::X, coefficient: -1.0 },
        ];
        let (displacement, rotation) = (Some(1e-3), [None; 3]);
        for (table, constraint) in [
            (
                "normal_displacement=[{ set = 'right', displacement = 1e-3 }]",
                MultiPointConstraint::Guided { along: Directions::Normal { sides: right() }, displacement: 1e-3 },
            ),
            (
                "radial_displacement=[{ set = 'right', displacement = 1e-3, centre = [0.1, 0.2] }]",
                MultiPointConstraint::Guided {
                    along: Directions::Radial { nodes: right(), centre: [0.1, 0.2] },
                    displacement: 1e-3,
                },
            ),
            (
                "tilting_platen=[{ set = 'right', normal = 'x', displacement = 1e-3 }]",
                MultiPointConstraint::TiltingPlaten { nodes: right(), axis: Axis::X, displacement, rotation },
            ),
            (
                "rigid_body=[{ set = 'bottom_right', displacement = { x = 1e-3 } }]",
                MultiPointConstraint::RigidBody {
                    nodes: "bottom_right".to_owned(),
                    displacement: [displacement, None, None],
                    rotation,
                },
            ),
            (
                "periodic=[{ from = 'left', to = 'right', jump = { x = 1e-3 } }]",
                MultiPointConstraint::Periodic {
                    from: "left".to_owned(),
                    to: right(),
                    jump: [displacement, None, None],
                },
            ),
            (
                "sum=[{ name = 'a', terms = [{ set = 'right', component = 'x', coefficient = 2.0 }, \
                 { set = 'left', component = 'x', coefficient = -1.0 }], value = 1e-3 }]",
                MultiPointConstraint::Sum { terms, value: 1e-3 },
            ),
        ] {
            assert_eq!(constraints(table), [constraint], "{table}");
        }
    }
}
