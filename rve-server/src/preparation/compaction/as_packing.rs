//! A cell in the axes of the packing that it is to become, and that packing.

use super::{Compaction, rows};
use crate::cell::{Cell, ContactRecord, renamed};
use crate::definition::{ListedContact, PackingError, PackingFile};
use crate::preparation::stress_target::{Matrix, symmetric, turned_in, turned_out};
use crate::solver::SolverFor;
use crate::space::{Components, Tensor, apply, cross};
use protocol::Tensor2;

impl<S: SolverFor> Compaction<'_, S> {
    /// The committed state as a file, turned so that Y1 points along axis 1.
    ///
    /// # Errors
    /// [`PackingError::Content`].
    pub(crate) fn packing(&self, provenance: serde_json::Value) -> Result<PackingFile<S>, PackingError> {
        let state = self.cell.committed();
        let axes = self.axes();
        let back = S::Tensor::from_fn(|i, j| axes[i][j]);
        let turned = self.cell_by_first_vectors().deformed(&back).rows;
        // Y1 along axis 1, Y2 in the plane of axes 1 and 2: what rounding has left elsewhere is taken out.
        let rows = S::Tensor::from_fn(|row, axis| if axis > row { 0.0 } else { turned[row][axis] });
        let radii = &self.cell.model().radii;
        let grains =
            state.positions.iter().zip(radii).map(|(position, radius)| S::grain(apply(&back, *position), *radius));
        let (mut contacts, mut rolling_moments) = (Vec::new(), Vec::new());
        for (place, contact) in state.contacts.iter().enumerate() {
            let moment = state.rolling_moments.get(place).copied();
            let (contact, moment) = match self.first_vectors.are_those_of_now::<S>() {
                true => (*contact, moment),
                false => renamed(contact, moment, self.first_vectors.shift::<S>(contact.shift)),
            };
            if contact.tangential_force.norm() == 0.0 && moment.is_none_or(|moment| moment.norm() == 0.0) {
                continue;
            }
            let ContactRecord { origin, end, shift, tangential_force } = contact;
            let tangential_force = S::turned_tangential(tangential_force, &back);
            contacts.push(ListedContact { origin, end, shift, tangential_force });
            rolling_moments.extend(moment.map(|moment| S::turned_spin(moment, &back)));
        }
        if rolling_moments.iter().all(|moment| moment.norm() == 0.0) {
            rolling_moments.clear();
        }
        let version =
            if rolling_moments.is_empty() { PackingFile::VERSION } else { PackingFile::VERSION_WITH_MOMENTS };
        PackingFile {
            version,
            thickness: self.cell.model().thickness,
            contacts,
            rolling_moments,
            provenance,
            ..PackingFile::<S>::new(rows, grains.collect())
        }
        .checked()
    }

    /// Largest deviation of a stress component from the target, over the target pressure: in the axes in which grains are solved, and in
    /// those of the file, in which the packing is judged.
    pub(super) fn stress_error(&self, stress: &Tensor2) -> f64 {
        let axes = self.axes();
        let (stress, deviator) = (rows(stress), turned_out(&self.target.deviator, &axes));
        let own = turned_in(&symmetric(&stress), &axes);
        let mut largest = 0.0f64;
        for i in 0..self.target.dimension {
            for j in 0..self.target.dimension {
                let mean = if i == j { self.target.pressure } else { 0.0 };
                let errors = [stress[i][j] - deviator[i][j], own[i][j] - self.target.deviator[i][j]];
                largest = errors.iter().fold(largest, |largest, error| largest.max((error + mean).abs()));
            }
        }
        largest / self.target.pressure
    }

    /// The committed cell by the vectors that the packing was given with.
    fn cell_by_first_vectors(&self) -> Cell<S> {
        Cell { rows: self.first_vectors.rows::<S>(&self.cell.committed().cell.rows) }
    }

    /// Axes of the committed cell as rows: the first along Y1 of the packing as it was given, the second in the plane of that and Y2.
    pub(super) fn axes(&self) -> Matrix {
        let rows = self.cell_by_first_vectors().rows;
        let unit = |v: [f64; 3]| {
            let length = v.dot(v).sqrt();
            v.map(|component| component / length)
        };
        let row = |i: usize| std::array::from_fn(|axis| if axis < S::DIMENSION { rows[i][axis] } else { 0.0 });
        let first: [f64; 3] = unit(row(0));
        let third = if S::DIMENSION == 2 { [0.0, 0.0, 1.0] } else { unit(cross(first, row(1))) };
        [first, cross(third, first), third]
    }
}
