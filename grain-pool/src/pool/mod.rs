//! A pool of worker processes for any program.
//!
//! One thread owns channels and workers for the whole life of the pool ([`thread`]); callers send it requests and wait. So a pool can
//! be used from any thread, calls from several threads are served one after the other, and the workers end with the pool or the
//! process and not with the thread that happened to open it.

mod options;
mod thread;

pub use options::PoolOptions;

use crate::error::PoolError;
use crate::snapshot::Snapshot;
use macro_solver::material::{MaterialError, PointMaterial, PointTrial};
use macro_solver::pool::{Pool, PoolStatistics};
use protocol::transport::shared_memory::SharedMemoryMacroPort;
use protocol::{Tensor2, TrialOptions, TrialResult};
use rve_server::definition::AnyDefinition;
use std::sync::atomic::{AtomicU64, Ordering};
use thread::PoolThread;

/// The pool of the macro solver behind shared memory.
type WorkerPool = Pool<SharedMemoryMacroPort>;

/// Most states that are made in one call: more than any mesh has points, and less than memory can hold in vain.
const MOST_STATES: usize = 10_000_000;

/// One point of a pool: a committed state and at most one trial, kept by the pool.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct State {
    pool: u64,
    point: usize,
}

impl State {
    /// Number of the state in its pool, from 0 in the order in which they were made.
    pub fn number(self) -> usize {
        self.point
    }
}

/// One trial: the deformation of one point from its committed state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trial {
    /// The point.
    pub state: State,
    /// Displacement gradient `H = F - I` from the committed configuration.
    pub target: Tensor2,
    /// Results wanted in addition to the stress.
    pub options: TrialOptions,
}

/// Worker processes that answer trials of many points at once.
pub struct RvePool {
    number: u64,
    cells: Vec<AnyDefinition>,
    thread: PoolThread,
}

impl RvePool {
    /// Starts the workers and waits until they serve. States can be made of each of `cells`, which all have the same dimension.
    ///
    /// # Errors
    /// See [`PoolError`]; no process is left.
    pub fn open(cells: Vec<AnyDefinition>, options: PoolOptions) -> Result<Self, PoolError> {
        Self::open_while(cells, options, &mut || true)
    }

    /// As [`RvePool::open`]; `keep_going` is called some 20 times a second, and `false` ends the call.
    ///
    /// # Errors
    /// As [`RvePool::open`], and [`PoolError::Interrupted`].
    pub fn open_while(
        cells: Vec<AnyDefinition>,
        options: PoolOptions,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Result<Self, PoolError> {
        static OPENED: AtomicU64 = AtomicU64::new(0);
        let number = OPENED.fetch_add(1, Ordering::Relaxed);
        let Some(first) = cells.first() else {
            return Err(PoolError::Arguments("a pool needs at least one cell".into()));
        };
        if cells.iter().any(|cell| cell.dimension() != first.dimension()) {
            let text = "discs and spheres cannot be mixed in one pool; open one pool for each";
            return Err(PoolError::Arguments(text.into()));
        }
        let definitions = cells.iter().map(AnyDefinition::to_protocol).collect();
        let thread = PoolThread::start(definitions, options, number, keep_going)?;
        Ok(Self { number, cells, thread })
    }

    /// Space dimension of the cells, 2 or 3.
    pub fn dimension(&self) -> u32 {
        self.cells[0].dimension()
    }

    /// What states can be made of.
    pub fn cells(&self) -> &[AnyDefinition] {
        &self.cells
    }

    /// New points in the initial state of the cell with this number.
    ///
    /// # Errors
    /// [`PoolError::NoSuchCell`], [`PoolError::Closed`], [`PoolError::OtherProcess`].
    pub fn new_states(&self, cell: usize, count: usize) -> Result<Vec<State>, PoolError> {
        if cell >= self.cells.len() {
            return Err(PoolError::NoSuchCell { cell, cells: self.cells.len() });
        }
        if count > MOST_STATES {
            return Err(PoolError::Arguments(format!(
                "{count} states are too many: at most {MOST_STATES} are made in one call"
            )));
        }
        let first = self.call(move |pool| Ok(pool.add_points(cell, count)))?;
        Ok((first..first + count).map(|point| State { pool: self.number, point }).collect())
    }

    /// Answers all trials, in their order. Each starts from the committed state of its point and becomes its trial; of several trials
    /// of one point in a call, the last.
    ///
    /// # Errors
    /// See [`PoolError`]. After [`PoolError::Refused`] none of these points has a trial.
    pub fn trial(&self, trials: &[Trial]) -> Result<Vec<TrialResult>, PoolError> {
        self.trial_while(trials, &mut || true)
    }

    /// As [`RvePool::trial`]; `keep_going` is called some 20 times a second, and `false` ends the call.
    ///
    /// # Errors
    /// As [`RvePool::trial`], and [`PoolError::Interrupted`].
    pub fn trial_while(
        &self,
        trials: &[Trial],
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Result<Vec<TrialResult>, PoolError> {
        let points = self.points(trials.iter().map(|trial| trial.state))?;
        let make =
            |(trial, &point): (&Trial, &usize)| PointTrial { point, target: trial.target, options: trial.options };
        let trials: Vec<PointTrial> = trials.iter().zip(&points).map(make).collect();
        self.thread.call(keep_going, move |pool| {
            pool.evaluate(&trials).map_err(|error| failure(error, pool.refused_trial()))
        })
    }

    /// Makes the trials of these points their committed states: all, or none in case of an error.
    ///
    /// # Errors
    /// [`PoolError::NothingToCommit`], [`PoolError::ForeignState`], [`PoolError::Closed`], [`PoolError::OtherProcess`].
    pub fn commit(&self, states: &[State]) -> Result<(), PoolError> {
        let points = self.points(states.iter().copied())?;
        self.call(move |pool| {
            if let Some(place) = points.iter().position(|&point| !pool.has_trial(point)) {
                return Err(PoolError::NothingToCommit { place });
            }
            points.iter().for_each(|&point| pool.commit_point(point));
            Ok(())
        })
    }

    /// Drops the trials of these points.
    ///
    /// # Errors
    /// [`PoolError::ForeignState`], [`PoolError::Closed`], [`PoolError::OtherProcess`].
    pub fn rollback(&self, states: &[State]) -> Result<(), PoolError> {
        let points = self.points(states.iter().copied())?;
        self.call(move |pool| {
            points.iter().for_each(|&point| pool.rollback_point(point));
            Ok(())
        })
    }

    /// The committed states of these points. Nothing is copied: snapshots share memory with the pool.
    ///
    /// # Errors
    /// As [`RvePool::rollback`].
    pub fn snapshot(&self, states: &[State]) -> Result<Vec<Snapshot>, PoolError> {
        let points = self.points(states.iter().copied())?;
        self.call(move |pool| {
            let snapshot = |&point: &usize| {
                let (definition, state) = pool.committed_snapshot(point);
                Snapshot { definition, state: state.clone() }
            };
            Ok(points.iter().map(snapshot).collect())
        })
    }

    /// Replaces the committed states of these points and drops their trials: all, or none in case of an error. A snapshot may be
    /// restored to any point of the same cell.
    ///
    /// # Errors
    /// [`PoolError::Snapshot`], [`PoolError::Arguments`], and as [`RvePool::rollback`].
    pub fn restore(&self, states: &[State], snapshots: &[Snapshot]) -> Result<(), PoolError> {
        if states.len() != snapshots.len() {
            let text = format!("{} states, but {} snapshots; give one for each", states.len(), snapshots.len());
            return Err(PoolError::Arguments(text));
        }
        let points = self.points(states.iter().copied())?;
        let snapshots = snapshots.to_vec();
        self.call(move |pool| {
            for (place, (&point, snapshot)) in points.iter().zip(&snapshots).enumerate() {
                let (definition, _) = pool.committed_snapshot(point);
                snapshot.fits(definition).map_err(|reason| PoolError::Snapshot { place, reason })?;
            }
            for (&point, snapshot) in points.iter().zip(snapshots) {
                pool.restore_point(point, snapshot.state);
            }
            Ok(())
        })
    }

    /// Process ids of the workers that serve now.
    ///
    /// # Errors
    /// [`PoolError::Closed`], [`PoolError::OtherProcess`].
    pub fn worker_processes(&self) -> Result<Vec<u32>, PoolError> {
        self.call(|pool| Ok(pool.worker_processes()))
    }

    /// What the pool did so far.
    ///
    /// # Errors
    /// [`PoolError::Closed`], [`PoolError::OtherProcess`].
    pub fn statistics(&self) -> Result<PoolStatistics, PoolError> {
        self.call(|pool| Ok(pool.statistics()))
    }

    /// Dismisses the workers and returns when they are gone; further calls fail. Dropping the pool does the same.
    pub fn close(&self) {
        self.thread.close();
    }

    fn call<T: Send + 'static>(
        &self,
        work: impl FnOnce(&mut WorkerPool) -> Result<T, PoolError> + Send + 'static,
    ) -> Result<T, PoolError> {
        self.thread.call(&mut || true, work)
    }

    fn points(&self, states: impl Iterator<Item = State>) -> Result<Vec<usize>, PoolError> {
        let own = |(place, state): (usize, State)| match state.pool == self.number {
            true => Ok(state.point),
            false => Err(PoolError::ForeignState { place }),
        };
        states.enumerate().map(own).collect()
    }
}

/// The error of an evaluation; `place` is that of the refused trial in the call.
fn failure(error: MaterialError, place: Option<usize>) -> PoolError {
    match error {
        MaterialError::Point { point, reason } => PoolError::Refused { point: place.unwrap_or(point), reason },
        MaterialError::WorkersLost(reason) => PoolError::WorkersLost(reason),
        MaterialError::Interrupted => PoolError::Interrupted,
        MaterialError::Channel(reason) | MaterialError::DefinitionRefused(reason) => PoolError::Channel(reason),
    }
}
