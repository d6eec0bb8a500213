//! Stress and tangent in the order of the host: 11, 22, 33, 12, 13, 23, shear strains doubled, matrices by columns.

use crate::ffi_boundary::Failure;
use crate::measures::{Components, End, Operator, Stress};
use protocol::{Tensor2, Tensor4};
use std::f64::consts::SQRT_2;
use std::ffi::c_int;

const DIRECT: [(usize, usize); 3] = [(0, 0), (1, 1), (2, 2)];
const SHEAR: [(usize, usize); 3] = [(0, 1), (0, 2), (1, 2)];

/// A deformation gradient from an array by columns.
pub(super) fn gradient(columns: &[f64]) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| columns[3 * j + i]))
}

/// Components of a stress state.
#[derive(Clone, Debug)]
pub(super) struct Voigt {
    pairs: Vec<(usize, usize)>,
}

impl Voigt {
    /// For three direct and one (plane strain, axial symmetry) or three shear components.
    ///
    /// # Errors
    /// Any other stress state: plane stress cannot be kept by a cell.
    pub(super) fn new(direct: c_int, shear: c_int) -> Result<Self, Failure> {
        let shears = match (direct, shear) {
            (3, 1) => 1,
            (3, 3) => 3,
            _ => {
                let text = format!(
                    "NDI = {direct} and NSHR = {shear}: only plane strain, axial symmetry and solids are served"
                );
                return Err(Failure::input(text));
            }
        };
        Ok(Self { pairs: DIRECT.into_iter().chain(SHEAR.into_iter().take(shears)).collect() })
    }

    /// NTENS.
    pub(super) fn components(&self) -> usize {
        self.pairs.len()
    }

    /// The tensor of a strain with doubled shears.
    pub(super) fn strain(&self, components: &[f64]) -> Tensor2 {
        let mut tensor = Tensor2::ZERO;
        for (value, &(i, j)) in components.iter().zip(&self.pairs) {
            let value = if i == j { *value } else { 0.5 * value };
            tensor.0[3 * i + j] = value;
            tensor.0[3 * j + i] = value;
        }
        tensor
    }

    /// STRESS: the symmetric part; what grains that are nearly at rest leave of the rest is no stress of a continuum.
    pub(super) fn put_stress(&self, stress: &Tensor2, room: &mut [f64]) {
        for (place, &(i, j)) in room.iter_mut().zip(&self.pairs) {
            *place = 0.5 * (stress.get(i, j) + stress.get(j, i));
        }
    }

    /// DDSDDE: change of the Jaumann rate of the Kirchhoff stress over the volume ratio with the strain increment,
    /// `1/2 (C_ijkl + C_ijlk) + sigma_ij delta_kl`, by columns. `C` is objective, so its spin part is that of the Jaumann rate.
    pub(super) fn put_jacobian(&self, tangent: &Tensor4, stress: &Tensor2, room: &mut [f64]) {
        let rows = self.pairs.len();
        for (column, &(k, l)) in self.pairs.iter().enumerate() {
            for (row, &(i, j)) in self.pairs.iter().enumerate() {
                let both = |i, j| 0.5 * (tangent.get(i, j, k, l) + tangent.get(i, j, l, k));
                let convected = if k == l { 0.5 * (stress.get(i, j) + stress.get(j, i)) } else { 0.0 };
                room[rows * column + row] = 0.5 * (both(i, j) + both(j, i)) + convected;
            }
        }
    }

    /// STRESS and DDSDDE for equilibrium in the undeformed body: the second Piola-Kirchhoff stress and its change with the Green-Lagrange
    /// strain, by columns.
    pub(super) fn put_second_piola(&self, end: &End<'_>, stress: &mut [f64], jacobian: &mut [f64]) {
        let rows = self.components();
        let places = Components { in_space: rows == DIRECT.len() + SHEAR.len() };
        // MFront's shears are times the square root of two; here stresses are as they are, and shear strains doubled.
        let share = |component: usize| if component < DIRECT.len() { 1.0 } else { SQRT_2 };
        for (row, value) in end.force(Stress::SecondPiola, places).into_iter().enumerate() {
            stress[row] = value / share(row);
        }
        for (place, value) in end.operator(Operator::SecondPiolaByStrain, places).into_iter().enumerate() {
            let (row, column) = (place / rows, place % rows);
            jacobian[rows * column + row] = value / (share(row) * share(column));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measures::closed_law::{LAME, SHEAR, cauchy, flat, second_piola, tangent};
    use crate::measures::{Matrix, UNIT};
    use rve_server::space::product;

    /// An objective isotropic law: the Jaumann rate of the Cauchy stress is Lame's.
    #[test]
    fn the_jacobian_of_an_objective_law_has_no_spin() {
        let (lame, shear) = (3.0, 2.0);
        let stress = Tensor2([5.0, 1.0, 0.0, 1.0, -2.0, 0.0, 0.0, 0.0, 0.5]);
        let delta = |i: usize, j: usize| if i == j { 1.0 } else { 0.0 };
        let mut tangent = Tensor4::ZERO;
        for place in 0..81 {
            let [i, j, k, l] = [place / 27, place / 9 % 3, place / 3 % 3, place % 3];
            // d sigma = lame tr(L) I + 2 shear D + W sigma - sigma W, with W = (L - L^T) / 2.
            let spin = 0.5
                * (delta(i, k) * stress.get(l, j) - delta(i, l) * stress.get(k, j) - stress.get(i, k) * delta(l, j)
                    + stress.get(i, l) * delta(k, j));
            let elastic =
                lame * delta(i, j) * delta(k, l) + shear * (delta(i, k) * delta(j, l) + delta(i, l) * delta(j, k));
            tangent.set(i, j, k, l, elastic + spin);
        }
        let voigt = Voigt::new(3, 3).unwrap();
        let mut jacobian = vec![0.0; 36];
        voigt.put_jacobian(&tangent, &stress, &mut jacobian);
        let direct = |row: usize, column: usize| jacobian[6 * column + row];
        assert!((direct(0, 0) - (lame + 2.0 * shear + 5.0)).abs() < 1e-14);
        assert!((direct(0, 1) - (lame + 5.0)).abs() < 1e-14 && (direct(1, 0) - (lame - 2.0)).abs() < 1e-14);
        assert!((direct(3, 3) - shear).abs() < 1e-14 && direct(0, 3).abs() < 1e-14);
        assert!((direct(3, 0) - 1.0).abs() < 1e-14, "the shear stress is convected");
    }

    /// Saint Venant-Kirchhoff's law behind a rotation by 40 degrees, which second Piola-Kirchhoff stress and moduli do not see.
    #[test]
    fn second_piola_stress_and_moduli_do_not_see_a_rotation() {
        let (sine, cosine) = 40.0_f64.to_radians().sin_cos();
        let rotation: Matrix = [[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]];
        let stretch: Matrix = [[1.05, 0.04, 0.0], [0.04, 0.93, 0.0], [0.0, 0.0, 1.02]];
        let after = product(&rotation, &stretch);
        let (stress, tangent) = (flat(&cauchy(&after)), tangent(&after));
        let end = End { before: UNIT, after, stress: &stress, tangent: &tangent };
        let wanted = second_piola(&stretch);
        for shears in [1, 3] {
            let voigt = Voigt::new(3, shears).unwrap();
            let rows = voigt.components();
            let (mut found, mut moduli) = (vec![0.0; rows], vec![0.0; rows * rows]);
            voigt.put_second_piola(&end, &mut found, &mut moduli);
            for (row, &(i, j)) in voigt.pairs.iter().enumerate() {
                assert!((found[row] - wanted[i][j]).abs() < 1e-12, "{row}: {found:?}");
                for column in 0..rows {
                    // The change of a shear stress with the doubled shear strain is the shear modulus.
                    let own = if row < 3 { 2.0 * SHEAR } else { SHEAR };
                    let expected =
                        if row == column { own } else { 0.0 } + if row < 3 && column < 3 { LAME } else { 0.0 };
                    let value = moduli[rows * column + row];
                    assert!((value - expected).abs() < 1e-6, "{row} {column}: {value} {expected}");
                }
            }
        }
    }

    #[test]
    fn stress_states_that_a_cell_cannot_keep_are_refused() {
        assert!(Voigt::new(2, 1).unwrap_err().text.contains("NDI = 2"));
        assert_eq!(Voigt::new(3, 1).unwrap().components(), 4);
        assert_eq!(gradient(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0])[0], [1.0, 4.0, 7.0]);
    }
}
