//! The periodicity vectors that a packing was given with, while its cell is strained: a cell that shears far is described by other vectors
//! of the same lattice, and its axes are still those of the vectors that its user knows.

use crate::space::{Space, Tensor, inverse, product};

/// What the vectors of the beginning are in terms of those of now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FirstVectors {
    /// First vector `i` is the sum of `counts[i][j]` times vector `j` of now.
    counts: [[i32; 3]; 3],
}

impl FirstVectors {
    /// Of a cell that was given by `first` vectors and is described by those of `now`, m, by rows; both make the same lattice.
    pub(super) fn new<S: Space>(first: &S::Tensor, now: &S::Tensor) -> Self {
        Self { counts: whole::<S>(&product(first, &inverse(now))) }
    }

    /// Follows a step: vectors that would be `carried` along by it are described by those of `now`.
    pub(super) fn follow<S: Space>(&mut self, carried: &S::Tensor, now: &S::Tensor) {
        let step = whole::<S>(&product(carried, &inverse(now)));
        let before = self.counts;
        let entry = |i: usize, j: usize| (0..S::DIMENSION).map(|k| before[i][k] * step[k][j]).sum();
        self.counts = std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)));
    }

    /// The first vectors as they lie now, m, by rows; bitwise those of `now` where these are the first ones themselves.
    pub(super) fn rows<S: Space>(&self, now: &S::Tensor) -> S::Tensor {
        if self.are_those_of_now::<S>() {
            return *now;
        }
        product(&S::Tensor::from_fn(|i, j| f64::from(self.counts[i][j])), now)
    }

    /// Whether nothing has been described anew.
    pub(super) fn are_those_of_now<S: Space>(&self) -> bool {
        (0..S::DIMENSION).all(|i| (0..S::DIMENSION).all(|j| self.counts[i][j] == i32::from(i == j)))
    }

    /// A shift along the vectors of now as one along the first ones.
    pub(super) fn shift<S: Space>(&self, shift: S::Shift) -> S::Shift {
        // Both describe one lattice, so the inverse holds whole numbers too.
        let back = whole::<S>(&inverse(&S::Tensor::from_fn(|i, j| f64::from(self.counts[i][j]))));
        S::shift(|axis| (0..S::DIMENSION).map(|of| shift[of] * back[of][axis]).sum())
    }
}

fn whole<S: Space>(matrix: &S::Tensor) -> [[i32; 3]; 3] {
    let entry =
        |i: usize, j: usize| if i < S::DIMENSION && j < S::DIMENSION { matrix[i][j].round() as i32 } else { 0 };
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cell::Cell;
    use crate::space::Spheres;

    #[test]
    fn first_vectors_and_shifts_are_found_again_after_two_changes_of_description() {
        let first = [[2.0, 0.0, 0.0], [0.3, 1.5, 0.0], [0.1, -0.2, 1.0]];
        let mut vectors = FirstVectors::new::<Spheres>(&first, &first);
        assert!(vectors.are_those_of_now::<Spheres>());
        assert_eq!(vectors.rows::<Spheres>(&first), first);
        let sum =
            |a: [f64; 3], n: f64, b: [f64; 3]| -> [f64; 3] { std::array::from_fn(|axis| a[axis] + n * b[axis]) };
        let second = [first[0], sum(first[1], -2.0, first[0]), first[2]];
        vectors.follow::<Spheres>(&first, &second);
        let third = [sum(second[0], 1.0, second[2]), second[1], sum(second[2], 3.0, second[1])];
        let third = [third[0], third[1], third[2]];
        vectors.follow::<Spheres>(&second, &third);
        let found = vectors.rows::<Spheres>(&third);
        for (one, other) in found.iter().flatten().zip(first.iter().flatten()) {
            assert!((one - other).abs() < 1e-12, "{found:?}");
        }
        let (before, now) = (Cell::<Spheres> { rows: first }, Cell::<Spheres> { rows: third });
        for shift in [[1, 0, 0], [0, 1, -1], [2, -3, 1]] {
            let (one, other) = (now.translation(shift), before.translation(vectors.shift::<Spheres>(shift)));
            assert!((0..3).all(|axis| (one[axis] - other[axis]).abs() < 1e-12), "{one:?} {other:?}");
        }
    }
}
