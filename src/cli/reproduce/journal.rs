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

/// All iterates of a run, in order. Of a run that was continued those that the later process computed again count once.
///
/// # Errors
/// The journal cannot be read.
pub(super) fn iterates(run: &Finished) -> Result<Vec<Iterate>, ReproduceError> {
    let file = run.folder().join("run.jsonl");
    std::fs::read_to_string(&file).map(|text| iterates_of(&text)).map_err(|error| unusable(&file, &error))
}

fn iterates_of(text: &str) -> Vec<Iterate> {
    let mut found: Vec<Iterate> = Vec::new();
    let mut is_continued = false;
    for line in text.lines() {
        // A line that was cut short by the end of a process is no event.
        let Ok(event) = serde_json::from_str::<Value>(line) else { continue };
        is_continued |= event["event"] == "started";
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
            // A process that goes on from a checkpoint repeats what came after it.
            if std::mem::take(&mut is_continued) {
                found.retain(|iterate| iterate.step < step);
            }
            found.push(Iterate { step, iteration, load, force_ratio, displacement_ratio });
        }
    }
    found
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
    fn what_a_continued_run_computes_again_counts_once() {
        let line = |step: u64, iteration: u64| {
            format!(r#"{{"event":"iteration","step":{step},"iteration":{iteration},"load":0.1,"force_ratio":0.5}}"#)
        };
        let started = r#"{"event":"started"}"#.to_owned();
        let lines = [
            started.clone(),
            line(1, 1),
            line(2, 1),
            line(2, 2),
            line(3, 1),
            "{\"event\":\"iter".to_owned(),
            started,
            line(2, 1),
            line(2, 2),
            line(2, 1),
            line(3, 1),
        ];
        let found: Vec<[u64; 2]> = iterates_of(&lines.join("\n")).iter().map(|it| [it.step, it.iteration]).collect();
        assert_eq!(found, [[1, 1], [2, 1], [2, 2], [2, 1], [3, 1]]);
    }

    #[test]
    fn the_last_attempt_at_a_step_counts() {
        let iterate =
            |step, iteration| Iterate { step, iteration, load: 0.0, force_ratio: 1.0, displacement_ratio: None };
        let all = [iterate(1, 1), iterate(2, 1), iterate(2, 2), iterate(2, 1), iterate(2, 2), iterate(3, 1)];
        assert_eq!(attempt(&all, 2), all[3..5]);
        assert!(attempt(&all, 7).is_empty());
    }
}
