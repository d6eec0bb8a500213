//! The central difference method over one stage.
//!
//! At an instant `n` all forces are known and the velocity of the half step before; the equations of motion give the velocity
//! of the half step behind, and with it the displacements of the instant `n + 1`. Dampers inside elements see the half
//! step before, dampers at nodes the mean of both. A report about an instant is complete: its velocity is that mean.

use super::constrained_velocities::VelocityConstraints;
use super::dashpots::Dashpots;
use super::energy::{BalanceViolation, Forces, Monitor};
use super::handover::Handover;
use super::masses::{element_masses, nodal_masses, scale_factors};
use super::stage_context::StageContext;
use crate::element::PointGeometry;
use crate::material::PointMaterial;
use crate::model::assembly::forces::ElementLaws;
use crate::model::assembly::isotropic::Isotropic;
use crate::model::assembly::viscosity::Viscosity;
use crate::model::failure::failure;
use crate::model::stable_step::{ElementLimits, limits};
use crate::observer::{EnergyBalance, Outcome};
use crate::problem::dynamics::{Reporting, TimeStepRule};
use crate::problem::{Moment, ProblemError, Stage};
use crate::solve::driver::timed;
use nalgebra::Matrix3;
use protocol::TangentKind;

/// Tangent for the stable step: every contact sticks, the stiffest case.
const STIFFEST: TangentKind = TangentKind::TrussLike;

/// Factor on the stable step above which a step is more than rounding beyond it.
const LIMIT: f64 = 1.0 + 1e-6;

/// Most time steps of a stage: no run comes to the end of more, and most likely a number has a wrong unit.
const MOST_STEPS: f64 = 1e9;

/// A dynamic stage under way.
#[derive(Clone, Debug)]
pub(crate) struct Integrator {
    /// Bulk viscosity of the elements.
    pub(super) viscosity: Viscosity,
    /// By Gauss point, isotropic moduli of the state at the start of the stage, which bound the step.
    pub(super) stiffness: Vec<Isotropic>,
    /// By element, factor on its masses by mass scaling.
    pub(super) scale_factors: Vec<f64>,
    /// By node, kg.
    pub(super) masses: Vec<f64>,
    /// Added by mass scaling, kg.
    pub(super) added_mass: f64,
    pub(super) dashpots: Dashpots,
    /// Forces at absorbing sides in place of the supports that they replace, N, by degree of freedom.
    pub(super) held: Vec<f64>,
    pub(super) velocity_constraints: VelocityConstraints,
    /// Bound of the stable time step by the elastic tangents of the elements, s.
    pub(super) stable_step: f64,
    /// Time step, s, the instant from which it holds, s, and the number of that instant.
    pub(super) step: f64,
    pub(super) origin: (f64, u64),
    /// Time of the instant before this one, s.
    pub(super) time_before: f64,
    /// Instants passed, and those of the whole stage.
    pub(super) done: u64,
    pub(super) total: u64,
    /// Of the half step behind the instant, m/s.
    pub(super) ahead: Vec<f64>,
    /// Of the instant, m/s and m/s2.
    pub(super) velocity: Vec<f64>,
    pub(super) acceleration: Vec<f64>,
    pub(super) forces: Forces,
    pub(super) hourglass_energy: f64,
    pub(super) monitor: Monitor,
    /// Displacement gradients of the latest step.
    pub(super) gradients: Vec<Matrix3<f64>>,
    /// Displacement gradients since the last report.
    pub(super) gradients_since_report: Vec<Matrix3<f64>>,
}

impl Integrator {
    /// Begins a stage at the committed state, after the stage that `handover` comes from. Every point is evaluated once for its elastic
    /// tangent.
    ///
    /// # Errors
    /// The end of the run: a problem that does not fit, or points that cannot be evaluated.
    pub(crate) fn start(
        context: &mut StageContext<'_>,
        handover: Handover,
        material: &mut dyn PointMaterial,
    ) -> Result<Self, Outcome> {
        let still = vec![Matrix3::zeros(); context.points.all().len()];
        context.points.start_step();
        context.points.fix_ramps(&still);
        context.evaluate_points(&still, Moment { load: 0.0, time: 0.0 }, STIFFEST, material)?;
        material.rollback();
        context.points.forget_trials();
        let (dimension, formulation) = (context.problem.mesh.dimension, context.problem.formulation);
        let settings = context.settings;
        let stiffness: Vec<Isotropic> = context
            .points
            .all()
            .iter()
            .map(|point| Isotropic::of(dimension, &point.total(formulation).moduli))
            .collect();
        let viscosity = Viscosity::new(settings.damping, settings.viscosity, settings.density);
        let dashpots = Dashpots::of_stage(context, &stiffness, &vec![1.0; context.problem.mesh.elements.len()]);
        let velocity_constraints = context.velocity_constraints(&dashpots).map_err(Outcome::Refused)?;
        let mut integrator = Self {
            viscosity,
            scale_factors: Vec::new(),
            masses: Vec::new(),
            added_mass: 0.0,
            dashpots,
            held: context.body.zero(),
            velocity_constraints,
            stiffness,
            step: 0.0,
            stable_step: f64::INFINITY,
            origin: (0.0, 0),
            time_before: 0.0,
            done: 0,
            total: 0,
            ahead: context.body.zero(),
            velocity: handover.velocity.clone().unwrap_or_else(|| context.body.zero()),
            acceleration: context.body.zero(),
            forces: Forces::default(),
            hourglass_energy: 0.0,
            monitor: Monitor::new(settings.energy_tolerance, settings.longest_excess),
            gradients_since_report: still.clone(),
            gradients: still,
        };
        integrator.choose_masses_and_step(context)?;
        integrator.first_instant(context, &handover);
        Ok(integrator)
    }

    fn choose_masses_and_step(&mut self, context: &StageContext<'_>) -> Result<(), Outcome> {
        let masses = element_masses(context.body, context.settings).map_err(Outcome::Refused)?;
        let limits = limits(&self.laws(context), context.constraints, &masses);
        self.scale_factors = scale_factors(context.settings, &limits);
        self.dashpots = Dashpots::of_stage(context, &self.stiffness, &self.scale_factors);
        (self.masses, self.added_mass) = nodal_masses(context.body, &masses, &self.scale_factors);
        self.choose_step(context, &limits)
    }

    /// Divides what is left of the stage into equal steps.
    ///
    /// # Errors
    /// They are more than any run comes to the end of.
    pub(super) fn choose_step(
        &mut self,
        context: &StageContext<'_>,
        limits: &[ElementLimits],
    ) -> Result<(), Outcome> {
        let critical = limits
            .iter()
            .zip(&self.scale_factors)
            .map(|(limits, factor)| limits.scaled(*factor).step())
            .fold(f64::INFINITY, f64::min);
        let wanted = match context.settings.step {
            TimeStepRule::Stable { safety } => safety * critical,
            TimeStepRule::Fixed { step } => step,
        };
        self.stable_step = critical;
        let now = self.time();
        let left = context.stage.duration - now;
        // A sliver of a step at the end would only be rounding.
        let steps = (left / wanted - 1e-9).ceil().max(1.0);
        if steps.is_nan() || steps > MOST_STEPS {
            return Err(Outcome::Refused(ProblemError::Number {
                what: "the number of time steps (loading.duration over dynamics.time_step or the stable step)",
                requirement: "at most 1e9",
                value: steps,
            }));
        }
        self.origin = (now, self.done);
        self.step = left / steps;
        self.total = self.done + steps as u64;
        if self.is_above_stable_step() {
            let (time_step, stable_step) = (self.step, self.stable_step);
            tracing::warn!(event = "time_step_above_the_stable_one", time_step, stable_step);
        }
        Ok(())
    }

    /// One time step: displacements, stresses, forces, velocities, energies.
    ///
    /// # Errors
    /// The end of the run; [`Outcome::Unstable`] names the step and the remedy.
    pub(crate) fn advance(
        &mut self,
        context: &mut StageContext<'_>,
        material: &mut dyn PointMaterial,
    ) -> Result<(), Outcome> {
        let path: Vec<f64> = self.ahead.iter().map(|velocity| velocity * self.step).collect();
        self.gradients = context.body.gradients(&path);
        let is_sound = |gradient: &Matrix3<f64>| (Matrix3::identity() + gradient).determinant() > 0.0;
        if let Some(point) = self.gradients.iter().position(|gradient| !is_sound(gradient)) {
            return Err(self.unstable(format!("Gauss point {point} is turned inside out")));
        }
        let every = context.settings.tangent_every;
        let renews = every > 0 && (self.done + 1).is_multiple_of(every);
        context.points.fix_ramps(&self.gradients);
        let tangent = if renews { STIFFEST } else { TangentKind::None };
        let next = self.moment(context, self.time() + self.step);
        context.evaluate_points(&self.gradients, next, tangent, material).map_err(|outcome| self.at_step(outcome))?;
        material.commit().map_err(|error| failure(error).into_outcome())?;
        context.body.commit(&path);
        context.points.commit(&self.gradients);
        for (total, gradient) in self.gradients_since_report.iter_mut().zip(&self.gradients) {
            *total = context.problem.formulation.joined(total, gradient);
        }
        self.time_before = self.time();
        self.done += 1;
        context.statistics.time_steps += 1;
        let is_inverted = |geometry: &PointGeometry| geometry.volume.is_nan() || geometry.volume <= 0.0;
        if let Some(point) = context.body.settled_geometry().iter().position(is_inverted) {
            return Err(self.unstable(format!("the element of Gauss point {point} is turned inside out")));
        }
        let mut nanoseconds = 0;
        timed(&mut nanoseconds, || self.next_instant(context, &path, renews))?;
        context.statistics.assembly_nanoseconds += nanoseconds;
        self.check_energy()
    }

    /// Ends a run whose energies do not add up.
    fn check_energy(&self) -> Result<(), Outcome> {
        let balance = self.monitor.balance;
        let (largest, residual) = (balance.largest, balance.relative_residual());
        match self.monitor.excess(self.is_above_stable_step()) {
            None => Ok(()),
            Some(BalanceViolation::Unstable) => Err(self.unstable(format!(
                "the body holds {largest:.1e} J, far more than it was given, and the energy balance is off by {residual:.1e} \
                 of that"
            ))),
            Some(BalanceViolation::Unresolved) if self.is_above_stable_step() => {
                Err(self.unstable(format!("the energy balance is off by {residual:.1e} of the largest energy")))
            }
            Some(BalanceViolation::Unresolved) => Err(self.unstable(format!(
                "the energy balance has been off by more than it may for {} steps, now by {residual:.1e} of the largest \
                 energy: the motion is too fast for the time step, though it does not grow",
                balance.longest_excess
            ))),
        }
    }

    pub(super) fn laws<'s>(&'s self, context: &'s StageContext<'_>) -> ElementLaws<'s> {
        ElementLaws {
            body: context.body,
            points: context.points,
            stiffness: &self.stiffness,
            viscosity: self.viscosity,
            densities: &context.settings.element_densities,
            hourglass: context.problem.hourglass,
        }
    }

    pub(super) fn moment(&self, context: &StageContext<'_>, time: f64) -> Moment {
        Moment { load: time / context.stage.duration, time }
    }

    /// Whether the time step, which was given then, is above the stable one.
    fn is_above_stable_step(&self) -> bool {
        self.step > LIMIT * self.stable_step
    }

    pub(super) fn unstable(&self, reason: String) -> Outcome {
        let reason = if self.is_above_stable_step() {
            format!("{reason}; elements are stable up to a time step of {:.3e} s", self.stable_step)
        } else {
            reason
        };
        Outcome::Unstable { step: self.done, time: self.time(), time_step: self.step, reason }
    }

    /// What a failed evaluation means: smaller steps have been tried by the points that refused.
    fn at_step(&self, outcome: Outcome) -> Outcome {
        match outcome {
            Outcome::DidNotConverge { reason } => self.unstable(reason),
            other => other,
        }
    }

    /// Time since the stage began, s.
    pub(crate) fn time(&self) -> f64 {
        self.origin.0 + self.step * (self.done - self.origin.1) as f64
    }

    /// Share of the stage that has passed; exactly 1 at its end.
    pub(crate) fn load(&self, stage: &Stage) -> f64 {
        if self.is_done() { 1.0 } else { self.time() / stage.duration }
    }

    /// Whether the stage is over.
    pub(crate) fn is_done(&self) -> bool {
        self.done >= self.total
    }

    /// Whether the instant is to be reported.
    pub(crate) fn is_reported(&self, reporting: Reporting) -> bool {
        let passed = |time: f64, interval: f64| (time / interval + 1e-9).floor();
        let is_due = match reporting {
            Reporting::Steps(steps) => self.done.is_multiple_of(steps),
            Reporting::Interval(interval) => passed(self.time(), interval) > passed(self.time_before, interval),
        };
        is_due || self.is_done()
    }

    /// Energies since the stage began.
    pub(crate) fn energy(&self) -> EnergyBalance {
        self.monitor.balance
    }

    /// Velocities of the instant, m/s.
    pub(crate) fn velocity(&self) -> &[f64] {
        &self.velocity
    }

    /// Accelerations of the instant, m/s2.
    pub(crate) fn acceleration(&self) -> &[f64] {
        &self.acceleration
    }

    /// Forces of the supports, N.
    pub(crate) fn reactions(&self) -> &[f64] {
        &self.forces.reactions
    }

    /// Forces of the loads, N.
    pub(crate) fn loads(&self) -> &[f64] {
        &self.forces.loads
    }

    /// Energy in hourglass springs, or taken by hourglass dashpots since the stage began, J.
    pub(crate) fn hourglass_energy(&self) -> f64 {
        self.hourglass_energy
    }

    /// Displacement gradients since the last report.
    pub(crate) fn gradients_since_report(&self) -> &[Matrix3<f64>] {
        &self.gradients_since_report
    }

    /// Notes that the instant has been reported.
    pub(crate) fn reported(&mut self) {
        self.gradients_since_report.fill(Matrix3::zeros());
    }

    /// Instants passed.
    pub(crate) fn done(&self) -> u64 {
        self.done
    }

    /// Time step, s.
    pub(crate) fn step(&self) -> f64 {
        self.step
    }

    /// Bound of the stable time step by the elastic tangents of the elements, s.
    pub(crate) fn stable_step(&self) -> f64 {
        self.stable_step
    }

    /// Added by mass scaling, kg, and the mass of the body with it.
    pub(crate) fn added_mass(&self) -> (f64, f64) {
        (self.added_mass, self.masses.iter().sum())
    }
}
