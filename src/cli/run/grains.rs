//! `grains/*.vtp`: the grains of chosen Gauss points, drawn from their committed snapshots.
//!
//! [`SnapshotRecorder`] stands between solver and pool and copies the snapshots of the chosen points at every commit;
//! [`GrainWriter`] turns them into files when a step's fields are written. The macro solver never sees a grain.

use macro_solver::checkpoint::{Archive, CheckpointError};
use macro_solver::material::{MaterialError, PointId, PointMaterial, PointTrial};
use macro_solver::observer::{FieldsView, Observer, StepReport, StopRequest};
use macro_solver::output::{Field, FieldSeries, OutputError, RecordPlan, write_particles};
use macro_solver::pool::Pool;
use protocol::transport::MacroPort;
use protocol::{RveError, RveSolver, TrialResult};
use rve_server::cell::ContactNetwork;
use rve_server::definition::{AnyDefinition, GrainDefinition};
use rve_server::engine::GrainRve;
use rve_server::solver::SolverFor;
use rve_server::space::Components;
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
}

impl<'a, P: MacroPort> SnapshotRecorder<'a, P> {
    /// A recorder for these points, and the snapshots that it records.
    pub(super) fn new(pool: &'a mut Pool<P>, points: &[PointId]) -> (Self, Snapshots) {
        let snapshots = Snapshots::default();
        let recorder = Self { pool, points: points.to_vec(), snapshots: Rc::clone(&snapshots) };
        recorder.record();
        (recorder, snapshots)
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

    fn save(&self, archive: &mut Archive) {
        self.pool.save(archive);
    }

    fn restore(&mut self, archive: &Archive) -> Result<(), CheckpointError> {
        self.pool.restore(archive)?;
        self.record();
        Ok(())
    }
}

/// Writes the grains of the chosen points.
pub(super) struct GrainWriter {
    folder: PathBuf,
    plan: RecordPlan,
    snapshots: Snapshots,
    /// One for each chosen point.
    renderers: BTreeMap<PointId, Box<dyn Renderer>>,
    series: BTreeMap<PointId, FieldSeries>,
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
        snapshots: Snapshots,
    ) -> Result<Self, StopRequest> {
        let folder = folder.join("grains");
        if plan.has_fields() && !snapshots.borrow().is_empty() {
            fs::create_dir_all(&folder).map_err(|source| stop(OutputError::write(&folder, source)))?;
        }
        let mut renderers = BTreeMap::new();
        for &point in snapshots.borrow().keys() {
            let definition = &materials.definitions[materials.made_of[point]];
            renderers.insert(point, renderer(definition).map_err(stop)?);
        }
        Ok(Self { folder, plan: plan.clone(), snapshots, renderers, series: BTreeMap::new() })
    }

    fn write(&mut self, report: &StepReport) -> Result<(), StopRequest> {
        for (&point, snapshot) in self.snapshots.borrow().iter() {
            let name = format!("point-{point:04}-step-{:04}.vtp", report.step);
            if let Some(renderer) = self.renderers.get(&point) {
                renderer.draw(snapshot, &self.folder.join(&name))?;
            }
            let folder = &self.folder;
            let series = self.series.entry(point).or_insert_with(|| series_of(folder, point));
            series.add(report.time, name).map_err(stop)?;
        }
        Ok(())
    }
}

fn series_of(folder: &Path, point: PointId) -> FieldSeries {
    FieldSeries::new(&folder.join(format!("point-{point:04}.pvd")))
}

const SECTION: &str = "grains";

/// Counts changes of what [`GrainWriter`] saves.
const VERSION: u32 = 1;

impl Observer for GrainWriter {
    fn save(&self, archive: &mut Archive) {
        let frames: BTreeMap<PointId, &[(f64, String)]> =
            self.series.iter().map(|(&point, series)| (point, series.frames())).collect();
        archive.put(SECTION, VERSION, &frames);
    }

    fn restore(&mut self, archive: &Archive) -> Result<(), CheckpointError> {
        let frames: BTreeMap<PointId, Vec<(f64, String)>> = archive.get(SECTION, VERSION)?;
        for (point, frames) in frames {
            let mut series = series_of(&self.folder, point);
            series.restore(frames).map_err(|error| CheckpointError::unfit(SECTION, error))?;
            self.series.insert(point, series);
        }
        Ok(())
    }

    fn accepted(&mut self, report: &StepReport, _fields: &FieldsView<'_>) -> Result<(), StopRequest> {
        if self.plan.wants_fields(report) { self.write(report) } else { Ok(()) }
    }
}

fn stop(reason: impl ToString) -> StopRequest {
    StopRequest { reason: reason.to_string() }
}

/// Draws the grains of a snapshot, whatever their dimension.
trait Renderer {
    /// Writes the picture; an empty snapshot stands for the packing as given.
    fn draw(&self, snapshot: &[u8], path: &Path) -> Result<(), StopRequest>;
}

fn renderer(definition: &AnyDefinition) -> Result<Box<dyn Renderer>, RveError> {
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
    fn draw(&self, snapshot: &[u8], path: &Path) -> Result<(), StopRequest> {
        let mut cell = self.0.clone();
        if !snapshot.is_empty() {
            cell.restore(snapshot).map_err(stop)?;
        }
        let network = cell.committed_network().map_err(stop)?;
        write_grains(path, &cell, &network).map_err(stop)
    }
}

/// One cloud: centres as they are (not wrapped into the cell), radius, rotation, number of contacts, rattler or not.
fn write_grains<S: SolverFor>(
    path: &Path,
    cell: &GrainRve<S>,
    network: &ContactNetwork<S>,
) -> Result<(), OutputError> {
    let mut contacts = vec![0.0; network.positions.len()];
    for contact in &network.contacts {
        contacts[contact.origin as usize] += 1.0;
        contacts[contact.end as usize] += 1.0;
    }
    let rattlers = network.rattlers().into_iter().map(|rattler| f64::from(u8::from(rattler))).collect();
    let rotations = cell.committed().rotations.iter().flat_map(|rotation| rotation.components().to_vec()).collect();
    let fields = [
        Field::scalar("radius", network.radii.clone()),
        Field { name: "rotation".to_owned(), components: S::Spin::COUNT, values: rotations },
        Field::scalar("contacts", contacts),
        Field::scalar("rattler", rattlers),
    ];
    let in_space =
        |position: &S::Vector| std::array::from_fn(|axis| if axis < S::DIMENSION { position[axis] } else { 0.0 });
    let centres: Vec<[f64; 3]> = network.positions.iter().map(in_space).collect();
    write_particles(path, &centres, &fields)
}
