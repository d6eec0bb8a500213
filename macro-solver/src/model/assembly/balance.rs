//! Balance of forces of one iterate and its tangent.
//!
//! The tangent is the exact derivative of the forces.

use crate::element::PointGeometry;
use crate::element::integrals::{add_force, add_stiffness};
use crate::model::assembly::block::{Block, BlockDofs};
use crate::model::assembly::coupling::CoupledBody;
use crate::model::body::{Body, degrees_of_freedom};
use crate::model::loads::Loads;
use crate::model::points::{Coupling, Points};
use crate::problem::Moment;
use nalgebra::Matrix3;

/// Forces and stiffness of one iterate. Vectors run over all degrees of freedom; N, in the plane per metre.
#[derive(Clone, Debug)]
pub(crate) struct Balance {
    /// Nodal forces of the stresses.
    pub(crate) internal: Vec<f64>,
    /// Nodal forces of the loads.
    pub(crate) external: Vec<f64>,
    /// Stiffness blocks: elements, then follower loads, then what averages over neighbours add, element by element.
    pub(crate) blocks: Vec<Block>,
    /// Energy of the hourglass control, J, in the plane per metre.
    pub(crate) hourglass_energy: f64,
}

/// Where the nodes are, and what is integrated there in place of the stresses of the points.
#[derive(Clone, Copy)]
struct Place<'a> {
    geometry: &'a [PointGeometry],
    positions: &'a [[f64; 3]],
    averaged: Option<&'a [Matrix3<f64>]>,
}

/// Contribution of one element.
struct ElementBalance {
    block: Block,
    force: Vec<f64>,
    hourglass_energy: f64,
}

impl Balance {
    /// Out-of-balance force, internal minus external.
    pub(crate) fn residual(&self) -> Vec<f64> {
        self.internal.iter().zip(&self.external).map(|(internal, external)| internal - external).collect()
    }

    /// Largest diagonal entry of any block, N/m, in the plane per metre.
    pub(crate) fn largest_diagonal(&self) -> f64 {
        self.blocks.iter().map(Block::largest_diagonal).fold(0.0, f64::max)
    }

    /// `K v` for a vector over all degrees of freedom.
    pub(crate) fn stiffness_times(&self, vector: &[f64]) -> Vec<f64> {
        let mut product = vec![0.0; vector.len()];
        for block in &self.blocks {
            let columns = block.dofs.columns();
            for (row, &target) in block.dofs.rows.iter().enumerate() {
                let entries = &block.matrix[row * columns.len()..(row + 1) * columns.len()];
                product[target] += entries.iter().zip(columns).map(|(entry, &dof)| entry * vector[dof]).sum::<f64>();
            }
        }
        product
    }
}

impl Body {
    /// Degrees of freedom of all stiffness blocks, in the order of [`Balance::blocks`].
    pub(crate) fn block_dofs(&self, loads: &Loads, coupling: Option<&Coupling>) -> Vec<BlockDofs> {
        let dimension = self.mesh().dimension.count();
        let elements = self.mesh().elements.iter().map(|nodes| degrees_of_freedom(dimension, nodes));
        let square = elements.chain(loads.block_dofs()).map(BlockDofs::square);
        let coupled = coupling
            .map(|coupling| (0..self.mesh().elements.len()).map(|element| self.coupled_dofs(element, coupling)));
        square.chain(coupled.into_iter().flatten()).collect()
    }

    /// Balance after `increment` at a moment of the stage, from the points' latest stresses and moduli.
    pub(crate) fn balance(&self, increment: &[f64], points: &Points, loads: &Loads, moment: Moment) -> Balance {
        let positions = self.positions(increment);
        let geometry = self.integration_geometry(&positions);
        let averaged = points.integrated_stresses(geometry.iter().map(|geometry| geometry.volume));
        let place = Place { geometry: &geometry, positions: &positions, averaged: averaged.as_deref() };
        let elements = self.for_all_elements(|element| self.element_balance(element, place, points));
        let mut internal = self.zero();
        let mut hourglass_energy = 0.0;
        let mut blocks = Vec::with_capacity(elements.len());
        for part in elements {
            for (&dof, value) in part.block.dofs.rows.iter().zip(&part.force) {
                internal[dof] += value;
            }
            hourglass_energy += part.hourglass_energy;
            blocks.push(part.block);
        }
        blocks.extend(loads.stiffness(&positions, moment));
        if let Some(coupling) = points.coupling() {
            let coupled = CoupledBody::new(self, coupling, &geometry, points.all());
            blocks.extend(self.for_all_elements(|element| coupled.stiffness(element)));
        }
        Balance { internal, external: loads.force(&positions, moment), blocks, hourglass_energy }
    }

    /// Forces and stiffness of one element.
    fn element_balance(&self, element: usize, place: Place<'_>, points: &Points) -> ElementBalance {
        let Place { geometry, positions, averaged } = place;
        let (dimension, nodes) = (self.mesh().dimension.count(), &self.mesh().elements[element]);
        let mut block = Block::zero(BlockDofs::square(degrees_of_freedom(dimension, nodes)));
        let mut force = vec![0.0; block.dofs.rows.len()];
        for number in self.points_of(element) {
            let (stress, moduli) = points.integrand(number, averaged);
            add_force(dimension, &geometry[number], nodes.len(), &stress, &mut force);
            add_stiffness(dimension, &geometry[number], nodes.len(), &moduli, &mut block.matrix);
        }
        let mut hourglass_energy = 0.0;
        if let Some(modes) = self.hourglass(element) {
            let shear = self.first_shear_modulus(element, points.all());
            let stiffness = modes.stiffness(self.hourglass_coefficient(), shear);
            // Of displacements, not positions: exactly zero in the initial state.
            let moved = |node: usize| std::array::from_fn(|i| positions[node][i] - self.mesh().nodes[node][i]);
            let amplitudes = self.add_hourglass_force(element, modes, stiffness, moved, &mut force);
            modes.add_stiffness(dimension, stiffness, &mut block.matrix);
            hourglass_energy = modes.energy(stiffness, &amplitudes);
        }
        ElementBalance { block, force, hourglass_energy }
    }
}
