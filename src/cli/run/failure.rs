//! Why a run did not reach its end: message, exit code, remedy, and the failure case of a trial that ends workers.

use super::folder::OutputFolder;
use crate::cli::start_state::{self, LoadComparison, PackingState};
use crate::exit::{Exit, Failure};
use macro_solver::checkpoint::FailureCase;
use macro_solver::observer::{Outcome, Run};
use macro_solver::problem::{Applied, Condition, Moment, Stage};
use rve_server::engine::ENGINE_NAME;
use scene_reader::Scene;

/// Why a run did not reach its end, with the remedy; `None` for one that did. `failure_case` is the hint from
/// [`write_failure_case`], `engines` are those outside this program.
pub(super) fn failure(scene: &Scene, run: &Run, failure_case: Option<&str>, engines: &[&str]) -> Option<Failure> {
    let engines = if engines.is_empty() {
        String::new()
    } else {
        format!(
            "\nhint: these cells are solved by {}: a run with `--engine grains` tells whether the engine is the cause",
            engines.join(", ")
        )
    };
    let stage = match &scene.problem.stages[..] {
        [_] => String::new(),
        stages => stages.get(run.stage).map_or(String::new(), |stage| format!(" of stage '{}'", stage.name)),
    };
    Some(match &run.outcome {
        Outcome::Completed => return None,
        Outcome::DidNotConverge { reason } => {
            let text = match no_start(scene, run) {
                Some(explained) => {
                    format!("the run found no equilibrium at the start{stage}: {reason}\n{explained}")
                }
                None if run.has_no_start() && is_nearly_balanced(scene, run) => format!(
                    "the run found no equilibrium at the start{stage}: {reason}\nhint: the body is given in balance to {:.1e} of the loads, \
                     which is little, but not to solver.force_tolerance: cells are brought to rest no closer than their own tolerance; take a \
                     larger solver.force_tolerance, or another solver.strategy",
                    run.statistics.initial_imbalance
                ),
                None if run.has_no_start() => format!(
                    "the run found no equilibrium at the start{stage}: {reason}\nhint: the loads that act from the start are more than the \
                     body bears as it is given, or its supports do not hold it; {}{}",
                    friction_at_once(scene),
                    start_state::remedy(scene)
                ),
                None if stands_still(scene, run) => format!(
                    "the run did not converge beyond load {:.4}{stage}: {reason}\nhint: nothing changes along this stage: what it removes or \
                     adds acts from its first step on, and the body finds no equilibrium with it. Do it in several stages, or put its force in \
                     the place of a support and let that fall along the stage (docs/guide/scenes.md, Excavation)",
                    run.load
                ),
                None => format!(
                    "the run did not converge beyond load {:.4}{stage}: {reason}\nhint: use more loading.increments, {}, or look at \
                     the last fields{}",
                    run.load,
                    smaller_steps(scene, run),
                    if finds_load_factor(scene, run) {
                        ""
                    } else {
                        "; if a force exceeds the capacity, prescribe a displacement instead"
                    }
                ),
            };
            Failure::new(Exit::NotConverged, text + &engines)
        }
        Outcome::Unstable { step, time, time_step, reason } => Failure::new(
            Exit::NotConverged,
            format!(
                "the motion is unstable{stage}: at time step {step} (t = {time:.6e} s) {reason}\nhint: the step of {time_step:.3e} s is too \
                 large; leave dynamics.time_step out or lower dynamics.safety, and if the material stiffens set \
                 dynamics.tangent_every. If the motion does not grow, slower histories or damping resolve it, or \
                 dynamics.longest_excess = 0 disables this check{}",
                motion_of_packing(scene)
            ),
        ),
        Outcome::Interrupted => Failure::new(
            Exit::Interrupted,
            format!(
                "interrupted at load {:.4}{stage}; everything up to the last accepted step is written{}",
                run.load,
                if scene.checkpoint.enabled { "; --resume continues the run" } else { "" }
            ),
        ),
        Outcome::WorkersLost { reason } => {
            Failure::new(Exit::WorkersLost, format!("{reason}{}", failure_case.unwrap_or_default()))
        }
        Outcome::Stopped(request) => Failure::new(Exit::BadInput, request),
        Outcome::Refused(error) => Failure::new(Exit::BadInput, error),
        Outcome::DefinitionRefused { reason } => Failure::new(
            Exit::BadInput,
            format!(
                "{reason}\nhint: change what the engine does not take, or name another one by `--engine`; docs/guide/external-engines.md says what \
                 each of them solves"
            ),
        ),
        Outcome::CheckpointRefused(error) => Failure::new(Exit::BadInput, error),
    })
}

/// Whether the stress that a body is given balances its loads better than any scene needs it to.
fn is_nearly_balanced(scene: &Scene, run: &Run) -> bool {
    let asked = scene.problem.stages.first().map_or(0.0, |stage| stage.tolerances.force);
    run.statistics.initial_imbalance < 1e-5 && asked < 1e-5
}

/// Whether nothing changes along the stage in which a run has ended.
fn stands_still(scene: &Scene, run: &Run) -> bool {
    scene.problem.stages.get(run.stage).is_some_and(Stage::changes_nothing)
}

/// Whether the load factor is an unknown in the stage in which a run has ended: such stages are never stabilised.
fn finds_load_factor(scene: &Scene, run: &Run) -> bool {
    scene.problem.stages.get(run.stage).is_some_and(Stage::finds_load_factor)
}

/// How steps become smaller than they were.
fn smaller_steps(scene: &Scene, run: &Run) -> &'static str {
    if finds_load_factor(scene, run) {
        return "a smaller loading.smallest_increment";
    }
    let stabilisation = scene.problem.stages.get(run.stage).and_then(|stage| stage.control.stabilisation);
    if stabilisation.is_some_and(|settings| settings.after.is_some_and(|after| after > 0)) {
        "loading.stabilise_after = 0 (failed steps are cut back first)"
    } else {
        "a smaller loading.smallest_increment"
    }
}

/// Explanation of a failure in step 0, before any load was changed: more increments cannot help there. `None` for a later failure,
/// and if packing, loads and contact law match.
fn no_start(scene: &Scene, run: &Run) -> Option<String> {
    if !run.has_no_start() {
        return None;
    }
    // A run has made cells of them.
    let packings = PackingState::of_all(scene).ok()?;
    let differs = || match start_state::compare_loads(scene, &packings) {
        LoadComparison::Differ(text) => Some(text),
        LoadComparison::Match | LoadComparison::Nearly(_) | LoadComparison::NotCompared(_) => None,
    };
    let remark = start_state::remarks(&packings, PackingState::remarks).into_iter().next();
    if let Some(explained) = remark.or_else(differs) {
        return Some(format!("{explained}\nhint: {}", start_state::remedy(scene)));
    }
    let is_far_from_rest = packings.iter().any(|packing| packing.is_far_from_rest);
    is_far_from_rest.then(|| start_state::remarks(&packings, PackingState::remarks_on_the_law).join("; "))
}

/// What friction that is reduced from the first moment on may have to do with it; empty otherwise.
fn friction_at_once(scene: &Scene) -> &'static str {
    let start = Moment { load: 0.0, time: 0.0 };
    let is_reduced = |applied: &Applied| match applied.condition {
        Condition::Friction { from, to, .. } => from + applied.history.factor(start) * (to - from) < 1.0,
        _ => false,
    };
    match scene.problem.stages.first() {
        Some(stage) if stage.conditions.iter().any(is_reduced) => {
            "its friction is reduced from the first moment on: history = \"ramp\" in [[friction]] reduces it along the stage; "
        }
        _ => "",
    }
}

/// A further hint about a motion: energy that it was not given may come from a packing that is far from rest; empty otherwise.
fn motion_of_packing(scene: &Scene) -> String {
    let packing = PackingState::of(scene.definition()).ok().filter(|packing| packing.is_far_from_rest);
    packing.map_or_else(String::new, |packing| format!("\nhint: {}", packing.remarks_on_the_law().join("; ")))
}

/// Writes the trial that has ended too many workers to `quarantine.replay`; returns a hint for the message.
pub(super) fn write_failure_case(case: &FailureCase, folder: &OutputFolder) -> String {
    let path = folder.path().join("quarantine.replay");
    match macro_solver::output::write_atomically(&path, &case.encode()) {
        Ok(()) if case.engine.is_empty() || case.engine == ENGINE_NAME => format!(
            "\nhint: `grainspan element --replay {}` repeats this trial in a single process, for a debugger",
            path.display()
        ),
        Ok(()) => format!(
            "\nhint: run.jsonl has what the workers of the engine `{}` have said; `grainspan element --replay {}` prints the trial",
            case.engine,
            path.display()
        ),
        // The run has failed already: one line, not another failure.
        Err(error) => format!("\nthe failing trial could not be written: {error}"),
    }
}
