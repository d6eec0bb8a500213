//! The state of the driver between two steps, for checkpoints. The geometry, the balance of forces and the factors of the global matrix
//! follow from it; they are computed again from the same numbers in the same order.

use super::accepted::LastStep;
use super::driver::{Session, Solver};
use super::newton::quasi_newton::{Memory, Pair};
use super::newton::tangent_update::TangentUpdaterRecord;
use crate::checkpoint::{Archive, CheckpointError, Progress};
use crate::model::points::{PointRecord, copy};
use crate::observer::Statistics;
use crate::solve::explicit::{Integrator, IntegratorRecord};
use serde::{Deserialize, Serialize};

const SECTION: &str = "driver";

/// Counts changes of [`Record`].
const VERSION: u32 = 35;

#[derive(Serialize, Deserialize)]
struct Record {
    displacements: Vec<f64>,
    points: Vec<PointRecord>,
    last_step: Option<LastStep>,
    stage: u64,
    stage_start: Vec<f64>,
    load: f64,
    stage_fraction: f64,
    arc_length: Option<f64>,
    last_load_change: f64,
    step: u64,
    step_size: f64,
    stabilised_in_vain: Option<f64>,
    statistics: Statistics,
    /// Whether the equations of the stage have been analysed and that is counted.
    analysed: bool,
    integrator: Option<IntegratorRecord>,
    /// Strain increments of the last step, for the staggered average; empty without neighbours.
    strains: Vec<Vec<f64>>,
    tangents: TangentUpdaterRecord,
    /// Entries of the global matrix whose factors the next step may use; empty if it makes its own.
    kept_matrix: Vec<f64>,
    /// Whether its equations are solved directly.
    kept_is_direct: bool,
    pairs: Vec<Pair>,
    /// Of the next step.
    strain_per_step: f64,
    /// Of the last step that kept to the error that was asked for.
    strain_within_error: Option<f64>,
}

impl Solver<'_> {
    /// Saves driver, material and observer after an accepted step.
    pub(super) fn save_all(&self, progress: Progress, session: &mut Session<'_>) {
        let Session { material, observer, store } = session;
        store.save_step(progress, &mut |archive| {
            self.save(archive);
            material.save(archive);
            observer.save(archive);
        });
    }

    /// Restores driver, material and observer from an earlier process; `false` without a checkpoint.
    ///
    /// # Errors
    /// The first part that does not fit.
    pub(super) fn resume(&mut self, session: &mut Session<'_>) -> Result<bool, CheckpointError> {
        let Some(archive) = session.store.earlier() else { return Ok(false) };
        self.restore(&archive)?;
        session.material.restore(&archive)?;
        session.observer.restore(&archive)?;
        Ok(true)
    }

    fn save(&self, archive: &mut Archive) {
        let record = Record {
            displacements: self.body.displacements.clone(),
            points: self.points.records(),
            last_step: self.last_step.clone(),
            stage: self.stage as u64,
            stage_start: self.stage_start.clone(),
            load: self.load,
            stage_fraction: self.stage_fraction,
            arc_length: self.arc_length,
            last_load_change: self.last_load_change,
            step: self.step as u64,
            step_size: self.step_size,
            stabilised_in_vain: self.stabilised_in_vain,
            statistics: self.statistics.clone(),
            analysed: self.linear.is_analysed(),
            integrator: self.integrator.as_ref().map(Integrator::record),
            strains: self.points.previous_strains(),
            tangents: self.tangents.record(),
            kept_matrix: if self.tangents.keeps_factors() { self.linear.values().to_vec() } else { Vec::new() },
            kept_is_direct: self.linear.solves_directly(),
            pairs: self.memory.as_ref().map(Memory::record).unwrap_or_default(),
            strain_per_step: self.points.strain_per_step(),
            strain_within_error: self.strain_within_error,
        };
        archive.put(SECTION, VERSION, &record);
    }

    fn restore(&mut self, archive: &Archive) -> Result<(), CheckpointError> {
        let record: Record = archive.get(SECTION, VERSION)?;
        copy(SECTION, &mut self.body.displacements, &record.displacements)?;
        if record.last_step.as_ref().is_some_and(|last| !last.fits(self.body.displacements.len())) {
            return Err(CheckpointError::unfit(SECTION, "the last step is that of another mesh"));
        }
        self.points.restore(SECTION, record.points)?;
        self.points.set_strain_per_step(record.strain_per_step);
        self.strain_within_error = record.strain_within_error;
        self.last_step = record.last_step;
        (self.load, self.stage_fraction, self.step_size) = (record.load, record.stage_fraction, record.step_size);
        self.stabilised_in_vain = record.stabilised_in_vain;
        (self.arc_length, self.last_load_change) = (record.arc_length, record.last_load_change);
        let number = |value: u64| usize::try_from(value).map_err(|error| CheckpointError::unfit(SECTION, error));
        (self.step, self.stage) = (number(record.step)?, number(record.stage)?);
        if self.stage >= self.problem.stages.len() {
            return Err(CheckpointError::unfit(SECTION, "it stands in a stage that the scene does not have"));
        }
        copy(SECTION, &mut self.stage_start, &record.stage_start)?;
        self.statistics = record.statistics;
        self.tangent_kind = self.stage().strategy.tangent;
        self.body.settle();
        self.set_up().map_err(|error| CheckpointError::unfit(SECTION, error))?;
        self.tangents.restore(record.tangents);
        if !record.kept_matrix.is_empty() {
            let again = self.linear.factorize_again(&record.kept_matrix, record.kept_is_direct);
            if !again.map_err(|error| CheckpointError::unfit(SECTION, error))? {
                return Err(CheckpointError::unfit(SECTION, "the kept stiffness is that of another mesh"));
            }
            self.tangents.keep_factors();
        }
        if let Some(memory) = &mut self.memory
            && !memory.restore(record.pairs, self.constraints.free().len())
        {
            return Err(CheckpointError::unfit(SECTION, "the quasi-Newton pairs are those of another mesh"));
        }
        let statistics = &self.statistics;
        let (symbolic, numeric) = (statistics.symbolic_factorizations, statistics.numeric_factorizations);
        let counts = [symbolic, numeric, statistics.linear_iterations, statistics.direct_fallbacks];
        self.linear.count_from(counts, record.analysed);
        self.points.restore_strains(SECTION, &record.strains)?;
        self.restore_integrator(SECTION, record.integrator)
    }
}
