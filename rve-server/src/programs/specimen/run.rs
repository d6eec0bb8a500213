//! The driver of a specimen test: stages of wall motion, rows of results.

use super::assembly::{Joinable, assembled};
use super::body::Body;
use super::dynamics::{Dynamics, GrainSums, Motion};
use super::error::SpecimenError;
use super::results::{SpecimenEvent, SpecimenPicture, SpecimenRow, SpecimenStart, SpecimenSummary};
use super::test_file::{SpecimenTest, Stage};
use super::wall::{Wall, WallDrive};
use crate::contact::{ContactLaw, ContactLaws, LawVisitor, Rotations};
use crate::definition::PackingFile;
use crate::simd::Tuple;
use crate::space::{Discs, Spheres};

/// Default speed of the servo per missing force, relative to the walls' stiffness.
const SERVO_GAIN: f64 = 0.02;

/// Default largest strain of one step of a servo-controlled wall.
const LARGEST_STRAIN_PER_STEP: f64 = 1e-5;

/// Steps between two checks of balance and energy.
const BALANCE_INTERVAL: u64 = 100;

/// Energy that is missing, or too much, over the energy turned over: from here on a row is counted, and a run stops.
const ENERGY_COUNTED: f64 = 0.01;
const ENERGY_STOP: f64 = 0.1;

/// Distance of a controlled wall stress from its target, over the mean target, from which on a row is counted.
const SERVO_COUNTED: f64 = 0.01;

/// Runs a test on a packing. Equal input gives equal bits for any number of threads.
///
/// # Errors
/// A test or packing that is not sound, or a motion that went out of control.
pub fn run_specimen<S: SpecimenFor>(
    test: &SpecimenTest,
    packing: &PackingFile<S>,
    listener: &mut dyn FnMut(&SpecimenEvent<'_>),
) -> Result<SpecimenSummary, SpecimenError> {
    S::run(test, packing, listener)
}

/// Spaces whose specimens can be run. The method is not generic, unlike what it calls: the dynamics are compiled once per
/// space, in this crate, and not again in every program that uses it.
pub trait SpecimenFor: Joinable {
    /// As [`run_specimen`].
    ///
    /// # Errors
    /// As [`run_specimen`].
    fn run(
        test: &SpecimenTest,
        packing: &PackingFile<Self>,
        listener: &mut dyn FnMut(&SpecimenEvent<'_>),
    ) -> Result<SpecimenSummary, SpecimenError>;
}

impl SpecimenFor for Discs {
    fn run(
        test: &SpecimenTest,
        packing: &PackingFile<Self>,
        listener: &mut dyn FnMut(&SpecimenEvent<'_>),
    ) -> Result<SpecimenSummary, SpecimenError> {
        run_stages(test, packing, listener)
    }
}

impl SpecimenFor for Spheres {
    fn run(
        test: &SpecimenTest,
        packing: &PackingFile<Self>,
        listener: &mut dyn FnMut(&SpecimenEvent<'_>),
    ) -> Result<SpecimenSummary, SpecimenError> {
        run_stages(test, packing, listener)
    }
}

fn run_stages<S: Joinable + ContactLaws>(
    test: &SpecimenTest,
    packing: &PackingFile<S>,
    listener: &mut dyn FnMut(&SpecimenEvent<'_>),
) -> Result<SpecimenSummary, SpecimenError> {
    test.validate(S::DIMENSION)?;
    let contact = test.contact_without_damping();
    contact.compile::<S, _>(Stages { test, packing, listener })?
}

/// All stages of a test, with whichever law its contact table chooses.
struct Stages<'a, S: Joinable> {
    test: &'a SpecimenTest,
    packing: &'a PackingFile<S>,
    listener: &'a mut dyn FnMut(&SpecimenEvent<'_>),
}

impl<S: Joinable> LawVisitor<S> for Stages<'_, S> {
    type Output = Result<SpecimenSummary, SpecimenError>;

    fn visit<C: ContactLaw<S>>(self, law: C) -> Self::Output {
        let mut run = Run::new(self.test, self.packing, law)?;
        for (number, stage) in self.test.stage.iter().enumerate() {
            run.follow(number, stage, self.listener)?;
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

struct Run<'a, S: Joinable, C: ContactLaw<S>> {
    test: &'a SpecimenTest,
    dynamics: Dynamics<S, C>,
    /// Numbers of the lower and upper wall of every walled axis.
    walls: [Option<[usize; 2]>; 3],
    /// Side lengths of the box at the start, m.
    sides: [f64; 3],
    thickness: f64,
    solid: f64,
    /// Counts during the run.
    summary: SpecimenSummary,
    last: GrainSums,
}

impl<'a, S: Joinable, C: ContactLaw<S>> Run<'a, S, C> {
    fn new(test: &'a SpecimenTest, packing: &PackingFile<S>, law: C) -> Result<Self, SpecimenError> {
        let periodic = test.periodic_axes(S::DIMENSION)?;
        let assembled = assembled(packing, &test.tiles, test.cut, periodic)?;
        let wall_law = law.with_friction(test.walls.friction);
        let thickness = packing.thickness;
        let measure = |radius: f64| S::grain_measure(radius) * if S::DIMENSION == 2 { thickness } else { 1.0 };
        let masses: Vec<f64> =
            assembled.grains.iter().map(|grain| test.contact.density * measure(grain.radius)).collect();
        let solid = assembled.grains.iter().map(|grain| measure(grain.radius)).sum();
        let mut sides = assembled.sides;
        let mut walls = Vec::new();
        let mut numbers = [None; 3];
        for axis in (0..S::DIMENSION).filter(|axis| !periodic[*axis]) {
            let surfaces = |sign: f64| {
                let far = |grain: &super::Grain<S>| sign * grain.position.as_ref()[axis] + grain.radius;
                sign * assembled.grains.iter().map(far).fold(f64::NEG_INFINITY, f64::max)
            };
            let (low, high) = (surfaces(-1.0), surfaces(1.0));
            sides[axis] = high - low;
            numbers[axis] = Some([walls.len(), walls.len() + 1]);
            for (place, sign, end) in [(low, 1.0, "low"), (high, -1.0, "high")] {
                let unit = <S::Coordinates<f64>>::build(|i| if i == axis { 1.0 } else { 0.0 });
                let name = format!("{} {end}", ["x", "y", "z"][axis]);
                let drive = WallDrive::Velocity(0.0);
                walls.push(Wall::new(
                    &name,
                    unit.scaled(place),
                    unit.scaled(sign),
                    wall_law,
                    drive,
                    test.contact.damping,
                ));
            }
        }
        let mut body = Body::new(law, assembled.grains, masses, test.contact.damping, assembled.periods);
        let histories = assembled.histories.iter();
        let dropped =
            body.adopt(histories.map(|history| (history.contact.key(), move |branch| history.axial(branch))));
        let motion = Motion {
            gravity: std::array::from_fn(|axis| test.motion.gravity.get(axis).copied().unwrap_or(0.0)),
            local_damping: test.motion.local_damping,
            safety: test.motion.safety,
            step: test.motion.step,
            rotations_free: test.contact.rotations == Rotations::Free,
            scaled_masses: test.motion.scaled_masses,
        };
        let dynamics = Dynamics::new(body, walls, motion);
        let mut run = Self {
            test,
            dynamics,
            walls: numbers,
            sides,
            thickness: if S::DIMENSION == 2 { thickness } else { 1.0 },
            solid,
            summary: SpecimenSummary::default(),
            last: GrainSums::default(),
        };
        let forces = run.dynamics.body.loads.iter().map(|load| load.force.dot(load.force).sqrt());
        run.last.largest_force = forces.fold(0.0, f64::max);
        run.summary.start = SpecimenStart {
            stress: run.contact_stress(),
            unbalanced_force_ratio: run.unbalanced(),
            histories: assembled.histories.len() - dropped,
            cut_through: assembled.cut_through,
            dropped,
            slant: assembled.slant,
        };
        Ok(run)
    }

    fn follow(
        &mut self,
        number: usize,
        stage: &Stage,
        listener: &mut dyn FnMut(&SpecimenEvent<'_>),
    ) -> Result<(), SpecimenError> {
        let friction = stage.friction.unwrap_or(self.test.contact.friction);
        let law = self.dynamics.body.law().with_friction(friction);
        self.dynamics.body.change_law(law);
        let lengths: [f64; 3] = std::array::from_fn(|axis| self.length(axis));
        let mut balanced = stage.until_balance.is_none();
        let mut row = 0;
        for step in 0..stage.steps {
            self.drive(stage, &lengths);
            self.last = self.dynamics.advance();
            let done = step + 1;
            if !self.last.kinetic_energy.is_finite() {
                return Err(SpecimenError::Diverged { stage: stage.name.clone(), step: done });
            }
            if done.is_multiple_of(BALANCE_INTERVAL) || done == stage.steps {
                self.check_energy(stage, done)?;
            }
            let at_balance = done.is_multiple_of(BALANCE_INTERVAL)
                && stage.until_balance.is_some_and(|limit| self.is_balanced(stage, limit));
            if done.is_multiple_of(BALANCE_INTERVAL) {
                listener(&SpecimenEvent::Progress { stage: number, step: done });
            }
            // Row k of n is due when k / n of the stage is done.
            if done * stage.rows >= (row + 1) * stage.steps || at_balance || done == stage.steps {
                row = done * stage.rows / stage.steps;
                let result = self.row(stage);
                self.count(stage, &result);
                listener(&SpecimenEvent::Row(&result, &|| self.picture()));
            }
            if at_balance {
                balanced = true;
                break;
            }
        }
        self.summary.unbalanced_stages += u64::from(!balanced);
        Ok(())
    }

    /// Energy that is missing over the energy turned over.
    fn energy_error(&self) -> f64 {
        let turnover = self.dynamics.energy_turnover();
        if turnover > 0.0 { self.dynamics.missing_energy().abs() / turnover } else { 0.0 }
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
        self.summary.energy_misses += u64::from(self.energy_error() > ENERGY_COUNTED);
        if stage.until_balance.is_some() {
            return;
        }
        let error = self.servo_error(stage, &row.wall_stress);
        self.summary.largest_servo_error = self.summary.largest_servo_error.max(error);
        self.summary.servo_misses += u64::from(error > SERVO_COUNTED);
    }

    /// Largest distance of a controlled wall stress from its target over the mean target.
    fn servo_error(&self, stage: &Stage, stress: &[f64; 3]) -> f64 {
        let targets = stage.stress.values();
        let sizes = targets.iter().flatten().map(|stress| stress.abs());
        let mean = sizes.clone().sum::<f64>() / sizes.count().max(1) as f64;
        let distances = targets.iter().zip(stress).filter_map(|(target, found)| Some((found - (*target)?).abs()));
        distances.fold(0.0, f64::max) / mean.max(f64::MIN_POSITIVE)
    }

    /// Sets every wall's drive for the next step.
    fn drive(&mut self, stage: &Stage, lengths: &[f64; 3]) {
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
        }
    }

    fn is_balanced(&self, stage: &Stage, limit: f64) -> bool {
        let stress = std::array::from_fn(|axis| self.wall_stress(axis));
        self.servo_error(stage, &stress) <= limit && self.unbalanced() <= limit
    }

    /// Distance of the walls of an axis, or its period, m.
    fn length(&self, axis: usize) -> f64 {
        match self.walls[axis] {
            Some([low, high]) => {
                let place = |wall: usize| self.dynamics.walls[wall].point.as_ref()[axis];
                place(high) - place(low)
            }
            None => self.sides[axis],
        }
    }

    /// Area of a wall, m2.
    fn area(&self, axis: usize) -> f64 {
        (0..S::DIMENSION).filter(|other| *other != axis).map(|other| self.length(other)).product::<f64>()
            * self.thickness
    }

    fn wall_stress(&self, axis: usize) -> f64 {
        self.walls[axis].map_or(0.0, |[low, high]| {
            let force = |wall: usize| self.dynamics.walls[wall].normal_force();
            -0.5 * (force(low) + force(high)) / self.area(axis)
        })
    }

    fn unbalanced(&self) -> f64 {
        let contacts = &self.dynamics.contacts;
        if contacts.contacts == 0 {
            return 0.0;
        }
        self.last.largest_force / (contacts.normal_force / contacts.contacts as f64)
    }

    /// Volume of the box, m3.
    fn volume(&self) -> f64 {
        (0..S::DIMENSION).map(|axis| self.length(axis)).product::<f64>() * self.thickness
    }

    fn contact_stress(&self) -> [f64; 6] {
        let (sum, volume) = (self.dynamics.body.stress_sum(), self.volume());
        [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
            .map(|(i, j): (usize, usize)| 0.5 * (sum[i][j] + sum[j][i]) / volume)
    }

    fn row(&self, stage: &Stage) -> SpecimenRow {
        let body = &self.dynamics.body;
        let contacts = &self.dynamics.contacts;
        let volume = self.volume();
        let at_walls: usize = self.dynamics.walls.iter().map(Wall::contacts).sum();
        let inside = contacts.contacts.saturating_sub(at_walls as u64) as f64;
        SpecimenRow {
            stage: stage.name.clone(),
            step: self.dynamics.steps,
            time: self.dynamics.time,
            strain: std::array::from_fn(|axis| self.length(axis) / self.sides[axis] - 1.0),
            wall_stress: std::array::from_fn(|axis| self.wall_stress(axis)),
            contact_stress: self.contact_stress(),
            void_ratio: (volume - self.solid) / self.solid,
            coordination_number: 2.0 * inside / body.grains.len() as f64,
            fabric_anisotropy: crate::preparation::anisotropy_of_fabric(&body.fabric(), S::DIMENSION),
            sliding_fraction: contacts.sliding as f64 / contacts.contacts.max(1) as f64,
            unbalanced_force_ratio: self.unbalanced(),
            kinetic_energy: self.last.kinetic_energy,
            elastic_energy: contacts.elastic_energy,
            friction_work: self.dynamics.works[0],
            viscous_work: self.dynamics.works[1],
            damping_work: self.dynamics.works[2],
            max_overlap_ratio: 0.5 * contacts.largest_overlap,
            wall_work: self.dynamics.wall_work,
            missing_energy: self.dynamics.missing_energy(),
        }
    }

    fn picture(&self) -> SpecimenPicture {
        let spread = |components: &[f64]| {
            let mut all = [0.0; 3];
            all[..components.len()].copy_from_slice(components);
            all
        };
        let grains = &self.dynamics.body.grains;
        SpecimenPicture {
            centres: grains.iter().map(|grain| spread(grain.position.as_ref())).collect(),
            radii: grains.iter().map(|grain| grain.radius).collect(),
            rotations: self
                .dynamics
                .rotations
                .iter()
                .map(|rotation| match rotation.as_ref() {
                    [about_z] => [0.0, 0.0, *about_z],
                    components => spread(components),
                })
                .collect(),
            velocities: grains.iter().map(|grain| spread(grain.velocity.as_ref())).collect(),
        }
    }
}
