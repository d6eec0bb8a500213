//! Second-order tensors of two and three dimensions, row-major, and the few operations that grains need.

use super::components::Components;
use std::fmt::Debug;
use std::ops::{Index, IndexMut};

/// `[[f64; 2]; 2]` or `[[f64; 3]; 3]`.
pub trait Tensor:
    Copy + Debug + Default + PartialEq + Send + Sync + 'static + IndexMut<usize> + Index<usize, Output = Self::Vector>
{
    /// A row.
    type Vector: Components + Index<usize, Output = f64> + IndexMut<usize>;

    /// Number of rows.
    const DIMENSION: usize;

    /// All components zero.
    const ZERO: Self;

    /// The unit tensor.
    const IDENTITY: Self;

    /// The tensor whose components `ij` the function gives.
    fn from_fn(component: impl FnMut(usize, usize) -> f64) -> Self;

    /// Determinant.
    fn determinant(&self) -> f64;

    /// Inverse; the caller knows that the determinant is not zero.
    fn inverse(&self) -> Self;

    /// The components, row by row.
    fn components(&self) -> impl Iterator<Item = f64> {
        let tensor = *self;
        (0..Self::DIMENSION * Self::DIMENSION).map(move |k| tensor[k / Self::DIMENSION][k % Self::DIMENSION])
    }
}

impl Tensor for [[f64; 2]; 2] {
    type Vector = [f64; 2];
    const DIMENSION: usize = 2;
    const ZERO: Self = [[0.0; 2]; 2];
    const IDENTITY: Self = [[1.0, 0.0], [0.0, 1.0]];

    fn from_fn(mut component: impl FnMut(usize, usize) -> f64) -> Self {
        std::array::from_fn(|i| std::array::from_fn(|j| component(i, j)))
    }

    fn determinant(&self) -> f64 {
        self[0][0] * self[1][1] - self[0][1] * self[1][0]
    }

    fn inverse(&self) -> Self {
        let scale = 1.0 / self.determinant();
        [[self[1][1] * scale, -self[0][1] * scale], [-self[1][0] * scale, self[0][0] * scale]]
    }
}

impl Tensor for [[f64; 3]; 3] {
    type Vector = [f64; 3];
    const DIMENSION: usize = 3;
    const ZERO: Self = [[0.0; 3]; 3];
    const IDENTITY: Self = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    fn from_fn(mut component: impl FnMut(usize, usize) -> f64) -> Self {
        std::array::from_fn(|i| std::array::from_fn(|j| component(i, j)))
    }

    fn determinant(&self) -> f64 {
        self[0].dot(cross(self[1], self[2]))
    }

    fn inverse(&self) -> Self {
        let scale = 1.0 / self.determinant();
        let rows = [cross(self[1], self[2]), cross(self[2], self[0]), cross(self[0], self[1])];
        Self::from_fn(|i, j| rows[j][i] * scale)
    }
}

/// Vector product.
pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Determinant.
pub fn determinant<T: Tensor>(a: &T) -> f64 {
    a.determinant()
}

/// Inverse; the caller knows that the determinant is not zero.
pub fn inverse<T: Tensor>(a: &T) -> T {
    a.inverse()
}

/// Matrix product `a b`.
pub fn product<T: Tensor>(a: &T, b: &T) -> T {
    T::from_fn(|i, j| {
        let mut sum = a[i][0] * b[0][j];
        for k in 1..T::DIMENSION {
            sum += a[i][k] * b[k][j];
        }
        sum
    })
}

/// Transpose.
pub fn transpose<T: Tensor>(a: &T) -> T {
    T::from_fn(|i, j| a[j][i])
}

/// Matrix times column vector.
pub fn apply<T: Tensor>(a: &T, v: T::Vector) -> T::Vector {
    T::Vector::from_fn(|i| a[i].dot(v))
}

/// Component-wise sum `a + scale b`.
pub fn add_scaled<T: Tensor>(a: &T, scale: f64, b: &T) -> T {
    T::from_fn(|i, j| a[i][j] + scale * b[i][j])
}

/// Component-wise product `scale a`.
pub fn scaled<T: Tensor>(a: &T, scale: f64) -> T {
    T::from_fn(|i, j| a[i][j] * scale)
}

/// Largest absolute component.
pub fn largest_component<T: Tensor>(a: &T) -> f64 {
    a.components().fold(0.0, |largest: f64, value| largest.max(value.abs()))
}

/// Frobenius norm.
pub fn norm<T: Tensor>(a: &T) -> f64 {
    a.components().map(|value| value * value).sum::<f64>().sqrt()
}

/// `R a R^T` for a rotation `R`.
pub fn rotated<T: Tensor>(a: &T, rotation: &T) -> T {
    product(&product(rotation, a), &transpose(rotation))
}
