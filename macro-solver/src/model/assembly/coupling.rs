//! Stiffness between elements whose points average their strains over a neighbourhood.
//!
//! With `sigma_I(L_I, <e>_I)` and `<e>_I = sum_K a_IK e_K` the forces `sum_I V_I B_I^T sigma_I` change by
//! `sum_IK V_I B_I^T S_I a_IK D_K B_K du`, where `S = d sigma / d <e>` and `D = d e / d L`: the matrix is not symmetric, and as wide as
//! the radius. If the stresses are averaged by the transpose too, `sum_IJ V_I a_IJ B_J^T sigma_I`, it is twice as wide. What a point
//! contributes to its own element at a fixed average is in the stiffness of the element.

use super::block::{Block, BlockDofs};
use crate::element::PointGeometry;
use crate::element::integrals::{CoupledPoint, add_coupling};
use crate::model::body::{Body, degrees_of_freedom};
use crate::model::points::{Coupling, Point};

impl Body {
    /// Degrees of freedom of the stiffness that couples an element with its neighbours.
    pub(super) fn coupled_dofs(&self, element: usize, coupling: &Coupling) -> BlockDofs {
        let dimension = self.mesh().dimension.count();
        let rows = degrees_of_freedom(dimension, &self.mesh().elements[element]);
        BlockDofs::wide(rows, degrees_of_freedom(dimension, coupling.nodes(element)))
    }

    /// That stiffness, from the latest moduli of all points.
    pub(super) fn coupled_stiffness(
        &self,
        element: usize,
        geometry: &[PointGeometry],
        points: &[Point],
        coupling: &Coupling,
    ) -> Block {
        let dimension = self.mesh().dimension.count();
        let mut block = Block::zero(self.coupled_dofs(element, coupling));
        let (width, nodes) = (block.dofs.columns().len(), coupling.nodes(element));
        let own: Vec<usize> = (0..self.mesh().elements[element].len()).collect();
        let place = |node: &usize| nodes.binary_search(node).expect("all nodes of the neighbourhood are listed");
        for number in self.points_of(element) {
            let row = CoupledPoint { geometry: &geometry[number], places: &own };
            for (other, moduli) in coupling.moduli(number, points, geometry, self.formulation()) {
                let places: Vec<usize> = self.mesh().elements[self.element_of(other)].iter().map(place).collect();
                let column = CoupledPoint { geometry: &geometry[other], places: &places };
                add_coupling(dimension, row, column, &moduli, width, &mut block.matrix);
            }
        }
        block
    }
}
