//! Checks of the implicit solver on closed-form materials.

mod answers;
mod averages;
mod balance_error;
mod bending;
mod committed_iterates;
mod continued;
mod convergence;
mod equilibrium;
mod equilibrium_stress;
mod formulations;
mod friction;
mod guided;
mod idle;
mod initial;
mod multi_point_constraints;
mod neighbours;
mod noise;
mod patch;
mod path;
mod plane_benchmarks;
mod pore_fluid;
pub(crate) mod stabilisation;
mod stabilised_columns;
mod stages;
mod stepping;
mod strategies;
mod tangent;

use super::solve;
use crate::material::elastic::{ElasticLaw, ElasticMaterial};
use crate::material::{MaterialError, PointId, PointMaterial, PointTrial};
use crate::mesh::block::Block;
use crate::mesh::{Dimension, ElementKind, Mesh};
use crate::observer::{CutBack, FieldsView, IterationReport, Observer, PointFields, Run, StepReport, StopRequest};
use crate::problem::{Axis, Condition, Problem, Stage, Tolerances};
use protocol::TrialResult;

/// Keeps everything that a run reports.
#[derive(Default)]
struct Recorder {
    iterations: Vec<IterationReport>,
    steps: Vec<StepReport>,
    cut_backs: Vec<CutBack>,
    stages: Vec<String>,
    displacements: Vec<[f64; 3]>,
    reactions: Vec<[f64; 3]>,
    points: Vec<PointFields>,
    hourglass_energy: f64,
    fluid_energy: f64,
}

impl Observer for Recorder {
    fn stage_started(&mut self, _: usize, stage: &Stage) {
        self.stages.push(stage.name.clone());
    }

    fn iterated(&mut self, report: &IterationReport) {
        self.iterations.push(*report);
    }

    fn accepted(&mut self, report: &StepReport, fields: &FieldsView<'_>) -> Result<(), StopRequest> {
        self.steps.push(*report);
        self.displacements = fields.displacements.to_vec();
        self.reactions = fields.reactions.to_vec();
        self.points = fields.points.to_vec();
        (self.hourglass_energy, self.fluid_energy) = (fields.hourglass_energy, fields.fluid_energy);
        Ok(())
    }

    fn cut_back(&mut self, event: &CutBack) {
        self.cut_backs.push(event.clone());
    }
}

/// Decides whether an evaluation fails, from the number of commits before it and what it asks for.
type Refusal = Box<dyn FnMut(usize, &[PointTrial]) -> Option<MaterialError>>;

/// An elastic material that remembers what it was asked and may refuse.
struct Spy {
    inner: ElasticMaterial,
    trials: Vec<Vec<PointTrial>>,
    commits: usize,
    refuse: Refusal,
}

impl Spy {
    fn new(inner: ElasticMaterial) -> Self {
        Self { inner, trials: vec![Vec::new()], commits: 0, refuse: Box::new(|_, _| None) }
    }

    /// The trial of each point that stood when step `step` was committed.
    fn committed_trials(&self, step: usize) -> Vec<PointTrial> {
        let mut last: Vec<Option<PointTrial>> = Vec::new();
        for trial in &self.trials[step] {
            last.resize(last.len().max(trial.point + 1), None);
            last[trial.point] = Some(*trial);
        }
        last.into_iter().flatten().collect()
    }
}

impl PointMaterial for Spy {
    fn evaluate(&mut self, trials: &[PointTrial]) -> Result<Vec<TrialResult>, MaterialError> {
        if let Some(error) = (self.refuse)(self.commits, trials) {
            return Err(error);
        }
        self.trials[self.commits].extend_from_slice(trials);
        self.inner.evaluate(trials)
    }

    fn commit(&mut self) -> Result<(), MaterialError> {
        self.commits += 1;
        self.trials.push(Vec::new());
        self.inner.commit()
    }

    fn rollback(&mut self) {
        self.trials[self.commits].clear();
        self.inner.rollback();
    }

    fn mark(&mut self) {
        self.inner.mark();
    }

    fn return_to_mark(&mut self) {
        self.inner.return_to_mark();
    }

    fn copy_state(&mut self, from: PointId, to: PointId) {
        self.inner.copy_state(from, to);
    }
}

const TIGHT: Tolerances = Tolerances::both(1e-9, 1e-9);

fn block(kind: ElementKind, columns: usize, rows: usize) -> Mesh {
    Block::plane([columns as f64, rows as f64], [columns, rows], kind).mesh().unwrap()
}

/// Adds a node set for every node, so that each can get its own displacement.
fn prescribe_field(problem: &mut Problem, nodes: &[usize], field: impl Fn([f64; 3]) -> [f64; 3]) {
    for &node in nodes {
        let name = format!("node {node}");
        let value = field(problem.mesh.nodes[node]);
        problem.mesh.node_sets.insert(name.clone(), vec![node]);
        for (axis, value) in Axis::ALL.into_iter().zip(value).take(problem.mesh.dimension.count()) {
            let moved = Condition::Displacement { nodes: name.clone(), axis, value };
            problem.stages[0].conditions.push(moved.into());
        }
    }
}

fn run(problem: &Problem, material: &mut dyn PointMaterial) -> (Run, Recorder) {
    let mut recorder = Recorder::default();
    let run = solve(problem, material, &mut recorder);
    (run, recorder)
}

/// Two-dimensional bulk and shear modulus of plane stress, Pa.
fn plane_stress_moduli(young: f64, poisson: f64) -> (f64, f64) {
    (0.5 * young / (1.0 - poisson), 0.5 * young / (1.0 + poisson))
}

/// Pressure at the sides of a biaxial test, Pa.
const CONFINEMENT: f64 = 1e6;

/// A material that starts under the pressure of a biaxial test.
fn confined(problem: &Problem) -> ElasticMaterial {
    elastic(ElasticLaw::SaintVenant, problem).with_initial_stress([
        [-CONFINEMENT, 0.0, 0.0],
        [0.0, -CONFINEMENT, 0.0],
        [0.0; 3],
    ])
}

/// Lateral stretch at which nothing is in excess of the pressure at the sides, by bisection.
fn stretch_in_balance(excess: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.9, 1.2);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if excess(middle) < 0.0 { low = middle } else { high = middle }
    }
    low
}

fn elastic(law: ElasticLaw, problem: &Problem) -> ElasticMaterial {
    match problem.mesh.dimension {
        Dimension::Plane => ElasticMaterial::new(law, 2.0e7, 1.0e7, problem.point_count()),
        Dimension::Space => ElasticMaterial::spatial(law, 2.0e7, 1.0e7, problem.point_count()),
    }
}
