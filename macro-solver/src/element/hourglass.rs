//! Control of the modes that one Gauss point does not see, after Flanagan and Belytschko (1981).
//!
//! The hourglass vectors `gamma_a` of an element with one point are orthogonal to constant and linear fields, so their
//! amplitudes `q_i = gamma_a x_ai` vanish in every affine motion, finite rotations included. Taken on the initial
//! geometry and applied to the total motion they need no integration in time: the stiffness form is a quadratic
//! potential, symmetric, path-independent and objective.

pub(crate) use super::hourglass_keys::HourglassKeys;
use super::{Dimension, ElementKind, point_geometry};
use serde::{Deserialize, Serialize};

/// Nodes of the largest element with one point and hourglass modes.
pub const MAX_HOURGLASS_NODES: usize = 8;

/// How hourglass modes are held.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "HourglassKeys", into = "HourglassKeys")]
pub enum HourglassControl {
    /// By springs: `Q = c (3 G / d) V (b . b) q` with the shear modulus `G` and the coefficient `c`. At a Poisson's ratio
    /// of 1/4 this is the published form with the P-wave modulus, which would lock near incompressibility.
    Stiffness {
        /// `c`, dimensionless; 0.05 is usual. About 0.2 to 0.3 has the bending stiffness of full integration.
        coefficient: f64,
    },
    /// By dashpots at the fraction `e` of the critical damping of springs with coefficient 1. Only for dynamics.
    Viscous {
        /// `e`, dimensionless.
        coefficient: f64,
    },
}

impl Default for HourglassControl {
    fn default() -> Self {
        Self::Stiffness { coefficient: 0.05 }
    }
}

impl HourglassControl {
    /// Its number.
    pub fn coefficient(self) -> f64 {
        match self {
            Self::Stiffness { coefficient } | Self::Viscous { coefficient } => coefficient,
        }
    }
}

/// Hourglass modes of one element.
#[derive(Clone, Debug, PartialEq)]
pub struct HourglassModes {
    /// `gamma_a`, normalised so that they are orthonormal on a parallelepiped: one row per mode.
    pub vectors: Vec<[f64; MAX_HOURGLASS_NODES]>,
    /// Initial volume, m3, in the plane per metre of thickness.
    pub volume: f64,
    /// `V b_ai b_ai / d` with the gradients `b` at the point and `d` dimensions, m (1 in the plane).
    pub scale: f64,
    nodes: usize,
}

/// Signs of the hourglass modes at the corners: products of two natural coordinates, in space also of all three.
fn sign_patterns(dimension: Dimension) -> Vec<fn(&[f64; 3]) -> f64> {
    match dimension {
        Dimension::Plane => vec![|p| p[0] * p[1]],
        Dimension::Space => {
            vec![|p| p[1] * p[2], |p| p[2] * p[0], |p| p[0] * p[1], |p| p[0] * p[1] * p[2]]
        }
    }
}

impl HourglassModes {
    /// Of an element at its initial positions; `None` for kinds without hourglass modes.
    pub fn new(kind: ElementKind, positions: &[[f64; 3]]) -> Option<Self> {
        if !kind.needs_hourglass_control() {
            return None;
        }
        let geometry = point_geometry(kind, positions, 0);
        let volume = geometry.volume;
        let (nodes, dimension) = (kind.node_count(), kind.dimension().count());
        let places = super::node_places(kind);
        let vectors = sign_patterns(kind.dimension()).into_iter().map(|sign| {
            let signs: Vec<f64> = places.iter().map(sign).collect();
            let moments: [f64; 3] =
                std::array::from_fn(|i| signs.iter().zip(positions).map(|(sign, x)| sign * x[i]).sum());
            let mut vector = [0.0; MAX_HOURGLASS_NODES];
            for (node, entry) in vector.iter_mut().enumerate().take(nodes) {
                let linear: f64 = (0..3).map(|i| moments[i] * geometry.gradients[node][i]).sum();
                *entry = (signs[node] - linear) / (nodes as f64).sqrt();
            }
            vector
        });
        let squares: f64 = geometry.gradients.iter().flatten().map(|slope| slope * slope).sum();
        Some(Self { vectors: vectors.collect(), volume, scale: volume * squares / dimension as f64, nodes })
    }

    /// Stiffness of every mode for a shear modulus, Pa: N/m, in the plane per metre.
    pub fn stiffness(&self, coefficient: f64, shear: f64) -> f64 {
        3.0 * coefficient * shear * self.scale
    }

    /// Viscosity of every mode, N s/m, in the plane per metre: `coefficient` times the critical damping `2 sqrt(k m)`
    /// of the modes with `k` of coefficient 1 and the mass per node `m`. Density in kg/m3, shear modulus in Pa.
    pub fn viscosity(&self, coefficient: f64, shear: f64, density: f64) -> f64 {
        2.0 * coefficient * (self.stiffness(1.0, shear) * density * self.volume / self.nodes as f64).sqrt()
    }

    /// Amplitudes `gamma_a v_ai` of a nodal field: positions, displacements or velocities.
    pub fn amplitudes(&self, field: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let amplitude = |vector: &[f64; MAX_HOURGLASS_NODES]| {
            std::array::from_fn(|i| vector.iter().zip(field).map(|(entry, value)| entry * value[i]).sum())
        };
        self.vectors.iter().map(amplitude).collect()
    }

    /// Nodal forces that resist amplitudes, `factor gamma_a q_i`: with the stiffness and amplitudes of displacements, or
    /// the viscosity and amplitudes of velocities, N. Added to `force` as [`super::integrals::add_force`] does.
    pub fn add_force(&self, dimension: usize, factor: f64, amplitudes: &[[f64; 3]], force: &mut [f64]) {
        for (vector, amplitude) in self.vectors.iter().zip(amplitudes) {
            for node in 0..self.nodes {
                for i in 0..dimension {
                    force[dimension * node + i] += factor * vector[node] * amplitude[i];
                }
            }
        }
    }

    /// Energy of the springs, J, in the plane per metre.
    pub fn energy(&self, stiffness: f64, amplitudes: &[[f64; 3]]) -> f64 {
        0.5 * stiffness * amplitudes.iter().flatten().map(|amplitude| amplitude * amplitude).sum::<f64>()
    }

    /// Adds the derivative of [`HourglassModes::add_force`] with the nodal field to an element matrix: row-major and square, with
    /// `dimension` rows for each node. `factor` is the stiffness of the modes, N/m, in the plane per metre of thickness.
    pub fn add_stiffness(&self, dimension: usize, factor: f64, matrix: &mut [f64]) {
        let width = dimension * self.nodes;
        for vector in &self.vectors {
            for a in 0..self.nodes {
                for b in 0..self.nodes {
                    let entry = factor * vector[a] * vector[b];
                    for i in 0..dimension {
                        matrix[(dimension * a + i) * width + dimension * b + i] += entry;
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::node_places;

    fn bent(kind: ElementKind) -> Vec<[f64; 3]> {
        let lift = if kind.dimension() == Dimension::Plane { 0.0 } else { 1.0 };
        let moved = |&[x, y, z]: &[f64; 3]| {
            [1.1 * x + 0.1 * x * y + 0.05 * y * z, 0.9 * y - 0.08 * x * y, lift * (1.2 * z + 0.07 * x * z - 0.1 * y)]
        };
        node_places(kind).iter().map(moved).collect()
    }

    /// H-2 for one element: any affine motion, a quarter turn included, has no hourglass amplitude.
    #[test]
    fn affine_motions_of_irregular_elements_have_no_amplitude() {
        for kind in [ElementKind::Q4Single, ElementKind::H8Single] {
            let positions = bent(kind);
            let modes = HourglassModes::new(kind, &positions).unwrap();
            assert_eq!(modes.vectors.len(), if kind == ElementKind::Q4Single { 1 } else { 4 });
            let turned: Vec<[f64; 3]> = positions.iter().map(|&[x, y, z]| [-y + 3.0, x + 0.2 * y, 1.5 * z]).collect();
            let largest = modes.amplitudes(&turned).iter().flatten().fold(0.0, |a: f64, b| a.max(b.abs()));
            assert!(largest < 1e-14, "{kind:?}: {largest:e}");
        }
        assert_eq!(HourglassModes::new(ElementKind::H8, &bent(ElementKind::H8)), None);
    }

    #[test]
    fn force_is_the_derivative_of_the_energy_and_stiffness_that_of_the_force() {
        let kind = ElementKind::H8Single;
        let modes = HourglassModes::new(kind, &bent(kind)).unwrap();
        let field: Vec<[f64; 3]> =
            (0..8).map(|node| std::array::from_fn(|i| (1.3 * node as f64 + i as f64).sin())).collect();
        let force_at = |field: &[[f64; 3]]| {
            let mut force = vec![0.0; 24];
            modes.add_force(3, 7.0, &modes.amplitudes(field), &mut force);
            force
        };
        let mut matrix = vec![0.0; 24 * 24];
        modes.add_stiffness(3, 7.0, &mut matrix);
        let force = force_at(&field);
        let work: f64 = force.iter().zip(field.as_flattened()).map(|(force, value)| force * value).sum();
        assert!((0.5 * work - modes.energy(7.0, &modes.amplitudes(&field))).abs() < 1e-12);
        for row in 0..24 {
            let product: f64 = (0..24).map(|column| matrix[24 * row + column] * field.as_flattened()[column]).sum();
            assert!((product - force[row]).abs() < 1e-13);
        }
    }

    /// The viscosity is a fraction of critical damping: `c^2 = 4 e^2 k m`.
    #[test]
    fn viscosity_is_a_fraction_of_critical_damping() {
        let kind = ElementKind::Q4Single;
        let modes = HourglassModes::new(kind, &bent(kind)).unwrap();
        let (viscosity, stiffness) = (modes.viscosity(0.1, 5e6, 2000.0), modes.stiffness(1.0, 5e6));
        let mass = 2000.0 * modes.volume / 4.0;
        assert!((viscosity * viscosity / (0.04 * stiffness * mass) - 1.0).abs() < 1e-14);
    }
}
