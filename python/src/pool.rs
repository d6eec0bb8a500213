//! The pool of worker processes.

use crate::arrays::{indices, tensors};
use crate::cell::read;
use crate::error::raised;
use crate::result::{dictionary, options};
use crate::signals::interruptible;
use grain_pool::{PoolError, PoolOptions, RvePool, Snapshot, State, Trial};
use protocol::MOST_RAMP_STEPS;
use protocol::transport::shared_memory::Waiting;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

/// A pool; states are numbered in the order in which they are made.
#[pyclass(frozen, module = "grainspan._native")]
pub(crate) struct Pool {
    pool: RvePool,
    states: Mutex<Vec<State>>,
}

#[pymethods]
impl Pool {
    /// Starts `workers` processes of `program`. Every cell is a text (TOML: packing, contact, rve) whose paths are relative to `folder`.
    #[new]
    fn new(
        py: Python<'_>,
        cells: Vec<String>,
        folder: PathBuf,
        program: PathBuf,
        workers: Option<usize>,
        wait: &str,
    ) -> PyResult<Self> {
        let waiting = wait.parse::<Waiting>().map_err(|_| {
            PyValueError::new_err(format!("wait {wait:?} is unknown; choose \"block\", \"hybrid\" or \"spin\""))
        })?;
        let pool = interruptible(py, |keep_going| {
            let cells = cells.into_iter().map(|text| read(text, &folder)).collect::<Result<_, _>>()?;
            let usual = PoolOptions::new(program);
            let workers = workers.unwrap_or(usual.workers);
            RvePool::open_while(cells, PoolOptions { workers, waiting, ..usual }, keep_going)
        })?;
        Ok(Self { pool, states: Mutex::default() })
    }

    #[getter]
    fn dimension(&self) -> u32 {
        self.pool.dimension()
    }

    /// Makes states and returns the number of the first.
    fn new_states(&self, py: Python<'_>, cell: usize, count: usize) -> PyResult<usize> {
        self.done(py, || {
            // Locked only behind the wait for the pool: other threads wait for the lock with the interpreter in their hands.
            let made = self.pool.new_states(cell, count)?;
            let mut states = self.states.lock().unwrap_or_else(PoisonError::into_inner);
            let first = states.len();
            states.extend(made);
            Ok(first)
        })
    }

    /// Answers trials: bytes of int64 and float64 in, a dictionary of byte arrays out.
    fn trial<'py>(
        &self,
        py: Python<'py>,
        states: &[u8],
        targets: &[u8],
        tangent: &str,
        observables: Vec<String>,
        ramp_steps: &[u8],
    ) -> PyResult<Bound<'py, PyDict>> {
        let states = self.states(states)?;
        let dimension = self.pool.dimension() as usize;
        let targets = tensors(targets, dimension);
        let common = options(tangent, &observables, 0)?;
        let ramps = indices(ramp_steps)?;
        if targets.len() != states.len() || ramps.len() != states.len() {
            return Err(PyValueError::new_err("every state needs one target and one number of ramp steps"));
        }
        let mut trials = Vec::with_capacity(states.len());
        for ((&state, target), ramp) in states.iter().zip(targets).zip(ramps) {
            let known = u32::try_from(ramp).ok().filter(|steps| *steps <= MOST_RAMP_STEPS);
            let ramp_steps = known.ok_or_else(|| {
                PyValueError::new_err(format!(
                    "ramp_steps = {ramp}: at most {MOST_RAMP_STEPS}; 0 lets the cell choose"
                ))
            })?;
            trials.push(Trial { state, target, options: protocol::TrialOptions { ramp_steps, ..common } });
        }
        let results = interruptible(py, |keep_going| self.pool.trial_while(&trials, keep_going))?;
        dictionary(py, &results, &common, dimension)
    }

    fn commit(&self, py: Python<'_>, states: &[u8]) -> PyResult<()> {
        let states = self.states(states)?;
        self.done(py, || self.pool.commit(&states))
    }

    fn rollback(&self, py: Python<'_>, states: &[u8]) -> PyResult<()> {
        let states = self.states(states)?;
        self.done(py, || self.pool.rollback(&states))
    }

    fn snapshot<'py>(&self, py: Python<'py>, states: &[u8]) -> PyResult<Vec<Bound<'py, PyBytes>>> {
        let states = self.states(states)?;
        let snapshots = self.done(py, || self.pool.snapshot(&states))?;
        Ok(snapshots.iter().map(|one| PyBytes::new(py, &one.to_bytes())).collect())
    }

    fn restore(&self, py: Python<'_>, states: &[u8], snapshots: Vec<Vec<u8>>) -> PyResult<()> {
        let states = self.states(states)?;
        self.done(py, || {
            let read = |(place, bytes): (usize, &Vec<u8>)| {
                Snapshot::from_bytes(bytes).map_err(|reason| PoolError::Snapshot { place, reason })
            };
            let snapshots = snapshots.iter().enumerate().map(read).collect::<Result<Vec<_>, _>>()?;
            self.pool.restore(&states, &snapshots)
        })
    }

    fn worker_processes(&self, py: Python<'_>) -> PyResult<Vec<u32>> {
        self.done(py, || self.pool.worker_processes())
    }

    /// Counts of the pool, by name.
    fn statistics(&self, py: Python<'_>) -> PyResult<Vec<(&'static str, f64)>> {
        let found = self.done(py, || self.pool.statistics())?;
        Ok(vec![
            ("evaluations", found.evaluations as f64),
            ("duplicates_skipped", found.duplicates_skipped as f64),
            ("reissued", found.reissued as f64),
            ("workers_lost", found.workers_lost as f64),
            ("worker_restarts", found.worker_restarts as f64),
            ("wall_s", found.wall_s),
            ("rve_s", found.rve_s),
            ("tangent_s", found.tangent_s),
            ("transport_s", found.transport_s),
            ("macro_transport_s", found.macro_transport_s),
            ("idle_s", found.idle_s),
        ])
    }

    fn close(&self, py: Python<'_>) {
        py.detach(|| self.pool.close());
    }
}

impl Pool {
    /// The states with these numbers.
    fn states(&self, numbers: &[u8]) -> PyResult<Vec<State>> {
        let states = self.states.lock().unwrap_or_else(PoisonError::into_inner);
        let known = |number: usize| {
            states.get(number).copied().ok_or_else(|| {
                PyValueError::new_err(format!("there is no state {number}; the pool has {}", states.len()))
            })
        };
        indices(numbers)?.into_iter().map(known).collect()
    }

    /// A short call, without the interpreter.
    fn done<T: Send>(&self, py: Python<'_>, work: impl FnOnce() -> Result<T, PoolError> + Send) -> PyResult<T> {
        py.detach(work).map_err(|error| raised(py, &error))
    }
}
