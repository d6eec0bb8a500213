//! Shape functions at one place.

/// Nodes of the largest element; arrays of smaller elements are padded with zeros.
pub const MAX_NODES: usize = 20;

/// Shape functions at one place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// Values, dimensionless.
    pub values: [f64; MAX_NODES],
    /// Derivatives with respect to the natural coordinates; the third one is 0 in the plane.
    pub gradients: [[f64; 3]; MAX_NODES],
}

impl Shape {
    /// No nodes yet.
    pub(crate) const EMPTY: Self = Self { values: [0.0; MAX_NODES], gradients: [[0.0; 3]; MAX_NODES] };

    /// Sets one node's function.
    pub(crate) fn set(&mut self, node: usize, value: f64, gradient: [f64; 3]) {
        self.values[node] = value;
        self.gradients[node] = gradient;
    }
}
