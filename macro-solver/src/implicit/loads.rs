//! Pressures, tractions and body forces: nodal forces and, for a follower pressure, their change with the geometry.

use super::linear_solver::Block;
use crate::body::degrees_of_freedom;
use crate::element::side::{SideShape, side_shapes};
use crate::element::{point_geometry, shapes_at_points};
use crate::mesh::{Mesh, Side};
use crate::problem::{Condition, PressureKind, Problem, ProblemError};
use nalgebra::Vector3;

/// All loads of a problem. Vectors run over all degrees of freedom; in the plane per metre of thickness.
#[derive(Clone, Debug)]
pub(super) struct Loads {
    dimension: usize,
    followers: Vec<Follower>,
    dead: Vec<f64>,
    proportional: Vec<f64>,
}

/// A pressure on one side that turns and stretches with it.
#[derive(Clone, Debug)]
struct Follower {
    dimension: usize,
    nodes: Vec<usize>,
    shapes: &'static [SideShape],
    pressure: f64,
}

impl Loads {
    /// Collects the loads of a problem.
    ///
    /// # Errors
    /// A side or element set that does not exist.
    pub(super) fn new(problem: &Problem) -> Result<Self, ProblemError> {
        let mesh = &problem.mesh;
        let zero = vec![0.0; mesh.degrees_of_freedom()];
        let dimension = mesh.dimension.count();
        let mut loads = Self { dimension, followers: Vec::new(), dead: zero.clone(), proportional: zero };
        for condition in &problem.conditions {
            match condition {
                Condition::Pressure { sides, value, kind } => {
                    loads.add_pressure(mesh, problem.sides(sides)?, *value, *kind);
                }
                Condition::Traction { sides, value } => loads.add_traction(mesh, problem.sides(sides)?, *value),
                Condition::BodyForce { elements, value } => {
                    loads.add_body_force(mesh, problem.elements(elements)?, *value);
                }
                Condition::Displacement { .. } | Condition::Platen { .. } => {}
            }
        }
        Ok(loads)
    }

    fn add_pressure(&mut self, mesh: &Mesh, sides: &[Side], pressure: f64, kind: PressureKind) {
        for &side in sides {
            let shapes = side_shapes(mesh.kinds[side.element].side_kind());
            let follower = Follower { dimension: self.dimension, nodes: mesh.side_nodes(side), shapes, pressure };
            match kind {
                PressureKind::Follower => self.followers.push(follower),
                PressureKind::Dead => follower.add_force(&mesh.nodes, &mut self.dead),
            }
        }
    }

    fn add_traction(&mut self, mesh: &Mesh, sides: &[Side], value: [f64; 3]) {
        for &side in sides {
            let nodes = mesh.side_nodes(side);
            for shape in side_shapes(mesh.kinds[side.element].side_kind()) {
                let area = shape.weight * area_vector(shape, &nodes, &mesh.nodes).norm();
                for (&node, weight) in nodes.iter().zip(&shape.values) {
                    for (axis, component) in value.iter().enumerate().take(self.dimension) {
                        self.proportional[self.dimension * node + axis] += weight * area * component;
                    }
                }
            }
        }
    }

    fn add_body_force(&mut self, mesh: &Mesh, elements: &[usize], value: [f64; 3]) {
        for &element in elements {
            let (kind, positions) = (mesh.kinds[element], mesh.element_positions(element));
            for (local, shape) in shapes_at_points(kind).iter().enumerate() {
                let volume = point_geometry(kind, &positions, local).volume;
                for (&node, weight) in mesh.elements[element].iter().zip(&shape.values) {
                    for (axis, component) in value.iter().enumerate().take(self.dimension) {
                        self.proportional[self.dimension * node + axis] += weight * volume * component;
                    }
                }
            }
        }
    }

    /// Nodal forces at a load factor with the nodes at `positions`, N.
    pub(super) fn force(&self, positions: &[[f64; 3]], load: f64) -> Vec<f64> {
        let mut force: Vec<f64> =
            self.dead.iter().zip(&self.proportional).map(|(dead, share)| dead + load * share).collect();
        for follower in &self.followers {
            follower.add_force(positions, &mut force);
        }
        force
    }

    /// Degrees of freedom of each stiffness block, in the order of [`Loads::stiffness`].
    pub(super) fn block_dofs(&self) -> impl Iterator<Item = Vec<usize>> + '_ {
        self.followers.iter().map(|follower| degrees_of_freedom(self.dimension, &follower.nodes))
    }

    /// `-d force / d displacement`, block by block, with the nodes at `positions`.
    pub(super) fn stiffness(&self, positions: &[[f64; 3]]) -> impl Iterator<Item = Block> {
        self.followers.iter().map(|follower| follower.stiffness(positions))
    }
}

impl Follower {
    /// Adds `-p integral N n da`.
    fn add_force(&self, positions: &[[f64; 3]], force: &mut [f64]) {
        for shape in self.shapes {
            let area = area_vector(shape, &self.nodes, positions) * (self.pressure * shape.weight);
            for (&node, weight) in self.nodes.iter().zip(&shape.values) {
                for axis in 0..self.dimension {
                    force[self.dimension * node + axis] -= weight * area[axis];
                }
            }
        }
    }

    /// `p integral N_a d(t_1 x t_2)/du_b`: constant in the plane, where the normal is linear in the positions.
    fn stiffness(&self, positions: &[[f64; 3]]) -> Block {
        let mut block = Block::zero(degrees_of_freedom(self.dimension, &self.nodes));
        let width = block.dofs.len();
        for shape in self.shapes {
            let [first, second] = shape.tangents(self.nodes.iter().map(|&node| positions[node]));
            let scale = self.pressure * shape.weight;
            for (b, slope) in shape.gradients.iter().enumerate().take(self.nodes.len()) {
                for k in 0..self.dimension {
                    let unit = Vector3::ith(k, 1.0);
                    let change = (unit.cross(&second) * slope[0] + first.cross(&unit) * slope[1]) * scale;
                    for (a, weight) in shape.values.iter().enumerate().take(self.nodes.len()) {
                        for i in 0..self.dimension {
                            let entry = (self.dimension * a + i) * width + self.dimension * b + k;
                            block.matrix[entry] += weight * change[i];
                        }
                    }
                }
            }
        }
        block
    }
}

/// Outward normal times area per natural area.
fn area_vector(shape: &SideShape, nodes: &[usize], positions: &[[f64; 3]]) -> Vector3<f64> {
    let [first, second] = shape.tangents(nodes.iter().map(|&node| positions[node]));
    first.cross(&second)
}
