//! Pressure of the fluid in the pores of a point, and what it adds to stress and moduli.

use super::Point;
use crate::formulation::conversion::spatial_moduli;
use crate::formulation::tensor::column;
use crate::formulation::{Formulation, Operator, Response};
use nalgebra::Matrix3;

/// The fluid of one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fluid {
    /// Bulk modulus over porosity, Pa.
    pub(super) bulk_modulus: f64,
    /// Logarithm of the volume at which its excess pressure is zero, over the initial volume.
    pub(super) reference: f64,
}

impl Point {
    /// From now on the fluid cannot drain; one that could not before keeps its pressure.
    pub(super) fn close_pores(&mut self, formulation: Formulation, bulk_modulus: f64) {
        if self.fluid.is_none() {
            let reference = formulation.log_volume(&self.deformation);
            self.fluid = Some(Fluid { bulk_modulus, reference });
        }
    }

    /// Excess pressure of the pore fluid at the latest evaluation, Pa, compression positive; `None` where it drains.
    pub(crate) fn pore_pressure(&self, formulation: Formulation) -> Option<f64> {
        let Fluid { bulk_modulus, reference } = self.fluid?;
        // Subtracted, not negated: a point at rest has 0, not -0.
        Some(0.0 - bulk_modulus * (formulation.log_volume(&self.trial_deformation) - reference))
    }

    /// Energy that the pore fluid holds at the latest evaluation, J per m3 of the present volume, with small strains of the initial one: the
    /// work that has brought it to its excess pressure; 0 where it drains.
    pub(crate) fn fluid_energy(&self, formulation: Formulation) -> f64 {
        let (Some(fluid), Some(pressure)) = (self.fluid, self.pore_pressure(formulation)) else { return 0.0 };
        let strain = pressure / fluid.bulk_modulus;
        match formulation {
            Formulation::SmallStrain => 0.5 * fluid.bulk_modulus * strain.powi(2),
            // The integral of K ln(V / V0) over the volume, V (p / K - 1) + V0 times K.
            Formulation::TotalLagrangian | Formulation::UpdatedLagrangian | Formulation::Corotational => {
                fluid.bulk_modulus * (strain.exp_m1() - strain)
            }
        }
    }

    /// A Cauchy stress of the grains with the pressure of the fluid added, Pa.
    pub(crate) fn with_pore_pressure(&self, formulation: Formulation, stress: &Matrix3<f64>) -> Matrix3<f64> {
        match self.pore_pressure(formulation) {
            Some(pressure) => stress - Matrix3::from_diagonal_element(pressure),
            None => *stress,
        }
    }

    /// What the fluid adds to the stress for a small change of the displacement gradient, Pa.
    pub(super) fn fluid_stress_change(&self, gradient: &Matrix3<f64>) -> Matrix3<f64> {
        let bulk_modulus = self.fluid.map_or(0.0, |fluid| fluid.bulk_modulus);
        Matrix3::from_diagonal_element(bulk_modulus * gradient.trace())
    }

    /// Total stress and moduli of the latest evaluation: those of grains and fluid together.
    pub(crate) fn total(&self, formulation: Formulation) -> Response {
        self.with_fluid(formulation, self.response.clone())
    }

    /// The same for another response of the grains.
    pub(super) fn with_fluid(&self, formulation: Formulation, grains: Response) -> Response {
        let (Some(fluid), Some(pressure)) = (self.fluid, self.pore_pressure(formulation)) else {
            return grains;
        };
        let pressure = Matrix3::from_diagonal_element(-pressure);
        let unit = column(&Matrix3::identity());
        let moduli: Operator = unit * unit.transpose() * fluid.bulk_modulus;
        let moduli = match formulation {
            Formulation::SmallStrain => moduli,
            Formulation::TotalLagrangian | Formulation::UpdatedLagrangian | Formulation::Corotational => {
                spatial_moduli(&moduli, &pressure)
            }
        };
        Response { stress: grains.stress + pressure, moduli: grains.moduli + moduli }
    }
}
