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
use rve_server::space::Tensor;
use scene_reader::Materials;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

/// Committed snapshots of the chosen points; an empty one stands for the packing as given.
pub(super) type Snapshots = Rc<RefCell<BTreeMap<PointId, Arc<[u8]>>>>;

/// Forwards everything to the pool and records snapshots.
pub(super) struct SnapshotRecorder<'a, P: MacroPort> {
    pool: &'a mut Pool<P>,
    points: Vec<PointId>,
    snapshots: Snapshots,
    /// Those of the checkpoint that the run continues from.
    restored: Snapshots,
}

impl<'a, P: MacroPort> SnapshotRecorder<'a, P> {
    /// A recorder for these points, in ascending order, and the snapshots that it records.
    pub(super) fn new(pool: &'a mut Pool<P>, points: &[PointId]) -> (Self, Snapshots) {
        let snapshots = Snapshots::default();
        let recorder =
            Self { pool, points: points.to_vec(), snapshots: Rc::clone(&snapshots), restored: Snapshots::default() };
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
            snapshots.insert(point, Arc::clone(&self.pool.committed_snapshot(point).1.bytes));
        }
    }
}

impl<P: MacroPort> PointMaterial for SnapshotRecorder<'_, P> {
    fn evaluate(&mut self, trials: &[PointTrial]) -> Result<Vec<TrialResult>, MaterialError> {
        self.pool.evaluate(trials)
    }

    fn commit(&mut self) -> Result<(), MaterialError> {
        self.pool.commit()?;
        self.record();
        Ok(())
    }

    fn rollback(&mut self) {
        self.pool.rollback();
    }

    fn mark(&mut self) {
        self.pool.mark();
    }

    fn return_to_mark(&mut self) {
        self.pool.return_to_mark();
        self.record();
    }

    fn save(&self, archive: &mut Archive) {
        self.pool.save(archive);
    }

    fn restore(&mut self, archive: &Archive) -> Result<(), CheckpointError> {
        self.pool.restore(archive)?;
        self.record();
        self.restored.borrow_mut().clone_from(&self.snapshots.borrow());
        Ok(())
    }
}

/// Writes the grains of the chosen points.
pub(super) struct GrainWriter {
    folder: PathBuf,
    plan: RecordPlan,
    snapshots: Snapshots,
    /// Points whose grains are written.
    chosen: Vec<PointId>,
    /// One for each chosen point.
    renderers: BTreeMap<PointId, Box<dyn Renderer>>,
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
        snapshots: Snapshots,
    ) -> Result<Self, StopRequest> {
        let folder = folder.join("grains");
        if plan.has_fields() && !chosen.is_empty() {
            fs::create_dir_all(&folder).map_err(|source| stop(OutputError::write(&folder, source)))?;
        }
        let mut renderers = BTreeMap::new();
        for &point in chosen {
            let definition = &materials.definitions[materials.made_of[point]];
            renderers.insert(point, renderer(definition).map_err(stop)?);
        }
        let chosen = renderers.keys().copied().collect();
        Ok(Self { folder, plan: plan.clone(), snapshots, chosen, renderers, series: BTreeMap::new() })
    }

    fn write(&mut self, report: &StepReport, fields: &FieldsView<'_>) -> Result<(), StopRequest> {
        let snapshots = self.snapshots.borrow();
        for &point in &self.chosen {
            let Some(snapshot) = snapshots.get(&point) else { continue };
            let names = WHAT.map(|what| format!("{what}-{point:04}-step-{:04}.vtp", report.step));
            if let (Some(renderer), Some(state)) = (self.renderers.get(&point), fields.points.get(point)) {
                let (picture, fluctuation) = renderer.draw(snapshot, &state.deformation)?;
                let fluctuation = Field::vector("displacement_fluctuation", &fluctuation);
                write_grains(&self.folder.join(&names[0]), &picture, vec![fluctuation]).map_err(stop)?;
                write_contacts(&self.folder.join(&names[1]), &picture).map_err(stop)?;
            }
            let folder = &self.folder;
            let series = self.series.entry(point).or_insert_with(|| series_of(folder, point));
            for (series, name) in series.iter_mut().zip(names) {
                series.add(report.time, name).map_err(stop)?;
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

const SECTION: &str = "grains";

/// Counts changes of what [`GrainWriter`] saves.
const VERSION: u32 = 2;

/// Frames of a series: time and file.
type Frames = Vec<(f64, String)>;

impl Observer for GrainWriter {
    fn save(&self, archive: &mut Archive) {
        let frames: BTreeMap<PointId, [&[(f64, String)]; 2]> =
            self.series.iter().map(|(&point, series)| (point, series.each_ref().map(FieldSeries::frames))).collect();
        archive.put(SECTION, VERSION, &frames);
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
        Ok(())
    }

    fn accepted(&mut self, report: &StepReport, fields: &FieldsView<'_>) -> Result<(), StopRequest> {
        if self.plan.wants_fields(report) { self.write(report, fields) } else { Ok(()) }
    }
}

fn stop(reason: impl ToString) -> StopRequest {
    StopRequest { reason: reason.to_string() }
}

/// Draws the grains of a snapshot, whatever their dimension.
pub(super) trait Renderer {
    /// Grains and contacts of a snapshot; an empty one stands for the packing as given.
    fn picture(&self, snapshot: &[u8]) -> Result<CellPicture, StopRequest>;

    /// Grains and contacts of a snapshot, an empty one stands for the packing as given, and what each grain has been displaced in
    /// addition to the deformation of its cell, m. `deformation` is about that of the cell.
    fn draw(&self, snapshot: &[u8], deformation: &Tensor2) -> Result<(CellPicture, Vec<[f64; 3]>), StopRequest>;
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
}

impl<S: SolverFor> Renderer for CellRenderer<S> {
    fn picture(&self, snapshot: &[u8]) -> Result<CellPicture, StopRequest> {
        let mut cell = self.0.clone();
        if !snapshot.is_empty() {
            cell.restore(snapshot).map_err(stop)?;
        }
        cell.picture().map_err(stop)
    }

    fn draw(&self, snapshot: &[u8], deformation: &Tensor2) -> Result<(CellPicture, Vec<[f64; 3]>), StopRequest> {
        let mut cell = self.0.clone();
        if !snapshot.is_empty() {
            cell.restore(snapshot).map_err(stop)?;
        }
        let picture = cell.picture().map_err(stop)?;
        let deformation = S::Tensor::from_fn(|i, j| deformation.get(i, j));
        let fluctuations = displacement_fluctuations(self.0.committed(), cell.committed(), &deformation);
        Ok((picture, fluctuations))
    }
}
