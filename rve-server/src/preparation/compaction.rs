//! A cell in preparation: compressed, sheared, brought to a stress and written as a packing.

use super::first_vectors::FirstVectors;
use super::progress::{PackingProgress, ProgressLog};
use super::servo::{LARGEST_STRAIN, Response, ServoLimits, StagnationMonitor, aim, pressure};
use super::stress_target::{Matrix, StressTarget, symmetric, turned_in, turned_out};
use crate::cell::{Cell, ContactRecord, renamed};
use crate::contact::{ContactTable, Rotations};
use crate::definition::{GrainDefinition, ListedContact, PackingError, PackingFile, RveOptions};
use crate::engine::GrainRve;
use crate::solver::SolverFor;
use crate::space::{Components, Space, Tensor, apply, cross, largest_component};
use crate::tangent::Closeness;
use protocol::{Observables, RveError, RveSolver, TangentKind, Tensor2, TrialFlags, TrialOptions, TrialResult};

/// First isotropic compression per increment; grains move by a hundredth of a radius or so.
const FIRST_COMPRESSION: f64 = 5e-3;

/// No increment is halved below this.
const LEAST_COMPRESSION: f64 = 1e-8;

/// After an increment that was taken the next one is at least this: halving must not bring the compression to a stop.
const LEAST_NEXT_COMPRESSION: f64 = 1e-6;

/// Share of the target pressure at which the compression hands over to the servo.
const HANDOVER: [f64; 2] = [0.02, 0.2];

/// Most times that a cell of spheres that carries load is given more time to come to rest in one increment.
const MOST_SETTLINGS: u32 = 10;

/// Stress error over pressure below which the servo on spheres learns from its steps: the network's own operator knows no
/// sliding, is much too stiff for shear, and would approach the target by a hundredth of the distance per step.
const CLOSE: f64 = 0.5;

/// Steps without a smaller error after which the servo on spheres uses the network operator again.
const MAX_STALLS: u32 = 12;

/// Share of the distance to its target stress that a careful step may leave; a step that leaves more is taken back and shortened.
const WORTHWHILE: f64 = 0.95;

/// Careful steps in a row before the servo tries plain ones again.
const CAREFUL_STEPS: u32 = 10;

/// Most times that a careful step is halved; what is left then is taken as it is, so that a cell that snaps can go on.
const MOST_HALVINGS: u32 = 8;

/// Share of the target pressure below which a cell is simply compressed further, by this strain: spheres at once, discs after
/// `SLACK_STEPS` of them in a row, and then by twice as much each time, `SLACK_DOUBLINGS` times.
const SLACK_PRESSURE: f64 = 0.005;
const SLACK_STRAIN: f64 = 1e-4;
const SLACK_STEPS: i32 = 40;
const SLACK_DOUBLINGS: i32 = 4;

/// Steps in a row, of discs and of spheres, that bring the stress no nearer to the target, by [`STUCK_GAIN`], after which a packing far below its
/// pressure is compressed in the same way: where its network hardly resists some shear, as one of cohesive grains that roll, that shear takes
/// up every step. The servo of stiff spheres creeps for some hundreds of steps and comes to its end.
const STUCK_STEPS: [i32; 2] = [200, 1000];
/// See [`STUCK_STEPS`].
const STUCK_GAIN: f64 = 0.99;
/// Share of the pressure below which, down to [`SLACK_PRESSURE`], such steps count.
const STUCK_PRESSURE: f64 = 0.5;

/// Largest strain component of a servo step on spheres while the stress is far from the target: a network of few contacts
/// says that it is soft, and is not after half of the step.
const FAR_STRAIN: f64 = 2e-4;

/// Most increments of either stage.
const MOST_INCREMENTS: u32 = 5_000;

/// Largest strain of the servo from the first load on. Packings take some per cent to their stress; grains that cannot carry it flow until
/// a few of them bridge a flat cell.
const MOST_STRAIN_OF_SERVO: f64 = 0.4;

/// Tangential over normal stiffness that the servo assumes of contacts without tangential springs, and of stiffer ones without friction.
const ASSUMED_SPRINGS: f64 = 0.5;

/// Strain whose only purpose is that the grains are brought to rest.
const TOUCH: f64 = 1e-9;

/// How far from the target a compaction may end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tolerances {
    /// Largest unbalanced force over mean normal contact force.
    pub(crate) force: f64,
    /// Largest deviation of a stress component over the target pressure.
    pub(crate) stress: f64,
}

/// How far from its target stress, and from rest, a packing may end that was brought to another stress or weakened.
pub(crate) const TOLERANCES_OF_CHANGED_PACKINGS: Tolerances = Tolerances { force: 1e-8, stress: 1e-6 };

/// A cell with a target stress.
pub(crate) struct Compaction<'a, S: SolverFor> {
    cell: GrainRve<S>,
    /// The vectors that the packing was given with: its axes are theirs, whatever describes the lattice now.
    first_vectors: FirstVectors,
    /// Whether grains may not turn: nothing balances the moments on them, and only the symmetric part of the stress obeys the strain.
    has_couples: bool,
    /// The vectors of the committed cell as the latest trial has carried them along, m, by rows.
    carried: S::Tensor,
    target: StressTarget,
    tolerances: Tolerances,
    limits: ServoLimits<S>,
    log: &'a ProgressLog<'a>,
}

impl<'a, S: SolverFor> Compaction<'a, S> {
    /// Takes grains over, wherever they are.
    ///
    /// # Errors
    /// [`PackingError::Content`].
    pub(crate) fn new(
        packing: PackingFile<S>,
        contact: &ContactTable,
        target: StressTarget,
        tolerances: Tolerances,
        log: &'a ProgressLog<'a>,
    ) -> Result<Self, PackingError> {
        let definition = GrainDefinition { packing, contact: contact.clone(), options: RveOptions::default() };
        let mut cell = GrainRve::<S>::new(&definition).map_err(content)?;
        let first_vectors = FirstVectors::new::<S>(&definition.packing.periodicity, &cell.committed().cell.rows);
        let has_couples = contact.rotations == Rotations::Blocked;
        cell.solve_operators_to(Closeness::RESULT);
        if S::DIMENSION == 2 {
            // The servo of spheres learns from its steps and reaches more targets with what their own operator says.
            cell.assume_springs_in_operators(ASSUMED_SPRINGS);
        }
        let limits =
            ServoLimits::increments_and_strain(MOST_INCREMENTS, cell.committed().cell.rows, MOST_STRAIN_OF_SERVO);
        let carried = cell.committed().cell.rows;
        Ok(Self { cell, first_vectors, has_couples, carried, target, tolerances, limits, log })
    }

    /// Gives the cell another target, for `most_increments` servo steps and `most_strain` from here on: grains that flow at a lower stress than
    /// the target would otherwise be sheared on for as long as there are steps.
    pub(crate) fn aim_at(
        &mut self,
        target: StressTarget,
        tolerances: Tolerances,
        most_increments: u32,
        most_strain: f64,
    ) {
        (self.target, self.tolerances) = (target, tolerances);
        self.limits =
            ServoLimits::increments_and_strain(most_increments, self.cell.committed().cell.rows, most_strain);
    }

    /// Isotropic compression until the grains carry load; increments that overshoot are taken back and halved.
    ///
    /// # Errors
    /// [`PackingError::Content`] if no pressure is reached.
    pub(crate) fn compress(&mut self) -> Result<(), PackingError> {
        self.cell.set_options(RveOptions {
            strain_per_step: Some(2e-4),
            tolerance: Some(1e-2),
            max_steps: Some(2_000),
            ..RveOptions::default()
        });
        let mut compression = FIRST_COMPRESSION;
        for increment in 0..MOST_INCREMENTS {
            let before = (S::DIMENSION == 3).then(|| (self.cell.clone(), self.first_vectors));
            let mut answer = self.trial(&self.isotropic(-compression), TangentKind::None)?;
            if before.is_some() {
                answer = self.settled(answer)?;
            }
            let share = self.pressure_share(&answer);
            // Grains that snap across the window at the smallest increment are taken as they lie.
            if share > HANDOVER[1] && compression > LEAST_COMPRESSION {
                match before {
                    Some(before) => (self.cell, self.first_vectors) = before,
                    None => self.cell.rollback(),
                }
                compression *= 0.5;
                continue;
            }
            self.commit()?;
            self.report("compression", increment, &answer);
            if share > HANDOVER[0] {
                // The strain of the servo counts from here.
                let rows = self.cell.committed().cell.rows;
                self.limits = ServoLimits::increments_and_strain(self.limits.increments, rows, MOST_STRAIN_OF_SERVO);
                return Ok(());
            }
            compression = compression.max(LEAST_NEXT_COMPRESSION);
        }
        Err(PackingError::Content(format!("compression did not reach a pressure in {MOST_INCREMENTS} increments")))
    }

    /// A trial of a cell that carries load, given time to come to rest: near jamming forces die away slowly, and would be
    /// taken for the pressure of a packing.
    fn settled(&mut self, mut answer: TrialResult) -> Result<TrialResult, PackingError> {
        for _ in 0..MOST_SETTLINGS {
            let is_at_rest = !answer.flags.contains(TrialFlags::NOT_EQUILIBRATED);
            if is_at_rest || self.pressure_share(&answer) < HANDOVER[0] {
                break;
            }
            self.commit()?;
            answer = self.trial(&self.isotropic(-TOUCH), TangentKind::None)?;
        }
        Ok(answer)
    }

    fn pressure_share(&self, answer: &TrialResult) -> f64 {
        pressure(&answer.stress, self.target.dimension) / self.target.pressure
    }

    /// Newton steps on all stress components with the network's own tangent, or with what the steps have taught.
    ///
    /// # Errors
    /// [`PackingError::Content`] if the target is not reached.
    pub(crate) fn servo(&mut self) -> Result<(), PackingError> {
        self.cell.set_options(RveOptions {
            strain_per_step: Some(2e-6),
            tolerance: Some(1e-4),
            max_steps: Some(20_000),
            ..RveOptions::default()
        });
        let mut response = Response::isotropic(100.0 * self.target.pressure, self.target.dimension);
        let mut answer = self.trial(&self.isotropic(-TOUCH), self.tangent())?;
        let mut refined = false;
        // Discs keep to the network's own operator in every step: committed packings come out again to the bit.
        let learns = S::DIMENSION == 3;
        let (mut best, mut since_best) = (f64::INFINITY, 0);
        let (mut watch, mut careful_steps, mut slack) = (StagnationMonitor::new(), 0, 0);
        let (mut nearest, mut stuck) = (f64::INFINITY, 0);
        for increment in 0..self.limits.increments {
            self.commit()?;
            self.report("servo", increment, &answer);
            if self.limits.are_passed_by(&self.cell.committed().cell.rows) {
                let [smallest, largest] = self.target.principal_pressures();
                return Err(PackingError::Content(format!(
                    "the grains flow without reaching a stress whose smallest principal value is {:.2} of the largest, on the way to the stress that \
                     is asked for: the friction between them does not bear it; ask for principal stresses that differ less, or raise that friction",
                    smallest / largest
                )));
            }
            let error = self.stress_error(&answer.stress);
            if refined
                && error <= self.tolerances.stress
                && answer.scalars.unbalanced_force_ratio <= self.tolerances.force
            {
                return Ok(());
            }
            if error < 1e-2 && !refined {
                refined = true;
                self.refine(1e-6);
            }
            if let Some(operator) = &answer.tangent {
                response.adopt(operator);
            }
            (nearest, stuck) = match self.pressure_share(&answer) {
                share if !(SLACK_PRESSURE..STUCK_PRESSURE).contains(&share) => (f64::INFINITY, 0),
                _ if error < STUCK_GAIN * nearest => (error, 0),
                _ => (nearest, stuck + 1),
            };
            let longest = STUCK_STEPS[usize::from(learns)];
            if stuck > longest {
                let strain = SLACK_STRAIN * 2f64.powi((stuck - longest).min(SLACK_DOUBLINGS));
                answer = self.trial(&self.isotropic(-strain), self.tangent())?;
                continue;
            }
            slack = if self.pressure_share(&answer) < SLACK_PRESSURE { slack + 1 } else { 0 };
            if !learns && slack > SLACK_STEPS {
                // What few contacts there are say nothing about where load will be found.
                let strain = SLACK_STRAIN * 2f64.powi((slack - SLACK_STEPS).min(SLACK_DOUBLINGS));
                answer = self.trial(&self.isotropic(-strain), self.tangent())?;
                continue;
            }
            if slack > 0 {
                watch = StagnationMonitor::new();
            } else if !learns && watch.is_circling(error) {
                (watch, careful_steps) = (StagnationMonitor::new(), CAREFUL_STEPS);
            }
            if careful_steps > 0 && slack == 0 && error > self.tolerances.stress {
                careful_steps -= 1;
                answer = self.careful_step(&mut response, &answer)?;
                continue;
            }
            let deviator = turned_out(&self.target.deviator, &self.axes());
            let aimed = aim(&self.target, &deviator, &answer.stress);
            let mut strain = response.strain(&aimed, &answer.stress, LARGEST_STRAIN);
            let mut kind = self.tangent();
            if learns {
                if error >= CLOSE {
                    strain = limited(&strain, FAR_STRAIN);
                }
                since_best = if error < best { 0 } else { since_best + 1 };
                best = best.min(error);
                if self.pressure_share(&answer) < SLACK_PRESSURE {
                    strain = self.isotropic(-SLACK_STRAIN);
                } else if error < CLOSE && since_best < MAX_STALLS {
                    kind = TangentKind::None;
                } else if since_best >= MAX_STALLS {
                    (best, since_best) = (error, 0);
                }
            }
            let next = self.trial(&strain, kind)?;
            if next.tangent.is_none() {
                response.learn(&strain, &difference(&next.stress, &answer.stress));
            }
            answer = next;
        }
        let (steps, error) = (self.limits.increments, self.stress_error(&answer.stress));
        Err(PackingError::Content(format!(
            "the stress did not reach the target in {steps} servo steps: it is off by {error:.1e} of the pressure, and unbalanced forces are \
             {:.1e} of the mean contact force",
            answer.scalars.unbalanced_force_ratio
        )))
    }

    /// A step that is taken back and shortened until it brings the stress nearer to the target. Every miss teaches the
    /// response what lies between the two states that a plain servo jumps to and fro.
    fn careful_step(&mut self, response: &mut Response, before: &TrialResult) -> Result<TrialResult, PackingError> {
        let deviator = turned_out(&self.target.deviator, &self.axes());
        let aimed = aim(&self.target, &deviator, &before.stress);
        let missing = |stress: &Tensor2| {
            let stress = rows(stress);
            largest_component::<Matrix>(&std::array::from_fn(|i| std::array::from_fn(|j| stress[i][j] - aimed[i][j])))
        };
        let mut most = LARGEST_STRAIN;
        for _ in 0..MOST_HALVINGS {
            let strain = response.strain(&aimed, &before.stress, most);
            let answer = self.trial(&strain, self.tangent())?;
            if missing(&answer.stress) < WORTHWHILE * missing(&before.stress) {
                return Ok(answer);
            }
            self.cell.rollback();
            response.learn(&strain, &difference(&answer.stress, &before.stress));
            most = 0.5 * largest_component(&strain);
        }
        let strain = response.strain(&aimed, &before.stress, most);
        self.trial(&strain, self.tangent())
    }

    /// Strains the cell by a symmetric tensor given in the cell's own axes.
    ///
    /// # Errors
    /// [`PackingError::Content`].
    pub(crate) fn strain(&mut self, strain: &Matrix) -> Result<(), PackingError> {
        self.refine(2e-6);
        let answer = self.trial(&turned_out(strain, &self.axes()), TangentKind::None)?;
        self.commit()?;
        self.report("shear", 0, &answer);
        Ok(())
    }

    /// Contact fabric minus its mean part, in the cell's own axes.
    ///
    /// # Errors
    /// Contact forces that are not finite.
    pub(crate) fn fabric_deviator(&mut self) -> Result<Matrix, PackingError> {
        let fabric = self.cell.observe(Observables::FABRIC).map_err(content)?.observed.fabric;
        let mut deviator = turned_in(&rows(&fabric), &self.axes());
        let mean = (0..self.target.dimension).map(|i| deviator[i][i]).sum::<f64>() / self.target.dimension as f64;
        for (i, row) in deviator.iter_mut().enumerate().take(self.target.dimension) {
            row[i] -= mean;
        }
        Ok(deviator)
    }

    /// The committed state as a file, turned so that Y1 points along axis 1.
    ///
    /// # Errors
    /// [`PackingError::Content`].
    pub(crate) fn packing(&self, provenance: serde_json::Value) -> Result<PackingFile<S>, PackingError> {
        let state = self.cell.committed();
        let axes = self.axes();
        let back = S::Tensor::from_fn(|i, j| axes[i][j]);
        let turned = self.cell_by_first_vectors().deformed(&back).rows;
        // Y1 along axis 1, Y2 in the plane of axes 1 and 2: what rounding has left elsewhere is taken out.
        let rows = S::Tensor::from_fn(|row, axis| if axis > row { 0.0 } else { turned[row][axis] });
        let radii = &self.cell.model().radii;
        let grains =
            state.positions.iter().zip(radii).map(|(position, radius)| S::grain(apply(&back, *position), *radius));
        let (mut contacts, mut rolling_moments) = (Vec::new(), Vec::new());
        for (place, contact) in state.contacts.iter().enumerate() {
            let moment = state.rolling_moments.get(place).copied();
            let (contact, moment) = match self.first_vectors.are_those_of_now::<S>() {
                true => (*contact, moment),
                false => renamed(contact, moment, self.first_vectors.shift::<S>(contact.shift)),
            };
            if contact.tangential_force.norm() == 0.0 && moment.is_none_or(|moment| moment.norm() == 0.0) {
                continue;
            }
            let ContactRecord { origin, end, shift, tangential_force } = contact;
            let tangential_force = S::turned_tangential(tangential_force, &back);
            contacts.push(ListedContact { origin, end, shift, tangential_force });
            rolling_moments.extend(moment.map(|moment| S::turned_spin(moment, &back)));
        }
        if rolling_moments.iter().all(|moment| moment.norm() == 0.0) {
            rolling_moments.clear();
        }
        let version =
            if rolling_moments.is_empty() { PackingFile::VERSION } else { PackingFile::VERSION_WITH_MOMENTS };
        PackingFile {
            version,
            thickness: self.cell.model().thickness,
            contacts,
            rolling_moments,
            provenance,
            ..PackingFile::<S>::new(rows, grains.collect())
        }
        .checked()
    }

    /// Largest deviation of a stress component from the target, over the target pressure: in the axes in which grains are solved, and in
    /// those of the file, in which the packing is judged.
    fn stress_error(&self, stress: &Tensor2) -> f64 {
        let axes = self.axes();
        let (stress, deviator) = (rows(stress), turned_out(&self.target.deviator, &axes));
        let own = turned_in(&symmetric(&stress), &axes);
        let mut largest = 0.0f64;
        for i in 0..self.target.dimension {
            for j in 0..self.target.dimension {
                let mean = if i == j { self.target.pressure } else { 0.0 };
                let errors = [stress[i][j] - deviator[i][j], own[i][j] - self.target.deviator[i][j]];
                largest = errors.iter().fold(largest, |largest, error| largest.max((error + mean).abs()));
            }
        }
        largest / self.target.pressure
    }

    /// The committed cell by the vectors that the packing was given with.
    fn cell_by_first_vectors(&self) -> Cell<S> {
        Cell { rows: self.first_vectors.rows::<S>(&self.cell.committed().cell.rows) }
    }

    /// Axes of the committed cell as rows: the first along Y1 of the packing as it was given, the second in the plane of that and Y2.
    fn axes(&self) -> Matrix {
        let rows = self.cell_by_first_vectors().rows;
        let unit = |v: [f64; 3]| {
            let length = v.dot(v).sqrt();
            v.map(|component| component / length)
        };
        let row = |i: usize| std::array::from_fn(|axis| if axis < S::DIMENSION { rows[i][axis] } else { 0.0 });
        let first: [f64; 3] = unit(row(0));
        let third = if S::DIMENSION == 2 { [0.0, 0.0, 1.0] } else { unit(cross(first, row(1))) };
        [first, cross(third, first), third]
    }

    fn isotropic(&self, strain: f64) -> Matrix {
        let mut matrix = [[0.0; 3]; 3];
        for (i, row) in matrix.iter_mut().enumerate().take(self.target.dimension) {
            row[i] = strain;
        }
        matrix
    }

    fn refine(&mut self, strain_per_step: f64) {
        self.cell.set_options(RveOptions {
            strain_per_step: Some(strain_per_step),
            tolerance: Some(self.tolerances.force),
            max_steps: Some(100_000),
            ..RveOptions::default()
        });
    }

    fn tangent(&self) -> TangentKind {
        TangentKind::TrussLike
    }

    fn trial(&mut self, strain: &Matrix, tangent: TangentKind) -> Result<TrialResult, PackingError> {
        let target = Tensor2::from_rows(strain);
        let options = TrialOptions { tangent, ..TrialOptions::default() };
        let mut answer = self.cell.trial(&target, &options).map_err(content)?;
        self.log.spend(answer.cost.force_evaluations);
        if self.has_couples {
            answer.stress = Tensor2::from_rows(&symmetric(&rows(&answer.stress)));
        }
        self.carried = carried_along::<S>(&self.cell.committed().cell, strain);
        Ok(answer)
    }

    /// Makes the latest trial the state.
    fn commit(&mut self) -> Result<(), PackingError> {
        self.cell.commit().map_err(content)?;
        self.first_vectors.follow::<S>(&self.carried, &self.cell.committed().cell.rows);
        Ok(())
    }

    fn report(&self, stage: &'static str, increment: u32, answer: &TrialResult) {
        let stress_error = self.stress_error(&answer.stress);
        self.log.report(PackingProgress {
            attempt: 0,
            stage,
            increment,
            solid_fraction: 1.0 / (1.0 + answer.scalars.void_ratio),
            pressure: pressure(&answer.stress, self.target.dimension),
            stress_error,
            unbalanced_force_ratio: answer.scalars.unbalanced_force_ratio,
        });
    }
}

/// Vectors of a cell, m, by rows, after a displacement gradient.
fn carried_along<S: Space>(cell: &Cell<S>, gradient: &Matrix) -> S::Tensor {
    cell.deformed(&S::Tensor::from_fn(|i, j| gradient[i][j] + if i == j { 1.0 } else { 0.0 })).rows
}

/// A strain cut to a largest component.
fn limited(strain: &Matrix, most: f64) -> Matrix {
    let largest = largest_component(strain);
    let share = if largest > most { most / largest } else { 1.0 };
    strain.map(|row| row.map(|value| share * value))
}

/// A tensor by its rows.
pub(crate) fn rows(tensor: &Tensor2) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| tensor.get(i, j)))
}

fn difference(after: &Tensor2, before: &Tensor2) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| after.get(i, j) - before.get(i, j)))
}

pub(crate) fn content(error: RveError) -> PackingError {
    PackingError::Content(error.to_string())
}
