//! How accurately the cells of a scene are solved: what its keys say, or an error that the run keeps to.

use super::document::Document;
use super::input_error::InputError;
use super::tables::{ProcedureKeyword, SceneFile};
use macro_solver::material::error_estimate::ErrorEstimateSettings;
use macro_solver::problem::ErrorControl;
use rve_server::definition::{Accuracy, Criterion, RveOptions, SolverName};

/// Error of the stress over the pressure that a scene keeps to which names no accuracy; the reasons are in
/// docs/lab-book/error-estimate.md.
const DEFAULT_ERROR: f64 = 5e-3;

/// Tolerance of the cells in scenes with dynamic stages, in place of the 1e-3 of the accuracy `default`: what cells may keep out of balance damps
/// waves whose stresses are small next to the pressure (docs/lab-book/error-estimate.md).
const MOTION_TOLERANCE: f64 = 1e-5;

/// Keys of `[rve]` that name an accuracy.
const KEYS: [&str; 4] = ["accuracy", "error", "strain_per_step", "tolerance"];

/// Chooses the accuracy where the scene leaves it open, and whether it did so. An error is kept to in implicit stages only: explicit ones
/// cut their time steps, and with them the strain increments, for stability.
///
/// # Errors
/// Those of [`error_estimate`].
pub(super) fn choose(document: &Document, file: &mut SceneFile) -> Result<bool, InputError> {
    let is_estimated = error_estimate(document, file)?.enabled;
    let is_named = KEYS.iter().any(|key| document.is_written(&["rve", key]));
    let own = file.stage.iter().filter_map(|stage| stage.get_ref().procedure);
    let procedures: Vec<ProcedureKeyword> = own.chain([file.procedure]).collect();
    let is_implicit = procedures.iter().all(|procedure| *procedure == ProcedureKeyword::Implicit);
    let is_open = is_estimated && !is_named && is_implicit && file.rve.solver == SolverName::Relaxation;
    if is_open {
        file.rve.error = Some(DEFAULT_ERROR);
    }
    let is_dynamic = procedures.contains(&ProcedureKeyword::Dynamic);
    if is_dynamic && has_default_tolerance(document, &file.rve) {
        // That of the energy criterion is quadratic in the forces.
        let is_energy = file.rve.criterion == Criterion::Energy;
        file.rve.tolerance = Some(if is_energy { MOTION_TOLERANCE * MOTION_TOLERANCE } else { MOTION_TOLERANCE });
    }
    Ok(is_open)
}

/// Whether the tolerance of the cells is that of the accuracy `default`.
fn has_default_tolerance(document: &Document, options: &RveOptions) -> bool {
    let is_default = options.error.is_none() && options.accuracy == Accuracy::Default;
    is_default
        && options.solver == SolverName::Relaxation
        && options.frame.is_none()
        && !document.is_written(&["rve", "tolerance"])
}

/// The error of the stresses that the tolerances of implicit stages follow: the one that the run keeps to, or the default one in drafts,
/// whose cells are solved as at the start of a run that keeps to it. Steps that balance more closely than their cells do stagnate.
pub(super) fn error_of_stresses(document: &Document, file: &SceneFile) -> Option<f64> {
    let is_draft = file.rve.accuracy == Accuracy::Draft
        && !["strain_per_step", "tolerance"].iter().any(|key| document.is_written(&["rve", key]));
    file.rve.error.or(is_draft.then_some(DEFAULT_ERROR))
}

/// The table `[error_estimate]`.
///
/// # Errors
/// A share that is none; an estimate that is switched off although `rve.error` needs it.
pub(super) fn error_estimate(document: &Document, file: &SceneFile) -> Result<ErrorEstimateSettings, InputError> {
    let given = file.error_estimate.over(&ErrorEstimateSettings::default());
    let settings = given.map_err(|fault| document.fault(&fault))?;
    if !settings.enabled && file.rve.error.is_some() {
        return Err(document
            .error_at_key(&["error_estimate", "enabled"], "rve.error needs the estimate of the error")
            .hint("remove one of the two keys"));
    }
    Ok(settings)
}

/// What the key `rve.error` asks of the strain per ramp step.
pub(super) fn error_control(options: &RveOptions) -> Option<ErrorControl> {
    let [smallest, largest] = options.strain_per_step_bounds();
    options.error.map(|error| ErrorControl { error, smallest, largest })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scene;
    use std::path::Path;

    /// A scene that names no accuracy.
    fn main_scene(more: &[&str]) -> Scene {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/biaxial.toml");
        Scene::load(&path, &more.iter().map(|&given| given.to_owned()).collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn a_scene_without_an_accuracy_keeps_to_an_error() {
        let scene = main_scene(&[]);
        assert!(scene.keeps_default_error);
        assert_eq!(scene.problem.error_control.map(|control| control.error), Some(DEFAULT_ERROR));
        for more in
            ["rve.accuracy=default", "rve.strain_per_step=1e-6", "rve.tolerance=1e-3", "error_estimate.enabled=false"]
        {
            let scene = main_scene(&[more]);
            assert!(!scene.keeps_default_error && scene.problem.error_control.is_none(), "{more}");
        }
        let named = main_scene(&["rve.error=2e-3"]);
        assert!(!named.keeps_default_error && named.problem.error_control.is_some());
    }

    fn tolerances(scene: &Scene) -> Vec<[f64; 2]> {
        scene.problem.stages.iter().map(|stage| [stage.tolerances.force, stage.tolerances.displacement]).collect()
    }

    /// A scene that names neither an accuracy nor tolerances.
    fn brick(more: &[&str]) -> Scene {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/single-hexahedron-shear.toml");
        Scene::load(&path, &more.iter().map(|&given| given.to_owned()).collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn tolerances_follow_the_error_where_they_are_not_written() {
        let of = |more: &[&str]| tolerances(&brick(more));
        assert_eq!(of(&[]), [[1e-2, 5e-2]]);
        assert_eq!(of(&["rve.error=2e-3"]), [[4e-3, 2e-2]]);
        assert_eq!(of(&["rve.error=5e-2"]), [[1e-2, 5e-2]], "not weaker than where steps stagnate");
        assert_eq!(of(&["rve.error=2e-3", "solver.force_tolerance=7e-4"]), [[7e-4, 2e-2]]);
        let criteria = "solver.criteria=[\"force_over_reactions\"]";
        assert_eq!(of(&["rve.error=2e-3", criteria]), [[1e-3, 1e-2]], "other measures");
        let stages = "stage=[{ name = 'a', solver = { criteria = ['force'] } }, { name = 'b' }]";
        assert_eq!(of(&["rve.error=2e-3", stages]), [[1e-3, 1e-2], [4e-3, 2e-2]], "other measures in one stage");
        assert_eq!(of(&["rve.accuracy=default"]), [[1e-3, 1e-2]]);
        assert_eq!(of(&["rve.accuracy=draft"]), [[1e-2, 5e-2]]);
        assert_eq!(of(&["rve.accuracy=draft", "rve.tolerance=1e-4"]), [[1e-3, 1e-2]]);
        assert_eq!(of(&["rve.accuracy=draft", "solver.displacement_tolerance=3e-3"]), [[1e-2, 3e-3]]);
        let relaxed = ["rve.accuracy=draft", "procedure=\"relaxation\""];
        assert_eq!(of(&relaxed)[0][0], 1e-2, "cells of drafts are no closer to equilibrium");
        let mut given_up = brick(&[]);
        given_up.give_up_default_error();
        assert_eq!(tolerances(&given_up), [[1e-3, 1e-2]]);
    }

    #[test]
    fn without_an_estimate_the_accuracy_is_the_default_one() {
        let mut open = main_scene(&[]);
        let named = main_scene(&["rve.accuracy=default"]);
        open.give_up_default_error();
        assert_eq!(open.definition().to_protocol(), named.definition().to_protocol());
        assert_eq!(open.problem.strain_per_step, named.problem.strain_per_step);
        assert_eq!(open.problem.error_control, None);
        let mut named = main_scene(&["rve.error=2e-3"]);
        named.give_up_default_error();
        assert!(named.problem.error_control.is_some(), "what a scene names itself stays");
    }
}
