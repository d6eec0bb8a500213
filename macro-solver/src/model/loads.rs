//! Pressures, tractions and body forces of a stage: nodal forces and, for a follower pressure, their change with the geometry.

use crate::element::side::{SideShape, area_vector, side_shapes};
use crate::element::{point_geometry, shapes_at_points};
use crate::mesh::{Mesh, Side};
use crate::model::assembly::block::{Block, BlockDofs};
use crate::model::body::degrees_of_freedom;
use crate::problem::{Amplitude, Applied, Condition, Moment, PressureKind, Problem, ProblemError, Stage};
use nalgebra::Vector3;

/// All loads of a stage. Vectors run over all degrees of freedom; in the plane per metre of thickness.
#[derive(Clone, Debug)]
pub(crate) struct Loads {
    dimension: usize,
    degrees_of_freedom: usize,
    followers: Vec<FollowerPressure>,
    /// Forces that keep their direction, one for each history.
    dead: Vec<(Amplitude, Vec<f64>)>,
}

/// A pressure on one side that turns and stretches with it.
#[derive(Clone, Debug)]
struct FollowerPressure {
    dimension: usize,
    nodes: Vec<usize>,
    shapes: &'static [SideShape],
    pressure: f64,
    history: Amplitude,
}

impl Loads {
    /// Collects the loads of a stage.
    ///
    /// # Errors
    /// A side or element set that does not exist.
    pub(crate) fn new(problem: &Problem, stage: &Stage) -> Result<Self, ProblemError> {
        let mesh = &problem.mesh;
        let mut loads = Self {
            dimension: mesh.dimension.count(),
            degrees_of_freedom: mesh.degrees_of_freedom(),
            followers: Vec::new(),
            dead: Vec::new(),
        };
        for Applied { condition, history, .. } in &stage.conditions {
            match condition {
                Condition::Pressure { sides, value, kind } => {
                    loads.add_pressure(mesh, problem.sides(sides)?, *value, *kind, history);
                }
                Condition::Traction { sides, value } => {
                    loads.add_traction(mesh, problem.sides(sides)?, *value, history);
                }
                Condition::BodyForce { elements, value } => {
                    loads.add_body_force(mesh, problem.elements(elements)?, *value, history);
                }
                Condition::Displacement { .. }
                | Condition::Platen { .. }
                | Condition::MultiPointConstraint(_)
                | Condition::Friction { .. } => {}
            }
        }
        Ok(loads)
    }

    fn add_pressure(&mut self, mesh: &Mesh, sides: &[Side], pressure: f64, kind: PressureKind, history: &Amplitude) {
        for &side in sides {
            let follower = FollowerPressure {
                dimension: self.dimension,
                nodes: mesh.side_nodes(side),
                shapes: side_shapes(mesh.kinds[side.element].side_kind()),
                pressure,
                history: history.clone(),
            };
            match kind {
                PressureKind::Follower => self.followers.push(follower),
                PressureKind::Dead => follower.add_force(&mesh.nodes, 1.0, self.dead_forces(history)),
            }
        }
    }

    fn add_traction(&mut self, mesh: &Mesh, sides: &[Side], value: [f64; 3], history: &Amplitude) {
        let dimension = self.dimension;
        let forces = self.dead_forces(history);
        for &side in sides {
            let nodes = mesh.side_nodes(side);
            for shape in side_shapes(mesh.kinds[side.element].side_kind()) {
                let area = shape.weight * area_vector(shape, &nodes, &mesh.nodes).norm();
                add_shares(dimension, &nodes, &shape.values, area, value, forces);
            }
        }
    }

    fn add_body_force(&mut self, mesh: &Mesh, elements: &[usize], value: [f64; 3], history: &Amplitude) {
        let dimension = self.dimension;
        let forces = self.dead_forces(history);
        for &element in elements {
            let (kind, positions) = (mesh.kinds[element], mesh.element_positions(element));
            for (local, shape) in shapes_at_points(kind).iter().enumerate() {
                let volume = point_geometry(kind, &positions, local).volume;
                add_shares(dimension, &mesh.elements[element], &shape.values, volume, value, forces);
            }
        }
    }

    /// The vector that collects forces with this history, zero at first.
    fn dead_forces(&mut self, history: &Amplitude) -> &mut [f64] {
        let place = self.dead.iter().position(|(known, _)| known == history).unwrap_or_else(|| {
            self.dead.push((history.clone(), vec![0.0; self.degrees_of_freedom]));
            self.dead.len() - 1
        });
        &mut self.dead[place].1
    }

    /// Nodal forces at a moment of the stage with the nodes at `positions`, N.
    pub(crate) fn force(&self, positions: &[[f64; 3]], moment: Moment) -> Vec<f64> {
        self.force_by(positions, |history| history.factor(moment))
    }

    /// Change of the nodal forces from one moment to another by their histories alone, with the nodes at `positions`, N. Loads that stay
    /// as they are leave no rounding in it.
    pub(crate) fn change(&self, positions: &[[f64; 3]], from: Moment, to: Moment) -> Vec<f64> {
        self.force_by(positions, |history| history.factor(to) - history.factor(from))
    }

    /// Nodal forces with the factor `factor` on the loads of each history.
    fn force_by(&self, positions: &[[f64; 3]], factor: impl Fn(&Amplitude) -> f64) -> Vec<f64> {
        let mut force = vec![0.0; self.degrees_of_freedom];
        for (history, forces) in &self.dead {
            let factor = factor(history);
            for (sum, value) in force.iter_mut().zip(forces) {
                *sum += factor * value;
            }
        }
        for follower in &self.followers {
            follower.add_force(positions, factor(&follower.history), &mut force);
        }
        force
    }

    /// Degrees of freedom of each stiffness block, in the order of [`Loads::stiffness`].
    pub(crate) fn block_dofs(&self) -> impl Iterator<Item = Vec<usize>> + '_ {
        self.followers.iter().map(|follower| degrees_of_freedom(self.dimension, &follower.nodes))
    }

    /// `-d force / d displacement` at a moment of the stage, block by block, with the nodes at `positions`.
    pub(crate) fn stiffness(&self, positions: &[[f64; 3]], moment: Moment) -> impl Iterator<Item = Block> {
        self.followers.iter().map(move |follower| follower.stiffness(positions, follower.history.factor(moment)))
    }
}

impl FollowerPressure {
    /// Adds `-p integral N n da`.
    fn add_force(&self, positions: &[[f64; 3]], factor: f64, force: &mut [f64]) {
        for shape in self.shapes {
            let area = area_vector(shape, &self.nodes, positions) * (factor * self.pressure * shape.weight);
            for (&node, weight) in self.nodes.iter().zip(&shape.values) {
                for axis in 0..self.dimension {
                    force[self.dimension * node + axis] -= weight * area[axis];
                }
            }
        }
    }

    /// `p integral N_a d(t_1 x t_2)/du_b`: constant in the plane, where the normal is linear in the positions.
    fn stiffness(&self, positions: &[[f64; 3]], factor: f64) -> Block {
        let mut block = Block::zero(BlockDofs::square(degrees_of_freedom(self.dimension, &self.nodes)));
        let width = block.dofs.rows.len();
        for shape in self.shapes {
            let [first, second] = shape.tangents(self.nodes.iter().map(|&node| positions[node]));
            let scale = factor * self.pressure * shape.weight;
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

/// Adds `value x size`, shared out among nodes by the values of their shape functions.
fn add_shares(dimension: usize, nodes: &[usize], shapes: &[f64], size: f64, value: [f64; 3], forces: &mut [f64]) {
    for (&node, weight) in nodes.iter().zip(shapes) {
        for (axis, component) in value.iter().enumerate().take(dimension) {
            forces[dimension * node + axis] += weight * size * component;
        }
    }
}
