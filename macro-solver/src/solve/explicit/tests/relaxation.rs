//! H-12: dynamic relaxation of an elastic block, corrected and as printed.

use super::*;
use crate::material::elastic::{ElasticLaw, ElasticMaterial};
use crate::observer::Silent;
use crate::problem::Tolerances;
use crate::problem::relaxation::RelaxationSettings;
use claims::Claim;

/// The block of [Liu2018] section 4, 10 x 20 mm, compressed between smooth platens, in one increment; Poisson's
/// ratio is 1/4.
fn block(columns: usize, rows: usize, procedure: Procedure) -> Problem {
    let mesh = Block::plane([0.01, 0.02], [columns, rows], ElementKind::Q4).mesh().unwrap();
    let push = Condition::Displacement { nodes: "top".into(), axis: Axis::Y, value: -2e-6 };
    let mut problem =
        Problem::new(mesh, vec![push, Condition::fixed("bottom", Axis::Y), Condition::fixed("bottom_left", Axis::X)]);
    let stage = &mut problem.stages[0];
    stage.procedure = procedure;
    stage.control.increments = 1;
    stage.control.min = 1.0;
    stage.tolerances = Tolerances::both(1e-6, 1.0);
    problem.formulation = Formulation::SmallStrain;
    problem
}

fn material(problem: &Problem) -> ElasticMaterial {
    ElasticMaterial::new(ElasticLaw::SmallStrain, 2.0, 1.0, problem.point_count())
}

/// H-12, to an out-of-balance force of 1e-6 of the reactions.
/// H-12, to an out-of-balance force of 1e-6 of the reactions.
#[test]
fn iteration_counts_are_those_of_the_corrected_scheme() {
    for ((columns, rows), expected) in [((1, 1), 45), ((1, 2), 58), ((2, 4), 125), ((4, 8), 259), ((8, 16), 527)] {
        let settings = RelaxationSettings { hits: 1, ..RelaxationSettings::default() };
        let problem = block(columns, rows, Procedure::Relaxation(settings));
        let run = solve(&problem, &mut material(&problem), &mut Silent);
        assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
        let quantity = format!("iterations of dynamic relaxation, block of {columns} x {rows} elements");
        let iterations = run.statistics.iterations as f64;
        Claim::of("H-12", &quantity).value(iterations, f64::from(expected)).within(0.2);
    }
}

/// H-12, S-11: as printed, the step is beyond the critical one on all but the coarsest meshes, and is refused with the reason.
#[test]
fn the_printed_scheme_is_refused_where_it_would_diverge() {
    for ((columns, rows), stable) in [((1, 1), true), ((2, 4), false), ((4, 8), false)] {
        let problem = block(columns, rows, Procedure::Relaxation(RelaxationSettings::as_printed()));
        let run = solve(&problem, &mut material(&problem), &mut Silent);
        let completes = match run.outcome {
            Outcome::Completed => true,
            Outcome::DidNotConverge { reason } => {
                let quantity = "the printed scheme is refused with the keyword of the corrected one";
                Claim::of("S-11", quantity).holds(reason.contains("corrected"));
                false
            }
            other => panic!("{other:?}"),
        };
        let quantity = "the printed scheme runs on one element and is refused on 2 x 4 and 4 x 8";
        Claim::of("H-12", quantity).holds(completes == stable);
    }
}

struct Last(Vec<[f64; 3]>);

impl Observer for Last {
    fn accepted(&mut self, _report: &StepReport, fields: &FieldsView<'_>) -> Result<(), StopRequest> {
        self.0 = fields.displacements.to_vec();
        Ok(())
    }
}

/// Displacements after a compression under prestress in three increments, and the evaluations that it took.
fn compressed(procedure: Procedure, duration: f64) -> (Vec<[f64; 3]>, u64) {
    let mut problem = block(2, 4, procedure);
    problem.formulation = Formulation::UpdatedLagrangian;
    let sides = ["left", "right"].map(|sides| Condition::Pressure {
        sides: sides.into(),
        value: 0.02,
        kind: Default::default(),
    });
    let stage = &mut problem.stages[0];
    stage.conditions.extend(sides.map(Applied::from));
    stage.duration = duration;
    stage.control.increments = 3;
    stage.control.min = 1e-3;
    stage.tolerances = Tolerances::both(1e-7, 1e-3);
    if let Condition::Displacement { value, .. } = &mut stage.conditions[0].condition {
        *value = -4e-4;
    }
    let stress = [[-0.02, 0.0, 0.0], [0.0, -0.05, 0.0], [0.0, 0.0, 0.0]];
    let mut material =
        ElasticMaterial::new(ElasticLaw::SaintVenant, 2.0, 1.0, problem.point_count()).with_initial_stress(stress);
    let mut last = Last(Vec::new());
    let run = solve(&problem, &mut material, &mut last);
    assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
    (last.0, run.statistics.evaluations)
}

fn largest_difference(first: &[[f64; 3]], second: &[[f64; 3]]) -> f64 {
    first.as_flattened().iter().zip(second.as_flattened()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// I-7: relaxation and slow damped dynamics find what Newton's method finds, for many more evaluations.
#[test]
fn relaxation_and_slow_dynamics_meet_the_solution_of_newtons_method() {
    let (newton, few) = compressed(Procedure::Implicit, 1.0);
    let (relaxed, many) = compressed(Procedure::Relaxation(RelaxationSettings::default()), 1.0);
    let difference = largest_difference(&newton, &relaxed);
    let quantity = "displacements by dynamic relaxation, over the largest";
    Claim::of("I-7", quantity).error(difference / 4e-4).within(1e-5);
    assert!(many > 5 * few, "{many} against {few} evaluations");
    // Lowest period about 0.03 s: half a second is slow, and the damper takes what the start excites.
    let mut settings = settings(1.0);
    settings.damping.mass = 100.0;
    settings.reporting = Reporting::Steps(1000);
    let (moved, most) = compressed(Procedure::Dynamic(Box::new(settings)), 1.0);
    let difference = largest_difference(&newton, &moved);
    let quantity = "displacements by slow damped dynamics, over the largest";
    Claim::of("I-7", quantity).error(difference / 4e-4).within(0.01);
    assert!(most > many, "{most} against {many} evaluations");
}

/// The step of the motion was infinite where nothing is free, and no step converged.
#[test]
fn a_body_whose_nodes_are_all_led_follows_them() {
    let mut problem = block(1, 1, Procedure::Relaxation(RelaxationSettings::default()));
    problem.stages[0].conditions.extend(["left", "right"].map(|nodes| held(nodes, Axis::X)));
    let mut last = Last(Vec::new());
    let run = solve(&problem, &mut material(&problem), &mut last);
    assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
    assert_eq!(run.statistics.iterations, 1);
    assert!((last.0[3][1] + 2e-6).abs() < 1e-18, "{:?}", last.0);
}
