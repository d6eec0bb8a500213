//! The iterations of a run, from its `run.jsonl`.

use super::error::ReproduceError;
use super::results::{Finished, unusable};
use serde_json::Value;

/// An iterate of Newton's method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Iterate {
    /// Step that is attempted.
    pub(super) step: u64,
    /// Number within the attempt.
    pub(super) iteration: u64,
    /// Load factor of the stage.
    pub(super) load: f64,
    /// Out-of-balance force over reactions or loads.
    pub(super) force_ratio: f64,
    /// Next correction over the displacements that the criterion names; `None` for an iterate without one.
    pub(super) displacement_ratio: Option<f64>,
}

/// All iterates of a run, in order.
///
/// # Errors
/// The journal cannot be read.
pub(super) fn iterates(run: &Finished) -> Result<Vec<Iterate>, ReproduceError> {
    let file = run.folder().join("run.jsonl");
    let text = std::fs::read_to_string(&file).map_err(|error| unusable(&file, &error))?;
    let mut found = Vec::new();
    for line in text.lines() {
        // A line that was cut short by the end of a process is no event.
        let Ok(event) = serde_json::from_str::<Value>(line) else { continue };
        if event["event"] != "iteration" {
            continue;
        }
        if let (Some(step), Some(iteration), Some(load), Some(force_ratio)) = (
            event["step"].as_u64(),
            event["iteration"].as_u64(),
            event["load"].as_f64(),
            event["force_ratio"].as_f64(),
        ) {
            let displacement_ratio = event["displacement_ratio"].as_f64();
            found.push(Iterate { step, iteration, load, force_ratio, displacement_ratio });
        }
    }
    Ok(found)
}

/// The iterates of the last attempt at a step.
pub(super) fn attempt(iterates: &[Iterate], step: u64) -> Vec<Iterate> {
    let of_step: Vec<Iterate> = iterates.iter().copied().filter(|iterate| iterate.step == step).collect();
    let begin = of_step.iter().rposition(|iterate| iterate.iteration <= 1).unwrap_or(0);
    of_step[begin..].to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_attempt_at_a_step_counts() {
        let iterate =
            |step, iteration| Iterate { step, iteration, load: 0.0, force_ratio: 1.0, displacement_ratio: None };
        let all = [iterate(1, 1), iterate(2, 1), iterate(2, 2), iterate(2, 1), iterate(2, 2), iterate(3, 1)];
        assert_eq!(attempt(&all, 2), all[3..5]);
        assert!(attempt(&all, 7).is_empty());
    }
}
