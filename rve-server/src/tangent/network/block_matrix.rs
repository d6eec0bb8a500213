//! A square sparse matrix of small blocks, one block row and column per grain, symmetric in its pattern.

use num_traits::MulAdd;

/// One block, `[row][column]`.
pub(super) type Block<const B: usize> = [[f64; B]; B];

/// Values of several right-hand sides for the unknowns of one grain, `[unknown][right-hand side]`.
pub(super) type Columns<const B: usize, const R: usize> = [[f64; R]; B];

/// Blocks of the grains themselves and of pairs of grains.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BlockMatrix<const B: usize> {
    /// Pairs of different grains that have blocks, the smaller number first, ascending.
    pub pairs: Vec<[usize; 2]>,
    /// Blocks on the diagonal.
    pub diagonal: Vec<Block<B>>,
    /// Block (first, second) of each pair.
    pub upper: Vec<Block<B>>,
    /// Block (second, first) of each pair.
    pub lower: Vec<Block<B>>,
}

/// Where the four blocks of a contact go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// Both grains are the same.
    Diagonal,
    /// The pair's number; the origin grain has the smaller number.
    Forward(usize),
    /// The pair's number; the origin grain has the larger number.
    Backward(usize),
}

impl<const B: usize> BlockMatrix<B> {
    /// A zero matrix for `grains` grains linked by `contacts` (origin, end), and the place of each contact.
    pub(super) fn with_pattern(grains: usize, contacts: &[[usize; 2]]) -> (Self, Vec<Place>) {
        let ordered = |ends: &[usize; 2]| if ends[0] <= ends[1] { *ends } else { [ends[1], ends[0]] };
        let mut pairs: Vec<[usize; 2]> = contacts.iter().filter(|ends| ends[0] != ends[1]).map(ordered).collect();
        // Contacts come sorted from the grain solver; anything else is sorted here.
        if !pairs.is_sorted() {
            pairs.sort_unstable();
        }
        pairs.dedup();
        let mut guess = 0;
        let places = contacts
            .iter()
            .map(|ends| {
                if ends[0] == ends[1] {
                    return Place::Diagonal;
                }
                let wanted = ordered(ends);
                guess = [guess, guess + 1]
                    .into_iter()
                    .find(|&guess| pairs.get(guess) == Some(&wanted))
                    .unwrap_or_else(|| pairs.binary_search(&wanted).expect("every contact has its pair"));
                if wanted == *ends { Place::Forward(guess) } else { Place::Backward(guess) }
            })
            .collect();
        let zero = [[0.0; B]; B];
        let blocks = vec![zero; pairs.len()];
        (Self { pairs, diagonal: vec![zero; grains], upper: blocks.clone(), lower: blocks }, places)
    }

    /// Number of block rows.
    pub(super) fn grains(&self) -> usize {
        self.diagonal.len()
    }

    /// Adds the blocks of a link: `across` for (origin, end), `back` for (end, origin).
    #[inline(always)]
    pub(super) fn add_link(&mut self, origin: usize, place: Place, across: &Block<B>, back: &Block<B>) {
        match place {
            Place::Diagonal => {
                add(&mut self.diagonal[origin], across);
                add(&mut self.diagonal[origin], back);
            }
            Place::Forward(pair) => {
                add(&mut self.upper[pair], across);
                add(&mut self.lower[pair], back);
            }
            Place::Backward(pair) => {
                add(&mut self.upper[pair], back);
                add(&mut self.lower[pair], across);
            }
        }
    }

    /// Makes the equations of the unknowns marked in `pinned` read `stiffness * x = 0` and drops them elsewhere.
    pub(super) fn pin(&mut self, pinned: &[[bool; B]], stiffness: f64) {
        let clear = |block: &mut Block<B>, rows: &[bool; B], columns: &[bool; B]| {
            for (row, values) in block.iter_mut().enumerate() {
                for (column, value) in values.iter_mut().enumerate() {
                    if rows[row] || columns[column] {
                        *value = 0.0;
                    }
                }
            }
        };
        for (block, pins) in self.diagonal.iter_mut().zip(pinned).filter(|(_, pins)| pins.contains(&true)) {
            clear(block, pins, pins);
            for unknown in (0..B).filter(|&unknown| pins[unknown]) {
                block[unknown][unknown] = stiffness;
            }
        }
        for (place, [first, second]) in self.pairs.iter().enumerate() {
            let (first, second) = (&pinned[*first], &pinned[*second]);
            if first.contains(&true) || second.contains(&true) {
                clear(&mut self.upper[place], first, second);
                clear(&mut self.lower[place], second, first);
            }
        }
    }

    /// Adds `stiffness` to every diagonal value.
    pub(super) fn shift_diagonal(&mut self, stiffness: f64) {
        for block in &mut self.diagonal {
            for (unknown, row) in block.iter_mut().enumerate() {
                row[unknown] += stiffness;
            }
        }
    }

    /// `result = matrix * values`.
    #[inline(always)]
    pub(super) fn apply<const R: usize>(&self, values: &[Columns<B, R>], result: &mut [Columns<B, R>]) {
        for ((result, block), value) in result.iter_mut().zip(&self.diagonal).zip(values) {
            *result = [[0.0; R]; B];
            add_product(result, block, value);
        }
        for ((&[first, second], upper), lower) in self.pairs.iter().zip(&self.upper).zip(&self.lower) {
            add_product(&mut result[first], upper, &values[second]);
            add_product(&mut result[second], lower, &values[first]);
        }
    }

    /// `loads - matrix * answers`.
    #[inline(always)]
    pub(super) fn residual<const R: usize>(
        &self,
        loads: &[Columns<B, R>],
        answers: &[Columns<B, R>],
    ) -> Vec<Columns<B, R>> {
        let mut residual = loads.to_vec();
        for ((block, target), answer) in self.diagonal.iter().zip(&mut residual).zip(answers) {
            subtract_applied(target, block, answer);
        }
        for ((&[first, second], upper), lower) in self.pairs.iter().zip(&self.upper).zip(&self.lower) {
            subtract_applied(&mut residual[first], upper, &answers[second]);
            subtract_applied(&mut residual[second], lower, &answers[first]);
        }
        residual
    }
}

/// `target += values`.
#[inline(always)]
pub(super) fn add<const ROWS: usize, const COLUMNS: usize>(
    target: &mut [[f64; COLUMNS]; ROWS],
    values: &[[f64; COLUMNS]; ROWS],
) {
    for (target, values) in target.iter_mut().zip(values) {
        for (target, value) in target.iter_mut().zip(values) {
            *target += value;
        }
    }
}

/// `target += block * values`, fused, in either precision.
#[inline(always)]
pub(super) fn add_product<T: Copy + MulAdd<Output = T>, const B: usize, const R: usize>(
    target: &mut [[T; R]; B],
    block: &[[T; B]; B],
    values: &[[T; R]; B],
) {
    for row in 0..B {
        let mut sum = target[row];
        for column in 0..B {
            for lane in 0..R {
                sum[lane] = block[row][column].mul_add(values[column][lane], sum[lane]);
            }
        }
        target[row] = sum;
    }
}

/// `target -= block * values`, every product rounded: preparations follow these bits, and packings are kept with them.
#[inline(always)]
pub(super) fn subtract_applied<const B: usize, const R: usize>(
    target: &mut Columns<B, R>,
    block: &Block<B>,
    values: &Columns<B, R>,
) {
    for row in 0..B {
        let mut sum = target[row];
        for column in 0..B {
            for lane in 0..R {
                sum[lane] -= block[row][column] * values[column][lane];
            }
        }
        target[row] = sum;
    }
}

/// Largest absolute value in each column; NaN if anything is NaN.
#[inline(always)]
pub(super) fn largest<const B: usize, const R: usize>(values: &[Columns<B, R>]) -> [f64; R] {
    let mut norms = [0.0_f64; R];
    for row in values.iter().flatten() {
        for lane in 0..R {
            // Neither a NaN in the values nor one in the norm is ever dropped. No branch: lanes decide for themselves.
            let value = row[lane].abs();
            let keeps = norms[lane].is_nan() | (value <= norms[lane]);
            norms[lane] = if keeps { norms[lane] } else { value };
        }
    }
    norms
}
