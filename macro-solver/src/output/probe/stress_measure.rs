//! Functions of the Cauchy stress.

use crate::formulation::tensor::matrix;
use nalgebra::Matrix3;
use protocol::Tensor2;

/// A function of the Cauchy stress. Tension positive, except the functions that say compression.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StressMeasure {
    /// Component of the Cauchy stress, Pa; row and column, 0 = x, 1 = y, 2 = z.
    Component(usize, usize),
    /// `sigma_yy` over `sigma_xx`.
    Ratio,
    /// Minus the mean of the first 2 or 3 normal stresses, Pa, **compression positive**.
    Pressure(usize),
    /// `sigma_xx - sigma_yy`, Pa, positive in vertical compression.
    Deviator,
    /// A principal value of the Cauchy stress, Pa.
    Principal(Rank, Axes),
    /// Ratio of two principal values of the Cauchy stress.
    PrincipalRatio(Rank, Rank, Axes),
    /// `|sigma_xx - sigma_yy| / |sigma_xx + sigma_yy|`, the stress measure of [Liu2018].
    SigmaBar,
    /// Mobilised friction angle, degrees: its sine is the difference of the major and minor principal stresses over their sum.
    FrictionAngle(Axes),
    /// `sqrt(3/2 s:s)` of the deviatoric stress in space, Pa.
    VonMises,
}

/// Directions among which principal values are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axes {
    /// x and y.
    Plane,
    /// x, y and z.
    Space,
}

/// A principal stress by its rank among compressions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rank {
    /// The largest compression.
    Major,
    /// Between the other two; of three axes.
    Intermediate,
    /// The smallest compression.
    Minor,
}

impl StressMeasure {
    /// Unit of the value; `-` if it has none.
    pub(super) fn unit(&self) -> &'static str {
        match self {
            Self::Ratio | Self::PrincipalRatio(..) | Self::SigmaBar => "-",
            Self::FrictionAngle(_) => "degrees",
            Self::Component(..) | Self::Pressure(_) | Self::Deviator | Self::Principal(..) | Self::VonMises => "Pa",
        }
    }

    /// Value for a stress, Pa.
    pub fn of(&self, stress: &Tensor2) -> f64 {
        let (xx, yy) = (stress.get(0, 0), stress.get(1, 1));
        match *self {
            Self::Component(row, column) => stress.get(row, column),
            Self::Ratio => yy / xx,
            Self::Pressure(axes) => -(0..axes).map(|axis| stress.get(axis, axis)).sum::<f64>() / axes as f64,
            Self::Deviator => xx - yy,
            Self::Principal(rank, axes) => principal_value(rank, axes, stress),
            Self::PrincipalRatio(upper, lower, axes) => {
                principal_value(upper, axes, stress) / principal_value(lower, axes, stress)
            }
            Self::SigmaBar => ((xx - yy) / (xx + yy)).abs(),
            Self::FrictionAngle(axes) => {
                let [major, minor] = [Rank::Major, Rank::Minor].map(|rank| principal_value(rank, axes, stress));
                ((major - minor) / (major + minor)).asin().to_degrees()
            }
            Self::VonMises => {
                let stress = matrix(stress);
                let deviator =
                    0.5 * (stress + stress.transpose()) - Matrix3::from_diagonal_element(stress.trace() / 3.0);
                (1.5 * deviator.norm_squared()).sqrt()
            }
        }
    }
}

/// Principal value of the symmetric part of a stress, Pa, tension positive.
fn principal_value(rank: Rank, axes: Axes, stress: &Tensor2) -> f64 {
    // Ascending: the largest compression first.
    let values = match axes {
        Axes::Plane => {
            let [[xx, xy], [yx, yy]] = stress.plane();
            let (middle, radius) = (0.5 * (xx + yy), (0.5 * (xx - yy)).hypot(0.5 * (xy + yx)));
            [middle - radius, middle, middle + radius]
        }
        Axes::Space => {
            let stress = matrix(stress);
            let mut values = (0.5 * (stress + stress.transpose())).symmetric_eigenvalues();
            values.as_mut_slice().sort_by(f64::total_cmp);
            values.into()
        }
    };
    match rank {
        Rank::Major => values[0],
        Rank::Intermediate => values[1],
        Rank::Minor => values[2],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn principal_stresses_and_their_ratios_follow_compression() {
        // Major 5 along 30 degrees, minor 1, and 2 out of the plane.
        let (sin, cos) = 30_f64.to_radians().sin_cos();
        let (xx, yy, xy) = (-5.0 * cos * cos - sin * sin, -5.0 * sin * sin - cos * cos, -4.0 * sin * cos);
        let stress = Tensor2([xx, xy, 0.0, xy, yy, 0.0, 0.0, 0.0, -2.0]);
        let of = |measure: StressMeasure| measure.of(&stress);
        let principal = |rank, axes| of(StressMeasure::Principal(rank, axes));
        assert!((principal(Rank::Major, Axes::Plane) + 5.0).abs() < 1e-14);
        assert!((principal(Rank::Minor, Axes::Plane) + 1.0).abs() < 1e-14);
        assert!((principal(Rank::Intermediate, Axes::Space) + 2.0).abs() < 1e-14);
        let ratio = StressMeasure::PrincipalRatio(Rank::Major, Rank::Intermediate, Axes::Space);
        assert!((of(ratio) - 2.5).abs() < 1e-14);
        assert!((of(StressMeasure::FrictionAngle(Axes::Plane)) - (4.0_f64 / 6.0).asin().to_degrees()).abs() < 1e-12);
        assert!((of(StressMeasure::SigmaBar) - ((xx - yy) / (xx + yy)).abs()).abs() < 1e-15);
        let mises = (0.5_f64 * (16.0 + 1.0 + 9.0)).sqrt();
        assert!((of(StressMeasure::VonMises) - mises).abs() < 1e-13);
    }
}
