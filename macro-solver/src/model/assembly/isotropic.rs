//! The isotropic part of a stiffness: sound speeds, hourglass springs and viscous dampers are made of it.

use crate::formulation::Operator;
use crate::mesh::Dimension;
use serde::{Deserialize, Serialize};

/// Lamé moduli of the isotropic tensor nearest to a tangent, Pa.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Isotropic {
    /// `lambda`, of the plane or of space.
    pub(crate) lambda: f64,
    /// `G`.
    pub(crate) shear: f64,
}

impl Isotropic {
    /// The projection that keeps `C_iijj` and the mean of `C_ijij` and `C_ijji` over the body's dimensions.
    pub(crate) fn of(dimension: Dimension, moduli: &Operator) -> Self {
        let axes = dimension.count();
        let count = axes as f64;
        let (mut volumetric, mut total) = (0.0, 0.0);
        for i in 0..axes {
            for j in 0..axes {
                volumetric += moduli[(4 * i, 4 * j)];
                total += 0.5 * (moduli[(3 * i + j, 3 * i + j)] + moduli[(3 * i + j, 3 * j + i)]);
            }
        }
        // With C = lambda dd + G (..): volumetric = d^2 lambda + 2 d G, total = d lambda + (d^2 + d) G.
        let shear = (total - volumetric / count) / (count * count + count - 2.0);
        Self { lambda: (volumetric - 2.0 * count * shear) / (count * count), shear }
    }

    /// Modulus of P-waves, `lambda + 2 G`, Pa.
    pub(crate) fn longitudinal(&self) -> f64 {
        self.lambda + 2.0 * self.shear
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formulation::tensor::isotropic_moduli;

    #[test]
    fn isotropic_moduli_are_their_own_projection() {
        for dimension in [Dimension::Plane, Dimension::Space] {
            let part = Isotropic::of(dimension, &isotropic_moduli(3.0, 2.0));
            assert!((part.lambda - 3.0).abs() + (part.shear - 2.0).abs() < 1e-14, "{dimension:?}: {part:?}");
        }
    }
}
