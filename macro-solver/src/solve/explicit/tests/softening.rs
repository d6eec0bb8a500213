//! K-7 and S-10: averages over neighbours in motion, on a bar that softens and on bars that only swing.

use super::*;
use crate::nonlocal::{Kernel, NonlocalError, NonlocalSettings};
use crate::observer::Silent;
use crate::problem::ProblemError;
use crate::problem::dynamics::{InitialVelocity, RayleighDamping, TimeStepRule};
use claims::Claim;

/// Strain at which softening begins.
const THRESHOLD: f64 = 1e-3;

/// A bar of 1 m, weaker by a tenth over its middle 0.4 m, is pulled to twice the strain at which it softens. Returns the width of the
/// band (participation of the strains beyond the threshold), m, and the work lost, J/m2.
fn pulled(count: usize, radius: Option<f64>) -> (f64, f64) {
    let side = 1.0 / count as f64;
    let (speed, reach) = (2e-3, 2e-3);
    let mut mesh = strip(ElementKind::Q4Single, count, side);
    let mut settings = DynamicSettings {
        step: TimeStepRule::Fixed { step: 0.5 * side },
        damping: RayleighDamping { mass: 0.3, stiffness: 0.0 },
        reporting: Reporting::Steps(1_000_000),
        ..settings(1.0)
    };
    for node in 0..mesh.nodes.len() {
        let name = format!("node {node}");
        let value = [speed * mesh.nodes[node][0], 0.0, 0.0];
        settings.initial_velocities.push(InitialVelocity { nodes: name.clone(), value });
        mesh.node_sets.insert(name, vec![node]);
    }
    let pull = moved("right", Axis::X, reach, Amplitude::RAMP);
    let mut problem = problem(mesh, vec![pull, held("left", Axis::X), held("all", Axis::Y)], reach / speed, settings);
    problem.stages[0].nonlocal = radius.map(|radius| NonlocalSettings { radius, ..NonlocalSettings::default() });
    let law = |element: usize| {
        let middle = (element as f64 + 0.5) * side - 0.5;
        let threshold = if middle.abs() < 0.2 { 0.9 * THRESHOLD } else { THRESHOLD };
        DamageLaw { lambda: 0.0, shear: 0.5, threshold, softening: 0.02 }
    };
    let laws: Vec<DamageLaw> = (0..count).map(law).collect();
    let mut material = DamageMaterial::new(laws.clone());
    let film = completed(&problem, &mut material);
    let beyond: Vec<f64> = film
        .last()
        .points
        .iter()
        .enumerate()
        .map(|(point, fields)| (fields.stress.get(0, 0) / material.integrity(point) - THRESHOLD).max(0.0))
        .collect();
    let (sum, squares): (f64, f64) = (beyond.iter().sum(), beyond.iter().map(|strain| strain * strain).sum());
    let lost =
        laws.iter().enumerate().map(|(point, law)| law.dissipation(material.largest_strain(point))).sum::<f64>();
    (sum * sum / squares * side, lost * side)
}

/// K-7: with a radius of 0.2 m the band is as wide on 10, 20, 40 and 80 elements (R/h = 2 to 16) and the lost work converges; without
/// averages the band is as wide as the mesh is coarse.
#[test]
fn the_band_of_a_softening_bar_does_not_follow_the_mesh() {
    let counts = [10, 20, 40, 80];
    let wide = counts.map(|count| pulled(count, Some(0.2)));
    for (coarse, fine) in wide.iter().zip(&wide[1..]) {
        let quantity = "width of the band of a bar in motion against a mesh twice as fine, m";
        Claim::of("K-7", quantity).value(coarse.0, fine.0).within(0.05);
        let quantity = "lost work of a bar in motion against a mesh twice as fine, J/m2";
        Claim::of("K-7", quantity).value(coarse.1, fine.1).within(0.05);
    }
    let narrow = counts.map(|count| pulled(count, None));
    for (coarse, fine) in narrow.iter().zip(&narrow[1..]) {
        let quantity = "width of the band over that on a mesh twice as coarse, without averages";
        Claim::of("K-7", quantity).number(fine.0 / coarse.0).at_most(0.6);
    }
}

fn struck_bar(nonlocal: NonlocalSettings) -> Problem {
    let start = InitialVelocity { nodes: "right".into(), value: [1e-3, 0.0, 0.0] };
    // A struck node swings at the frequency of the mesh, which no step resolves: whether its energy grows is what counts here.
    let settings = DynamicSettings { initial_velocities: vec![start], longest_excess: 0, ..settings(1.0) };
    let conditions = vec![held("left", Axis::X), held("all", Axis::Y)];
    let mut problem = problem(strip(ElementKind::Q4Single, 40, 1.0), conditions, 200.0, settings);
    problem.stages[0].nonlocal = Some(nonlocal);
    problem
}

/// S-10: every kernel over the radii of the table: what is accepted runs without gaining energy, what is not is refused with a remedy
/// before any point is asked.
#[test]
fn unstable_kernels_are_refused_and_stable_ones_run() {
    for kernel in Kernel::ALL {
        for radius in [0.5, 1.35, 1.8, 2.0, 2.5, 2.7, 4.0, 6.0, 8.0] {
            let problem = struck_bar(NonlocalSettings { radius, kernel, ..NonlocalSettings::default() });
            let run = solve(&problem, &mut elastic(&problem, 0.0, 0.5), &mut Silent);
            if kernel == Kernel::Bell && radius >= 2.0 {
                let Outcome::Refused(ProblemError::Nonlocal(error)) = run.outcome else {
                    panic!("{kernel:?} {radius}: {:?}", run.outcome);
                };
                let has_remedy =
                    matches!(error, NonlocalError::Unstable { .. }) && error.to_string().contains("wendland");
                Claim::of("S-10", "the bell is refused with a remedy from R/h = 2 on").holds(has_remedy);
                let quantity = "points that are asked before the bell is refused";
                Claim::of("S-10", quantity).value(run.statistics.evaluations as f64, 0.0).within_absolute(0.0);
            } else {
                let quantity =
                    format!("a struck bar runs to its end, kernel {} where it is stable", kernel.keyword());
                Claim::of("S-10", &quantity).holds(matches!(run.outcome, Outcome::Completed));
            }
        }
    }
    // The remedies of the table.
    for remedy in [
        NonlocalSettings { adjoint: true, ..NonlocalSettings::default() },
        NonlocalSettings { local_share: 0.2, ..NonlocalSettings::default() },
    ] {
        let problem = struck_bar(NonlocalSettings { radius: 2.5, kernel: Kernel::Bell, ..remedy });
        completed(&problem, &mut elastic(&problem, 0.0, 0.5));
    }
}

#[test]
fn combinations_without_a_meaning_are_refused_with_the_remedy() {
    let refused = |change: &dyn Fn(&mut Problem)| {
        let mut problem = struck_bar(NonlocalSettings { radius: 3.0, ..NonlocalSettings::default() });
        change(&mut problem);
        match solve(&problem, &mut elastic(&problem, 0.0, 0.5), &mut Silent).outcome {
            Outcome::Refused(error) => error.to_string(),
            other => panic!("{other:?}"),
        }
    };
    assert!(refused(&|problem| problem.formulation = Formulation::UpdatedLagrangian).contains("\"corotational\""));
}

/// A radius below the distance of the points is no averaging at all: the same bits as without.
#[test]
fn a_short_radius_changes_no_bit() {
    let run = |nonlocal: Option<NonlocalSettings>| {
        let mut problem = struck_bar(NonlocalSettings { radius: 0.9, ..NonlocalSettings::default() });
        problem.stages[0].nonlocal = nonlocal;
        problem.formulation = Formulation::Corotational;
        completed(&problem, &mut elastic(&problem, 0.2, 0.5)).last().displacements.clone()
    };
    assert_eq!(run(Some(NonlocalSettings { radius: 0.9, ..NonlocalSettings::default() })), run(None));
}
