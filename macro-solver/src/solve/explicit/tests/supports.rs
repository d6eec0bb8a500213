//! Supports whose velocity or acceleration is prescribed, and smooth starts, against d'Alembert's solution.

use super::*;
use crate::problem::dynamics::TimeStepRule;
use crate::problem::{Moment, Rate, RateHistory, SmoothRamp};

/// P-wave modulus 12 Pa, density, side of an element: a P-wave speed of 2 m/s.
const LAMBDA: f64 = 6.0;
const SHEAR: f64 = 3.0;
const DENSITY: f64 = 3.0;
const SIDE: f64 = 0.5;
const SPEED: f64 = 2.0;

fn rate(rate: Rate, history: Amplitude) -> Amplitude {
    Amplitude::Rate(Box::new(RateHistory::new(rate, history)))
}

/// A bar of 40 elements whose left end is led by a history for 38 steps of h / c; nothing moves across.
fn led(value: f64, history: Amplitude) -> Problem {
    let (step, steps) = (SIDE / SPEED, 38);
    let conditions = vec![moved("left", Axis::X, value, history), held("all", Axis::Y)];
    let settings = DynamicSettings { step: TimeStepRule::Fixed { step }, ..settings(DENSITY) };
    problem(strip(ElementKind::Q4, 40, SIDE), conditions, f64::from(steps) * step, settings)
}

/// With lumped masses and the step h / c the bar repeats at every node what its end did: `u = f(t - x / c)`. The end has the velocity
/// `a t` and the acceleration `a` from the start on, and its support the force of the wave, `rho c A v`.
#[test]
fn a_constant_acceleration_is_met_from_the_start() {
    let acceleration = 0.02;
    let problem = led(acceleration, rate(Rate::Acceleration, Amplitude::Constant));
    let film = completed(&problem, &mut elastic(&problem, LAMBDA, SHEAR));
    let left = &problem.mesh.node_sets["left"];
    for instant in &film.instants {
        for (node, moved) in problem.mesh.nodes.iter().zip(&instant.displacements) {
            let exact = 0.5 * acceleration * (instant.time - node[0] / SPEED).max(0.0).powi(2);
            assert!((moved[0] - exact).abs() < 1e-12, "{node:?} at {}", instant.time);
        }
        for &node in left {
            let [velocity, rate] = [instant.velocities[node][0], instant.accelerations[node][0]];
            assert!((velocity - acceleration * instant.time).abs() < 1e-13, "{velocity} at {}", instant.time);
            assert!((rate - acceleration).abs() < 1e-12, "{rate} at {}", instant.time);
        }
        let force: f64 = left.iter().map(|&node| instant.reactions[node][0]).sum();
        // At the start the end has its share of the mass to push and nothing has come back from the wave yet.
        let own_mass = 0.5 * DENSITY * SIDE * SIDE;
        let wave = DENSITY * SPEED * SIDE * acceleration * instant.time;
        let exact = if instant.time == 0.0 { own_mass * acceleration } else { wave };
        assert!((force - exact).abs() < 1e-11, "{force} instead of {exact} at {}", instant.time);
    }
    assert!(film.last().energy.largest_relative_residual() < 1e-2, "{:?}", film.last().energy);
}

/// A velocity that rises and falls in straight lines: its integral is met at every instant, and so is the velocity at the start.
#[test]
fn a_velocity_is_met_where_it_changes_and_at_the_start() {
    let history = Amplitude::Table(vec![[0.0, 0.5], [2.5, 1.0], [5.0, -1.0]]);
    let problem = led(0.1, rate(Rate::Velocity, history.clone()));
    let film = completed(&problem, &mut elastic(&problem, LAMBDA, SHEAR));
    let node = problem.mesh.node_sets["left"][0];
    let at = |time: f64| 0.1 * history.factor(Moment { load: 0.0, time });
    assert_eq!(film.instants[0].velocities[node][0], at(0.0));
    let step = film.instants[0].time_step;
    for (number, instant) in film.instants.iter().enumerate().skip(1) {
        let corner = [2.5, 5.0].iter().any(|time| (instant.time - time).abs() < 1.5 * step);
        let found = instant.velocities[node][0];
        assert!(corner || (found - at(instant.time)).abs() < 1e-13, "{found} at instant {number}");
        let before = film.instants[number - 1].displacements[node][0];
        let path = instant.displacements[node][0] - before;
        let mean = 0.5 * (at(instant.time) + at(instant.time - step));
        assert!(corner || (path / step - mean).abs() < 1e-12, "the path over instant {number}");
    }
}

/// A history that ends with the stage while it still moves: the last instant has its velocity, no acceleration and the force of the wave, as
/// the instants before. It was that of a support that is stopped at once.
#[test]
fn a_history_that_ends_with_the_stage_moves_in_its_last_instant() {
    let duration = 38.0 * SIDE / SPEED;
    let table = Amplitude::Table(vec![[0.0, 0.0], [duration, 1.0]]);
    let shape = SmoothRamp { start: 0.25, stop: 0.0 };
    let speeds =
        [(table, 0.1), (Amplitude::SmoothRamp { from: 0.0, to: 1.0, shape }, 0.1 / 0.875), (Amplitude::RAMP, 0.1)];
    for (history, velocity) in speeds {
        let problem = led(0.1 * duration, history.clone());
        let film = completed(&problem, &mut elastic(&problem, LAMBDA, SHEAR));
        let left = &problem.mesh.node_sets["left"];
        let last = film.last();
        for &node in left {
            let found = [last.velocities[node][0], last.accelerations[node][0]];
            assert!((found[0] - velocity).abs() < 1e-12 && found[1].abs() < 1e-11, "{found:?} with {history:?}");
            assert_eq!(last.displacements[node][0], 0.1 * duration);
        }
        let force: f64 = left.iter().map(|&node| last.reactions[node][0]).sum();
        assert!((force - DENSITY * SPEED * SIDE * velocity).abs() < 1e-11, "{force} with {history:?}");
    }
}

/// The stress that a smooth start sends into the bar grows from nothing: no jump larger than the rate's own, whereas a plain ramp begins
/// with the whole of `rho c v`.
#[test]
fn a_smooth_ramp_sends_no_step_into_the_bar() {
    let shape = SmoothRamp { start: 0.5, stop: 0.0 };
    let smooth = led(0.95, Amplitude::SmoothRamp { from: 0.0, to: 1.0, shape });
    let largest_jump = |problem: &Problem| {
        let film = completed(problem, &mut elastic(problem, LAMBDA, SHEAR));
        let node = problem.mesh.node_sets["left"][0];
        assert_eq!(film.last().displacements[node][0], 0.95);
        let stress = |instant: &Instant| instant.points[0].stress.get(0, 0);
        let pairs = film.instants.windows(2).map(|pair| (stress(&pair[1]) - stress(&pair[0])).abs());
        let start = &film.instants[0];
        (pairs.fold(0.0, f64::max), [start.velocities[node][0], start.accelerations[node][0]])
    };
    let (jump, start) = largest_jump(&smooth);
    // The rate is 0.95 m over 9.5 s, with half of the stage at a mean of half: 0.4 / 3 m/s. It changes by 1.5 over its start at most.
    let velocity = 0.1 / 0.75;
    let most = DENSITY * SPEED * velocity * 1.5 / 19.0;
    assert!(jump < 1.05 * most && jump > 0.9 * most, "{jump} against {most}");
    // Its acceleration over the first half step is that of a rate that grows from 0: 2 du / dt^2 with du = V a H(dt / a).
    let step = 1.0 / 38.0 / 0.5_f64;
    let first = 0.95 / 0.75 * 0.5 * step.powi(3) * (1.0 - 0.5 * step);
    assert!(start[0] == 0.0 && (start[1] - 2.0 * first / 0.0625).abs() < 1e-12, "{start:?}");
    let (jump, _) = largest_jump(&led(0.95, Amplitude::RAMP));
    assert!(jump > 0.45 * DENSITY * SPEED * 0.1, "{jump}");
    let (_, start) = largest_jump(&led(0.95, Amplitude::SMOOTH));
    let x = 1.0 / 38.0_f64;
    let first = 0.95 * x.powi(3) * (10.0 - 15.0 * x + 6.0 * x * x);
    assert!(start[0] == 0.0 && (start[1] - 2.0 * first / 0.0625).abs() < 1e-12, "{start:?}");
}

/// A body of which nothing is free had no stable step, and went through the whole stage in one.
#[test]
fn a_body_whose_nodes_are_all_led_is_resolved_as_its_element_would_be_by_itself() {
    let stretch = moved("right", Axis::X, 1e-3, Amplitude::RAMP);
    let conditions = vec![held("left", Axis::X), stretch, held("bottom", Axis::Y), held("top", Axis::Y)];
    let problem = problem(strip(ElementKind::Q4, 1, 1.0), conditions, 60.0, settings(2.0));
    let film = completed(&problem, &mut elastic(&problem, 1.0, 1.0));
    // A wave takes 0.8 s from side to side.
    assert!(film.last().time_step < 0.9, "{}", film.last().time_step);
    assert!((film.last().points[0].stress.get(0, 0) - 3e-3).abs() < 1e-12);
}
