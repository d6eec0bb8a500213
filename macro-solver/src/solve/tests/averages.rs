//! Newton's method with strains averaged over neighbours: tangent, rate, and the answer of other procedures.

use super::tangent::{orders, pressed, stiffness_error};
use super::*;
use crate::formulation::Formulation;
use crate::material::damage::{DamageLaw, DamageMaterial};
use crate::nonlocal::{Kernel, NonlocalSettings, Update};
use crate::observer::Outcome;
use crate::problem::relaxation::RelaxationSettings;
use crate::problem::{Applied, MultiPointConstraint, NamedStrategy, Platen, PoreFluid, Procedure, TangentUpdate};
use claims::Claim;

fn averages(radius: f64) -> NonlocalSettings {
    NonlocalSettings { radius, ..NonlocalSettings::default() }
}

/// K-8. Both formulations with strain increments, on elements of one and of several points, with each way of averaging.
#[test]
fn the_stiffness_with_averages_is_the_derivative_of_the_residual() {
    let ways = [
        averages(1.1),
        NonlocalSettings { adjoint: true, ..averages(1.1) },
        NonlocalSettings { update: Update::Staggered, local_share: 0.2, ..averages(1.3) },
        NonlocalSettings { kernel: Kernel::Bell, adjoint: true, ..averages(1.6) },
    ];
    for kind in [ElementKind::Q4, ElementKind::Q4Single, ElementKind::Q8, ElementKind::T6, ElementKind::H8Single] {
        for formulation in [Formulation::SmallStrain, Formulation::Corotational] {
            for way in &ways {
                let mut problem = pressed(kind);
                problem.formulation = formulation;
                problem.stages[0].nonlocal = Some(way.clone());
                let quantity = "stiffness with averages against differences, over its largest diagonal";
                Claim::of("K-8", quantity).error(stiffness_error(&problem)).within(1e-8);
            }
        }
    }
    let mut problem = pressed(ElementKind::Q4);
    problem.formulation = Formulation::Corotational;
    problem.stages[0].nonlocal = Some(averages(1.1));
    problem.pore_fluid = Some(PoreFluid { bulk_modulus: 1e8, from_stage: 0 });
    let quantity = "stiffness with averages and pore fluid against differences, over its largest diagonal";
    Claim::of("K-8", quantity).error(stiffness_error(&problem)).within(1e-8);
}

/// K-8. The rate of Newton's method at a finite strain is that without averages.
#[test]
fn newton_with_averages_converges_quadratically() {
    for (kind, adjoint) in [(ElementKind::Q8, false), (ElementKind::Q4Single, false), (ElementKind::Q4Single, true)] {
        let mut problem = pressed(kind);
        problem.formulation = Formulation::Corotational;
        problem.stages[0].nonlocal = Some(NonlocalSettings { adjoint, ..averages(1.2) });
        problem.stages[0].strategy.capped_change = 1.0;
        problem.stages[0].conditions.push(Applied::from(Condition::Platen {
            nodes: "top".into(),
            contact: Platen::Rough,
            axis: Axis::Y,
            displacement: -0.12,
        }));
        problem.stages[0].control.increments = 1;
        problem.stages[0].tolerances = Tolerances::both(1e-11, 1e-11);
        let initial = [[-3.0e6, 0.0, 0.0], [0.0, -3.0e6, 0.0], [0.0, 0.0, -3.0e6]];
        let mut material = elastic(ElasticLaw::SaintVenant, &problem).with_initial_stress(initial);
        let (run, record) = run(&problem, &mut material);
        assert!(matches!(run.outcome, Outcome::Completed), "{kind:?} {:?}", run.outcome);
        let quantity = "correction of an iteration over twice the square of the one before, or over 1e-13";
        Claim::of("K-8", quantity).number(largest_over_square(&record, 1)).at_most(1.0);
    }
}

/// The largest correction of an iteration over twice the square of the one before it, or over round-off, where that one is below a
/// twentieth of the step: at most 1 where Newton's method squares its error.
fn largest_over_square(record: &Recorder, step: usize) -> f64 {
    let ratios = orders(record, step).0;
    let small = ratios.windows(2).filter(|pair| pair[0] < 0.05);
    let shares = small.map(|pair| (pair[1] / (2.0 * pair[0] * pair[0]).max(1e-13)).abs());
    shares.max_by(f64::total_cmp).unwrap_or_else(|| panic!("no correction is small: {ratios:?}"))
}

/// Strain at which softening begins.
const THRESHOLD: f64 = 1e-3;

/// A bar of 1 m, weaker by up to a tenth towards its middle, is pulled in equilibrium to twice the strain at which it softens.
fn pulled_bar(count: usize, radius: Option<f64>) -> (Problem, Vec<DamageLaw>) {
    let side = 1.0 / count as f64;
    let mesh = Block::plane([1.0, side], [count, 1], ElementKind::Q4Single).mesh().unwrap();
    let pull = Condition::Displacement { nodes: "right".into(), axis: Axis::X, value: 2.0 * THRESHOLD };
    let mut problem =
        Problem::new(mesh, vec![pull, Condition::fixed("left", Axis::X), Condition::fixed("all", Axis::Y)]);
    problem.formulation = Formulation::SmallStrain;
    let stage = &mut problem.stages[0];
    stage.nonlocal = radius.map(|radius| NonlocalSettings { local_share: 0.1, ..averages(radius) });
    stage.strategy.tangent_floor = None;
    stage.strategy.tangent_update = TangentUpdate::Always;
    stage.strategy.capped_change = 1.0;
    stage.tolerances = Tolerances::both(1e-10, 1e-10);
    // A step that fails is made shorter, so that the bar stays in equilibrium.
    stage.control.stabilisation = None;
    let law = |element: usize| {
        let middle = (element as f64 + 0.5) * side - 0.5;
        let weakness = 0.1 * (-(middle / 0.1) * (middle / 0.1)).exp();
        DamageLaw { lambda: 0.0, shear: 0.5, threshold: (1.0 - weakness) * THRESHOLD, softening: 0.02 }
    };
    (problem, (0..count).map(law).collect())
}

/// Width of the band (participation of the strains beyond the threshold), m, and the work lost, J/m2, of a bar that was pulled by
/// Newton's method, and what was reported.
fn pulled(count: usize, radius: Option<f64>) -> (f64, f64, Recorder) {
    let (problem, laws) = pulled_bar(count, radius);
    let mut material = DamageMaterial::new(laws.clone()).with_consistent_tangents();
    let (run, record) = run(&problem, &mut material);
    assert!(matches!(run.outcome, Outcome::Completed), "{count} {radius:?}: {:?}", run.outcome);
    let side = 1.0 / count as f64;
    // With a modulus of 1 Pa: of the strains that the points see.
    let seen = |point: usize| record.points[point].stress.get(0, 0) / material.integrity(point);
    let beyond: Vec<f64> = (0..count).map(|point| (seen(point) - THRESHOLD).max(0.0)).collect();
    let (sum, squares): (f64, f64) = (beyond.iter().sum(), beyond.iter().map(|strain| strain * strain).sum());
    let lost =
        laws.iter().enumerate().map(|(point, law)| law.dissipation(material.largest_strain(point))).sum::<f64>();
    (sum * sum / squares * side, lost * side, record)
}

/// K-9. With a radius of 0.2 m and a local share of 0.1 the band of a bar in equilibrium is as wide on 20, 40 and 80 elements (R/h = 4 to 16)
/// and the lost work is the same; without averages it is as wide as two elements. Every step past the peak takes few iterations.
#[test]
fn the_band_of_a_bar_in_equilibrium_does_not_follow_the_mesh() {
    let wide = [20, 40, 80].map(|count| pulled(count, Some(0.2)));
    let figures: Vec<(f64, f64)> = wide.iter().map(|(width, lost, _)| (*width, *lost)).collect();
    for (coarse, fine) in figures.iter().zip(&figures[1..]) {
        let quantity = "width of the band of a bar in equilibrium against a mesh twice as fine, m";
        Claim::of("K-9", quantity).value(coarse.0, fine.0).within(0.02);
        let quantity = "lost work of a bar in equilibrium against a mesh twice as fine, J/m2";
        Claim::of("K-9", quantity).value(coarse.1, fine.1).within(0.02);
    }
    let narrow = [10, 20].map(|count| pulled(count, None).0);
    let quantity = "width of the band over that on a mesh twice as coarse, without averages";
    Claim::of("K-9", quantity).number(narrow[1] / narrow[0]).at_most(0.6);
    for (_, _, record) in &wide {
        let iterations: Vec<usize> = record.steps.iter().map(|step| step.iterations).collect();
        // The first step beyond the peak is cut back.
        assert!(
            iterations.iter().all(|iterations| *iterations <= 5) && record.cut_backs.len() <= 2,
            "{iterations:?}"
        );
        let last = record.steps.last().expect("the end is reported").step;
        let ratios = orders(record, last).0;
        assert!(ratios.windows(2).any(|pair| pair[1] < 1e-3 * pair[0]), "{ratios:?}");
    }
}

/// K-10. Every named strategy of Newton's method and dynamic relaxation find the same equilibrium of a block between rough platens.
#[test]
fn all_ways_to_the_answer_agree_with_averages() {
    let answer = |adjoint: bool, change: &dyn Fn(&mut crate::problem::Stage)| {
        let mut problem = Problem::new(block(ElementKind::Q4Single, 3, 4), Vec::new());
        problem.formulation = Formulation::Corotational;
        let platen = |nodes: &str, displacement| Condition::Platen {
            nodes: nodes.into(),
            contact: Platen::Rough,
            axis: Axis::Y,
            displacement,
        };
        let pushed = Condition::BodyForce { elements: "all".into(), value: [1e5, 0.0, 0.0] };
        let stage = &mut problem.stages[0];
        stage.conditions =
            [platen("bottom", 0.0), platen("top", -0.1), pushed].into_iter().map(Applied::from).collect();
        stage.nonlocal = Some(NonlocalSettings { adjoint, ..averages(1.8) });
        (stage.control.increments, stage.control.max_iterations) = (2, 60);
        stage.tolerances = Tolerances::both(1e-9, 1e-9);
        change(stage);
        let (run, record) = run(&problem, &mut elastic(ElasticLaw::SaintVenant, &problem));
        assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
        record
    };
    for adjoint in [false, true] {
        let newton = answer(adjoint, &|_| {});
        let relaxed =
            answer(adjoint, &|stage| stage.procedure = Procedure::Relaxation(RelaxationSettings::default()));
        let others = NamedStrategy::ALL.map(|named| answer(adjoint, &|stage| stage.strategy = named.preset()));
        let others = others.iter().map(|other| ("other strategies of Newton's method", other));
        for (what, other) in others.chain([("dynamic relaxation", &relaxed)]) {
            let moved = newton.displacements.iter().flatten().zip(other.displacements.iter().flatten());
            let error = moved.map(|(one, other)| (one - other).abs()).fold(0.0, f64::max) / 0.1;
            Claim::of("K-10", &format!("displacements by {what}, over that of the platen")).error(error).within(1e-6);
            let forces = newton.reactions.iter().flatten().zip(other.reactions.iter().flatten());
            let largest = newton.reactions.iter().flatten().fold(0.0f64, |most, value| most.max(value.abs()));
            let error = forces.map(|(one, other)| (one - other).abs()).fold(0.0, f64::max) / largest;
            Claim::of("K-10", &format!("reactions by {what}, over the largest")).error(error).within(1e-6);
        }
    }
}

/// Averages through periodic faces, whose nodes are eliminated, are in the stiffness as well: without them iterations would not converge
/// quadratically.
#[test]
fn periodic_faces_are_in_the_stiffness() {
    let mut problem = Problem::new(block(ElementKind::Q4, 4, 2), Vec::new());
    problem.formulation = Formulation::Corotational;
    let stage = &mut problem.stages[0];
    stage.nonlocal = Some(averages(1.4));
    let link =
        MultiPointConstraint::Periodic { from: "left".into(), to: "right".into(), jump: [None, Some(0.0), None] };
    let platen = |nodes: &str, displacement| Condition::Platen {
        nodes: nodes.into(),
        contact: Platen::Rough,
        axis: Axis::Y,
        displacement,
    };
    let pushed = Condition::BodyForce { elements: "all".into(), value: [2e5, 1e5, 0.0] };
    let conditions = [platen("bottom", 0.0), pushed, Condition::MultiPointConstraint(link)];
    stage.conditions = conditions.into_iter().map(Applied::from).collect();
    stage.strategy.tangent_floor = None;
    stage.strategy.tangent_update = TangentUpdate::Always;
    stage.strategy.capped_change = 1.0;
    stage.control.increments = 1;
    stage.tolerances = Tolerances::both(1e-11, 1e-11);
    let (run, record) = run(&problem, &mut elastic(ElasticLaw::SaintVenant, &problem));
    assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
    let share = largest_over_square(&record, 1);
    assert!(share <= 1.0, "{share}");
}
