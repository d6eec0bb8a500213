//! The keys of `[output]`: what is recorded.

use super::document::Document;
use super::input_error::InputError;
use super::tables::{Observable, OutputTable};
use keys::Located;
use macro_solver::output::Probe;
use protocol::Observables;

/// Optional results that every point is asked for.
///
/// # Errors
/// A probe needs one that is left out.
pub(super) fn observables(
    document: &Document,
    table: &OutputTable,
    probes: &[Probe],
) -> Result<Observables, InputError> {
    let observables = table.observables.iter().fold(Observables::NONE, |all, keyword| {
        all.union(match keyword {
            Observable::Rotation => Observables::ROTATION,
            Observable::CoordinationNoRattlers => Observables::COORDINATION_NO_RATTLERS,
            Observable::Fabric => Observables::FABRIC,
            Observable::SlidingFraction => Observables::SLIDING_FRACTION,
            Observable::Energy => Observables::ENERGY,
        })
    });
    match probes.iter().find(|probe| probe.quantity.needs_energy()) {
        Some(probe) if !observables.contains(Observables::ENERGY) => Err(document
            .error(format!("the probe '{}' needs energies, which output.observables leaves out", probe.name))
            .hint("add \"energy\" to output.observables")),
        _ => Ok(observables),
    }
}

/// Gauss points whose grains are written, ascending.
///
/// # Errors
/// There is no such point.
pub(super) fn grains(document: &Document, table: &OutputTable, points: usize) -> Result<Vec<usize>, InputError> {
    let mut grains = Vec::new();
    for point in &table.grains {
        if *point.get_ref() >= points {
            return Err(document
                .error_at(point.span(), format!("there is no Gauss point {}", point.get_ref()))
                .hint(format!("the mesh has the points 0 to {}", points - 1)));
        }
        grains.push(*point.get_ref());
    }
    grains.sort_unstable();
    grains.dedup();
    Ok(grains)
}

/// Axes of the plot: as asked, else the first strain-like probe against the first stress-like one.
///
/// # Errors
/// There is no such column.
pub(super) fn plot(
    document: &Document,
    table: &OutputTable,
    probes: &[Probe],
    stages: usize,
) -> Result<Option<(String, String)>, InputError> {
    // The load factor begins again with every stage.
    let progress = if stages > 1 { "time" } else { "load" };
    let column = |given: &Option<Located<String>>, otherwise: usize, fallback: &str| match given {
        None => Ok(probes.get(otherwise).map_or(fallback.to_owned(), |probe| probe.name.clone())),
        Some(name) if ["time", "load"].contains(&name.get_ref().as_str()) => Ok(name.get_ref().clone()),
        Some(name) if probes.iter().any(|probe| probe.name == *name.get_ref()) => Ok(name.get_ref().clone()),
        Some(name) => Err(document
            .error_at(name.span(), format!("there is no column '{}' to plot", name.get_ref()))
            .hint("name a probe, \"time\" or \"load\"")),
    };
    let (x, y) = match probes.len() {
        1 => (column(&table.plot_x, 1, progress)?, column(&table.plot_y, 0, progress)?),
        _ => (column(&table.plot_x, 0, progress)?, column(&table.plot_y, 1, progress)?),
    };
    Ok((table.plot && !probes.is_empty()).then_some((x, y)))
}
