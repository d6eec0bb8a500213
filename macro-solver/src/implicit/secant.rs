//! Rank-one secant correction of one point's moduli from its last two evaluations (Broyden's update in four
//! dimensions).
//!
//! It changes the path to the solution, never the solution. Two gates keep branch noise out: targets closer than
//! [`SecantGates::min_change`], and stress jumps beyond [`SecantGates::max_ratio`]. A floor under the smallest eigenvalue keeps
//! a softening point from making the global matrix indefinite: without it corrections wander.

use super::moduli::column;
use crate::problem::SecantGates;
use nalgebra::{Matrix2, Matrix3, Matrix4, SymmetricEigen};

/// One evaluation within a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sample {
    /// Displacement gradient from the committed state.
    pub(super) gradient: Matrix2<f64>,
    /// First Piola stress relative to the committed configuration, Pa.
    pub(super) first_piola: Matrix2<f64>,
}

impl Sample {
    /// From the answer to a target: `P = det F sigma F^-T`.
    pub(super) fn new(gradient: Matrix2<f64>, stress: &Matrix2<f64>) -> Option<Self> {
        let deformation = Matrix2::identity() + gradient;
        let inverse = deformation.try_inverse()?;
        Some(Self { gradient, first_piola: deformation.determinant() * stress * inverse.transpose() })
    }
}

/// Size of a point's first tangent, the yardstick of gates and floor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Yardstick {
    /// Frobenius norm, Pa.
    pub(super) norm: f64,
    /// `C_2222`, Pa.
    pub(super) vertical: f64,
}

/// The corrected moduli at `to`, or `None` if a gate or the floor refuses the correction.
pub(super) fn corrected(
    moduli: &Matrix4<f64>,
    from: &Sample,
    to: &Sample,
    yardstick: &Yardstick,
    gates: &SecantGates,
) -> Option<Matrix4<f64>> {
    let change = to.gradient - from.gradient;
    if change.amax() < gates.min_change {
        return None;
    }
    // Both changes carried to the configuration of `to`, where the moduli live.
    let deformation = Matrix2::identity() + to.gradient;
    let carried_change = change * deformation.try_inverse()?;
    let carried_stress = (to.first_piola - from.first_piola) * deformation.transpose() / deformation.determinant();
    let (gradient, stress) = (column(&carried_change), column(&carried_stress));
    let length = gradient.norm_squared();
    if stress.norm() > gates.max_ratio * yardstick.norm * length.sqrt() {
        return None;
    }
    let update = (stress - moduli * gradient) * gradient.transpose() / length;
    let floor = (gates.floor * yardstick.vertical).min(smallest_eigenvalue(moduli));
    [1.0, 0.5, 0.25]
        .into_iter()
        .map(|share| moduli + share * update)
        .find(|candidate| smallest_eigenvalue(candidate) >= floor)
}

/// The moduli with every direction of strain at least as stiff as `floor` times the yardstick, or `None` if they
/// already are.
pub(super) fn floored(moduli: &Matrix4<f64>, yardstick: &Yardstick, floor: f64) -> Option<Matrix4<f64>> {
    let least = floor * yardstick.vertical;
    let eigen = strain_stiffness(moduli);
    if eigen.eigenvalues.min() >= least {
        return None;
    }
    let mut stiffened = *moduli;
    for (value, direction) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value < least {
            let strain = strain_basis() * direction;
            stiffened += (least - value) * strain * strain.transpose();
        }
    }
    Some(stiffened)
}

/// Smallest eigenvalue of the symmetric part over symmetric strains, Pa.
fn smallest_eigenvalue(moduli: &Matrix4<f64>) -> f64 {
    strain_stiffness(moduli).eigenvalues.min()
}

/// Principal stiffnesses of the symmetric part over symmetric strains, Pa.
fn strain_stiffness(moduli: &Matrix4<f64>) -> SymmetricEigen<f64, nalgebra::Const<3>> {
    let strain: Matrix3<f64> = strain_basis().transpose() * moduli * strain_basis();
    SymmetricEigen::new(0.5 * (strain + strain.transpose()))
}

/// Orthonormal basis of symmetric strains: xx, yy, (xy + yx) / sqrt(2).
fn strain_basis() -> nalgebra::Matrix4x3<f64> {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    nalgebra::Matrix4x3::new(1.0, 0.0, 0.0, 0.0, 0.0, half, 0.0, 0.0, half, 0.0, 1.0, 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stiff() -> Matrix4<f64> {
        Matrix4::new(3.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 0.0, 0.0, 3.0)
    }

    fn samples(slope: &Matrix4<f64>, size: f64) -> (Sample, Sample) {
        let change = Matrix2::new(1.0, 0.2, -0.1, -0.7) * size;
        let stress = slope * column(&change);
        let stress = Matrix2::new(stress[0], stress[1], stress[2], stress[3]);
        let from = Sample { gradient: -change, first_piola: -stress };
        (from, Sample { gradient: Matrix2::zeros(), first_piola: Matrix2::zeros() })
    }

    const YARDSTICK: Yardstick = Yardstick { norm: 5.0, vertical: 3.0 };

    #[test]
    fn corrected_moduli_reproduce_the_last_pair() {
        let (from, to) = samples(&(0.4 * stiff()), 1e-3);
        let corrected = corrected(&stiff(), &from, &to, &YARDSTICK, &SecantGates::default()).unwrap();
        let change = column(&(to.gradient - from.gradient));
        let stress = column(&(to.first_piola - from.first_piola));
        assert!((corrected * change - stress).norm() < 1e-15);
    }

    #[test]
    fn a_soft_direction_is_stiffened_and_the_others_are_kept() {
        let mut soft = stiff();
        soft[(0, 0)] = -1.0;
        let stiffened = floored(&soft, &YARDSTICK, 0.02).unwrap();
        let (before, after) = (strain_stiffness(&soft), strain_stiffness(&stiffened));
        let sorted = |mut values: Vec<f64>| {
            values.sort_by(f64::total_cmp);
            values
        };
        let before = sorted(before.eigenvalues.iter().copied().collect());
        let after = sorted(after.eigenvalues.iter().copied().collect());
        assert!(before[0] < 0.0 && (after[0] - 0.06).abs() < 1e-12);
        assert!((after[1] - before[1]).abs() + (after[2] - before[2]).abs() < 1e-12);
        assert_eq!(floored(&stiff(), &YARDSTICK, 0.02), None);
    }

    #[test]
    fn gates_refuse_close_pairs_and_jumps_and_the_floor_refuses_softening() {
        let gates = SecantGates::default();
        let (from, to) = samples(&stiff(), 1e-5);
        assert_eq!(corrected(&stiff(), &from, &to, &YARDSTICK, &gates), None);
        let (from, to) = samples(&(10.0 * stiff()), 1e-3);
        assert_eq!(corrected(&stiff(), &from, &to, &YARDSTICK, &gates), None);
        let (from, to) = samples(&(-2.0 * stiff()), 1e-3);
        let kept = corrected(&stiff(), &from, &to, &YARDSTICK, &gates);
        assert!(kept.is_none_or(|moduli| smallest_eigenvalue(&moduli) >= gates.floor * YARDSTICK.vertical));
    }
}
