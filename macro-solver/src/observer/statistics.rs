//! Counts and times of a run, and how often each shortcut of an answer was taken.

use super::accuracy::AccuracyFigures;
use super::trial_costs::TrialCosts;
use protocol::{Cost, TrialFlags};
use serde::{Deserialize, Serialize};

/// Counts and times of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Statistics {
    /// Accepted load steps, without the initial equilibrium, and reports of dynamic stages.
    pub steps: u64,
    /// Time steps of dynamic stages.
    #[serde(default)]
    pub time_steps: u64,
    /// Out-of-balance force of the initial stress over the reactions or loads, whichever is larger.
    pub initial_imbalance: f64,
    /// Largest deviation of the initial stress from what [`crate::problem::InitialState`] expects, over the largest
    /// component expected; 0 if nothing is expected.
    pub initial_deviation: f64,
    /// Largest norm of the reactions or of the loads in an accepted step, N, in the plane per metre: what forces are measured by when
    /// little is left of them.
    pub largest_forces: f64,
    /// Iterations of accepted and failed attempts.
    pub iterations: u64,
    /// Iterates rejected by the globalisation, and rejected increments of viscous stabilisation.
    pub rejected: u64,
    /// Point evaluations of these iterates.
    pub rejected_evaluations: u64,
    /// Iterates evaluated with frozen-network tangents, because those with slip had led away from balance.
    #[serde(default)]
    pub frozen_network_iterates: u64,
    /// Point evaluations.
    pub evaluations: u64,
    /// Point evaluations by point.
    pub evaluations_per_point: Vec<u64>,
    /// Point evaluations that were evaluated with a tangent operator.
    pub tangents: u64,
    /// Evaluations saved because a target had not changed in any bit.
    pub skipped: u64,
    /// Force evaluations of the replies that were kept instead.
    pub skipped_force_evaluations: u64,
    /// Evaluations saved because a step did not deform the point.
    pub still_points: u64,
    /// Failed attempts.
    pub cut_backs: u64,
    /// Point evaluations of attempts that were taken back.
    #[serde(default)]
    pub failed_evaluations: u64,
    /// Their force evaluations.
    #[serde(default)]
    pub failed_force_evaluations: u64,
    /// Steps in which nothing changed and the body stayed in balance as it was: not held to the displacement criterion.
    pub idle_steps: u64,
    /// Steps accepted although iterations had stopped to make progress, see [`crate::problem::Tolerances::stagnated_force`].
    pub stagnated_steps: u64,
    /// Largest out-of-balance force ratio of these steps.
    pub largest_stagnated_force_ratio: f64,
    /// Steps accepted in balance although their corrections were above the tolerance, as noise, see [`crate::problem::Tolerances::accept_noise`].
    pub steps_with_noisy_corrections: u64,
    /// Largest mean [level](crate::material::stress_level::stress_level) of the stresses in an accepted step of Newton's method, Pa.
    pub largest_pressure: f64,
    /// Largest out-of-balance force ratio of an accepted step, see [`StepReport::force_ratio`].
    pub largest_force_ratio: f64,
    /// Largest sum of the out-of-balance forces along an axis in an accepted step, over reactions and loads along it, at least over a
    /// fifth of the largest forces: what the reactions lack of the loads.
    pub largest_force_sum: f64,
    /// Largest displacement ratio of an accepted step, see [`StepReport::displacement_ratio`].
    pub largest_displacement_ratio: f64,
    /// Steps that reached equilibrium by viscous stabilisation, see [`Stabilised`].
    pub stabilised_steps: u64,
    /// Times that viscous stabilisation found no equilibrium and the body was returned to the state before the step.
    pub stabilisations_taken_back: u64,
    /// Committed increments of viscous stabilisation, none of them in balance but the last of each stabilised step. Like the
    /// evaluations they include attempts that did not reach equilibrium.
    pub stabilisation_increments: u64,
    /// Point evaluations of viscous stabilisation, those of rejected increments included.
    pub stabilisation_evaluations: u64,
    /// Viscous work of stabilised steps, and of the forces out of balance along steps with committed iterates, J, in the plane per metre.
    pub stabilisation_work: f64,
    /// Steps that went on from committed iterates, without viscosity.
    #[serde(default)]
    pub steps_with_committed_iterates: u64,
    /// These iterates, the last of each step not among them.
    #[serde(default)]
    pub committed_iterates: u64,
    /// Secant corrections applied to point tangents.
    pub secant_corrections: u64,
    /// Secant corrections that a gate or the floor rejected.
    pub secant_refusals: u64,
    /// Evaluations whose tangent was stiffened in at least one direction by
    /// [`crate::problem::Strategy::tangent_floor`].
    pub floored_tangents: u64,
    /// Shortcuts, counted over all evaluations.
    pub flags: FlagCounts,
    /// Force evaluations of the answers that the event-driven solver found itself.
    #[serde(default)]
    pub event_driven_force_evaluations: u64,
    /// Evaluations of all points that ended without an answer because grains did not come to rest within their step cap.
    pub unfinished_trials: u64,
    /// Answers whose Cauchy stress was not symmetric: the engine lets couples act on the grains that nothing carries.
    pub asymmetric_stresses: u64,
    /// Sub-steps into which refused trials of single points were divided in dynamic stages.
    pub sub_steps: u64,
    /// Cost of all evaluations, as the engine counted it.
    pub cost: Cost,
    /// How the force evaluations are spread over the trials.
    pub trial_costs: TrialCosts,
    /// Accuracy of the accepted steps.
    pub accuracy: AccuracyFigures,
    /// Symbolic factorizations of the global matrix.
    pub symbolic_factorizations: u64,
    /// Numeric factorizations of the global matrix.
    pub numeric_factorizations: u64,
    /// Iterations of the iterative solver of the global equations.
    pub linear_iterations: u64,
    /// Times that the iterative solver failed and the equations were solved directly.
    pub direct_fallbacks: u64,
    /// Degrees of freedom solved for.
    pub unknowns: usize,
    /// Wall time spent waiting for points, ns.
    pub material_nanoseconds: u64,
    /// Wall time of assembling, ns.
    pub assembly_nanoseconds: u64,
    /// Wall time of factorizing and solving, ns.
    pub linear_solver_nanoseconds: u64,
}

/// How often each shortcut of [`TrialFlags`] was taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FlagCounts {
    /// The relaxation ended at its step cap.
    pub not_equilibrated: u64,
    /// Another tangent replaced the requested one: that of uniform strain, or `truss_like` for operators by perturbation.
    pub tangent_fallback: u64,
    /// The network tangent needed a diagonal shift.
    pub tangent_regularised: u64,
    /// Overlap above 10 % of a grain.
    pub large_overlap: u64,
    /// No load-bearing contacts.
    #[serde(alias = "fluid")]
    pub no_load_bearing_contacts: u64,
    /// The target was exactly zero.
    pub null_targets: u64,
    /// The relaxation made no headway and went on in another way.
    pub damping_changed: u64,
    /// The event-driven solver answered by a stored linear response.
    #[serde(default)]
    pub elastic_increments: u64,
    /// The event-driven solver answered by new linear responses.
    #[serde(default)]
    pub event_increments: u64,
    /// The event-driven solver handed over to relaxation.
    #[serde(default)]
    pub handed_over: u64,
}

impl FlagCounts {
    /// Counts one answer.
    pub fn add(&mut self, flags: TrialFlags) {
        // The length is that of the list of flags: one that is not counted does not compile.
        let counters: [(TrialFlags, &mut u64); TrialFlags::NAMED.len()] = [
            (TrialFlags::NOT_EQUILIBRATED, &mut self.not_equilibrated),
            (TrialFlags::TANGENT_FALLBACK, &mut self.tangent_fallback),
            (TrialFlags::TANGENT_REGULARISED, &mut self.tangent_regularised),
            (TrialFlags::LARGE_OVERLAP, &mut self.large_overlap),
            (TrialFlags::NO_LOAD_BEARING_CONTACTS, &mut self.no_load_bearing_contacts),
            (TrialFlags::SKIPPED_NULL_TARGET, &mut self.null_targets),
            (TrialFlags::DAMPING_CHANGED, &mut self.damping_changed),
            (TrialFlags::ELASTIC_INCREMENT, &mut self.elastic_increments),
            (TrialFlags::EVENT_INCREMENT, &mut self.event_increments),
            (TrialFlags::HANDED_OVER, &mut self.handed_over),
        ];
        for (flag, counter) in counters {
            *counter += u64::from(flags.contains(flag));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flag_has_a_counter_of_its_own() {
        let numbers = |counts: &FlagCounts| {
            let fields = serde_json::to_value(counts).unwrap();
            fields.as_object().unwrap().values().map(|count| count.as_u64().unwrap()).collect::<Vec<_>>()
        };
        let mut all = FlagCounts::default();
        for (flag, word) in TrialFlags::NAMED {
            let mut counts = FlagCounts::default();
            counts.add(flag);
            assert_eq!(numbers(&counts).iter().sum::<u64>(), 1, "{word}");
            all.add(flag);
        }
        assert_eq!(numbers(&all), [1; TrialFlags::NAMED.len()]);
    }
}
