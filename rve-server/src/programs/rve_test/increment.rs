//! One increment: a trial where all components are strains, a search where stresses are controlled.

use super::error::{APART, ElementError, SMALLER_STEPS};
use super::path::{Matrix, flat, tensor_of};
use super::run::Run;
use super::search_limit::SearchLimit;
use super::servo::{Miss, Servo};
use super::step::Step;
use super::stress_control::StressControl;
use super::stress_relaxation::{LARGEST_JUMP, MOST_RELAXED, Relaxation, STEPS_BEFORE_NEAREST, is_out_of_range};
use super::test_file::COMPONENT_KEYS;
use super::tested_cell::TestedCell;
use crate::space::{Space, add_scaled};
use protocol::{Observables, TangentKind, Tensor2, TrialFlags, TrialOptions, TrialResult};

/// Largest miss of a controlled stress, relative to the mean pressure, from which it is relaxed where a search has failed and a shorter
/// stride could follow. From farther off the path would be another one.
const NEAR: f64 = 0.02;

/// Trials of one increment after which, once stresses had to be relaxed in it, its other parts are not searched any more: their stresses are
/// relaxed at once.
const MOST_SEARCHED: u32 = 400;

/// Trials and their DEM steps, those of searches that failed included.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spent {
    pub(super) trials: u32,
    pub(super) dem_steps: u64,
    /// Committed steps of relaxed stresses.
    pub(super) relaxed: u32,
    /// Those of them that have not come to rest.
    pub(super) restless: u32,
    /// The last trial had no load-bearing contacts.
    pub(super) is_apart: bool,
    /// The nearer side of a snap was kept, at least in a part of the increment.
    pub(super) has_jumped: bool,
}

/// An accepted trial and what it took.
pub(super) struct Accepted {
    pub(super) gradient: Matrix,
    pub(super) answer: TrialResult,
    pub(super) control: StressControl,
}

impl<C: TestedCell> Run<C> {
    /// One trial.
    pub(super) fn attempt(
        &mut self,
        step: &Step,
        gradient: &Matrix,
        ramp_steps: u32,
    ) -> Result<TrialResult, ElementError> {
        if self.stop.is_made() {
            return Err(ElementError::Interrupted { increment: self.summary.rows });
        }
        let options = TrialOptions {
            tangent: TangentKind::None,
            ramp_steps,
            observables: Observables::ALL,
            ..TrialOptions::default()
        };
        let target = Tensor2(flat(&step.kinematics.target(gradient, &step.committed_gradient)));
        let answer = self
            .cell
            .trial(&target, &options)
            .map_err(|reason| ElementError::Cell { increment: self.summary.rows, reason })?;
        self.spent.trials += 1;
        self.spent.dem_steps += answer.cost.force_evaluations;
        self.spent.is_apart = answer.flags.contains(TrialFlags::NO_LOAD_BEARING_CONTACTS);
        Ok(answer)
    }

    pub(super) fn keep_network(&mut self) {
        self.network = self.cell.trial_network().cloned();
    }

    pub(super) fn prescribed(&mut self, step: &Step) -> Result<Accepted, ElementError> {
        let answer = self.attempt(step, &step.gradient, 0)?;
        self.keep_network();
        Ok(Accepted { gradient: step.gradient, answer, control: StressControl::None })
    }

    /// One search for the controlled stresses. Where it fails although it came near, the cell has snapped on the way, each time to another
    /// stress: the nearest trial is committed and the stresses are relaxed from there. As the last resort the nearest trial is taken, if that
    /// is as near as a snap may leave it, and the stresses are relaxed otherwise, from however far.
    pub(super) fn controlled(&mut self, step: &Step, is_last_resort: bool) -> Result<Accepted, ElementError> {
        let elastic = self.elastic(step)?;
        let sliding = self.sliding(step)?;
        if Relaxation::new(&step.targets).is_sound(&elastic) {
            self.sound = Some(elastic);
        }
        let mut servo = Servo::new(&step.targets, &sliding, &elastic);
        let last_change = self.last_change.as_ref().filter(|change| step.goes_on_with(change));
        let mut gradient = match last_change {
            // Going on as before beats every operator while the path is smooth.
            Some(change) => step.with_unknowns(&add_scaled(&step.committed_gradient, 1.0, change)),
            None => servo.predict(&step.gradient, &step.expected_stress(&self.stress, &sliding)),
        };
        let mut ramp_steps = 0;
        let mut closest: Option<(Miss, f64, Matrix)> = None;
        let is_searched = self.spent.relaxed == 0 || self.spent.trials < MOST_SEARCHED;
        let mut limit = match (is_searched, is_last_resort) {
            (false, _) => SearchLimit::of_one_trial(),
            (true, false) => SearchLimit::of_a_stride(),
            (true, true) => SearchLimit::of_the_last_resort(),
        };
        while limit.goes_on() {
            let answer = match self.attempt(step, &gradient, ramp_steps) {
                // The search has left the range of one trial: the target lies beyond what the cell can carry.
                Err(ElementError::Cell { increment, reason }) if is_out_of_range(&reason) => {
                    if closest.is_none() {
                        return Err(ElementError::StressOutOfReach { increment, reason });
                    }
                    break;
                }
                answer => answer?,
            };
            // The first trial chooses the ramp for all: the stress would jump with its length otherwise.
            ramp_steps = u32::try_from(answer.cost.ramp_steps).unwrap_or(u32::MAX);
            let stress = tensor_of(&answer.stress.0);
            let scale = step.stress_scale(&stress, C::Grains::DIMENSION);
            let miss = servo.miss(&stress);
            limit.count(miss.distance());
            let tolerance = self.stress_tolerance * scale;
            let is_reached = miss.distance() <= tolerance;
            let is_at_jump = servo.has_pinned_a_jump(tolerance) && gradient == servo.best(&gradient);
            if is_reached || (is_at_jump && miss.distance() <= LARGEST_JUMP * scale) {
                self.spent.has_jumped |= !is_reached;
                self.keep_network();
                self.follow_up(&servo);
                let control = if is_reached { StressControl::Met } else { StressControl::Jump };
                return Ok(Accepted { gradient, answer, control });
            }
            if closest.is_none_or(|(best, ..)| miss.distance() < best.distance()) {
                closest = Some((miss, tolerance, gradient));
            }
            if is_at_jump {
                break;
            }
            gradient = servo.improve(&gradient, &stress);
            if servo.has_pinned_a_jump(tolerance) {
                gradient = servo.best(&gradient);
            }
        }
        self.forget_followed();
        let (miss, tolerance, gradient) = closest.expect("the first trial was answered");
        // A relaxation that may not end as near as a snap leaves it would end the test, where shorter strides are still to come.
        let has_room = self.spent.relaxed + STEPS_BEFORE_NEAREST < MOST_RELAXED;
        if !is_last_resort && has_room && self.stress_tolerance * miss.distance() <= NEAR * tolerance {
            return self.relaxed(step.clone(), gradient, ramp_steps);
        }
        if is_last_resort && self.stress_tolerance * miss.distance() <= LARGEST_JUMP * tolerance {
            let answer = self.attempt(step, &gradient, ramp_steps)?;
            self.spent.has_jumped = true;
            self.keep_network();
            return Ok(Accepted { gradient, answer, control: StressControl::Jump });
        }
        if is_last_resort {
            return self.relaxed(step.clone(), gradient, ramp_steps);
        }
        Err(self.not_reached(&miss, tolerance))
    }

    /// Takes the cell to `gradient` and from there, in committed steps, to the controlled stresses.
    fn relaxed(&mut self, mut step: Step, mut gradient: Matrix, ramp_steps: u32) -> Result<Accepted, ElementError> {
        let mut relaxation = Relaxation::new(&step.targets);
        let mut ramp = ramp_steps;
        let (mut taken, mut nearest): (_, Option<(Miss, f64)>) = (0, None);
        loop {
            let answer = self.attempt(&step, &gradient, std::mem::take(&mut ramp))?;
            self.keep_network();
            let stress = tensor_of(&answer.stress.0);
            let scale = step.stress_scale(&stress, C::Grains::DIMENSION);
            let miss = step.miss(&stress);
            let tolerance = self.stress_tolerance * scale;
            let is_reached = miss.distance() <= tolerance;
            let is_near = taken >= STEPS_BEFORE_NEAREST && miss.distance() <= LARGEST_JUMP * scale;
            if is_reached || is_near {
                self.spent.has_jumped |= !is_reached;
                let control = if is_reached { StressControl::Relaxed } else { StressControl::Jump };
                return Ok(Accepted { gradient, answer, control });
            }
            if nearest.is_none_or(|(best, _)| miss.distance() < best.distance()) {
                nearest = Some((miss, tolerance));
            }
            if self.spent.relaxed >= MOST_RELAXED || self.spent.restless >= C::MOST_RESTLESS {
                let (miss, tolerance) = nearest.expect("just set");
                return Err(self.not_reached(&miss, tolerance));
            }
            self.spent.restless += u32::from(answer.flags.contains(TrialFlags::NOT_EQUILIBRATED));
            let energies = self.cell.energies_of_trial();
            self.cell.commit().expect("the trial is the latest");
            step.advance_committed(gradient);
            self.work.advance(step.kinematics.committed, stress, energies);
            taken += 1;
            self.spent.relaxed += 1;
            let elastic = self.elastic(&step)?;
            let elastic = match self.sound {
                Some(sound) if !relaxation.is_sound(&elastic) => sound,
                _ => elastic,
            };
            gradient = relaxation.next(&gradient, &stress, &elastic);
        }
    }

    fn not_reached(&self, miss: &Miss, tolerance: f64) -> ElementError {
        ElementError::StressNotReached {
            increment: self.summary.rows,
            component: COMPONENT_KEYS[miss.component],
            reached: miss.reached,
            target: miss.target,
            tolerance,
            iterations: self.spent.trials,
            remedy: if self.spent.is_apart { APART } else { SMALLER_STEPS },
        }
    }
}
