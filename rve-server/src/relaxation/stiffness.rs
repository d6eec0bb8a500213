//! How stiff the stiffest grain is: the bound from which the relaxation takes its masses.
//!
//! With a unit pseudo-time step the explicit motion is stable while `omega_max < 2`. The bound used is
//! `omega_max^2 <= 2 max_i lambda_max(M_i^-1 K_ii)` with `K_ii` the grain's own 3x3 block (two translations and the
//! rotation), because `(a - b)^2 <= 2 a^2 + 2 b^2` in every contact. Erratum: the single-contact frequencies of
//! [Liu2015] eq. 64 are not bounds; on crystals they allow steps up to four times too long.

use super::kernel::{GrainSlot, LinearLaw, PairSlot};

/// Inertia of a grain in the relaxation is this times mass times radius squared; measured best, a solid disc has 0.5.
pub(crate) const INERTIA_FACTOR: f64 = 0.8;

/// Newton steps for an eigenvalue; five leave less than a percent even between close eigenvalues.
const NEWTON_STEPS: u32 = 5;

/// A symmetric 3x3 matrix: `[xx, yy, zz, xy, xz, yz]`.
type Block = [f64; 6];

/// Largest eigenvalue over all grains of the own stiffness block divided by unit masses `shape[i]` and inertias
/// `inertia shape[i] R_i^2`, N/m.
pub(crate) fn largest_own_stiffness(
    law: &LinearLaw,
    inertia: f64,
    grains: &[GrainSlot],
    shape: &[f64],
    pairs: &[PairSlot],
    blocks: &mut Vec<Block>,
) -> f64 {
    blocks.clear();
    blocks.resize(grains.len(), [0.0; 6]);
    for pair in pairs.iter().filter(|pair| pair.touches()) {
        let [x, y] = pair.direction;
        let stiffness = [pair.normal_stiffness, law.stiffness_ratio * pair.normal_stiffness];
        add_contact(&mut blocks[pair.origin as usize], stiffness, [x, y], inertia);
        add_contact(&mut blocks[pair.end as usize], stiffness, [-x, -y], inertia);
    }
    blocks.iter().zip(shape).fold(0.0, |largest: f64, (block, mass)| largest.max(largest_eigenvalue(block) / mass))
}

/// Adds `k_n e e^T + k_t (t, l) (t, l)^T` with `e` pointing away from the grain, the rotation scaled by its inertia.
/// The lever arm is taken as the radius, which bounds it. Zero inertia means that grains do not rotate.
fn add_contact(block: &mut Block, [normal, tangential]: [f64; 2], [x, y]: [f64; 2], inertia: f64) {
    let arm = if inertia > 0.0 { 1.0 / inertia.sqrt() } else { 0.0 };
    block[0] += normal * x * x + tangential * y * y;
    block[1] += normal * y * y + tangential * x * x;
    block[2] += tangential * arm * arm;
    block[3] += (normal - tangential) * x * y;
    block[4] -= tangential * arm * y;
    block[5] += tangential * arm * x;
}

/// Upper bound of the largest eigenvalue of a symmetric 3x3 matrix, tight to rounding unless two eigenvalues nearly
/// coincide.
///
/// Newton's method on the characteristic cubic, started above its largest root, approaches that root from above: every
/// iterate is a bound. Arithmetic alone, so that the masses and with them all results do not depend on a system's
/// mathematical library.
fn largest_eigenvalue(block: &Block) -> f64 {
    let [xx, yy, zz, xy, xz, yz] = *block;
    let mean = (xx + yy + zz) / 3.0;
    let (x, y, z) = (xx - mean, yy - mean, zz - mean);
    // Of the deviator: half its squared norm, and its determinant. Characteristic cubic: r^3 - half r - determinant.
    let half = 0.5 * (x * x + y * y + z * z) + (xy * xy + xz * xz + yz * yz);
    let determinant = x * (y * z - yz * yz) - xy * (xy * z - yz * xz) + xz * (xy * yz - y * xz);
    let mut root = 2.0 * (half / 3.0).sqrt();
    for _ in 0..NEWTON_STEPS {
        let slope = 3.0 * root * root - half;
        if slope <= 0.0 {
            break;
        }
        root -= (root * (root * root - half) - determinant) / slope;
    }
    mean + root
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn eigenvalue_is_bounded_from_above_and_tightly(v in proptest::array::uniform6(-5.0..5.0f64)) {
            let [a, b, c, d, e, f] = v;
            let matrix = Matrix3::new(a, d, e, d, b, f, e, f, c);
            let reference = matrix.symmetric_eigenvalues().max();
            let spread = matrix.norm();
            let bound = largest_eigenvalue(&v);
            prop_assert!(bound >= reference - 1e-13 * spread);
            prop_assert!(bound <= reference + 0.02 * spread);
        }
    }
}
