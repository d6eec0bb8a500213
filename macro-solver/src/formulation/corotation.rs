//! The corotated frame of a step.
//!
//! [Liu2015] section 2.3.3 drives a point by the strain increment in a frame that turns with the material. With the
//! step gradient `G` on the committed configuration: `L = G (I + G/2)^-1` is the gradient on the midpoint geometry,
//! `D = sym L` the strain increment, `F_mid = (I + G/2) F_n = R_mid U_mid`, and `E = R_mid^T D R_mid` its corotated form.
//! The material is given `H = E (I - E/2)^-1`, the gradient whose midpoint strain is `E`: sending `E` itself would lose
//! `E^2 / 2` in every step and be of first order only. Its stress `s` becomes `sigma = R_end s R_end^T` with `F_end = (I + G) F_n = R_end U_end`.
//! The paper's listing of the algorithm is missing; this is the standard midpoint rule that its text describes.

use super::AveragedModuli;
use super::tensor::{Operator, column, from_column, unit};
use nalgebra::{Matrix3, Vector3};

/// Rotations and strain of one step at one point.
#[derive(Clone, Debug, PartialEq)]
pub struct Corotation {
    /// Strain increment in the corotated frame, `E`.
    pub strain: Matrix3<f64>,
    /// Strain increment in the fixed axes, `D`; what a nonlocal operator averages.
    pub spatial_strain: Matrix3<f64>,
    /// Rotation at the middle of the step.
    pub midpoint: Polar,
    /// Rotation at the end of the step.
    pub end: Polar,
    committed: Matrix3<f64>,
    gradient: Matrix3<f64>,
    to_midpoint: Matrix3<f64>,
}

impl Corotation {
    /// Of the step gradient `gradient` from the committed deformation gradient `committed`; `None` if the point is
    /// turned inside out on the way.
    pub fn of_step(committed: &Matrix3<f64>, gradient: &Matrix3<f64>) -> Option<Self> {
        let half = Matrix3::identity() + 0.5 * gradient;
        let to_midpoint = half.try_inverse()?;
        let midpoint = Polar::of(&(half * committed))?;
        let end = Polar::of(&((Matrix3::identity() + gradient) * committed))?;
        let rate = gradient * to_midpoint;
        let spatial_strain = 0.5 * (rate + rate.transpose());
        Some(Self {
            strain: midpoint.rotation.transpose() * spatial_strain * midpoint.rotation,
            spatial_strain,
            midpoint,
            end,
            committed: *committed,
            gradient: *gradient,
            to_midpoint,
        })
    }

    /// A strain increment of the fixed axes, for example an average over neighbours, in the corotated frame.
    pub fn into_frame(&self, strain: &Matrix3<f64>) -> Matrix3<f64> {
        self.midpoint.rotation.transpose() * strain * self.midpoint.rotation
    }

    /// The target of the material for a corotated strain increment, `H = E (I - E/2)^-1`; `None` for increments that no
    /// motion has.
    pub fn target(strain: &Matrix3<f64>) -> Option<Matrix3<f64>> {
        Some(strain * (Matrix3::identity() - 0.5 * strain).try_inverse()?)
    }

    /// A stress of the corotated frame in the fixed axes at the end of the step.
    pub fn out_of_frame(&self, stress: &Matrix3<f64>) -> Matrix3<f64> {
        self.end.rotation * stress * self.end.rotation.transpose()
    }

    /// `d sigma_ij / d L_kl` with the displacement gradient `L` on the current configuration, from the stress and the
    /// tangent in the corotated frame. Exact derivative of the whole step, rotations included. `None` for increments
    /// that no motion has.
    pub fn stress_change(&self, stress: &Matrix3<f64>, tangent: &Operator) -> Option<Operator> {
        let to_target = (Matrix3::identity() - 0.5 * self.strain).try_inverse()?;
        let from_start = (Matrix3::identity() + self.strain * to_target).try_inverse()?;
        let (middle, end) = (&self.midpoint.rotation, &self.end.rotation);
        let mut change = Operator::zeros();
        for pair in 0..9 {
            let step = unit(pair) * (Matrix3::identity() + self.gradient);
            // With M = (I + G/2)^-1, L = G M changes by M dG M; likewise the target with (I - E/2)^-1.
            let rate = self.to_midpoint * step * self.to_midpoint;
            let spin_middle = self.midpoint.spin(&(0.5 * step * self.committed));
            let spin_end = self.end.spin(&(step * self.committed));
            let strain = middle.transpose() * (0.5 * (rate + rate.transpose())) * middle + self.strain * spin_middle
                - spin_middle * self.strain;
            let own = from_column(&(tangent * column(&(to_target * strain * to_target * from_start))));
            let turned = end * (own + spin_end * stress - stress * spin_end) * end.transpose();
            change.set_column(pair, &column(&turned));
        }
        Some(change)
    }

    /// Parts of the derivative of the stress of a point that was given `average`, a strain increment in the fixed axes, in place of
    /// its own; `stress` and `tangent` are those of the corotated frame. `None` for increments that no motion has.
    pub fn averaged_moduli(
        &self,
        average: &Matrix3<f64>,
        stress: &Matrix3<f64>,
        tangent: &Operator,
    ) -> Option<AveragedModuli> {
        let seen = self.into_frame(average);
        let to_target = (Matrix3::identity() - 0.5 * seen).try_inverse()?;
        let from_start = (Matrix3::identity() + seen * to_target).try_inverse()?;
        let (middle, end) = (&self.midpoint.rotation, &self.end.rotation);
        let answer =
            |strain: &Matrix3<f64>| from_column(&(tangent * column(&(to_target * strain * to_target * from_start))));
        let mut moduli =
            AveragedModuli { own: Operator::zeros(), seen: Operator::zeros(), strain: Operator::zeros() };
        for pair in 0..9 {
            let unit = unit(pair);
            let step = unit * (Matrix3::identity() + self.gradient);
            let rate = self.to_midpoint * step * self.to_midpoint;
            moduli.strain.set_column(pair, &column(&(0.5 * (rate + rate.transpose()))));
            let spin_middle = self.midpoint.spin(&(0.5 * step * self.committed));
            let spin_end = self.end.spin(&(step * self.committed));
            let turned = answer(&(seen * spin_middle - spin_middle * seen));
            let own = end * (turned + spin_end * stress - stress * spin_end) * end.transpose();
            moduli.own.set_column(pair, &column(&own));
            let straight = end * answer(&(middle.transpose() * unit * middle)) * end.transpose();
            moduli.seen.set_column(pair, &column(&straight));
        }
        Some(moduli)
    }
}

/// Polar decomposition `F = R U`.
#[derive(Clone, Debug, PartialEq)]
pub struct Polar {
    /// Rotation `R`.
    pub rotation: Matrix3<f64>,
    /// Right stretch `U`.
    pub stretch: Matrix3<f64>,
}

impl Polar {
    /// Decomposes a deformation gradient; `None` unless its determinant is positive and finite.
    pub fn of(deformation: &Matrix3<f64>) -> Option<Self> {
        let determinant = deformation.determinant();
        if !(determinant > 0.0 && determinant.is_finite()) {
            return None;
        }
        // Newton's iteration R <- (R + R^-T) / 2 converges quadratically for any invertible start.
        let mut rotation = *deformation;
        for _ in 0..60 {
            let next = 0.5 * (rotation + rotation.try_inverse()?.transpose());
            let change = (next - rotation).amax();
            rotation = next;
            if change < 1e-15 {
                break;
            }
        }
        let stretch = rotation.transpose() * deformation;
        Some(Self { rotation, stretch: 0.5 * (stretch + stretch.transpose()) })
    }

    /// `R^T dR` for a change `dF` of the deformation gradient: the skew `W` with `W U + U W = R^T dF - dF^T R`.
    pub fn spin(&self, change: &Matrix3<f64>) -> Matrix3<f64> {
        let turned = self.rotation.transpose() * change;
        let skew = turned - turned.transpose();
        let right = Vector3::new(skew[(2, 1)], skew[(0, 2)], skew[(1, 0)]);
        let system = Matrix3::identity() * self.stretch.trace() - self.stretch;
        let inverse = system.try_inverse().expect("the stretch is positive definite");
        (inverse * right).cross_matrix()
    }
}
