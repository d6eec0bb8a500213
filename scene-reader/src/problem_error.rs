//! A defect of a problem, told at the key that caused it.

use super::document::{Document, explain_command};
use super::input_error::InputError;
use macro_solver::problem::ProblemError;

/// A defect that the solver's own check found, at the key that caused it.
pub(super) fn problem_error(document: &Document, error: &ProblemError) -> InputError {
    let (stage, cause) = match error {
        ProblemError::Stage { number, error, .. } => (Some(number.to_string()), &**error),
        cause => (None, cause),
    };
    if let ProblemError::Contradiction { first_set, second_set, .. } = cause {
        return document.error(error).hint(format!(
            "a node follows one condition along each axis: move one of '{first_set}' and '{second_set}' along another axis, give \
             both the same displacement, or use a mesh in which they share no node"
        ));
    }
    let key: Vec<String> = match cause {
        ProblemError::Setting(fault) => fault.path.clone(),
        ProblemError::Nonlocal(_) => vec!["nonlocal".to_owned()],
        ProblemError::NonlocalFormulation { .. } => vec!["solver".to_owned(), "formulation".to_owned()],
        ProblemError::ViscousHourglass => vec!["solver".to_owned(), "hourglass".to_owned()],
        ProblemError::HistoryAtRest | ProblemError::MotionOffRamp | ProblemError::FrictionUnknownLoad => {
            vec!["loading".to_owned(), "control".to_owned()]
        }
        ProblemError::Mass(_) => vec!["dynamics".to_owned(), "lumping".to_owned()],
        ProblemError::FrictionHistory => vec!["friction".to_owned()],
        ProblemError::RigidMotion { .. } | ProblemError::NoDirection { .. } | ProblemError::NoImage { .. } => {
            return document
                .error(error)
                .hint("docs/reference/scene.md says how [[boundary]] and [mesh] work together");
        }
        // The others say themselves what to do.
        _ => return document.error(error),
    };
    let in_stage: Vec<String> =
        stage.iter().flat_map(|number| ["stage".to_owned(), number.clone()]).chain(key.clone()).collect();
    let place = if document.is_written(&parts(&in_stage)) { in_stage } else { key };
    document.error_at_key(&parts(&place), error).hint(explain_command(&place))
}

fn parts(path: &[String]) -> Vec<&str> {
    path.iter().map(String::as_str).collect()
}
