//! `grains/*.vtp`: grains and contacts of chosen Gauss points, drawn from their committed snapshots.
//!
//! [`SnapshotRecorder`] stands between solver and pool and copies the snapshots of the chosen points at every commit;
//! [`GrainWriter`] turns them into files when a step's fields are written. The macro solver never sees a grain.

use crate::cli::cell_files::{write_contacts, write_grains};
use macro_solver::checkpoint::{Archive, CheckpointError};
use macro_solver::material::{MaterialError, PointId, PointMaterial, PointTrial};
use macro_solver::observer::{FieldsView, Observer, StepReport, StopRequest};
use macro_solver::output::{Field, FieldSeries, OutputError, RecordPlan};
use macro_solver::pool::Pool;
use protocol::transport::MacroPort;
use protocol::{RveError, RveSolver, Tensor2, TrialResult};
use rve_server::definition::{AnyDefinition, GrainDefinition};
use rve_server::engine::GrainRve;
use rve_server::homogenization::fluctuation::displacement_fluctuations;
use rve_server::homogenization::picture::CellPicture;
use rve_server::solver::SolverFor;
use rve_server::space::{Tensor, inverse, product};
use scene_reader::Materials;
use serde::{Deserialize, Serialize};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

/// The committed cell of a point.
#[derive(Clone, Debug)]
pub(super) struct CommittedCell {
    /// Its snapshot; an empty one stands for the packing as given.
    pub snapshot: Arc<[u8]>,
    /// Share by which its friction is below that of its definition.
    pub friction_reduction: f64,
}

/// Committed cells of the chosen points.
pub(super) type Snapshots = Rc<RefCell<BTreeMap<PointId, CommittedCell>>>;

/// Shares by which friction is reduced, by point; 0 at points that are not in it.
type FrictionReductions = BTreeMap<PointId, f64>;

/// Forwards everything to the pool and records snapshots.
pub(super) struct SnapshotRecorder<'a, P: MacroPort> {
    pool: &'a mut Pool<P>,
    points: Vec<PointId>,
    snapshots: Snapshots,
    /// Those of the checkpoint that the run continues from.
    restored: Snapshots,
    /// Friction of the latest trials, of the committed ones and of those at the mark.
    tried: FrictionReductions,
    committed: FrictionReductions,
    marked: FrictionReductions,
}

impl<'a, P: MacroPort> SnapshotRecorder<'a, P> {
    /// A recorder for these points, in ascending order, and the snapshots that it records.
    pub(super) fn new(pool: &'a mut Pool<P>, points: &[PointId]) -> (Self, Snapshots) {
        let snapshots = Snapshots::default();
        let recorder = Self {
            pool,
            points: points.to_vec(),
            snapshots: Rc::clone(&snapshots),
            restored: Snapshots::default(),
            tried: FrictionReductions::new(),
            committed: FrictionReductions::new(),
            marked: FrictionReductions::new(),
        };
        recorder.record();
        (recorder, snapshots)
    }

    /// Snapshots of the checkpoint that the run continues from; empty before it has been read, or without one.
    pub(super) fn restored(&self) -> Snapshots {
        Rc::clone(&self.restored)
    }

    fn record(&self) {
        let mut snapshots = self.snapshots.borrow_mut();
        for &point in &self.points {
            let snapshot = Arc::clone(&self.pool.committed_snapshot(point).1.bytes);
            let friction_reduction = self.committed.get(&point).copied().unwrap_or(0.0);
            snapshots.insert(point, CommittedCell { snapshot, friction_reduction });
        }
    }
}

impl<P: MacroPort> PointMaterial for SnapshotRecorder<'_, P> {
    fn evaluate(&mut self, trials: &[PointTrial]) -> Result<Vec<TrialResult>, MaterialError> {
        for trial in trials {
            if trial.options.friction_reduction == 0.0 {
                self.tried.remove(&trial.point);
            } else {
                self.tried.insert(trial.point, trial.options.friction_reduction);
            }
        }
        self.pool.evaluate(trials)
    }

    fn commit(&mut self) -> Result<(), MaterialError> {
        self.pool.commit()?;
        self.committed.clone_from(&self.tried);
        self.record();
        Ok(())
    }

    fn rollback(&mut self) {
        self.pool.rollback();
        self.tried.clone_from(&self.committed);
    }

    fn mark(&mut self) {
        self.pool.mark();
        self.marked.clone_from(&self.committed);
    }

    fn return_to_mark(&mut self) {
        self.pool.return_to_mark();
        self.committed.clone_from(&self.marked);
        self.tried.clone_from(&self.marked);
        self.record();
    }

    fn copy_state(&mut self, from: PointId, to: PointId) {
        self.pool.copy_state(from, to);
        for reductions in [&mut self.tried, &mut self.committed] {
            match reductions.get(&from).copied() {
                Some(reduction) => reductions.insert(to, reduction),
                None => reductions.remove(&to),
            };
        }
    }

    fn save(&self, archive: &mut Archive) {
        self.pool.save(archive);
        if !self.committed.is_empty() {
            archive.put(FRICTION, 1, &self.committed);
        }
    }

    fn restore(&mut self, archive: &Archive) -> Result<(), CheckpointError> {
        self.pool.restore(archive)?;
        self.committed = if archive.holds(FRICTION) { archive.get(FRICTION, 1)? } else { FrictionReductions::new() };
        self.tried.clone_from(&self.committed);
        self.record();
        self.restored.borrow_mut().clone_from(&self.snapshots.borrow());
        Ok(())
    }
}

/// The section of friction that differs from that of the definitions, which is there only where some does.
const FRICTION: &str = "friction_of_grains";

/// Writes the grains of the chosen points.
pub(super) struct GrainWriter {
    folder: PathBuf,
    plan: RecordPlan,
    snapshots: Snapshots,
    /// One for each point whose grains are written.
    renderers: BTreeMap<PointId, Box<dyn Renderer>>,
    /// From which state fluctuations are counted.
    reference: Reference,
    /// Series of grains and of contacts of each point.
    series: BTreeMap<PointId, [FieldSeries; 2]>,
}

impl GrainWriter {
    /// A writer into `folder/grains`, whenever the plan wants fields.
    ///
    /// # Errors
    /// The folder cannot be made, or the definition of a point is not sound.
    pub(super) fn create(
        folder: &Path,
        materials: &Materials,
        plan: &RecordPlan,
        chosen: &[PointId],
        from: Option<usize>,
        snapshots: Snapshots,
    ) -> Result<Self, StopRequest> {
        let folder = folder.join("grains");
        if plan.has_fields() && !chosen.is_empty() {
            fs::create_dir_all(&folder).map_err(|source| stop_request(OutputError::write(&folder, source)))?;
        }
        let mut renderers = BTreeMap::new();
        for &point in chosen {
            let definition = &materials.definitions[materials.made_of[point]];
            renderers.insert(point, renderer(definition).map_err(stop_request)?);
        }
        let reference = Reference { stage: from.filter(|stage| *stage > 0), ..Reference::default() };
        Ok(Self { folder, plan: plan.clone(), snapshots, renderers, reference, series: BTreeMap::new() })
    }

    fn write(&mut self, report: &StepReport, fields: &FieldsView<'_>) -> Result<(), StopRequest> {
        let snapshots = self.snapshots.borrow();
        for (&point, renderer) in &self.renderers {
            let cell = snapshots.get(&point).expect("the recorder keeps every point that is drawn");
            let names = WHAT.map(|what| format!("{what}-{point:04}-step-{:04}.vtp", report.step));
            let start = self.reference.of(point, &fields.points[point].deformation);
            let (picture, fluctuation) = renderer.draw(start, cell)?;
            let fluctuation = fluctuation.map(|all| Field::vector("displacement_fluctuation", &all));
            write_grains(&self.folder.join(&names[0]), &picture, fluctuation.into_iter().collect())
                .map_err(stop_request)?;
            write_contacts(&self.folder.join(&names[1]), &picture).map_err(stop_request)?;
            let folder = &self.folder;
            let series = self.series.entry(point).or_insert_with(|| series_of(folder, point));
            for (series, name) in series.iter_mut().zip(names) {
                series.add(report.time, name).map_err(stop_request)?;
            }
        }
        Ok(())
    }
}

/// What files of a point are called: its grains and its contacts.
const WHAT: [&str; 2] = ["point", "contacts"];

fn series_of(folder: &Path, point: PointId) -> [FieldSeries; 2] {
    WHAT.map(|what| FieldSeries::new(&folder.join(format!("{what}-{point:04}.pvd"))))
}

/// The state from which fluctuations are counted.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Reference {
    /// Stage at whose start it is; `None` for the packing as given.
    stage: Option<usize>,
    /// Snapshot and deformation gradient of each chosen point at the end of the step before, while that may be the one.
    latest: BTreeMap<PointId, (Vec<u8>, Tensor2)>,
    /// Those at the start of the stage, once it has begun.
    start: BTreeMap<PointId, (Vec<u8>, Tensor2)>,
}

impl Reference {
    /// Snapshot at the start and the deformation gradient since then; `None` before the start. An empty snapshot stands for the packing
    /// as given.
    fn of(&self, point: PointId, deformation: &Tensor2) -> Option<(&[u8], Tensor2)> {
        if self.stage.is_none() {
            return Some((&[], *deformation));
        }
        let (snapshot, before) = self.start.get(&point)?;
        let matrix = |tensor: &Tensor2| <[[f64; 3]; 3]>::from_fn(|i, j| tensor.get(i, j));
        let since = product(&matrix(deformation), &inverse(&matrix(before)));
        Some((snapshot, Tensor2::from_rows(&since)))
    }

    /// Takes note of the stage of an accepted step, before its grains are drawn.
    fn enter(&mut self, report: &StepReport) {
        if self.stage == Some(report.stage) && self.start.is_empty() {
            self.start = std::mem::take(&mut self.latest);
        }
    }

    /// Keeps the accepted state if the stage may begin with it.
    fn keep<'a>(
        &mut self,
        report: &StepReport,
        fields: &FieldsView<'_>,
        drawn: impl Iterator<Item = &'a PointId>,
        snapshots: &Snapshots,
    ) {
        self.latest.clear();
        if self.stage == Some(report.stage + 1) {
            let snapshots = snapshots.borrow();
            let at =
                |&point: &PointId| (point, (snapshots[&point].snapshot.to_vec(), fields.points[point].deformation));
            self.latest = drawn.map(at).collect();
        }
    }
}

const SECTION: &str = "grains";

/// The section of [`Reference`], which is there only if a stage is named.
const REFERENCE: &str = "grains_reference";

/// Counts changes of what [`GrainWriter`] saves.
const VERSION: u32 = 2;

/// Frames of a series: time and file.
type Frames = Vec<(f64, String)>;

impl Observer for GrainWriter {
    fn save(&self, archive: &mut Archive) {
        let frames: BTreeMap<PointId, [&[(f64, String)]; 2]> =
            self.series.iter().map(|(&point, series)| (point, series.each_ref().map(FieldSeries::frames))).collect();
        archive.put(SECTION, VERSION, &frames);
        if self.reference.stage.is_some() {
            archive.put(REFERENCE, 1, &self.reference);
        }
    }

    fn restore(&mut self, archive: &Archive) -> Result<(), CheckpointError> {
        let frames: BTreeMap<PointId, [Frames; 2]> = archive.get(SECTION, VERSION)?;
        for (point, frames) in frames {
            let mut series = series_of(&self.folder, point);
            for (series, frames) in series.iter_mut().zip(frames) {
                series.restore(frames).map_err(|error| CheckpointError::unfit(SECTION, error))?;
            }
            self.series.insert(point, series);
        }
        if self.reference.stage.is_some() {
            self.reference = archive.get(REFERENCE, 1)?;
        }
        Ok(())
    }

    fn accepted(&mut self, report: &StepReport, fields: &FieldsView<'_>) -> Result<(), StopRequest> {
        self.reference.enter(report);
        let written = if self.plan.wants_fields(report) { self.write(report, fields) } else { Ok(()) };
        self.reference.keep(report, fields, self.renderers.keys(), &self.snapshots);
        written
    }
}

fn stop_request(reason: impl ToString) -> StopRequest {
    StopRequest { reason: reason.to_string() }
}

/// A picture, and displacement fluctuations.
pub(super) type Drawn = (CellPicture, Option<Vec<[f64; 3]>>);

/// Draws the grains of a committed cell, whatever their dimension.
pub(super) trait Renderer {
    /// Grains and contacts of a cell.
    fn picture(&self, cell: &CommittedCell) -> Result<CellPicture, StopRequest>;

    /// Grains and contacts of a cell, and what each grain has been displaced in addition to the deformation of its cell, m, since
    /// the snapshot of `start`, whose second part is about the deformation gradient of the cell since then. Empty snapshots stand for the
    /// packing as given; without `start` there are no displacements.
    fn draw(&self, start: Option<(&[u8], Tensor2)>, end: &CommittedCell) -> Result<Drawn, StopRequest>;
}

/// A renderer of the cells of a definition.
///
/// # Errors
/// The definition is not sound.
pub(super) fn renderer(definition: &AnyDefinition) -> Result<Box<dyn Renderer>, RveError> {
    Ok(match definition {
        AnyDefinition::Discs(definition) => Box::new(CellRenderer::new(definition)?),
        AnyDefinition::Spheres(definition) => Box::new(CellRenderer::new(definition)?),
    })
}

/// A cell of the packing as given.
struct CellRenderer<S: SolverFor>(GrainRve<S>);

impl<S: SolverFor> CellRenderer<S> {
    fn new(definition: &GrainDefinition<S>) -> Result<Self, RveError> {
        GrainRve::new(definition).map(Self)
    }

    /// The cell in the state of a snapshot.
    fn cell(&self, snapshot: &[u8]) -> Result<GrainRve<S>, StopRequest> {
        let mut cell = self.0.clone();
        if !snapshot.is_empty() {
            cell.restore(snapshot).map_err(stop_request)?;
        }
        Ok(cell)
    }
}

impl<S: SolverFor> Renderer for CellRenderer<S> {
    fn picture(&self, cell: &CommittedCell) -> Result<CellPicture, StopRequest> {
        self.cell(&cell.snapshot)?.picture(cell.friction_reduction).map_err(stop_request)
    }

    fn draw(&self, start: Option<(&[u8], Tensor2)>, end: &CommittedCell) -> Result<Drawn, StopRequest> {
        let mut cell = self.cell(&end.snapshot)?;
        let picture = cell.picture(end.friction_reduction).map_err(stop_request)?;
        let Some((start, deformation)) = start else { return Ok((picture, None)) };
        let deformation = S::Tensor::from_fn(|i, j| deformation.get(i, j));
        let start = self.cell(start)?;
        let fluctuations = displacement_fluctuations(start.committed(), cell.committed(), &deformation);
        Ok((picture, Some(fluctuations)))
    }
}
