//! A point that refuses its trial in an explicit step goes there in parts.

use super::*;
use crate::checkpoint::{Archive, CheckpointError};
use crate::material::{MaterialError, PointMaterial, PointTrial};
use protocol::{RveError, TrialResult};

/// Refuses targets beyond a limit.
struct Timid {
    inner: DamageMaterial,
    limit: f64,
    refused: u64,
}

impl PointMaterial for Timid {
    fn evaluate(&mut self, trials: &[PointTrial]) -> Result<Vec<TrialResult>, MaterialError> {
        let size = |trial: &PointTrial| trial.target.0.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
        match trials.iter().find(|trial| size(trial) > self.limit) {
            None => self.inner.evaluate(trials),
            Some(trial) => {
                self.refused += 1;
                let reason = RveError::TargetTooLarge { norm: size(trial), limit: self.limit };
                Err(MaterialError::Point { point: trial.point, reason })
            }
        }
    }

    fn commit(&mut self) -> Result<(), MaterialError> {
        self.inner.commit()
    }

    fn rollback(&mut self) {
        self.inner.rollback();
    }

    fn mark(&mut self) {
        self.inner.mark();
    }

    fn return_to_mark(&mut self) {
        self.inner.return_to_mark();
    }

    fn save(&self, archive: &mut Archive) {
        self.inner.save(archive);
    }

    fn restore(&mut self, archive: &Archive) -> Result<(), CheckpointError> {
        self.inner.restore(archive)
    }
}

/// A strip whose left end is pushed: the elements next to it are strained by up to 1e-4 in a step.
fn pushed() -> Problem {
    let push = moved("left", Axis::X, 0.002, Amplitude::RAMP);
    let mut problem =
        problem(strip(ElementKind::Q4Single, 6, 1.0), vec![push, held("bottom", Axis::Y)], 12.0, settings(2.0));
    problem.formulation = Formulation::Corotational;
    problem
}

#[test]
fn a_refused_trial_is_gone_in_parts_and_counted() {
    let problem = pushed();
    let solved = |limit: f64| {
        let mut material = Timid { inner: elastic(&problem, 1.0, 1.0), limit, refused: 0 };
        let mut film = Film::default();
        let run = solve(&problem, &mut material, &mut film);
        (run, film, material.refused)
    };
    let (whole, film, refused) = solved(f64::INFINITY);
    assert!(matches!(whole.outcome, Outcome::Completed) && refused == 0 && whole.statistics.sub_steps == 0);
    let largest = film
        .instants
        .iter()
        .flat_map(|instant| &instant.points)
        .fold(0.0f64, |most, point| point.step_gradient.0.iter().fold(most, |most, value| most.max(value.abs())));
    for share in [0.6, 0.2] {
        let (run, in_parts, refused) = solved(share * largest);
        assert!(matches!(run.outcome, Outcome::Completed), "{share}: {:?}", run.outcome);
        let parts = run.statistics.sub_steps;
        assert!(parts > 0 && refused >= parts, "{parts} parts after {refused} refusals");
        assert_eq!(run.statistics.evaluations, whole.statistics.evaluations + parts, "each part is an evaluation");
        let size = film.last().displacements.iter().flatten().fold(0.0f64, |most, value| most.max(value.abs()));
        for (one, other) in
            film.last().displacements.iter().flatten().zip(in_parts.last().displacements.iter().flatten())
        {
            assert!((one - other).abs() < 1e-4 * size, "{one} {other}");
        }
    }
    // Parts of a sixteenth do not help: the run ends and says which point it was.
    let (run, _, _) = solved(0.01 * largest);
    let Outcome::Unstable { reason, .. } = &run.outcome else { panic!("{:?}", run.outcome) };
    assert!(reason.contains("Gauss point") && reason.contains("limit"), "{reason}");
}
