//! The specimen: committed geometry, kinematics relative to it, and the balance of forces on the current geometry.
//!
//! The reference of a step is the last committed configuration. Cauchy stress is integrated over the current one, and
//! the tangent is its exact derivative; tensors refer to the fixed axes.

use super::linear_solver::Block;
use super::loads::{Loads, degrees_of_freedom};
use super::points::Point;
use crate::element::{GAUSS_POINTS, PointGeometry, point_geometry, shape};
use crate::mesh::{Mesh, POINTS_PER_ELEMENT};
use nalgebra::{Matrix2, Matrix4};

/// Geometry that moves.
#[derive(Clone, Debug)]
pub(super) struct Body {
    mesh: Mesh,
    extent: f64,
    /// Committed displacements since the start, m, by degree of freedom.
    pub(super) displacements: Vec<f64>,
    reference: Vec<PointGeometry>,
}

/// Forces and stiffness of one iterate. Vectors run over all degrees of freedom, N per metre.
#[derive(Clone, Debug)]
pub(super) struct Balance {
    /// Nodal forces of the stresses.
    pub(super) internal: Vec<f64>,
    /// Nodal forces of the loads.
    pub(super) external: Vec<f64>,
    /// Stiffness blocks: elements, then follower loads.
    pub(super) blocks: Vec<Block>,
}

impl Balance {
    /// Out-of-balance force, internal minus external.
    pub(super) fn residual(&self) -> Vec<f64> {
        self.internal.iter().zip(&self.external).map(|(internal, external)| internal - external).collect()
    }

    /// Largest diagonal entry of any block, N/m per metre.
    pub(super) fn largest_diagonal(&self) -> f64 {
        let diagonal = |block: &Block| {
            let width = block.dofs.len();
            (0..width).map(|row| block.matrix[row * width + row].abs()).fold(0.0, f64::max)
        };
        self.blocks.iter().map(diagonal).fold(0.0, f64::max)
    }

    /// `K v` for a vector over all degrees of freedom.
    pub(super) fn stiffness_times(&self, vector: &[f64]) -> Vec<f64> {
        let mut product = vec![0.0; vector.len()];
        for block in &self.blocks {
            let width = block.dofs.len();
            for (row, &target) in block.dofs.iter().enumerate() {
                let entries = &block.matrix[row * width..(row + 1) * width];
                product[target] +=
                    entries.iter().zip(&block.dofs).map(|(entry, &dof)| entry * vector[dof]).sum::<f64>();
            }
        }
        product
    }
}

impl Body {
    /// An undeformed body.
    pub(super) fn new(mesh: Mesh) -> Self {
        let extent = (0..2)
            .map(|axis| {
                let of =
                    |pick: fn(f64, f64) -> f64, start| mesh.nodes.iter().map(|node| node[axis]).fold(start, pick);
                of(f64::max, f64::NEG_INFINITY) - of(f64::min, f64::INFINITY)
            })
            .fold(0.0, f64::max);
        let displacements = vec![0.0; 2 * mesh.nodes.len()];
        let mut body = Self { mesh, extent, displacements, reference: Vec::new() };
        body.reference = body.geometry(&body.zero());
        body
    }

    /// The mesh as given.
    pub(super) fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// Largest initial side, m.
    pub(super) fn extent(&self) -> f64 {
        self.extent
    }

    /// No motion.
    pub(super) fn zero(&self) -> Vec<f64> {
        vec![0.0; self.displacements.len()]
    }

    /// Node positions after `increment` from the committed configuration, m.
    pub(super) fn positions(&self, increment: &[f64]) -> Vec<[f64; 2]> {
        let moved = |node: usize, axis: usize| {
            self.mesh.nodes[node][axis] + (self.displacements[2 * node + axis] + increment[2 * node + axis])
        };
        (0..self.mesh.nodes.len()).map(|node| [moved(node, 0), moved(node, 1)]).collect()
    }

    /// Every point's displacement gradient relative to the committed configuration.
    pub(super) fn gradients(&self, increment: &[f64]) -> Vec<Matrix2<f64>> {
        let of_point = |(number, geometry): (usize, &PointGeometry)| {
            let mut gradient = Matrix2::zeros();
            for (&node, slope) in self.mesh.elements[number / POINTS_PER_ELEMENT].iter().zip(&geometry.gradients) {
                for i in 0..2 {
                    for j in 0..2 {
                        gradient[(i, j)] += increment[2 * node + i] * slope[j];
                    }
                }
            }
            gradient
        };
        self.reference.iter().enumerate().map(of_point).collect()
    }

    /// Geometry of every point after `increment`.
    pub(super) fn geometry(&self, increment: &[f64]) -> Vec<PointGeometry> {
        let positions = self.positions(increment);
        let mut geometry = Vec::with_capacity(self.mesh.elements.len() * POINTS_PER_ELEMENT);
        for nodes in &self.mesh.elements {
            let corners: Vec<[f64; 2]> = nodes.iter().map(|&node| positions[node]).collect();
            geometry.extend((0..POINTS_PER_ELEMENT).map(|local| point_geometry(self.mesh.kind, &corners, local)));
        }
        geometry
    }

    /// Initial and, for given node positions, current place of a point, m.
    pub(super) fn place(&self, point: usize, positions: &[[f64; 2]]) -> [f64; 2] {
        let values = shape(self.mesh.kind, GAUSS_POINTS[point % POINTS_PER_ELEMENT]).values;
        let mut place = [0.0; 2];
        for (&node, value) in self.mesh.elements[point / POINTS_PER_ELEMENT].iter().zip(&values) {
            place[0] += value * positions[node][0];
            place[1] += value * positions[node][1];
        }
        place
    }

    /// The first point whose deformation from the committed configuration, or whose element, is turned inside out.
    pub(super) fn inverted_point(&self, gradients: &[Matrix2<f64>], geometry: &[PointGeometry]) -> Option<usize> {
        // Negated comparisons so that NaN counts as inverted.
        (0..gradients.len()).find(|&point| {
            let determinant = (Matrix2::identity() + gradients[point]).determinant();
            !(determinant > 0.0 && geometry[point].area > 0.0)
        })
    }

    /// Degrees of freedom of all stiffness blocks, in the order of [`Balance::blocks`].
    pub(super) fn block_dofs(&self, loads: &Loads) -> Vec<Vec<usize>> {
        self.mesh.elements.iter().map(|nodes| degrees_of_freedom(nodes)).chain(loads.block_dofs()).collect()
    }

    /// Balance after `increment` at a load factor, from the points' latest stresses and moduli.
    pub(super) fn balance(&self, increment: &[f64], points: &[Point], loads: &Loads, load: f64) -> Balance {
        let geometry = self.geometry(increment);
        let mut internal = self.zero();
        let mut blocks = Vec::with_capacity(self.mesh.elements.len());
        for (element, nodes) in self.mesh.elements.iter().enumerate() {
            let mut block = Block::zero(degrees_of_freedom(nodes));
            let first = element * POINTS_PER_ELEMENT;
            for number in first..first + POINTS_PER_ELEMENT {
                add_force(&geometry[number], nodes, &points[number].stress, &mut internal);
                add_stiffness(&geometry[number], nodes.len(), &points[number].moduli, &mut block);
            }
            blocks.push(block);
        }
        blocks.extend(loads.stiffness());
        Balance { internal, external: loads.force(&self.positions(increment), load), blocks }
    }

    /// Makes the configuration after `increment` the reference of the next step.
    pub(super) fn commit(&mut self, increment: &[f64]) {
        for (displacement, change) in self.displacements.iter_mut().zip(increment) {
            *displacement += change;
        }
        self.settle();
    }

    /// Makes the configuration of the displacements the reference of the next step.
    pub(super) fn settle(&mut self) {
        self.reference = self.geometry(&self.zero());
    }
}

/// Adds `f_ai = sigma_ij dN_a/dx_j dv`.
fn add_force(geometry: &PointGeometry, nodes: &[usize], stress: &Matrix2<f64>, force: &mut [f64]) {
    for (&node, slope) in nodes.iter().zip(&geometry.gradients) {
        for i in 0..2 {
            force[2 * node + i] += geometry.area * (stress[(i, 0)] * slope[0] + stress[(i, 1)] * slope[1]);
        }
    }
}

/// Adds `K_aibk = dN_a/dx_j A_ijkl dN_b/dx_l dv`.
fn add_stiffness(geometry: &PointGeometry, nodes: usize, moduli: &Matrix4<f64>, block: &mut Block) {
    let width = 2 * nodes;
    for b in 0..nodes {
        for k in 0..2 {
            let slope = &geometry.gradients[b];
            let change = moduli.column(2 * k) * slope[0] + moduli.column(2 * k + 1) * slope[1];
            for a in 0..nodes {
                let test = &geometry.gradients[a];
                for i in 0..2 {
                    block.matrix[(2 * a + i) * width + 2 * b + k] +=
                        geometry.area * (test[0] * change[2 * i] + test[1] * change[2 * i + 1]);
                }
            }
        }
    }
}
