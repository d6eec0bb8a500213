//! Change of the stress of a point that is given the average of strain increments over a neighbourhood.
//!
//! Its stress depends on the motion of many points: on its own by the rotations of the corotated frame, and on those of all
//! neighbours by their strain increments, `sigma_I(R_I, sum_J a_IJ e_J)`. The derivative is kept in parts, because it is only
//! put together between points.

use super::conversion::spatial_moduli;
use super::corotation::Corotation;
use super::small_strain::small_strain_moduli;
use super::tensor::{Operator, column, unit};
use super::{Formulation, Response};
use nalgebra::Matrix3;

/// Parts of the derivative of a stress by averages. `L` is a displacement gradient on the configuration of
/// [`Formulation::integration`]; stresses are Cauchy stresses in the fixed axes.
#[derive(Clone, Debug, PartialEq)]
pub struct AveragedModuli {
    /// `d sigma / d L` of the point itself at a fixed average, by its rotations, Pa.
    pub own: Operator,
    /// `d sigma / d <e>` with the average of strain increments, Pa.
    pub seen: Operator,
    /// `d e / d L` of the strain increment that the neighbours of the point average, dimensionless.
    pub strain: Operator,
}

impl Formulation {
    /// The parts of a point's derivative: the point moves by the step gradient `gradient` from the committed deformation gradient
    /// `committed`, has been given the strain increment `average`, and has answered with `stress` (Pa) and `tangent`. `None` if the
    /// motion turns the point inside out, and for formulations without strain increments.
    pub fn averaged_moduli(
        self,
        committed: &Matrix3<f64>,
        gradient: &Matrix3<f64>,
        average: &Matrix3<f64>,
        stress: &Matrix3<f64>,
        tangent: &Operator,
    ) -> Option<AveragedModuli> {
        match self {
            Self::SmallStrain => Some(AveragedModuli {
                own: Operator::zeros(),
                seen: small_strain_moduli(average, tangent)?,
                strain: symmetric_part(),
            }),
            Self::TotalLagrangian | Self::UpdatedLagrangian => None,
            Self::Corotational => Corotation::of_step(committed, gradient)?.averaged_moduli(average, stress, tangent),
        }
    }

    /// The same for a point of which only the response to its own motion is known, as if nothing turned: what is left of it for the
    /// first iterate of a stage.
    pub fn averaged_moduli_of(self, response: &Response) -> AveragedModuli {
        let seen = response.moduli - self.geometric_moduli(&response.stress);
        AveragedModuli { own: Operator::zeros(), seen, strain: symmetric_part() }
    }

    /// Change of the nominal stress with `L` at a fixed Cauchy stress, Pa: by the volume and the area that carries it.
    pub fn geometric_moduli(self, stress: &Matrix3<f64>) -> Operator {
        match self {
            Self::SmallStrain | Self::TotalLagrangian => Operator::zeros(),
            Self::UpdatedLagrangian | Self::Corotational => spatial_moduli(&Operator::zeros(), stress),
        }
    }

    /// The part of [`Formulation::geometric_moduli`] by the volume alone, Pa.
    pub fn volumetric_moduli(self, stress: &Matrix3<f64>) -> Operator {
        match self {
            Self::SmallStrain | Self::TotalLagrangian => Operator::zeros(),
            Self::UpdatedLagrangian | Self::Corotational => column(stress) * column(&Matrix3::identity()).transpose(),
        }
    }
}

/// `d sym(L) / d L`.
fn symmetric_part() -> Operator {
    let mut part = Operator::zeros();
    for pair in 0..9 {
        let unit = unit(pair);
        part.set_column(pair, &column(&(0.5 * (unit + unit.transpose()))));
    }
    part
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formulation::tensor::from_column;

    /// `s = H . T . H^T + tr(H) S`, smooth and without symmetries of its own, in the frame of the material.
    fn law(target: &Matrix3<f64>) -> Matrix3<f64> {
        let fibre = Matrix3::new(2.0, 0.3, 0.0, 0.3, 1.0, 0.1, 0.0, 0.1, 0.5);
        fibre * target.trace() + 1.5 * (target + target.transpose()) + 4.0 * target.transpose() * target
    }

    /// `d s / d F` relative to the end of the trial, by central differences.
    fn tangent(target: &Matrix3<f64>) -> Operator {
        let mut tangent = Operator::zeros();
        for pair in 0..9 {
            let step = 1e-6 * unit(pair) * (Matrix3::identity() + target);
            tangent.set_column(pair, &column(&((law(&(target + step)) - law(&(target - step))) / 2e-6)));
        }
        tangent
    }

    /// Every part against central differences of the stress and of the strain increment.
    #[test]
    fn parts_are_derivatives_of_stress_and_strain() {
        let committed = Matrix3::new(1.1, 0.2, 0.0, -0.1, 0.9, 0.05, 0.02, 0.0, 1.05);
        let gradient = Matrix3::new(0.05, -0.08, 0.01, 0.11, -0.04, 0.02, 0.0, 0.03, 0.02);
        let average = Matrix3::new(0.03, 0.02, 0.01, 0.02, -0.05, 0.0, 0.01, 0.0, 0.02);
        for formulation in [Formulation::SmallStrain, Formulation::Corotational] {
            let target = |gradient: &Matrix3<f64>, average: &Matrix3<f64>| {
                formulation.target_of_strain(&committed, gradient, average).unwrap()
            };
            let stress = |gradient: &Matrix3<f64>, average: &Matrix3<f64>| {
                formulation.cauchy(&committed, gradient, &law(&target(gradient, average))).unwrap()
            };
            let sent = target(&gradient, &average);
            let moduli =
                formulation.averaged_moduli(&committed, &gradient, &average, &law(&sent), &tangent(&sent)).unwrap();
            for pair in 0..9 {
                let step = 1e-6 * unit(pair);
                let moved = match formulation {
                    Formulation::SmallStrain => step,
                    _ => step * (Matrix3::identity() + gradient),
                };
                let check = |what: &str, difference: Matrix3<f64>, part: &Operator| {
                    let error = (difference / 2e-6 - from_column(&part.column(pair).into_owned())).amax();
                    assert!(error < 1e-7, "{formulation:?} {what} {pair}: {error:e}");
                };
                let own = stress(&(gradient + moved), &average) - stress(&(gradient - moved), &average);
                check("own", own, &moduli.own);
                let even = 0.5 * (step + step.transpose());
                let seen = stress(&gradient, &(average + even)) - stress(&gradient, &(average - even));
                let even_part = 0.5 * (moduli.seen.column(pair) + moduli.seen.column(3 * (pair % 3) + pair / 3));
                let error = (seen / 2e-6 - from_column(&even_part)).amax();
                assert!(error < 1e-7, "{formulation:?} seen {pair}: {error:e}");
                let strain = |gradient: &Matrix3<f64>| formulation.strain(&committed, gradient).unwrap();
                check("strain", strain(&(gradient + moved)) - strain(&(gradient - moved)), &moduli.strain);
            }
        }
    }
}
