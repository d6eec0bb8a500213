//! Shape functions, Gauss points and geometry of elements and their sides.
//!
//! Natural coordinates of quadrilaterals and hexahedra run from -1 to 1, those of triangles and tetrahedra from 0 to 1.
//! Node order is that of [`ElementKind`]. A plane element is treated as a slab of unit thickness: its third natural
//! coordinate is `z`, and nothing depends on it.

use kinds::SinglePoint;
use nalgebra::Matrix3;

mod dimension;
pub mod frequency;
pub mod hourglass;
mod hourglass_keys;
pub mod integrals;
mod kinds;
pub mod mass;
pub mod quadrature;
mod shape;
pub mod side;
mod tabulated;

pub use dimension::Dimension;
pub use kinds::{ElementKind, SideKind};
pub use quadrature::GaussPoint;
pub use shape::{MAX_NODES, Shape};
pub use tabulated::{gauss_points, shape, shapes_at_points};

/// Natural coordinates of the nodes of an element kind.
pub fn node_places(kind: ElementKind) -> &'static [[f64; 3]] {
    kind.interpolation().places
}

/// Gradients in space and the volume that a Gauss point stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointGeometry {
    /// Derivatives of the shape functions with respect to position, 1/m.
    pub gradients: [[f64; 3]; MAX_NODES],
    /// Weight times Jacobian determinant, m3; m2 per metre of thickness in the plane. Not positive where the element
    /// is inverted; gradients are then meaningless.
    pub volume: f64,
}

impl PointGeometry {
    /// The same point after its nodes have moved from the positions of this geometry to `positions`: gradients and
    /// volume carried by the deformation gradient of the point, `b = B F^-1`, `v = V det F`. Gradients are meaningless
    /// where the volume is not positive.
    pub fn carried(&self, positions: &[[f64; 3]], dimension: Dimension) -> Self {
        let mut deformation: Matrix3<f64> = Matrix3::zeros();
        for (position, gradient) in positions.iter().zip(&self.gradients) {
            for i in 0..3 {
                for j in 0..3 {
                    deformation[(i, j)] += position[i] * gradient[j];
                }
            }
        }
        if dimension == Dimension::Plane {
            deformation[(2, 2)] = 1.0;
        }
        let mut carried = *self;
        carried.volume *= deformation.determinant();
        if let Some(inverse) = deformation.try_inverse() {
            for (new, old) in carried.gradients.iter_mut().zip(&self.gradients).take(positions.len()) {
                *new = std::array::from_fn(|j| (0..3).map(|i| old[i] * inverse[(i, j)]).sum());
            }
        }
        carried
    }
}

/// Geometry of Gauss point `local` of an element whose nodes lie at `positions`.
pub fn point_geometry(kind: ElementKind, positions: &[[f64; 3]], local: usize) -> PointGeometry {
    if let Some(SinglePoint::MeanOver(kind)) = kind.definition().single_point {
        return mean_geometry(kind, positions);
    }
    let weight = gauss_points(kind)[local].weight;
    let mut geometry = geometry_of_shape(kind, &shapes_at_points(kind)[local], positions);
    geometry.volume *= weight;
    geometry
}

/// Mean gradients and total volume over the points of `kind`; exact for hexahedra with 2x2x2 points.
fn mean_geometry(kind: ElementKind, positions: &[[f64; 3]]) -> PointGeometry {
    let mut mean = PointGeometry { gradients: [[0.0; 3]; MAX_NODES], volume: 0.0 };
    let points: Vec<PointGeometry> =
        (0..kind.point_count()).map(|local| point_geometry(kind, positions, local)).collect();
    mean.volume = points.iter().map(|point| point.volume).sum();
    for point in &points {
        let share = point.volume / mean.volume;
        for (sum, gradient) in mean.gradients.iter_mut().zip(&point.gradients) {
            (0..3).for_each(|i| sum[i] += share * gradient[i]);
        }
    }
    mean
}

/// Geometry for given shape functions; the volume is the Jacobian determinant alone.
pub fn geometry_of_shape(kind: ElementKind, shape: &Shape, positions: &[[f64; 3]]) -> PointGeometry {
    let mut jacobian: Matrix3<f64> = Matrix3::zeros();
    for (position, gradient) in positions.iter().zip(&shape.gradients) {
        for i in 0..3 {
            for j in 0..3 {
                jacobian[(i, j)] += position[i] * gradient[j];
            }
        }
    }
    if kind.dimension() == Dimension::Plane {
        jacobian[(2, 2)] = 1.0;
    }
    let volume = jacobian.determinant();
    let mut gradients = [[0.0; 3]; MAX_NODES];
    if let Some(inverse) = jacobian.try_inverse() {
        for (spatial, natural) in gradients.iter_mut().zip(&shape.gradients).take(positions.len()) {
            for (j, component) in spatial.iter_mut().enumerate() {
                *component =
                    natural[0] * inverse[(0, j)] + natural[1] * inverse[(1, j)] + natural[2] * inverse[(2, j)];
            }
        }
    }
    PointGeometry { gradients, volume }
}

#[cfg(test)]
mod tests;
