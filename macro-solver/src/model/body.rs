//! The specimen: committed geometry and kinematics relative to it. Quasi-static and dynamic solvers share it.
//!
//! Which configuration gradients refer to and which one stresses are integrated on is the formulation's choice. Tensors
//! refer to the fixed axes; vectors run over all degrees of freedom, `dimension * node + axis`.

use crate::element::hourglass::{HourglassControl, HourglassModes};
use crate::element::{PointGeometry, point_geometry, shapes_at_points};
use crate::formulation::{Configuration, Formulation};
use crate::mesh::Mesh;
use nalgebra::Matrix3;
use std::borrow::Cow;

/// Geometry that moves.
#[derive(Clone, Debug)]
pub(crate) struct Body {
    mesh: Mesh,
    formulation: Formulation,
    /// Element of every point.
    elements: Vec<usize>,
    first_points: Vec<usize>,
    extent: f64,
    /// Committed displacements since the start, m, by degree of freedom.
    pub(crate) displacements: Vec<f64>,
    /// Modes to hold, for the elements that have some.
    hourglass: Vec<Option<HourglassModes>>,
    hourglass_coefficient: f64,
    initial: Vec<PointGeometry>,
    /// Of the committed configuration; empty if the formulation does not refer to it.
    committed: Vec<PointGeometry>,
}

impl Body {
    /// An undeformed body.
    pub(crate) fn new(mesh: Mesh, formulation: Formulation, hourglass: HourglassControl) -> Self {
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
        // As after every step: what a checkpoint of the start gives is not to differ from it in rounding.
        body.settle();
        body
    }

    /// The mesh as given.
    pub(crate) fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// Element of a point.
    pub(crate) fn element_of(&self, point: usize) -> usize {
        self.elements[point]
    }

    /// Number of a point within its element.
    pub(crate) fn local_number(&self, point: usize) -> usize {
        point - self.first_points[self.elements[point]]
    }

    /// How motion becomes strain.
    pub(crate) fn formulation(&self) -> Formulation {
        self.formulation
    }

    /// Numbers of the points of an element.
    pub(crate) fn points_of(&self, element: usize) -> std::ops::Range<usize> {
        self.first_points[element]..self.first_points[element + 1]
    }

    /// Hourglass modes of an element with one point.
    pub(crate) fn hourglass(&self, element: usize) -> Option<&HourglassModes> {
        self.hourglass[element].as_ref()
    }

    /// Coefficient of the hourglass control, dimensionless.
    pub(crate) fn hourglass_coefficient(&self) -> f64 {
        self.hourglass_coefficient
    }

    /// Geometry on which stresses are integrated with the nodes at `positions`.
    pub(crate) fn integration_geometry(&self, positions: &[[f64; 3]]) -> Cow<'_, [PointGeometry]> {
        match self.formulation.integration() {
            Configuration::Initial => Cow::Borrowed(&self.initial),
            Configuration::Committed | Configuration::Current => Cow::Owned(self.geometry_at(positions)),
        }
    }

    /// Largest initial side, m.
    pub(crate) fn extent(&self) -> f64 {
        self.extent
    }

    /// No motion.
    pub(crate) fn zero(&self) -> Vec<f64> {
        vec![0.0; self.displacements.len()]
    }

    /// Node positions after `increment` from the committed configuration, m.
    pub(crate) fn positions(&self, increment: &[f64]) -> Vec<[f64; 3]> {
        self.moved_nodes(|dof| self.displacements[dof] + increment[dof])
    }

    /// Node positions with these displacements since the start, m.
    pub(crate) fn positions_at(&self, displacements: &[f64]) -> Vec<[f64; 3]> {
        self.moved_nodes(|dof| displacements[dof])
    }

    fn moved_nodes(&self, displacement: impl Fn(usize) -> f64) -> Vec<[f64; 3]> {
        let dimension = self.mesh.dimension.count();
        let mut positions = self.mesh.nodes.clone();
        for (node, position) in positions.iter_mut().enumerate() {
            for (axis, coordinate) in position.iter_mut().enumerate().take(dimension) {
                *coordinate += displacement(dimension * node + axis);
            }
        }
        positions
    }

    /// Every point's displacement gradient relative to the formulation's reference.
    pub(crate) fn gradients(&self, increment: &[f64]) -> Vec<Matrix3<f64>> {
        let reference = if self.committed.is_empty() { &self.initial } else { &self.committed };
        let of_point = |(&element, geometry): (&usize, &PointGeometry)| {
            self.gradient_of(&self.mesh.elements[element], geometry, increment)
        };
        self.elements.iter().zip(reference).map(of_point).collect()
    }

    /// Gradient of a field over all degrees of freedom at a point of an element with the nodes `nodes`.
    pub(crate) fn gradient_of(&self, nodes: &[usize], geometry: &PointGeometry, field: &[f64]) -> Matrix3<f64> {
        let dimension = self.mesh.dimension.count();
        let mut gradient = Matrix3::zeros();
        for (&node, slope) in nodes.iter().zip(&geometry.gradients) {
            for i in 0..dimension {
                for j in 0..dimension {
                    gradient[(i, j)] += field[dimension * node + i] * slope[j];
                }
            }
        }
        gradient
    }

    /// Geometry of every point after `increment`.
    pub(crate) fn geometry(&self, increment: &[f64]) -> Vec<PointGeometry> {
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

    /// Side of the square or cube with the volume of an element, m; `geometry` is that of all points.
    pub(crate) fn length_of(&self, element: usize, geometry: &[PointGeometry]) -> f64 {
        let volume: f64 = self.points_of(element).map(|number| geometry[number].volume).sum();
        volume.powf(1.0 / self.mesh.dimension.count() as f64)
    }

    /// Geometry on which stresses are integrated at the committed state.
    pub(crate) fn settled_geometry(&self) -> &[PointGeometry] {
        match self.formulation.integration() {
            Configuration::Committed | Configuration::Current if !self.committed.is_empty() => &self.committed,
            Configuration::Initial | Configuration::Committed | Configuration::Current => &self.initial,
        }
    }

    /// Place of a point for given node positions, m.
    pub(crate) fn place(&self, point: usize, positions: &[[f64; 3]]) -> [f64; 3] {
        let element = self.elements[point];
        let values = shapes_at_points(self.mesh.kinds[element])[self.local_number(point)].values;
        let mut place = [0.0; 3];
        for (&node, value) in self.mesh.elements[element].iter().zip(&values) {
            (0..3).for_each(|axis| place[axis] += value * positions[node][axis]);
        }
        place
    }

    /// The first point whose deformation from the committed configuration, or whose element, is turned inside out.
    pub(crate) fn inverted_point(&self, gradients: &[Matrix3<f64>], geometry: &[PointGeometry]) -> Option<usize> {
        // Negated comparisons so that NaN counts as inverted.
        (0..gradients.len()).find(|&point| {
            let determinant = (Matrix3::identity() + gradients[point]).determinant();
            !(determinant > 0.0 && geometry[point].volume > 0.0)
        })
    }

    /// Makes the configuration after `increment` the reference of the next step.
    pub(crate) fn commit(&mut self, increment: &[f64]) {
        for (displacement, change) in self.displacements.iter_mut().zip(increment) {
            *displacement += change;
        }
        self.settle();
    }

    /// Makes the configuration of the displacements the reference of the next step.
    pub(crate) fn settle(&mut self) {
        if self.formulation.reference() == Configuration::Committed {
            self.committed = self.geometry(&self.zero());
        }
    }
}

/// All degrees of freedom of every node, in order.
pub(crate) fn degrees_of_freedom(dimension: usize, nodes: &[usize]) -> Vec<usize> {
    nodes.iter().flat_map(|&node| (0..dimension).map(move |axis| dimension * node + axis)).collect()
}

/// A vector over all degrees of freedom as one triple per node; z is 0 in the plane.
pub(crate) fn by_node(dimension: usize, values: &[f64]) -> Vec<[f64; 3]> {
    let padded = |node: &[f64]| std::array::from_fn(|axis| node.get(axis).copied().unwrap_or(0.0));
    values.chunks_exact(dimension).map(padded).collect()
}
