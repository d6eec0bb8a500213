//! What a loose balance of forces leaves of an error, and what the run says of it.

use super::strategies::pressed;
use super::*;
use crate::observer::{BalanceError, Outcome};
use crate::problem::NamedStrategy;

/// Stresses after one step, and the error that the run states for it.
fn stresses(strategy: NamedStrategy, tolerance: f64) -> (Vec<[f64; 9]>, BalanceError) {
    let mut problem = pressed();
    problem.stages[0].control.increments = 1;
    problem.stages[0].tolerances = Tolerances::both(tolerance, tolerance);
    problem.stages[0].strategy = strategy.preset();
    let (finished, record) = run(&problem, &mut elastic(ElasticLaw::SaintVenant, &problem));
    assert!(matches!(finished.outcome, Outcome::Completed), "{:?}", finished.outcome);
    let step = record.steps.last().expect("a step was accepted");
    let statistics = &finished.statistics;
    assert!(statistics.largest_force_ratio >= step.force_ratio && statistics.largest_force_ratio <= tolerance);
    (record.points.iter().map(|point| point.stress.0).collect(), step.accuracy.balance.expect("Newton's method"))
}

/// Root mean square of the difference over the points, and norm of its mean, over the mean pressure in the plane.
fn differences(found: &[[f64; 9]], exact: &[[f64; 9]]) -> BalanceError {
    let count = exact.len() as f64;
    let pressure = -exact.iter().map(|stress| 0.5 * (stress[0] + stress[4])).sum::<f64>() / count;
    let each = |k: usize| found.iter().zip(exact).map(move |(found, exact)| found[k] - exact[k]);
    let squares: f64 = (0..9).map(|k| each(k).map(|one| one * one).sum::<f64>()).sum();
    let mean: f64 = (0..9).map(|k| each(k).sum::<f64>().powi(2)).sum();
    BalanceError { rms: (squares / count).sqrt() / pressure, of_mean: mean.sqrt() / count / pressure }
}

#[test]
fn a_loose_balance_tells_the_error_that_it_leaves() {
    for strategy in [NamedStrategy::Newton, NamedStrategy::ModifiedNewton] {
        let (exact, _) = stresses(strategy, 1e-10);
        for tolerance in [1e-1, 1e-2, 1e-3] {
            let (found, stated) = stresses(strategy, tolerance);
            let truth = differences(&found, &exact);
            let is_near = |stated: f64, truth: f64| (truth / 2.0..2.0 * truth).contains(&stated);
            assert!(
                is_near(stated.rms, truth.rms) && is_near(stated.of_mean, truth.of_mean),
                "{strategy:?} {tolerance}: {stated:?} for {truth:?}"
            );
        }
    }
}
