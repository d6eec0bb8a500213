//! Whether the stress of the packings is in equilibrium with the initial loads: one assembly without any grain.

use macro_solver::material::{MaterialError, PointId, PointMaterial, PointTrial};
use macro_solver::mesh::point_places;
use macro_solver::observer::Silent;
use macro_solver::problem::Procedure;
use macro_solver::solve::solve;
use protocol::{Cost, Observed, Scalars, TangentKind, Tensor2, Tensor4, TrialFlags, TrialResult};
use scene_reader::Scene;

/// Meshes with more points are not assembled for a check.
const MOST_POINTS: usize = 50_000;

/// Out-of-balance force of the stress at the start under the initial loads, over the loads or reactions, given the stress of the packing of
/// every Gauss point, Pa.
///
/// # Errors
/// Why there is nothing to compare: the first stage is a motion without a limit of it, or the mesh is too large to be assembled for a check.
pub(super) fn imbalance(scene: &Scene, of_packings: &[Tensor2]) -> Result<f64, String> {
    let mut problem = scene.problem.clone();
    let starts_with_motion =
        problem.stages.first().is_none_or(|stage| matches!(stage.procedure, Procedure::Dynamic(_)));
    if starts_with_motion && problem.initial.limits.largest_imbalance.is_none() {
        return Err("the first stage is a motion, which they may set off".to_owned());
    }
    if problem.point_count() > MOST_POINTS {
        return Err(format!("the mesh has more than {MOST_POINTS} Gauss points"));
    }
    let stresses = match (&problem.initial.expected, scene.preparation()) {
        (Some(expected), Some(_)) => {
            let at = |(point, place): (usize, &[f64; 3])| {
                let stress = expected.at(point, *place);
                Tensor2(std::array::from_fn(|entry| stress[(entry / 3, entry % 3)]))
            };
            point_places(&problem.mesh).iter().enumerate().map(at).collect()
        }
        _ => of_packings.to_vec(),
    };
    // With this limit any residual ends the run after its first evaluation.
    problem.initial.limits.largest_imbalance = Some(0.0);
    let mut material = AsGiven { stresses, evaluated: false };
    let run = solve(&problem, &mut material, &mut Silent);
    Ok(run.statistics.initial_imbalance)
}

/// A material with the given stress at every Gauss point, for a single evaluation.
struct AsGiven {
    stresses: Vec<Tensor2>,
    evaluated: bool,
}

impl PointMaterial for AsGiven {
    fn evaluate(&mut self, trials: &[PointTrial]) -> Result<Vec<TrialResult>, MaterialError> {
        if std::mem::replace(&mut self.evaluated, true) {
            return Err(MaterialError::Interrupted);
        }
        let result = |trial: &PointTrial| TrialResult {
            stress: self.stresses[trial.point],
            tangent: (trial.options.tangent != TangentKind::None).then(|| Box::new(Tensor4::ZERO)),
            scalars: Scalars::default(),
            observed: Observed::default(),
            cost: Cost::default(),
            flags: TrialFlags::default(),
        };
        Ok(trials.iter().map(result).collect())
    }

    fn commit(&mut self) -> Result<(), MaterialError> {
        Ok(())
    }

    fn rollback(&mut self) {}

    fn mark(&mut self) {}

    fn return_to_mark(&mut self) {}

    fn copy_state(&mut self, from: PointId, to: PointId) {
        self.stresses[to] = self.stresses[from];
    }
}
