//! Convergence and warnings from the event log.

use crate::folder::RunFolder;
use crate::numbers::short;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Warnings that are shown; the rest is counted.
const MOST_WARNINGS: usize = 200;

/// Steps whose iterations are shown one by one: the last ones.
const MOST_STEPS: usize = 400;

/// `steps`: of the last steps number, iterations as `[force ratio, displacement ratio, rejected]`, cut-backs; `warnings` and `more_warnings`.
pub(crate) fn log(folder: &RunFolder) -> Value {
    let mut steps: BTreeMap<u64, (Vec<Value>, u64)> = BTreeMap::new();
    let mut warnings: Vec<String> = Vec::new();
    let mut more_warnings = 0_u64;
    let mut has_restarted = false;
    for entry in folder.complete_lines("run.jsonl").lines().filter_map(|line| serde_json::from_str(line).ok()) {
        let entry: Value = entry;
        let text = |key: &str| entry.get(key).and_then(Value::as_str);
        let step = entry.get("step").and_then(Value::as_u64);
        has_restarted |= text("event") == Some("started");
        if let (true, Some("iteration" | "cut_back"), Some(step)) = (has_restarted, text("event"), step) {
            // A run that is continued solves the steps after its checkpoint again.
            steps.retain(|known, _| *known < step);
            has_restarted = false;
        }
        match (text("event"), step) {
            (Some("iteration"), Some(step)) => {
                let ratio = |key: &str| entry.get(key).and_then(Value::as_f64).map_or(Value::Null, short);
                let rejected = entry.get("rejected").cloned().unwrap_or(Value::Bool(false));
                let iteration = json!([ratio("force_ratio"), ratio("displacement_ratio"), rejected]);
                // Another attempt at a step replaces the iterations of the one that failed.
                let number = entry.get("iteration").and_then(Value::as_u64);
                let known = steps.entry(step).or_default();
                if number == Some(1) {
                    known.0.clear();
                }
                known.0.push(iteration);
            }
            (Some("cut_back"), Some(step)) => steps.entry(step).or_default().1 += 1,
            _ => {}
        }
        if let Some(level @ ("WARN" | "ERROR")) = text("level") {
            if warnings.len() < MOST_WARNINGS {
                warnings.push(line_of(&entry, level));
            } else {
                more_warnings += 1;
            }
        }
    }
    let shown = steps.into_iter().rev().take(MOST_STEPS);
    let shown: Vec<Value> = shown
        .map(
            |(step, (iterations, cut_backs))| json!({"step": step, "iterations": iterations, "cut_backs": cut_backs}),
        )
        .collect();
    json!({
        "steps": shown.into_iter().rev().collect::<Value>(),
        "warnings": warnings,
        "more_warnings": more_warnings,
    })
}

fn line_of(entry: &Value, level: &str) -> String {
    let fields = entry.as_object().into_iter().flatten();
    let parts =
        fields.filter(|(key, _)| !matches!(key.as_str(), "level" | "target" | "timestamp")).map(|(key, value)| {
            let value = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            if matches!(key.as_str(), "message" | "event") { value } else { format!("{key} = {value}") }
        });
    format!("{level}: {}", parts.collect::<Vec<_>>().join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn iterations_cut_backs_and_warnings_are_found() {
        let place = tempfile::tempdir().unwrap();
        fs::write(place.path().join("scene.toml"), "").unwrap();
        let lines = [
            r#"{"level":"DEBUG","event":"iteration","step":1,"iteration":1,"force_ratio":0.9}"#,
            r#"{"level":"DEBUG","event":"iteration","step":1,"iteration":2,"force_ratio":0.8}"#,
            r#"{"level":"WARN","event":"cut_back","step":1,"reason":"too large"}"#,
            r#"{"level":"DEBUG","event":"iteration","step":1,"iteration":1,"force_ratio":0.5,"displacement_ratio":null,"rejected":false}"#,
            r#"{"level":"DEBUG","event":"iteration","step":1,"iteration":2,"force_ratio":1.23456789e-3,"displacement_ratio":0.1,"rejected":true}"#,
            "not json",
            r#"{"level":"WARN","event":"cut_"#,
        ];
        fs::write(place.path().join("run.jsonl"), lines.join("\n")).unwrap();
        let found = log(&RunFolder::open(place.path()).unwrap());
        assert_eq!(
            found["steps"].to_string(),
            r#"[{"cut_backs":1,"iterations":[[0.5,null,false],[0.0012346,0.1,true]],"step":1}]"#
        );
        assert_eq!(found["warnings"].to_string(), r#"["WARN: cut_back, reason = too large, step = 1"]"#);
    }

    #[test]
    fn steps_that_a_continued_run_solves_again_count_once() {
        let place = tempfile::tempdir().unwrap();
        fs::write(place.path().join("scene.toml"), "").unwrap();
        let started = r#"{"level":"INFO","event":"started"}"#.to_owned();
        let cut = |step: u64| format!(r#"{{"level":"WARN","event":"cut_back","step":{step}}}"#);
        let iteration = |step: u64| format!(r#"{{"event":"iteration","step":{step},"iteration":1}}"#);
        let lines = [
            started.clone(),
            cut(1),
            cut(2),
            iteration(2),
            iteration(3),
            // Killed, and continued after step 1.
            started,
            iteration(2),
            cut(2),
            iteration(2),
        ];
        fs::write(place.path().join("run.jsonl"), lines.join("\n") + "\n").unwrap();
        let found = log(&RunFolder::open(place.path()).unwrap());
        let counts: Vec<Vec<u64>> = found["steps"]
            .as_array()
            .unwrap()
            .iter()
            .map(|step| ["step", "cut_backs"].map(|key| step[key].as_u64().unwrap()).to_vec())
            .collect();
        assert_eq!(counts, [[1, 1], [2, 1]]);
    }
}
