//! RVE tests on a frame: strains prescribed, stresses found by a secant search.

use super::error::{ElementError, SMALLER_STEPS};
use super::path::{COMPONENTS, Matrix, Operator, by_gradient, tensor_of};
use super::requests::RowRequests;
use super::row::ElementRow;
use super::start_check::is_far_from_targets;
use super::step::{LEAST_SHARE, raised_level};
use super::stress_control::StressControl;
use super::stress_relaxation::{LARGEST_JUMP, MOST_RELAXED, Relaxation, STEPS_BEFORE_NEAREST, is_out_of_range};
use super::summary::{ElementEnd, ElementSummary};
use super::test_file::{Components, ElementTest, Segment};
use super::work::PathWork;
use crate::cell::GrainState;
use crate::definition::PackingFile;
use crate::homogenization::fluctuation::displacement_fluctuations;
use crate::programs::frame::{FrameDefinition, FrameOptions, FrameRve};
use crate::space::Discs;
use crate::space::plane::{self, Plane};
use crate::tangent::{self, FrozenMethod};
use nalgebra::{DMatrix, DVector};
use protocol::{Observables, RveSolver, Tensor2, TrialFlags, TrialOptions, TrialResult};
use std::ops::ControlFlow;

/// Most trials of one increment under stress control.
const MOST_TRIALS: u32 = 30;

/// Committed states of one increment that have not come to rest, with which it is given up: nothing holds the grains.
const MOST_RESTLESS: u32 = 30;

/// Strain of the perturbations that give the first response of a segment.
const PERTURBATION: f64 = 1e-6;

/// Largest strain component of one correction.
const LARGEST_CORRECTION: f64 = 2e-3;

const KEYS: [&str; 4] = ["xx", "xy", "yx", "yy"];

/// The same among the nine components of space.
const IN_SPACE: [usize; 4] = [0, 1, 3, 4];

/// Runs an element test on the frame that is cut out of `packing`; every row is given to `on_row`, which may end the test after it.
pub(super) fn run_frame_element(
    test: &ElementTest,
    options: &FrameOptions,
    packing: PackingFile,
    requests: RowRequests,
    on_row: &mut dyn FnMut(&ElementRow) -> ControlFlow<()>,
) -> ElementEnd {
    let definition = FrameDefinition { packing, contact: test.contact.clone(), frame: options.clone() };
    let frame = FrameRve::new(&definition).map_err(ElementError::Definition);
    let mut cell = match frame.and_then(|frame| test.check_dimension(2).map(|()| frame)) {
        Ok(cell) => cell,
        Err(error) => return error.into(),
    };
    let first = cell.observe(Observables::ALL);
    let far_from_targets = u64::from(is_far_from_targets(test, &tensor_of(&first.stress.0)));
    let mut run = Run {
        stress: flat(&first.stress.plane()),
        cell,
        stress_tolerance: test.stress_tolerance,
        stress_level: 0.0,
        deformation: plane::IDENTITY,
        summary: ElementSummary { far_from_targets, ..ElementSummary::default() },
        work: None,
        last_control: StressControl::None,
        missed: [None; 4],
        requests,
        reference: None,
        on_row,
    };
    let result = if run.deliver(&first, StressControl::None, Spent::default()).is_break() {
        Ok(())
    } else {
        run.follow_path(&test.path)
    };
    ElementEnd { summary: run.summary, result }
}

/// Components under stress control, in the order of [`KEYS`], their targets, Pa, and the elastic response of these stresses to these
/// strains at the start of the segment, Pa.
struct Controlled<'a> {
    places: &'a [usize],
    targets: &'a [f64],
    elastic: &'a Operator,
}

/// Trials of an increment and their force evaluations.
#[derive(Clone, Copy, Debug, Default)]
struct Spent {
    trials: u32,
    dem_steps: u64,
    /// Committed states on the way to its end that have not come to rest.
    restless: u32,
}

struct Run<'a> {
    cell: FrameRve,
    stress_tolerance: f64,
    /// Largest stress component at the start of a segment so far, Pa.
    stress_level: f64,
    /// F of the committed state, relative to the frame as cut.
    deformation: Plane,
    stress: [f64; 4],
    /// How the last row met its stresses.
    last_control: StressControl,
    /// Targets of the last segment if its last increment missed them, Pa.
    missed: [Option<f64>; 4],
    summary: ElementSummary,
    /// Work along the rows; none before the first.
    work: Option<PathWork>,
    requests: RowRequests,
    /// Grains and deformation from which fluctuations are counted, once they are reached.
    reference: Option<(GrainState<Discs>, Plane)>,
    on_row: &'a mut dyn FnMut(&ElementRow) -> ControlFlow<()>,
}

impl Run<'_> {
    fn follow_path(&mut self, path: &[Segment]) -> Result<(), ElementError> {
        for segment in path.iter().flat_map(|segment| (0..segment.repeat).map(move |_| segment)) {
            if self.follow(segment)?.is_break() {
                break;
            }
        }
        Ok(())
    }

    fn follow(&mut self, segment: &Segment) -> Result<ControlFlow<()>, ElementError> {
        let start = self.deformation;
        self.stress_level = raised_level(self.stress_level, &self.stress);
        let (strains, stresses) = (in_plane(&segment.strain), in_plane(&segment.stress));
        // A stress that was missed across a snap is made up for at once: the next segment goes on from what was wanted.
        let mut start_stress = self.stress;
        for (start, missed) in start_stress.iter_mut().zip(std::mem::take(&mut self.missed)) {
            *start = missed.unwrap_or(*start);
        }
        let places: Vec<usize> = (0..4).filter(|place| stresses[*place].is_some()).collect();
        let mut gradient = [0.0; 4];
        let elastic = self.elastic(&start, &gradient, &places)?;
        let mut response = among(&places, &elastic);
        let mut last_change = [0.0; 4];
        for increment in 1..=segment.increments {
            let share = f64::from(increment) / f64::from(segment.increments);
            let committed = gradient;
            for place in 0..4 {
                match stresses[place] {
                    // Going on as before is the first guess.
                    Some(_) => gradient[place] += last_change[place],
                    None => gradient[place] = share * strains[place].unwrap_or(0.0),
                }
            }
            let targets: Vec<f64> = places
                .iter()
                .map(|place| {
                    let end = stresses[*place].unwrap_or_default();
                    start_stress[*place] + share * (end - start_stress[*place])
                })
                .collect();
            let controlled = Controlled { places: &places, targets: &targets, elastic: &elastic };
            let asked = self.reach(&start, &mut gradient, &controlled, &mut response)?;
            if self.last_control == StressControl::Jump && increment == segment.increments {
                self.missed = stresses;
            }
            last_change = if self.last_control.has_snapped() {
                [0.0; 4]
            } else {
                std::array::from_fn(|place| gradient[place] - committed[place])
            };
            if asked.is_break() {
                return Ok(asked);
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Corrects the free components of `gradient` until the controlled stresses are within tolerance, commits the state and delivers its
    /// row. Where no strain meets them, since the frame snaps, they are relaxed in committed steps.
    fn reach(
        &mut self,
        start: &Plane,
        gradient: &mut [f64; 4],
        controlled: &Controlled<'_>,
        response: &mut DMatrix<f64>,
    ) -> Result<ControlFlow<()>, ElementError> {
        let mut last: Option<(DVector<f64>, DVector<f64>)> = None;
        let mut spent = Spent::default();
        let before = *gradient;
        for _ in 0..MOST_TRIALS {
            let answer = match self.attempt(start, gradient, &mut spent) {
                Err(ElementError::Cell { reason, .. }) if is_out_of_range(&reason) => break,
                answer => answer?,
            };
            let (miss, tolerance, _) = self.miss(&answer, controlled);
            if miss.iter().all(|miss| miss.abs() <= tolerance) {
                let control = if controlled.places.is_empty() { StressControl::None } else { StressControl::Met };
                return Ok(self.accept(start, gradient, &answer, control, spent));
            }
            if let Some((step, before)) = &last {
                let surprise = (before - &miss) - &*response * step;
                *response += surprise * step.transpose() / step.norm_squared();
            }
            let is_finite = |step: &DVector<f64>| step.iter().all(|part| part.is_finite());
            let step = response.clone().lu().solve(&miss).filter(is_finite);
            let step = step.unwrap_or_else(|| miss.map(|_| -PERTURBATION));
            let step = &step * (LARGEST_CORRECTION / step.amax()).min(1.0);
            for (place, part) in controlled.places.iter().zip(step.iter()) {
                gradient[*place] += part;
            }
            last = Some((step, miss));
        }
        *gradient = before;
        *response = among(controlled.places, controlled.elastic);
        self.relax(start, gradient, controlled, spent)
    }

    /// Takes the frame to `gradient` and from there, in committed steps, to the controlled stresses.
    fn relax(
        &mut self,
        start: &Plane,
        gradient: &mut [f64; 4],
        controlled: &Controlled<'_>,
        mut spent: Spent,
    ) -> Result<ControlFlow<()>, ElementError> {
        let mut targets = [None; COMPONENTS];
        for (place, target) in controlled.places.iter().zip(controlled.targets) {
            targets[IN_SPACE[*place]] = Some(*target);
        }
        let mut relaxation = Relaxation::new(&targets);
        let mut nearest = None;
        for taken in 0..MOST_RELAXED {
            let answer = self.attempt(start, gradient, &mut spent)?;
            let (miss, tolerance, scale) = self.miss(&answer, controlled);
            let distance = miss.amax();
            if distance <= tolerance {
                return Ok(self.accept(start, gradient, &answer, StressControl::Relaxed, spent));
            }
            if taken >= STEPS_BEFORE_NEAREST && distance <= LARGEST_JUMP * scale {
                return Ok(self.accept(start, gradient, &answer, StressControl::Jump, spent));
            }
            if nearest.as_ref().is_none_or(|(best, ..): &(DVector<f64>, f64, [f64; 4])| distance < best.amax()) {
                nearest = Some((miss, tolerance, flat(&answer.stress.plane())));
            }
            self.keep(start, gradient);
            spent.restless += u32::from(answer.flags.contains(TrialFlags::NOT_EQUILIBRATED));
            if spent.restless == MOST_RESTLESS {
                break;
            }
            let row = ElementRow::new(self.summary.rows, 2, deformation_in_space(&self.deformation), &answer, None);
            if let Some(work) = &mut self.work {
                work.advance(row.deformation, row.stress, None);
            }
            let next = relaxation.next(
                &in_space(&two_by_two(gradient)),
                &in_space(&answer.stress.plane()),
                controlled.elastic,
            );
            for place in controlled.places {
                gradient[*place] = next[IN_SPACE[*place] / 3][IN_SPACE[*place] % 3];
            }
        }
        let (miss, tolerance, stress) = nearest.expect("at least one step was taken");
        let worst = miss.iamax();
        Err(ElementError::StressNotReached {
            increment: self.summary.rows,
            component: KEYS[controlled.places[worst]],
            reached: stress[controlled.places[worst]],
            target: controlled.targets[worst],
            tolerance,
            iterations: spent.trials,
            remedy: SMALLER_STEPS,
        })
    }

    /// Targets less stresses, Pa, their tolerance, and the stress that both are measured by.
    fn miss(&self, answer: &TrialResult, controlled: &Controlled<'_>) -> (DVector<f64>, f64, f64) {
        let stress = flat(&answer.stress.plane());
        let missing = controlled.places.iter().zip(controlled.targets).map(|(place, target)| target - stress[*place]);
        let pressure = 0.5 * (stress[0] + stress[3]).abs();
        let scale = raised_level(pressure.max(LEAST_SHARE * self.stress_level), controlled.targets);
        (DVector::from_iterator(controlled.places.len(), missing), self.stress_tolerance * scale, scale)
    }

    /// Commits the latest trial.
    fn keep(&mut self, start: &Plane, gradient: &[f64; 4]) {
        self.cell.commit().expect("the accepted trial is the latest");
        self.deformation = deformed(start, gradient);
    }

    /// Commits the latest trial and delivers its row.
    fn accept(
        &mut self,
        start: &Plane,
        gradient: &[f64; 4],
        answer: &TrialResult,
        control: StressControl,
        spent: Spent,
    ) -> ControlFlow<()> {
        self.stress = flat(&answer.stress.plane());
        self.last_control = control;
        self.keep(start, gradient);
        self.deliver(answer, control, spent)
    }

    /// Elastic response of the stresses to the strains at these places, Pa: that of small probes. Where they tell nothing, as in a frame that is
    /// far from rest and collapses in each of them, uniform strain of all grains takes their place: too stiff, so that steps are short.
    fn elastic(&mut self, start: &Plane, gradient: &[f64; 4], places: &[usize]) -> Result<Operator, ElementError> {
        let probed = self.perturbed(start, gradient, places)?;
        let mut operator = [[0.0; COMPONENTS]; COMPONENTS];
        let mut targets = [None; COMPONENTS];
        for (row, place) in places.iter().enumerate() {
            targets[IN_SPACE[*place]] = Some(0.0);
            for (column, other) in places.iter().enumerate() {
                operator[IN_SPACE[*place]][IN_SPACE[*other]] = probed[(row, column)];
            }
        }
        if places.is_empty() || Relaxation::new(&targets).is_sound(&operator) {
            return Ok(operator);
        }
        let uniform = tangent::evaluate(&self.cell.committed_network(), FrozenMethod::KRUYT);
        Ok(by_gradient(&uniform.operator, &[[0.0; 3]; 3]))
    }

    /// Derivative of the controlled stresses by the free strains, from small probes.
    fn perturbed(
        &mut self,
        start: &Plane,
        gradient: &[f64; 4],
        places: &[usize],
    ) -> Result<DMatrix<f64>, ElementError> {
        let mut response = DMatrix::zeros(places.len(), places.len());
        for (column, place) in places.iter().enumerate() {
            let mut stresses = [[0.0; 4]; 2];
            for (stress, sign) in stresses.iter_mut().zip([1.0, -1.0]) {
                let mut probe = *gradient;
                probe[*place] += sign * PERTURBATION;
                let mut spent = Spent::default();
                let answer = self.attempt(start, &probe, &mut spent)?;
                self.summary.dem_steps += spent.dem_steps;
                *stress = flat(&answer.stress.plane());
            }
            for (row, place) in places.iter().enumerate() {
                response[(row, column)] = (stresses[0][*place] - stresses[1][*place]) / (2.0 * PERTURBATION);
            }
        }
        Ok(response)
    }

    fn attempt(
        &mut self,
        start: &Plane,
        gradient: &[f64; 4],
        spent: &mut Spent,
    ) -> Result<TrialResult, ElementError> {
        if self.requests.stop.is_made() {
            return Err(ElementError::Interrupted { increment: self.summary.rows });
        }
        let target = plane::product(&deformed(start, gradient), &plane::inverse(&self.deformation));
        let h = plane::add_scaled(&target, -1.0, &plane::IDENTITY);
        let options = TrialOptions { observables: Observables::ALL, ..TrialOptions::default() };
        let answer = self.cell.trial(&Tensor2::from_plane(h), &options);
        let answer = answer.map_err(|reason| ElementError::Cell { increment: self.summary.rows, reason })?;
        spent.trials += 1;
        spent.dem_steps += answer.cost.force_evaluations;
        Ok(answer)
    }

    fn deliver(&mut self, answer: &TrialResult, control: StressControl, spent: Spent) -> ControlFlow<()> {
        let mut row = ElementRow::new(self.summary.rows, 2, deformation_in_space(&self.deformation), answer, None);
        match &mut self.work {
            Some(work) => work.advance(row.deformation, row.stress, None),
            none => *none = Some(PathWork::new(row.deformation, row.stress, 1.0)),
        }
        row.work = self.work.as_ref().map_or(0.0, |work| work.over_present_volume()[0]);
        row.trials = spent.trials;
        row.dem_steps = spent.dem_steps;
        row.stress_control = control;
        let network = self.cell.committed_network();
        row.force_anisotropy = Some(network.force_anisotropy());
        row.picture = self.requests.pictures.contains(&row.increment).then(|| self.cell.picture(&network));
        if self.requests.fluctuations_from == Some(row.increment) {
            self.reference = Some((self.cell.committed().clone(), self.deformation));
        }
        if let (Some(_), Some((start, deformation))) = (&row.picture, &self.reference) {
            let since = plane::product(&self.deformation, &plane::inverse(deformation));
            row.fluctuations = Some(displacement_fluctuations(start, self.cell.committed(), &since));
        }
        self.summary.add(&row);
        // The row tells of its last state.
        let is_hidden = spent.restless > 0 && !row.flags.contains(TrialFlags::NOT_EQUILIBRATED);
        self.summary.not_equilibrated += u64::from(is_hidden);
        (self.on_row)(&row)
    }
}

/// The part of an operator that belongs to these places.
fn among(places: &[usize], operator: &Operator) -> DMatrix<f64> {
    DMatrix::from_fn(places.len(), places.len(), |row, column| {
        operator[IN_SPACE[places[row]]][IN_SPACE[places[column]]]
    })
}

/// `F = (I + G) F0`.
fn deformed(start: &Plane, gradient: &[f64; 4]) -> Plane {
    let [xx, xy, yx, yy] = *gradient;
    plane::product(&[[1.0 + xx, xy], [yx, 1.0 + yy]], start)
}

fn two_by_two([xx, xy, yx, yy]: &[f64; 4]) -> Plane {
    [[*xx, *xy], [*yx, *yy]]
}

fn flat(tensor: &Plane) -> [f64; 4] {
    [tensor[0][0], tensor[0][1], tensor[1][0], tensor[1][1]]
}

/// The components 11, 12, 21, 22 of a table.
fn in_plane(table: &Components) -> [Option<f64>; 4] {
    [table.xx, table.xy, table.yx, table.yy]
}

/// A deformation gradient of the plane in space, where nothing is stretched out of the plane.
fn deformation_in_space(deformation: &Plane) -> Matrix {
    let [[xx, xy], [yx, yy]] = *deformation;
    [[xx, xy, 0.0], [yx, yy, 0.0], [0.0, 0.0, 1.0]]
}

/// A displacement gradient or a stress (Pa) of the plane in space: zero out of the plane.
fn in_space(tensor: &Plane) -> Matrix {
    let [[xx, xy], [yx, yy]] = *tensor;
    [[xx, xy, 0.0], [yx, yy, 0.0], [0.0; 3]]
}
