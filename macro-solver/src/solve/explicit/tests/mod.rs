//! Waves and vibrations with known answers, through the driver of a run.

mod absorbing;
mod constraints;
mod damping;
mod relaxation;
mod reports;
mod resuming;
mod softening;
mod stability;
mod sub_steps;
mod supports;
mod waves;

use crate::formulation::Formulation;
use crate::material::damage::{DamageLaw, DamageMaterial};
use crate::mesh::block::Block;
use crate::mesh::{ElementKind, Mesh};
use crate::observer::EnergyBalance;
use crate::observer::{FieldsView, Observer, Outcome, PointFields, Run, StepReport, StopRequest};
use crate::problem::dynamics::{DynamicSettings, Reporting};
use crate::problem::{Amplitude, Applied, Axis, Condition, Problem, Procedure, Stage};
use crate::solve::solve;

/// What was reported of one instant.
#[derive(Clone)]
struct Instant {
    time: f64,
    displacements: Vec<[f64; 3]>,
    velocities: Vec<[f64; 3]>,
    accelerations: Vec<[f64; 3]>,
    reactions: Vec<[f64; 3]>,
    points: Vec<PointFields>,
    energy: EnergyBalance,
    hourglass_energy: f64,
    time_step: f64,
    added_mass: f64,
    mass: f64,
    evaluations: u64,
}

/// Keeps all reports.
#[derive(Default)]
struct Film {
    instants: Vec<Instant>,
}

impl Observer for Film {
    fn accepted(&mut self, report: &StepReport, fields: &FieldsView<'_>) -> Result<(), StopRequest> {
        // Stages without motion prepare what is looked at.
        let Some(dynamics) = fields.dynamics else { return Ok(()) };
        self.instants.push(Instant {
            time: report.time,
            displacements: fields.displacements.to_vec(),
            velocities: dynamics.velocities.to_vec(),
            accelerations: dynamics.accelerations.to_vec(),
            reactions: fields.reactions.to_vec(),
            points: fields.points.to_vec(),
            energy: dynamics.energy,
            hourglass_energy: fields.hourglass_energy,
            time_step: dynamics.time_step,
            added_mass: dynamics.added_mass,
            mass: dynamics.mass,
            evaluations: report.evaluations,
        });
        Ok(())
    }
}

impl Film {
    fn last(&self) -> &Instant {
        self.instants.last().expect("at least the start is reported")
    }
}

/// A strip of `count` square plane elements of side `side` (m) along x.
fn strip(kind: ElementKind, count: usize, side: f64) -> Mesh {
    Block::plane([count as f64 * side, side], [count, 1], kind).mesh().unwrap()
}

/// One dynamic stage with small strains.
fn problem(mesh: Mesh, conditions: Vec<Applied>, duration: f64, settings: DynamicSettings) -> Problem {
    let mut problem = Problem::new(mesh, Vec::new());
    let mut stage = Stage::new("waves", conditions);
    stage.duration = duration;
    stage.procedure = Procedure::Dynamic(Box::new(settings));
    problem.stages = vec![stage];
    problem.formulation = Formulation::SmallStrain;
    problem
}

/// Linear elasticity in rate form at every point.
fn elastic(problem: &Problem, lambda: f64, shear: f64) -> DamageMaterial {
    DamageMaterial::new(vec![DamageLaw::elastic(lambda, shear); problem.point_count()])
}

fn run(problem: &Problem, material: &mut DamageMaterial) -> (Run, Film) {
    let mut film = Film::default();
    let run = solve(problem, material, &mut film);
    (run, film)
}

/// Steps are reports, as in the table of results; time steps are counted apart.
#[test]
fn steps_are_the_reports_of_a_motion() {
    let push = moved("left", Axis::X, 1e-6, Amplitude::RAMP);
    let settings = DynamicSettings { reporting: Reporting::Steps(3), ..settings(3.0) };
    let problem = problem(strip(ElementKind::Q4, 4, 0.5), vec![push, held("all", Axis::Y)], 1.0, settings);
    let (run, film) = run(&problem, &mut elastic(&problem, 6.0, 3.0));
    let statistics = &run.statistics;
    // The first report is that of the start.
    assert_eq!(statistics.steps, film.instants.len() as u64 - 1);
    let time_steps = 1.0 / film.last().time_step;
    assert!((statistics.time_steps as f64 - time_steps).abs() < 1.0 && statistics.time_steps > statistics.steps);
}

/// Runs to the end.
fn completed(problem: &Problem, material: &mut DamageMaterial) -> Film {
    let (run, film) = run(problem, material);
    assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
    film
}

fn held(nodes: &str, axis: Axis) -> Applied {
    Condition::fixed(nodes, axis).into()
}

fn moved(nodes: &str, axis: Axis, value: f64, history: Amplitude) -> Applied {
    Applied::new(Condition::Displacement { nodes: nodes.into(), axis, value }, history)
}

fn settings(density: f64) -> DynamicSettings {
    DynamicSettings { reporting: Reporting::Steps(1), ..DynamicSettings::new(density) }
}
