//! Absorbing sides in place of supports, as at the base of a body in which gravity has been at work before an earthquake.

use super::*;
use crate::problem::MultiPointConstraint;
use crate::problem::dynamics::MassScaling;
use std::f64::consts::PI;

const LAMBDA: f64 = 6.0;
const SHEAR: f64 = 3.0;
const DENSITY: f64 = 3.0;
const SIDE: f64 = 0.5;
const SPEED: f64 = 2.0;
/// Weight per volume, N/m3.
const WEIGHT: f64 = 1e-3;
const COUNT: usize = 20;

/// A bar that leans with its weight against its left end, which then lets waves out, for two dynamic stages; in the second one its
/// right end is given a push.
fn leaning_bar() -> Problem {
    leaning_bar_with(&[held("left", Axis::X)], &[held("all", Axis::Y)])
}

/// The same with these conditions at its left end until that lets waves out, and these for the whole time.
fn leaning_bar_with(end: &[Applied], throughout: &[Applied]) -> Problem {
    let weight = || Condition::BodyForce { value: [-WEIGHT, 0.0, 0.0], elements: "all".into() };
    let mut problem = Problem::new(strip(ElementKind::Q4, COUNT, SIDE), Vec::new());
    problem.formulation = Formulation::SmallStrain;
    let leans = Stage::new("leans", [&[weight().into()][..], end, throughout].concat());
    let length = COUNT as f64 * SIDE;
    let moving = |name: &str, push: f64| {
        let pulse = 6.0 * SIDE / SPEED;
        let hump = (0..=40).map(|k| f64::from(k) / 40.0).map(|share| [pulse * share, (PI * share).sin().powi(2)]);
        let push = Condition::Traction { sides: "right".into(), value: [push, 0.0, 0.0] };
        let push = Applied::new(push, Amplitude::Table(hump.chain([[1e3, 0.0]]).collect()));
        let weight = Applied::new(weight(), Amplitude::Constant);
        let mut stage = Stage::new(name, [&[weight, push][..], throughout].concat());
        stage.duration = pulse + 1.3 * length / SPEED;
        let settings = DynamicSettings { absorbing: vec!["left".into()], ..settings(DENSITY) };
        stage.procedure = Procedure::Dynamic(Box::new(settings));
        stage
    };
    problem.stages = vec![leans, moving("waits", 0.0), moving("is pushed", -1e-3)];
    problem
}

fn linked(link: MultiPointConstraint) -> Applied {
    Condition::MultiPointConstraint(link).into()
}

/// The upper and the lower side move alike.
fn periodic() -> Applied {
    let jump = [Some(0.0), Some(0.0), None];
    linked(MultiPointConstraint::Periodic { from: "bottom".into(), to: "top".into(), jump })
}

fn fastest(instant: &Instant) -> f64 {
    instant.velocities.iter().map(|velocity| velocity[0].abs().max(velocity[1].abs())).fold(0.0, f64::max)
}

/// Largest velocity in the first dynamic stage, in which nothing should happen; both have as many steps.
fn fastest_while_waiting(problem: &Problem) -> f64 {
    let film = completed(problem, &mut elastic(problem, LAMBDA, SHEAR));
    film.instants[..film.instants.len() / 2].iter().map(fastest).fold(0.0, f64::max)
}

/// A side lets waves out whatever the masses have been raised by: it has the impedance of the mass that moves.
#[test]
fn an_absorbing_side_lets_out_waves_of_raised_masses() {
    let mut problem = leaning_bar();
    for stage in &mut problem.stages[1..] {
        let Procedure::Dynamic(settings) = &mut stage.procedure else { panic!("a dynamic stage") };
        settings.mass_scaling = MassScaling::Uniform { factor: 4.0 };
        stage.duration *= 2.0;
        for applied in &mut stage.conditions {
            if let Amplitude::Table(rows) = &mut applied.history {
                rows.iter_mut().for_each(|[time, _]| *time *= 2.0);
            }
        }
    }
    let film = completed(&problem, &mut elastic(&problem, LAMBDA, SHEAR));
    let sent = film.instants.iter().map(fastest).fold(0.0, f64::max);
    let wave = 1e-3 / (4.0 * DENSITY * 0.5 * SPEED);
    assert!((sent / wave - 1.0).abs() < 0.1, "{sent} of {wave}");
    assert!(fastest(film.last()) < 0.05 * sent, "{} of {sent} is still there", fastest(film.last()));
}

/// An absorbing side goes on bearing what the support bore that it replaces, in the stage behind the next one too: the bar stays where it
/// is, and a wave leaves it.
#[test]
fn an_absorbing_side_bears_what_the_support_bore() {
    let problem = leaning_bar();
    let film = completed(&problem, &mut elastic(&problem, LAMBDA, SHEAR));
    // Both stages have as many steps.
    let waits = &film.instants[..film.instants.len() / 2];
    assert!(waits.iter().all(|instant| fastest(instant) < 1e-12), "the bar moves by itself");
    // A wave of the velocity p / (rho c), which leaves through the left end.
    let wave = 1e-3 / (DENSITY * SPEED);
    let sent = film.instants.iter().map(fastest).fold(0.0, f64::max);
    assert!((sent / wave - 1.0).abs() < 0.1, "{sent} of {wave}");
    assert!(fastest(film.last()) < 0.05 * sent, "{} of {sent} is still there", fastest(film.last()));
    assert!(film.last().energy.largest_relative_residual() < 1e-2, "{:?}", film.last().energy);
}

/// As in a column of soil, one element wide, whose sides move alike: all nodes of its base are linked, and none bore anything.
#[test]
fn linked_nodes_of_an_absorbing_side_bear_what_the_support_bore() {
    let problem = leaning_bar_with(&[held("left", Axis::X), held("left", Axis::Y)], &[periodic()]);
    let moves = fastest_while_waiting(&problem);
    assert!(moves < 1e-12, "{moves:e} m/s");
}

/// A link that goes on needs no one to bear its forces: those of one end of it alone would push the bar.
#[test]
fn an_absorbing_side_does_not_bear_what_its_links_go_on_bearing() {
    let mut problem = leaning_bar_with(&[], &[held("left", Axis::X), held("left", Axis::Y), periodic()]);
    for stage in &mut problem.stages[1..] {
        let Procedure::Dynamic(settings) = &mut stage.procedure else { panic!("a dynamic stage") };
        settings.absorbing = vec!["bottom".into()];
    }
    let moves = fastest_while_waiting(&problem);
    assert!(moves < 1e-12, "{moves:e} m/s");
}

/// The end was held by a rigid body that does not move, which is no displacement of any node.
#[test]
fn an_absorbing_side_bears_what_a_link_bore_that_was_its_support() {
    let (displacement, rotation) = ([Some(0.0), None, None], [None, None, Some(0.0)]);
    let block = linked(MultiPointConstraint::RigidBody { nodes: "left".into(), displacement, rotation });
    let moves = fastest_while_waiting(&leaning_bar_with(&[block], &[held("all", Axis::Y)]));
    assert!(moves < 1e-12, "{moves:e} m/s");
}

/// A load that begins with the stage is none that the support has borne: it moves the side against its dampers and the bar,
/// `v = p / (2 rho c)`, until the wave comes back from the other end.
#[test]
fn a_load_that_begins_at_once_acts_on_an_absorbing_side() {
    let mut problem = leaning_bar();
    problem.stages.truncate(2);
    let push = Condition::Traction { sides: "left".into(), value: [1e-3, 0.0, 0.0] };
    problem.stages[1].conditions.push(Applied::new(push, Amplitude::Constant));
    let film = completed(&problem, &mut elastic(&problem, LAMBDA, SHEAR));
    let late = &film.instants[film.instants.len() / 2..];
    for &node in &problem.mesh.node_sets["left"] {
        let mean = late.iter().map(|instant| instant.velocities[node][0]).sum::<f64>() / late.len() as f64;
        let wanted = 1e-3 / (2.0 * DENSITY * SPEED);
        assert!((mean / wanted - 1.0).abs() < 0.03, "{mean} of {wanted}");
    }
}
