//! Through snaps: bars whose weakest cell softens faster than the others unload.

use super::*;
use crate::formulation::Formulation;
use crate::material::altered::{Altered, Timid};
use crate::material::damage::{DamageLaw, DamageMaterial};
use crate::observer::{Outcome, Stabilised};
use crate::problem::Stabilisation;
use protocol::RveError;

const CELLS: usize = 6;

/// Strain at which the weak cell softens.
const THRESHOLD: f64 = 1e-3;

/// Strain over which its stress falls by a factor of e: at first 2.5 times as fast as the others shorten while they unload.
const SOFTENING: f64 = 2e-3;

/// A column of unit cells in uniaxial strain.
pub(crate) fn softening_column(loading: Condition) -> Problem {
    let conditions = vec![
        Condition::fixed("bottom", Axis::Y),
        Condition::fixed("left", Axis::X),
        Condition::fixed("right", Axis::X),
        loading,
    ];
    let mut problem = Problem::new(block(ElementKind::Q4, 1, CELLS), conditions);
    problem.formulation = Formulation::SmallStrain;
    problem.stages[0].control.min = 1e-3;
    problem.stages[0].control.max_iterations = 60;
    problem.stages[0].tolerances = Tolerances::both(1e-8, 1e-8);
    // Cut back to the smallest step first, so that the place of a snap is that of the closed form.
    problem.stages[0].control.stabilisation = Some(LATE);
    problem
}

/// Only where the smallest step has failed.
const LATE: Stabilisation =
    Stabilisation { after: None, commit_iterates_after: None, ..Stabilisation::UNDER_MOVING_SUPPORTS };

pub(crate) fn pulled(by: f64) -> Problem {
    softening_column(Condition::Displacement { nodes: "top".into(), axis: Axis::Y, value: by })
}

/// The lowest cell is weak.
pub(crate) fn weak_at_the_bottom() -> DamageMaterial {
    let law = |point| DamageLaw {
        lambda: 1.0e7,
        shear: 1.0e7,
        threshold: if point < 4 { THRESHOLD } else { f64::INFINITY },
        softening: SOFTENING,
    };
    DamageMaterial::new((0..4 * CELLS).map(law).collect())
}

/// Strain of the weak cell on the far side of the snap, by bisection of the column's length.
fn strain_beyond(pulled: f64) -> f64 {
    let (mut low, mut high) = (THRESHOLD + SOFTENING * (2.5f64).ln(), pulled);
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        let others = THRESHOLD * (-(middle - THRESHOLD) / SOFTENING).exp();
        if middle + (CELLS - 1) as f64 * others < pulled { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Keeps what is told about stabilised steps and those with committed iterates, and everything else.
#[derive(Default)]
pub(super) struct Watch {
    pub(super) stabilised: Vec<Stabilised>,
    pub(super) committed: Vec<Stabilised>,
    pub(super) recorder: Recorder,
}

impl Observer for Watch {
    fn iterated(&mut self, report: &IterationReport) {
        self.recorder.iterated(report);
    }

    fn accepted(&mut self, report: &StepReport, fields: &FieldsView<'_>) -> Result<(), StopRequest> {
        self.recorder.accepted(report, fields)
    }

    fn stabilised(&mut self, event: &Stabilised) {
        self.stabilised.push(event.clone());
    }

    fn iterates_committed(&mut self, event: &Stabilised) {
        self.committed.push(event.clone());
    }
}

/// The end of the prescribed path is reached on the far branch of the closed form; what happened is told and counted.
#[test]
fn a_snap_under_displacement_control_ends_on_the_far_branch() {
    let problem = pulled(1e-2);
    let (mut material, mut watch) = (weak_at_the_bottom(), Watch::default());
    let run = solve(&problem, &mut material, &mut watch);
    assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
    let exact = strain_beyond(1e-2);
    assert!((material.largest_strain(0) / exact - 1.0).abs() < 1e-6, "{} {exact}", material.largest_strain(0));
    let [event] = &watch.stabilised[..] else { panic!("{:?}", watch.stabilised) };
    assert_eq!(
        (run.statistics.stabilised_steps, run.statistics.stabilisation_increments),
        (1, event.increments as u64)
    );
    assert!(event.work > 0.0 && event.largest_imbalance > 1e-2 && event.increments < 60, "{event:?}");
    let Watch { recorder, .. } = watch;
    let stabilised: Vec<&StepReport> =
        recorder.steps.iter().filter(|step| step.stabilisation_increments > 0).collect();
    assert_eq!(stabilised.len(), 1);
    assert!(stabilised[0].force_ratio < 1e-8 && (stabilised[0].load - 0.6).abs() < 0.05, "{stabilised:?}");
    // The gradients of the step are those of the whole way.
    let strain: f64 = recorder.points.iter().map(|point| point.deformation.get(1, 1) - 1.0).sum::<f64>() / 4.0;
    assert!((strain / 1e-2 - 1.0).abs() < 1e-9, "{strain}");
}

/// Work that the viscosity takes is what the column gives up: the work of the supports less what is stored and lost.
#[test]
fn the_drag_takes_what_the_snap_sets_free() {
    let problem = pulled(1e-2);
    let (mut material, mut watch) = (weak_at_the_bottom(), Watch::default());
    solve(&problem, &mut material, &mut watch);
    let stiffness = 3.0e7;
    let stored = |weak: f64, others: f64| {
        let integrity =
            if weak <= THRESHOLD { 1.0 } else { THRESHOLD / weak * (-(weak - THRESHOLD) / SOFTENING).exp() };
        0.5 * stiffness * (integrity * weak * weak + (CELLS - 1) as f64 * others * others)
    };
    let lost = DamageLaw { lambda: 1.0e7, shear: 1.0e7, threshold: THRESHOLD, softening: SOFTENING };
    // The column is held at the length of the stabilised step, and begins it next to the threshold.
    let length = 1e-2 * watch.stabilised[0].load;
    let after = strain_beyond(length);
    let others = (length - after) / (CELLS - 1) as f64;
    let released = stored(THRESHOLD, THRESHOLD) - stored(after, others) - lost.dissipation(after);
    // The trapezium rule over the increments, and the load step itself.
    // Increments are few, and the trapezium rule is what it is.
    assert!((watch.stabilised[0].work / released - 1.0).abs() < 0.1, "{} {released}", watch.stabilised[0].work);
}

/// Under a force that the column cannot carry there is no balance to come to. What that took is counted all the same.
#[test]
fn a_collapse_is_told_from_a_snap() {
    let traction = Condition::Traction { sides: "top".into(), value: [0.0, 1.1 * 3.0e7 * THRESHOLD, 0.0] };
    let mut problem = softening_column(traction);
    problem.stages[0].control.stabilisation = Some(Stabilisation { most_increments: 100, ..LATE });
    let (run, recorder) = run(&problem, &mut weak_at_the_bottom());
    let Outcome::DidNotConverge { reason } = &run.outcome else { panic!("{:?}", run.outcome) };
    assert!(reason.contains("stabilised: no equilibrium after 100 increments"), "{reason}");
    assert!(run.load < 1.0 && run.load > 0.85, "{}", run.load);
    let statistics = &run.statistics;
    assert_eq!(statistics.stabilised_steps, 0);
    let stabilised = &recorder.iterations[recorder.iterations.len() - 100..];
    let taken_back = stabilised.iter().filter(|report| report.rejected).count() as u64;
    assert_eq!(statistics.stabilisation_increments + taken_back, 100);
    assert_eq!(statistics.stabilisation_evaluations, stabilised.iter().map(|report| report.evaluations).sum::<u64>());
    assert_eq!((statistics.stabilisations_taken_back, statistics.stabilisation_work), (1, 0.0));
}

/// With more increments than the force needs to stop falling, the path of a step that can be cut back is given up as soon as nothing comes of
/// it; that of the smallest step is the last resort, and ends with a body that has collapsed.
#[test]
fn a_path_without_gain_is_given_up_before_its_increments_are_spent() {
    let traction = Condition::Traction { sides: "top".into(), value: [0.0, 1.1 * 3.0e7 * THRESHOLD, 0.0] };
    let mut problem = softening_column(traction);
    problem.stages[0].control.stabilisation =
        Some(Stabilisation { most_increments: 1000, after: Some(1), ..Stabilisation::default() });
    let (run, recorder) = run(&problem, &mut weak_at_the_bottom());
    let Outcome::DidNotConverge { reason } = &run.outcome else { panic!("{:?}", run.outcome) };
    assert!(
        reason.contains("stabilised: collapse:") && reason.contains("have strained the body by 10.0 %"),
        "{reason}"
    );
    assert_eq!(run.statistics.stabilisations_taken_back, 2);
    assert!(recorder.iterations.len() < 1400, "{}", recorder.iterations.len());
}

/// A force that the column carries in part: stabilised at once, the first step beyond that is taken back, and cutting back finds
/// the same states as if it had never been tried.
#[test]
fn a_step_that_is_stabilised_in_vain_is_taken_back_and_cut_back() {
    let traction = Condition::Traction { sides: "top".into(), value: [0.0, 1.1 * 3.0e7 * THRESHOLD, 0.0] };
    let carried = |after: Option<usize>| {
        let mut problem = softening_column(traction.clone());
        problem.stages[0].control.stabilisation = Some(Stabilisation { after, ..Stabilisation::default() });
        let mut material = weak_at_the_bottom();
        let (run, recorder) = run(&problem, &mut material);
        let Outcome::DidNotConverge { reason } = &run.outcome else { panic!("{:?}", run.outcome) };
        assert!(reason.contains("the smallest step") && reason.contains("stabilised: "), "{reason}");
        // However the run ends, the material is in the last accepted state.
        assert!(material.largest_strain(0) <= THRESHOLD, "{}", material.largest_strain(0));
        (run, recorder)
    };
    let (last, at_once) = (carried(None), carried(Some(1)));
    assert_eq!(last.0.statistics.stabilisations_taken_back, 1);
    assert_eq!(at_once.0.statistics.stabilisations_taken_back, 2);
    assert_eq!(at_once.0.statistics.cut_backs, last.0.statistics.cut_backs);
    let loads = |recorder: &Recorder| recorder.steps.iter().map(|step| step.load).collect::<Vec<f64>>();
    assert_eq!(loads(&at_once.1), loads(&last.1));
    assert_eq!(at_once.0.load, last.0.load);
    for (one, other) in at_once.1.points.iter().zip(&last.1.points) {
        assert_eq!(one.stress, other.stress);
        assert!(one.evaluations > other.evaluations, "{} {}", one.evaluations, other.evaluations);
    }
}

/// A material that refuses everything after certain numbers of commits, until it is returned to its mark.
struct RefusesUntilTakenBack {
    material: DamageMaterial,
    commits: usize,
    refuses_after: Vec<usize>,
}

impl PointMaterial for RefusesUntilTakenBack {
    fn evaluate(&mut self, trials: &[PointTrial]) -> Result<Vec<TrialResult>, MaterialError> {
        if self.refuses_after.first() == Some(&self.commits) {
            let reason = RveError::TargetTooLarge { norm: 1.0, limit: 0.0 };
            return Err(MaterialError::Point { point: trials[0].point, reason });
        }
        self.material.evaluate(trials)
    }

    fn commit(&mut self) -> Result<(), MaterialError> {
        self.commits += 1;
        self.material.commit()
    }

    fn rollback(&mut self) {
        self.material.rollback();
    }

    fn mark(&mut self) {
        self.material.mark();
    }

    fn return_to_mark(&mut self) {
        self.refuses_after.remove(0);
        self.material.return_to_mark();
    }

    fn copy_state(&mut self, from: PointId, to: PointId) {
        self.material.copy_state(from, to);
    }
}

/// The second step is taken back and goes on in shorter ones. Once they have passed its end, the next failure is stabilised at once again,
/// although none of them has had the full size.
#[test]
fn steps_are_stabilised_again_beyond_the_end_of_one_that_was_taken_back() {
    let mut problem = pulled(5e-4);
    problem.stages[0].control.increments = 4;
    problem.stages[0].control.stabilisation = Some(Stabilisation { after: Some(1), ..LATE });
    let mut material =
        RefusesUntilTakenBack { material: weak_at_the_bottom(), commits: 0, refuses_after: vec![1, 3] };
    let (run, recorder) = run(&problem, &mut material);
    assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
    assert_eq!(run.statistics.stabilisations_taken_back, 2);
    let loads: Vec<f64> = recorder.steps.iter().map(|step| step.load).collect();
    assert!(loads[1] == 0.25 && loads[3] >= 0.5 && loads[4] - loads[3] < 0.25, "{loads:?}");
}

/// An increment that a point refuses is taken back and made smaller, counted and told like any iterate that is turned down.
#[test]
fn increments_that_points_refuse_are_taken_back_and_counted() {
    let mut problem = pulled(1e-2);
    problem.stages[0].control.stabilisation = Some(Stabilisation { after: Some(1), ..Stabilisation::default() });
    let mut material = Altered { material: weak_at_the_bottom(), alteration: Timid::new(4e-4) };
    let mut watch = Watch::default();
    let run = solve(&problem, &mut material, &mut watch);
    assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
    let Watch { stabilised: events, recorder: Recorder { iterations, .. }, .. } = watch;
    let refused = |reports: &[IterationReport]| {
        reports.iter().filter(|report| report.rejected && report.evaluations == 0).count()
    };
    assert_eq!(refused(&iterations) as u64, material.alteration.refused);
    assert_eq!(run.statistics.rejected, iterations.iter().filter(|report| report.rejected).count() as u64);
    // Stabilisation begins to count iterations again after the attempt that failed.
    let snap = &events[0];
    let of_step: Vec<IterationReport> = iterations.into_iter().filter(|report| report.step == snap.step).collect();
    let stabilised = &of_step[of_step.iter().rposition(|report| report.iteration == 1).unwrap()..];
    assert!(refused(stabilised) > 3, "{}", refused(stabilised));
    assert_eq!(stabilised.iter().filter(|report| !report.rejected).count(), snap.increments);
    assert_eq!(stabilised.iter().map(|report| report.evaluations).sum::<u64>(), snap.evaluations);
    let increments: u64 = events.iter().map(|event| event.increments as u64).sum();
    assert_eq!(
        (run.statistics.stabilised_steps, run.statistics.stabilisation_increments),
        (events.len() as u64, increments)
    );
}

/// Without it a snap ends the run, as an honest failure; sooner, it saves the attempts with smaller steps.
#[test]
fn it_can_be_switched_off_and_on_earlier() {
    let mut problem = pulled(1e-2);
    let by_default = run(&problem, &mut weak_at_the_bottom()).0;
    problem.stages[0].control.stabilisation = None;
    let without = run(&problem, &mut weak_at_the_bottom()).0;
    assert!(matches!(without.outcome, Outcome::DidNotConverge { .. }) && (without.load - 0.6).abs() < 0.05);
    problem.stages[0].control.stabilisation = Some(Stabilisation { after: Some(1), ..Stabilisation::default() });
    let early = run(&problem, &mut weak_at_the_bottom()).0;
    assert!(matches!(early.outcome, Outcome::Completed) && early.statistics.cut_backs == 1);
    assert!(early.statistics.evaluations < by_default.statistics.evaluations);
}

/// A step that is long in itself is made shorter first: its stabilisation would take many increments.
#[test]
fn a_step_in_which_supports_move_far_is_cut_back_first() {
    let mut problem = pulled(3e-2);
    problem.stages[0].control.increments = 1;
    problem.stages[0].control.stabilisation = Some(Stabilisation { after: Some(1), ..Stabilisation::default() });
    let mut watch = Watch::default();
    let run = solve(&problem, &mut weak_at_the_bottom(), &mut watch);
    assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
    assert!(run.statistics.cut_backs >= 1, "{}", run.statistics.cut_backs);
    // 2 % of the width of the column are two thirds of the way.
    let shorter = |event: &Stabilised| event.load < 0.67 || run.statistics.cut_backs > 1;
    assert!(watch.stabilised.iter().all(shorter), "{:?}", watch.stabilised);
    // A step that is short enough is stabilised at once.
    let mut problem = pulled(1e-2);
    (problem.stages[0].control.increments, problem.stages[0].control.stabilisation) =
        (1, Some(Stabilisation { after: Some(1), ..Stabilisation::default() }));
    let mut watch = Watch::default();
    let run = solve(&problem, &mut weak_at_the_bottom(), &mut watch);
    assert_eq!((run.statistics.cut_backs, watch.stabilised.len()), (1, 1));
    assert_eq!(watch.stabilised[0].load, 1.0);
}
