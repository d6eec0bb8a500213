//! When a cell counts as being in equilibrium: three measures from the literature, by name.

use crate::definition::Criterion;
use crate::lanes::{StepSums, Wanted};

/// Steps in a row that the energy criterion must hold: the motion has no kinetic energy at a turning point either.
pub(crate) const ENERGY_HITS: u32 = 10;

/// The sums that a criterion needs beyond the usual ones.
pub(crate) fn wanted_by(criterion: Criterion) -> Wanted {
    Wanted {
        contact_force_square: criterion == Criterion::RmsForce,
        elastic_energy: criterion == Criterion::Energy,
        ..Wanted::default()
    }
}

/// Value of a criterion; 0 without contacts, because then nothing is out of balance. `mass` is the cell's.
pub(crate) fn unbalanced(criterion: Criterion, grains: usize, mass: f64, sums: &StepSums<f64>) -> f64 {
    if sums.contacts == 0.0 {
        return 0.0;
    }
    let (measure, scale) = match criterion {
        Criterion::MaxForce => (sums.largest_force_square.sqrt(), sums.normal_force / sums.contacts),
        Criterion::RmsForce => {
            ((sums.force_square / grains as f64).sqrt(), (sums.contact_force_square / sums.contacts).sqrt())
        }
        Criterion::Energy => (0.5 * mass * sums.motion_square, sums.elastic_energy),
    };
    if measure == 0.0 { 0.0 } else { measure / scale.abs() }
}
