//! Fields of the elements, from the VTU files of a run.

use super::error::ReproduceError;
use super::results::{Finished, unusable};
use macro_solver::output::{frame_file, step_of_frame};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use vtkio::model::{Attribute, DataSet, Piece, UnstructuredGridPiece, VertexNumbers};

/// The mesh and the fields of one written step.
#[derive(Debug)]
pub(super) struct Fields {
    file: PathBuf,
    grid: UnstructuredGridPiece,
}

impl Fields {
    /// Numbers of the steps that a run has written.
    pub(super) fn steps(run: &Finished) -> Vec<usize> {
        let entries = std::fs::read_dir(run.folder().join("fields")).into_iter().flatten().flatten();
        let step = |name: OsString| step_of_frame(&format!("fields/{}", name.to_string_lossy()));
        let mut steps: Vec<usize> =
            entries.filter_map(|entry| step(entry.file_name()).map(|step| step as usize)).collect();
        steps.sort_unstable();
        steps
    }

    /// The fields of a step.
    ///
    /// # Errors
    /// The run has not written it, or it cannot be read.
    pub(super) fn read(run: &Finished, step: usize) -> Result<Self, ReproduceError> {
        Self::of_file(&run.folder().join(frame_file(step as u64)))
    }

    fn of_file(file: &Path) -> Result<Self, ReproduceError> {
        let model = vtkio::Vtk::import(file).map_err(|error| unusable(file, &error))?;
        let DataSet::UnstructuredGrid { pieces, .. } = model.data else {
            return Err(unusable(file, &"not a mesh"));
        };
        match pieces.into_iter().next() {
            Some(Piece::Inline(grid)) => Ok(Self { file: file.to_owned(), grid: *grid }),
            _ => Err(unusable(file, &"no mesh in it")),
        }
    }

    /// Centres of the elements at the start, m.
    ///
    /// # Errors
    /// The mesh cannot be read.
    pub(super) fn centres(&self) -> Result<Vec<[f64; 3]>, ReproduceError> {
        let points = self.points()?;
        let mean = |own: &Vec<usize>, axis: usize| {
            own.iter().map(|node| points[3 * node + axis]).sum::<f64>() / own.len() as f64
        };
        Ok(self.nodes()?.iter().map(|own| [0, 1, 2].map(|axis| mean(own, axis))).collect())
    }

    /// First four corners of the elements in the plane of x and y, displaced, m: of bricks of one layer the whole outline.
    ///
    /// # Errors
    /// The mesh or the displacements cannot be read.
    pub(super) fn outlines(&self) -> Result<Vec<[[f64; 2]; 4]>, ReproduceError> {
        let points = self.points()?;
        let moved = self.values(&self.grid.data.point, "displacement")?;
        let nodes = self.nodes()?;
        if nodes.iter().any(|own| own.len() < 4) || moved.len() != points.len() {
            return Err(unusable(&self.file, &"elements without four corners"));
        }
        let place = |node: usize| [0, 1].map(|axis| points[3 * node + axis] + moved[3 * node + axis]);
        Ok(nodes.iter().map(|own| [0, 1, 2, 3].map(|corner| place(own[corner]))).collect())
    }

    /// Coordinates of the nodes at the start, m, three each.
    fn points(&self) -> Result<Vec<f64>, ReproduceError> {
        let points = self.grid.points.clone().cast_into::<f64>();
        points.ok_or_else(|| unusable(&self.file, &"points are no numbers"))
    }

    /// Nodes of the elements.
    fn nodes(&self) -> Result<Vec<Vec<usize>>, ReproduceError> {
        let (nodes, ends) = match &self.grid.cells.cell_verts {
            VertexNumbers::XML { connectivity, offsets } => (connectivity, offsets),
            VertexNumbers::Legacy { .. } => return Err(unusable(&self.file, &"an old form of elements")),
        };
        let mut begin = 0;
        let mut found = Vec::new();
        for end in ends {
            let end = *end as usize;
            found.push(nodes[begin..end].iter().map(|node| *node as usize).collect());
            begin = end;
        }
        Ok(found)
    }

    /// A field of the elements: its numbers, element after element.
    ///
    /// # Errors
    /// There is no such field.
    pub(super) fn element_values(&self, name: &str) -> Result<Vec<f64>, ReproduceError> {
        self.values(&self.grid.data.cell, name)
    }

    fn values(&self, fields: &[Attribute], name: &str) -> Result<Vec<f64>, ReproduceError> {
        match fields.iter().find(|attribute| attribute.name() == name) {
            Some(Attribute::DataArray(array)) => array
                .data
                .clone()
                .cast_into::<f64>()
                .ok_or_else(|| unusable(&self.file, &format!("field '{name}' has no numbers"))),
            _ => Err(unusable(&self.file, &format!("there is no field '{name}'"))),
        }
    }

    /// Mean of a field over the elements whose centres have the same coordinate along `axis`: pairs of coordinate and mean, in order.
    ///
    /// # Errors
    /// There is no such field.
    pub(super) fn profile(&self, name: &str, axis: usize) -> Result<Vec<[f64; 2]>, ReproduceError> {
        let values = self.element_values(name)?;
        let mut rows: Vec<(f64, f64, usize)> = Vec::new();
        for (centre, value) in self.centres()?.iter().zip(values) {
            match rows.iter_mut().find(|row| (row.0 - centre[axis]).abs() < 1e-9) {
                Some(row) => {
                    row.1 += value;
                    row.2 += 1;
                }
                None => rows.push((centre[axis], value, 1)),
            }
        }
        rows.sort_by(|one, other| one.0.total_cmp(&other.0));
        Ok(rows.into_iter().map(|(place, sum, count)| [place, sum / count as f64]).collect())
    }
}
