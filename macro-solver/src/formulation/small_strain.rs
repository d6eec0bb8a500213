//! Moduli of the small-strain form.

use super::tensor::Operator;
use nalgebra::Matrix3;

/// `d sigma_ij / d G_kl` for the target `e = sym G`: `C_ijpq (I + e)^-1_rq d e_pr`, because `C` refers to the end of the
/// trial. `None` if `I + e` cannot be inverted.
pub(super) fn small_strain_moduli(gradient: &Matrix3<f64>, tangent: &Operator) -> Option<Operator> {
    let strain = 0.5 * (gradient + gradient.transpose());
    let inverse = (Matrix3::identity() + strain).try_inverse()?;
    // To the start of the trial: M_ijpr = C_ijpq inverse_rq.
    let start = Operator::from_fn(|row, column| {
        let (p, r) = (column / 3, column % 3);
        (0..3).map(|q| tangent[(row, 3 * p + q)] * inverse[(r, q)]).sum()
    });
    Some(Operator::from_fn(|row, column| {
        let (k, l) = (column / 3, column % 3);
        0.5 * (start[(row, 3 * k + l)] + start[(row, 3 * l + k)])
    }))
}
