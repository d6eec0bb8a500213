//! Operators that force the mean strain upon all grains: UKO, UCKO, UCKO-2DOF and KAO of [Argilaga2018].
//!
//! No balance of grains is solved for, which makes them cheap and far too stiff. With `k_n` and `k_t` scaled by
//! calibration factors they are UCKO and UCKO-2DOF.

use super::link::{LinkedGrains, dot};
use super::sliding::{ContactStiffness, Sliding};
use super::strain::{PAIRS, objective, pair, stretched};
use protocol::Tensor4;

/// Factors of `k_n` and `k_t` without calibration.
pub(super) const UNCALIBRATED: [f64; 2] = [1.0, 1.0];

/// UKO in its objective form, Pa: grains follow the mean strain and spin with the mean rotation.
///
/// Erratum: the printed operator lets the whole displacement gradient shear the contacts, so that a rigid rotation
/// changes the stress and `d sigma` is not symmetric. Here strain alone acts, which symmetrises the tangential part in
/// both index pairs; that is also the true upper bound of the network operators at vanishing prestress. Prestress terms
/// are left out. All contacts stick.
pub(super) fn kruyt<const D: usize, const B: usize>(grains: &LinkedGrains<D>, factors: [f64; 2]) -> Tensor4 {
    let mut sum = [[0.0; B]; PAIRS];
    for link in &grains.links {
        let normal_stiffness = factors[0] * link.normal_stiffness;
        let tangential_stiffness = factors[1] * link.tangential_stiffness;
        let motions: [[f64; D]; B] = std::array::from_fn(|strain| stretched(strain, &link.branch));
        let lengthenings = motions.map(|motion| dot(&motion, &link.normal));
        // Stress is symmetric here: components follow from unit strains on the left as well.
        for (row, (left, left_lengthening)) in motions.iter().zip(&lengthenings).enumerate() {
            let [i, j] = pair::<D>(row);
            for (column, (right, right_lengthening)) in motions.iter().zip(&lengthenings).enumerate() {
                let along = left_lengthening * right_lengthening;
                let across = dot(left, right) - along;
                let share = (normal_stiffness * along + tangential_stiffness * across) / grains.volume;
                sum[D * i + j][column] += share;
                if i != j {
                    sum[D * j + i][column] += share;
                }
            }
        }
    }
    objective(&sum, &[[0.0; D]; D])
}

/// UKO as printed, [Argilaga2018] eq. 13, Pa: grains do not spin, so a rigid rotation shears every contact.
pub(super) fn kruyt_printed<const D: usize>(grains: &LinkedGrains<D>, factors: [f64; 2]) -> Tensor4 {
    let mut operator = Tensor4::ZERO;
    for link in &grains.links {
        let e = &link.normal;
        let scale = link.length * link.length / grains.volume;
        let (normal, tangential) =
            (scale * factors[0] * link.normal_stiffness, scale * factors[1] * link.tangential_stiffness);
        for [i, j, k, l] in indices::<D>() {
            let unit = if i == k { 1.0 } else { 0.0 };
            let stiffness = normal * e[i] * e[k] + tangential * (unit - e[i] * e[k]);
            operator.set(i, j, k, l, operator.get(i, j, k, l) + stiffness * e[j] * e[l]);
        }
    }
    operator
}

/// KAO as printed, [Argilaga2018] eq. 18 at `F = I`, Pa: uniform strain, all grains spin with the mean rotation, and the
/// forces that are there already turn with the contacts.
///
/// Erratum: this state violates the balance of moments, so that `d sigma` is not symmetric; see [`augmented`]. The sign
/// of the prestress terms holds for tension-positive stress.
pub(super) fn augmented_printed<const D: usize, const B: usize>(grains: &LinkedGrains<D>) -> Tensor4 {
    let mut operator = Tensor4::ZERO;
    let mut stress = [[0.0; D]; D];
    for link in &grains.links {
        let (e, force) = (&link.normal, link.force());
        let law = ContactStiffness::of(link, Sliding::Sticks, 0.0);
        for [i, j, k, l] in indices::<D>() {
            // l T E_sym e: half of T e_l for each of the two index orders.
            let elastic = link.normal_stiffness * e[i] * e[k] * e[l]
                + 0.5 * (law.tangential[i][k] * e[l] + law.tangential[i][l] * e[k]);
            let unit = if i == k { 1.0 } else { 0.0 };
            let turn = (link.normal_force * (unit - e[i] * e[k]) - e[i] * link.tangential_force[k]) * e[l];
            let twist = twisted::<D>(link.tangential_force, e, [i, k, l]);
            let value = link.length * e[j] * (link.length * elastic + turn + twist) / grains.volume;
            operator.set(i, j, k, l, operator.get(i, j, k, l) + value);
        }
        for (i, row) in stress.iter_mut().enumerate() {
            for (j, value) in row.iter_mut().enumerate() {
                *value += force[i] * link.branch[j] / grains.volume;
            }
        }
    }
    for [i, j, k, l] in indices::<D>() {
        let area = if j == k { stress[i][l] } else { 0.0 };
        let volume = if k == l { stress[i][j] } else { 0.0 };
        operator.set(i, j, k, l, operator.get(i, j, k, l) + area - volume);
    }
    operator
}

/// KAO with `d sigma` made symmetric, Pa.
pub(super) fn augmented<const D: usize, const B: usize>(grains: &LinkedGrains<D>) -> Tensor4 {
    let printed = augmented_printed::<D, B>(grains);
    let mut operator = Tensor4::ZERO;
    for [i, j, k, l] in indices::<D>() {
        operator.set(i, j, k, l, 0.5 * (printed.get(i, j, k, l) + printed.get(j, i, k, l)));
    }
    operator
}

/// The tangential force turned about the normal by the mean spin that `dF_kl` contains, component `i`; nothing in the
/// plane.
fn twisted<const D: usize>(force: [f64; D], e: &[f64; D], [i, k, l]: [usize; 3]) -> f64 {
    if D == 2 || k == l {
        return 0.0;
    }
    // dF_kl alone spins with omega = 1/2 e_l x e_k; (omega . e) (e x f)_i.
    let axis = 3 - k - l;
    let orientation = if (l + 1) % 3 == k { 0.5 } else { -0.5 };
    let (first, second) = ((i + 1) % 3, (i + 2) % 3);
    orientation * e[axis] * (e[first] * force[second] - e[second] * force[first])
}

fn indices<const D: usize>() -> impl Iterator<Item = [usize; 4]> {
    let count = D * D * D * D;
    (0..count).map(|place| [place / (D * D * D), place / (D * D) % D, place / D % D, place % D])
}
