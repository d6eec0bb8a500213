//! The driver: increment by increment along the path.

use super::error::ElementError;
use super::increment::{Accepted, Spent};
use super::path::{COMPONENTS, Matrix, Operator, SegmentKinematics, flat, tensor_of};
use super::probes::Probed;
use super::requests::{RowRequests, StopRequests};
use super::row::ElementRow;
use super::start_check::is_far_from_targets;
use super::step::{Step, raised_level};
use super::stress_control::StressControl;
use super::strides::Strides;
use super::summary::{ElementEnd, ElementSummary};
use super::test_file::{ElementTest, Segment};
use super::tested_cell::TestedCell;
use super::work::PathWork;
use crate::cell::{ContactNetwork, GrainState};
use crate::definition::{GrainDefinition, Packing, PackingFile};
use crate::engine::GrainRve;
use crate::homogenization::fluctuation::displacement_fluctuations;
use crate::programs::frame::{FrameDefinition, FrameRve};
use crate::solver::SolverFor;
use crate::space::{Space, Tensor, add_scaled, inverse, product};
use crate::tangent::{self, Closeness};
use protocol::{RveError, TangentKind, TrialFlags};
use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::path::Path;

/// Share of the energy stored in the contacts that numerical damping takes in an increment from which on grains have rearranged suddenly. Steady
/// sliding leaves it some thousandths.
const SUDDEN: f64 = 0.1;

/// Runs `test`; paths in it are relative to `base_dir`. Every row is given to `on_row` as soon as it is accepted, with
/// what `requests` names: a tangent operator alone stands for itself.
///
/// A controlled stress component is accepted within `stress_tolerance` times the mean pressure `|tr sigma|` over the
/// dimension of the trial (or times the largest target, or a hundredth of the largest stress at which a segment has started, if that is
/// greater: a cell without pressure has no scale of its own). The stress of a packing that is far from rest does not count, but that of its first
/// row instead.
///
/// # Errors
/// See [`ElementError`]; rows delivered before stay valid.
pub fn run_element(
    test: &ElementTest,
    base_dir: &Path,
    requests: impl Into<RowRequests>,
    on_row: &mut dyn FnMut(&ElementRow),
) -> Result<ElementSummary, ElementError> {
    let packing = Packing::read(&base_dir.join(&test.packing))?;
    let end = run_element_on(test, packing, requests, &mut |row| {
        on_row(row);
        ControlFlow::Continue(())
    });
    end.result.map(|()| end.summary)
}

/// Runs `test` on a packing in memory, which has been checked; `test.packing` is not read. `on_row` may end the test after
/// any row.
pub fn run_element_on(
    test: &ElementTest,
    packing: Packing,
    requests: impl Into<RowRequests>,
    on_row: &mut dyn FnMut(&ElementRow) -> ControlFlow<()>,
) -> ElementEnd {
    run_requested(test, packing, requests.into(), on_row)
}

/// Not generic, unlike the function above: the cells are compiled in this crate, and not again in every program that uses it.
fn run_requested(
    test: &ElementTest,
    packing: Packing,
    requests: RowRequests,
    on_row: &mut dyn FnMut(&ElementRow) -> ControlFlow<()>,
) -> ElementEnd {
    let refused = |reason: &str| ElementEnd::from(ElementError::Test(reason.to_owned()));
    if test.frame.is_some() && requests.tangent != TangentKind::None {
        return refused("frame: the table of a frame has no tangent; leave out --tangent, or the table");
    }
    match (packing, &test.frame) {
        (Packing::Discs(packing), None) => run_on(periodic_cell(test, packing), test, requests, on_row),
        (Packing::Spheres(packing), None) => run_on(periodic_cell(test, packing), test, requests, on_row),
        (Packing::Discs(packing), Some(options)) => {
            let definition = FrameDefinition { packing, contact: test.contact.clone(), frame: options.clone() };
            let frame = FrameRve::new(&definition).map_err(ElementError::Definition);
            run_on(frame.and_then(|frame| test.check_dimension(2).map(|()| frame)), test, requests, on_row)
        }
        (Packing::Spheres(_), Some(_)) => {
            refused("frame: boundary-particle frames are for plane packings; remove the table")
        }
    }
}

fn periodic_cell<S: SolverFor>(test: &ElementTest, packing: PackingFile<S>) -> Result<GrainRve<S>, ElementError> {
    test.check_dimension(S::DIMENSION)?;
    let definition = GrainDefinition { packing, contact: test.contact.clone(), options: test.rve.clone() };
    let mut cell = GrainRve::new(&definition).map_err(ElementError::Definition)?;
    cell.solve_operators_to(Closeness::RESULT);
    cell.count_energies();
    Ok(cell)
}

fn run_on<C: TestedCell>(
    cell: Result<C, ElementError>,
    test: &ElementTest,
    requests: RowRequests,
    on_row: &mut dyn FnMut(&ElementRow) -> ControlFlow<()>,
) -> ElementEnd {
    match cell {
        Ok(cell) => {
            let mut run = Run::new(cell, test, requests);
            let result = run.follow_path(test, on_row);
            if result.is_err() {
                // Those of the row that was not reached.
                run.summary.trials += u64::from(run.spent.trials);
                run.summary.dem_steps += run.spent.dem_steps;
            }
            ElementEnd { summary: run.summary, result }
        }
        Err(error) => error.into(),
    }
}

/// A test on its way.
pub(super) struct Run<C: TestedCell> {
    pub(super) cell: C,
    pub(super) stress_tolerance: f64,
    tangent: TangentKind,
    pictures: BTreeSet<u64>,
    fluctuations_from: Option<u64>,
    pub(super) stop: StopRequests,
    /// Grains and deformation from which fluctuations are counted, once they are reached.
    reference: Option<(GrainState<C::Grains>, Matrix)>,
    pub(super) summary: ElementSummary,
    /// F of the committed state, relative to the packing as given.
    deformation: Matrix,
    /// Stress of the committed state, Pa.
    pub(super) stress: Matrix,
    /// Largest stress component at the start of a segment so far, Pa.
    stress_level: f64,
    /// Whether the packing as given is far from equilibrium under the law.
    is_far_from_rest: bool,
    /// Work and damping up to the committed state.
    pub(super) work: PathWork,
    /// Network of the committed state with the contacts that slid in the last step.
    pub(super) network: Option<ContactNetwork<C::Grains>>,
    /// Targets of the last segment if its last increment missed them, Pa.
    missed: [Option<f64>; COMPONENTS],
    /// Change of G in the last increment of the same segment.
    pub(super) last_change: Option<Matrix>,
    /// Parts in which increments of the same segment are taken.
    strides: Strides,
    /// Elastic operator of the last state that a search started from and that carried a load; for cells that carry none.
    pub(super) sound: Option<Operator>,
    /// What perturbations have told in this segment, where no operator of the contacts does.
    pub(super) probed: Option<Probed>,
    /// Cost of the present increment so far.
    pub(super) spent: Spent,
    /// DEM steps in which the packing came to rest; they count with the first increment.
    spent_settling: u64,
    /// Energies of the last row: taken by numerical damping so far and stored in the contacts, J/m3.
    last_energies: [f64; 2],
}

impl<C: TestedCell> Run<C> {
    /// Before row 0.
    fn new(cell: C, test: &ElementTest, requests: RowRequests) -> Self {
        let summary = ElementSummary { listed_forces: cell.forces_not_taken_over(), ..ElementSummary::default() };
        Self {
            cell,
            stress_tolerance: test.stress_tolerance,
            tangent: requests.tangent,
            pictures: requests.pictures,
            fluctuations_from: requests.fluctuations_from,
            stop: requests.stop,
            reference: None,
            summary,
            deformation: Matrix::IDENTITY,
            stress: Matrix::ZERO,
            stress_level: 0.0,
            is_far_from_rest: false,
            work: PathWork::new(Matrix::IDENTITY, Matrix::ZERO, f64::NAN),
            network: None,
            missed: [None; COMPONENTS],
            last_change: None,
            strides: Strides::of(0.0),
            sound: None,
            probed: None,
            spent: Spent::default(),
            spent_settling: 0,
            last_energies: [0.0; 2],
        }
    }

    /// Row 0 and all segments.
    fn follow_path(
        &mut self,
        test: &ElementTest,
        on_row: &mut dyn FnMut(&ElementRow) -> ControlFlow<()>,
    ) -> Result<(), ElementError> {
        if self.begin(test, on_row).map_err(ElementError::Definition)?.is_break() {
            return Ok(());
        }
        // Where stresses are controlled, the search for them takes the grains to rest.
        let strains_only = |segment: &Segment| segment.stress.values().iter().all(Option::is_none);
        if self.is_far_from_rest {
            if test.path.first().is_some_and(strains_only) {
                self.settle()?;
            } else {
                self.summary.begins_with_motion = 1;
            }
        }
        // The stress of a packing that is far from rest is none that the cell has borne.
        let mut has_borne = self.summary.begins_with_motion == 0;
        for segment in &test.path {
            self.last_change = None;
            self.strides = Strides::of(if strains_only(segment) { 0.0 } else { strain_of_an_increment(segment) });
            for _ in 0..segment.repeat {
                self.probed = None;
                if std::mem::replace(&mut has_borne, true) {
                    self.stress_level = raised_level(self.stress_level, &flat(&self.stress));
                }
                if self.follow(segment, on_row)?.is_break() {
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    fn begin(
        &mut self,
        test: &ElementTest,
        on_row: &mut dyn FnMut(&ElementRow) -> ControlFlow<()>,
    ) -> Result<ControlFlow<()>, RveError> {
        let answer = self.cell.observed()?;
        let network = self.cell.network_at_rest()?;
        self.work = PathWork::new(self.deformation, tensor_of(&answer.stress.0), network.volume());
        self.network = Some(network);
        let is_wanted = self.tangent != TangentKind::None;
        let operator = is_wanted.then(|| self.cell.operator_as_given(self.tangent)).flatten();
        self.is_far_from_rest = self.cell.begins_far_from_rest(&answer);
        let mut row = ElementRow::new(0, dimension::<C>(), self.deformation, &answer, operator);
        row.damping_work = C::COUNTS_DAMPING.then_some(0.0);
        self.summary.far_from_targets = u64::from(is_far_from_targets(test, &row.stress));
        Ok(self.deliver(row, on_row))
    }

    /// Brings the packing to rest under the law, where it is; row 0 remains the packing as given.
    fn settle(&mut self) -> Result<(), ElementError> {
        let answer = self.cell.come_to_rest().map_err(|reason| ElementError::Cell { increment: 0, reason })?;
        self.spent_settling = answer.cost.force_evaluations;
        self.summary.settled = 1;
        self.summary.not_equilibrated += u64::from(answer.flags.contains(TrialFlags::NOT_EQUILIBRATED));
        self.summary.damping_changed += u64::from(answer.flags.contains(TrialFlags::DAMPING_CHANGED));
        self.keep_network();
        let energies = self.cell.energies_of_trial();
        self.cell.commit().expect("the cell has just settled");
        self.stress = tensor_of(&answer.stress.0);
        self.work.advance(self.deformation, self.stress, energies);
        // What damping took on the way to rest is no rearrangement of the first increment.
        let [_, damping] = self.work.over_present_volume();
        self.last_energies = [damping, answer.observed.elastic_energy];
        Ok(())
    }

    fn follow(
        &mut self,
        segment: &Segment,
        on_row: &mut dyn FnMut(&ElementRow) -> ControlFlow<()>,
    ) -> Result<ControlFlow<()>, ElementError> {
        let kinematics_at_start = self.deformation;
        // A stress that was missed across a snap is made up for at once: the next segment goes on from what was wanted.
        let mut start_stress = flat(&self.stress);
        for (start, missed) in start_stress.iter_mut().zip(std::mem::take(&mut self.missed)) {
            *start = missed.unwrap_or(*start);
        }
        let mut committed_gradient = Matrix::ZERO;
        for increment in 1..=segment.increments {
            let share = |number: u32| f64::from(number) / f64::from(segment.increments);
            let (begin, end) = (share(increment - 1), share(increment));
            self.spent = Spent { dem_steps: std::mem::take(&mut self.spent_settling), ..Spent::default() };
            let accepted = loop {
                // The end itself, to the bit.
                let (part, is_last) = self.strides.aim();
                let aim = if is_last { end } else { begin + part * (end - begin) };
                let kinematics = SegmentKinematics { at_start: kinematics_at_start, committed: self.deformation };
                let mut gradient = flat(&committed_gradient);
                let mut targets = segment.stress.values();
                for place in 0..COMPONENTS {
                    match &mut targets[place] {
                        Some(target) => *target = start_stress[place] + aim * (*target - start_stress[place]),
                        None => gradient[place] = aim * segment.strain.values()[place].unwrap_or(0.0),
                    }
                }
                let (gradient, level) = (tensor_of(&gradient), self.stress_level);
                let step = Step { kinematics, committed_gradient, gradient, targets, level };
                let is_smallest = self.strides.is_shortest();
                let relaxed_before = self.spent.relaxed;
                let attempt = if targets.iter().all(Option::is_none) {
                    self.prescribed(&step)
                } else {
                    self.controlled(&step, is_smallest)
                };
                let accepted = match attempt {
                    Err(ElementError::StressNotReached { .. } | ElementError::StressOutOfReach { .. })
                        // What has been committed on the way to the stresses cannot be taken back.
                        if !is_smallest && self.spent.relaxed == relaxed_before =>
                    {
                        self.cell.rollback();
                        self.last_change = None;
                        self.forget_followed();
                        self.strides.halve();
                        continue;
                    }
                    attempt => attempt?,
                };
                if is_last {
                    break accepted;
                }
                self.strides.advance(accepted.control != StressControl::Jump);
                self.take_up(&step.kinematics, &accepted, &mut committed_gradient);
            };
            let operator = self.operator();
            let kinematics = SegmentKinematics { at_start: kinematics_at_start, committed: self.deformation };
            self.take_up(&kinematics, &accepted, &mut committed_gradient);
            let mut control = accepted.control;
            if self.strides.is_cut() {
                self.summary.cut_increments += 1;
                self.last_change = None;
                control = control.max(StressControl::Cut);
            }
            self.strides = self.strides.next_increment();
            self.summary.stress_jumps += u64::from(self.spent.has_jumped);
            // The row tells of its last state.
            let is_told = accepted.answer.flags.contains(TrialFlags::NOT_EQUILIBRATED);
            self.summary.not_equilibrated += u64::from(self.spent.restless > 0 && !is_told);
            if self.spent.relaxed > 0 {
                // The way here has led far from where perturbations were tried.
                self.probed = None;
                self.summary.relaxed_increments += 1;
                control = control.max(StressControl::Relaxed);
            }
            if accepted.control == StressControl::Jump && increment == segment.increments {
                self.missed = segment.stress.values();
            }
            if self.accept(&accepted, control, operator, on_row).is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Makes the accepted trial the committed state.
    fn take_up(&mut self, kinematics: &SegmentKinematics, accepted: &Accepted, committed_gradient: &mut Matrix) {
        let energies = self.cell.energies_of_trial();
        self.cell.commit().expect("the accepted trial is the latest");
        self.last_change =
            (!accepted.control.has_snapped()).then(|| add_scaled(&accepted.gradient, -1.0, committed_gradient));
        *committed_gradient = accepted.gradient;
        self.deformation = kinematics.deformation(&accepted.gradient);
        self.stress = tensor_of(&accepted.answer.stress.0);
        self.work.advance(self.deformation, self.stress, energies);
    }

    fn accept(
        &mut self,
        accepted: &Accepted,
        control: StressControl,
        operator: Option<tangent::TangentOutcome>,
        on_row: &mut dyn FnMut(&ElementRow) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        if self.summary.begins_with_motion == 1 && self.stress_level == 0.0 {
            // The first stress that was asked of a packing that began far from rest; strides on the way to it are none.
            self.stress_level = raised_level(0.0, &flat(&self.stress));
        }
        let mut row =
            ElementRow::new(self.summary.rows, dimension::<C>(), self.deformation, &accepted.answer, operator);
        row.trials = self.spent.trials;
        row.dem_steps = self.spent.dem_steps;
        row.stress_control = control;
        let [work, damping] = self.work.over_present_volume();
        (row.work, row.damping_work) = (work, C::COUNTS_DAMPING.then_some(damping));
        self.deliver(row, on_row)
    }

    /// Hands on the row of the committed state.
    fn deliver(
        &mut self,
        mut row: ElementRow,
        on_row: &mut dyn FnMut(&ElementRow) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        self.stress = row.stress;
        if let Some(damping) = row.damping_work {
            let [damped, stored] = std::mem::replace(&mut self.last_energies, [damping, row.elastic_energy]);
            // A cell that has come apart stores nothing that damping could be measured by.
            let bears_load = !row.flags.contains(TrialFlags::NO_LOAD_BEARING_CONTACTS);
            let is_sudden =
                row.increment > 0 && bears_load && damping - damped > SUDDEN * stored.max(row.elastic_energy);
            self.summary.sudden_rearrangements += u64::from(is_sudden);
        }
        let network = self.cell.network_at_rest().expect("an accepted state is finite");
        row.force_anisotropy = Some(network.force_anisotropy());
        row.picture = self.pictures.contains(&row.increment).then(|| self.cell.picture_of(&network));
        if self.fluctuations_from == Some(row.increment) {
            self.reference = Some((self.cell.grains().clone(), self.deformation));
        }
        if let (Some(_), Some((start, deformation))) = (&row.picture, &self.reference) {
            let since = product(&self.deformation, &inverse(deformation));
            let about = <C::Grains as Space>::Tensor::from_fn(|i, j| since[i][j]);
            row.fluctuations = Some(displacement_fluctuations(start, self.cell.grains(), &about));
        }
        self.summary.note(&row);
        on_row(&row)
    }

    /// The operator requested, of the present trial.
    fn operator(&mut self) -> Option<tangent::TangentOutcome> {
        let perturbed = self.cell.requested_operator(self.tangent)?;
        self.summary.operator_steps += perturbed.force_evaluations;
        Some(perturbed.outcome)
    }
}

/// Largest component of the prescribed strain of an increment.
fn strain_of_an_increment(segment: &Segment) -> f64 {
    let largest = segment.strain.values().into_iter().flatten().map(f64::abs).fold(0.0, f64::max);
    largest / f64::from(segment.increments)
}

fn dimension<C: TestedCell>() -> u32 {
    C::Grains::DIMENSION as u32
}
