//! The committed state in the form that observers get.

use super::Solver;
use super::moduli::{full, full_deformation};
use crate::mesh::POINTS_PER_ELEMENT;
use crate::observer::PointFields;
use nalgebra::Matrix2;

/// Arrays behind a [`crate::observer::FieldsView`].
pub(super) struct Fields {
    pub(super) displacements: Vec<[f64; 2]>,
    pub(super) reactions: Vec<[f64; 2]>,
    pub(super) loads: Vec<[f64; 2]>,
    pub(super) points: Vec<PointFields>,
}

impl Solver<'_> {
    /// Collects the committed state; `gradients` are those of the step that led to it.
    pub(super) fn fields(&self, gradients: &[Matrix2<f64>]) -> Fields {
        let mut reactions = self.committed_balance.residual();
        for &dof in self.constraints.free() {
            reactions[dof] = 0.0;
        }
        Fields {
            displacements: by_node(&self.body.displacements),
            reactions: by_node(&reactions),
            loads: by_node(&self.committed_balance.external),
            points: self.point_fields(gradients),
        }
    }

    fn point_fields(&self, gradients: &[Matrix2<f64>]) -> Vec<PointFields> {
        let still = self.body.zero();
        let (positions, geometry) = (self.body.positions(&still), self.body.geometry(&still));
        let mut fields = Vec::with_capacity(gradients.len());
        for (number, point) in self.points.all().iter().enumerate() {
            let answer = point.answer.as_ref().expect("every point is evaluated before a state is accepted");
            fields.push(PointFields {
                element: number / POINTS_PER_ELEMENT,
                local: number % POINTS_PER_ELEMENT,
                initial_position: self.body.place(number, &self.body.mesh().nodes),
                position: self.body.place(number, &positions),
                area: geometry[number].area,
                deformation: full_deformation(&point.deformation),
                step_gradient: full(&gradients[number]),
                stress: answer.stress,
                scalars: answer.scalars,
                observed: answer.observed,
                flags: answer.flags,
                step_evaluations: point.step_evaluations,
                evaluations: point.evaluations,
                cost: point.cost,
                step_cost: point.step_cost,
            });
        }
        fields
    }
}

fn by_node(values: &[f64]) -> Vec<[f64; 2]> {
    values.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect()
}
