//! `[[tilting_platen]]`, `[[normal_displacement]]`, `[[radial_displacement]]`, `[[rigid_body]]`, `[[periodic]]` and `[[sum]]`: displacements that are tied to one another.

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

/// Names and conditions of all of them.
///
/// # Errors
/// A set that does not exist, or a history that is not usable.
pub(super) fn multi_point_constraints(
    document: &Document,
    sets: &Sets<'_>,
    tables: &ConstraintTables<'_>,
) -> Result<Vec<(String, Applied)>, InputError> {
    let mut found = Vec::new();
    let mut push = |name: String, constraint, given: &Option<Located<History>>| {
        let history = history(document, given, Amplitude::RAMP)?;
        found.push((name, Applied::new(Condition::MultiPointConstraint(constraint), history)));
        Ok(())
    };
    let called = |name: &Option<String>, set: &str| name.clone().unwrap_or_else(|| set.to_owned());
    for table in tables.tilting_platen.iter().map(Located::get_ref) {
        let nodes = sets.node_set(document, &table.set)?;
        let (axis, displacement, rotation) = (table.normal, table.displacement, by_axis(table.rotation));
        push(
            called(&table.name, &nodes),
            MultiPointConstraint::TiltingPlaten { nodes, axis, displacement, rotation },
            &table.history,
        )?;
    }
    for table in tables.normal_displacement.iter().map(Located::get_ref) {
        let sides = sets.side_set(document, &table.set)?;
        let (name, displacement) = (called(&table.name, &sides), table.displacement);
        let along = Directions::Normal { sides };
        push(name, MultiPointConstraint::Guided { along, displacement }, &table.history)?;
    }
    for table in tables.radial_displacement.iter().map(Located::get_ref) {
        let nodes = sets.node_set(document, &table.set)?;
        let (name, displacement) = (called(&table.name, &nodes), table.displacement);
        let along = Directions::Radial { nodes, centre: table.centre };
        push(name, MultiPointConstraint::Guided { along, displacement }, &table.history)?;
    }
    for table in tables.rigid_body.iter().map(Located::get_ref) {
        let nodes = sets.node_set(document, &table.set)?;
        let (displacement, rotation) = (by_axis(table.displacement), by_axis(table.rotation));
        push(
            called(&table.name, &nodes),
            MultiPointConstraint::RigidBody { nodes, displacement, rotation },
            &table.history,
        )?;
    }
    for table in tables.periodic.iter().map(Located::get_ref) {
        let (from, to) = (sets.node_set(document, &table.from)?, sets.node_set(document, &table.to)?);
        push(
            called(&table.name, &from),
            MultiPointConstraint::Periodic { from, to, jump: by_axis(table.jump) },
            &table.history,
        )?;
    }
    for table in tables.sum.iter().map(Located::get_ref) {
        let mut terms = Vec::new();
        for term in &table.terms {
            let nodes = sets.node_set(document, &term.set)?;
            terms.push(ConstraintTerm { nodes, axis: term.component, coefficient: term.coefficient });
        }
        push(table.name.clone(), MultiPointConstraint::Sum { terms, value: table.value }, &table.history)?;
    }
    Ok(found)
}

fn by_axis(components: Components) -> [Option<f64>; 3] {
    components.by_axis().map(|(_, component)| component)
}
