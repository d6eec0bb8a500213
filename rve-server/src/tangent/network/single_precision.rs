//! A block matrix and its right-hand sides in single precision, grains numbered so that neighbours are near in memory.
//!
//! Half the memory and twice the lanes of double precision: what an iteration costs is reading the matrix. Values are
//! divided by the stiffness of a contact, so that nothing over- or underflows whatever the units.

use super::block_matrix::{Block, BlockMatrix, Columns, add_product};

/// One block, `[row][column]`.
pub(super) type SingleBlock<const B: usize> = [[f32; B]; B];

/// Values of several right-hand sides for the unknowns of one grain.
pub(super) type SingleColumns<const B: usize, const P: usize> = [[f32; P]; B];

/// Two linked grains and their blocks.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SinglePair<const B: usize> {
    /// The smaller number.
    pub first: usize,
    /// The larger number.
    pub second: usize,
    /// Block (first, second).
    pub upper: SingleBlock<B>,
    /// Block (second, first).
    pub lower: SingleBlock<B>,
}

/// A matrix over `typical`, its grains in a given order.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SingleMatrix<const B: usize> {
    /// Blocks on the diagonal.
    pub diagonal: Vec<SingleBlock<B>>,
    /// Pairs, ascending.
    pub pairs: Vec<SinglePair<B>>,
}

impl<const B: usize> SingleMatrix<B> {
    /// Copies `matrix / typical`; `order` lists the grains.
    #[inline(always)]
    pub(super) fn of(matrix: &BlockMatrix<B>, order: &[usize], typical: f64) -> Self {
        let mut place_of = vec![0; order.len()];
        for (place, &grain) in order.iter().enumerate() {
            place_of[grain] = place;
        }
        let scale = 1.0 / typical;
        let blocks = matrix.pairs.iter().zip(&matrix.upper).zip(&matrix.lower);
        let mut pairs: Vec<_> = blocks
            .map(|((&[first, second], upper), lower)| {
                let (first, second) = (place_of[first], place_of[second]);
                let (upper, lower) = (rounded(upper, scale), rounded(lower, scale));
                if first < second {
                    SinglePair { first, second, upper, lower }
                } else {
                    SinglePair { first: second, second: first, upper: lower, lower: upper }
                }
            })
            .collect();
        pairs.sort_unstable_by_key(|pair| (pair.first, pair.second));
        Self { diagonal: order.iter().map(|&grain| rounded(&matrix.diagonal[grain], scale)).collect(), pairs }
    }

    /// `result = matrix * values`.
    #[inline(always)]
    pub(super) fn apply<const P: usize>(&self, values: &[SingleColumns<B, P>], result: &mut [SingleColumns<B, P>]) {
        for ((result, block), value) in result.iter_mut().zip(&self.diagonal).zip(values) {
            *result = product(block, value);
        }
        for pair in &self.pairs {
            add_product(&mut result[pair.first], &pair.upper, &values[pair.second]);
            add_product(&mut result[pair.second], &pair.lower, &values[pair.first]);
        }
    }
}

/// `block * scale` in single precision.
#[inline(always)]
pub(super) fn rounded<const B: usize>(block: &Block<B>, scale: f64) -> SingleBlock<B> {
    block.map(|row| row.map(|value| (value * scale) as f32))
}

/// `block * values`.
#[inline(always)]
pub(super) fn product<const B: usize, const P: usize>(
    block: &SingleBlock<B>,
    values: &SingleColumns<B, P>,
) -> SingleColumns<B, P> {
    let mut result = [[0.0; P]; B];
    add_product(&mut result, block, values);
    result
}

/// `target -= values`.
#[inline(always)]
pub(super) fn subtract<const B: usize, const P: usize>(
    target: &mut SingleColumns<B, P>,
    values: &SingleColumns<B, P>,
) {
    for row in 0..B {
        for lane in 0..P {
            target[row][lane] -= values[row][lane];
        }
    }
}

/// Scalar products of the columns, summed over the grains in double precision.
#[inline(always)]
pub(super) fn dot<const B: usize, const P: usize>(a: &[SingleColumns<B, P>], b: &[SingleColumns<B, P>]) -> [f64; P] {
    let mut sum = [0.0; P];
    for (a, b) in a.iter().zip(b) {
        let mut part = [0.0_f32; P];
        for unknown in 0..B {
            for lane in 0..P {
                part[lane] = a[unknown][lane].mul_add(b[unknown][lane], part[lane]);
            }
        }
        for lane in 0..P {
            sum[lane] += f64::from(part[lane]);
        }
    }
    sum
}

/// `values / scale` of each column in single precision, grains in the given order.
#[inline(always)]
pub(super) fn gather<const B: usize, const P: usize>(
    values: &[Columns<B, P>],
    order: &[usize],
    scale: &[f64; P],
    result: &mut [SingleColumns<B, P>],
) {
    let factor = scale.map(|scale| 1.0 / scale);
    for (result, &grain) in result.iter_mut().zip(order) {
        for unknown in 0..B {
            for lane in 0..P {
                result[unknown][lane] = (values[grain][unknown][lane] * factor[lane]) as f32;
            }
        }
    }
}
