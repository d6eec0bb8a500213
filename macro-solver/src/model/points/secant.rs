//! Rank-one secant correction of one point's moduli from its last two evaluations (Broyden's update over the
//! components of the displacement gradient).
//!
//! It changes the path to the solution, never the solution. Two gates keep branch noise out: targets closer than
//! [`SecantSettings::min_change`], and stress jumps beyond [`SecantSettings::max_ratio`]. A floor under the smallest eigenvalue keeps
//! a softening point from making the global matrix indefinite: without it corrections wander.

use crate::formulation::tensor::{Operator, column};
use crate::formulation::{Configuration, Formulation};
use crate::mesh::Dimension;
use crate::problem::SecantSettings;
use nalgebra::{DMatrix, Dyn, Matrix3, SymmetricEigen};

/// One evaluation within a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sample {
    /// Displacement gradient of the step.
    pub(crate) gradient: Matrix3<f64>,
    /// Stress conjugate to it, Pa: first Piola relative to the committed configuration, Cauchy for small strain.
    pub(crate) nominal: Matrix3<f64>,
    /// From the configuration of the gradient to that of the moduli.
    pub(crate) carrier: Matrix3<f64>,
}

impl Sample {
    /// The state that a step starts from, with its Cauchy stress. For small strain the gradient refers to the initial
    /// state as well, where that of the step is zero too.
    pub(crate) fn committed(stress: &Matrix3<f64>) -> Self {
        Self { gradient: Matrix3::zeros(), nominal: *stress, carrier: Matrix3::identity() }
    }

    /// From the strain increment that a point has seen, an average over neighbours, and its Cauchy stress. What its own rotation does to
    /// the stress is counted as an answer to the strain.
    pub(crate) fn of_strain(strain: &Matrix3<f64>, stress: &Matrix3<f64>) -> Self {
        Self { gradient: *strain, nominal: *stress, carrier: Matrix3::identity() }
    }

    /// From the gradient of the step and the Cauchy stress at its end: `P = det F sigma F^-T`.
    pub(crate) fn new(formulation: Formulation, gradient: &Matrix3<f64>, stress: &Matrix3<f64>) -> Option<Self> {
        if formulation.reference() == Configuration::Initial {
            return Some(Self { gradient: *gradient, nominal: *stress, carrier: Matrix3::identity() });
        }
        let carrier = Matrix3::identity() + gradient;
        let inverse = carrier.try_inverse()?;
        Some(Self { gradient: *gradient, nominal: carrier.determinant() * stress * inverse.transpose(), carrier })
    }
}

/// Size of a point's first tangent, the reference of gates and floor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ReferenceModuli {
    /// Frobenius norm, Pa.
    pub(crate) norm: f64,
    /// `C_2222`, Pa.
    pub(crate) vertical: f64,
    /// Mean of `C_ijij` over the shears of the dimension, Pa.
    pub(crate) shear: f64,
}

impl ReferenceModuli {
    /// Of a first tangent.
    pub(crate) fn of(dimension: Dimension, tangent: &Operator) -> Self {
        let axes = dimension.count();
        let pairs: Vec<usize> =
            (0..axes).flat_map(|i| (0..axes).filter(move |j| *j != i).map(move |j| 3 * i + j)).collect();
        let shear = pairs.iter().map(|&pair| tangent[(pair, pair)]).sum::<f64>() / pairs.len() as f64;
        Self { norm: tangent.norm(), vertical: tangent[(4, 4)], shear }
    }
}

/// The corrected moduli at `to`, or `None` if a gate or the floor refuses the correction.
pub(crate) fn corrected(
    dimension: Dimension,
    moduli: &Operator,
    from: &Sample,
    to: &Sample,
    reference: &ReferenceModuli,
    settings: &SecantSettings,
) -> Option<Operator> {
    let change = to.gradient - from.gradient;
    if change.amax() < settings.min_change {
        return None;
    }
    // Both changes carried to the configuration of `to`, where the moduli live.
    let carried_change = change * to.carrier.try_inverse()?;
    let carried_stress = (to.nominal - from.nominal) * to.carrier.transpose() / to.carrier.determinant();
    let (gradient, stress) = (column(&carried_change), column(&carried_stress));
    let length = gradient.norm_squared();
    if stress.norm() > settings.max_ratio * reference.norm * length.sqrt() {
        return None;
    }
    let update = (stress - moduli * gradient) * gradient.transpose() / length;
    let floor = (settings.floor * reference.vertical).min(smallest_eigenvalue(dimension, moduli));
    [1.0, 0.5, 0.25]
        .into_iter()
        .map(|share| moduli + share * update)
        .find(|candidate| smallest_eigenvalue(dimension, candidate) >= floor)
}

/// The moduli with every direction of strain at least as stiff as `floor` times the reference, or `None` if they
/// already are.
pub(crate) fn floored(
    dimension: Dimension,
    moduli: &Operator,
    reference: &ReferenceModuli,
    floor: f64,
) -> Option<Operator> {
    let least = floor * reference.vertical;
    let eigen = strain_stiffness(dimension, moduli);
    if eigen.eigenvalues.min() >= least {
        return None;
    }
    let basis = strain_basis(dimension);
    let mut stiffened = *moduli;
    for (value, direction) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value < least {
            let strain = &basis * direction;
            for row in 0..9 {
                for column in 0..9 {
                    stiffened[(row, column)] += (least - value) * strain[row] * strain[column];
                }
            }
        }
    }
    Some(stiffened)
}

/// Smallest eigenvalue of the symmetric part over symmetric strains, Pa.
fn smallest_eigenvalue(dimension: Dimension, moduli: &Operator) -> f64 {
    strain_stiffness(dimension, moduli).eigenvalues.min()
}

/// Principal stiffnesses of the symmetric part over the symmetric strains of the dimension, Pa.
fn strain_stiffness(dimension: Dimension, moduli: &Operator) -> SymmetricEigen<f64, Dyn> {
    let basis = strain_basis(dimension);
    let strain: DMatrix<f64> = basis.transpose() * (moduli * &basis);
    SymmetricEigen::new(0.5 * (&strain + strain.transpose()))
}

/// Orthonormal basis of symmetric strains as columns over the pairs: the normal strains, then `(ij + ji) / sqrt(2)`.
fn strain_basis(dimension: Dimension) -> DMatrix<f64> {
    let axes = dimension.count();
    let shears = (0..axes).flat_map(|i| (i + 1..axes).map(move |j| (i, j)));
    let strains: Vec<(usize, usize)> = (0..axes).map(|i| (i, i)).chain(shears).collect();
    let mut basis = DMatrix::zeros(9, strains.len());
    for (number, &(i, j)) in strains.iter().enumerate() {
        let share = if i == j { 1.0 } else { std::f64::consts::FRAC_1_SQRT_2 };
        basis[(3 * i + j, number)] = share;
        basis[(3 * j + i, number)] = share;
    }
    basis
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formulation::tensor::from_column;

    const PLANE: Dimension = Dimension::Plane;

    fn isotropic(normal: f64, shear: f64) -> Operator {
        Operator::from_fn(|row, column| {
            let (i, j, k, l) = (row / 3, row % 3, column / 3, column % 3);
            let delta = |a: usize, b: usize| f64::from(a == b);
            normal * delta(i, j) * delta(k, l) + shear * (delta(i, k) * delta(j, l) + delta(i, l) * delta(j, k))
        })
    }

    fn samples(slope: &Operator, size: f64) -> (Sample, Sample) {
        let change = Matrix3::new(1.0, 0.2, 0.0, -0.1, -0.7, 0.0, 0.0, 0.0, 0.0) * size;
        let stress = from_column(&(slope * column(&change)));
        let sample = |gradient, nominal| Sample { gradient, nominal, carrier: Matrix3::identity() };
        (sample(-change, -stress), sample(Matrix3::zeros(), Matrix3::zeros()))
    }

    const REFERENCE: ReferenceModuli = ReferenceModuli { norm: 5.0, vertical: 3.0, shear: 1.0 };

    #[test]
    fn corrected_moduli_reproduce_the_last_pair() {
        let stiff = isotropic(1.0, 1.0);
        let (from, to) = samples(&(0.4 * stiff), 1e-3);
        let corrected = corrected(PLANE, &stiff, &from, &to, &REFERENCE, &SecantSettings::default()).unwrap();
        let change = column(&(to.gradient - from.gradient));
        let stress = column(&(to.nominal - from.nominal));
        assert!((corrected * change - stress).norm() < 1e-15);
    }

    #[test]
    fn a_soft_direction_is_stiffened_and_the_others_are_kept() {
        for (dimension, count) in [(Dimension::Plane, 3), (Dimension::Space, 6)] {
            let mut soft = isotropic(1.0, 1.0);
            soft[(0, 0)] = -1.0;
            let stiffened = floored(dimension, &soft, &REFERENCE, 0.02).unwrap();
            let sorted = |moduli: &Operator| {
                let mut values: Vec<f64> = strain_stiffness(dimension, moduli).eigenvalues.iter().copied().collect();
                values.sort_by(f64::total_cmp);
                values
            };
            let (before, after) = (sorted(&soft), sorted(&stiffened));
            assert!(before[0] < 0.0 && (after[0] - 0.06).abs() < 1e-12 && before.len() == count);
            assert!(before[1..].iter().zip(&after[1..]).all(|(before, after)| (before - after).abs() < 1e-12));
            assert_eq!(floored(dimension, &isotropic(1.0, 1.0), &REFERENCE, 0.02), None);
        }
    }

    #[test]
    fn gates_refuse_close_pairs_and_jumps_and_the_floor_refuses_softening() {
        let (settings, stiff) = (SecantSettings::default(), isotropic(1.0, 1.0));
        let (from, to) = samples(&stiff, 1e-5);
        assert_eq!(corrected(PLANE, &stiff, &from, &to, &REFERENCE, &settings), None);
        let (from, to) = samples(&(10.0 * stiff), 1e-3);
        assert_eq!(corrected(PLANE, &stiff, &from, &to, &REFERENCE, &settings), None);
        let (from, to) = samples(&(-2.0 * stiff), 1e-3);
        let kept = corrected(PLANE, &stiff, &from, &to, &REFERENCE, &settings);
        assert!(kept.is_none_or(|moduli| smallest_eigenvalue(PLANE, &moduli) >= settings.floor * REFERENCE.vertical));
    }
}
