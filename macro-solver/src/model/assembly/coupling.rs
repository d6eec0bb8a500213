//! Stiffness between elements whose points average their strains over a neighbourhood.
//!
//! With `sigma_I(L_I, <e>_I)` and `<e>_I = sum_K a_IK e_K` the forces `sum_I V_I B_I^T sigma_I` change by
//! `sum_IK V_I B_I^T S_I a_IK D_K B_K du`, where `S = d sigma / d <e>` and `D = d e / d L`: the matrix is not symmetric, and as wide as
//! the radius. If the stresses are averaged by the transpose too, `sum_IJ V_I a_IJ B_J^T sigma_I`, it is twice as wide. What a point
//! contributes to its own element at a fixed average is in the stiffness of the element.
//!
//! The rows of an element are added source by source, a source being a point `I` whose stress acts on the element: first what its average
//! does with the motion, `sum_K a_IK D_K B_K`, as wide as the block but with one row per component only, then its product with
//! `sum_J V_I a_IJ B_J^T S_I` over the points `J` of the element.

use super::block::{Block, BlockDofs};
use crate::element::PointGeometry;
use crate::formulation::Operator;
use crate::model::body::{Body, degrees_of_freedom};
use crate::model::points::{Coupling, Point};
use std::collections::BTreeMap;

/// The coupled points of a body at one iterate.
pub(super) struct CoupledBody<'a> {
    body: &'a Body,
    coupling: &'a Coupling,
    geometry: &'a [PointGeometry],
    points: &'a [Point],
    /// For every point `D B`: how its strain increment changes with the motion of its nodes, column by column, `dimension^2` entries each.
    strains: Vec<Vec<f64>>,
}

impl Body {
    /// Degrees of freedom of the stiffness that couples an element with its neighbours.
    pub(super) fn coupled_dofs(&self, element: usize, coupling: &Coupling) -> BlockDofs {
        let dimension = self.mesh().dimension.count();
        let rows = degrees_of_freedom(dimension, &self.mesh().elements[element]);
        BlockDofs::wide(rows, degrees_of_freedom(dimension, coupling.nodes(element)))
    }
}

impl<'a> CoupledBody<'a> {
    /// With the latest moduli of all points.
    pub(super) fn new(
        body: &'a Body,
        coupling: &'a Coupling,
        geometry: &'a [PointGeometry],
        points: &'a [Point],
    ) -> Self {
        let dimension = body.mesh().dimension.count();
        let strains = |(number, point): (usize, &Point)| {
            let nodes = body.mesh().elements[body.element_of(number)].len();
            let moduli = point.averaged(body.formulation());
            strain_of_motion(dimension, &geometry[number].gradients[..nodes], &moduli.strain)
        };
        let strains = points.iter().enumerate().map(strains).collect();
        Self { body, coupling, geometry, points, strains }
    }

    /// Stiffness that couples an element with its neighbours.
    pub(super) fn stiffness(&self, element: usize) -> Block {
        let mut block = Block::zero(self.body.coupled_dofs(element, self.coupling));
        let mut rows = BlockRows::new(self, element, block.dofs.columns().len());
        for (source, shares) in self.sources(element) {
            rows.add_source(source, &shares, &mut block.matrix);
        }
        block
    }

    /// For every point whose stress acts on an element: the points of the element where it does, with the volume that it acts on.
    fn sources(&self, element: usize) -> BTreeMap<usize, Vec<(usize, f64)>> {
        let mut sources: BTreeMap<usize, Vec<(usize, f64)>> = BTreeMap::new();
        for number in self.body.points_of(element) {
            for (source, weight) in self.coupling.sources(number) {
                sources.entry(source).or_default().push((number, weight * self.geometry[source].volume));
            }
        }
        sources
    }

    fn nodes_of(&self, point: usize) -> &'a [usize] {
        &self.body.mesh().elements[self.body.element_of(point)]
    }
}

/// Rows of one element on their way.
struct BlockRows<'a, 'b> {
    coupled: &'a CoupledBody<'b>,
    dimension: usize,
    /// Number of rows.
    count: usize,
    /// Number of columns.
    width: usize,
    /// For every node of the mesh its place among those of the columns.
    places: Vec<usize>,
    /// What the average of a source does with the motion: one row of the block's width for each component.
    average: Vec<f64>,
}

impl<'a, 'b> BlockRows<'a, 'b> {
    fn new(coupled: &'a CoupledBody<'b>, element: usize, width: usize) -> Self {
        let mesh = coupled.body.mesh();
        let dimension = mesh.dimension.count();
        let mut places = vec![usize::MAX; mesh.nodes.len()];
        for (place, &node) in coupled.coupling.nodes(element).iter().enumerate() {
            places[node] = place;
        }
        let average = vec![0.0; dimension * dimension * width];
        Self { coupled, dimension, count: dimension * mesh.elements[element].len(), width, places, average }
    }

    /// Adds the forces of the stress of one source.
    fn add_source(&mut self, source: usize, shares: &[(usize, f64)], matrix: &mut [f64]) {
        let point = &self.coupled.points[source];
        let moduli = point.averaged(self.coupled.body.formulation());
        self.take_average(source);
        let components = self.dimension * self.dimension;
        let forces = self.forces(shares, &moduli.seen);
        for (row, entries) in matrix.chunks_exact_mut(self.width).enumerate() {
            for component in 0..components {
                let force = forces[row * components + component];
                let average = &self.average[component * self.width..(component + 1) * self.width];
                entries.iter_mut().zip(average).for_each(|(entry, change)| *entry += force * change);
            }
        }
        if self.coupled.coupling.integrates_averages() {
            // The volume that the stress of the source stands for changes too.
            let formulation = self.coupled.body.formulation();
            let own = moduli.own + formulation.volumetric_moduli(&point.response.stress);
            self.add_own(source, &self.forces(shares, &own), matrix);
        }
    }

    /// `sum_K a_IK D_K B_K` of a source.
    fn take_average(&mut self, source: usize) {
        let (dimension, components) = (self.dimension, self.dimension * self.dimension);
        self.average.fill(0.0);
        for (other, weight) in self.coupled.coupling.averaged(source) {
            let columns = self.coupled.strains[other].chunks_exact(components);
            let nodes = self.coupled.nodes_of(other);
            let dofs = nodes.iter().flat_map(|&node| (0..dimension).map(move |axis| (node, axis)));
            for ((node, axis), changes) in dofs.zip(columns) {
                let column = dimension * self.places[node] + axis;
                for (component, change) in changes.iter().enumerate() {
                    self.average[component * self.width + column] += weight * change;
                }
            }
        }
    }

    /// `sum_J v_J B_J^T M` over the points `J` of the element with their volumes `v_J`, row by row.
    fn forces(&self, shares: &[(usize, f64)], moduli: &Operator) -> Vec<f64> {
        let (dimension, components) = (self.dimension, self.dimension * self.dimension);
        let mut forces = vec![0.0; self.count * components];
        for (row, entries) in forces.chunks_exact_mut(components).enumerate() {
            let (node, i) = (row / dimension, row % dimension);
            for j in 0..dimension {
                let slope: f64 = shares
                    .iter()
                    .map(|&(number, volume)| volume * self.coupled.geometry[number].gradients[node][j])
                    .sum();
                for (component, entry) in entries.iter_mut().enumerate() {
                    let (k, l) = (component / dimension, component % dimension);
                    *entry += slope * moduli[(3 * i + j, 3 * k + l)];
                }
            }
        }
        forces
    }

    /// Adds forces, row by row, that the displacement gradient of a source itself causes.
    fn add_own(&self, source: usize, forces: &[f64], matrix: &mut [f64]) {
        let (dimension, components) = (self.dimension, self.dimension * self.dimension);
        let slopes = &self.coupled.geometry[source].gradients;
        for (&node, slope) in self.coupled.nodes_of(source).iter().zip(slopes) {
            for (entries, force) in matrix.chunks_exact_mut(self.width).zip(forces.chunks_exact(components)) {
                for k in 0..dimension {
                    let change: f64 = (0..dimension).map(|l| force[dimension * k + l] * slope[l]).sum();
                    entries[dimension * self.places[node] + k] += change;
                }
            }
        }
    }
}

/// `D B` of a point: the change of its strain increment, `dimension^2` entries, for each degree of freedom of its nodes.
fn strain_of_motion(dimension: usize, slopes: &[[f64; 3]], strain: &Operator) -> Vec<f64> {
    let mut columns = Vec::with_capacity(slopes.len() * dimension.pow(3));
    for slope in slopes {
        for k in 0..dimension {
            for component in 0..dimension * dimension {
                let (i, j) = (component / dimension, component % dimension);
                columns.push((0..dimension).map(|l| strain[(3 * i + j, 3 * k + l)] * slope[l]).sum());
            }
        }
    }
    columns
}
