//! Points whose stresses depend on the motion of others, because their strains are averaged over a neighbourhood.

use super::{Point, Points};
use crate::formulation::AveragedModuli;
use crate::formulation::tensor::{column, from_column};
use crate::mesh::{Mesh, point_places, point_volumes};
use crate::nonlocal::{NonlocalLayer, NonlocalOperator};
use crate::problem::{Problem, Procedure, Stage};
use nalgebra::Matrix3;
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Which points of a stage are coupled, and how strongly.
#[derive(Clone, Debug)]
pub(crate) struct Coupling {
    /// The table of averages.
    operator: Arc<NonlocalOperator>,
    /// For every point those whose stresses it integrates, with the weights of their averages; `None`: its own.
    integrated: Option<Vec<Vec<(usize, f64)>>>,
    /// For every element the nodes that move what its forces depend on, ascending.
    nodes: Vec<Vec<usize>>,
}

impl Coupling {
    /// The couplings that averages bring about on a mesh.
    pub(super) fn new(mesh: &Mesh, neighbours: &NonlocalLayer) -> Self {
        let operator = neighbours.operator();
        let integrated = neighbours.is_adjoint().then(|| {
            let mut integrated = vec![Vec::new(); operator.len()];
            for point in 0..operator.len() {
                operator.row(point).for_each(|(other, weight)| integrated[other].push((point, weight)));
            }
            integrated
        });
        let mut coupling = Self { operator: operator.clone(), integrated, nodes: Vec::new() };
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
        let averaged_by = |point: usize| self.averaged(point).map(|(other, _)| other);
        match &self.integrated {
            None => averaged_by(point).collect(),
            Some(integrated) => {
                let sources = integrated[point].iter().map(|(source, _)| *source);
                sources.flat_map(|source| averaged_by(source).chain([source])).collect()
            }
        }
    }

    /// The points whose strains of this step a point averages, with weights.
    pub(crate) fn averaged(&self, point: usize) -> impl Iterator<Item = (usize, f64)> {
        self.operator.row_of_this_step(point)
    }

    /// The points whose stresses are integrated at a point, with the weights of their averages: itself, unless stresses are averaged.
    pub(crate) fn sources(&self, point: usize) -> impl Iterator<Item = (usize, f64)> {
        let (own, others) = match &self.integrated {
            None => (Some((point, 1.0)), &[][..]),
            Some(integrated) => (None, integrated[point].as_slice()),
        };
        own.into_iter().chain(others.iter().copied())
    }

    /// Whether stresses are averaged on their way to the elements.
    pub(crate) fn integrates_averages(&self) -> bool {
        self.integrated.is_some()
    }
}

impl Points {
    /// How the points are coupled in this stage; `None` if every stress depends on the motion of its own point alone, and where no
    /// stiffness is needed.
    pub(crate) fn coupling(&self) -> Option<&Coupling> {
        self.coupling.as_deref()
    }

    /// Changes of the grains' stresses for changes of all displacement gradients, Pa, by the latest moduli.
    fn stress_changes(&self, gradients: &[Matrix3<f64>]) -> Vec<Matrix3<f64>> {
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
            for (other, weight) in coupling.averaged(number) {
                change += weight * (moduli.seen * strains[other]);
            }
            from_column(&change)
        };
        averaged.iter().enumerate().map(change).collect()
    }

    /// The same with what pore fluid adds, whose stiffness may be many times that of the grains.
    pub(crate) fn total_stress_changes(&self, gradients: &[Matrix3<f64>]) -> Vec<Matrix3<f64>> {
        let mut changes = self.stress_changes(gradients);
        for ((change, point), gradient) in changes.iter_mut().zip(&self.points).zip(gradients) {
            *change += point.fluid_stress_change(gradient);
        }
        changes
    }
}

/// How much the averages of a stage over neighbouring points couple.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CouplingSize {
    /// Pairs of a point and one that it averages.
    pub pairs: usize,
    /// Entries of the stiffness between elements, 0 where none is formed.
    pub entries: usize,
}

impl Problem {
    /// Of the stage whose averages couple most; zero without averages. The problem has been checked.
    pub fn coupling_size(&self) -> CouplingSize {
        let sizes = self.stages.iter().filter_map(|stage| {
            let neighbours = neighbours(self, stage)?;
            let pairs = (0..neighbours.operator().len()).map(|point| neighbours.operator().row(point).count()).sum();
            let entries = if stage.procedure == Procedure::Implicit {
                let coupling = Coupling::new(&self.mesh, &neighbours);
                let dofs = |nodes: usize| self.mesh.dimension.count() * nodes;
                let rows = self.mesh.elements.iter().map(|nodes| dofs(nodes.len()));
                rows.enumerate().map(|(element, rows)| rows * dofs(coupling.nodes(element).len())).sum()
            } else {
                0
            };
            Some(CouplingSize { pairs, entries })
        });
        sizes.max_by_key(|size| (size.entries, size.pairs)).unwrap_or_default()
    }
}

/// The averages of a stage that has any.
pub(super) fn neighbours(problem: &Problem, stage: &Stage) -> Option<NonlocalLayer> {
    let settings = stage.nonlocal.as_ref()?;
    let periods = problem.periods(stage).expect("checked before the run");
    let (places, volumes) = (point_places(&problem.mesh), point_volumes(&problem.mesh));
    Some(NonlocalLayer::new(&places, &volumes, &periods, settings).expect("checked before the run"))
}
