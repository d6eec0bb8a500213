//! Tied nodes in motion.

use super::*;
use crate::problem::dynamics::{InitialVelocity, TimeStepRule};
use crate::problem::{MultiPointConstraint, ProblemError};
use std::f64::consts::PI;

fn linked(link: MultiPointConstraint) -> Applied {
    Condition::MultiPointConstraint(link).into()
}

fn periodic(from: &str, to: &str, jump: [Option<f64>; 3], history: Amplitude) -> Applied {
    Applied::new(
        Condition::MultiPointConstraint(MultiPointConstraint::Periodic { from: from.into(), to: to.into(), jump }),
        history,
    )
}

/// Gives every node its own velocity.
fn thrown(mesh: &mut Mesh, settings: &mut DynamicSettings, velocity: impl Fn([f64; 3]) -> [f64; 3]) {
    for node in 0..mesh.nodes.len() {
        let name = format!("node {node}");
        settings.initial_velocities.push(InitialVelocity { nodes: name.clone(), value: velocity(mesh.nodes[node]) });
        mesh.node_sets.insert(name, vec![node]);
    }
}

/// Only the lower side is struck. Tied to its image it shares that motion from the start, and the strip vibrates at the discrete
/// frequency of a shear beam, `sin(w dt / 2) = (c dt / h) sin(k h / 2)`.
#[test]
fn a_strip_with_periodic_sides_vibrates_like_a_beam_of_no_width() {
    let (count, side, speed) = (12, 0.5, 1.0);
    let step = 0.3 * side / speed;
    let wave = PI / (count as f64 * side);
    let frequency = 2.0 / step * (speed * step / side * (0.5 * wave * side).sin()).asin();
    let mut mesh = strip(ElementKind::Q4, count, side);
    let mut settings = DynamicSettings { step: TimeStepRule::Fixed { step }, ..settings(3.0) };
    thrown(&mut mesh, &mut settings, |[x, y, _]| [0.0, if y < 0.25 { 2e-3 * (wave * x).sin() } else { 0.0 }, 0.0]);
    let mut conditions = vec![periodic("bottom", "top", [Some(0.0), Some(0.0), None], Amplitude::RAMP)];
    conditions.extend(["left", "right"].into_iter().flat_map(|end| [Axis::X, Axis::Y].map(|axis| held(end, axis))));
    let problem = problem(mesh, conditions, 40.0 * step, settings);
    let film = completed(&problem, &mut elastic(&problem, 6.0, 3.0));
    for instant in &film.instants {
        let phase = frequency * instant.time;
        let amplitude = 1e-3 * phase.sin() * step / (frequency * step).sin();
        for (place, moved) in problem.mesh.nodes.iter().zip(&instant.displacements) {
            let exact = amplitude * (wave * place[0]).sin();
            assert!((moved[1] - exact).abs() < 1e-10 && moved[0].abs() < 1e-12, "{} {moved:?} {exact}", instant.time);
        }
    }
    assert!(film.last().energy.largest_relative_residual() < 0.02, "{:?}", film.last().energy);
}

/// Whatever its nodes are thrown with, a free rigid body flies with the velocity and spin of its momentum, for ever.
#[test]
fn a_rigid_body_keeps_its_momentum() {
    let mut mesh = Block::plane([3.0, 2.0], [3, 2], ElementKind::Q4).mesh().unwrap();
    let mut settings = DynamicSettings { step: TimeStepRule::Fixed { step: 0.01 }, ..settings(2.0) };
    thrown(&mut mesh, &mut settings, |[x, y, _]| [1e-3 * (3.0 * x + y).sin(), 1e-3 * (x - 2.0 * y).cos(), 0.0]);
    let start: Vec<[f64; 3]> = settings.initial_velocities.iter().map(|given| given.value).collect();
    // Every element gives a quarter of its 2 kg to each corner.
    let mut masses = vec![0.0; mesh.nodes.len()];
    mesh.elements.iter().flatten().for_each(|&node| masses[node] += 0.5);
    let total: f64 = masses.iter().sum();
    let mean = |of: &dyn Fn(usize) -> f64| (0..masses.len()).map(|node| masses[node] * of(node)).sum::<f64>() / total;
    let centre = [0, 1].map(|axis| mean(&|node| mesh.nodes[node][axis]));
    let speed = [0, 1].map(|axis| mean(&|node| start[node][axis]));
    let arm = |node: usize| [mesh.nodes[node][0] - centre[0], mesh.nodes[node][1] - centre[1]];
    let spin = mean(&|node| arm(node)[0] * start[node][1] - arm(node)[1] * start[node][0])
        / mean(&|node| arm(node)[0].powi(2) + arm(node)[1].powi(2));
    let rigid = |node: usize| [speed[0] - spin * arm(node)[1], speed[1] + spin * arm(node)[0]];
    let body = MultiPointConstraint::RigidBody { nodes: "all".into(), displacement: [None; 3], rotation: [None; 3] };
    let problem = problem(mesh.clone(), vec![linked(body)], 0.2, settings);
    let film = completed(&problem, &mut elastic(&problem, 6.0, 3.0));
    assert_eq!(film.instants.len(), 21);
    for instant in &film.instants {
        for node in 0..masses.len() {
            for axis in 0..2 {
                let error = instant.velocities[node][axis] - rigid(node)[axis];
                assert!(error.abs() < 1e-14, "{} {node} {error:e}", instant.time);
            }
        }
    }
}

/// A jump that grows is met at every instant; the other one finds its own value; what the ties do is in the ledger.
#[test]
fn a_periodic_cell_is_stretched_by_its_jump_and_by_nothing_else() {
    let mesh = Block::plane([2.0, 2.0], [2, 2], ElementKind::Q4).mesh().unwrap();
    let slowly = moved("bottom_left", Axis::X, 0.0, Amplitude::Constant);
    let conditions = vec![
        periodic("left", "right", [Some(1e-3), Some(0.0), None], Amplitude::RAMP),
        periodic("bottom", "top", [Some(0.0), None, None], Amplitude::RAMP),
        slowly,
        held("bottom_left", Axis::Y),
    ];
    let mut settings = settings(1e-3);
    settings.damping.mass = 2.0;
    let problem = problem(mesh, conditions, 1.0, settings);
    let film = completed(&problem, &mut elastic(&problem, 2.0, 1.0));
    let [left, right] = ["left", "right"].map(|set| problem.mesh.node_sets[set].clone());
    for instant in &film.instants {
        for (&one, &other) in left.iter().zip(&right) {
            let stretch = instant.displacements[other][0] - instant.displacements[one][0];
            assert!((stretch - 1e-3 * instant.time).abs() < 1e-15, "{} {stretch}", instant.time);
        }
    }
    let last = film.last();
    assert!(last.energy.largest_relative_residual() < 0.02, "{:?}", last.energy);
    for point in &last.points {
        // Slow against its waves: uniaxial stress along x, in plane strain.
        let [[xx, _], [_, yy]] = point.stress.plane();
        let exact = 4.0 * 1.0 * (2.0 + 1.0) / (2.0 + 2.0) * 5e-4;
        assert!((xx / exact - 1.0).abs() < 0.02 && yy.abs() < 0.02 * xx, "{xx} {exact} {yy}");
    }
}

/// An absorbing side across the axes couples the components of a node; ties there are refused before any step.
#[test]
fn ties_of_obliquely_damped_nodes_are_refused_with_the_remedy() {
    let mut mesh = Block::plane([2.0, 2.0], [2, 2], ElementKind::Q4).mesh().unwrap();
    mesh.nodes.iter_mut().for_each(|place| place[0] += 0.3 * place[1]);
    let mut settings = settings(1.0);
    settings.absorbing = vec!["right".into()];
    let platen = MultiPointConstraint::TiltingPlaten {
        nodes: "right".into(),
        axis: Axis::X,
        displacement: None,
        rotation: [None; 3],
    };
    let problem = problem(mesh, vec![linked(platen)], 1.0, settings);
    let (run, film) = run(&problem, &mut elastic(&problem, 6.0, 3.0));
    let Outcome::Refused(error @ ProblemError::MultiPointConstraint { .. }) = run.outcome else {
        panic!("{:?}", run.outcome)
    };
    assert!(error.to_string().contains("oblique") && film.instants.is_empty(), "{error}");
}
