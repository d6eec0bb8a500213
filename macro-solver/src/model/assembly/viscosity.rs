//! Viscous stresses in the elements: stiffness-proportional damping and bulk viscosity.

use super::isotropic::Isotropic;
use crate::formulation::Operator;
use crate::formulation::tensor::isotropic_moduli;
use crate::problem::dynamics::{BulkViscosity, RayleighDamping};
use nalgebra::Matrix3;

/// Viscous law of the body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Viscosity {
    /// Stiffness-proportional damping, s.
    pub(crate) stiffness: f64,
    /// Bulk viscosity.
    pub(crate) bulk: BulkViscosity,
    /// Mass density, kg/m3.
    pub(crate) density: f64,
}

impl Viscosity {
    /// Nothing viscous.
    pub(crate) const NONE: Self =
        Self { stiffness: 0.0, bulk: BulkViscosity { linear: 0.0, quadratic: 0.0 }, density: 0.0 };

    /// From the settings of a run.
    pub(crate) fn new(damping: RayleighDamping, bulk: BulkViscosity, density: f64) -> Self {
        Self { stiffness: damping.stiffness, bulk, density }
    }

    /// Whether there is none.
    pub(crate) fn is_none(&self) -> bool {
        self.stiffness == 0.0 && self.bulk == BulkViscosity::default()
    }

    /// Stress, Pa, of the rate of deformation `rate` (1/s) in an element of size `length` (m).
    pub(crate) fn stress(&self, moduli: Isotropic, length: f64, rate: &Matrix3<f64>) -> Matrix3<f64> {
        let trace = rate.trace();
        let compression = (-trace).max(0.0);
        let bulk = self.linear(moduli, length) + self.density * (self.bulk.quadratic * length).powi(2) * compression;
        let pressure = (self.stiffness * moduli.lambda + bulk) * trace;
        Matrix3::identity() * pressure + rate * (2.0 * self.stiffness * moduli.shear)
    }

    /// The linear part as moduli, Pa s.
    pub(crate) fn moduli(&self, moduli: Isotropic, length: f64) -> Operator {
        let bulk = self.linear(moduli, length);
        isotropic_moduli(self.stiffness * moduli.lambda + bulk, self.stiffness * moduli.shear)
    }

    /// Linear bulk viscosity, Pa s.
    fn linear(&self, moduli: Isotropic, length: f64) -> f64 {
        self.bulk.linear * length * (self.density * moduli.longitudinal().max(0.0)).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formulation::tensor::{column, from_column};

    #[test]
    fn linear_stresses_are_those_of_the_moduli_and_the_quadratic_one_acts_in_compression_only() {
        let moduli = Isotropic { lambda: 3.0, shear: 2.0 };
        let rate = Matrix3::new(-0.3, 0.1, 0.0, 0.1, 0.2, 0.0, 0.0, 0.0, 0.0);
        let linear = Viscosity { stiffness: 0.7, bulk: BulkViscosity { linear: 0.06, quadratic: 0.0 }, density: 5.0 };
        let expected = from_column(&(linear.moduli(moduli, 0.4) * column(&rate)));
        assert!((linear.stress(moduli, 0.4, &rate) - expected).amax() < 1e-15);
        let shock = Viscosity { bulk: BulkViscosity { linear: 0.06, quadratic: 1.2 }, ..linear };
        let more = shock.stress(moduli, 0.4, &rate) - expected;
        assert!((more + Matrix3::identity() * (5.0 * (1.2f64 * 0.4).powi(2) * 0.1 * 0.1)).amax() < 1e-15);
        assert_eq!(shock.stress(moduli, 0.4, &-rate), linear.stress(moduli, 0.4, &-rate));
    }
}
