//! `[[tilting_platen]]`, `[[rigid_body]]`, `[[periodic]]` and `[[sum]]`: displacements that are tied to one another.

use super::conditions::history;
use super::document::Document;
use super::input_error::InputError;
use super::sets::Sets;
use super::tables::{Components, History, PeriodicTable, RigidBodyTable, SumTable, TiltingPlatenTable};
use keys::Located;
use macro_solver::problem::{Amplitude, Applied, Condition, Link, LinkTerm};

/// The tables of one place.
#[derive(Clone, Copy)]
pub(super) struct LinkTables<'a> {
    pub(super) tilting_platen: &'a [Located<TiltingPlatenTable>],
    pub(super) rigid_body: &'a [Located<RigidBodyTable>],
    pub(super) periodic: &'a [Located<PeriodicTable>],
    pub(super) sum: &'a [Located<SumTable>],
}

/// Names and conditions of all links.
///
/// # Errors
/// A set that does not exist, or a history that is not usable.
pub(super) fn links(
    document: &Document,
    sets: &Sets<'_>,
    tables: &LinkTables<'_>,
) -> Result<Vec<(String, Applied)>, InputError> {
    let mut found = Vec::new();
    let mut push = |name: String, link, given: &Option<Located<History>>| {
        let history = history(document, given, Amplitude::RAMP)?;
        found.push((name, Applied::new(Condition::Linked(link), history)));
        Ok(())
    };
    let called = |name: &Option<String>, set: &str| name.clone().unwrap_or_else(|| set.to_owned());
    for table in tables.tilting_platen.iter().map(Located::get_ref) {
        let nodes = sets.node_set(document, &table.set)?;
        let (axis, displacement) = (table.normal, table.displacement);
        push(called(&table.name, &nodes), Link::TiltingPlaten { nodes, axis, displacement }, &table.history)?;
    }
    for table in tables.rigid_body.iter().map(Located::get_ref) {
        let nodes = sets.node_set(document, &table.set)?;
        let (displacement, rotation) = (by_axis(table.displacement), by_axis(table.rotation));
        push(called(&table.name, &nodes), Link::RigidBody { nodes, displacement, rotation }, &table.history)?;
    }
    for table in tables.periodic.iter().map(Located::get_ref) {
        let (from, to) = (sets.node_set(document, &table.from)?, sets.node_set(document, &table.to)?);
        push(called(&table.name, &from), Link::Periodic { from, to, jump: by_axis(table.jump) }, &table.history)?;
    }
    for table in tables.sum.iter().map(Located::get_ref) {
        let mut terms = Vec::new();
        for term in &table.terms {
            let nodes = sets.node_set(document, &term.set)?;
            terms.push(LinkTerm { nodes, axis: term.component, coefficient: term.coefficient });
        }
        push(table.name.clone(), Link::Sum { terms, value: table.value }, &table.history)?;
    }
    Ok(found)
}

fn by_axis(components: Components) -> [Option<f64>; 3] {
    components.by_axis().map(|(_, component)| component)
}
