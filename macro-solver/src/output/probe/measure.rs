//! What is measured at one Gauss point.

use super::reference::{Origin, reference_volume};
use super::stress_measure::{Axes, StressMeasure};
use crate::formulation::strain::{green_lagrange, plane_shear_strain, spatial_shear_strain};
use crate::formulation::tensor::matrix;
use crate::observer::PointFields;
use nalgebra::Vector3;
use protocol::{Observables, Tensor2};

/// A quantity of a Gauss point. Tension positive throughout, except the quantities that say compression.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Measure {
    /// A function of the Cauchy stress.
    Stress(StressMeasure),
    /// Excess pressure of the pore fluid, compression positive; 0 where it drains.
    PorePressure,
    /// Void volume over grain volume.
    VoidRatio,
    /// Void volume over total volume.
    Porosity,
    /// 2 x contacts over grains.
    Coordination,
    /// The same without rattlers and their contacts.
    CoordinationNoRattlers,
    /// Major over minor principal value of the contact fabric, minus 1.
    FabricAnisotropy,
    /// Component of the contact fabric `1/C sum n x n`.
    Fabric(usize, usize),
    /// Share of the contacts at the Coulomb limit.
    SlidingFraction,
    /// Mean rotation of the grains about an axis since the start of the run, rad.
    GrainRotation(usize),
    /// Component of the displacement gradient `F - I`.
    DisplacementGradient(usize, usize),
    /// Component of the Green-Lagrange strain `(F^T F - I) / 2`.
    Strain(usize, usize),
    /// Largest minus smallest principal value of the Green-Lagrange strain, of the plane or in space.
    ShearStrain(Axes),
    /// The same of the increment since the last accepted step.
    ShearStrainIncrement(Axes),
    /// `sqrt(2/3 e:e)` of the deviator `e` of the logarithmic strain in space.
    DeviatoricStrain,
    /// The same of the increment since the last accepted step.
    DeviatoricStrainIncrement,
    /// Incremental equivalent strain of [Liu2018] Fig. 7: Frobenius norm of the change of `F - I` since the last accepted step. A
    /// rotation in the step adds to it.
    EquivalentStrainIncrement,
    /// Current over reference volume, minus 1; dilation positive.
    VolumeChange,
    /// Logarithm of current over reference volume; dilation positive.
    LogVolumeStrain,
    /// Stored contact energy per volume, J/m3.
    ElasticEnergy,
    /// Work lost to friction per volume since the start of the run, J/m3.
    FrictionalDissipation,
    /// Work that numerical damping of the grains has taken per volume since the start of the run, J/m3.
    DampingWork,
}

impl Measure {
    /// Unit at one Gauss point; `-` if it has none.
    pub(super) fn unit(&self) -> &'static str {
        match self {
            Self::Stress(stress) => stress.unit(),
            Self::PorePressure => "Pa",
            Self::GrainRotation(_) => "rad",
            Self::ElasticEnergy | Self::FrictionalDissipation | Self::DampingWork => "J/m3",
            Self::VoidRatio
            | Self::Porosity
            | Self::Coordination
            | Self::CoordinationNoRattlers
            | Self::FabricAnisotropy
            | Self::Fabric(..)
            | Self::SlidingFraction
            | Self::DisplacementGradient(..)
            | Self::Strain(..)
            | Self::ShearStrain(_)
            | Self::ShearStrainIncrement(_)
            | Self::DeviatoricStrain
            | Self::DeviatoricStrainIncrement
            | Self::EquivalentStrainIncrement
            | Self::VolumeChange
            | Self::LogVolumeStrain => "-",
        }
    }

    /// Value at a Gauss point, the number `number` of the run.
    pub(in crate::output) fn at(&self, number: usize, point: &PointFields, origin: Origin<'_>) -> f64 {
        let since = || origin.since(number, &point.deformation);
        let increment =
            || Tensor2(std::array::from_fn(|place| point.step_gradient.0[place] + Tensor2::IDENTITY.0[place]));
        let observed = &point.observed;
        match *self {
            Self::Stress(stress) => stress.of(&point.stress),
            Self::PorePressure => point.pore_pressure.unwrap_or(0.0),
            Self::VoidRatio => point.scalars.void_ratio,
            Self::Porosity => point.scalars.void_ratio / (1.0 + point.scalars.void_ratio),
            Self::Coordination => point.scalars.coordination_number,
            Self::CoordinationNoRattlers => observed.coordination_number_no_rattlers,
            Self::FabricAnisotropy => observed.fabric_anisotropy,
            Self::Fabric(row, column) => observed.fabric.get(row, column),
            Self::SlidingFraction => observed.sliding_fraction,
            Self::GrainRotation(axis) => observed.mean_rotation[axis],
            Self::DisplacementGradient(row, column) => since().get(row, column) - Tensor2::IDENTITY.get(row, column),
            Self::Strain(row, column) => green_lagrange(&since()).get(row, column),
            Self::ShearStrain(axes) => shear_strain(axes, &since()),
            Self::ShearStrainIncrement(axes) => shear_strain(axes, &increment()),
            Self::DeviatoricStrain => deviatoric_strain(&since()),
            Self::DeviatoricStrainIncrement => deviatoric_strain(&increment()),
            Self::EquivalentStrainIncrement => (matrix(&since()) - matrix(&origin.before(number))).norm(),
            Self::VolumeChange => point.volume / reference_volume(origin, number, point) - 1.0,
            Self::LogVolumeStrain => (point.volume / reference_volume(origin, number, point)).ln(),
            Self::ElasticEnergy => observed.elastic_energy,
            Self::FrictionalDissipation => observed.frictional_dissipation,
            Self::DampingWork => observed.damping_work,
        }
    }

    /// Optional results of the points that the measure needs.
    pub fn needs(&self) -> Observables {
        match self {
            Self::CoordinationNoRattlers => Observables::COORDINATION_NO_RATTLERS,
            Self::FabricAnisotropy | Self::Fabric(..) => Observables::FABRIC,
            Self::SlidingFraction => Observables::SLIDING_FRACTION,
            Self::GrainRotation(_) => Observables::ROTATION,
            Self::ElasticEnergy | Self::FrictionalDissipation | Self::DampingWork => Observables::ENERGY,
            Self::Stress(_)
            | Self::PorePressure
            | Self::VoidRatio
            | Self::Porosity
            | Self::Coordination
            | Self::DisplacementGradient(..)
            | Self::Strain(..)
            | Self::ShearStrain(_)
            | Self::ShearStrainIncrement(_)
            | Self::DeviatoricStrain
            | Self::DeviatoricStrainIncrement
            | Self::EquivalentStrainIncrement
            | Self::VolumeChange
            | Self::LogVolumeStrain => Observables::NONE,
        }
    }

    /// Whether the value is an energy per volume, whose sum over a part of the body takes the place of its mean.
    pub fn is_energy_density(&self) -> bool {
        matches!(self, Self::ElasticEnergy | Self::FrictionalDissipation | Self::DampingWork)
    }

    /// Whether the value depends on the state from which deformation is counted.
    pub fn has_reference(&self) -> bool {
        matches!(
            self,
            Self::DisplacementGradient(..)
                | Self::Strain(..)
                | Self::ShearStrain(_)
                | Self::DeviatoricStrain
                | Self::EquivalentStrainIncrement
                | Self::VolumeChange
                | Self::LogVolumeStrain
        )
    }

    /// Whether the value is a difference to the state at the end of the step before.
    pub(in crate::output) fn compares_steps(&self) -> bool {
        matches!(self, Self::EquivalentStrainIncrement)
    }
}

fn shear_strain(axes: Axes, deformation: &Tensor2) -> f64 {
    match axes {
        Axes::Plane => plane_shear_strain(deformation),
        Axes::Space => spatial_shear_strain(deformation),
    }
}

/// `sqrt(2/3 e:e)` with the deviator of the logarithmic strain `ln(F^T F) / 2`; in the plane the strain along z is 0.
fn deviatoric_strain(deformation: &Tensor2) -> f64 {
    let deformation = matrix(deformation);
    let strains = (deformation.transpose() * deformation).symmetric_eigenvalues().map(|square| 0.5 * square.ln());
    let deviator = strains - Vector3::repeat(strains.mean());
    (2.0 / 3.0 * deviator.norm_squared()).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviatoric_strain_of_pure_shear_is_known() {
        // Stretches e^0.1 and e^-0.1: e = (0.1, -0.1, 0), sqrt(2/3 x 0.02).
        let stretched = Tensor2([0.1_f64.exp(), 0.0, 0.0, 0.0, (-0.1_f64).exp(), 0.0, 0.0, 0.0, 1.0]);
        assert!((deviatoric_strain(&stretched) - (0.04_f64 / 3.0).sqrt()).abs() < 1e-14);
        assert!(deviatoric_strain(&Tensor2([1.1, 0.0, 0.0, 0.0, 1.1, 0.0, 0.0, 0.0, 1.1])) < 1e-15);
    }
}
