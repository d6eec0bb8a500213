//! Sub-steps of single points: where a point refuses its trial and the step cannot be made smaller for all, as in explicit
//! dynamics.

use super::Points;
use super::evaluation::count_refused;
use crate::formulation::tensor::{matrix, tensor};
use crate::material::{MaterialError, PointMaterial, PointTrial};
use crate::observer::Statistics;
use nalgebra::Matrix3;
use protocol::{TangentKind, TrialOptions, TrialResult};

/// Times that the first part of a refused trial is halved.
const MOST_HALVINGS: usize = 4;

/// Parts that all points together may need in one evaluation.
const MOST_PARTS: usize = 64;

impl Points {
    /// Evaluates trials. A point that refuses its trial takes a part of it and commits that before the rest, which replaces its
    /// trial; the other points wait. Between the parts no forces are assembled.
    ///
    /// # Errors
    /// As the material's, where smaller parts do not help either. The parts that were gone stay committed.
    pub(crate) fn answers_in_parts(
        &mut self,
        trials: &mut [PointTrial],
        material: &mut dyn PointMaterial,
        statistics: &mut Statistics,
    ) -> Result<Vec<TrialResult>, MaterialError> {
        for _ in 0..MOST_PARTS {
            let error = match material.evaluate(trials) {
                Ok(answers) => return Ok(answers),
                Err(error) => error,
            };
            let refused = match &error {
                MaterialError::Point { point, .. } if error.is_curable_by_smaller_step() => *point,
                _ => return Err(error),
            };
            material.rollback();
            let Some(trial) = trials.iter_mut().find(|trial| trial.point == refused) else { return Err(error) };
            if !self.goes_part_of_the_way(trial, material, statistics)? {
                return Err(error);
            }
            // An error that goes on is counted where it arrives.
            count_refused(&error, statistics);
        }
        material.evaluate(trials)
    }

    /// Commits as large a part of a trial as the point accepts and leaves the rest in it; false if it accepts none.
    fn goes_part_of_the_way(
        &mut self,
        trial: &mut PointTrial,
        material: &mut dyn PointMaterial,
        statistics: &mut Statistics,
    ) -> Result<bool, MaterialError> {
        let whole = matrix(&trial.target);
        let mut share = 0.5;
        for _ in 0..MOST_HALVINGS {
            let first = whole * share;
            let options = TrialOptions { tangent: TangentKind::None, ..trial.options };
            match material.evaluate(&[PointTrial { target: tensor(&first), options, ..*trial }]) {
                Ok(answers) => {
                    answers.iter().for_each(|answer| self.count(trial.point, answer, statistics));
                    let Some(back) = (Matrix3::identity() + first).try_inverse() else { return Ok(false) };
                    material.commit()?;
                    statistics.sub_steps += 1;
                    trial.target = tensor(&((Matrix3::identity() + whole) * back - Matrix3::identity()));
                    return Ok(true);
                }
                Err(error) if error.is_curable_by_smaller_step() => {
                    count_refused(&error, statistics);
                    material.rollback();
                    share *= 0.5;
                }
                Err(error) => return Err(error),
            }
        }
        Ok(false)
    }
}
