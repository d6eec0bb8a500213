//! A fixed number of components that are added and scaled alike.

use bytemuck::Pod;
use std::fmt::Debug;

/// A number or an array of numbers.
pub trait Components: Copy + Debug + Default + PartialEq + Pod + Send + Sync + 'static {
    /// Number of components.
    const COUNT: usize;

    /// All components zero.
    const ZERO: Self;

    /// The value whose components the function gives.
    fn from_fn(component: impl FnMut(usize) -> f64) -> Self;

    /// The components in order.
    fn components(&self) -> &[f64];

    /// The components in order, to be changed.
    fn components_mut(&mut self) -> &mut [f64];

    /// Component-wise sum.
    #[must_use]
    fn plus(self, other: Self) -> Self {
        let (a, b) = (self.components(), other.components());
        Self::from_fn(|place| a[place] + b[place])
    }

    /// Component-wise difference.
    #[must_use]
    fn minus(self, other: Self) -> Self {
        let (a, b) = (self.components(), other.components());
        Self::from_fn(|place| a[place] - b[place])
    }

    /// Every component times `factor`.
    #[must_use]
    fn times(self, factor: f64) -> Self {
        let a = self.components();
        Self::from_fn(|place| a[place] * factor)
    }

    /// Sum of products of components, in order.
    fn dot(self, other: Self) -> f64 {
        let (a, b) = (self.components(), other.components());
        let mut sum = a[0] * b[0];
        for place in 1..Self::COUNT {
            sum += a[place] * b[place];
        }
        sum
    }

    /// Euclidean norm.
    fn norm(self) -> f64 {
        self.dot(self).sqrt()
    }

    /// Whether every component is a finite number.
    fn is_finite(self) -> bool {
        self.components().iter().all(|value| value.is_finite())
    }
}

impl Components for f64 {
    const COUNT: usize = 1;
    const ZERO: Self = 0.0;

    fn from_fn(mut component: impl FnMut(usize) -> f64) -> Self {
        component(0)
    }

    fn components(&self) -> &[f64] {
        std::slice::from_ref(self)
    }

    fn components_mut(&mut self) -> &mut [f64] {
        std::slice::from_mut(self)
    }

    fn norm(self) -> f64 {
        self.abs()
    }
}

/// Neither `Default` nor `Pod` is known of arrays of any length.
macro_rules! array {
    ($count:literal) => {
        impl Components for [f64; $count] {
            const COUNT: usize = $count;
            const ZERO: Self = [0.0; $count];

            fn from_fn(component: impl FnMut(usize) -> f64) -> Self {
                std::array::from_fn(component)
            }

            fn components(&self) -> &[f64] {
                self
            }

            fn components_mut(&mut self) -> &mut [f64] {
                self
            }
        }
    };
}

array!(2);
array!(3);
