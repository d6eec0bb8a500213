//! Points whose stresses depend on the motion of others, because their strains are averaged over a neighbourhood.

use super::{Point, Points};
use crate::element::PointGeometry;
use crate::formulation::tensor::{column, from_column};
use crate::formulation::{AveragedModuli, Formulation, Operator};
use crate::mesh::Mesh;
use crate::nonlocal::NonlocalLayer;
use nalgebra::Matrix3;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

/// Which points of a stage are coupled, and how strongly.
#[derive(Clone, Debug)]
pub(crate) struct Coupling {
    /// For every point those whose strains of this step it averages, with weights.
    averaged: Vec<Vec<(usize, f64)>>,
    /// For every point those whose stresses it integrates, with the weights of their averages; `None`: its own.
    integrated: Option<Vec<Vec<(usize, f64)>>>,
    /// For every element the nodes that move what its forces depend on, ascending.
    nodes: Vec<Vec<usize>>,
}

impl Coupling {
    /// The couplings that averages bring about on a mesh.
    pub(super) fn new(mesh: &Mesh, neighbours: &NonlocalLayer) -> Self {
        let operator = neighbours.operator();
        let averaged: Vec<Vec<(usize, f64)>> =
            (0..operator.len()).map(|point| operator.row_of_this_step(point).collect()).collect();
        let integrated = neighbours.is_adjoint().then(|| {
            let mut integrated = vec![Vec::new(); operator.len()];
            for point in 0..operator.len() {
                operator.row(point).for_each(|(other, weight)| integrated[other].push((point, weight)));
            }
            integrated
        });
        let mut coupling = Self { averaged, integrated, nodes: Vec::new() };
        let first_points = mesh.first_points();
        let mut element_of = vec![0; operator.len()];
        for element in 0..mesh.elements.len() {
            element_of[first_points[element]..first_points[element + 1]].fill(element);
        }
        coupling.nodes = (0..mesh.elements.len())
            .map(|element| {
                let points = first_points[element]..first_points[element + 1];
                let elements: BTreeSet<usize> =
                    points.flat_map(|point| coupling.reach(point)).map(|other| element_of[other]).collect();
                let nodes: BTreeSet<usize> =
                    elements.into_iter().flat_map(|element| &mesh.elements[element]).copied().collect();
                nodes.into_iter().collect()
            })
            .collect();
        coupling
    }

    /// Nodes on whose motion the forces of an element depend, ascending.
    pub(crate) fn nodes(&self, element: usize) -> &[usize] {
        &self.nodes[element]
    }

    /// Points on whose motion the stress depends that a point integrates.
    fn reach(&self, point: usize) -> BTreeSet<usize> {
        let averaged_by = |point: usize| self.averaged[point].iter().map(|(other, _)| *other);
        match &self.integrated {
            None => averaged_by(point).collect(),
            Some(integrated) => {
                let sources = integrated[point].iter().map(|(source, _)| *source);
                sources.flat_map(|source| averaged_by(source).chain([source])).collect()
            }
        }
    }

    /// Whether stresses are averaged on their way to the elements.
    pub(super) fn integrates_averages(&self) -> bool {
        self.integrated.is_some()
    }

    /// For every point on which the stress integrated at the point `number` depends: the change of that stress, times its volume, with
    /// the displacement gradient there, N m.
    pub(crate) fn moduli(
        &self,
        number: usize,
        points: &[Point],
        geometry: &[PointGeometry],
        formulation: Formulation,
    ) -> BTreeMap<usize, Operator> {
        let mut moduli: BTreeMap<usize, Operator> = BTreeMap::new();
        let mut add_averages = |source: usize, share: f64| {
            let seen = share * points[source].averaged(formulation).seen;
            for &(other, weight) in &self.averaged[source] {
                *moduli.entry(other).or_insert_with(Operator::zeros) += weight * seen;
            }
        };
        match &self.integrated {
            None => add_averages(number, geometry[number].volume),
            Some(integrated) => {
                for &(source, weight) in &integrated[number] {
                    add_averages(source, weight * geometry[source].volume);
                }
            }
        }
        for (&other, moduli) in &mut moduli {
            *moduli *= points[other].averaged(formulation).strain;
        }
        for &(source, weight) in self.integrated.iter().flat_map(|integrated| &integrated[number]) {
            // The volume that the stress of the source stands for changes too.
            let own = points[source].averaged(formulation).own
                + formulation.volumetric_moduli(&points[source].response.stress);
            *moduli.entry(source).or_insert_with(Operator::zeros) += weight * geometry[source].volume * own;
        }
        moduli
    }
}

impl Points {
    /// How the points are coupled in this stage; `None` if every stress depends on the motion of its own point alone, and where no
    /// stiffness is needed.
    pub(crate) fn coupling(&self) -> Option<&Coupling> {
        self.coupling.as_deref()
    }

    /// Changes of the grains' stresses for changes of all displacement gradients, Pa, by the latest moduli.
    pub(crate) fn stress_changes(&self, gradients: &[Matrix3<f64>]) -> Vec<Matrix3<f64>> {
        let Some(coupling) = self.coupling() else {
            let change =
                |(point, gradient): (&Point, &Matrix3<f64>)| from_column(&(point.response.moduli * column(gradient)));
            return self.points.iter().zip(gradients).map(change).collect();
        };
        let averaged: Vec<Cow<'_, AveragedModuli>> =
            self.points.iter().map(|point| point.averaged(self.formulation)).collect();
        let strains: Vec<_> =
            averaged.iter().zip(gradients).map(|(moduli, gradient)| moduli.strain * column(gradient)).collect();
        let change = |(number, moduli): (usize, &Cow<'_, AveragedModuli>)| {
            let stress = &self.points[number].response.stress;
            let mut change = (moduli.own + self.formulation.geometric_moduli(stress)) * column(&gradients[number]);
            for &(other, weight) in &coupling.averaged[number] {
                change += weight * (moduli.seen * strains[other]);
            }
            from_column(&change)
        };
        averaged.iter().enumerate().map(change).collect()
    }
}
