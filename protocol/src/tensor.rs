//! Full second- and fourth-order tensors with a fixed memory layout.

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

/// A 3x3 tensor, row-major. Plane problems use the upper left 2x2 block.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, Serialize, Deserialize)]
#[repr(transparent)]
pub struct Tensor2(pub [f64; 9]);

impl Tensor2 {
    /// All components zero.
    pub const ZERO: Self = Self([0.0; 9]);

    /// The unit tensor.
    pub const IDENTITY: Self = Self([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);

    /// Embeds the plane tensor `[[xx, xy], [yx, yy]]`.
    pub fn from_plane(plane: [[f64; 2]; 2]) -> Self {
        let mut full = Self::ZERO;
        for (i, row) in plane.iter().enumerate() {
            full.0[3 * i..3 * i + 2].copy_from_slice(row);
        }
        full
    }

    /// The tensor with these rows.
    pub fn from_rows(rows: &[[f64; 3]; 3]) -> Self {
        Self(std::array::from_fn(|place| rows[place / 3][place % 3]))
    }

    /// The upper left 2x2 block `[[xx, xy], [yx, yy]]`.
    pub fn plane(&self) -> [[f64; 2]; 2] {
        [[self.0[0], self.0[1]], [self.0[3], self.0[4]]]
    }

    /// Component `ij`, both counted from 0.
    pub fn get(&self, i: usize, j: usize) -> f64 {
        self.0[3 * i + j]
    }

    /// Whether every component is a finite number.
    pub fn is_finite(&self) -> bool {
        self.0.iter().all(|component| component.is_finite())
    }
}

/// A 9x9 operator `C_ijkl = d sigma_ij / d F_kl`, row-major in `(ij, kl)`, each pair numbered `3 i + j`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(transparent)]
pub struct Tensor4(pub [f64; 81]);

impl Tensor4 {
    /// All components zero.
    pub const ZERO: Self = Self([0.0; 81]);

    /// Component `ijkl`, each counted from 0.
    pub fn get(&self, i: usize, j: usize, k: usize, l: usize) -> f64 {
        self.0[9 * (3 * i + j) + 3 * k + l]
    }

    /// Sets component `ijkl`, each counted from 0.
    pub fn set(&mut self, i: usize, j: usize, k: usize, l: usize, value: f64) {
        self.0[9 * (3 * i + j) + 3 * k + l] = value;
    }

    /// The plane operator as `[ij][kl]` with pairs ordered 11, 12, 21, 22.
    pub fn plane(&self) -> [[f64; 4]; 4] {
        let mut block = [[0.0; 4]; 4];
        for (row, block_row) in block.iter_mut().enumerate() {
            for (column, value) in block_row.iter_mut().enumerate() {
                *value = self.get(row / 2, row % 2, column / 2, column % 2);
            }
        }
        block
    }

    /// Embeds a plane operator given as `[ij][kl]` with pairs ordered 11, 12, 21, 22.
    pub fn from_plane(block: [[f64; 4]; 4]) -> Self {
        let mut full = Self::ZERO;
        for (row, block_row) in block.iter().enumerate() {
            for (column, value) in block_row.iter().enumerate() {
                full.set(row / 2, row % 2, column / 2, column % 2, *value);
            }
        }
        full
    }

    /// Whether every component is a finite number.
    pub fn is_finite(&self) -> bool {
        self.0.iter().all(|component| component.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plane_block_survives_embedding() {
        let plane = [[1.0, 2.0], [3.0, 4.0]];
        assert_eq!(Tensor2::from_plane(plane).plane(), plane);
        let mut block = [[0.0; 4]; 4];
        for (row, values) in block.iter_mut().enumerate() {
            for (column, value) in values.iter_mut().enumerate() {
                *value = (10 * row + column) as f64;
            }
        }
        let full = Tensor4::from_plane(block);
        assert_eq!(full.plane(), block);
        assert_eq!(full.get(0, 1, 1, 0), 12.0);
    }

    #[test]
    fn one_bad_component_is_seen() {
        let mut tensor = Tensor2::IDENTITY;
        assert!(tensor.is_finite());
        tensor.0[4] = f64::NAN;
        assert!(!tensor.is_finite());
    }
}
