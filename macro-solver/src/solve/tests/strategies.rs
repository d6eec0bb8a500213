//! Named strategies and convergence criteria: other paths to the same state, and what each may cost.

use super::*;
use crate::observer::Outcome;
use crate::problem::{Criteria, NamedStrategy, Platen, Strategy, TangentUpdate};
use claims::Claim;
use protocol::TangentKind;

/// A block pressed between rough platens; not linear.
pub(super) fn pressed() -> Problem {
    let platen = |nodes: &str, displacement| Condition::Platen {
        nodes: nodes.into(),
        contact: Platen::Rough,
        axis: Axis::Y,
        displacement,
    };
    let mut problem = Problem::new(block(ElementKind::Q8, 2, 2), vec![platen("bottom", 0.0), platen("top", -0.4)]);
    problem.stages[0].control.increments = 4;
    problem.stages[0].control.max_iterations = 60;
    problem.stages[0].tolerances = TIGHT;
    problem
}

fn solved(strategy: Strategy) -> (Run, Recorder) {
    let mut problem = pressed();
    problem.stages[0].strategy = strategy;
    let (finished, record) = run(&problem, &mut elastic(ElasticLaw::SaintVenant, &problem));
    assert!(
        matches!(finished.outcome, Outcome::Completed),
        "{:?}: {:?}",
        problem.stages[0].strategy,
        finished.outcome
    );
    (finished, record)
}

fn largest_difference(one: &Recorder, other: &Recorder) -> f64 {
    let pairs = one.points.iter().zip(&other.points);
    pairs.flat_map(|(one, other)| (0..9).map(|i| (one.stress.0[i] - other.stress.0[i]).abs())).fold(0.0, f64::max)
}

#[test]
fn every_named_strategy_finds_the_same_state() {
    let (_, exact) = solved(NamedStrategy::Newton.preset());
    for named in NamedStrategy::ALL {
        let (finished, record) = solved(named.preset());
        let difference = largest_difference(&exact, &record);
        assert!(difference < 1e-6 * 2e7, "{named:?}: {difference:e} Pa");
        let statistics = &finished.statistics;
        let share = statistics.tangents as f64 / statistics.evaluations as f64;
        let expected = match named {
            NamedStrategy::Newton | NamedStrategy::SlipSecant => 1.0..=1.0,
            NamedStrategy::SlipNewton | NamedStrategy::ModifiedNewton | NamedStrategy::QuasiNewton => 0.05..=0.7,
            NamedStrategy::PointSecant => 0.001..=0.3,
        };
        assert!(expected.contains(&share), "{named:?} asks for tangents in {share} of its evaluations");
        let corrects = matches!(named, NamedStrategy::SlipSecant | NamedStrategy::PointSecant);
        assert_eq!(statistics.secant_corrections > 0, corrects, "{named:?}");
        assert_eq!(statistics.cut_backs, 0, "{named:?}");
    }
}

/// Secants learn from stresses alone: with one tangent per point for the whole run they need fewer iterations than that tangent does.
#[test]
fn secants_need_fewer_iterations_than_the_first_tangent_alone() {
    let secants = NamedStrategy::PointSecant.preset();
    let plain = Strategy { secant: None, ..secants.clone() };
    let figures = |strategy| {
        let statistics = solved(strategy).0.statistics;
        (statistics.iterations, statistics.tangents)
    };
    let ((learnt, tangents), (kept, same)) = (figures(secants), figures(plain));
    assert_eq!(tangents, same);
    assert!(4 * learnt < 3 * kept, "{learnt} {kept}");
}

/// With the factors of the undeformed body for the whole run, pairs are what makes the iteration converge soon.
#[test]
fn quasi_newton_pairs_need_fewer_iterations_than_the_factors_alone() {
    let learnt = Strategy { tangent_update: TangentUpdate::Once, ..NamedStrategy::QuasiNewton.preset() };
    let plain = Strategy { quasi_newton: None, ..learnt.clone() };
    let iterations = |strategy| solved(strategy).0.statistics.iterations;
    let (learnt, plain) = (iterations(learnt), iterations(plain));
    assert!(4 * learnt < 3 * plain, "{learnt} {plain}");
}

/// T-9 on a smooth law: full Newton squares its error; factors kept from the start of the step divide it by a constant.
#[test]
fn kept_tangents_converge_linearly_and_fresh_ones_quadratically() {
    let orders = |named: NamedStrategy| -> Vec<f64> {
        let mut problem = pressed();
        problem.stages[0].control.increments = 1;
        problem.stages[0].tolerances = Tolerances::both(1e-11, 1e-11);
        problem.stages[0].strategy = Strategy { quasi_newton: None, capped_change: 1.0, ..named.preset() };
        let (finished, record) = run(&problem, &mut elastic(ElasticLaw::SaintVenant, &problem));
        assert!(matches!(finished.outcome, Outcome::Completed), "{:?}", finished.outcome);
        let steps = record.iterations.iter().filter(|iteration| iteration.step == 1);
        let ratios: Vec<f64> = steps.filter_map(|iteration| iteration.displacement_ratio).collect();
        ratios
            .windows(3)
            .filter(|triple| triple[0] < 0.05 && triple[2] > 1e-13)
            .map(|triple| (triple[2] / triple[1]).ln() / (triple[1] / triple[0]).ln())
            .collect()
    };
    let fresh = orders(NamedStrategy::Newton);
    assert!(!fresh.is_empty());
    for order in fresh {
        Claim::of("T-9", "order of the iteration on a smooth law, fresh tangents").number(order).at_least(1.8);
    }
    let kept = orders(NamedStrategy::QuasiNewton);
    assert!(kept.len() > 2, "{kept:?}");
    for order in kept {
        let quantity = "order of the iteration on a smooth law, tangents kept from the start of the step";
        Claim::of("T-9", quantity).number(order).between(0.6, 1.5);
    }
}

/// The accepted state of every choice of criteria meets what was asked, and not more than that where it can be told.
#[test]
fn criteria_hold_alone_and_together() {
    let accepted = |criteria: Criteria, [force, displacement, energy]: [f64; 3]| {
        let mut problem = pressed();
        problem.stages[0].tolerances = Tolerances { energy, criteria, ..Tolerances::both(force, displacement) };
        let (finished, record) = run(&problem, &mut elastic(ElasticLaw::SaintVenant, &problem));
        assert!(matches!(finished.outcome, Outcome::Completed), "{criteria:?} {:?}", finished.outcome);
        let last = *record.steps.last().unwrap();
        (finished.statistics.iterations, last.force_ratio, last.displacement_ratio)
    };
    let tight = [1e-8, 1e-8, 1e-16];
    let (_, force, _) = accepted(Criteria::FORCE_OVER_REACTIONS, tight);
    assert!(force <= 1e-8);
    let (_, _, displacement) = accepted(Criteria::CORRECTION_OVER_STEP, tight);
    assert!(displacement <= 1e-8);
    let energy = Criteria { force: None, displacement: None, energy: true };
    let (few, force, _) = accepted(energy, [1e-8, 1e-8, 1e-4]);
    let (many, better, _) = accepted(energy, tight);
    assert!(few < many && better < force && better < 1e-6, "{few} {many} {force:e} {better:e}");
    let (both, _, _) = accepted(Criteria::default(), [1e-2, 1e-8, 1.0]);
    let (all, force, displacement) = accepted(Criteria { energy: true, ..Criteria::default() }, [1e-2, 1e-8, 1e-18]);
    assert!(force <= 1e-2 && displacement <= 1e-8 && all >= both);
}

/// Points that deform alike but for round-off are asked the same question in every bit once targets are rounded.
#[test]
fn rounded_targets_are_equal_where_the_deformation_is() {
    let smooth = |nodes: &str, axis, value| Condition::Displacement { nodes: nodes.into(), axis, value };
    let conditions = vec![
        smooth("bottom", Axis::Y, 0.0),
        smooth("left", Axis::X, 0.0),
        smooth("top", Axis::Y, -0.0123),
        Condition::Pressure { sides: "right".into(), value: 1e4, kind: Default::default() },
    ];
    let mut problem = Problem::new(block(ElementKind::Q8, 3, 2), conditions);
    problem.stages[0].control.increments = 3;
    problem.stages[0].tolerances = Tolerances::both(1e-4, 1e-4);
    let kinds_of_target = |grid| {
        let mut problem = problem.clone();
        problem.stages[0].strategy = Strategy { target_grid: grid, ..NamedStrategy::Newton.preset() };
        let mut spy = Spy::new(elastic(ElasticLaw::SaintVenant, &problem));
        let (finished, _) = run(&problem, &mut spy);
        assert!(matches!(finished.outcome, Outcome::Completed), "{:?}", finished.outcome);
        let mut bits: Vec<Vec<u64>> = spy
            .committed_trials(2)
            .iter()
            .map(|trial| trial.target.0.iter().map(|x| (x + 0.0).to_bits()).collect())
            .collect();
        bits.sort();
        bits.dedup();
        bits.len()
    };
    assert!(kinds_of_target(None) > 1);
    assert_eq!(kinds_of_target(Some(1e-6)), 1);
}

#[test]
fn settings_out_of_range_are_refused() {
    let refused = |change: fn(&mut Problem)| {
        let mut problem = pressed();
        change(&mut problem);
        problem.validate().unwrap_err().to_string()
    };
    assert!(
        refused(|p| p.stages[0].tolerances.criteria = Criteria { force: None, displacement: None, energy: false })
            .contains("criteria")
    );
    assert!(refused(|p| p.stages[0].strategy.target_grid = Some(0.1)).contains("target_grid"));
    assert!(refused(|p| p.stages[0].tolerances.energy = -1.0).contains("solver.energy_tolerance"));
    let strategy = Strategy { tangent: TangentKind::TrussLike, ..NamedStrategy::QuasiNewton.preset() };
    assert_eq!(strategy, NamedStrategy::QuasiNewton.preset());
}
