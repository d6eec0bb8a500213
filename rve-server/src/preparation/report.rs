//! The acceptance report: requirements against the values reached, measured on the packing as written.

use super::compaction::{packing_error, rows};
use super::friction_search::FrictionAttempt;
use super::preshear::{ShearAttempt, anisotropy_of};
use super::recipe::{PackingRecipe, StateQuantity};
use super::stress_target::{Matrix, StressTarget, symmetric, symmetric_pairs};
use crate::contact::{ContactTable, Rotations};
use crate::definition::{GrainDefinition, PackingError, PackingFile, RveOptions};
use crate::engine::GrainRve;
use crate::homogenization::fabric::LARGE_OVERLAP_RATIO;
use crate::solver::SolverFor;
use protocol::Observables;
use serde::Serialize;

/// Turning a packing into the axes of its file and wrapping its grains moves them by rounding; the forces follow.
const ROUNDING: f64 = 1e-7;

/// Attempts of the searches of a preparation; the last one was accepted.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Searches {
    /// Preparation frictions and what they gave.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub friction: Vec<FrictionAttempt>,
    /// Shear strains and what they gave.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub shear: Vec<ShearAttempt>,
}

/// One requirement.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Requirement {
    /// Quantity.
    pub quantity: String,
    /// Value requested.
    #[serde(rename = "asked")]
    pub requested: f64,
    /// Value of the packing.
    pub got: f64,
    /// Largest accepted difference, same unit.
    pub tolerance: f64,
}

impl Requirement {
    /// Whether the packing has what was requested.
    pub fn is_met(&self) -> bool {
        (self.got - self.requested).abs() <= self.tolerance
    }
}

/// Properties of a finished packing, measured on the packing as written.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PackingReport {
    /// 2 for discs, 3 for spheres.
    pub dimension: usize,
    /// Number of grains.
    pub grains: usize,
    /// Stress, Pa, tension positive.
    pub stress: [[f64; 3]; 3],
    /// Void volume over grain volume.
    pub void_ratio: f64,
    /// Void volume over cell volume.
    pub porosity: f64,
    /// 2 x contacts over grains.
    pub coordination_number: f64,
    /// The same without rattlers.
    pub coordination_number_no_rattlers: f64,
    /// Contact fabric, mean of n x n.
    pub fabric: [[f64; 3]; 3],
    /// Major over minor principal fabric, minus 1.
    pub fabric_anisotropy: f64,
    /// Largest deviation of a stress component from the target over the target pressure.
    pub stress_error: f64,
    /// Unbalanced force over mean normal force.
    pub unbalanced_force_ratio: f64,
    /// Largest overlap over grain diameter.
    pub max_overlap_ratio: f64,
    /// Friction under which the packing is at rest.
    pub friction: f64,
    /// The searches.
    pub searches: Searches,
    /// Asked against got.
    pub requirements: Vec<Requirement>,
    /// DEM steps spent on all packings that were made.
    pub force_evaluations: u64,
}

impl PackingReport {
    /// Refuses a packing that misses what was requested.
    ///
    /// # Errors
    /// [`PackingError::Content`] naming what is missed and by how much.
    pub fn refuse_misses(&self) -> Result<(), PackingError> {
        let missed: Vec<String> = self
            .requirements
            .iter()
            .filter(|requirement| !requirement.is_met())
            .map(|missed| {
                format!(
                    "{} is {:e} instead of {:e} +- {:e}",
                    missed.quantity, missed.got, missed.requested, missed.tolerance
                )
            })
            .collect();
        if missed.is_empty() { Ok(()) } else { Err(PackingError::Content(missed.join("; "))) }
    }
}

/// Measures a packing as a user of the file would find it.
///
/// # Errors
/// [`PackingError::Content`] if the packing cannot be read as a cell.
pub(crate) fn measured<S: SolverFor>(
    recipe: &PackingRecipe,
    target: &StressTarget,
    packing: &PackingFile<S>,
    contact: &ContactTable,
    searches: Searches,
    force_evaluations: u64,
) -> Result<PackingReport, PackingError> {
    let definition =
        GrainDefinition { packing: packing.clone(), contact: contact.clone(), options: RveOptions::default() };
    let mut cell = GrainRve::<S>::new(&definition).map_err(packing_error)?;
    let answer = cell.observe(Observables::ALL).map_err(packing_error)?;
    let (stress, fabric) = (rows(&answer.stress), rows(&answer.observed.fabric));
    let mut report = PackingReport {
        dimension: target.dimension,
        grains: packing.grains.len(),
        stress,
        void_ratio: answer.scalars.void_ratio,
        porosity: answer.scalars.void_ratio / (1.0 + answer.scalars.void_ratio),
        coordination_number: answer.scalars.coordination_number,
        coordination_number_no_rattlers: answer.observed.coordination_number_no_rattlers,
        fabric,
        fabric_anisotropy: anisotropy_of_fabric(&fabric, target.dimension),
        // Grains that may not turn bear couples, which are no part of the target.
        stress_error: match contact.rotations {
            Rotations::Blocked => stress_error(&symmetric(&stress), target),
            _ => stress_error(&stress, target),
        },
        unbalanced_force_ratio: answer.scalars.unbalanced_force_ratio,
        max_overlap_ratio: answer.scalars.max_overlap_ratio,
        friction: contact.friction,
        searches,
        requirements: Vec::new(),
        force_evaluations,
    };
    report.requirements = requirements(recipe, target, &report)?;
    Ok(report)
}

fn requirements(
    recipe: &PackingRecipe,
    target: &StressTarget,
    report: &PackingReport,
) -> Result<Vec<Requirement>, PackingError> {
    let mut list = Vec::new();
    let mut ask = |quantity: String, requested: f64, got: f64, tolerance: f64| {
        list.push(Requirement { quantity, requested, got, tolerance });
    };
    for &(i, j) in symmetric_pairs(target.dimension) {
        let tolerance = (recipe.stress_tolerance + ROUNDING) * target.pressure;
        let got = 0.5 * (report.stress[i][j] + report.stress[j][i]);
        ask(format!("stress_{}{}, Pa", i + 1, j + 1), target.component(i, j), got, tolerance);
    }
    ask("unbalanced_force_ratio".into(), 0.0, report.unbalanced_force_ratio, recipe.tolerance + ROUNDING);
    ask("max_overlap_ratio".into(), 0.0, report.max_overlap_ratio, LARGE_OVERLAP_RATIO);
    // A density or an anisotropy is that of the packing before grains are taken out, a density that before the shear of the anisotropy.
    if recipe.removal.is_none() {
        if let Some(state) = &recipe.target {
            let (quantity, requested) = state.quantity()?;
            let before = report.searches.friction.last().filter(|_| recipe.anisotropy.is_some());
            match before {
                Some(found) => {
                    ask(format!("{} before the shear", quantity.keyword()), requested, found.value, state.tolerance);
                }
                None => ask(quantity.keyword().into(), requested, value_of(report, quantity), state.tolerance),
            }
        }
        if let Some(anisotropy) = &recipe.anisotropy {
            ask("fabric_anisotropy".into(), anisotropy.value, report.fabric_anisotropy, anisotropy.tolerance);
        }
    }
    if let Some((deviation, tolerance)) = recipe.grading.sieve_deviation(&recipe.radii(), recipe.dimension) {
        // As a density, it is that of the grains before some are taken out.
        let when = if recipe.removal.is_some() { " before grains were taken out" } else { "" };
        ask(format!("sieve curve{when}, largest deviation"), 0.0, deviation, tolerance);
    }
    Ok(list)
}

fn stress_error(stress: &Matrix, target: &StressTarget) -> f64 {
    let mut largest = 0.0f64;
    for (i, row) in stress.iter().enumerate().take(target.dimension) {
        for (j, value) in row.iter().enumerate().take(target.dimension) {
            largest = largest.max((value - target.component(i, j)).abs());
        }
    }
    largest / target.pressure
}

/// Major over minor principal value of a contact fabric, minus 1.
pub(crate) fn anisotropy_of_fabric(fabric: &Matrix, dimension: usize) -> f64 {
    anisotropy_of(&without_mean(fabric, dimension), dimension)
}

fn without_mean(fabric: &Matrix, dimension: usize) -> Matrix {
    let mean = (0..dimension).map(|i| fabric[i][i]).sum::<f64>() / dimension as f64;
    let mut deviator = *fabric;
    for (i, row) in deviator.iter_mut().enumerate().take(dimension) {
        row[i] -= mean;
    }
    deviator
}

/// The value of a named quantity.
pub(crate) fn value_of(report: &PackingReport, quantity: StateQuantity) -> f64 {
    match quantity {
        StateQuantity::VoidRatio => report.void_ratio,
        StateQuantity::Porosity => report.porosity,
        StateQuantity::CoordinationNumber => report.coordination_number,
        StateQuantity::CoordinationNumberNoRattlers => report.coordination_number_no_rattlers,
    }
}
