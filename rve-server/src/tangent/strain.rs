//! Strains as columns: the symmetric part of an operator, and the whole operator that objectivity makes of it.

use protocol::Tensor4;

/// The index pair of each of the `B` independent strains: the diagonal first, then 12, or 23, 13, 12.
pub(super) const fn pair<const D: usize>(strain: usize) -> [usize; 2] {
    if strain < D {
        return [strain, strain];
    }
    if D == 2 {
        return [0, 1];
    }
    match strain {
        3 => [1, 2],
        4 => [0, 2],
        _ => [0, 1],
    }
}

/// `E x` for the unit strain `E`; a shear strain has `1/2` at both places.
#[inline(always)]
pub(super) fn stretched<const D: usize>(strain: usize, x: &[f64; D]) -> [f64; D] {
    let mut result = [0.0; D];
    let [i, j] = pair::<D>(strain);
    if i == j {
        result[i] = x[i];
    } else {
        result[i] = 0.5 * x[j];
        result[j] = 0.5 * x[i];
    }
    result
}

/// Room for the components of a stress, numbered `D i + j`.
pub(super) const PAIRS: usize = 9;

/// The operator on displacement gradients whose action on strain is `stiffness`, `[D i + j][strain]`, and whose action on
/// a spin `W` is `W sigma - sigma W`, as every frame-indifferent material has it.
pub(super) fn objective<const D: usize, const B: usize>(
    stiffness: &[[f64; B]; PAIRS],
    stress: &[[f64; D]; D],
) -> Tensor4 {
    let mut operator = Tensor4::ZERO;
    for (row, values) in stiffness.iter().take(D * D).enumerate() {
        let (i, j) = (row / D, row % D);
        for (column, &value) in values.iter().enumerate() {
            let [k, l] = pair::<D>(column);
            if k == l {
                operator.set(i, j, k, l, value);
                continue;
            }
            // dF_kl = 1 alone is half the shear strain's unit pair and the spin W_kl = 1/2 = -W_lk.
            let spin = |m: usize, n: usize| match [m, n] {
                [m, n] if [m, n] == [k, l] => 0.5,
                [m, n] if [m, n] == [l, k] => -0.5,
                _ => 0.0,
            };
            let change: f64 = (0..D).map(|m| spin(i, m) * stress[m][j] - stress[i][m] * spin(m, j)).sum();
            operator.set(i, j, k, l, value + change);
            operator.set(i, j, l, k, value - change);
        }
    }
    operator
}
