//! The stress that a packing is brought to, in axes of the cell: axis 1 along Y1, axis 2 in the plane of Y1 and Y2.

use crate::definition::PackingError;

/// A 3x3 tensor, row-major; plane tensors use the upper left block.
pub(crate) type Matrix = [[f64; 3]; 3];

/// A compressive stress: pressure and deviator. Kept apart because a servo raises both in proportion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StressTarget {
    /// Mean pressure, Pa, compression positive.
    pub pressure: f64,
    /// Stress minus its mean part, Pa, tension positive; zero outside the dimensions of the packing.
    pub deviator: [[f64; 3]; 3],
    /// 2 or 3.
    pub dimension: usize,
}

impl StressTarget {
    /// The same pressure in all directions.
    ///
    /// # Errors
    /// [`PackingError::Content`] if the pressure is not positive.
    pub fn isotropic(pressure: f64, dimension: usize) -> Result<Self, PackingError> {
        if pressure.is_finite() && pressure > 0.0 {
            return Ok(Self { pressure, deviator: [[0.0; 3]; 3], dimension });
        }
        Err(PackingError::Content(format!("pressure = {pressure} must be a positive number")))
    }

    /// A tensor in space, of which a plane target takes the plane components.
    ///
    /// # Errors
    /// As [`StressTarget::from_rows`].
    pub fn of_tensor(stress: &[[f64; 3]; 3], dimension: usize) -> Result<Self, PackingError> {
        let rows: Vec<Vec<f64>> = stress[..dimension].iter().map(|row| row[..dimension].to_vec()).collect();
        Self::from_rows(&rows, dimension)
    }

    /// A full tensor by its rows.
    ///
    /// # Errors
    /// [`PackingError::Content`] unless it is symmetric, of the right size and compressive in every direction.
    pub fn from_rows(rows: &[Vec<f64>], dimension: usize) -> Result<Self, PackingError> {
        let refuse = |reason: String| Err(PackingError::Content(reason));
        if rows.len() != dimension || rows.iter().any(|row| row.len() != dimension) {
            return refuse(format!("stress needs {dimension} rows of {dimension} numbers"));
        }
        let mut stress = [[0.0; 3]; 3];
        for (i, row) in rows.iter().enumerate() {
            stress[i][..dimension].copy_from_slice(row);
        }
        let whole = nalgebra::DMatrix::from_fn(dimension, dimension, |i, j| stress[i][j]);
        if !whole.iter().all(|value| value.is_finite()) {
            return refuse("stress holds a number that is not finite".into());
        }
        if whole != whole.transpose() {
            return refuse("stress must be symmetric: grains carry no couple".into());
        }
        let largest = whole.symmetric_eigenvalues().max();
        if largest >= 0.0 {
            return refuse(format!(
                "stress has a principal value of {largest:e} Pa; tension is positive, and grains bear none"
            ));
        }
        let pressure = -whole.trace() / dimension as f64;
        for (i, row) in stress.iter_mut().enumerate().take(dimension) {
            row[i] += pressure;
        }
        Ok(Self { pressure, deviator: stress, dimension })
    }

    /// Smallest and largest principal pressure, Pa, compression positive.
    pub(crate) fn principal_pressures(&self) -> [f64; 2] {
        let stress = nalgebra::DMatrix::from_fn(self.dimension, self.dimension, |i, j| self.component(i, j));
        let values = stress.symmetric_eigenvalues();
        [-values.max(), -values.min()]
    }

    /// Component `ij` of the target, Pa.
    pub fn component(&self, i: usize, j: usize) -> f64 {
        if i == j { -self.pressure + self.deviator[i][j] } else { self.deviator[i][j] }
    }
}

/// Index pairs of a symmetric tensor: first the diagonal, then 12 (, 13, 23).
pub(crate) fn symmetric_pairs(dimension: usize) -> &'static [(usize, usize)] {
    if dimension == 2 { &[(0, 0), (1, 1), (0, 1)] } else { &[(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)] }
}

/// `R^T a R`, the tensor whose components in turned axes are `a`. The rows of `R` are the turned axes. An exactly zero
/// tensor stays exactly zero.
pub(crate) fn turned_out(a: &Matrix, rotation: &Matrix) -> Matrix {
    let mut result = [[0.0; 3]; 3];
    for (i, row) in result.iter_mut().enumerate() {
        for (j, value) in row.iter_mut().enumerate() {
            for k in 0..3 {
                for l in 0..3 {
                    *value += rotation[k][i] * a[k][l] * rotation[l][j];
                }
            }
        }
    }
    result
}

/// The symmetric part.
pub(crate) fn symmetric(a: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| 0.5 * (a[i][j] + a[j][i])))
}

/// `R a R^T`, the components of `a` in turned axes.
pub(crate) fn turned_in(a: &Matrix, rotation: &Matrix) -> Matrix {
    let mut transposed = [[0.0; 3]; 3];
    for (i, row) in rotation.iter().enumerate() {
        for (j, value) in row.iter().enumerate() {
            transposed[j][i] = *value;
        }
    }
    turned_out(a, &transposed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unsound_stresses_are_refused() {
        let reason = |rows: &[&[f64]]| {
            let rows: Vec<Vec<f64>> = rows.iter().map(|row| row.to_vec()).collect();
            StressTarget::from_rows(&rows, 2).unwrap_err().to_string()
        };
        assert!(reason(&[&[-1.0, 0.0]]).contains("2 rows"));
        assert!(reason(&[&[-1.0, 0.1], &[0.2, -1.0]]).contains("symmetric"));
        assert!(reason(&[&[-1.0, 1.5], &[1.5, -1.0]]).contains("principal value"));
        assert!(reason(&[&[1.0, 0.0], &[0.0, 1.0]]).contains("tension is positive"));
        assert!(StressTarget::isotropic(-1.0, 2).unwrap_err().to_string().contains("pressure = -1"));
    }

    #[test]
    fn parts_add_up_to_the_whole() {
        let target = StressTarget::from_rows(&[vec![-1.0, 0.2], vec![0.2, -3.0]], 2).unwrap();
        assert_eq!(target.pressure, 2.0);
        assert_eq!([target.component(0, 0), target.component(1, 1), target.component(0, 1)], [-1.0, -3.0, 0.2]);
    }

    #[test]
    fn turning_in_and_out_are_inverse() {
        let (sine, cosine) = 0.3f64.sin_cos();
        let rotation = [[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]];
        let a = [[1.0, 0.5, 0.1], [0.5, -2.0, 0.3], [0.1, 0.3, 0.7]];
        let back = turned_out(&turned_in(&a, &rotation), &rotation);
        assert!(back.iter().flatten().zip(a.iter().flatten()).all(|(x, y)| (x - y).abs() < 1e-15));
    }
}
