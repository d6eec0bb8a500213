//! A defect of a problem, told at the key that caused it.

use super::conditions::ConditionPlaces;
use super::document::{Document, explain_command};
use super::input_error::InputError;
use macro_solver::problem::ProblemError;

/// A defect that the solver's own check found, at the condition or the key that caused it; `places` are those of the conditions, by stage.
pub(super) fn problem_error(document: &Document, places: &[ConditionPlaces], error: &ProblemError) -> InputError {
    let (stage, found) = match error {
        ProblemError::Stage { number, error, .. } => (Some(*number), &**error),
        found => (None, found),
    };
    let cause = error.cause();
    if let ProblemError::Condition { number, .. } = found
        && let Some(place) = places.get(stage.unwrap_or(0)).and_then(|places| places.get(*number))
    {
        let error = document.error_at(place.clone(), error);
        return match cause {
            ProblemError::Contradiction { first_set, second_set, .. } if first_set == second_set => error.hint(format!(
                "a node follows one condition along each axis, and two conditions move '{first_set}': take one of them out, or give both the \
                 same displacement"
            )),
            ProblemError::Contradiction { first_set, second_set, .. } => error.hint(format!(
                "a node follows one condition along each axis: move one of '{first_set}' and '{second_set}' along another axis, \
                 give both the same displacement, or use a mesh in which they share no node"
            )),
            ProblemError::NoDirection { .. } | ProblemError::NoImage { .. } => error.hint(SETS_OF_MESHES),
            _ => error,
        };
    }
    let key: Vec<String> = match cause {
        ProblemError::Setting(fault) => fault.path.clone(),
        ProblemError::Nonlocal(_) => vec!["nonlocal".to_owned()],
        ProblemError::NonlocalFormulation { .. } => vec!["solver".to_owned(), "formulation".to_owned()],
        ProblemError::ViscousHourglass => vec!["solver".to_owned(), "hourglass".to_owned()],
        ProblemError::Mass(_) => vec!["dynamics".to_owned(), "lumping".to_owned()],
        ProblemError::RigidMotion { .. } => return document.error(error).hint(SETS_OF_MESHES),
        // The others say themselves what to do.
        _ => return document.error(error),
    };
    let number = stage.map(|stage| stage.to_string());
    let in_stage: Vec<String> =
        number.iter().flat_map(|number| ["stage".to_owned(), number.clone()]).chain(key.clone()).collect();
    let place = if document.is_written(&parts(&in_stage)) { in_stage } else { key };
    document.error_at_key(&parts(&place), error).hint(explain_command(&place))
}

/// Where it is said which sets there are.
const SETS_OF_MESHES: &str = "docs/reference/scene.md says how [[boundary]] and [mesh] work together";

fn parts(path: &[String]) -> Vec<&str> {
    path.iter().map(String::as_str).collect()
}
