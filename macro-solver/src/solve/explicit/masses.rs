//! Masses of the elements and of the nodes, with what was added for a larger step.

use crate::element::mass::lumped_masses;
use crate::model::body::Body;
use crate::model::stable_step::ElementLimits;
use crate::problem::ProblemError;
use crate::problem::dynamics::{DynamicSettings, MassScaling, TimeStepRule};

/// Lumped masses of the nodes of every element, kg, in the plane per metre of thickness.
///
/// # Errors
/// A kind of element that the lumping does not suit.
pub(super) fn element_masses(body: &Body, settings: &DynamicSettings) -> Result<Vec<Vec<f64>>, ProblemError> {
    let mesh = body.mesh();
    (0..mesh.elements.len())
        .map(|element| {
            let positions = mesh.element_positions(element);
            Ok(lumped_masses(mesh.kinds[element], &positions, settings.density_of(element), settings.lumping)?)
        })
        .collect()
}

/// Factor on the masses of every element.
pub(super) fn scale_factors(settings: &DynamicSettings, limits: &[ElementLimits]) -> Vec<f64> {
    let safety = match settings.step {
        TimeStepRule::Stable { safety } => safety,
        TimeStepRule::Fixed { .. } => 1.0,
    };
    let factor = |limits: &ElementLimits| match settings.mass_scaling {
        MassScaling::None => 1.0,
        MassScaling::Uniform { factor } => factor,
        MassScaling::ToStep { step } => limits.factor_for(step / safety).max(1.0),
    };
    limits.iter().map(factor).collect()
}

/// Mass of every node, kg, and the sum of the added mass.
pub(super) fn nodal_masses(body: &Body, masses: &[Vec<f64>], factors: &[f64]) -> (Vec<f64>, f64) {
    let mesh = body.mesh();
    let mut nodal = vec![0.0; mesh.nodes.len()];
    let mut added = 0.0;
    for ((nodes, masses), factor) in mesh.elements.iter().zip(masses).zip(factors) {
        for (&node, mass) in nodes.iter().zip(masses) {
            nodal[node] += factor * mass;
            added += (factor - 1.0) * mass;
        }
    }
    (nodal, added)
}
