//! Sums, products and sizes of vectors over degrees of freedom and of gradients over points, in the order of these: the same bits on every machine.

use nalgebra::Matrix3;

/// Scalar product.
pub(super) fn dot(one: &[f64], other: &[f64]) -> f64 {
    one.iter().zip(other).map(|(one, other)| one * other).sum()
}

/// Euclidean norm, summed in order.
pub(super) fn norm(vector: &[f64]) -> f64 {
    vector.iter().map(|value| value * value).sum::<f64>().sqrt()
}

/// Sum of two vectors.
pub(super) fn sum(first: &[f64], second: &[f64]) -> Vec<f64> {
    first.iter().zip(second).map(|(first, second)| first + second).collect()
}

/// First vector less the second.
pub(super) fn difference(first: &[f64], second: &[f64]) -> Vec<f64> {
    first.iter().zip(second).map(|(first, second)| first - second).collect()
}

/// Adds a multiple of a vector.
pub(super) fn add(into: &mut [f64], share: f64, what: &[f64]) {
    for (value, what) in into.iter_mut().zip(what) {
        *value += share * what;
    }
}

/// Largest component of any of the displacement gradients.
pub(super) fn largest_component(gradients: &[Matrix3<f64>]) -> f64 {
    gradients.iter().map(Matrix3::amax).fold(0.0, f64::max)
}
