//! Strain measures of a deformation gradient.

use super::tensor::{matrix, tensor};
use nalgebra::Matrix3;
use protocol::Tensor2;

/// `E = (F^T F - I) / 2`.
pub(crate) fn green_lagrange(deformation: &Tensor2) -> Tensor2 {
    let deformation = matrix(deformation);
    tensor(&(0.5 * (deformation.transpose() * deformation - Matrix3::identity())))
}

/// Difference of the principal values of the Green-Lagrange strain in the plane: what shows a shear band.
pub(crate) fn plane_shear_strain(deformation: &Tensor2) -> f64 {
    let [[xx, xy], [_, yy]] = green_lagrange(deformation).plane();
    (xx - yy).hypot(2.0 * xy)
}

/// Largest minus smallest principal value of the Green-Lagrange strain.
pub(crate) fn spatial_shear_strain(deformation: &Tensor2) -> f64 {
    let principal = matrix(&green_lagrange(deformation)).symmetric_eigenvalues();
    principal.max() - principal.min()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strain_of_a_rotation_is_zero_and_of_simple_shear_its_shear() {
        let (sin, cos) = 0.4_f64.sin_cos();
        let turned = Tensor2([cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0]);
        assert!(plane_shear_strain(&turned) < 1e-15 && spatial_shear_strain(&turned) < 1e-15);
        // In the plane and out of it.
        for (place, in_plane) in [(1, 1e-4), (2, 0.0), (5, 0.0)] {
            let mut sheared = Tensor2::IDENTITY;
            sheared.0[place] = 1e-4;
            assert!((spatial_shear_strain(&sheared) - 1e-4).abs() < 1e-8, "{place}");
            assert!((plane_shear_strain(&sheared) - in_plane).abs() < 1e-8, "{place}");
        }
    }
}
