//! S-9: what is too fast for its step is stopped; H-13: what is not keeps its energy; the step that elements allow.

use super::*;
use crate::element::hourglass::HourglassControl;
use crate::problem::dynamics::{InitialVelocity, MassScaling, RayleighDamping, TimeStepRule};
use claims::Claim;

/// A square of 6 x 6 elements with an edge struck by a velocity of 1e-3 m/s, free elsewhere.
fn struck(kind: ElementKind, settings: DynamicSettings, duration: f64) -> Problem {
    let mesh = Block::plane([6.0, 6.0], [6, 6], kind).mesh().unwrap();
    let mut settings = settings;
    settings.initial_velocities = vec![
        InitialVelocity { nodes: "left".into(), value: [1e-3, 0.0, 0.0] },
        InitialVelocity { nodes: "top_right".into(), value: [-2e-3, 1e-3, 0.0] },
    ];
    problem(mesh, vec![held("bottom", Axis::Y)], duration, settings)
}

/// The largest step that a body of this kind allows: the highest frequency of its assembly by power iteration on the run itself
/// would be circular, so elements of one size that fill the body are used, whose bound is that of the mesh to some percent.
fn stable_step(kind: ElementKind) -> f64 {
    let settings = DynamicSettings { step: TimeStepRule::Stable { safety: 1.0 }, ..settings(2.0) };
    let problem = struck(kind, settings, 1e3);
    completed_start(&problem)
}

/// Time step of a run that is stopped after its first report.
fn completed_start(problem: &Problem) -> f64 {
    struct Once(f64);
    impl Observer for Once {
        fn accepted(&mut self, _report: &StepReport, fields: &FieldsView<'_>) -> Result<(), StopRequest> {
            self.0 = fields.dynamics.map_or(0.0, |dynamics| dynamics.time_step);
            Err(StopRequest { reason: "seen".into() })
        }
    }
    let mut once = Once(0.0);
    solve(problem, &mut elastic(problem, 1.0, 1.0), &mut once);
    once.0
}

/// S-9: one element, whose bound is exact, 1 % beyond it: stopped within 50 steps, with step and remedy.
#[test]
fn a_step_one_percent_beyond_the_critical_one_is_stopped_within_fifty_steps() {
    for kind in [ElementKind::Q4, ElementKind::Q4Single, ElementKind::Q8] {
        let mesh = Block::plane([1.0, 1.0], [1, 1], kind).mesh().unwrap();
        let start = InitialVelocity { nodes: "top_right".into(), value: [1e-3, 2e-3, 0.0] };
        let with = |step| {
            let settings = DynamicSettings { step, initial_velocities: vec![start.clone()], ..settings(2.0) };
            problem(mesh.clone(), Vec::new(), 100.0, settings)
        };
        let critical = completed_start(&with(TimeStepRule::Stable { safety: 1.0 }));
        let beyond = with(TimeStepRule::Fixed { step: 1.01 * critical });
        let (outcome, film) = run(&beyond, &mut elastic(&beyond, 1.0, 1.0));
        match &outcome.outcome {
            Outcome::Unstable { step, .. } => {
                let quantity = "steps until one element at 1.01 times its critical step is stopped";
                Claim::of("S-9", quantity).number(*step as f64).at_most(50.0);
            }
            other => panic!("{kind:?}: {other:?}"),
        }
        assert!(film.instants.iter().all(|instant| instant.energy.residual().is_finite()));
        let below = with(TimeStepRule::Fixed { step: 0.99 * critical });
        completed(&below, &mut elastic(&below, 1.0, 1.0));
    }
}

/// S-9 on a mesh: elements bound the body's frequency from above, by 15 % for squares whose fastest
/// mode is a change of volume, which not all of them can follow at once.
#[test]
fn an_unstable_mesh_is_stopped_and_a_stable_one_keeps_its_energy() {
    for kind in [ElementKind::Q4, ElementKind::Q4Single, ElementKind::T3] {
        let critical = stable_step(kind);
        let fast = DynamicSettings { step: TimeStepRule::Fixed { step: 1.25 * critical }, ..settings(2.0) };
        let problem = struck(kind, fast, 200.0 * critical);
        let (outcome, _) = run(&problem, &mut elastic(&problem, 1.0, 1.0));
        match outcome.outcome {
            Outcome::Unstable { step, ref reason, .. } => {
                assert!(
                    reason.contains("energy") && reason.contains("stable up to a time step of"),
                    "{kind:?}: {reason}"
                );
                let quantity = "steps until a mesh at 1.25 times the bound of its elements is stopped";
                Claim::of("S-9", quantity).number(step as f64).at_most(50.0);
            }
            other => panic!("{kind:?}: {other:?}"),
        }
        let calm = DynamicSettings { step: TimeStepRule::Stable { safety: 0.9 }, longest_excess: 0, ..settings(2.0) };
        let problem = struck(kind, calm, 500.0 * critical);
        let film = completed(&problem, &mut elastic(&problem, 1.0, 1.0));
        let energy = film.last().energy;
        assert!(energy.external.abs() < 1e-12 * energy.largest && energy.kinetic > 0.0);
    }
}

/// H-13 enforced: struck nodes swing at the frequency of the mesh. The energy does not grow, but the step does not resolve the motion, so
/// its balance stays off by more than 1e-2 and the run is stopped, unless told to go on. Damping that takes that motion away lets it
/// run.
#[test]
fn a_motion_that_the_step_does_not_resolve_is_stopped() {
    let with = |longest_excess, stiffness| {
        let damping = RayleighDamping { mass: 0.0, stiffness };
        let settings = DynamicSettings { longest_excess, damping, ..settings(2.0) };
        struck(ElementKind::Q4, settings, 300.0)
    };
    let defaults = DynamicSettings::new(2.0);
    let coarse = with(defaults.longest_excess, 0.0);
    let (outcome, film) = run(&coarse, &mut elastic(&coarse, 1.0, 1.0));
    match outcome.outcome {
        Outcome::Unstable { step, ref reason, .. } => {
            assert!(reason.contains("does not grow"), "{step}: {reason}");
            let quantity = "step at which a motion that the step does not resolve is stopped";
            Claim::of("H-13", quantity).value(step as f64, 200.0).within_absolute(0.0);
        }
        other => panic!("{other:?}"),
    }
    assert!(film.last().energy.longest_excess >= 198 && film.last().energy.largest_relative_residual() > 0.1);
    let patient = with(0, 0.0);
    let film = completed(&patient, &mut elastic(&patient, 1.0, 1.0));
    assert!(film.last().energy.excess_steps > 300);
    let damped = with(defaults.longest_excess, 0.5);
    let film = completed(&damped, &mut elastic(&damped, 1.0, 1.0));
    let energy = film.last().energy;
    assert!(energy.excess_steps < 100, "{energy:?}");
}

/// Mass scaling to a step: the step is reached, the added mass is that of the element equation, and it is told.
#[test]
fn scaled_masses_allow_the_wanted_step_and_are_reported() {
    let mut mesh = Block::plane([4.0, 1.0], [4, 1], ElementKind::Q4).mesh().unwrap();
    // The last column is a tenth as wide and would set the step.
    for node in &mut mesh.nodes {
        node[0] = if node[0] > 3.5 { 3.1 } else { node[0] };
    }
    let run = |scaling| {
        let settings = DynamicSettings { mass_scaling: scaling, ..settings(2.0) };
        let problem = problem(mesh.clone(), vec![held("left", Axis::X)], 20.0, settings);
        completed(&problem, &mut elastic(&problem, 1.0, 1.0)).last().clone()
    };
    let plain = run(MassScaling::None);
    assert_eq!(plain.added_mass, 0.0);
    assert!((plain.mass - 2.0 * 3.1).abs() < 1e-12);
    let uniform = run(MassScaling::Uniform { factor: 4.0 });
    assert!(
        (uniform.time_step / plain.time_step - 2.0).abs() < 0.02 && (uniform.added_mass - 3.0 * 6.2).abs() < 1e-12
    );
    let wanted = 4.0 * plain.time_step;
    let scaled = run(MassScaling::ToStep { step: wanted });
    assert!(scaled.time_step <= wanted * (1.0 + 1e-9) && scaled.time_step > 0.97 * wanted);
    assert!(scaled.added_mass > 0.1 && scaled.added_mass < 0.2 * 15.0 * 1.1, "{}", scaled.added_mass);
    assert!((scaled.mass - scaled.added_mass - 6.2).abs() < 1e-12);
}

/// H-11 in motion: an hourglass mode of one-point elements is stopped by dashpots and swings on springs; the ledger closes on both.
#[test]
fn hourglass_modes_are_damped_or_held() {
    let start = |node: usize| [if node.is_multiple_of(2) { 1e-3 } else { -1e-3 }, 0.0, 0.0];
    let run = |control| {
        let mut mesh = strip(ElementKind::Q4Single, 6, 1.0);
        let mut settings = settings(2.0);
        // The pattern of the mode: signs alternate along x and along y.
        for node in 0..mesh.nodes.len() {
            let [x, y, _] = mesh.nodes[node];
            let name = format!("node {node}");
            let value = start((x + y).round() as usize);
            settings.initial_velocities.push(InitialVelocity { nodes: name.clone(), value });
            mesh.node_sets.insert(name, vec![node]);
        }
        let mut problem = problem(mesh, Vec::new(), 60.0, settings);
        problem.hourglass = control;
        completed(&problem, &mut elastic(&problem, 1.0, 1.0))
    };
    let damped = run(HourglassControl::Viscous { coefficient: 0.02 });
    let (first, last) = (damped.instants[0].energy, damped.last().energy);
    let quantity = "kinetic energy that dashpots leave of an hourglass mode, over its first";
    Claim::of("H-11", quantity).number(last.kinetic / first.kinetic).at_most(1e-3);
    let quantity = "energy that dashpots take from an hourglass mode, over its first";
    Claim::of("H-11", quantity).value(last.hourglass / first.kinetic, 1.0).within(0.02);
    assert_eq!(damped.last().hourglass_energy, last.hourglass);
    let quantity = "residual of the energy balance, hourglass mode on dashpots";
    Claim::of("H-13", quantity).error(last.largest_relative_residual()).within(1e-2);
    let sprung = run(HourglassControl::Stiffness { coefficient: 0.01 });
    let stored = sprung.instants.iter().map(|instant| instant.hourglass_energy).fold(0.0, f64::max);
    let quantity = "largest energy that springs store of an hourglass mode, over its first";
    Claim::of("H-11", quantity).number(stored / first.kinetic).at_least(0.9);
    let quantity = "residual of the energy balance, hourglass mode on springs";
    Claim::of("H-13", quantity).error(sprung.last().energy.largest_relative_residual()).within(1e-2);
}

/// New tangents find the step of a body that has softened, without changing its motion by more than the step does.
#[test]
fn renewed_tangents_change_the_step_of_a_softened_body() {
    let law = DamageLaw { lambda: 1.0, shear: 1.0, threshold: 1e-3, softening: 1e-2 };
    let run = |every| {
        let settings = DynamicSettings { tangent_every: every, ..settings(2.0) };
        let pull = moved("right", Axis::X, 0.015, Amplitude::RAMP);
        let conditions = vec![pull, held("left", Axis::X), held("bottom", Axis::Y)];
        let problem = problem(strip(ElementKind::Q4, 1, 1.0), conditions, 60.0, settings);
        let mut material = DamageMaterial::new(vec![law; problem.point_count()]);
        completed(&problem, &mut material).instants.iter().map(|instant| instant.time_step).fold(0.0, f64::max)
    };
    assert!(run(5) > 1.2 * run(0));
}

/// A push that comes when a body has long moved by as little as rounding: it is set off before the push has done any work, which is no
/// instability. So is a support that is moved off at once.
#[test]
fn a_late_push_on_a_body_all_but_at_rest_is_no_instability() {
    let late = |value: f64| Amplitude::Table(vec![[0.0, 0.0], [2.0, 0.0], [2.5, value], [1e3, value]]);
    let push = Applied::new(Condition::Traction { sides: "right".into(), value: [1e-3, 0.0, 0.0] }, late(1.0));
    let shove = moved("left", Axis::X, 1e-3, late(1.0));
    for driven in [push, shove] {
        let tiny = InitialVelocity { nodes: "right".into(), value: [1e-17, 0.0, 0.0] };
        let settings = DynamicSettings { initial_velocities: vec![tiny], ..settings(2.0) };
        let problem = problem(strip(ElementKind::Q4, 6, 1.0), vec![driven, held("all", Axis::Y)], 6.0, settings);
        let film = completed(&problem, &mut elastic(&problem, 1.0, 1.0));
        let fastest = film.last().velocities.iter().map(|velocity| velocity[0].abs()).fold(0.0, f64::max);
        assert!(fastest > 1e-5, "{fastest}");
    }
}
