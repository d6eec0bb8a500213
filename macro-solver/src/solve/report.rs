//! What observers get of an accepted state; the same for all procedures.

use super::accepted::{AcceptedState, Counters};
use super::driver::{Session, Solver};
use crate::formulation::Formulation;
use crate::formulation::tensor::tensor;
use crate::model::body::by_node;
use crate::observer::{BalanceError, FieldsView, Outcome, PointFields, StepAccuracy, StepReport};
use nalgebra::Matrix3;

impl Solver<'_> {
    /// Takes note of the accuracy of a committed step and chooses the strain per ramp step of the next one.
    pub(super) fn note_accuracy(&mut self, balance: Option<BalanceError>, session: &Session<'_>) {
        let strain_per_step = self.points.strain_per_step();
        let control = self.problem.error_control;
        self.accuracy = StepAccuracy { strain_per_step, estimate: session.material.error_estimate(), balance };
        self.statistics.accuracy.add(&self.accuracy, control.map(|control| control.error));
        if let (Some(control), Some(estimate)) = (control, self.accuracy.estimate)
            && estimate.points > 0
        {
            let next = control.next_strain_per_step(strain_per_step, self.strain_within_error, estimate.rms);
            if control.is_within_error(estimate.rms) {
                self.strain_within_error = Some(strain_per_step);
            }
            self.points.set_strain_per_step(next);
        }
    }

    /// Reports an accepted state to the observer; `before` are the counters at the start of the step.
    ///
    /// # Errors
    /// The observer requests a stop.
    pub(super) fn report_accepted(
        &self,
        state: &AcceptedState<'_>,
        before: &Counters,
        session: &mut Session<'_>,
    ) -> Result<(), Outcome> {
        let report = StepReport {
            step: self.step,
            stage: self.stage,
            load: state.load,
            time: self.problem.begin_of(self.stage) + self.moment(state.stage_fraction).time,
            share: (self.stage as f64 + state.stage_fraction) / self.problem.stages.len() as f64,
            size: state.step_size,
            iterations: state.iterations,
            evaluations: self.statistics.evaluations - before.evaluations,
            skipped: self.statistics.skipped + self.statistics.still_points - before.skipped,
            cut_backs: before.cut_backs,
            stabilisation_increments: before.stabilisation_increments,
            committed_iterates: before.committed_iterates,
            force_ratio: state.force_ratio,
            displacement_ratio: state.displacement_ratio,
            ends_stage: self.ends_stage(state.stage_fraction),
            convergence: state.convergence,
            flags: self.points.flags(),
            accuracy: self.accuracy,
        };
        let dimension = self.body.mesh().dimension.count();
        let points = self.point_fields(state.gradients);
        let formulation = self.problem.formulation;
        let volumes = points.iter().zip(self.body.settled_geometry()).map(|(fields, settled)| match formulation {
            Formulation::SmallStrain => settled.volume,
            Formulation::TotalLagrangian | Formulation::UpdatedLagrangian | Formulation::Corotational => {
                fields.volume
            }
        });
        let fluids = volumes.zip(self.points.all());
        let fluid_energy = fluids.map(|(volume, point)| volume * point.fluid_energy(formulation)).sum();
        let view = FieldsView {
            mesh: self.body.mesh(),
            displacements: &by_node(dimension, &self.body.displacements),
            reactions: &by_node(dimension, state.reactions),
            loads: &by_node(dimension, state.loads),
            hourglass_energy: state.hourglass_energy,
            fluid_energy,
            dynamics: state.dynamics,
            points: &points,
            statistics: &self.statistics,
        };
        session.observer.accepted(&report, &view).map_err(Outcome::Stopped)
    }

    /// Committed states of the points; `gradients` are those of the step that led there.
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
                pore_pressure: point.pore_pressure(self.problem.formulation),
                scalars: answer.scalars,
                observed: self.problem.formulation.observed_in_space(&answer.observed, &point.deformation),
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
