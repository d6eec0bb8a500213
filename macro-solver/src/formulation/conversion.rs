//! Conversions of stresses and moduli between configurations: Cauchy stress, nominal stress on the current configuration,
//! first Piola stress on another one. They are exact.

use super::tensor::Operator;
use nalgebra::Matrix3;

/// `A_ijkl = C_ijkl + sigma_ij delta_kl - sigma_il delta_jk`: change of the nominal stress on the current
/// configuration with the displacement gradient on it, from `C = d sigma / d F` relative to the current state.
///
/// The first added term is the change of volume, the second the change of the area that carries the traction.
pub fn spatial_moduli(tangent: &Operator, stress: &Matrix3<f64>) -> Operator {
    tangent + area_and_volume(stress)
}

fn area_and_volume(stress: &Matrix3<f64>) -> Operator {
    Operator::from_fn(|row, column| {
        let (i, j, k, l) = (row / 3, row % 3, column / 3, column % 3);
        let volume = if k == l { stress[(i, j)] } else { 0.0 };
        let area = if j == k { stress[(i, l)] } else { 0.0 };
        volume - area
    })
}

/// `P = det F sigma F^-T` from `det F` and `F^-1`.
pub fn first_piola(determinant: f64, inverse: &Matrix3<f64>, stress: &Matrix3<f64>) -> Matrix3<f64> {
    determinant * stress * inverse.transpose()
}

/// `dP_iJ / dF_kL = det F F^-1_Jj F^-1_Ll A_ijkl` from `det F`, `F^-1` and the spatial moduli `A`.
pub fn piola_moduli(determinant: f64, inverse: &Matrix3<f64>, moduli: &Operator) -> Operator {
    transported(moduli, inverse) * determinant
}

/// `M_iJkL = T_Jj T_Ll A_ijkl`, one pair of indices at a time.
fn transported(moduli: &Operator, transport: &Matrix3<f64>) -> Operator {
    let mut half = Operator::zeros();
    for row in 0..9 {
        for column in 0..9 {
            let (k, l) = (column / 3, column % 3);
            half[(row, column)] = (0..3).map(|m| transport[(l, m)] * moduli[(row, 3 * k + m)]).sum();
        }
    }
    let mut whole = Operator::zeros();
    for row in 0..9 {
        let (i, j) = (row / 3, row % 3);
        for column in 0..9 {
            whole[(row, column)] = (0..3).map(|m| transport[(j, m)] * half[(3 * i + m, column)]).sum();
        }
    }
    whole
}

/// The inverse conversions, for tests.
#[cfg(test)]
pub(super) mod inverse {
    use super::{area_and_volume, transported};
    use crate::formulation::Operator;
    use nalgebra::Matrix3;

    /// The inverse of [`super::spatial_moduli`].
    pub(in crate::formulation) fn cauchy_moduli(moduli: &Operator, stress: &Matrix3<f64>) -> Operator {
        moduli - area_and_volume(stress)
    }

    /// `sigma = P F^T / det F`.
    pub(in crate::formulation) fn cauchy_stress(
        deformation: &Matrix3<f64>,
        first_piola: &Matrix3<f64>,
    ) -> Matrix3<f64> {
        first_piola * deformation.transpose() / deformation.determinant()
    }

    /// `A_ijkl = F_jJ F_lL (dP_iJ / dF_kL) / det F`: the inverse of [`super::piola_moduli`].
    pub(in crate::formulation) fn spatial_from_piola(deformation: &Matrix3<f64>, moduli: &Operator) -> Operator {
        transported(moduli, deformation) / deformation.determinant()
    }
}
