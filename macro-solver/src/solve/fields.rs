//! The committed state in the form that observers get.

use super::driver::Solver;
use crate::formulation::tensor::tensor;
use crate::model::body::by_node;
use crate::observer::PointFields;
use nalgebra::Matrix3;

/// Arrays behind a [`crate::observer::FieldsView`].
pub(super) struct Fields {
    pub(super) displacements: Vec<[f64; 3]>,
    pub(super) reactions: Vec<[f64; 3]>,
    pub(super) loads: Vec<[f64; 3]>,
    pub(super) points: Vec<PointFields>,
}

impl Solver<'_> {
    /// Collects the committed state; `gradients` are those of the step that led to it, forces run over all degrees of
    /// freedom.
    pub(super) fn fields(&self, gradients: &[Matrix3<f64>], reactions: &[f64], loads: &[f64]) -> Fields {
        let dimension = self.body.mesh().dimension.count();
        Fields {
            displacements: by_node(dimension, &self.body.displacements),
            reactions: by_node(dimension, reactions),
            loads: by_node(dimension, loads),
            points: self.point_fields(gradients),
        }
    }

    fn point_fields(&self, gradients: &[Matrix3<f64>]) -> Vec<PointFields> {
        let still = self.body.zero();
        let (positions, geometry) = (self.body.positions(&still), self.body.geometry(&still));
        let mut fields = Vec::with_capacity(gradients.len());
        for (number, point) in self.points.all().iter().enumerate() {
            let answer = point.answer.as_ref().expect("every point is evaluated before a state is accepted");
            fields.push(PointFields {
                element: self.body.element_of(number),
                local: self.body.local_number(number),
                initial_position: self.body.place(number, &self.body.mesh().nodes),
                position: self.body.place(number, &positions),
                volume: geometry[number].volume,
                deformation: tensor(&point.deformation),
                step_gradient: tensor(&gradients[number]),
                stress: tensor(&point.response.stress),
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
