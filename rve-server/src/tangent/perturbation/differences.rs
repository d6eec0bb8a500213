//! Differences of the stress in all directions of the displacement gradient.

use crate::space::{Space, Tensor};
use crate::tangent::method::Difference;
use protocol::Tensor4;

/// `C_ijmn = [sigma_ij(perturbation mn) - base_ij] / size`, or half the difference of a forward and a backward perturbation over
/// `size`, a displacement gradient, dimensionless; `None` if a perturbation fails or a difference is not finite. `stress` is the stress at a displacement gradient.
pub(super) fn differentiate<S: Space>(
    size: f64,
    difference: Difference,
    base: &S::Tensor,
    stress: &mut dyn FnMut(&S::Tensor) -> Option<S::Tensor>,
) -> Option<Tensor4> {
    let mut operator = Tensor4::ZERO;
    for m in 0..S::DIMENSION {
        for n in 0..S::DIMENSION {
            let mut at = |size: f64| {
                let mut gradient = S::Tensor::ZERO;
                gradient[m][n] = size;
                stress(&gradient)
            };
            let forward = at(size)?;
            let (from, width) = match difference {
                Difference::Forward => (*base, size),
                Difference::Central => (at(-size)?, 2.0 * size),
            };
            for i in 0..S::DIMENSION {
                for j in 0..S::DIMENSION {
                    operator.set(i, j, m, n, (forward[i][j] - from[i][j]) / width);
                }
            }
        }
    }
    operator.is_finite().then_some(operator)
}
