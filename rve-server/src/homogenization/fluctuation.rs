//! Displacement fluctuations: how grains move in addition to the deformation of their cell.

use crate::cell::GrainState;
use crate::space::{Space, Tensor, apply, inverse, product, transpose};

/// `x - F x0` of every grain without its mean over the grains, m, in coordinates of space: a cell may float. `F` is the deformation
/// gradient of the cell from `start` to `now`; `about` is about that, to a few per cent, and tells how often a cell under large shear has
/// been described anew. Positions are not wrapped into the cell, so images need no care. A rotation of everything turns the result with it.
pub fn displacement_fluctuations<S: Space>(
    start: &GrainState<S>,
    now: &GrainState<S>,
    about: &S::Tensor,
) -> Vec<[f64; 3]> {
    let deformation = cell_deformation::<S>(&start.cell.rows, &now.cell.rows, about);
    fluctuations::<S>(&start.positions, &now.positions, &deformation)
}

/// Deformation gradient of a cell from its periodicity vectors, rows `Y = M Y0 F^T`. The whole numbers `M` by which a cell under large
/// shear was described anew follow from a gradient that is about right.
pub(crate) fn cell_deformation<S: Space>(start: &S::Tensor, now: &S::Tensor, about: &S::Tensor) -> S::Tensor {
    let whole = product(now, &inverse(&product(start, &transpose(about))));
    let whole = S::Tensor::from_fn(|i, j| whole[i][j].round());
    transpose(&product(&inverse(&product(&whole, start)), now))
}

/// `x - F x0` of every grain without its mean over the grains, m: a cell may float.
fn fluctuations<S: Space>(start: &[S::Vector], now: &[S::Vector], deformation: &S::Tensor) -> Vec<[f64; 3]> {
    let offset = |(start, now): (&S::Vector, &S::Vector)| {
        let moved = apply(deformation, *start);
        std::array::from_fn(|axis| if axis < S::DIMENSION { now[axis] - moved[axis] } else { 0.0 })
    };
    let offsets: Vec<[f64; 3]> = start.iter().zip(now).map(offset).collect();
    let mean = |axis: usize| offsets.iter().map(|offset| offset[axis]).sum::<f64>() / offsets.len() as f64;
    let mean = [mean(0), mean(1), mean(2)];
    offsets.iter().map(|offset| std::array::from_fn(|axis| offset[axis] - mean[axis])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::Discs;

    /// A cell sheared by 1.7 is described by shorter vectors; its deformation is found all the same, from one that is 2 % off.
    #[test]
    fn the_deformation_of_a_cell_survives_its_new_description() {
        let start = [[2.0, 0.0], [0.0, 1.0]];
        let deformation = [[0.9, 1.7], [0.0, 1.1]];
        let rows = product(&start, &transpose(&deformation));
        let reduced = [rows[0], [rows[1][0] - rows[0][0], rows[1][1] - rows[0][1]]];
        let about = [[0.91, 1.68], [0.01, 1.12]];
        let found = cell_deformation::<Discs>(&start, &reduced, &about);
        for (found, expected) in found.as_flattened().iter().zip(deformation.as_flattened()) {
            assert!((found - expected).abs() < 1e-14, "{found} {expected}");
        }
    }

    #[test]
    fn fluctuations_are_what_the_deformation_leaves_without_the_mean() {
        let start = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
        let deformation = [[1.1, 0.2], [0.0, 0.9]];
        let own = [[0.03, 0.0], [-0.01, 0.0], [-0.01, 0.02], [-0.01, -0.02]];
        // The whole cell has floated by 5 and 7.
        let now: Vec<[f64; 2]> = start
            .iter()
            .zip(own)
            .map(|(&place, own)| {
                let moved = apply(&deformation, place);
                [moved[0] + own[0] + 5.0, moved[1] + own[1] + 7.0]
            })
            .collect();
        for (found, own) in fluctuations::<Discs>(&start, &now, &deformation).iter().zip(own) {
            assert!((found[0] - own[0]).abs() < 1e-14 && (found[1] - own[1]).abs() < 1e-14 && found[2] == 0.0);
        }
    }
}
