//! One cell in this process, and element tests.

use crate::arrays::tensors;
use crate::error::raised;
use crate::result::{dictionary, options, tangent_kind};
use crate::signals::interruptible;
use grain_pool::PoolError;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use rve_server::definition::AnyDefinition;
use scene_reader::{Document, read_cell};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Reads a cell (TOML: packing, contact, rve) whose paths are relative to `folder`.
///
/// # Errors
/// The first defect with its remedy.
pub(crate) fn read(text: String, folder: &Path) -> Result<AnyDefinition, PoolError> {
    Ok(read_cell(&Document::from_text(&folder.join("cell.toml"), text, &[])?)?)
}

/// One cell in this process.
#[pyclass(frozen, module = "grainspan._native")]
pub(crate) struct Rve {
    rve: Mutex<grain_pool::Rve>,
    cell: AnyDefinition,
}

#[pymethods]
impl Rve {
    /// A cell (TOML: packing, contact, rve) whose paths are relative to `folder`.
    #[new]
    fn new(py: Python<'_>, text: String, folder: PathBuf) -> PyResult<Self> {
        let made = py.detach(|| {
            let cell = read(text, &folder)?;
            Ok((grain_pool::Rve::new(&cell)?, cell))
        });
        let (rve, cell) = made.map_err(|error| raised(py, &error))?;
        Ok(Self { rve: Mutex::new(rve), cell })
    }

    #[getter]
    fn dimension(&self) -> u32 {
        self.cell.dimension()
    }

    #[getter]
    fn grains(&self) -> usize {
        self.cell.number()
    }

    /// Density of the packing, voids included, kg/m3.
    #[getter]
    fn bulk_density(&self) -> f64 {
        self.cell.bulk_density()
    }

    /// Strain that the cell takes in one ramp step.
    #[getter]
    fn strain_per_step(&self) -> f64 {
        self.cell.options().strain_per_step()
    }

    fn trial<'py>(
        &self,
        py: Python<'py>,
        target: &[u8],
        tangent: &str,
        observables: Vec<String>,
        ramp_steps: u32,
    ) -> PyResult<Bound<'py, PyDict>> {
        let dimension = self.cell.dimension() as usize;
        let options = options(tangent, &observables, ramp_steps)?;
        let Some(target) = tensors(target, dimension).first().copied() else {
            return Err(PyValueError::new_err("a target has one row and one column for each dimension of the cell"));
        };
        let result = self.done(py, |rve| rve.trial(&target, &options))?;
        dictionary(py, &[result], &options, dimension)
    }

    fn commit(&self, py: Python<'_>) -> PyResult<()> {
        self.done(py, grain_pool::Rve::commit)
    }

    fn rollback(&self, py: Python<'_>) -> PyResult<()> {
        self.done(py, |rve| {
            rve.rollback();
            Ok(())
        })
    }

    fn snapshot<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let snapshot = self.done(py, |rve| Ok(rve.snapshot()))?;
        Ok(PyBytes::new(py, &snapshot.to_bytes()))
    }

    fn restore(&self, py: Python<'_>, snapshot: Vec<u8>) -> PyResult<()> {
        self.done(py, |rve| {
            let read = grain_pool::Snapshot::from_bytes(&snapshot);
            let snapshot = read.map_err(|reason| PoolError::Snapshot { place: 0, reason })?;
            rve.restore(&snapshot, &self.cell)
        })
    }
}

impl Rve {
    fn done<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut grain_pool::Rve) -> Result<T, PoolError> + Send,
    ) -> PyResult<T> {
        py.detach(|| work(&mut self.rve.lock().unwrap_or_else(PoisonError::into_inner)))
            .map_err(|error| raised(py, &error))
    }
}

/// Runs an element test (TOML) and returns its rows as CSV, its counts, a warning about the packing, and why it stopped before its end.
#[pyfunction]
pub(crate) fn element_test<'py>(
    py: Python<'py>,
    text: String,
    folder: PathBuf,
    tangent: &str,
) -> PyResult<(Bound<'py, PyBytes>, Vec<(&'static str, u64)>, Option<String>, Option<String>)> {
    let tangent = tangent_kind(tangent)?;
    let outcome = interruptible(py, |keep_going| grain_pool::element_test(text, &folder, tangent, keep_going))?;
    let counts = outcome.summary.counts().to_vec();
    let of_packing = outcome.summary.listed_forces.warning();
    let stopped = outcome.stopped.map(|error| error.to_string());
    Ok((PyBytes::new(py, &outcome.csv), counts, of_packing, stopped))
}
