//! Geometry of the contact network: coordination, fabric, overlap.

use crate::cell::ContactNetwork;
use crate::space::{Components, Space, Tensor};

/// Overlap over the smaller diameter from which answers are flagged and packings warned about: contact laws of springs between the centres
/// of spheres, and of pairs that know of each other alone, do not hold there.
pub const LARGE_OVERLAP_RATIO: f64 = 0.1;

/// Overlap over the smaller diameter from which a packing is refused: the centre of one grain lies inside another one.
pub(crate) const LARGEST_OVERLAP_RATIO: f64 = 0.5;

/// A minor principal value of a fabric below this share of the major one is rounding.
pub(crate) const NO_MINOR_VALUE: f64 = 1e-14;

impl<S: Space> ContactNetwork<S> {
    /// Void area or volume over that of the grains. Overlaps count twice as grain, as is usual.
    pub fn void_ratio(&self) -> f64 {
        let solid: f64 = self.radii.iter().map(|radius| S::grain_measure(*radius)).sum();
        (self.measure() - solid) / solid
    }

    /// 2 x contacts over grains.
    pub fn coordination_number(&self) -> f64 {
        2.0 * self.contacts.len() as f64 / self.positions.len() as f64
    }

    /// Contact fabric `1/C sum n x n`; zero without contacts.
    pub fn fabric(&self) -> S::Tensor {
        let mut sum = S::Tensor::ZERO;
        for contact in &self.contacts {
            let branch = self.branch(contact);
            let square = branch.dot(branch);
            for i in 0..S::DIMENSION {
                for j in 0..S::DIMENSION {
                    sum[i][j] += branch[i] * branch[j] / square;
                }
            }
        }
        let scale = 1.0 / (self.contacts.len().max(1)) as f64;
        S::Tensor::from_fn(|i, j| sum[i][j] * scale)
    }

    /// Largest overlap over the smaller grain diameter of its contact; 0 without contacts.
    pub fn max_overlap_ratio(&self) -> f64 {
        self.contacts.iter().fold(0.0, |largest: f64, contact| {
            let branch = self.branch(contact);
            let (o, e) = (self.radii[contact.origin as usize], self.radii[contact.end as usize]);
            largest.max((o + e - branch.norm()) / (2.0 * o.min(e)))
        })
    }
}

/// Anisotropy of a fabric tensor: major over minor principal value, minus 1. It is 0 for a zero tensor, and where all contacts lie in
/// one direction or one plane: the quotient does not exist there, and the number must stay finite on the wire.
pub fn anisotropy<T: Tensor>(fabric: &T) -> f64 {
    let [minor, major] = extreme_principal_values(fabric);
    if minor <= NO_MINOR_VALUE * major { 0.0 } else { major / minor - 1.0 }
}

/// Smallest and largest principal value of the symmetric part of a tensor.
fn extreme_principal_values<T: Tensor>(a: &T) -> [f64; 2] {
    let symmetric = T::from_fn(|i, j| 0.5 * (a[i][j] + a[j][i]));
    let deviation = |i: usize, j: usize, mean: f64| if i == j { symmetric[i][j] - mean } else { symmetric[i][j] };
    let mean = (0..T::DIMENSION).map(|i| symmetric[i][i]).sum::<f64>() / T::DIMENSION as f64;
    if T::DIMENSION == 2 {
        let radius = (0.5 * (symmetric[0][0] - symmetric[1][1])).hypot(symmetric[0][1]);
        return [mean - radius, mean + radius];
    }
    // Trigonometric roots of the characteristic cubic of the deviator.
    let deviator = T::from_fn(|i, j| deviation(i, j, mean));
    let half_square = 0.5 * deviator.components().map(|value| value * value).sum::<f64>();
    if half_square == 0.0 {
        return [mean, mean];
    }
    let radius = 2.0 * (half_square / 3.0).sqrt();
    let cosine = (4.0 * deviator.determinant() / radius.powi(3)).clamp(-1.0, 1.0);
    let angle = cosine.acos() / 3.0;
    [mean + radius * (angle + std::f64::consts::TAU / 3.0).cos(), mean + radius * angle.cos()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn principal_values_in_space_are_those_of_the_definition() {
        let fabric = [[0.5, 0.1, -0.05], [0.1, 0.3, 0.02], [-0.05, 0.02, 0.2]];
        let values = nalgebra::Matrix3::from_fn(|i, j| fabric[i][j]).symmetric_eigenvalues();
        assert!((anisotropy(&fabric) - (values.max() / values.min() - 1.0)).abs() < 1e-13);
        assert!(anisotropy(&[[1.0 / 3.0, 0.0, 0.0], [0.0, 1.0 / 3.0, 0.0], [0.0, 0.0, 1.0 / 3.0]]).abs() < 1e-15);
        // One direction, as given and turned, where roundings leave a minor value.
        assert_eq!(anisotropy(&[[1.0, 0.0, 0.0], [0.0; 3], [0.0; 3]]), 0.0);
        for angle in [0.3_f64, 0.7, 1.1, 2.0] {
            let (sine, cosine) = angle.sin_cos();
            assert_eq!(anisotropy(&[[cosine * cosine, cosine * sine], [cosine * sine, sine * sine]]), 0.0);
        }
        assert_eq!(anisotropy(&[[0.0; 3]; 3]), 0.0);
        assert!((anisotropy(&[[0.6, 0.0], [0.0, 0.4]]) - 0.5).abs() < 1e-15);
    }
}
