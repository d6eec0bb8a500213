//! Steps that go on from committed iterates: a material whose stress depends on where in the step its path ended.

use super::stabilisation::{Watch, pulled, weak_at_the_bottom};
use super::*;
use crate::material::PointId;
use crate::material::damage::DamageMaterial;
use crate::observer::Outcome;
use crate::problem::Stabilisation;
use protocol::RveError;
use std::collections::BTreeMap;

/// Relative size of the jumps.
const ROUGHNESS: f64 = 3e-2;

/// Length of strain over which a jump lasts.
const GRAIN: f64 = 1e-6;

/// Largest increment that follows a branch without a jump.
const SMALL: f64 = 1e-4;

/// A material whose answers to large increments jump from branch to branch as those of cells that snap: the stress is off by up to
/// [`ROUGHNESS`], by a number that depends on the target and the row of elements. A small increment stays on the branch of the
/// committed state.
struct Rough {
    inner: DamageMaterial,
    /// Share by which the stress of a point is off, by point: committed, on trial, and at the mark.
    branches: [BTreeMap<usize, f64>; 3],
    commits: usize,
    /// Number of commits after which every trial is refused.
    most_commits: usize,
    /// Number of commits after which the first point jumps once, in the next small increment.
    jumps_after: Option<usize>,
}

impl Rough {
    fn new() -> Self {
        Self {
            inner: weak_at_the_bottom(),
            branches: Default::default(),
            commits: 0,
            most_commits: usize::MAX,
            jumps_after: None,
        }
    }

    /// Branch of a point after a trial.
    fn branch(&self, trial: &PointTrial) -> f64 {
        let strain = trial.target.get(1, 1);
        if strain.abs() < SMALL {
            if self.jumps_after == Some(self.commits) && trial.point == 0 {
                return 0.5;
            }
            return self.branches[0].get(&trial.point).copied().unwrap_or_default();
        }
        let (place, row) = ((strain / GRAIN).floor() as i64, trial.point as u64 / 4);
        let mixed = ((place as u64) ^ (row << 32)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        ROUGHNESS * ((mixed >> 11) as f64 / (1u64 << 52) as f64 - 1.0)
    }
}

impl PointMaterial for Rough {
    fn evaluate(&mut self, trials: &[PointTrial]) -> Result<Vec<TrialResult>, MaterialError> {
        if self.commits >= self.most_commits {
            let reason = RveError::TargetTooLarge { norm: 1.0, limit: 0.0 };
            return Err(MaterialError::Point { point: trials[0].point, reason });
        }
        let mut answers = self.inner.evaluate(trials)?;
        for (trial, answer) in trials.iter().zip(&mut answers) {
            let branch = self.branch(trial);
            answer.stress.0.iter_mut().for_each(|component| *component *= 1.0 + branch);
            self.branches[1].insert(trial.point, branch);
            self.jumps_after = self.jumps_after.filter(|_| branch != 0.5);
        }
        Ok(answers)
    }

    fn commit(&mut self) -> Result<(), MaterialError> {
        self.commits += 1;
        self.branches[0] = self.branches[1].clone();
        self.inner.commit()
    }

    fn rollback(&mut self) {
        self.branches[1] = self.branches[0].clone();
        self.inner.rollback();
    }

    fn mark(&mut self) {
        self.branches[2] = self.branches[0].clone();
        self.inner.mark();
    }

    fn return_to_mark(&mut self) {
        self.branches[0] = self.branches[2].clone();
        self.branches[1] = self.branches[2].clone();
        self.inner.return_to_mark();
    }

    fn copy_state(&mut self, from: PointId, to: PointId) {
        for branches in &mut self.branches[..2] {
            let branch = branches.get(&from).copied().unwrap_or_default();
            branches.insert(to, branch);
        }
        self.inner.copy_state(from, to);
    }
}

/// A column that is pulled to 0.8 of the strain at which its weak cell softens, in three steps.
fn problem(commit_iterates_after: Option<usize>) -> Problem {
    let mut problem = pulled(4.8e-3);
    let stage = &mut problem.stages[0];
    stage.control.increments = 3;
    stage.tolerances = Tolerances::both(1e-4, 1e-4);
    stage.control.stabilisation =
        Some(Stabilisation { after: Some(1), commit_iterates_after, ..Stabilisation::default() });
    problem
}

/// Without them the steps fail and are stabilised. With them none fails, each needs few increments more, and all is counted.
#[test]
fn a_rough_material_is_brought_to_balance_from_committed_iterates() {
    let (mut plain_material, mut plain) = (Rough::new(), Watch::default());
    let without = solve(&problem(None), &mut plain_material, &mut plain);
    assert!(matches!(without.outcome, Outcome::Completed), "{:?}", without.outcome);
    assert!(
        without.statistics.cut_backs > 0
            && without.statistics.failed_evaluations > 0
            && without.statistics.steps_with_committed_iterates == 0
    );

    let (mut material, mut watch) = (Rough::new(), Watch::default());
    let run = solve(&problem(Some(3)), &mut material, &mut watch);
    assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
    let statistics = &run.statistics;
    assert_eq!((statistics.cut_backs, statistics.stabilised_steps, watch.stabilised.len()), (0, 0, 0));
    assert!(statistics.evaluations < without.statistics.evaluations);
    let Watch { committed: events, recorder, .. } = watch;
    assert!(!events.is_empty() && events.len() as u64 == statistics.steps_with_committed_iterates);
    let increments: usize = events.iter().map(|event| event.increments).sum();
    assert_eq!(statistics.committed_iterates, increments as u64);
    let of_steps: usize = recorder.steps.iter().map(|step| step.committed_iterates).sum();
    assert_eq!(of_steps, increments);
    // Every step is in balance, and is committed once, with an iterate before each of its further increments.
    assert!(recorder.steps.iter().all(|step| step.force_ratio <= 1e-4), "{:?}", recorder.steps);
    assert_eq!(material.commits, statistics.steps as usize + increments);
    // Iterations of a step are counted through.
    let last = recorder.steps.iter().rfind(|step| step.committed_iterates > 0).unwrap();
    let of_last: Vec<usize> =
        recorder.iterations.iter().filter(|report| report.step == last.step).map(|report| report.iteration).collect();
    assert_eq!(of_last, (1..=last.iterations).collect::<Vec<_>>());
}

/// Where iterations contract nothing is committed before its time: the run is that without them, to the bit.
#[test]
fn a_smooth_material_is_left_alone() {
    let solved = |after| {
        let mut material = weak_at_the_bottom();
        let (run, recorder) = run(&problem(after), &mut material);
        assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
        assert_eq!(run.statistics.steps_with_committed_iterates, 0);
        recorder.displacements
    };
    assert_eq!(solved(Some(1)), solved(None));
}

/// Where nothing leads on from a committed iterate, the body and its cells are back in the last accepted state.
#[test]
fn an_iterate_that_leads_nowhere_is_taken_back() {
    let mut material = Rough { most_commits: 1, ..Rough::new() };
    let (run, recorder) = run(&problem(Some(3)), &mut material);
    let Outcome::DidNotConverge { .. } = &run.outcome else { panic!("{:?}", run.outcome) };
    assert_eq!((material.commits, run.load), (1, 0.0));
    assert!(run.statistics.stabilisations_taken_back > 0 && run.statistics.steps_with_committed_iterates == 0);
    assert_eq!(material.inner.largest_strain(0), 0.0, "the strain of the iterate is gone");
    assert!(recorder.displacements.iter().flatten().all(|value| *value == 0.0));
    assert_eq!(run.statistics.stabilisation_work, 0.0);
}

/// Such steps go on to the tolerances while they contract; they ended at the weaker ones of stagnated steps. If the next increment goes too far
/// then, the step ends at the state before it, with the stresses that the points have there.
#[test]
fn steps_go_on_to_the_tolerances_and_dropped_increments_leave_nothing_behind() {
    let mut problem = problem(Some(3));
    problem.stages[0].tolerances =
        Tolerances { stagnated_force: 1e-2, stagnated_displacement: 5e-2, ..Tolerances::both(1e-9, 1e-9) };
    let solved = |jumps_after| {
        let mut material = Rough { jumps_after, ..Rough::new() };
        let (run, recorder) = run(&problem, &mut material);
        assert!(matches!(run.outcome, Outcome::Completed), "{jumps_after:?}: {:?}", run.outcome);
        (material, run.statistics, recorder)
    };
    let (material, statistics, recorder) = solved(None);
    assert!(statistics.steps_with_committed_iterates > 0 && statistics.stagnated_steps == 0);
    assert!(recorder.steps.iter().all(|step| step.force_ratio <= 1e-9), "{:?}", recorder.steps);
    let mut stagnated = 0;
    for jump in 1..=material.commits {
        let (_, statistics, recorder) = solved(Some(jump));
        stagnated += statistics.stagnated_steps;
        // A column has one vertical stress, within the weaker tolerances; the jump is half of it.
        let stresses: Vec<f64> = recorder.points.iter().map(|point| point.stress.get(1, 1)).collect();
        let [low, high] = [f64::min, f64::max].map(|choose| stresses.iter().copied().reduce(choose).unwrap());
        assert!(high - low < 5e-2 * high, "after {jump} commits: {stresses:?}");
    }
    assert!(stagnated > 0, "some jumped after a state that was good enough");
}
