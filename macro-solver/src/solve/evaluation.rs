//! Evaluation of an iterate, for all procedures that look for an equilibrium: the points at their displacement gradients, then the
//! balance of forces with or without the stiffness.

use super::driver::{Session, Solver, timed};
use super::residual_norms::ResidualNorms;
use super::vectors::sum;
use crate::model::assembly::balance::Balance;
use crate::model::assembly::forces::{ElementLaws, Motion};
use crate::model::assembly::viscosity::Viscosity;
use crate::model::failure::Failure;
use nalgebra::Matrix3;
use protocol::TangentKind;

impl Solver<'_> {
    /// Displacement gradients of an increment as they are sent to the points.
    pub(super) fn gradients(&self, increment: &[f64]) -> Vec<Matrix3<f64>> {
        self.points.rounded(self.body.gradients(increment))
    }

    /// Evaluates all points at an iterate and assembles forces and stiffness.
    pub(super) fn evaluate(
        &mut self,
        increment: &[f64],
        load: f64,
        session: &mut Session<'_>,
    ) -> Result<ResidualNorms, Failure> {
        let kind = self.tangents.kind(self.tangent_kind);
        self.statistics.frozen_network_iterates += u64::from(kind != TangentKind::None && kind != self.tangent_kind);
        self.points.let_secants_hold(self.tangents.is_smooth());
        let norms = self.balance_at(increment, load, kind, session)?;
        self.tangents.evaluated();
        Ok(norms)
    }

    /// Evaluates all points at an iterate, with these tangents, and assembles the balance.
    pub(super) fn balance_at(
        &mut self,
        increment: &[f64],
        load: f64,
        tangent: TangentKind,
        session: &mut Session<'_>,
    ) -> Result<ResidualNorms, Failure> {
        let evaluations = self.evaluate_points(increment, load, tangent, session)?;
        let moment = self.moment(load);
        self.balance = timed(&mut self.statistics.assembly_nanoseconds, || {
            self.body.balance(increment, &self.points, &self.loads, moment)
        });
        Ok(self.residual_norms(evaluations))
    }

    /// Evaluates all points at an iterate, with the friction at a load factor; the number of evaluations.
    pub(super) fn evaluate_points(
        &mut self,
        increment: &[f64],
        load: f64,
        tangent: TangentKind,
        session: &mut Session<'_>,
    ) -> Result<u64, Failure> {
        let gradients = self.gradients(increment);
        if let Some(point) = self.body.inverted_point(&gradients, &self.body.geometry(increment)) {
            let element = self.body.element_of(point);
            return Err(Failure::Attempt(format!("element {element} is turned inside out at Gauss point {point}")));
        }
        self.points.set_friction(&self.frictions.reductions(self.moment(load)));
        let mut waiting = 0;
        let counts =
            timed(&mut waiting, || self.points.evaluate(&gradients, tangent, session.material, &mut self.statistics));
        self.statistics.material_nanoseconds += waiting;
        Ok(counts?.evaluated)
    }

    /// Norms of the assembled balance.
    pub(super) fn residual_norms(&self, evaluations: u64) -> ResidualNorms {
        let largest_forces = self.statistics.largest_forces;
        ResidualNorms::of(&self.balance, &self.constraints, self.body.extent(), largest_forces, evaluations)
    }

    /// Evaluates all points at an iterate and assembles forces alone.
    pub(super) fn evaluate_forces(
        &mut self,
        iterate: &[f64],
        load: f64,
        session: &mut Session<'_>,
    ) -> Result<ResidualNorms, Failure> {
        let evaluations = self.evaluate_points(iterate, load, TangentKind::None, session)?;
        let mut assembling = 0;
        self.balance = timed(&mut assembling, || self.forces_at(iterate, load));
        self.statistics.assembly_nanoseconds += assembling;
        Ok(self.residual_norms(evaluations))
    }

    /// Forces at an iterate that the points have evaluated.
    pub(super) fn forces_at(&self, iterate: &[f64], load: f64) -> Balance {
        let positions = self.body.positions(iterate);
        let displacements = sum(&self.body.displacements, iterate);
        let forces = self.element_laws().forces(Motion {
            geometry: &self.body.integration_geometry(&positions),
            displacements: &displacements,
            velocity: &self.body.zero(),
        });
        Balance {
            internal: sum(&forces.internal, &forces.hourglass),
            external: self.loads.force(&positions, self.moment(load)),
            blocks: Vec::new(),
            hourglass_energy: forces.hourglass_energy,
        }
    }

    /// The elements without viscosity, whose stiffness no one asks for.
    pub(super) fn element_laws(&self) -> ElementLaws<'_> {
        ElementLaws {
            body: &self.body,
            points: &self.points,
            stiffness: &[],
            viscosity: Viscosity::NONE,
            densities: &[],
            hourglass: self.problem.hourglass,
        }
    }
}
