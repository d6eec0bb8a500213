//! Between the kinematics of a point and its material: what strain is sent, and what the answer means for the body.
//!
//! A material answers a target `H`, relative to its committed state, with a Cauchy stress and, if asked, `C = d sigma /
//! d F` relative to the end of the trial. A [`Formulation`] says which `H` a motion means and turns the answer into
//! the stress and the moduli that the elements integrate. Motion is given by two tensors: the deformation gradient
//! `F_n` of the committed configuration, and the displacement gradient `G` of the step, taken on the configuration of
//! [`Formulation::reference`]. Nothing here depends on a time integrator: implicit and explicit solvers share it.

mod averages;
pub mod conversion;
pub mod corotation;
mod small_strain;
pub(crate) mod strain;
pub mod tensor;

pub use averages::AveragedModuli;
use conversion::{first_piola, piola_moduli, spatial_moduli};
use corotation::{Corotation, Polar};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use protocol::Observed;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use small_strain::small_strain_moduli;
pub use tensor::Operator;

/// How motion becomes strain, and which stress is integrated where.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Formulation {
    /// Strain is the symmetric part of the displacement gradient on the initial geometry, on which the Cauchy stress
    /// is integrated. Rotations are not seen.
    SmallStrain,
    /// `F` and the first Piola stress on the initial geometry, as in [Liu2018] section 2.1.
    TotalLagrangian,
    /// The step's displacement gradient on the committed geometry and the Cauchy stress on the current one, as in
    /// [Argilaga2018] section 2. The same equations as the total Lagrangian form.
    #[default]
    UpdatedLagrangian,
    /// The rate form of [Liu2015] section 2.3.3: the symmetric gradient of the step on the midpoint geometry, turned
    /// into the corotated frame by the polar decomposition of `F`; the Cauchy stress is turned out of the frame and
    /// integrated on the current geometry. Second-order accurate in the step; the material never sees a rotation.
    Corotational,
}

/// A geometry of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Configuration {
    /// As meshed.
    Initial,
    /// After the last committed step.
    Committed,
    /// At the iterate.
    Current,
}

/// What an answer means for the body.
#[derive(Clone, Debug, PartialEq)]
pub struct Response {
    /// Cauchy stress in the fixed axes, Pa, tension positive.
    pub stress: Matrix3<f64>,
    /// Change of the nominal stress with the displacement gradient, both on the current configuration (on the
    /// initial one for small strain), Pa.
    pub moduli: Operator,
}

protocol::keywords! {
    pub Formulation {
        SmallStrain => "small_strain",
        TotalLagrangian => "total_lagrangian",
        UpdatedLagrangian => "updated_lagrangian",
        Corotational => "corotational",
    }
}

impl Formulation {
    /// The configuration on which the step's displacement gradient is taken.
    pub fn reference(self) -> Configuration {
        match self {
            Self::SmallStrain => Configuration::Initial,
            Self::TotalLagrangian | Self::UpdatedLagrangian | Self::Corotational => Configuration::Committed,
        }
    }

    /// Displacement gradient of an increment after others: each refers to the configuration before it, unless all refer to the initial one.
    pub(crate) fn joined(self, before: &Matrix3<f64>, gradient: &Matrix3<f64>) -> Matrix3<f64> {
        match self.reference() {
            Configuration::Initial => before + gradient,
            Configuration::Committed | Configuration::Current => before + gradient + gradient * before,
        }
    }

    /// The configuration on which stresses are integrated.
    pub fn integration(self) -> Configuration {
        match self {
            Self::SmallStrain | Self::TotalLagrangian => Configuration::Initial,
            Self::UpdatedLagrangian | Self::Corotational => Configuration::Current,
        }
    }

    /// The target `H` to send for the step gradient `gradient` from the committed deformation gradient `committed`;
    /// `None` if the motion turns the point inside out.
    pub fn target(self, committed: &Matrix3<f64>, gradient: &Matrix3<f64>) -> Option<Matrix3<f64>> {
        match self {
            Self::SmallStrain => Some(0.5 * (gradient + gradient.transpose())),
            Self::TotalLagrangian | Self::UpdatedLagrangian => Some(*gradient),
            Self::Corotational => Corotation::target(&Corotation::of_step(committed, gradient)?.strain),
        }
    }

    /// Strain increment of a step in the fixed axes, as a neighbourhood averages it; `None` for formulations whose material
    /// sees rotations, and if the motion turns the point inside out.
    pub fn strain(self, committed: &Matrix3<f64>, gradient: &Matrix3<f64>) -> Option<Matrix3<f64>> {
        match self {
            Self::SmallStrain => Some(0.5 * (gradient + gradient.transpose())),
            Self::TotalLagrangian | Self::UpdatedLagrangian => None,
            Self::Corotational => Some(Corotation::of_step(committed, gradient)?.spatial_strain),
        }
    }

    /// The target to send for the strain increment `strain` (in the fixed axes) of a point whose own step gradient is
    /// `gradient`; `None` as in [`Formulation::strain`].
    pub fn target_of_strain(
        self,
        committed: &Matrix3<f64>,
        gradient: &Matrix3<f64>,
        strain: &Matrix3<f64>,
    ) -> Option<Matrix3<f64>> {
        match self {
            Self::SmallStrain => Some(*strain),
            Self::TotalLagrangian | Self::UpdatedLagrangian => None,
            Self::Corotational => Corotation::target(&Corotation::of_step(committed, gradient)?.into_frame(strain)),
        }
    }

    /// Whether a material sees strain increments without rotations, which can be averaged over neighbours.
    pub fn has_strain_increments(self) -> bool {
        matches!(self, Self::SmallStrain | Self::Corotational)
    }

    /// Deformation gradient after a step.
    pub fn deformation(self, committed: &Matrix3<f64>, gradient: &Matrix3<f64>) -> Matrix3<f64> {
        match self {
            Self::SmallStrain => committed + gradient,
            Self::TotalLagrangian | Self::UpdatedLagrangian | Self::Corotational => {
                (Matrix3::identity() + gradient) * committed
            }
        }
    }

    /// Logarithm of the volume over the initial one, for a total deformation gradient; its trace for small strain.
    pub fn log_volume(self, deformation: &Matrix3<f64>) -> f64 {
        match self {
            Self::SmallStrain => deformation.trace() - 3.0,
            Self::TotalLagrangian | Self::UpdatedLagrangian | Self::Corotational => deformation.determinant().ln(),
        }
    }

    /// Directions of the grains in the fixed axes, from those in the frame in which the material is driven. With small strain and corotated
    /// frames the material is not turned with the body: the rotation of the body, in a corotated frame up to half a turn, is added to that
    /// of the grains there, and the fabric of a corotated frame is turned by it. `deformation` is the deformation gradient of the state.
    pub fn observed_in_space(self, observed: &Observed, deformation: &Matrix3<f64>) -> Observed {
        let own = Vector3::from(observed.mean_rotation);
        match self {
            Self::TotalLagrangian | Self::UpdatedLagrangian => *observed,
            Self::SmallStrain => {
                let skew = 0.5 * (deformation - deformation.transpose());
                let turn = Vector3::new(skew[(2, 1)], skew[(0, 2)], skew[(1, 0)]);
                Observed { mean_rotation: (own + turn).into(), ..*observed }
            }
            Self::Corotational => {
                let Some(Polar { rotation, .. }) = Polar::of(deformation) else { return *observed };
                // By a quaternion, which has an axis for half a turn too.
                let turn =
                    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation)).scaled_axis();
                let fabric = tensor::tensor(&(rotation * tensor::matrix(&observed.fabric) * rotation.transpose()));
                Observed { mean_rotation: (rotation * own + turn).into(), fabric, ..*observed }
            }
        }
    }

    /// Stress and moduli of a point from the material's result for [`Formulation::target`]: `stress` (Pa) and `tangent` as the
    /// material returned them, `gradient` the displacement gradient of the step on the configuration of
    /// [`Formulation::reference`], `committed` the deformation gradient of the committed configuration. `None` if the motion
    /// turns the point inside out.
    pub fn response(
        self,
        committed: &Matrix3<f64>,
        gradient: &Matrix3<f64>,
        stress: &Matrix3<f64>,
        tangent: &Operator,
    ) -> Option<Response> {
        match self {
            Self::SmallStrain => Some(Response { stress: *stress, moduli: small_strain_moduli(gradient, tangent)? }),
            Self::TotalLagrangian | Self::UpdatedLagrangian => {
                Some(Response { stress: *stress, moduli: spatial_moduli(tangent, stress) })
            }
            Self::Corotational => {
                let corotation = Corotation::of_step(committed, gradient)?;
                let turned = corotation.out_of_frame(stress);
                let change = corotation.stress_change(stress, tangent)?;
                Some(Response { moduli: spatial_moduli(&change, &turned), stress: turned })
            }
        }
    }

    /// Stress and moduli as the element integrals need them: conjugate to gradients on [`Formulation::integration`].
    pub fn integrand(self, deformation: &Matrix3<f64>, response: &Response) -> Option<(Matrix3<f64>, Operator)> {
        match self {
            Self::TotalLagrangian => {
                let inverse = deformation.try_inverse()?;
                let stress = first_piola(deformation.determinant(), &inverse, &response.stress);
                Some((stress, piola_moduli(deformation.determinant(), &inverse, &response.moduli)))
            }
            Self::SmallStrain | Self::UpdatedLagrangian | Self::Corotational => {
                Some((response.stress, response.moduli))
            }
        }
    }

    /// As [`Formulation::integrand`], without moduli: for solvers that need forces alone.
    pub fn nominal_stress(self, deformation: &Matrix3<f64>, stress: &Matrix3<f64>) -> Option<Matrix3<f64>> {
        match self {
            Self::TotalLagrangian => {
                Some(first_piola(deformation.determinant(), &deformation.try_inverse()?, stress))
            }
            Self::SmallStrain | Self::UpdatedLagrangian | Self::Corotational => Some(*stress),
        }
    }

    /// Cauchy stress in the fixed axes from a material's answer, for solvers that ask for no tangent; `None` if the
    /// motion turns the point inside out.
    pub fn cauchy(
        self,
        committed: &Matrix3<f64>,
        gradient: &Matrix3<f64>,
        answer: &Matrix3<f64>,
    ) -> Option<Matrix3<f64>> {
        match self {
            Self::Corotational => Some(Corotation::of_step(committed, gradient)?.out_of_frame(answer)),
            Self::SmallStrain | Self::TotalLagrangian | Self::UpdatedLagrangian => Some(*answer),
        }
    }
}

#[cfg(test)]
mod tests;
