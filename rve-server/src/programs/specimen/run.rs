//! The driver of a specimen test: stages of wall motion, rows of results.

use super::assembly::{Joinable, assembled, straightened};
use super::body::Body;
use super::checkpoint::{Checkpoints, Place};
use super::dynamics::{Dynamics, GrainSums};
use super::error::SpecimenError;
use super::glue_depth::refuse_glue_of_all;
use super::numbering::numbered_by_position;
use super::removal::weakened;
use super::results::{SpecimenEvent, SpecimenRow, SpecimenStart, SpecimenSummary};
use super::set_up::{SurroundingWalls, drop_springless_histories, in_three_axes, motion_of};
use super::stage::{Sheared, Stage};
use super::test_file::SpecimenTest;
use super::unsupported_grains::UnsupportedGrains;
use super::wall::WallDrive;
use crate::contact::{ContactLaw, ContactLaws, LawVisitor};
use crate::definition::PackingFile;
use crate::homogenization::fabric::LARGE_OVERLAP_RATIO;
use crate::simd::Tuple;
use crate::space::{Components, Discs, Spheres};
use std::ops::ControlFlow;

/// Default speed of the servo per missing force, relative to the walls' stiffness.
const SERVO_GAIN: f64 = 0.3;

/// Default largest strain of one step of a servo-controlled wall.
const LARGEST_STRAIN_PER_STEP: f64 = 1e-5;

/// Steps between two checks of balance and energy.
const BALANCE_INTERVAL: u64 = 100;

/// Energy that is missing, or too much, over the energy turned over: from here on a row is counted, and a run stops.
const ENERGY_COUNTED: f64 = 0.01;
const ENERGY_STOP: f64 = 0.1;

/// Distance of a controlled wall stress from its target, over the mean target, from which on a row is counted.
const SERVO_COUNTED: f64 = 0.01;

/// Largest unbalanced force over the mean contact force, in a motion that is to be quasi-static, from which on a row is counted. The shipped
/// biaxial tests reach 0.03 and 0.04 where the specimen snaps, ten times as fast 0.11. A sheared layer of 3000 spheres is above it in one row
/// of fifteen at 5e-7 per step, in every row at six times that.
const UNBALANCED_COUNTED: f64 = 0.1;

/// Difference of the shear forces of opposite walls over their normal force, in a motion that is to be quasi-static, from which on a row is
/// counted.
const SHEAR_COUNTED: f64 = 0.02;

/// Hears what a run does, and may end it.
type Listener<'a> = dyn FnMut(&SpecimenEvent<'_>) -> ControlFlow<()> + 'a;

/// Runs a test on a packing. Equal input gives equal bits for any number of threads.
///
/// # Errors
/// A test or packing that is not sound, or a motion that went out of control.
pub fn run_specimen<S: SpecimenFor>(
    test: &SpecimenTest,
    packing: &PackingFile<S>,
    listener: &mut dyn FnMut(&SpecimenEvent<'_>),
) -> Result<SpecimenSummary, SpecimenError> {
    S::run(test, packing, &Checkpoints::default(), &mut |event| {
        listener(event);
        ControlFlow::Continue(())
    })
}

/// As [`run_specimen`], with states on the way, or from one on: the rows from there on, and the summary, are those of an undisturbed
/// run, bit for bit. A listener that breaks ends the run after the present step, with a last state where states are handed out.
///
/// # Errors
/// As [`run_specimen`]; a state of another test or packing.
pub fn run_specimen_from<S: SpecimenFor>(
    test: &SpecimenTest,
    packing: &PackingFile<S>,
    checkpoints: &Checkpoints<'_>,
    listener: &mut Listener<'_>,
) -> Result<SpecimenSummary, SpecimenError> {
    S::run(test, packing, checkpoints, listener)
}

/// Spaces whose specimens can be run. The method is not generic, unlike what it calls: the dynamics are compiled once per
/// space, in this crate, and not again in every program that uses it.
pub trait SpecimenFor: Joinable {
    /// As [`run_specimen_from`].
    ///
    /// # Errors
    /// As [`run_specimen_from`].
    fn run(
        test: &SpecimenTest,
        packing: &PackingFile<Self>,
        checkpoints: &Checkpoints<'_>,
        listener: &mut Listener<'_>,
    ) -> Result<SpecimenSummary, SpecimenError>;
}

impl SpecimenFor for Discs {
    fn run(
        test: &SpecimenTest,
        packing: &PackingFile<Self>,
        checkpoints: &Checkpoints<'_>,
        listener: &mut Listener<'_>,
    ) -> Result<SpecimenSummary, SpecimenError> {
        run_stages(test, packing, checkpoints, listener)
    }
}

impl SpecimenFor for Spheres {
    fn run(
        test: &SpecimenTest,
        packing: &PackingFile<Self>,
        checkpoints: &Checkpoints<'_>,
        listener: &mut Listener<'_>,
    ) -> Result<SpecimenSummary, SpecimenError> {
        run_stages(test, packing, checkpoints, listener)
    }
}

fn run_stages<S: Joinable + ContactLaws>(
    test: &SpecimenTest,
    packing: &PackingFile<S>,
    checkpoints: &Checkpoints<'_>,
    listener: &mut Listener<'_>,
) -> Result<SpecimenSummary, SpecimenError> {
    test.validate(S::DIMENSION)?;
    let contact = test.contact_without_damping();
    contact.compile::<S, _>(Stages { test, packing, checkpoints, listener })?
}

/// All stages of a test, with whichever law its contact table chooses.
struct Stages<'a, S: Joinable> {
    test: &'a SpecimenTest,
    packing: &'a PackingFile<S>,
    checkpoints: &'a Checkpoints<'a>,
    listener: &'a mut Listener<'a>,
}

impl<S: Joinable> LawVisitor<S> for Stages<'_, S> {
    type Output = Result<SpecimenSummary, SpecimenError>;

    fn visit<C: ContactLaw<S>>(self, law: C) -> Self::Output {
        let mut run = Run::new(self.test, self.packing, law)?;
        if let Some(state) = self.checkpoints.from {
            run.restore(state)?;
        }
        while let Some(stage) = self.test.stage.get(run.place.stage as usize) {
            if run.follow(stage, self.checkpoints.every, self.listener)?.is_break() {
                run.summary.is_stopped = (run.place.stage as usize) < self.test.stage.len();
                break;
            }
        }
        Ok(SpecimenSummary {
            grains: run.dynamics.body.grains.len(),
            steps: run.dynamics.steps,
            renewals: run.dynamics.body.renewals,
            shortenings: run.dynamics.shortenings,
            ..run.summary
        })
    }
}

/// A test under way.
pub(super) struct Run<'a, S: Joinable, C: ContactLaw<S>> {
    pub(super) test: &'a SpecimenTest,
    pub(super) dynamics: Dynamics<S, C>,
    /// Numbers of the lower and upper wall of every walled axis.
    pub(super) walls: [Option<[usize; 2]>; 3],
    /// What shear columns of the table are about.
    pub(super) sheared: Vec<Sheared>,
    /// Side lengths of the box at the start, m.
    pub(super) sides: [f64; 3],
    /// Periods at the start, m: what they lean by.
    pub(super) leans: [[f64; 3]; 3],
    /// Out-of-plane thickness, m; 1, without a unit, in space.
    pub(super) thickness: f64,
    /// Volume of all grains, m3. Overlaps count twice.
    pub(super) solid: f64,
    /// Counts during the run.
    pub(super) summary: SpecimenSummary,
    /// Sums over the grains of the latest step; before the first, the largest unbalanced force alone.
    pub(super) last: GrainSums,
    /// Stage, step and row that the run has come to.
    pub(super) place: Place,
}

impl<'a, S: Joinable, C: ContactLaw<S>> Run<'a, S, C> {
    /// The start of a test: the packing cut and joined to a specimen, with walls around it and forces evaluated.
    ///
    /// # Errors
    /// A packing that cannot become this specimen, or walls that would hold all of its grains.
    fn new(test: &'a SpecimenTest, packing: &PackingFile<S>, law: C) -> Result<Self, SpecimenError> {
        let periodic = test.periodic_axes(S::DIMENSION)?;
        let upright = test.straighten.then(|| straightened(packing, periodic));
        let whole = assembled(upright.as_ref().unwrap_or(packing), &test.tiles, test.cut, periodic)?;
        let (weakened, removed) = weakened(whole, &test.region)?;
        let mut assembled = numbered_by_position(weakened);
        let thickness = if S::DIMENSION == 2 { packing.thickness } else { 1.0 };
        let volumes: Vec<f64> =
            assembled.grains.iter().map(|grain| S::grain_measure(grain.radius) * thickness).collect();
        let masses = volumes.iter().map(|volume| test.contact.density * volume).collect();
        let SurroundingWalls { walls, numbers, sides } = SurroundingWalls::of(test, &assembled, periodic, law);
        refuse_glue_of_all(test, &walls, &numbers, &assembled.grains, sides)?;
        let leans = in_three_axes::<S>(&assembled.periods);
        let springless = drop_springless_histories(test, &mut assembled.histories);
        let mut body = Body::new(law, assembled.grains, masses, test.contact.damping, assembled.periods);
        let histories = assembled.histories.iter();
        let dropped =
            body.adopt(histories.map(|history| (history.contact.key(), move |branch| history.axial(branch))));
        let mut run = Self {
            test,
            dynamics: Dynamics::new(body, walls, motion_of(test)),
            walls: numbers,
            sheared: test.sheared(),
            sides,
            leans,
            thickness,
            solid: volumes.iter().sum(),
            summary: SpecimenSummary::default(),
            last: GrainSums::default(),
            place: Place::default(),
        };
        let forces = run.dynamics.body.loads.iter().map(|load| load.force.dot(load.force).sqrt());
        run.last.largest_force = forces.fold(0.0, f64::max);
        run.summary.start = SpecimenStart {
            stress: run.contact_stress(),
            unbalanced_force_ratio: run.unbalanced(),
            histories: assembled.histories.len() - dropped,
            cut_through: assembled.cut_through,
            dropped,
            springless,
            slant: assembled.slant,
            removed,
        };
        Ok(run)
    }

    /// Sets the friction between the grains to that of a stage.
    pub(super) fn use_friction_of(&mut self, stage: &Stage) {
        let friction = stage.friction.unwrap_or(self.test.contact.friction);
        let law = self.dynamics.body.law().with_friction(friction);
        self.dynamics.body.change_law(law);
    }

    fn begin(&mut self, stage: &Stage) {
        self.use_friction_of(stage);
        self.place.lengths = std::array::from_fn(|axis| self.length(axis));
        self.place.periods = std::array::from_fn(|axis| {
            let period = self.dynamics.body.period(axis).unwrap_or(S::Vector::ZERO);
            std::array::from_fn(|along| if along < S::DIMENSION { period[along] } else { 0.0 })
        });
        let gripping: Vec<usize> =
            stage.glued_axes().into_iter().filter_map(|axis| self.walls[axis]).flatten().collect();
        if !gripping.is_empty() {
            self.dynamics.grip(gripping.into_iter(), self.test.walls.glue_depth);
        }
    }

    /// What is left of a stage.
    fn follow(
        &mut self,
        stage: &Stage,
        every: Option<u64>,
        listener: &mut Listener<'_>,
    ) -> Result<ControlFlow<()>, SpecimenError> {
        let mut asked = ControlFlow::Continue(());
        self.dynamics.expect_strain(self.strain_per_step(stage));
        if self.place.done == 0 {
            self.begin(stage);
            let begun = SpecimenEvent::Begun { stage: self.place.stage as usize, picture: &|| self.picture() };
            asked = listener(&begun);
        }
        let mut balanced = stage.until_balance.is_none();
        while self.place.done < stage.steps {
            self.drive(stage);
            self.last = self.dynamics.advance();
            self.place.done += 1;
            let done = self.place.done;
            if !self.last.kinetic_energy.is_finite() {
                return Err(SpecimenError::Diverged { stage: stage.name.clone(), step: done });
            }
            if done.is_multiple_of(BALANCE_INTERVAL) || done == stage.steps {
                self.check_energy(stage, done)?;
            }
            let at_balance = (done.is_multiple_of(BALANCE_INTERVAL) || done == stage.steps)
                && stage.until_balance.is_some_and(|limit| self.is_balanced(stage, limit));
            if done.is_multiple_of(BALANCE_INTERVAL) {
                let progress = SpecimenEvent::Progress { stage: self.place.stage as usize, step: done };
                asked = first_break(asked, listener(&progress));
            }
            // Row k of n is due when k / n of the stage is done.
            if done * stage.rows >= (self.place.row + 1) * stage.steps || at_balance || done == stage.steps {
                self.place.row = done * stage.rows / stage.steps;
                let result = self.row(stage);
                self.count(stage, &result);
                asked = first_break(asked, listener(&SpecimenEvent::Row(&result, self)));
            }
            balanced |= at_balance;
            let is_last = at_balance || done == stage.steps;
            if is_last {
                self.summary.unbalanced_stages += u64::from(!balanced);
                self.place = Place { stage: self.place.stage + 1, ..Place::default() };
            }
            if every.is_some_and(|every| asked.is_break() || self.dynamics.steps.is_multiple_of(every)) {
                asked = first_break(asked, listener(&SpecimenEvent::State(self.state())));
            }
            if is_last || asked.is_break() {
                break;
            }
        }
        Ok(asked)
    }

    /// Energy that is missing over the largest energy turned over so far: at the top of a flight all parts of it may be near zero.
    fn energy_error(&mut self) -> f64 {
        let (missing, now) = (self.dynamics.missing_energy(), self.dynamics.energy_turnover());
        if !missing.is_finite() || !now.is_finite() {
            return f64::INFINITY;
        }
        let turnover = self.summary.largest_turnover.max(now);
        self.summary.largest_turnover = turnover;
        if turnover > 0.0 { missing.abs() / turnover } else { 0.0 }
    }

    fn check_energy(&mut self, stage: &Stage, step: u64) -> Result<(), SpecimenError> {
        let error = self.energy_error();
        self.summary.largest_energy_error = self.summary.largest_energy_error.max(error);
        if error <= ENERGY_STOP {
            return Ok(());
        }
        Err(SpecimenError::EnergyLost {
            stage: stage.name.clone(),
            step,
            missing: self.dynamics.missing_energy(),
            percent: 100.0 * error,
        })
    }

    /// Counts what a row falls short in.
    fn count(&mut self, stage: &Stage, row: &SpecimenRow) {
        let error = self.energy_error();
        self.summary.energy_misses += u64::from(error > ENERGY_COUNTED);
        self.summary.largest_energy_error = self.summary.largest_energy_error.max(error);
        self.summary.overlap_misses += u64::from(row.max_overlap_ratio > LARGE_OVERLAP_RATIO);
        self.summary.largest_overlap = self.summary.largest_overlap.max(row.max_overlap_ratio);
        if stage.until_balance.is_some() {
            return;
        }
        // Physical masses may be meant to move: a fall, a wave.
        if self.test.motion.scaled_masses {
            self.summary.unbalanced_rows += u64::from(row.unbalanced_force_ratio > UNBALANCED_COUNTED);
            self.summary.largest_unbalanced = self.summary.largest_unbalanced.max(row.unbalanced_force_ratio);
            let difference =
                stage.shear.components().map(|sheared| self.shear_difference(sheared)).fold(0.0, f64::max);
            self.summary.shear_misses += u64::from(difference > SHEAR_COUNTED);
            self.summary.largest_shear_difference = self.summary.largest_shear_difference.max(difference);
        }
        let error = self.servo_error(stage);
        self.summary.largest_servo_error = self.summary.largest_servo_error.max(error);
        self.summary.servo_misses += u64::from(error > SERVO_COUNTED);
    }

    /// Largest distance of a controlled wall stress from its target over the mean target.
    fn servo_error(&self, stage: &Stage) -> f64 {
        let targets = stage.stress.values();
        let sizes = targets.iter().flatten().map(|stress| stress.abs());
        let mean = sizes.clone().sum::<f64>() / sizes.count().max(1) as f64;
        let distances = targets
            .iter()
            .enumerate()
            .filter_map(|(axis, target)| target.map(|target| (self.servo_stress(axis) - target).abs()));
        distances.fold(0.0, f64::max) / mean.max(f64::MIN_POSITIVE)
    }

    /// Sets every wall's drive for the next step.
    fn drive(&mut self, stage: &Stage) {
        let lengths = self.place.lengths;
        let step = self.dynamics.step;
        let (strains, stresses) = (stage.strain.values(), stage.stress.values());
        for axis in 0..S::DIMENSION {
            let Some(pair) = self.walls[axis] else { continue };
            let drive = match (strains[axis], stresses[axis]) {
                (Some(strain), _) => {
                    // Both walls move, so that the middle of the specimen stays where it is.
                    let way = 0.5 * strain * lengths[axis] / stage.steps as f64;
                    WallDrive::Velocity(-way / step)
                }
                (None, Some(stress)) => {
                    let largest = self.test.walls.largest_strain_per_step.unwrap_or(LARGEST_STRAIN_PER_STEP);
                    WallDrive::Force {
                        target: -stress * self.area(axis),
                        gain: self.test.walls.servo_gain.unwrap_or(SERVO_GAIN),
                        largest_speed: 0.5 * largest * self.length(axis) / step,
                    }
                }
                (None, None) => WallDrive::Velocity(0.0),
            };
            for wall in pair {
                self.dynamics.walls[wall].drive = drive;
            }
            // Two walls that bear the same would let the weight sink.
            if let (Some(floor), WallDrive::Force { .. }) = (self.floor(axis), drive) {
                self.dynamics.walls[pair[floor]].drive = WallDrive::Velocity(0.0);
            }
            let shear = stage.shear.of_side(axis);
            let speed = lengths[axis] / stage.steps as f64 / step;
            self.dynamics.walls[pair[1]].glide = <S::Coordinates<f64>>::build(|along| shear[along] * speed);
        }
        self.dynamics.strain_sides(std::array::from_fn(|axis| self.side_rate(stage, axis, step)));
    }

    /// Largest strain that a step of a stage may cause.
    fn strain_per_step(&self, stage: &Stage) -> f64 {
        let servo = self.test.walls.largest_strain_per_step.unwrap_or(LARGEST_STRAIN_PER_STEP);
        let servo = if stage.stress.values().iter().any(Option::is_some) { servo } else { 0.0 };
        let strains = stage.strain.values().into_iter().flatten();
        let shears = (0..S::DIMENSION).flat_map(|axis| stage.shear.of_side(axis));
        let largest = strains.chain(shears).fold(0.0, |most: f64, strain| most.max(strain.abs()));
        servo.max(largest / stage.steps.max(1) as f64)
    }

    fn is_balanced(&self, stage: &Stage, limit: f64) -> bool {
        self.servo_error(stage) <= limit
            && self.unbalanced() <= limit
            && !self.unsupported_grains().are_in_the_air(limit)
    }

    fn unsupported_grains(&self) -> UnsupportedGrains {
        UnsupportedGrains {
            normal_force: self.dynamics.contacts.normal_force,
            largest_force: self.last.largest_force,
            kinetic_energy: self.last.kinetic_energy,
            free_weight: self.last.free_weight,
            turnover: self.dynamics.energy_turnover(),
        }
    }

    /// Rate of the period of an axis, m/s, in the homogeneous strain of the stage: strains along the periodic axes and shears across them
    /// act on every component of a period that leans.
    fn side_rate(&self, stage: &Stage, axis: usize, step: f64) -> S::Vector {
        let is_periodic = |axis: usize| axis < S::DIMENSION && self.walls[axis].is_none();
        let mut rate = S::Vector::ZERO;
        if !is_periodic(axis) {
            return rate;
        }
        for other in (0..S::DIMENSION).filter(|&other| is_periodic(other)) {
            let (strain, shear) = (stage.strain.values()[other].unwrap_or(0.0), stage.shear.of_side(other));
            let speed = self.place.periods[axis][other] / stage.steps as f64 / step;
            let part = S::Vector::from_fn(|along| speed * if along == other { strain } else { shear[along] });
            rate = Components::plus(rate, part);
        }
        rate
    }
}

/// Whether any of two answers ends the run.
fn first_break(one: ControlFlow<()>, other: ControlFlow<()>) -> ControlFlow<()> {
    if one.is_break() { one } else { other }
}
