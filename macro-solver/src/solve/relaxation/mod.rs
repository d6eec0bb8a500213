//! One attempt at one load step by dynamic relaxation.
//!
//! Every iterate is evaluated from the committed state. Erratum: [Liu2018] feeds each transient iterate to a material that
//! remembers its path; here only the equilibrium is committed, so the detours of the motion leave no trace.

mod headway;
mod motion;

use super::accepted::{Attempted, Converged};
use super::driver::{Session, Solver};
use super::procedure::LoadStepMethod;
use super::vectors::{difference, norm, sum};
use crate::element::mass::{Lumping, lumped_masses};
use crate::model::failure::Failure;
use crate::model::stable_step::limits;
use crate::observer::{Convergence, IterationReport};
use crate::problem::ForceMeasure;
use crate::problem::relaxation::{RelaxationForm, RelaxationSettings};
use headway::{ALLOWED, Headway};
use motion::Relaxation;
use nalgebra::Matrix3;
use protocol::TangentKind;

/// Iterations between two reports on a motion that goes on.
const REPORT_EVERY: usize = 50;

impl LoadStepMethod for RelaxationSettings {
    fn attempt(
        &self,
        solver: &mut Solver<'_>,
        stage_fraction: f64,
        _again: bool,
        session: &mut Session<'_>,
    ) -> Result<Attempted, Failure> {
        solver.relax(self, stage_fraction, session).map(Attempted::Converged)
    }

    fn iterations_govern_step_size(&self) -> bool {
        false
    }

    fn can_be_stabilised(&self) -> bool {
        false
    }
}

impl Solver<'_> {
    /// Tries to reach `load` from the committed state.
    fn relax(
        &mut self,
        settings: &RelaxationSettings,
        load: f64,
        session: &mut Session<'_>,
    ) -> Result<Converged, Failure> {
        if self.constraints.free().is_empty() {
            return self.follow_supports(load, session);
        }
        let (masses, highest) = self.relaxation_masses(session)?;
        let masses = self.masses_along_unknowns(masses);
        let is_free: Vec<bool> = (0..masses.len()).map(|dof| self.constraints.unknown(dof).is_some()).collect();
        let mut relaxation = Relaxation::new(settings, &masses, &is_free, highest);
        let share = self.share_to_repeat(load);
        let mut iterate = self.first_iterate(load, share);
        self.fix_relaxation_ramps(&iterate, load, share.is_some());
        let tolerance = self.stage().tolerances.force;
        let mut headway = Headway::new();
        let mut last = String::new();
        let mut change = self.body.zero();
        let mut before = self.body.zero();
        let relative = |change: &[f64], iterate: &[f64]| norm(change) / norm(iterate).max(f64::MIN_POSITIVE);
        for iteration in 1..=settings.max_iterations {
            self.statistics.iterations += 1;
            let norms = self.evaluate_forces(&iterate, load, session)?;
            match settings.form {
                RelaxationForm::Corrected if iteration == 1 => {}
                RelaxationForm::Corrected => {
                    let forces = self.along_unknowns(difference(&self.balance.internal, &before));
                    relaxation.observe(&change, &forces);
                }
                RelaxationForm::AsPrinted => {
                    let forces = self.along_unknowns(self.balance.internal.clone());
                    relaxation.observe(&sum(&self.body.displacements, &iterate), &forces);
                }
            }
            before.clone_from(&self.balance.internal);
            relaxation.note_displacement(&iterate);
            let force_ratio = norms.ratio(ForceMeasure::Largest);
            last = format!("out-of-balance {force_ratio:.2e}, kinetic energy {:.2e}", relaxation.kinetic_ratio());
            if !force_ratio.is_finite() {
                return Err(Failure::Attempt(format!("the motion grew without bound in iteration {iteration}")));
            }
            if iteration > 1 && relaxation.is_settled(force_ratio, tolerance) {
                let displacement_ratio = relative(&change, &iterate);
                self.report_iteration(load, iteration, norms.evaluations, force_ratio, displacement_ratio, session);
                return Ok(Converged {
                    increment: iterate,
                    load,
                    iterations: iteration,
                    force_ratio,
                    displacement_ratio,
                    correction: None,
                    convergence: Convergence::Full,
                });
            }
            headway.note(iteration, force_ratio, &iterate);
            if settings.form == RelaxationForm::Corrected && headway.has_ended(iteration) {
                let displacement_ratio = relative(&change, &iterate);
                return self.best_of(headway, iteration, displacement_ratio, load, session);
            }
            if iteration % REPORT_EVERY == 0 {
                let displacement_ratio = relative(&change, &iterate);
                self.report_iteration(load, iteration, norms.evaluations, force_ratio, displacement_ratio, session);
            }
            let ratio = relaxation.step_ratio();
            if ratio > 1.0 {
                return Err(Failure::Attempt(format!(
                    "iteration {iteration} asks for {ratio:.2} times the critical time step, so the motion would grow without \
                     bound: the printed form takes one frequency for damping and step; use form = \"corrected\""
                )));
            }
            change = relaxation.advance(&self.along_unknowns(self.balance.residual()));
            if self.has_links() {
                change = self.constraints.expand(&self.constraints.select(&change));
            }
            iterate = sum(&iterate, &change);
        }
        Err(Failure::Attempt(format!("not at rest after {} iterations: {last}", settings.max_iterations)))
    }

    /// The end of a motion without headway, which still moves by `displacement_ratio` of the step in an iteration: its best iterate, where a step
    /// that stagnates may end there.
    fn best_of(
        &mut self,
        headway: Headway,
        iteration: usize,
        displacement_ratio: f64,
        load: f64,
        session: &mut Session<'_>,
    ) -> Result<Converged, Failure> {
        let tolerances = &self.stage().tolerances;
        let allowed = if tolerances.stagnated_force > 0.0 { tolerances.stagnated().force } else { 0.0 };
        if headway.best > allowed {
            return Err(Failure::Attempt(format!(
                "no headway in {ALLOWED} iterations: out-of-balance {:.2e} at best after {iteration}",
                headway.best
            )));
        }
        let norms = self.evaluate_forces(&headway.iterate, load, session)?;
        let force_ratio = norms.ratio(ForceMeasure::Largest);
        self.report_iteration(load, iteration, norms.evaluations, force_ratio, displacement_ratio, session);
        Ok(Converged {
            increment: headway.iterate,
            load,
            iterations: iteration,
            force_ratio,
            displacement_ratio,
            correction: None,
            convergence: Convergence::Stagnated,
        })
    }

    /// The step of a body of which nothing is free: no motion has to come to rest.
    fn follow_supports(&mut self, load: f64, session: &mut Session<'_>) -> Result<Converged, Failure> {
        let increment = self.first_iterate(load, None);
        self.points.fix_ramps(&self.body.gradients(&increment));
        self.statistics.iterations += 1;
        let norms = self.evaluate_forces(&increment, load, session)?;
        let force_ratio = norms.ratio(ForceMeasure::Largest);
        self.report_iteration(load, 1, norms.evaluations, force_ratio, 0.0, session);
        Ok(Converged {
            increment,
            load,
            iterations: 1,
            force_ratio,
            displacement_ratio: 0.0,
            correction: None,
            convergence: Convergence::Full,
        })
    }

    /// Masses of all degrees of freedom for a mass density of 1 kg/m3, and the bound of the frequencies with them, rad/s. Every point
    /// is evaluated once for its elastic tangent at the committed state.
    fn relaxation_masses(&mut self, session: &mut Session<'_>) -> Result<(Vec<f64>, f64), Failure> {
        self.evaluate_points(&self.body.zero(), self.load, TangentKind::TrussLike, session)?;
        let (mesh, dimension) = (self.body.mesh(), self.body.mesh().dimension.count());
        let mut by_element = Vec::with_capacity(mesh.elements.len());
        let mut masses = self.body.zero();
        for (element, nodes) in mesh.elements.iter().enumerate() {
            let positions = mesh.element_positions(element);
            let own = lumped_masses(mesh.kinds[element], &positions, 1.0, Lumping::Hrz)
                .expect("masses in proportion to squares are positive");
            for (&node, mass) in nodes.iter().zip(&own) {
                (0..dimension).for_each(|axis| masses[dimension * node + axis] += mass);
            }
            by_element.push(own);
        }
        let limits = limits(&self.element_laws(), &self.constraints, &by_element);
        Ok((masses, limits.iter().map(|limits| limits.frequency).fold(0.0, f64::max)))
    }

    fn has_links(&self) -> bool {
        self.constraints.followers().next().is_some()
    }

    /// Masses of the motion of the unknowns. Displacements `u = T v + g` of linked components move the masses `T^T M T`, of which a
    /// diagonal takes the place that is nowhere below it, the sums of the absolute values of its rows: the frequencies stay below the bound
    /// of the elements. Followers have none left.
    fn masses_along_unknowns(&self, mut masses: Vec<f64>) -> Vec<f64> {
        for (dof, masters) in self.constraints.followers() {
            let reach: f64 = masters.iter().map(|(_, share)| share.abs()).sum();
            let mass = std::mem::take(&mut masses[dof]);
            masters.iter().for_each(|&(master, share)| masses[master] += mass * share.abs() * reach);
        }
        masses
    }

    /// Forces at all degrees of freedom as forces along the unknowns, `T^T f`, each at its own degree of freedom; none at followers.
    fn along_unknowns(&self, mut forces: Vec<f64>) -> Vec<f64> {
        if self.has_links() {
            for (&dof, force) in self.constraints.free().iter().zip(self.constraints.restrict(&forces)) {
                forces[dof] = force;
            }
            self.constraints.followers().for_each(|(dof, _)| forces[dof] = 0.0);
        }
        forces
    }

    /// Prescribed components are exact; the free ones repeat the share `share` of the last step, or stay where they are, and what is linked
    /// follows.
    fn first_iterate(&self, load: f64, share: Option<f64>) -> Vec<f64> {
        let moment = self.moment(load);
        let mut iterate = self.given(moment);
        if let Some((share, last)) = share.zip(self.last_step.as_ref()) {
            for &dof in self.constraints.free() {
                iterate[dof] = last.increment[dof] * share;
            }
            self.constraints.complete(&mut iterate, &self.body.displacements, moment);
        }
        iterate
    }

    /// Fixes the ramps: by the first iterate if it repeats the last step, or all alike by the mean strain that the supports impose, since
    /// it then strains their neighbourhood alone, or by that of the loads if it is larger.
    fn fix_relaxation_ramps(&mut self, iterate: &[f64], load: f64, repeats: bool) {
        let gradients = self.body.gradients(iterate);
        if repeats {
            self.points.fix_ramps(&gradients);
            return;
        }
        let imposed = iterate.iter().fold(0.0, |largest: f64, value| largest.max(value.abs())) / self.body.extent();
        let strain = imposed.max(self.strain_under_loads(load));
        self.points.fix_ramps(&vec![Matrix3::identity() * strain; gradients.len()]);
    }

    /// Mean strain that the loads cause beyond the committed state, estimated with the stiffest modulus of the points, which have answered a
    /// null trial: within a few times of what comes, for the number of ramp steps alone.
    fn strain_under_loads(&self, load: f64) -> f64 {
        let still = self.body.zero();
        let residual = self.constraints.restrict(&self.forces_at(&still, load).residual());
        let pushed: f64 = residual.iter().map(|force| force.abs()).sum();
        let volume: f64 = self.body.settled_geometry().iter().map(|geometry| geometry.volume).sum();
        let formulation = self.body.formulation();
        let moduli = self.points.all().iter().map(|point| point.total(formulation).moduli.amax());
        let stiffest = moduli.fold(0.0, f64::max);
        if stiffest > 0.0 { pushed * self.body.extent() / (volume * stiffest) } else { 0.0 }
    }

    fn report_iteration(
        &self,
        load: f64,
        iteration: usize,
        evaluations: u64,
        force_ratio: f64,
        displacement_ratio: f64,
        session: &mut Session<'_>,
    ) {
        session.observer.iterated(&IterationReport {
            step: self.step,
            load,
            iteration,
            evaluations,
            force_ratio,
            displacement_ratio: Some(displacement_ratio),
            rejected: false,
        });
    }
}
