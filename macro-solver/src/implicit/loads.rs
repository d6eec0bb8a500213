//! Pressures and tractions on edges: nodal forces and, for a follower pressure, their change with the geometry.

use super::linear_solver::Block;
use crate::element::edge::{EdgeShape, edge_nodes, edge_shapes};
use crate::mesh::Edge;
use crate::problem::{Condition, PressureKind, Problem, ProblemError};

/// All edge loads of a problem. Forces are per metre of thickness, vectors run over all degrees of freedom.
#[derive(Clone, Debug)]
pub(super) struct Loads {
    shapes: [EdgeShape; 2],
    followers: Vec<Follower>,
    dead: Vec<f64>,
    proportional: Vec<f64>,
}

#[derive(Clone, Debug)]
struct Follower {
    nodes: Vec<usize>,
    pressure: f64,
}

impl Loads {
    /// Collects the loads of a problem.
    ///
    /// # Errors
    /// An edge set that does not exist.
    pub(super) fn new(problem: &Problem) -> Result<Self, ProblemError> {
        let mesh = &problem.mesh;
        let zero = vec![0.0; 2 * mesh.nodes.len()];
        let shapes = edge_shapes(mesh.kind);
        let mut loads = Self { shapes, followers: Vec::new(), dead: zero.clone(), proportional: zero };
        for condition in &problem.conditions {
            match condition {
                Condition::Pressure { edges, value, kind } => {
                    let edges = problem.edges(edges)?;
                    loads.add_pressure(edges, *value, *kind, problem);
                }
                Condition::Traction { edges, value } => {
                    for &edge in problem.edges(edges)? {
                        loads.add_traction(&edge_nodes(mesh, edge), *value, &mesh.nodes);
                    }
                }
                Condition::Displacement { .. } | Condition::Platen { .. } => {}
            }
        }
        Ok(loads)
    }

    fn add_pressure(&mut self, edges: &[Edge], pressure: f64, kind: PressureKind, problem: &Problem) {
        for &edge in edges {
            let follower = Follower { nodes: edge_nodes(&problem.mesh, edge), pressure };
            match kind {
                PressureKind::Follower => self.followers.push(follower),
                PressureKind::Dead => follower.add_force(&self.shapes, &problem.mesh.nodes, &mut self.dead),
            }
        }
    }

    fn add_traction(&mut self, nodes: &[usize], value: [f64; 2], positions: &[[f64; 2]]) {
        for shape in &self.shapes {
            let length = tangent(nodes, shape, positions).map(|t| t * t).iter().sum::<f64>().sqrt();
            for (&node, weight) in nodes.iter().zip(&shape.values) {
                for (axis, component) in value.iter().enumerate() {
                    self.proportional[2 * node + axis] += weight * length * component;
                }
            }
        }
    }

    /// Nodal forces at a load factor with the nodes at `positions`, N per metre.
    pub(super) fn force(&self, positions: &[[f64; 2]], load: f64) -> Vec<f64> {
        let mut force: Vec<f64> =
            self.dead.iter().zip(&self.proportional).map(|(dead, share)| dead + load * share).collect();
        for follower in &self.followers {
            follower.add_force(&self.shapes, positions, &mut force);
        }
        force
    }

    /// Degrees of freedom of each stiffness block, in the order of [`Loads::stiffness`].
    pub(super) fn block_dofs(&self) -> impl Iterator<Item = Vec<usize>> + '_ {
        self.followers.iter().map(|follower| degrees_of_freedom(&follower.nodes))
    }

    /// `-d force / d displacement`, block by block.
    pub(super) fn stiffness(&self) -> impl Iterator<Item = Block> + '_ {
        self.followers.iter().map(|follower| follower.stiffness(&self.shapes))
    }
}

impl Follower {
    /// Adds `-p integral N n ds`; the outward normal lies to the right of the edge's direction.
    fn add_force(&self, shapes: &[EdgeShape; 2], positions: &[[f64; 2]], force: &mut [f64]) {
        for shape in shapes {
            let [along, up] = tangent(&self.nodes, shape, positions);
            for (&node, weight) in self.nodes.iter().zip(&shape.values) {
                force[2 * node] -= self.pressure * weight * up;
                force[2 * node + 1] += self.pressure * weight * along;
            }
        }
    }

    /// Independent of the positions, because the normal times the length is linear in them.
    fn stiffness(&self, shapes: &[EdgeShape; 2]) -> Block {
        let mut block = Block::zero(degrees_of_freedom(&self.nodes));
        let width = block.dofs.len();
        for shape in shapes {
            for (a, value) in shape.values.iter().take(self.nodes.len()).enumerate() {
                for (b, slope) in shape.gradients.iter().take(self.nodes.len()).enumerate() {
                    let change = self.pressure * value * slope;
                    block.matrix[2 * a * width + 2 * b + 1] += change;
                    block.matrix[(2 * a + 1) * width + 2 * b] -= change;
                }
            }
        }
        block
    }
}

/// Both degrees of freedom of every node, in order.
pub(super) fn degrees_of_freedom(nodes: &[usize]) -> Vec<usize> {
    nodes.iter().flat_map(|node| [2 * node, 2 * node + 1]).collect()
}

/// Change of position per natural coordinate.
fn tangent(nodes: &[usize], shape: &EdgeShape, positions: &[[f64; 2]]) -> [f64; 2] {
    let mut tangent = [0.0; 2];
    for (&node, slope) in nodes.iter().zip(&shape.gradients) {
        tangent[0] += slope * positions[node][0];
        tangent[1] += slope * positions[node][1];
    }
    tangent
}
