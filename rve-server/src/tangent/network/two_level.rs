//! An approximate inverse of the balance equations of a large network: what neighbours do to each other by one sweep
//! there and back over the grains (symmetric Gauss-Seidel), what spans the cell by the rigid motions of groups of grains.
//!
//! Sweeps alone need iterations in proportion to the width of the cell in grains; with the groups their number hardly
//! grows any more.

use super::aggregates::{Aggregates, Bond};
use super::block_matrix::{Block, BlockMatrix, Columns, add_product};
use super::elimination::Elimination;
use super::factors::Factors;
use super::single_precision::{SingleBlock, SingleColumns, SingleMatrix, product, rounded, subtract};
use crate::simd::{Vectorised, dispatch};

/// Grains of a group, unless that makes more groups than [`MOST_GROUPS`].
const GROUP_SIZE: usize = 60;

/// Most groups: they are solved for directly.
const MOST_GROUPS: usize = 64;

/// The groups of a network and the matrix that they see.
pub(super) struct Groups<const B: usize> {
    aggregates: Aggregates<B>,
    matrix: BlockMatrix<B>,
    elimination: Option<Elimination>,
}

impl<const B: usize> Groups<B> {
    /// Groups the grains of `matrix`; `radii` turn spins into lengths, and what is `pinned` stays where it is.
    pub(super) fn of<const D: usize>(
        matrix: &BlockMatrix<B>,
        bonds: &[Bond<D>],
        radii: &[f64],
        pinned: &[[bool; B]],
    ) -> Self {
        let size = GROUP_SIZE.max(radii.len().div_ceil(MOST_GROUPS));
        let aggregates = Aggregates::of(bonds, radii, pinned, size);
        let matrix = dispatch(Projection { aggregates: &aggregates, matrix });
        Self { elimination: Elimination::of(matrix.grains(), &matrix.pairs), aggregates, matrix }
    }
}

/// Balance equations to be iterated on.
#[derive(Clone, Copy)]
pub(super) struct Problem<'a, const B: usize, const P: usize> {
    /// Forces and moments of grains over their motions.
    pub matrix: &'a BlockMatrix<B>,
    /// Right-hand sides.
    pub loads: &'a [Columns<B, P>],
    /// Groups of the grains of `matrix`.
    pub groups: &'a Groups<B>,
    /// Stiffness of a contact, N/m.
    pub typical: f64,
}

/// The matrix that groups see.
struct Projection<'a, const B: usize> {
    aggregates: &'a Aggregates<B>,
    matrix: &'a BlockMatrix<B>,
}

impl<const B: usize> Vectorised for Projection<'_, B> {
    type Output = BlockMatrix<B>;

    #[inline(always)]
    fn run(self) -> BlockMatrix<B> {
        self.aggregates.projected(self.matrix)
    }
}

/// The approximate inverse. Grains are numbered in the order of their groups.
pub(super) struct TwoLevel<'a, const B: usize, const P: usize> {
    /// The matrix over `typical`.
    pub matrix: SingleMatrix<B>,
    /// Grain at each place.
    pub order: Vec<usize>,
    typical: f64,
    /// Inverses of its diagonal blocks.
    inverses: Vec<SingleBlock<B>>,
    /// Group of each place.
    group_of: Vec<usize>,
    motions: Vec<SingleBlock<B>>,
    groups: usize,
    /// `None` if the groups' matrix could not be factorized: then there are only sweeps.
    coarse: Option<Factors<'a, B, P, true>>,
}

impl<'a, const B: usize, const P: usize> TwoLevel<'a, B, P> {
    /// Prepares the inverse of the matrix of `problem`.
    pub(super) fn of(problem: Problem<'a, B, P>) -> Self {
        dispatch(Preparation(problem))
    }

    /// `result` = about `typical * inverse(matrix) * given`.
    pub(super) fn apply(&self, given: &[SingleColumns<B, P>], result: &mut [SingleColumns<B, P>]) {
        dispatch(Application { inverse: self, given, result });
    }

    #[inline(always)]
    fn prepared(problem: Problem<'a, B, P>) -> Self {
        let Problem { matrix, groups, typical, .. } = problem;
        let aggregates = &groups.aggregates;
        let mut order: Vec<usize> = (0..matrix.grains()).collect();
        order.sort_by_key(|&grain| aggregates.group_of[grain]);
        // Loops and not closures: a closure may be left a function of its own, outside the instruction set of its caller.
        let mut coarse = None;
        if let Some(elimination) = &groups.elimination {
            let factors = Factors::of(&groups.matrix, elimination);
            if is_regular(&factors, aggregates.count) {
                coarse = Some(factors);
            }
        }
        let (mut inverses, mut motions) = (Vec::new(), Vec::new());
        for &grain in &order {
            inverses.push(rounded(&inverted(&matrix.diagonal[grain]), typical));
            motions.push(rounded(&aggregates.motions[grain], 1.0));
        }
        Self {
            matrix: SingleMatrix::of(matrix, &order, typical),
            inverses,
            group_of: order.iter().map(|&grain| aggregates.group_of[grain]).collect(),
            motions,
            groups: aggregates.count,
            coarse,
            order,
            typical,
        }
    }

    #[inline(always)]
    fn applied(&self, given: &[SingleColumns<B, P>], result: &mut [SingleColumns<B, P>]) {
        self.sweep(given, result);
        if let Some(coarse) = &self.coarse {
            self.move_groups(coarse, given, result);
        }
    }

    /// `(D + U)^-1 D (D + L)^-1`.
    #[inline(always)]
    fn sweep(&self, given: &[SingleColumns<B, P>], result: &mut [SingleColumns<B, P>]) {
        let pairs = &self.matrix.pairs;
        result.copy_from_slice(given);
        let mut next = 0;
        for place in 0..result.len() {
            let value = product(&self.inverses[place], &result[place]);
            result[place] = value;
            while let Some(pair) = pairs.get(next).filter(|pair| pair.first == place) {
                subtract(&mut result[pair.second], &product(&pair.lower, &value));
                next += 1;
            }
        }
        for place in (0..result.len()).rev() {
            let mut sum = [[0.0; P]; B];
            while let Some(pair) = next.checked_sub(1).map(|last| &pairs[last]).filter(|pair| pair.first == place) {
                add_product(&mut sum, &pair.upper, &result[pair.second]);
                next -= 1;
            }
            subtract(&mut result[place], &product(&self.inverses[place], &sum));
        }
    }

    /// Adds the groups' rigid motions under what pulls at their grains.
    #[inline(always)]
    fn move_groups(
        &self,
        coarse: &Factors<'_, B, P, true>,
        given: &[SingleColumns<B, P>],
        result: &mut [SingleColumns<B, P>],
    ) {
        let mut pulls = vec![[[0.0; P]; B]; self.groups];
        for ((given, motions), group) in given.iter().zip(&self.motions).zip(&self.group_of) {
            let mut pull = [[0.0_f32; P]; B];
            for unknown in 0..B {
                for motion in 0..B {
                    for lane in 0..P {
                        pull[motion][lane] =
                            motions[unknown][motion].mul_add(given[unknown][lane], pull[motion][lane]);
                    }
                }
            }
            for (sum, values) in pulls[*group].iter_mut().zip(&pull) {
                for lane in 0..P {
                    sum[lane] += f64::from(values[lane]);
                }
            }
        }
        let moves = coarse.solve(&pulls);
        let moves: Vec<SingleColumns<B, P>> =
            moves.iter().map(|rows| rows.map(|row| row.map(|value| (value * self.typical) as f32))).collect();
        for ((result, motions), group) in result.iter_mut().zip(&self.motions).zip(&self.group_of) {
            add_product(result, motions, &moves[*group]);
        }
    }
}

/// The preparation as work that is dispatched.
struct Preparation<'a, const B: usize, const P: usize>(Problem<'a, B, P>);

impl<'a, const B: usize, const P: usize> Vectorised for Preparation<'a, B, P> {
    type Output = TwoLevel<'a, B, P>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        TwoLevel::prepared(self.0)
    }
}

/// One use of the inverse, likewise.
struct Application<'m, 'a, const B: usize, const P: usize> {
    inverse: &'m TwoLevel<'a, B, P>,
    given: &'m [SingleColumns<B, P>],
    result: &'m mut [SingleColumns<B, P>],
}

impl<const B: usize, const P: usize> Vectorised for Application<'_, '_, B, P> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        self.inverse.applied(self.given, self.result);
    }
}

/// Whether the factors move under a load without regularity, and not without end.
#[inline(always)]
fn is_regular<const B: usize, const P: usize>(factors: &Factors<'_, B, P, true>, groups: usize) -> bool {
    let probe: Vec<[[f64; P]; B]> = (0..groups)
        .map(|group| {
            std::array::from_fn(|unknown| {
                let square = ((B * group + unknown) as f64).powi(2);
                [(square * std::f64::consts::GOLDEN_RATIO).fract() - 0.5; P]
            })
        })
        .collect();
    factors.solve(&probe).iter().flatten().flatten().all(|value| value.is_finite())
}

/// Inverse of the block's symmetric part by Gauss-Jordan; a pivot that is next to nothing leaves its unknown as it is.
#[inline(always)]
fn inverted<const B: usize>(block: &Block<B>) -> Block<B> {
    let mut rest: Block<B> =
        std::array::from_fn(|row| std::array::from_fn(|column| 0.5 * (block[row][column] + block[column][row])));
    let largest = rest.iter().flatten().fold(0.0, |largest: f64, value| largest.max(value.abs()));
    let mut inverse: Block<B> =
        std::array::from_fn(|row| std::array::from_fn(|column| if row == column { 1.0 } else { 0.0 }));
    for pivot in 0..B {
        if rest[pivot][pivot].abs() <= 1e-6 * largest {
            rest[pivot][pivot] = largest;
        }
        let scale = 1.0 / rest[pivot][pivot];
        rest[pivot] = rest[pivot].map(|value| value * scale);
        inverse[pivot] = inverse[pivot].map(|value| value * scale);
        for row in (0..B).filter(|row| *row != pivot) {
            let factor = rest[row][pivot];
            for column in 0..B {
                rest[row][column] -= factor * rest[pivot][column];
                inverse[row][column] -= factor * inverse[pivot][column];
            }
        }
    }
    inverse
}
