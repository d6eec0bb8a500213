//! States from which strain, compression and volume change are counted: the start of the run, or that of a later stage.

use crate::mesh::Mesh;
use crate::observer::{FieldsView, PointFields, StepReport};
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
pub(super) enum Origin<'a> {
    /// The mesh as given.
    Run,
    /// The start of a stage.
    Stage(&'a ReferenceState),
    /// The start of a stage that has not begun: nothing has been counted.
    NotBegun,
}

/// The reference states of a run so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct References {
    /// Stages, from 0, whose start is needed; the first stage begins with the run.
    wanted: BTreeSet<usize>,
    known: BTreeMap<usize, ReferenceState>,
    /// The latest accepted state, as long as a later stage may begin with it.
    latest: Option<ReferenceState>,
}

impl References {
    /// No state yet; those at the start of these stages, from 0, will be kept.
    pub fn of_stages(stages: impl Iterator<Item = usize>) -> Self {
        Self { wanted: stages.filter(|&stage| stage > 0).collect(), ..Self::default() }
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
    }

    /// Where the probes of a stage count from; without a stage from the start of the run.
    pub(super) fn origin(&self, stage: Option<usize>) -> Origin<'_> {
        match stage {
            None | Some(0) => Origin::Run,
            Some(stage) => self.known.get(&stage).map_or(Origin::NotBegun, Origin::Stage),
        }
    }
}

/// Volume of a Gauss point in the reference state, m3.
pub(super) fn reference_volume(origin: Origin<'_>, number: usize, point: &PointFields) -> f64 {
    match origin {
        Origin::Stage(state) => state.volumes[number],
        Origin::Run => point.volume / crate::formulation::tensor::matrix(&point.deformation).determinant(),
        Origin::NotBegun => point.volume,
    }
}
