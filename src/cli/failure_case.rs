//! `grainspan element --replay FILE`: repeats a quarantined trial of a run in this process.

use crate::exit::{Exit, Failure};
use crate::stdout::print;
use macro_solver::checkpoint::FailureCase;
use protocol::{RveEngine, TrialResult};
use rve_server::engine::{ENGINE_NAME, GrainEngine};
use std::fmt::Write;
use std::path::Path;

/// Prints the trial, solves it and prints the result. A fault that ended workers of the run ends this process, in view of a debugger.
///
/// # Errors
/// The file cannot be used, or belongs to another engine (exit code 2); the engine fails (exit code 1).
pub(super) fn run(file: &Path) -> Result<Exit, Failure> {
    let case = FailureCase::read(file).map_err(|error| Failure::new(Exit::BadInput, error))?;
    if !(case.engine.is_empty() || case.engine == ENGINE_NAME) {
        print(trial_text(&case).as_bytes())?;
        let problem =
            format!("{}: the trial is one of the engine `{}`, not of the grain solver", file.display(), case.engine);
        let remedy = "run the scene again with --workers 1 to meet it; run.jsonl has what the worker has said";
        return Err(Failure::new(Exit::BadInput, format!("{problem}\nhint: {remedy}")));
    }
    // Before the attempt: this process may not survive it.
    print(trial_text(&case).as_bytes())?;
    let unusable = |error| Failure::new(Exit::BadInput, format!("{}: {error}", file.display()));
    let mut cell = GrainEngine.create(&case.definition).map_err(unusable)?;
    if !case.state.is_empty() {
        cell.restore(&case.state).map_err(unusable)?;
    }
    let result = cell
        .trial(&case.target, &case.options())
        .map_err(|error| Failure::new(Exit::NotConverged, format!("the engine fails: {error}")))?;
    print(result_text(&result).as_bytes())?;
    Ok(Exit::Done)
}

fn trial_text(case: &FailureCase) -> String {
    let mut text = format!("Gauss point {}, quarantined by {}\n", case.point, case.program);
    for end in &case.failures {
        line(&mut text, "ended a worker", end);
    }
    if !case.engine.is_empty() {
        line(&mut text, "engine", &case.engine);
    }
    line(&mut text, "definition", &case.definition.id().to_string());
    line(
        &mut text,
        "state",
        &match case.state.len() {
            0 => "initial".to_owned(),
            length => format!("snapshot of {length} bytes"),
        },
    );
    line(&mut text, "target", &format!("{:?}", case.target.0));
    line(&mut text, "tangent", case.tangent.keyword());
    line(&mut text, "ramp steps", &case.ramp_steps.to_string());
    text
}

fn result_text(result: &TrialResult) -> String {
    let mut text = String::new();
    line(&mut text, "stress", &format!("{:?}", result.stress.0));
    line(&mut text, "scalars", &format!("{:?}", result.scalars));
    line(&mut text, "cost", &format!("{:?}", result.cost));
    line(&mut text, "flags", &result.flags.0.to_string());
    text
}

fn line(text: &mut String, label: &str, value: &str) {
    writeln!(text, "  {label:<14} {value}").expect("writing to a String cannot fail");
}
