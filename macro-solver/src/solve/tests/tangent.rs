//! The global tangent against differences of the global residual, and the rate of Newton's method (H-8).

use super::*;
use crate::checkpoint::NoCheckpoints;
use crate::formulation::Formulation;
use crate::observer::{Outcome, Silent};
use crate::problem::{Applied, Platen, PressureKind, TangentUpdate};
use crate::solve::driver::{Session, Solver};
use claims::Claim;

pub(super) fn pressed(kind: ElementKind) -> Problem {
    let space = kind.dimension() == Dimension::Space;
    let mut mesh = if space { Block::space([2.0; 3], [2, 2, 1], kind).mesh().unwrap() } else { block(kind, 2, 2) };
    for (number, node) in mesh.nodes.iter_mut().enumerate() {
        node[0] += 0.06 * (number as f64 * 1.7).sin();
        node[1] += 0.06 * (number as f64 * 2.9).cos();
        node[2] += f64::from(u8::from(space)) * 0.06 * (number as f64 * 0.9).cos();
    }
    let pressure = |sides: &str, kind| Condition::Pressure { sides: sides.into(), value: 3.0e6, kind };
    let mut conditions = vec![
        Condition::fixed("bottom_left", Axis::X),
        Condition::Platen { nodes: "bottom".into(), contact: Platen::Smooth, axis: Axis::Y, displacement: 0.0 },
        pressure("right", PressureKind::Follower),
        pressure("top", PressureKind::Follower),
        pressure("left", PressureKind::Dead),
    ];
    if space {
        conditions.extend([pressure("front", PressureKind::Follower), Condition::fixed("bottom_back", Axis::Z)]);
    }
    let mut problem = Problem::new(mesh, conditions);
    problem.stages[0].strategy.tangent_floor = None;
    problem.stages[0].strategy.tangent_update = TangentUpdate::Always;
    problem
}

/// Every formulation on plane and solid elements, hourglass control and follower pressures included.
#[test]
fn the_stiffness_is_the_derivative_of_the_residual() {
    let kinds = [
        ElementKind::Q4,
        ElementKind::Q4Single,
        ElementKind::Q8,
        ElementKind::T6,
        ElementKind::H8,
        ElementKind::H8Single,
        ElementKind::T10,
    ];
    for (kind, formulation) in kinds.into_iter().flat_map(|kind| Formulation::ALL.map(|one| (kind, one))) {
        let mut problem = pressed(kind);
        problem.formulation = formulation;
        let error = stiffness_error(&problem);
        assert!(error < 1e-8, "{kind:?} {formulation:?}: {error:e}");
    }
}

/// Largest difference of the stiffness of a deformed body from central differences of its residual, over its largest diagonal.
pub(super) fn stiffness_error(problem: &Problem) -> f64 {
    let initial = [[-3.0e6, 2.0e5, 0.0], [2.0e5, -1.0e6, 0.0], [0.0; 3]];
    let mut material = elastic(ElasticLaw::SaintVenant, problem).with_initial_stress(initial);
    let mut solver = Solver::new(problem).unwrap();
    let mut session = Session { material: &mut material, observer: &mut Silent, store: &mut NoCheckpoints };
    let count = problem.mesh.degrees_of_freedom();
    let start: Vec<f64> = (0..count).map(|dof| 0.05 * (dof as f64 * 0.7).sin()).collect();
    // The reference of the hourglass control is that of the undeformed state, as in a run.
    solver.tangent_kind = problem.stages[0].strategy.tangent;
    solver.evaluate(&vec![0.0; count], 0.0, &mut session).unwrap();
    let mut residual = |increment: &[f64]| {
        solver.evaluate(increment, 1.0, &mut session).unwrap();
        (solver.balance.residual(), solver.balance.clone())
    };
    let balance = residual(&start).1;
    let step = 1e-6;
    let mut errors = Vec::new();
    // In space every third column: each kind of row and column is still met.
    for dof in (0..count).step_by(if count > 60 { 3 } else { 1 }) {
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
            errors.push((difference - column[row]).abs() / balance.largest_diagonal());
        }
    }
    errors.into_iter().max_by(f64::total_cmp).unwrap()
}

/// H-8. From one iteration to the next the error is squared, until round-off.
#[test]
fn newton_converges_quadratically_on_a_smooth_law() {
    for (kind, formulation) in [ElementKind::Q8, ElementKind::H8Single]
        .into_iter()
        .flat_map(|kind| Formulation::ALL.map(|formulation| (kind, formulation)))
        .filter(|(_, formulation)| *formulation != Formulation::SmallStrain)
    {
        let mut problem = pressed(kind);
        problem.formulation = formulation;
        problem.stages[0].strategy.capped_change = 1.0;
        let contact = Platen::Rough;
        problem.stages[0].conditions.push(Applied::from(Condition::Platen {
            nodes: "top".into(),
            contact,
            axis: Axis::Y,
            displacement: -0.3,
        }));
        problem.stages[0].control.increments = 1;
        problem.stages[0].tolerances = Tolerances::both(1e-11, 1e-11);
        let initial = [[-3.0e6, 0.0, 0.0], [0.0, -3.0e6, 0.0], [0.0, 0.0, -3.0e6]];
        let mut material = elastic(ElasticLaw::SaintVenant, &problem).with_initial_stress(initial);
        let (run, record) = run(&problem, &mut material);
        assert!(matches!(run.outcome, Outcome::Completed), "{kind:?} {formulation:?} {:?}", run.outcome);
        let (ratios, orders) = orders(&record, 1);
        assert!(!orders.is_empty(), "{kind:?} {formulation:?}: {ratios:?}");
        let what = if kind == ElementKind::Q8 { "Q8" } else { "one-point H8" };
        for order in orders {
            Claim::of("H-8", &format!("order of Newton's iteration, {what}")).number(order).at_least(1.8);
        }
    }
}

/// Displacement ratios of the iterations of a step, and the orders with which they fall where they are small.
pub(super) fn orders(record: &Recorder, step: usize) -> (Vec<f64>, Vec<f64>) {
    let ratios: Vec<f64> =
        record.iterations.iter().filter(|i| i.step == step).filter_map(|i| i.displacement_ratio).collect();
    let orders = ratios
        .windows(3)
        .filter(|triple| triple[0] < 0.05 && triple[2] > 1e-13)
        .map(|triple| (triple[2] / triple[1]).ln() / (triple[1] / triple[0]).ln())
        .collect();
    (ratios, orders)
}
