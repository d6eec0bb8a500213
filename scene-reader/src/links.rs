//! `[[tilting_platen]]`, `[[rigid_body]]`, `[[periodic]]` and `[[sum]]`: displacements that are tied to one another.

use super::conditions::history;
use super::document::Document;
use super::input_error::InputError;
use super::schema::{
    AxisKeyword, Components, HistoryTable, PeriodicTable, RigidBodyTable, SumTable, TiltingPlatenTable,
};
use super::sets::Sets;
use macro_solver::problem::{Amplitude, Applied, Axis, Condition, Link, LinkTerm};
use toml::Spanned;

/// The tables of one place.
#[derive(Clone, Copy)]
pub(super) struct LinkTables<'a> {
    pub(super) tilting_platen: &'a [Spanned<TiltingPlatenTable>],
    pub(super) rigid_body: &'a [Spanned<RigidBodyTable>],
    pub(super) periodic: &'a [Spanned<PeriodicTable>],
    pub(super) sum: &'a [Spanned<SumTable>],
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
    let mut push = |name: String, link, given: &Option<Spanned<HistoryTable>>| {
        let history = history(document, given, Amplitude::RAMP)?;
        found.push((name, Applied::new(Condition::Linked(link), history)));
        Ok(())
    };
    let called = |name: &Option<Spanned<String>>, set: &str| {
        name.as_ref().map_or_else(|| set.to_owned(), |name| name.get_ref().clone())
    };
    for table in tables.tilting_platen.iter().map(Spanned::get_ref) {
        let nodes = sets.node_set(document, &table.set)?;
        let (axis, displacement) = (axis(table.normal), table.displacement);
        push(called(&table.name, &nodes), Link::TiltingPlaten { nodes, axis, displacement }, &table.history)?;
    }
    for table in tables.rigid_body.iter().map(Spanned::get_ref) {
        let nodes = sets.node_set(document, &table.set)?;
        let (displacement, rotation) = (by_axis(table.displacement), by_axis(table.rotation));
        push(called(&table.name, &nodes), Link::RigidBody { nodes, displacement, rotation }, &table.history)?;
    }
    for table in tables.periodic.iter().map(Spanned::get_ref) {
        let (from, to) = (sets.node_set(document, &table.from)?, sets.node_set(document, &table.to)?);
        push(called(&table.name, &from), Link::Periodic { from, to, jump: by_axis(table.jump) }, &table.history)?;
    }
    for table in tables.sum.iter().map(Spanned::get_ref) {
        let mut terms = Vec::new();
        for term in &table.terms {
            let nodes = sets.node_set(document, &term.set)?;
            terms.push(LinkTerm { nodes, axis: axis(term.component), coefficient: term.coefficient });
        }
        push(table.name.clone(), Link::Sum { terms, value: table.value }, &table.history)?;
    }
    Ok(found)
}

fn by_axis(components: Components) -> [Option<f64>; 3] {
    components.by_axis().map(|(_, component)| component)
}

fn axis(keyword: AxisKeyword) -> Axis {
    match keyword {
        AxisKeyword::X => Axis::X,
        AxisKeyword::Y => Axis::Y,
        AxisKeyword::Z => Axis::Z,
    }
}
