//! The specimen: committed geometry, kinematics relative to it, and the balance of forces.
//!
//! Which configuration gradients refer to and which one stresses are integrated on is the formulation's choice; the
//! tangent is the exact derivative of the forces. Tensors refer to the fixed axes.

use super::linear_solver::Block;
use super::loads::{Loads, degrees_of_freedom};
use super::points::Point;
use crate::element::hourglass::{HourglassControl, HourglassModes};
use crate::element::integrals::{add_force, add_stiffness};
use crate::element::{PointGeometry, point_geometry, shapes_at_points};
use crate::formulation::{Configuration, Formulation};
use crate::mesh::Mesh;
use nalgebra::Matrix3;
use rayon::prelude::*;

/// Geometry that moves.
#[derive(Clone, Debug)]
pub(super) struct Body {
    mesh: Mesh,
    formulation: Formulation,
    /// Element of every point.
    elements: Vec<usize>,
    first_points: Vec<usize>,
    extent: f64,
    /// Committed displacements since the start, m, by degree of freedom.
    pub(super) displacements: Vec<f64>,
    /// Modes to hold, for the elements that have some.
    hourglass: Vec<Option<HourglassModes>>,
    hourglass_coefficient: f64,
    initial: Vec<PointGeometry>,
    /// Of the configuration that step gradients refer to; the initial one when empty.
    committed: Vec<PointGeometry>,
}

/// Forces and stiffness of one iterate. Vectors run over all degrees of freedom; N, in the plane per metre.
#[derive(Clone, Debug)]
pub(super) struct Balance {
    /// Nodal forces of the stresses.
    pub(super) internal: Vec<f64>,
    /// Nodal forces of the loads.
    pub(super) external: Vec<f64>,
    /// Stiffness blocks: elements, then follower loads.
    pub(super) blocks: Vec<Block>,
    /// Energy of the hourglass control, J, in the plane per metre.
    pub(super) hourglass_energy: f64,
}

/// Contribution of one element.
struct Part {
    block: Block,
    force: Vec<f64>,
    hourglass_energy: f64,
}

impl Balance {
    /// Out-of-balance force, internal minus external.
    pub(super) fn residual(&self) -> Vec<f64> {
        self.internal.iter().zip(&self.external).map(|(internal, external)| internal - external).collect()
    }

    /// Largest diagonal entry of any block, N/m, in the plane per metre.
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
    pub(super) fn new(mesh: Mesh, formulation: Formulation, hourglass: HourglassControl) -> Self {
        let extent = (0..3)
            .map(|axis| {
                let of =
                    |pick: fn(f64, f64) -> f64, start| mesh.nodes.iter().map(|node| node[axis]).fold(start, pick);
                of(f64::max, f64::NEG_INFINITY) - of(f64::min, f64::INFINITY)
            })
            .fold(0.0, f64::max);
        let displacements = vec![0.0; mesh.degrees_of_freedom()];
        let first_points = mesh.first_points();
        let elements = mesh
            .kinds
            .iter()
            .enumerate()
            .flat_map(|(element, kind)| std::iter::repeat_n(element, kind.point_count()))
            .collect();
        let modes = (0..mesh.elements.len())
            .map(|element| HourglassModes::new(mesh.kinds[element], &mesh.element_positions(element)))
            .collect();
        let mut body = Self {
            mesh,
            formulation,
            elements,
            first_points,
            extent,
            displacements,
            hourglass: modes,
            hourglass_coefficient: hourglass.coefficient(),
            initial: Vec::new(),
            committed: Vec::new(),
        };
        body.initial = body.geometry_at(&body.mesh.nodes);
        body
    }

    /// The mesh as given.
    pub(super) fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// Element of a point.
    pub(super) fn element_of(&self, point: usize) -> usize {
        self.elements[point]
    }

    /// Number of a point within its element.
    pub(super) fn local_number(&self, point: usize) -> usize {
        point - self.first_points[self.elements[point]]
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
    pub(super) fn positions(&self, increment: &[f64]) -> Vec<[f64; 3]> {
        let dimension = self.mesh.dimension.count();
        let mut positions = self.mesh.nodes.clone();
        for (node, position) in positions.iter_mut().enumerate() {
            for (axis, coordinate) in position.iter_mut().enumerate().take(dimension) {
                let dof = dimension * node + axis;
                *coordinate += self.displacements[dof] + increment[dof];
            }
        }
        positions
    }

    /// Every point's displacement gradient relative to the formulation's reference.
    pub(super) fn gradients(&self, increment: &[f64]) -> Vec<Matrix3<f64>> {
        let dimension = self.mesh.dimension.count();
        let reference = if self.committed.is_empty() { &self.initial } else { &self.committed };
        let of_point = |(&element, geometry): (&usize, &PointGeometry)| {
            let mut gradient = Matrix3::zeros();
            for (&node, slope) in self.mesh.elements[element].iter().zip(&geometry.gradients) {
                for i in 0..dimension {
                    for j in 0..dimension {
                        gradient[(i, j)] += increment[dimension * node + i] * slope[j];
                    }
                }
            }
            gradient
        };
        self.elements.iter().zip(reference).map(of_point).collect()
    }

    /// Geometry of every point after `increment`.
    pub(super) fn geometry(&self, increment: &[f64]) -> Vec<PointGeometry> {
        self.geometry_at(&self.positions(increment))
    }

    fn geometry_at(&self, positions: &[[f64; 3]]) -> Vec<PointGeometry> {
        let mut geometry = Vec::with_capacity(self.elements.len());
        let mut nodes_at = Vec::new();
        for (element, (nodes, &kind)) in self.mesh.elements.iter().zip(&self.mesh.kinds).enumerate() {
            nodes_at.clear();
            nodes_at.extend(nodes.iter().map(|&node| positions[node]));
            if let Some(initial) = self.initial.get(self.first_points[element])
                && kind.needs_hourglass_control()
            {
                // Mean gradients are taken once and carried along: only so are the forces those of a potential.
                geometry.push(initial.carried(&nodes_at, self.mesh.dimension));
                continue;
            }
            geometry.extend((0..kind.point_count()).map(|local| point_geometry(kind, &nodes_at, local)));
        }
        geometry
    }

    /// Place of a point for given node positions, m.
    pub(super) fn place(&self, point: usize, positions: &[[f64; 3]]) -> [f64; 3] {
        let element = self.elements[point];
        let values = shapes_at_points(self.mesh.kinds[element])[self.local_number(point)].values;
        let mut place = [0.0; 3];
        for (&node, value) in self.mesh.elements[element].iter().zip(&values) {
            (0..3).for_each(|axis| place[axis] += value * positions[node][axis]);
        }
        place
    }

    /// The first point whose deformation from the committed configuration, or whose element, is turned inside out.
    pub(super) fn inverted_point(&self, gradients: &[Matrix3<f64>], geometry: &[PointGeometry]) -> Option<usize> {
        // Negated comparisons so that NaN counts as inverted.
        (0..gradients.len()).find(|&point| {
            let determinant = (Matrix3::identity() + gradients[point]).determinant();
            !(determinant > 0.0 && geometry[point].volume > 0.0)
        })
    }

    /// Degrees of freedom of all stiffness blocks, in the order of [`Balance::blocks`].
    pub(super) fn block_dofs(&self, loads: &Loads) -> Vec<Vec<usize>> {
        let dimension = self.mesh.dimension.count();
        let elements = self.mesh.elements.iter().map(|nodes| degrees_of_freedom(dimension, nodes));
        elements.chain(loads.block_dofs()).collect()
    }

    /// Balance after `increment` at a load factor, from the points' latest stresses and moduli.
    pub(super) fn balance(&self, increment: &[f64], points: &[Point], loads: &Loads, load: f64) -> Balance {
        let positions = self.positions(increment);
        let current;
        let geometry = match self.formulation.integration() {
            Configuration::Initial => &self.initial,
            Configuration::Committed | Configuration::Current => {
                current = self.geometry_at(&positions);
                &current
            }
        };
        // Elements in parallel; their contributions are added up in their order, so the bits do not depend on threads.
        let parts: Vec<Part> = (0..self.mesh.elements.len())
            .into_par_iter()
            .map(|element| self.part(element, geometry, &positions, points))
            .collect();
        let mut internal = self.zero();
        let mut hourglass_energy = 0.0;
        let mut blocks = Vec::with_capacity(parts.len());
        for part in parts {
            for (&dof, value) in part.block.dofs.iter().zip(&part.force) {
                internal[dof] += value;
            }
            hourglass_energy += part.hourglass_energy;
            blocks.push(part.block);
        }
        blocks.extend(loads.stiffness(&positions));
        Balance { internal, external: loads.force(&positions, load), blocks, hourglass_energy }
    }

    /// Forces and stiffness of one element.
    fn part(&self, element: usize, geometry: &[PointGeometry], positions: &[[f64; 3]], points: &[Point]) -> Part {
        let (dimension, nodes) = (self.mesh.dimension.count(), &self.mesh.elements[element]);
        let mut block = Block::zero(degrees_of_freedom(dimension, nodes));
        let mut force = vec![0.0; block.dofs.len()];
        let mut hourglass_energy = 0.0;
        for number in self.first_points[element]..self.first_points[element + 1] {
            let (stress, moduli) = points[number].integrand(self.formulation);
            add_force(dimension, &geometry[number], nodes.len(), &stress, &mut force);
            add_stiffness(dimension, &geometry[number], nodes.len(), &moduli, &mut block.matrix);
        }
        if let Some(modes) = &self.hourglass[element] {
            let shear = points[self.first_points[element]].first_shear_modulus();
            let stiffness = modes.stiffness(self.hourglass_coefficient, shear);
            // Of displacements, not positions: exactly zero in the initial state.
            let moved = |&node: &usize| std::array::from_fn(|i| positions[node][i] - self.mesh.nodes[node][i]);
            let amplitudes = modes.amplitudes(&nodes.iter().map(moved).collect::<Vec<_>>());
            modes.add_force(dimension, stiffness, &amplitudes, &mut force);
            modes.add_stiffness(dimension, stiffness, &mut block.matrix);
            hourglass_energy = modes.energy(stiffness, &amplitudes);
        }
        Part { block, force, hourglass_energy }
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
        if self.formulation.reference() == Configuration::Committed {
            self.committed = self.geometry(&self.zero());
        }
    }
}
