//! States from which strain, compression and volume change are counted: the start of the run, or that of a later stage.

use crate::formulation::tensor::{matrix, tensor};
use crate::mesh::Mesh;
use crate::observer::{FieldsView, PointFields, StepReport};
use nalgebra::Matrix3;
use protocol::Tensor2;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// The deformation at the start of a stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReferenceState {
    /// Displacements of the nodes since the start of the run, m.
    pub displacements: Vec<[f64; 3]>,
    /// Deformation gradients of the Gauss points since the start of the run.
    pub deformations: Vec<Tensor2>,
    /// Volumes of the Gauss points, m3; in the plane per metre of thickness.
    pub volumes: Vec<f64>,
}

impl ReferenceState {
    fn of(view: &FieldsView<'_>) -> Self {
        Self {
            displacements: view.displacements.to_vec(),
            deformations: view.points.iter().map(|point| point.deformation).collect(),
            volumes: view.points.iter().map(|point| point.volume).collect(),
        }
    }

    /// Mean position of nodes along an axis in this state, m.
    pub(super) fn mean_position(&self, mesh: &Mesh, nodes: &[usize], axis: usize) -> f64 {
        let position = |&node: &usize| mesh.nodes[node][axis] + self.displacements[node][axis];
        nodes.iter().map(position).sum::<f64>() / nodes.len() as f64
    }
}

/// Where a probe counts from.
#[derive(Clone, Copy, Debug)]
pub(in crate::output) struct Origin<'a> {
    /// The state in which the value is 0.
    pub(super) start: Start<'a>,
    /// Deformation gradients at the end of the step before; `None` without one.
    before: Option<&'a [Tensor2]>,
}

/// A state in which nothing has been counted.
#[derive(Clone, Copy, Debug)]
pub(super) enum Start<'a> {
    /// The mesh as given.
    Run,
    /// The start of a stage.
    Stage(&'a ReferenceState),
    /// The start of a stage that has not begun: nothing has been counted.
    NotBegun,
}

impl Origin<'_> {
    /// Deformation gradient of a point since the start, given that since the start of the run.
    pub(super) fn since(&self, number: usize, deformation: &Tensor2) -> Tensor2 {
        match self.start {
            Start::Run => *deformation,
            Start::NotBegun => Tensor2::IDENTITY,
            Start::Stage(state) => {
                // An accepted state has no inverted point; one that had would show as NaN.
                let inverse = matrix(&state.deformations[number]).try_inverse();
                let inverse = inverse.unwrap_or(Matrix3::from_element(f64::NAN));
                tensor(&(matrix(deformation) * inverse))
            }
        }
    }

    /// The same at the end of the step before.
    pub(super) fn before(&self, number: usize) -> Tensor2 {
        self.before.map_or(Tensor2::IDENTITY, |before| self.since(number, &before[number]))
    }
}

/// The reference states of a run so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct References {
    /// Stages, from 0, whose start is needed; the first stage begins with the run.
    wanted: BTreeSet<usize>,
    known: BTreeMap<usize, ReferenceState>,
    /// The latest accepted state, as long as a later stage may begin with it.
    latest: Option<ReferenceState>,
    /// Whether the deformation at the end of the step before is needed.
    compares_steps: bool,
    /// That deformation, if it is needed and there was a step.
    before: Option<Vec<Tensor2>>,
}

impl References {
    /// No state yet; those at the start of these stages, from 0, will be kept.
    pub fn of_stages(stages: impl Iterator<Item = usize>) -> Self {
        Self { wanted: stages.filter(|&stage| stage > 0).collect(), ..Self::default() }
    }

    /// The same, which also keep the deformation at the end of the step before if `compares_steps`.
    pub fn comparing_steps(self, compares_steps: bool) -> Self {
        Self { compares_steps, ..self }
    }

    /// Takes note of the stage of an accepted step, before the step is measured.
    pub fn enter(&mut self, report: &StepReport) {
        if self.wanted.contains(&report.stage)
            && !self.known.contains_key(&report.stage)
            && let Some(state) = self.latest.take()
        {
            self.known.insert(report.stage, state);
        }
    }

    /// Keeps the accepted state if a later stage may begin with it, after the step has been measured.
    pub fn keep(&mut self, report: &StepReport, view: &FieldsView<'_>) {
        let is_needed = self.wanted.contains(&(report.stage + 1));
        self.latest = is_needed.then(|| ReferenceState::of(view));
        self.before = self.compares_steps.then(|| view.points.iter().map(|point| point.deformation).collect());
    }

    /// Where the probes of a stage count from; without a stage from the start of the run.
    pub(in crate::output) fn origin(&self, stage: Option<usize>) -> Origin<'_> {
        let start = match stage {
            None | Some(0) => Start::Run,
            Some(stage) => self.known.get(&stage).map_or(Start::NotBegun, Start::Stage),
        };
        Origin { start, before: self.before.as_deref() }
    }
}

/// Volume of a Gauss point in the reference state, m3.
pub(super) fn reference_volume(origin: Origin<'_>, number: usize, point: &PointFields) -> f64 {
    match origin.start {
        Start::Stage(state) => state.volumes[number],
        Start::Run => point.volume / matrix(&point.deformation).determinant(),
        Start::NotBegun => point.volume,
    }
}
