//! H-9, I-5 and the absorbing boundary: waves along bars and columns.

use super::*;
use crate::problem::dynamics::{InitialVelocity, TimeStepRule};
use claims::Claim;
use std::f64::consts::{PI, TAU};

/// P-wave modulus, shear modulus, density, side of an element: a P-wave speed of 2 m/s, an S-wave speed of 1 m/s.
const LAMBDA: f64 = 6.0;
const SHEAR: f64 = 3.0;
const DENSITY: f64 = 3.0;
const SIDE: f64 = 0.5;

/// A bar whose left end moves with the velocity 0.1 m/s from the start on; nothing moves across.
fn impact(kind: ElementKind, count: usize, courant: f64, steps: usize) -> Problem {
    let step = courant * SIDE / 2.0;
    let duration = steps as f64 * step;
    let push = moved("left", Axis::X, 0.1 * duration, Amplitude::RAMP);
    let settings = DynamicSettings { step: TimeStepRule::Fixed { step }, ..settings(DENSITY) };
    problem(strip(kind, count, SIDE), vec![push, held("all", Axis::Y)], duration, settings)
}

/// H-9: with lumped masses and the step h / c the solution of d'Alembert is met at every node: `u = v (t - x / c)`.
#[test]
fn a_step_of_velocity_is_exact_at_the_nodes_at_courant_one() {
    for kind in [ElementKind::Q4, ElementKind::Q4Single] {
        let problem = impact(kind, 40, 1.0, 38);
        let film = completed(&problem, &mut elastic(&problem, LAMBDA, SHEAR));
        let mut errors = Vec::new();
        for instant in &film.instants {
            for (node, moved) in problem.mesh.nodes.iter().zip(&instant.displacements) {
                let exact = 0.1 * (instant.time - node[0] / 2.0).max(0.0);
                assert_eq!(moved[1], 0.0, "{kind:?} {node:?} {}", instant.time);
                errors.push((moved[0] - exact).abs());
            }
        }
        let worst = errors.into_iter().max_by(f64::total_cmp).unwrap();
        Claim::of("H-9", "displacements at Courant number 1, m").error(worst).within(1e-12);
        // Behind the front the stress is rho c v.
        let stress = film.last().points[0].stress.get(0, 0);
        let exact = -(DENSITY * 2.0 * 0.1);
        Claim::of("H-9", "stress behind the front at Courant number 1, Pa").value(stress, exact).within(1e-12);
    }
}

/// H-9: free vibrations of a bar with held ends obey `sin(w dt / 2) = (c dt / h) sin(k h / 2)`.
#[test]
fn vibrations_below_courant_one_have_the_discrete_frequency() {
    let (count, courant) = (16, 0.6);
    let step = courant * SIDE / 2.0;
    let wave = 3.0 * PI / (count as f64 * SIDE);
    let frequency = 2.0 / step * (courant * (0.5 * wave * SIDE).sin()).asin();
    let duration = TAU / frequency * 3.3;
    let mut mesh = strip(ElementKind::Q4, count, SIDE);
    let mut settings = DynamicSettings { step: TimeStepRule::Fixed { step }, ..settings(DENSITY) };
    for node in 0..mesh.nodes.len() {
        let name = format!("node {node}");
        let value = [1e-3 * (wave * mesh.nodes[node][0]).sin(), 0.0, 0.0];
        settings.initial_velocities.push(InitialVelocity { nodes: name.clone(), value });
        mesh.node_sets.insert(name, vec![node]);
    }
    let ends = vec![held("left", Axis::X), held("right", Axis::X), held("all", Axis::Y)];
    let problem = problem(mesh, ends, duration, settings);
    let film = completed(&problem, &mut elastic(&problem, LAMBDA, SHEAR));
    // Started with a velocity, u_n = v sin(w n dt) dt / sin(w dt).
    let step = film.last().time_step;
    let frequency = 2.0 / step * (2.0 * step / SIDE * (0.5 * wave * SIDE).sin()).asin();
    let scale = 1e-3 * step / (frequency * step).sin();
    let errors = film.instants.iter().flat_map(|instant| {
        problem.mesh.nodes.iter().zip(&instant.displacements).map(move |(node, moved)| {
            let exact = scale * (wave * node[0]).sin() * (frequency * instant.time).sin();
            (moved[0] - exact).abs()
        })
    });
    let worst = errors.max_by(f64::total_cmp).unwrap();
    Claim::of("H-9", "vibration at Courant number 0.6, over its amplitude").error(worst / scale).within(1e-6);
}

/// With it the ratio of wave speeds is that of [Liu2015] table II, 631 over 382 m/s.
const COLUMN_LAMBDA: f64 = 2.186;

/// A column of `count` elements along y; its sides move alike because nothing moves along y.
fn column(count: usize) -> Mesh {
    Block::plane([SIDE, count as f64 * SIDE], [1, count], ElementKind::Q4Single).mesh().unwrap()
}

/// I-5: a standing shear wave `u = a sin(k y) / sin(k L) sin(w t)` between a held base and a driven top, 20 elements per
/// wave length, within 1 %.
#[test]
fn a_driven_shear_column_carries_the_standing_wave() {
    let count = 5;
    let height = count as f64 * SIDE;
    let wave = TAU / (20.0 * SIDE);
    let frequency = wave * 1.0;
    let mut mesh = column(count);
    let mut settings = settings(DENSITY);
    let amplitude = 1e-4;
    let shape = |y: f64| amplitude * (wave * y).sin() / (wave * height).sin();
    for node in 0..mesh.nodes.len() {
        let name = format!("node {node}");
        let value = [frequency * shape(mesh.nodes[node][1]), 0.0, 0.0];
        settings.initial_velocities.push(InitialVelocity { nodes: name.clone(), value });
        mesh.node_sets.insert(name, vec![node]);
    }
    let drive = Amplitude::Sine { frequency: frequency / TAU, phase: 0.0 };
    let conditions = vec![moved("top", Axis::X, amplitude, drive), held("bottom", Axis::X), held("all", Axis::Y)];
    let problem = problem(mesh, conditions, TAU / frequency, settings);
    let film = completed(&problem, &mut elastic(&problem, COLUMN_LAMBDA, SHEAR));
    let mut worst: f64 = 0.0;
    for instant in &film.instants {
        for (node, moved) in problem.mesh.nodes.iter().zip(&instant.displacements) {
            worst = worst.max((moved[0] - shape(node[1]) * (frequency * instant.time).sin()).abs());
        }
    }
    Claim::of("I-5", "standing shear wave of a driven column, over its amplitude")
        .error(worst / amplitude)
        .within(0.01);
    let quantity = "residual of the energy balance, driven column";
    Claim::of("H-13", quantity).error(film.last().energy.largest_relative_residual()).within(1e-2);
}

/// I-5: the front of a shear wave crosses the column in L / c_s; half the motion of the base passes at that time.
#[test]
fn a_shear_front_arrives_on_time() {
    let count = 60;
    let mut settings = settings(DENSITY);
    settings.absorbing = vec!["top".into()];
    let (rise, arrival) = (10.0 * SIDE, 60.0 * SIDE);
    let push = Amplitude::Table(
        (0..=40)
            .map(|k| {
                let share = f64::from(k) / 40.0;
                [rise * share, 0.5 - 0.5 * (PI * share).cos()]
            })
            .collect(),
    );
    let conditions = vec![moved("bottom", Axis::X, 1e-4, push), held("all", Axis::Y)];
    let problem = problem(column(count), conditions, arrival + 1.2 * rise, settings);
    let film = completed(&problem, &mut elastic(&problem, COLUMN_LAMBDA, SHEAR));
    let top = problem.mesh.node_sets["top"][0];
    let passed = |instant: &&Instant| instant.displacements[top][0] >= 0.5e-4;
    let half = film.instants.iter().find(passed).unwrap().time;
    Claim::of("I-5", "arrival of a shear front, s").value(half - 0.5 * rise, arrival).within(0.01);
}

/// Lysmer and Kuhlemeyer: P and S waves that arrive at a right angle leave; what comes back has less than 1 % of the energy.
#[test]
fn an_absorbing_end_lets_both_waves_out() {
    for (axis, across) in [(Axis::X, Axis::Y), (Axis::Y, Axis::X)] {
        let count = 60;
        let speed = if axis == Axis::X { 2.0 } else { 1.0 };
        let pulse = 24.0 * SIDE / speed;
        let hump = Amplitude::Table(
            (0..=60)
                .map(|k| {
                    let share = f64::from(k) / 60.0;
                    [pulse * share, (PI * share).sin().powi(2)]
                })
                .collect(),
        );
        let mut settings = settings(DENSITY);
        settings.absorbing = vec!["right".into()];
        let conditions = vec![moved("left", axis, 1e-4, hump), held("all", across)];
        let duration = pulse + 1.3 * count as f64 * SIDE / speed;
        let problem = problem(strip(ElementKind::Q4, count, SIDE), conditions, duration, settings);
        let film = completed(&problem, &mut elastic(&problem, LAMBDA, SHEAR));
        let energy = |instant: &Instant| instant.energy.kinetic + instant.energy.internal;
        let sent = film.instants.iter().map(|instant| instant.energy.kinetic).fold(0.0, f64::max);
        let left = energy(film.last());
        assert!(left.abs() < 0.01 * sent, "{axis:?}: {:.1e} of the energy is still there", left / sent);
        let quantity = "residual of the energy balance, waves into an absorbing end";
        Claim::of("H-13", quantity).error(film.last().energy.largest_relative_residual()).within(1e-2);
    }
}

/// The rate form of [Liu2015] on a bar that turns as a whole: stresses turn with it, energy is kept (H-13).
#[test]
fn a_spinning_vibrating_bar_keeps_its_energy() {
    let count = 8;
    let mut mesh = strip(ElementKind::Q4, count, SIDE);
    let mut settings = settings(DENSITY);
    let spin = 0.05;
    for node in 0..mesh.nodes.len() {
        let [x, y, _] = mesh.nodes[node];
        let name = format!("node {node}");
        let stretching = 0.01 * (PI * x / (count as f64 * SIDE)).cos();
        let value = [-spin * (y - 0.25) + stretching, spin * (x - 2.0), 0.0];
        settings.initial_velocities.push(InitialVelocity { nodes: name.clone(), value });
        mesh.node_sets.insert(name, vec![node]);
    }
    // A quarter turn takes 31 s.
    let mut problem = problem(mesh, Vec::new(), 31.4, settings);
    problem.formulation = Formulation::Corotational;
    let film = completed(&problem, &mut elastic(&problem, LAMBDA, SHEAR));
    let last = film.last();
    let (first, end) = (problem.mesh.node_sets["bottom_left"][0], problem.mesh.node_sets["bottom_right"][0]);
    let place = |node: usize, axis: usize| problem.mesh.nodes[node][axis] + last.displacements[node][axis];
    assert!((place(end, 0) - place(first, 0)).abs() < 0.2, "the bar stands upright");
    assert!((place(end, 1) - place(first, 1) - 4.0).abs() < 0.1);
    let quantity = "residual of the energy balance, bar that vibrates during a quarter turn";
    Claim::of("H-13", quantity).error(last.energy.largest_relative_residual()).within(1e-2);
}

/// A bar whose far half is four times as heavy: its mass is the sum, its step that of the light half, and a wave that meets the
/// heavy half comes back by the ratio of the impedances, `(1 - 2) / (1 + 2)`.
#[test]
fn elements_have_densities_of_their_own() {
    let (count, speed) = (80, 1e-3);
    let light = settings(1.0);
    let heavy = DynamicSettings {
        element_densities: (0..count).map(|element| if element < count / 2 { 1.0 } else { 4.0 }).collect(),
        ..settings(1.0)
    };
    let struck = |settings: DynamicSettings| {
        let push = moved("left", Axis::X, speed * 50.0, Amplitude::RAMP);
        let mesh = strip(ElementKind::Q4, count, 1.0);
        let problem = problem(mesh, vec![push, held("all", Axis::Y)], 50.0, settings);
        let mut material = elastic(&problem, 0.0, 0.5);
        completed(&problem, &mut material)
    };
    let (plain, film) = (struck(light), struck(heavy));
    assert!((film.last().mass / 200.0 - 1.0).abs() < 1e-12, "{}", film.last().mass);
    assert_eq!(film.last().time_step, plain.last().time_step);
    // The wave of speed 1 is back at 35 m after 45 s; the stress there doubles by 1 + (Z2 - Z1) / (Z2 + Z1) = 4/3.
    let stress = |film: &Film, from: usize, to: usize| {
        let points = &film.last().points;
        let chosen: Vec<f64> = points
            .iter()
            .filter(|point| (from..to).contains(&point.element))
            .map(|point| point.stress.get(0, 0))
            .collect();
        chosen.iter().sum::<f64>() / chosen.len() as f64
    };
    assert!((stress(&film, 33, 38) / -speed - 4.0 / 3.0).abs() < 0.03, "{}", stress(&film, 33, 38));
    assert!((stress(&plain, 33, 38) / -speed - 1.0).abs() < 0.03, "{}", stress(&plain, 33, 38));
}

#[test]
fn a_side_that_is_named_twice_absorbs_once() {
    let ends = |absorbing: &[&str]| {
        let mut settings = settings(DENSITY);
        settings.absorbing = absorbing.iter().map(|&name| name.to_owned()).collect();
        let push = moved("left", Axis::X, 1e-3, Amplitude::RAMP);
        let mesh = strip(ElementKind::Q4, 8, SIDE);
        // Twice as long as the wave takes to the other end.
        let problem = problem(mesh, vec![push, held("all", Axis::Y)], 8.0, settings);
        let film = completed(&problem, &mut elastic(&problem, LAMBDA, SHEAR));
        film.last().displacements.clone()
    };
    let once = ends(&["right"]);
    assert_eq!(ends(&["right", "right"]), once);
    assert_ne!(ends(&[]), once);
}
