//! Noise: S-8, tangents full of it at a point that softens; stresses with a little of it in small steps.

use super::stabilisation::{pulled, weak_at_the_bottom};
use super::*;
use crate::material::altered::{Altered, EachAnswer};
use crate::observer::Outcome;
use crate::problem::{NamedStrategy, Stabilisation};
use claims::Claim;

/// Spoils every tangent it hands on, as probes of a cell spoil theirs next to events among its grains.
struct Noise {
    /// Largest share by which a component is off.
    share: f64,
    /// State of the generator.
    state: u64,
}

impl Noise {
    /// Between -1 and 1.
    fn number(&mut self) -> f64 {
        self.state = self.state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

impl EachAnswer for Noise {
    fn change(&mut self, _: &PointTrial, answer: &mut TrialResult) {
        let Some(tangent) = answer.tangent.as_mut() else { return };
        for component in &mut tangent.0 {
            *component *= 1.0 + self.share * self.number();
        }
    }
}

/// Whatever the noise, through the peak, the snap and the softening after it the run ends in the state that exact tangents give,
/// with numbers all the way; what it took is counted.
#[test]
fn noisy_tangents_cost_iterations_and_not_the_answer() {
    let mut exact = weak_at_the_bottom();
    let (plain, _) = run(&pulled(1e-2), &mut exact);
    assert!(matches!(plain.outcome, Outcome::Completed), "{:?}", plain.outcome);
    for strategy in [NamedStrategy::Newton, NamedStrategy::ModifiedNewton] {
        for (share, seed) in [(0.1, 1), (0.3, 2), (0.5, 3), (0.5, 4)] {
            let mut problem = pulled(1e-2);
            problem.stages[0].strategy = strategy.preset();
            let alteration = Noise { share, state: seed };
            let mut material = Altered { material: weak_at_the_bottom(), alteration };
            let (run, recorder) = run(&problem, &mut material);
            assert!(matches!(run.outcome, Outcome::Completed), "{strategy:?} {share} {seed}: {:?}", run.outcome);
            let (strain, expected) = (material.material.largest_strain(0), exact.largest_strain(0));
            let quantity = "largest strain of the point that softens, tangents off by 10 to 50 %";
            Claim::of("S-8", quantity).value(strain, expected).within(1e-6);
            let is_finite = recorder.iterations.iter().all(|report| report.force_ratio.is_finite())
                && recorder.points.iter().all(|point| point.stress.0.iter().all(|value| value.is_finite()));
            Claim::of("S-8", "forces of every iteration and stresses at the end are finite").holds(is_finite);
            let smaller = (run.statistics.cut_backs + run.statistics.stabilised_steps) as f64;
            Claim::of("S-8", "steps that are made smaller or stabilised").number(smaller).at_least(1.0);
        }
    }
}

/// Spoils every stress, as the tolerance of a cell does.
struct NoisyStress(Noise);

impl EachAnswer for NoisyStress {
    fn change(&mut self, _: &PointTrial, answer: &mut TrialResult) {
        let factor = 1.0 + self.0.share * self.0.number();
        answer.stress.0.iter_mut().for_each(|component| *component *= factor);
    }
}

/// In small steps the corrections that such noise asks for are above the displacement tolerance, whatever is done. Steps in balance were refused
/// for them and halved, which made the corrections larger still, until none was left.
#[test]
fn small_steps_end_where_their_corrections_are_noise() {
    let solved = |stagnated_displacement| {
        let mut problem = pulled(1e-3);
        let stage = &mut problem.stages[0];
        stage.control.increments = 400;
        stage.tolerances = Tolerances { stagnated_displacement, ..Tolerances::within(5e-3) };
        stage.control.stabilisation = Some(Stabilisation { after: Some(1), ..Stabilisation::default() });
        let mut material =
            Altered { material: weak_at_the_bottom(), alteration: NoisyStress(Noise { share: 3e-3, state: 5 }) };
        run(&problem, &mut material).0
    };
    let (now, before) = (solved(5e-2), solved(0.0));
    let statistics = &now.statistics;
    assert!(matches!(now.outcome, Outcome::Completed), "{:?}", now.outcome);
    assert_eq!((statistics.steps, statistics.stagnated_steps), (400, 0));
    assert!(statistics.steps_with_noisy_corrections > 10 && statistics.largest_force_ratio <= 1e-2, "{statistics:?}");
    assert_eq!(before.statistics.steps_with_noisy_corrections, 0, "off");
    assert!(matches!(before.outcome, Outcome::DidNotConverge { .. }), "{:?}", before.outcome);
}
