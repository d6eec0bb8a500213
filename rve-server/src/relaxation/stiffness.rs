//! How stiff the stiffest grain is: the bound from which the relaxation takes its masses.
//!
//! With a unit pseudo-time step the explicit motion is stable while `omega_max < 2`. The bound used is
//! `omega_max^2 <= 2 max_i lambda_max(M_i^-1 K_ii)` with `K_ii` the grain's own 3x3 block (two translations and the
//! rotation), because `(a - b)^2 <= 2 a^2 + 2 b^2` in every contact. Erratum: the single-contact frequencies of
//! [Liu2015] eq. 64 are not bounds; on crystals they allow steps up to four times too long.

use super::kernel::{GrainSlot, LinearLaw, PairSlot};

/// Inertia of a grain in the relaxation is this times mass times radius squared; measured best, a solid disc has 0.5.
pub(crate) const INERTIA_FACTOR: f64 = 0.8;

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

/// Largest eigenvalue of a symmetric 3x3 matrix in closed form (trigonometric solution of the cubic).
fn largest_eigenvalue(block: &Block) -> f64 {
    let [xx, yy, zz, xy, xz, yz] = *block;
    let mean = (xx + yy + zz) / 3.0;
    let (x, y, z) = (xx - mean, yy - mean, zz - mean);
    let spread = ((x * x + y * y + z * z + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0).sqrt();
    if spread <= f64::MIN_POSITIVE {
        return mean;
    }
    let determinant = x * (y * z - yz * yz) - xy * (xy * z - yz * xz) + xz * (xy * yz - y * xz);
    let cosine = (0.5 * determinant / (spread * spread * spread)).max(-1.0).min(1.0);
    mean + 2.0 * spread * (cosine.acos() / 3.0).cos()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn closed_form_eigenvalue_is_right(v in proptest::array::uniform6(-5.0..5.0f64)) {
            let [a, b, c, d, e, f] = v;
            let matrix = Matrix3::new(a, d, e, d, b, f, e, f, c);
            let reference = matrix.symmetric_eigenvalues().max();
            prop_assert!((largest_eigenvalue(&v) - reference).abs() < 1e-12 * (1.0 + reference.abs()));
        }
    }
}
