//! Dampers at nodes: absorbing boundaries and mass-proportional damping, and the step of one node under them.
//!
//! An absorbing side carries the traction `-rho (c_p n n + c_s (I - n n)) v` (Lysmer and Kuhlemeyer 1969), which lets plane waves that
//! arrive at a right angle out entirely. Dampers at nodes are taken at the middle of the two half steps, which is stable for any strength.

use super::stage_context::StageContext;
use crate::element::side::side_shapes;
use crate::mesh::Side;
use crate::model::assembly::isotropic::Isotropic;
use crate::model::body::Body;
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeSet;

/// Damper of every node, N s/m, in the plane per metre of thickness.
#[derive(Clone, Debug)]
pub(super) struct Dashpots {
    nodes: Vec<Option<Matrix3<f64>>>,
}

impl Dashpots {
    /// Absorbing `sides` of a body with the mass density `density` (kg/m3) and the stiffness `stiffness` of each element.
    fn new(
        body: &Body,
        sides: &[Side],
        density: impl Fn(usize) -> f64,
        stiffness: impl Fn(usize) -> Isotropic,
    ) -> Self {
        let mesh = body.mesh();
        let mut dashpots = Self { nodes: vec![None; mesh.nodes.len()] };
        for &side in sides {
            let (moduli, density) = (stiffness(side.element), density(side.element));
            let longitudinal = (density * moduli.longitudinal()).sqrt();
            let shear = (density * moduli.shear).sqrt();
            let nodes = mesh.side_nodes(side);
            let mut shares = vec![0.0; nodes.len()];
            let (mut area, mut normal) = (0.0, Vector3::zeros());
            for shape in side_shapes(mesh.kinds[side.element].side_kind()) {
                let [first, second] = shape.tangents(nodes.iter().map(|&node| mesh.nodes[node]));
                let vector = first.cross(&second) * shape.weight;
                area += vector.norm();
                normal += vector;
                // Squares, as in HRZ masses: corners of quadratic sides would get nothing or less from the shape functions themselves.
                for (share, value) in shares.iter_mut().zip(&shape.values) {
                    *share += vector.norm() * value * value;
                }
            }
            let normal = normal.normalize();
            let across = normal * normal.transpose();
            let tensor = across * longitudinal + (Matrix3::identity() - across) * shear;
            let total: f64 = shares.iter().sum();
            for (&node, share) in nodes.iter().zip(&shares) {
                *dashpots.nodes[node].get_or_insert_with(Matrix3::zeros) += tensor * (area * share / total);
            }
        }
        for damper in dashpots.nodes.iter_mut().flatten() {
            without_rounding(damper);
        }
        dashpots
    }

    /// Those of a stage, with the stiffness `stiffness` of every point and the factors `scale_factors` on the masses of the elements:
    /// waves come with the impedance that the mass has.
    pub(super) fn of_stage(context: &StageContext<'_>, stiffness: &[Isotropic], scale_factors: &[f64]) -> Self {
        let sides_of = |name: &String| context.problem.sides(name).expect("checked before the run");
        // A side that two sets share absorbs once.
        let mut known = BTreeSet::new();
        let sides = context.settings.absorbing.iter().flat_map(sides_of).copied();
        let sides: Vec<Side> = sides.filter(|side| known.insert(*side)).collect();
        let first = |element: usize| stiffness[context.body.points_of(element).start];
        let density = |element: usize| context.settings.density_of(element) * scale_factors[element];
        Self::new(context.body, &sides, density, first)
    }

    /// Whether a node belongs to an absorbing side.
    pub(super) fn is_absorbing(&self, node: usize) -> bool {
        self.nodes[node].is_some()
    }

    /// Whether a damper of a node couples the component `axis` with others.
    pub(super) fn is_oblique(&self, node: usize, axis: usize) -> bool {
        self.nodes[node].is_some_and(|damper| (0..3).any(|other| other != axis && damper[(axis, other)] != 0.0))
    }

    /// Damper of a node with mass `mass` (kg) and mass-proportional damping of rate `rate` (1/s).
    pub(super) fn of_node(&self, node: usize, mass: f64, rate: f64) -> Matrix3<f64> {
        self.nodes[node].unwrap_or_else(Matrix3::zeros) + Matrix3::identity() * (rate * mass)
    }
}

/// Couplings that are as small as rounding of the normal of a side along an axis, over the largest entry.
const ROUNDING: f64 = 1e-12;

/// Takes out couplings that only rounding has left: they would make sides along the axes oblique.
fn without_rounding(damper: &mut Matrix3<f64>) {
    let least = ROUNDING * damper.amax();
    for i in 0..3 {
        for j in (0..3).filter(|j| *j != i) {
            if damper[(i, j)].abs() <= least {
                damper[(i, j)] = 0.0;
            }
        }
    }
}

/// Velocity of a node after a step: `m (v' - v) / dt + C (v + v') / 2 = f`, with the components in `prescribed` given. `axes`
/// components take part, the others stay zero.
pub(super) fn next_velocity(
    axes: usize,
    mass: f64,
    damper: &Matrix3<f64>,
    step: f64,
    velocity: &Vector3<f64>,
    force: &Vector3<f64>,
    prescribed: [Option<f64>; 3],
) -> Vector3<f64> {
    let mut matrix = Matrix3::identity() * (mass / step) + 0.5 * damper;
    let mut right = (Matrix3::identity() * (mass / step) - 0.5 * damper) * velocity + force;
    let is_diagonal = (0..3).all(|i| (0..3).all(|j| i == j || damper[(i, j)] == 0.0));
    for axis in 0..3 {
        let given = if axis < axes { prescribed[axis] } else { Some(0.0) };
        if let Some(value) = given {
            matrix.row_mut(axis).fill(0.0);
            matrix[(axis, axis)] = 1.0;
            right[axis] = value;
        }
    }
    if is_diagonal {
        return Vector3::from_fn(|axis, _| right[axis] / matrix[(axis, axis)]);
    }
    matrix.lu().solve(&right).expect("mass is positive and the damper positive semidefinite")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_without_damper_is_pushed_by_the_force_alone() {
        let (velocity, force) = (Vector3::new(1.0, 2.0, 0.0), Vector3::new(3.0, -4.0, 9.0));
        let next = next_velocity(2, 2.0, &Matrix3::zeros(), 0.5, &velocity, &force, [None, Some(7.0), None]);
        assert_eq!(next, Vector3::new(1.0 + 0.5 * 3.0 / 2.0, 7.0, 0.0));
    }

    #[test]
    fn an_oblique_damper_takes_what_its_tensor_says() {
        let normal = Vector3::new(0.6, 0.8, 0.0);
        let damper = normal * normal.transpose() * 5.0 + Matrix3::identity() * 0.5;
        let (velocity, force) = (Vector3::new(1.0, -1.0, 0.0), Vector3::new(0.3, 0.1, 0.0));
        let next = next_velocity(2, 2.0, &damper, 0.1, &velocity, &force, [None; 3]);
        let balance = (next - velocity) * (2.0 / 0.1) + damper * (0.5 * (next + velocity)) - force;
        assert!(balance.norm() < 1e-13, "{balance}");
    }
}
