//! The keys of `[output]`: what is recorded.

use super::document::Document;
use super::input_error::InputError;
use super::tables::{Observable, OutputTable};
use keys::Located;
use macro_solver::output::{Probe, Profile};
use protocol::Observables;

/// Optional results that every point is asked for.
///
/// # Errors
/// A probe or profile needs one that is left out.
pub(super) fn observables(
    document: &Document,
    table: &OutputTable,
    probes: &[Probe],
    profiles: &[Profile],
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
    let of_probes = probes.iter().map(|probe| ("probe", &probe.name, probe.quantity.needs()));
    let of_profiles = profiles.iter().map(|profile| ("profile", &profile.name, profile.probe.measure.needs()));
    for (what, name, needs) in of_probes.chain(of_profiles) {
        if !observables.contains(needs) {
            let keyword = keyword(needs);
            return Err(document
                .error(format!("the {what} '{name}' needs \"{keyword}\", which output.observables leaves out"))
                .hint(format!("add \"{keyword}\" to output.observables")));
        }
    }
    Ok(observables)
}

/// The word for one optional result.
fn keyword(observable: Observables) -> &'static str {
    match observable {
        Observables::ROTATION => "rotation",
        Observables::COORDINATION_NO_RATTLERS => "coordination_no_rattlers",
        Observables::FABRIC => "fabric",
        Observables::SLIDING_FRACTION => "sliding_fraction",
        _ => "energy",
    }
}

/// Chosen Gauss points, ascending.
///
/// # Errors
/// There is no such point.
pub(super) fn points(
    document: &Document,
    written: &[Located<usize>],
    count: usize,
) -> Result<Vec<usize>, InputError> {
    let mut points = Vec::new();
    for point in written {
        if *point.get_ref() >= count {
            return Err(document
                .error_at(point.span(), format!("there is no Gauss point {}", point.get_ref()))
                .hint(format!("the mesh has the points 0 to {}", count - 1)));
        }
        points.push(*point.get_ref());
    }
    points.sort_unstable();
    points.dedup();
    Ok(points)
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
