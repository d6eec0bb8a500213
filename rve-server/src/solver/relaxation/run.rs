//! The run of one cell through a trial: which step comes next, and when it is over.
//!
//! Everything here is decided from the cell's own numbers, so its path does not depend on the other cells of the
//! batch.

use super::convergence::{Advice, ConvergenceMonitor};
use super::criterion::{ENERGY_HITS, Imbalance};
use super::damping::{Damper, Kick, mass_factor};
use super::setting::Setting;
use crate::cell::Cell;
use crate::contact::ContactLaw;
use crate::definition::{AtStepCap, Criterion};
use crate::solver::answered_by::AnsweredBy;
use crate::solver::grain_solver::{PathEnergies, SolveJob, Solved};
use crate::solver::kernel::StepSums;
use crate::space::{Space, Tensor, add_scaled, inverse, largest_component, product};
use protocol::RveError;

/// `omega_max` stays below this share of the stability limit, so that contacts born between two checks do no harm.
const SAFETY: f64 = 0.8;

/// The same for spheres: with it the full step is a stable descent too, see [`super::damping::descent_share`].
const SAFETY_OF_SPHERES: f64 = 0.7;

/// Mass of a cell over the stiffness of one of its contacts, roughly: that of the grain which its contacts hold most stiffly, see
/// [`Run::raise_mass`].
const MASS_OVER_STIFFNESS: f64 = 6.0;

/// The share in force.
fn safety<S: Space>() -> f64 {
    if S::DIMENSION == 3 { SAFETY_OF_SPHERES } else { SAFETY }
}

/// Steps between two checks of the stiffness bound.
const STIFFNESS_INTERVAL: u64 = 64;

/// Growth of the normal forces that calls for a new check: contacts stiffen with them in some laws, at most in proportion.
const PRESSED: f64 = 1.05;

/// Growth of the number of contacts of a gas since the last look at the stiffness, as a share of it, with which it is looked at again.
const CONTACT_GROWTH: f64 = 0.1;

/// Fewest relaxation steps after the ramp: the moment at which the ramp ends says little about equilibrium.
const FEWEST_HOLD_STEPS: u32 = 10;

/// Phases of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Its contacts have not been evaluated yet.
    Fresh,
    Ramp,
    Hold,
    /// Held still for an evaluation without viscous forces, which could pass for equilibrium.
    Rest,
}

/// The path of one cell through `I + tau strain`, `tau` from 0 to 1, and the hold after it.
#[derive(Clone, Debug)]
pub(crate) struct Run<S: Space> {
    start: Cell<S>,
    strain: S::Tensor,
    ramp_steps: u32,
    phase: Phase,
    /// Steps done in the present phase.
    step: u32,
    stretch: S::Tensor,
    evaluations: u64,
    hits: u32,
    mass: f64,
    /// Whether contacts have been born, or pressed harder, since the last check of the stiffness bound.
    is_stiffer: bool,
    /// Sum of the normal forces at that check, N.
    looked_at: f64,
    /// Contacts then.
    looked_at_contacts: f64,
    damper: Damper,
    sums: StepSums<f64>,
    old_power: f64,
    /// Work lost to friction since the start of the run, J.
    pub(crate) dissipation: f64,
    /// Affine motion of the step that is evaluated next.
    affine: S::Tensor,
    /// Work on the cell since the start of the run, J, if it is counted.
    work: Option<f64>,
    /// Work and damping since the start of the run, if they are counted.
    energies: Option<PathEnergies>,
    /// Largest sum of normal forces that the cell has carried at rest, N.
    largest_load: f64,
    monitor: ConvergenceMonitor,
}

/// Motion of a cell in one step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Move<S: Space> {
    /// Affine motion in the step.
    pub(crate) affine: S::Tensor,
    /// The cell after it.
    pub(crate) cell: Cell<S>,
    pub(crate) kick: Kick,
    /// Whether contacts at the friction limit are counted.
    pub(crate) samples: bool,
    /// Whether the counts start from zero.
    pub(crate) clears_counts: bool,
}

impl<S: Space> Run<S> {
    /// At the start of a run. Without any ramp step the cell is only evaluated: nothing moves.
    pub(crate) fn new(job: &SolveJob<'_, S>) -> Self {
        let SolveJob { state, strain, ramp_steps, counts_work } = *job;
        let grains = state.positions.len();
        Self {
            start: state.cell,
            strain,
            ramp_steps,
            phase: Phase::Fresh,
            step: 0,
            stretch: S::Tensor::IDENTITY,
            evaluations: 0,
            hits: 0,
            mass: 0.0,
            is_stiffer: true,
            looked_at: 0.0,
            looked_at_contacts: 0.0,
            damper: Damper::new(safety::<S>()),
            sums: StepSums::default(),
            old_power: 0.0,
            dissipation: 0.0,
            affine: S::Tensor::ZERO,
            work: (counts_work && ramp_steps > 0).then_some(0.0),
            energies: None,
            largest_load: state.largest_load,
            monitor: ConvergenceMonitor::new(grains, S::DIMENSION),
        }
    }

    /// Number of evaluations in which contacts at the limit are counted.
    pub(crate) fn samples(&self) -> u32 {
        self.ramp_steps - self.ramp_steps / 2
    }

    /// Whether the stiffness of the contacts has to be looked at before the next step.
    pub(crate) fn needs_stiffness<C: ContactLaw<S::Kernel>>(&self, setting: &Setting<'_, C>) -> bool {
        // In a gas of grains the first contacts say little about how stiff the next ones make a grain, and a step that is too long makes
        // energy and throws grains away.
        let (grains, contacts) = (setting.radii.len(), self.sums.contacts);
        let stiffens = || {
            contacts < grains as f64
                || contacts > (1.0 + CONTACT_GROWTH) * self.looked_at_contacts
                || setting.first_touch_stiffness::<S>(f64::EPSILON) > 0.0
        };
        let is_due = || {
            self.mass == 0.0
                || self.evaluations.is_multiple_of(STIFFNESS_INTERVAL)
                || self.is_gas(grains) && stiffens()
        };
        self.is_stiffer && !matches!(self.phase, Phase::Fresh | Phase::Rest) && is_due()
    }

    /// The next step.
    ///
    /// `cell` is the present one. Where [`Run::needs_stiffness`], that has to be looked at before.
    pub(crate) fn next_move<C: ContactLaw<S::Kernel>>(&mut self, setting: &Setting<'_, C>, cell: Cell<S>) -> Move<S> {
        let still =
            Move { affine: S::Tensor::ZERO, cell, kick: Kick::default(), samples: false, clears_counts: false };
        self.affine = S::Tensor::ZERO;
        if matches!(self.phase, Phase::Fresh | Phase::Rest) {
            return still;
        }
        let kick = self.damper.kick(setting.options, self.mass, &self.sums, self.old_power);
        if self.phase == Phase::Hold {
            return Move { kick, ..still };
        }
        let step = self.step + 1;
        let share = f64::from(step) / f64::from(self.ramp_steps);
        let stretch = add_scaled(&S::Tensor::IDENTITY, share, &self.strain);
        // (I + tau' S) = (I + D) (I + tau S) with D = (tau' - tau) S (I + tau S)^-1, formed without cancellation.
        let increment = add_scaled(&S::Tensor::ZERO, 1.0 / f64::from(self.ramp_steps), &self.strain);
        let affine = product(&increment, &inverse(&self.stretch));
        (self.stretch, self.affine) = (stretch, affine);
        let half = self.ramp_steps / 2;
        let cell = self.start.deformed(&stretch);
        Move { affine, cell, kick, samples: step > half, clears_counts: step == half + 1 }
    }

    /// Whether hardly any grain has contacts enough to be held by them.
    fn is_gas(&self, grains: usize) -> bool {
        self.sums.contacts < 2.0 * grains as f64
    }

    /// Takes note of an evaluation. Returns how the run ended once it has.
    pub(crate) fn note<C>(
        &mut self,
        setting: &Setting<'_, C>,
        sums: &StepSums<f64>,
        old_power: f64,
    ) -> Option<Result<Solved, RveError>> {
        self.evaluations += 1;
        let is_finite = sums.motion_square.is_finite()
            && sums.normal_force.is_finite()
            && sums.force_square.is_finite()
            && sums.dissipation.is_finite();
        if !is_finite {
            return Some(Err(RveError::NotFinite { force_evaluations: self.evaluations }));
        }
        self.count_work(sums);
        if setting.counts_energies {
            self.count_energies(sums, old_power);
        }
        self.is_stiffer |= sums.new_contacts > 0.0 || sums.normal_force > PRESSED * self.looked_at;
        self.sums = *sums;
        self.old_power = old_power;
        self.dissipation += sums.dissipation + sums.opening_loss;
        match self.phase {
            Phase::Fresh if self.ramp_steps > 0 => {
                self.phase = Phase::Ramp;
                return None;
            }
            Phase::Ramp if self.step + 1 < self.ramp_steps => {
                self.step += 1;
                let unbalanced = self.imbalance(setting).ratio;
                return self.is_spent(setting).then(|| Err(self.gave_up(setting, unbalanced)));
            }
            Phase::Fresh => {
                self.phase = Phase::Hold;
                let imbalance = self.imbalance(setting);
                return Some(Ok(self.at_rest(setting, &imbalance)));
            }
            Phase::Ramp => (self.phase, self.step) = (Phase::Hold, 0),
            Phase::Hold => self.step += 1,
            Phase::Rest => {}
        }
        let needed = if setting.options.criterion == Criterion::Energy { ENERGY_HITS } else { 1 };
        let imbalance = self.imbalance(setting);
        let unbalanced = imbalance.ratio;
        if !unbalanced.is_finite() {
            return Some(Err(RveError::NotFinite { force_evaluations: self.evaluations }));
        }
        self.hits = if unbalanced <= setting.options.tolerance() { self.hits + 1 } else { 0 };
        let mut is_done = self.hits >= needed && self.step >= FEWEST_HOLD_STEPS;
        if setting.is_viscous && is_done && self.phase == Phase::Hold {
            (self.phase, is_done) = (Phase::Rest, false);
        } else {
            self.phase = Phase::Hold;
        }
        if is_done {
            return Some(Ok(self.at_rest(setting, &imbalance)));
        }
        let advice = self.monitor.note(self.step, &imbalance, self.sums.normal_force);
        if advice == Advice::Change {
            self.damper.change(self.mean_overlap() / setting.mean_radius);
        }
        let is_capped = self.step >= setting.options.max_steps() || advice == Advice::End;
        if self.is_spent(setting) || is_capped && setting.options.at_step_cap == AtStepCap::Refuse {
            return Some(Err(self.gave_up(setting, unbalanced)));
        }
        is_capped.then(|| Ok(self.ended(unbalanced, false, self.sums.contacts > 0.0)))
    }

    /// Mean overlap of the contacts, m, by the stiffness that the masses were taken from.
    fn mean_overlap(&self) -> f64 {
        MASS_OVER_STIFFNESS * self.sums.normal_force / (self.sums.contacts.max(1.0) * self.mass)
    }

    /// Whether the next step needs the virial for the work on the cell: while that moves.
    pub(crate) fn needs_virial(&self) -> bool {
        self.work.is_some() && matches!(self.phase, Phase::Fresh | Phase::Ramp)
    }

    /// Adds the work of the last step, if it is counted.
    fn count_work(&mut self, sums: &StepSums<f64>) {
        if self.needs_virial() {
            let work = self.work_of(sums);
            *self.work.get_or_insert_default() += work;
        }
    }

    /// Work of the contact forces on the affine motion of the step just evaluated, J, by the trapezium rule.
    fn work_of(&self, sums: &StepSums<f64>) -> f64 {
        let pairs = self.sums.virial.iter().zip(&sums.virial).zip(self.affine.components());
        pairs.map(|((before, after), affine)| 0.5 * (before + after) * affine).sum()
    }

    /// Adds the energies of the last step: forces before and after it on its motion. Grains begin every run without motion, so all work that
    /// the forces out of balance do on their motion is lost.
    fn count_energies(&mut self, sums: &StepSums<f64>, old_power: f64) {
        let work = self.work_of(sums);
        let energies = self.energies.get_or_insert_default();
        energies.work += work;
        energies.damping += 0.5 * (old_power + sums.power);
    }

    /// Whether all force evaluations that a trial may have are used up.
    fn is_spent<C>(&self, setting: &Setting<'_, C>) -> bool {
        setting.options.max_evaluations.is_some_and(|most| self.evaluations >= most)
    }

    /// How far the run got, for those who want no answer out of equilibrium.
    fn gave_up<C>(&self, setting: &Setting<'_, C>, unbalanced: f64) -> RveError {
        let increments = if self.phase == Phase::Ramp { self.step } else { self.ramp_steps };
        let target = largest_component(&self.strain);
        RveError::NotEquilibrated {
            strain: target * f64::from(increments) / f64::from(self.ramp_steps),
            target,
            increments: u64::from(increments),
            of: u64::from(self.ramp_steps),
            // Infinite before the first contact force; errors carry numbers.
            unbalanced: if unbalanced.is_finite() { unbalanced } else { f64::MAX },
            tolerance: setting.options.tolerance(),
            force_evaluations: self.evaluations,
        }
    }

    /// The end of a run whose grains are at rest, or that has only looked at them. The load of a packing that is far from rest under its law
    /// counts too: when such a cell falls apart as it comes to rest, nothing else tells that its last forces are rounding.
    fn at_rest<C>(&mut self, setting: &Setting<'_, C>, imbalance: &Imbalance) -> Solved {
        let load = self.sums.normal_force;
        let bears_load = imbalance.bears(load, self.largest_load, setting.options.tolerance());
        self.largest_load = self.largest_load.max(load);
        self.ended(imbalance.ratio, true, bears_load)
    }

    fn ended(&self, unbalanced: f64, equilibrated: bool, bears_load: bool) -> Solved {
        Solved {
            force_evaluations: self.evaluations,
            ramp_steps: self.ramp_steps,
            unbalanced,
            equilibrated,
            bears_load,
            changed_damping: self.damper.changes() > 0,
            answered_by: AnsweredBy::Relaxation,
            work: self.work,
            energies: self.energies,
        }
    }

    /// Largest sum of normal forces that the cell has carried at rest, N.
    pub(crate) fn largest_load(&self) -> f64 {
        self.largest_load
    }

    /// Whether the next kick depends on the work of the forces before the last step, although the damping chosen does not.
    pub(crate) fn needs_old_power(&self) -> bool {
        self.damper.changes() > 0
    }

    fn imbalance<C>(&self, setting: &Setting<'_, C>) -> Imbalance {
        let by = |criterion| Imbalance::by(criterion, setting.radii.len(), self.mass, &self.sums, self.largest_load);
        match (setting.options.criterion, self.phase) {
            // Grains are held while forces are taken without viscosity: their kinetic energy says nothing, but forces do.
            (Criterion::Energy, Phase::Rest) => by(Criterion::MaxForce).squared(),
            (criterion, _) => by(criterion),
        }
    }

    /// Raises the mass if the contacts have become stiffer; never lowers it within a run. `stiffness` is the largest own stiffness of
    /// a grain, N/m.
    pub(crate) fn raise_mass<C: ContactLaw<S::Kernel>>(&mut self, setting: &Setting<'_, C>, stiffness: f64) {
        let approach = largest_component(&self.strain) / f64::from(self.ramp_steps.max(1));
        let stiffness = stiffness.max(setting.first_touch_stiffness::<S>(approach));
        let factor = mass_factor(setting.options) * setting.law.mass_factor();
        let safety = safety::<S>();
        self.mass = self.mass.max(factor * stiffness / (2.0 * safety * safety));
        self.is_stiffer = false;
        (self.looked_at, self.looked_at_contacts) = (self.sums.normal_force, self.sums.contacts);
    }
}
