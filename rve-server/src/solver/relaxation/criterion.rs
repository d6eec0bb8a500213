//! When a cell counts as being in equilibrium: three measures from the literature, by name.

use crate::definition::Criterion;
use crate::solver::kernel::{StepSums, Wanted};
use protocol::TrialResult;

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

/// Share of the largest load that a cell has carried at rest below which its forces are measured by that share, no longer by
/// themselves. A cell that has come apart keeps grains that graze each other; their forces die away together with their
/// mean, so that no ratio of the two ever says that the cell is at rest. What is left out of balance is at most this share times
/// the tolerance times the force that a contact once had.
pub(crate) const LEAST_LOAD: f64 = 1e-3;

/// Share of the largest load that is rounding, whatever its balance.
const ROUNDING_LOAD: f64 = 1e-9;

/// Out-of-balance ratio from which a cell is far from rest.
const FAR_FROM_REST: f64 = 0.05;

/// Fewest contacts per grain, each counted at both ends and rattlers left out, of a cell that can come to rest: less holds nothing together.
const HELD_TOGETHER: f64 = 2.0;

/// Whether the state that an answer with all observables describes holds together, but is far from the equilibrium that a trial with this
/// tolerance finds.
pub(crate) fn holds_together_far_from_rest(answer: &TrialResult, tolerance: f64) -> bool {
    let unbalanced = answer.scalars.unbalanced_force_ratio;
    unbalanced.is_finite()
        && unbalanced > FAR_FROM_REST.max(2.0 * tolerance)
        && answer.observed.coordination_number_no_rattlers >= HELD_TOGETHER
}

/// How far a cell is from rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Imbalance {
    /// Imbalance: a force, N, or an energy, J, by criterion.
    pub(crate) measure: f64,
    /// The same over what the cell carries now; 0 without contacts, because then nothing is out of balance.
    pub(crate) of_present: f64,
    /// The same over the larger of what the cell carries now and [`LEAST_LOAD`] of what it once carried: the criterion.
    pub(crate) ratio: f64,
}

impl Imbalance {
    /// By a criterion. `mass` is the cell's, 0 before it has made a step, `largest_load` the largest sum of its normal forces at rest, N.
    ///
    /// Where nothing has moved yet there is no kinetic energy, whatever the forces: they are measured in place of it.
    pub(crate) fn by(
        criterion: Criterion,
        grains: usize,
        mass: f64,
        sums: &StepSums<f64>,
        largest_load: f64,
    ) -> Self {
        if sums.contacts == 0.0 {
            return Self { measure: 0.0, of_present: 0.0, ratio: 0.0 };
        }
        let criterion = if criterion == Criterion::Energy && mass == 0.0 { Criterion::MaxForce } else { criterion };
        let least_force = LEAST_LOAD * largest_load / grains as f64;
        let (measure, scale) = match criterion {
            Criterion::MaxForce => (sums.largest_force_square.sqrt(), sums.normal_force / sums.contacts),
            Criterion::RmsForce => {
                ((sums.force_square / grains as f64).sqrt(), (sums.contact_force_square / sums.contacts).sqrt())
            }
            Criterion::Energy => (0.5 * mass * sums.motion_square, sums.elastic_energy),
        };
        let over = |measure: f64, scale: f64| if measure == 0.0 { 0.0 } else { measure / scale.abs() };
        let of_present = over(measure, scale);
        let ratio = if criterion != Criterion::Energy {
            over(measure, scale.abs().max(least_force))
        } else if sums.normal_force < LEAST_LOAD * largest_load {
            // Nothing remembers the energy that the load once stored. The criterion is quadratic in the forces.
            of_present.min(over(sums.largest_force_square, least_force * least_force))
        } else {
            of_present
        };
        Self { measure, of_present, ratio }
    }

    /// Of forces, as a measure of energy: that is quadratic in them.
    pub(crate) fn squared(self) -> Self {
        let square = |value: f64| value * value;
        Self { measure: square(self.measure), of_present: square(self.of_present), ratio: square(self.ratio) }
    }

    /// Whether a cell that carries `load` and is at rest bears it: forces that are small by what the cell once carried and in
    /// no balance with each other are on their way to nothing.
    pub(crate) fn bears(&self, load: f64, largest_load: f64, tolerance: f64) -> bool {
        let is_small = load < LEAST_LOAD * largest_load;
        load > ROUNDING_LOAD * largest_load && !(is_small && self.of_present > tolerance)
    }
}
