//! Options of trials by name, and their results as byte arrays.

use crate::arrays::{bytes, components, operator};
use protocol::keyword::UnknownKeyword;
use protocol::{MOST_RAMP_STEPS, Observables, TangentKind, Tensor2, TrialOptions, TrialResult};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Observables that are computed on request, by the names that Python uses.
const OBSERVABLES: [(&str, Observables); 6] = [
    ("first_piola", Observables::FIRST_PIOLA),
    ("coordination_number_no_rattlers", Observables::COORDINATION_NO_RATTLERS),
    ("fabric", Observables::FABRIC),
    ("sliding_fraction", Observables::SLIDING_FRACTION),
    ("energy", Observables::ENERGY),
    ("rotation", Observables::ROTATION),
];

/// Keywords of the tangent operators.
#[pyfunction]
pub(crate) fn tangent_names() -> Vec<&'static str> {
    TangentKind::ALL.map(TangentKind::keyword).to_vec()
}

/// Names of the observables that are computed on request.
#[pyfunction]
pub(crate) fn observable_names() -> Vec<&'static str> {
    OBSERVABLES.map(|(name, _)| name).to_vec()
}

/// The tangent operator of a keyword.
///
/// # Errors
/// `ValueError` with all keywords.
pub(crate) fn tangent_kind(name: &str) -> PyResult<TangentKind> {
    name.parse().map_err(|unknown: UnknownKeyword| {
        PyValueError::new_err(format!("tangent {name:?} is unknown; choose one of {}", unknown.choices))
    })
}

/// Options of a trial from names.
///
/// # Errors
/// `ValueError` for an unknown name.
pub(crate) fn options(tangent: &str, observables: &[String], ramp_steps: u32) -> PyResult<TrialOptions> {
    let mut wanted = Observables::NONE;
    for name in observables {
        let found = OBSERVABLES.iter().find(|(known, _)| known == name);
        let (_, one) = found.ok_or_else(|| {
            let known = observable_names().join(", ");
            PyValueError::new_err(format!("observable {name:?} is unknown; choose from {known}"))
        })?;
        wanted = wanted.union(*one);
    }
    if ramp_steps > MOST_RAMP_STEPS {
        return Err(PyValueError::new_err(format!(
            "ramp_steps = {ramp_steps}: at most {MOST_RAMP_STEPS}; 0 lets the cell choose"
        )));
    }
    Ok(TrialOptions { tangent: tangent_kind(tangent)?, ramp_steps, observables: wanted, ..TrialOptions::default() })
}

/// Results as a dictionary of byte arrays, one entry of each array per result: `float64` unless the name is `flags`
/// (`uint32`), `force_evaluations` or `nanoseconds` (`uint64`).
pub(crate) fn dictionary<'py>(
    py: Python<'py>,
    results: &[TrialResult],
    options: &TrialOptions,
    dimension: usize,
) -> PyResult<Bound<'py, PyDict>> {
    let found = PyDict::new(py);
    let tensors = |of: fn(&TrialResult) -> &Tensor2| {
        bytes(py, results.iter().flat_map(|result| components(of(result), dimension)).map(f64::to_ne_bytes))
    };
    let scalars = |of: fn(&TrialResult) -> f64| bytes(py, results.iter().map(|result| of(result).to_ne_bytes()));
    found.set_item("stress", tensors(|result| &result.stress))?;
    if options.tangent != TangentKind::None {
        let all = results.iter().filter_map(|result| result.tangent.as_deref());
        found.set_item("tangent", bytes(py, all.flat_map(|one| operator(one, dimension)).map(f64::to_ne_bytes)))?;
    }
    found.set_item("void_ratio", scalars(|result| result.scalars.void_ratio))?;
    found.set_item("coordination_number", scalars(|result| result.scalars.coordination_number))?;
    found.set_item("unbalanced_force_ratio", scalars(|result| result.scalars.unbalanced_force_ratio))?;
    found.set_item("max_overlap_ratio", scalars(|result| result.scalars.max_overlap_ratio))?;
    found.set_item("volume_ratio", scalars(|result| result.scalars.volume_ratio))?;
    found.set_item("flags", bytes(py, results.iter().map(|result| result.flags.0.to_ne_bytes())))?;
    let counts = |of: fn(&TrialResult) -> u64| bytes(py, results.iter().map(|result| of(result).to_ne_bytes()));
    found.set_item("force_evaluations", counts(|result| result.cost.force_evaluations))?;
    found.set_item("ramp_steps", counts(|result| result.cost.ramp_steps))?;
    found
        .set_item("nanoseconds", counts(|result| result.cost.solve_nanoseconds + result.cost.tangent_nanoseconds))?;
    let wanted = |one| options.observables.contains(one);
    if wanted(Observables::FIRST_PIOLA) {
        found.set_item("first_piola", tensors(|result| &result.observed.first_piola))?;
    }
    if wanted(Observables::FABRIC) {
        found.set_item("fabric", tensors(|result| &result.observed.fabric))?;
        found.set_item("fabric_anisotropy", scalars(|result| result.observed.fabric_anisotropy))?;
    }
    if wanted(Observables::COORDINATION_NO_RATTLERS) {
        let name = "coordination_number_no_rattlers";
        found.set_item(name, scalars(|result| result.observed.coordination_number_no_rattlers))?;
    }
    if wanted(Observables::SLIDING_FRACTION) {
        found.set_item("sliding_fraction", scalars(|result| result.observed.sliding_fraction))?;
    }
    if wanted(Observables::ENERGY) {
        found.set_item("elastic_energy", scalars(|result| result.observed.elastic_energy))?;
        found.set_item("frictional_dissipation", scalars(|result| result.observed.frictional_dissipation))?;
        found.set_item("damping_work", scalars(|result| result.observed.damping_work))?;
    }
    if wanted(Observables::ROTATION) {
        let all = results.iter().flat_map(|result| result.observed.mean_rotation);
        found.set_item("mean_rotation", bytes(py, all.map(f64::to_ne_bytes)))?;
    }
    Ok(found)
}
