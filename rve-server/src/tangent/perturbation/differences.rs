//! Differences of the stress in all directions of the displacement gradient.

use crate::space::{Space, Tensor};
use protocol::Tensor4;

/// How an operator is probed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Probe {
    /// Size of the displacement gradient of a probe, dimensionless.
    pub size: f64,
    /// Whether each direction is probed both ways.
    pub central: bool,
}

/// `C_ijmn = [sigma_ij(probe of mn) - base_ij] / size`, or half the difference of a forward and a backward probe; `None`
/// if a probe fails or a difference is not finite. `stress` is the stress at a displacement gradient.
pub(super) fn differentiate<S: Space>(
    probe: Probe,
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
            let forward = at(probe.size)?;
            let (from, width) =
                if probe.central { (at(-probe.size)?, 2.0 * probe.size) } else { (*base, probe.size) };
            for i in 0..S::DIMENSION {
                for j in 0..S::DIMENSION {
                    operator.set(i, j, m, n, (forward[i][j] - from[i][j]) / width);
                }
            }
        }
    }
    operator.is_finite().then_some(operator)
}
