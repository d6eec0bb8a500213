//! The global tangent against differences of the global residual, and the rate of Newton's method (H-8).

use super::super::{Session, Solver};
use super::*;
use crate::checkpoint::NoKeeper;
use crate::observer::{Outcome, Silent};
use crate::problem::{Platen, PressureKind};

fn pressed(kind: ElementKind) -> Problem {
    let mut mesh = block(kind, 2, 2);
    for (number, node) in mesh.nodes.iter_mut().enumerate() {
        node[0] += 0.06 * (number as f64 * 1.7).sin();
        node[1] += 0.06 * (number as f64 * 2.9).cos();
    }
    let pressure = |sides: &str, kind| Condition::Pressure { sides: sides.into(), value: 3.0e6, kind };
    Problem::new(
        mesh,
        vec![
            Condition::fixed("bottom_left", Axis::X),
            Condition::Platen { nodes: "bottom".into(), contact: Platen::Smooth, axis: Axis::Y, displacement: 0.0 },
            pressure("right", PressureKind::Follower),
            pressure("top", PressureKind::Follower),
            pressure("left", PressureKind::Dead),
        ],
    )
}

#[test]
fn stiffness_with_follower_pressure_is_the_derivative_of_the_residual() {
    for kind in [ElementKind::Q4, ElementKind::Q8] {
        let problem = pressed(kind);
        let mut material = elastic(ElasticLaw::SaintVenant, &problem).with_initial_stress([
            [-3.0e6, 2.0e5, 0.0],
            [2.0e5, -1.0e6, 0.0],
            [0.0; 3],
        ]);
        let mut solver = Solver::new(&problem).unwrap();
        let mut session = Session { material: &mut material, observer: &mut Silent, keeper: &mut NoKeeper };
        let count = 2 * problem.mesh.nodes.len();
        let start: Vec<f64> = (0..count).map(|dof| 0.05 * (dof as f64 * 0.7).sin()).collect();
        let mut residual = |increment: &[f64]| {
            solver.evaluate(increment, 1.0, &mut session).unwrap();
            (solver.balance.residual(), solver.balance.clone())
        };
        let balance = residual(&start).1;
        let step = 1e-6;
        for dof in 0..count {
            let mut unit = vec![0.0; count];
            unit[dof] = 1.0;
            let column = balance.stiffness_times(&unit);
            let shifted = |sign: f64| {
                let mut moved = start.clone();
                moved[dof] += sign * step;
                moved
            };
            let (ahead, behind) = (residual(&shifted(1.0)).0, residual(&shifted(-1.0)).0);
            for row in 0..count {
                let difference = (ahead[row] - behind[row]) / (2.0 * step);
                let error = (difference - column[row]).abs() / balance.largest_diagonal();
                assert!(error < 1e-8, "{kind:?} row {row} column {dof}: {error:e}");
            }
        }
    }
}

/// H-8. From one iteration to the next the error is squared, until round-off.
#[test]
fn newton_converges_quadratically_on_a_smooth_law() {
    let mut problem = pressed(ElementKind::Q8);
    problem.conditions.push(Condition::Platen {
        nodes: "top".into(),
        contact: Platen::Rough,
        axis: Axis::Y,
        displacement: -0.3,
    });
    problem.control.increments = 1;
    problem.tolerances = Tolerances { force: 1e-11, displacement: 1e-11 };
    let mut material = elastic(ElasticLaw::SaintVenant, &problem).with_initial_stress([
        [-3.0e6, 0.0, 0.0],
        [0.0, -3.0e6, 0.0],
        [0.0; 3],
    ]);
    let (run, record) = run(&problem, &mut material);
    assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
    let ratios: Vec<f64> =
        record.iterations.iter().filter(|i| i.step == 1).filter_map(|i| i.displacement_ratio).collect();
    let orders: Vec<f64> = ratios
        .windows(3)
        .filter(|triple| triple[0] < 0.1 && triple[2] > 1e-13)
        .map(|triple| (triple[2] / triple[1]).ln() / (triple[1] / triple[0]).ln())
        .collect();
    assert!(!orders.is_empty() && orders.iter().all(|order| *order > 1.8), "{ratios:?} {orders:?}");
}
