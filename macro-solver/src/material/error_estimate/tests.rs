//! The estimate against a law whose error is known.

use super::*;
use protocol::{Cost, Observed, RveError, Scalars, TrialFlags};

/// Stress that tends to a limit, `d sigma = E (1 - sigma / limit) d strain`, by explicit steps: its error falls with the ramp step.
/// Pressure in all directions, so that nothing but the size of the error is under test.
struct Hardening {
    committed: Vec<f64>,
    marked: Vec<f64>,
    trial: Vec<Option<f64>>,
    /// Refuses trials of this point.
    refuses: Option<PointId>,
    /// Points without load-bearing contacts from this number of commits on.
    idle: Option<(Vec<PointId>, usize)>,
    commits: usize,
    evaluations: usize,
}

const MODULUS: f64 = 1e8;
const LIMIT: f64 = -2e5;
const START: f64 = -1e5;

impl Hardening {
    fn new(points: usize) -> Self {
        Self {
            committed: vec![START; points],
            marked: Vec::new(),
            trial: vec![None; points],
            refuses: None,
            idle: None,
            commits: 0,
            evaluations: 0,
        }
    }
}

/// The exact stress after a compression, Pa.
fn exact(strain: f64) -> f64 {
    LIMIT + (START - LIMIT) * (-MODULUS * strain.abs() / LIMIT.abs()).exp()
}

impl PointMaterial for Hardening {
    fn evaluate(&mut self, trials: &[PointTrial]) -> Result<Vec<TrialResult>, MaterialError> {
        let mut results = Vec::new();
        for trial in trials {
            if self.refuses == Some(trial.point) {
                return Err(MaterialError::Point { point: trial.point, reason: RveError::TargetNotFinite });
            }
            self.evaluations += 1;
            let steps = trial.options.ramp_steps;
            let mut stress = self.committed[trial.point];
            for _ in 0..steps {
                stress += MODULUS * (1.0 - stress / LIMIT) * trial.target.get(1, 1) / f64::from(steps);
            }
            let mut flags = TrialFlags::default();
            if self.idle.as_ref().is_some_and(|(points, from)| points.contains(&trial.point) && self.commits >= *from)
            {
                flags.insert(TrialFlags::NO_LOAD_BEARING_CONTACTS);
                stress = 0.0;
            }
            self.trial[trial.point] = Some(stress);
            results.push(TrialResult {
                stress: Tensor2::from_plane([[stress, 0.0], [0.0, stress]]),
                tangent: None,
                scalars: Scalars::default(),
                observed: Observed::default(),
                cost: Cost::default(),
                flags,
            });
        }
        Ok(results)
    }

    fn commit(&mut self) -> Result<(), MaterialError> {
        self.commits += 1;
        for (committed, trial) in self.committed.iter_mut().zip(&mut self.trial) {
            *committed = trial.take().unwrap_or(*committed);
        }
        Ok(())
    }

    fn rollback(&mut self) {
        self.trial.fill(None);
    }

    fn mark(&mut self) {
        self.marked.clone_from(&self.committed);
    }

    fn return_to_mark(&mut self) {
        self.committed.clone_from(&self.marked);
        self.rollback();
    }

    fn copy_state(&mut self, from: PointId, to: PointId) {
        (self.committed[to], self.trial[to]) = (self.committed[from], None);
    }
}

/// One replica that stays.
fn plan() -> SamplePlan {
    fixed(&[ReplicaPlan { point: 1, replica: 2 }])
}

fn fixed(plans: &[ReplicaPlan]) -> SamplePlan {
    let points = plans.iter().map(|plan| plan.point).collect();
    SamplePlan { fixed: plans.to_vec(), roaming: Vec::new(), points }
}

fn compression(point: PointId, strain: f64, ramp_steps: u32) -> PointTrial {
    let options = TrialOptions {
        tangent: TangentKind::TrussLike,
        observables: Observables::NONE,
        ramp_steps,
        ..TrialOptions::default()
    };
    PointTrial { point, target: Tensor2::from_plane([[0.0, 0.0], [0.0, -strain]]), options }
}

/// Steps of small strain; the sum of their logarithms is the strain that the replica sees in merged increments.
fn loaded(estimator: &mut ErrorEstimator<'_>, steps: usize, strain: f64, ramp_steps: u32) -> f64 {
    let mut stress = 0.0;
    for _ in 0..steps {
        // The first trial is an iterate that is not accepted.
        let trials = [compression(1, 3.0 * strain, ramp_steps), compression(1, strain, ramp_steps)];
        for trial in trials {
            stress = estimator.evaluate(&[compression(0, strain, ramp_steps), trial]).unwrap()[1].stress.get(1, 1);
        }
        estimator.commit().unwrap();
    }
    stress
}

/// A cell and its replica that both carry nothing agree. The error of a body whose only followed point was such a one was said to be 0.
#[test]
fn points_that_bear_no_load_say_nothing_about_the_others() {
    let follow = |idle: &[PointId], steps: usize| {
        let mut material = Hardening::new(4);
        material.idle = Some((idle.to_vec(), 5));
        let plans = [ReplicaPlan { point: 0, replica: 2 }, ReplicaPlan { point: 1, replica: 3 }];
        let mut estimator = ErrorEstimator::new(&mut material, 2, &fixed(&plans));
        loaded(&mut estimator, steps, 2e-4, 5);
        estimator.error_estimate()
    };
    let (both, one) = (follow(&[], 10).unwrap(), follow(&[1, 3], 10).unwrap());
    assert_eq!((both.points, one.points), (2, 1));
    assert!((one.rms / both.rms - 1.0).abs() < 1e-12, "{one:?} {both:?}");
    assert!(follow(&[0, 1, 2, 3], 5).is_some());
    assert_eq!(follow(&[0, 1, 2, 3], 10), None, "nobody knows");
}

#[test]
fn the_estimate_is_within_a_factor_of_two_of_the_true_error() {
    for ramp_steps in [2, 5, 20] {
        let mut material = Hardening::new(3);
        let mut estimator = ErrorEstimator::new(&mut material, 2, &plan());
        let stress = loaded(&mut estimator, 10, 2e-4, ramp_steps);
        let pressure = stress.abs();
        let truth = 2f64.sqrt() * (stress - exact(2e-3)).abs() / pressure;
        let estimate = estimator.error_estimate().unwrap();
        assert_eq!(estimate.points, 1);
        assert!((estimate.rms - estimate.largest).abs() < 1e-15 && (estimate.rms - estimate.of_mean).abs() < 1e-15);
        let ratio = estimate.rms / truth;
        assert!((0.5..2.0).contains(&ratio), "{ramp_steps} ramp steps: {} for {truth}", estimate.rms);
        assert_eq!(estimator.figures().evaluations, 10);
    }
}

#[test]
fn points_answer_and_are_committed_as_without_replicas() {
    let (mut with, mut without) = (Hardening::new(3), Hardening::new(2));
    let mut estimator = ErrorEstimator::new(&mut with, 2, &plan());
    for strain in [1e-4, 3e-4, 2e-4] {
        let trials = [compression(0, strain, 4), compression(1, 0.5 * strain, 4)];
        assert_eq!(estimator.evaluate(&trials).unwrap(), without.evaluate(&trials).unwrap());
        estimator.commit().unwrap();
        without.commit().unwrap();
    }
    // A rejected step reaches no replica.
    estimator.evaluate(&[compression(1, 1e-3, 4)]).unwrap();
    estimator.rollback();
    estimator.commit().unwrap();
    assert_eq!(estimator.figures().evaluations, 3);
    assert_eq!(with.committed[..2], without.committed[..]);
}

/// What a step that is taken back has committed reaches neither points nor replicas; what it has cost stays counted.
#[test]
fn points_and_replicas_return_to_the_mark() {
    let (mut returned, mut straight) = (Hardening::new(3), Hardening::new(3));
    let estimates = [(&mut returned, 2), (&mut straight, 0)].map(|(material, in_vain)| {
        let mut estimator = ErrorEstimator::new(material, 2, &plan());
        loaded(&mut estimator, 3, 1e-5, 1);
        estimator.mark();
        loaded(&mut estimator, in_vain, 1e-4, 4);
        estimator.return_to_mark();
        loaded(&mut estimator, 3, 1e-4, 4);
        (estimator.error_estimate(), estimator.figures().evaluations)
    });
    assert_eq!(estimates[0].0, estimates[1].0);
    assert_eq!(estimates[0].1, estimates[1].1 + 2);
    assert_eq!(returned.committed, straight.committed);
}

#[test]
fn increments_of_one_ramp_step_are_followed_in_groups() {
    let mut material = Hardening::new(3);
    let mut estimator = ErrorEstimator::new(&mut material, 2, &plan());
    let stress = loaded(&mut estimator, 15, 1e-5, 1);
    assert_eq!(estimator.figures().evaluations, 1, "eight of them are one trial");
    loaded(&mut estimator, 1, 1e-5, 1);
    assert_eq!(estimator.figures().evaluations, 2);
    let truth = 2f64.sqrt() * (stress - exact(1.6e-4)).abs() / stress.abs();
    let estimate = estimator.error_estimate().unwrap();
    assert!(estimate.rms < 10.0 * truth && estimate.rms > 0.0, "{} for {truth}", estimate.rms);
}

#[test]
fn a_refused_replica_is_given_up_and_counted() {
    let mut material = Hardening::new(4);
    material.refuses = Some(3);
    let plans = [ReplicaPlan { point: 0, replica: 2 }, ReplicaPlan { point: 1, replica: 3 }];
    let mut estimator = ErrorEstimator::new(&mut material, 2, &fixed(&plans));
    loaded(&mut estimator, 3, 1e-4, 4);
    let figures = estimator.figures();
    assert_eq!((figures.lost, figures.evaluations), (1, 3));
    assert_eq!(estimator.error_estimate().unwrap().points, 1);
}

#[test]
fn an_estimator_goes_on_from_what_it_saved() {
    let (mut whole, mut first) = (Hardening::new(3), Hardening::new(3));
    let mut estimator = ErrorEstimator::new(&mut first, 2, &plan());
    loaded(&mut estimator, 3, 1e-5, 1);
    let mut archive = Archive::default();
    estimator.save(&mut archive);
    let mut second = Hardening { committed: first.committed.clone(), ..Hardening::new(3) };
    let mut resumed = ErrorEstimator::new(&mut second, 2, &plan());
    resumed.restore(&archive).unwrap();
    loaded(&mut resumed, 7, 1e-5, 1);
    let mut estimator = ErrorEstimator::new(&mut whole, 2, &plan());
    loaded(&mut estimator, 10, 1e-5, 1);
    assert_eq!(resumed.error_estimate(), estimator.error_estimate());
    assert_eq!(resumed.figures(), estimator.figures());
    assert!(ErrorEstimator::new(&mut whole, 2, &SamplePlan::default()).restore(&archive).is_err());
}

/// Eight points, of which point 0 has a replica that stays; another replica roams over the rest.
fn roaming() -> SamplePlan {
    SamplePlan { fixed: vec![ReplicaPlan { point: 0, replica: 8 }], roaming: vec![9], points: (0..8).collect() }
}

/// A step in which one point strains more than the others.
fn localised(estimator: &mut ErrorEstimator<'_>, at: PointId, most: f64) {
    let strain = |point| if point == at { most } else { 1e-4 };
    let trials: Vec<PointTrial> = (0..8).map(|point| compression(point, strain(point), 4)).collect();
    estimator.evaluate(&trials).unwrap();
    estimator.commit().unwrap();
}

/// The point that the roaming replica follows.
fn followed(estimator: &ErrorEstimator<'_>) -> Option<PointId> {
    estimator.replicas[1].state.point
}

#[test]
fn a_roaming_replica_follows_the_point_that_strains_most_and_finds_its_error() {
    let (mut material, mut spread_alone) = (Hardening::new(10), Hardening::new(10));
    let mut estimator = ErrorEstimator::new(&mut material, 2, &roaming());
    let mut alone = ErrorEstimator::new(&mut spread_alone, 2, &SamplePlan { roaming: Vec::new(), ..roaming() });
    localised(&mut estimator, 5, 1e-3);
    assert_eq!((followed(&estimator), estimator.error_estimate().unwrap().points), (Some(5), 1));
    let before = estimator.error_estimate().unwrap().rms;
    localised(&mut estimator, 5, 1e-3);
    let estimate = estimator.error_estimate().unwrap();
    // The true error of point 5 since it has been followed, and what the sample took it to be before.
    let (start, end) = (in_steps(1), in_steps(2));
    let truth = 2f64.sqrt() * (end - exact_from(start, 1e-3)).abs() / end.abs();
    let of_point = estimate.largest;
    assert_eq!(estimate.points, 2);
    assert!((0.5..2.0).contains(&(of_point / truth.hypot(before))), "{of_point} for {truth} and {before}");
    for _ in 0..2 {
        localised(&mut alone, 5, 1e-3);
    }
    let spread = alone.error_estimate().unwrap();
    assert!(of_point > 3.0 * spread.largest, "the spread replica does not see it: {of_point}, {}", spread.largest);
    // The spread replica stands for seven of eight points.
    let expected = ((7.0 * spread.rms.powi(2) + of_point.powi(2)) / 8.0).sqrt();
    assert!((estimate.rms / expected - 1.0).abs() < 1e-12, "{} for {expected}", estimate.rms);
    // Another point strains more: the replica goes there when that has strained more in all.
    localised(&mut estimator, 3, 1.7e-3);
    assert_eq!(followed(&estimator), Some(5));
    localised(&mut estimator, 3, 1.7e-3);
    assert_eq!(followed(&estimator), Some(3));
}

/// Stress of a point after `steps` steps of 1e-3 in four ramp steps each, Pa.
fn in_steps(steps: usize) -> f64 {
    (0..4 * steps).fold(START, |stress, _| stress - MODULUS * (1.0 - stress / LIMIT) * 2.5e-4)
}

fn exact_from(stress: f64, strain: f64) -> f64 {
    LIMIT + (stress - LIMIT) * (-MODULUS * strain / LIMIT.abs()).exp()
}

/// What a step that is taken back has moved returns, and a resumed run goes on with the replicas where they were.
#[test]
fn roaming_replicas_return_to_the_mark_and_go_on_from_what_was_saved() {
    let (mut straight, mut returned, mut first) = (Hardening::new(10), Hardening::new(10), Hardening::new(10));
    let mut expected = ErrorEstimator::new(&mut straight, 2, &roaming());
    for at in [5, 5, 6] {
        localised(&mut expected, at, 1e-3);
    }
    let mut estimator = ErrorEstimator::new(&mut returned, 2, &roaming());
    localised(&mut estimator, 5, 1e-3);
    estimator.mark();
    localised(&mut estimator, 2, 4e-3);
    assert_eq!(followed(&estimator), Some(2));
    estimator.return_to_mark();
    localised(&mut estimator, 5, 1e-3);
    localised(&mut estimator, 6, 1e-3);
    assert_eq!(followed(&estimator), followed(&expected));
    assert_eq!(estimator.error_estimate(), expected.error_estimate());

    let mut estimator = ErrorEstimator::new(&mut first, 2, &roaming());
    localised(&mut estimator, 5, 1e-3);
    // Strain that does not lead to a review yet is part of what is saved.
    localised(&mut estimator, 5, 4e-4);
    let mut archive = Archive::default();
    estimator.save(&mut archive);
    localised(&mut estimator, 6, 4.5e-4);
    let (state, estimate) = (followed(&estimator), estimator.error_estimate());
    let committed_before = {
        let mut again = Hardening::new(10);
        let mut estimator = ErrorEstimator::new(&mut again, 2, &roaming());
        localised(&mut estimator, 5, 1e-3);
        localised(&mut estimator, 5, 4e-4);
        again.committed
    };
    let mut second = Hardening { committed: committed_before, ..Hardening::new(10) };
    let mut resumed = ErrorEstimator::new(&mut second, 2, &roaming());
    resumed.restore(&archive).unwrap();
    localised(&mut resumed, 6, 4.5e-4);
    assert_eq!((followed(&resumed), resumed.error_estimate()), (state, estimate));
    let mut other = Hardening::new(10);
    assert!(ErrorEstimator::new(&mut other, 2, &fixed(&roaming().fixed)).restore(&archive).is_err());
}

/// What was known of a point when its replica left it stays, and errors are relative to the largest stress that a point has had.
#[test]
fn errors_that_have_been_made_stay_when_the_replica_moves() {
    let mut material = Hardening::new(10);
    let mut estimator = ErrorEstimator::new(&mut material, 2, &roaming());
    for _ in 0..3 {
        localised(&mut estimator, 5, 1e-3);
    }
    for _ in 0..4 {
        localised(&mut estimator, 2, 2e-3);
    }
    assert_eq!(followed(&estimator), Some(2));
    let (known, estimate) = (estimator.strains.left(5), estimator.error_estimate().unwrap());
    assert!(known > 0.0);
    assert!(estimate.rms >= known / 8f64.sqrt() * (1.0 - 1e-12), "{} for {known}", estimate.rms);
    assert!(estimator.replicas[1].state.pressure >= -in_steps(1));
    // It comes back with what it knew.
    for _ in 0..8 {
        localised(&mut estimator, 5, 2e-3);
    }
    assert_eq!(followed(&estimator), Some(5));
    assert!(estimator.replicas[1].state.before >= known);
}

/// A roaming replica whose trial is refused does not try the same point again.
#[test]
fn a_roaming_replica_that_is_refused_goes_elsewhere() {
    let mut material = Hardening::new(10);
    material.refuses = Some(9);
    let mut estimator = ErrorEstimator::new(&mut material, 2, &roaming());
    for _ in 0..6 {
        localised(&mut estimator, 5, 1e-3);
    }
    assert_eq!((estimator.figures().lost, followed(&estimator)), (1, None));
    for _ in 0..7 {
        localised(&mut estimator, 6, 2e-3);
    }
    assert_eq!((estimator.figures().lost, followed(&estimator)), (2, None));
}
