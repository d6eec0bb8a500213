//! How a run stands: everything that is short.

use super::frame::frames;
use crate::cell;
use crate::controls::{Action, Controls, NO_CHECKPOINTS, NOT_SAVED, PAUSED};
use crate::folder::RunFolder;
use crate::program::Program;
use serde_json::{Map, Value, json};

/// Parts of `summary.json` that the page shows as they are.
const SHOWN: [&str; 10] = [
    "steps",
    "gauss_points",
    "newton_iterations",
    "rve_evaluations",
    "evaluations_per_gauss_point",
    "workers",
    "time",
    "accuracy",
    "balance",
    "energy",
];

/// Status, reason, progress and workers of a live run, figures of one that has ended, counters, warnings in words, frames, cells, `run`: a text that changes
/// when another run begins in the folder, and `version`: one that changes whenever another part of the data may have changed.
pub(crate) fn state(folder: &RunFolder, program: &Program) -> Value {
    let live = (program.live)(folder.path());
    // A run that continues finds the summary of the process before.
    let summary = if live.is_some() { None } else { folder.json("summary.json") };
    let controls = Controls::of(folder.path());
    let text = |key: &str| summary.as_ref().and_then(|summary| summary.get(key)).and_then(Value::as_str);
    let is_paused = live.is_some() && controls.has(PAUSED);
    let status = match (&live, text("status")) {
        _ if is_paused => "paused",
        (Some(_), _) => "running",
        (None, Some(status)) => status,
        (None, None) => "ended without a summary",
    };
    let requests: Vec<&str> =
        Action::ALL.into_iter().filter(|action| controls.asks(*action)).map(Action::keyword).collect();
    let of_frames = frames(folder);
    let cells = cell::available(folder);
    let lengths = ["history.csv", "run.jsonl", "summary.json"].map(|name| folder.length(name));
    let run = folder.run();
    let version = format!("{run} {lengths:?} {} {cells:?}", of_frames.len());
    let figures: Map<String, Value> =
        SHOWN.into_iter().filter_map(|key| Some((key.to_owned(), summary.as_ref()?.get(key)?.clone()))).collect();
    json!({
        "name": folder.name(),
        "status": status,
        "reason": text("reason"),
        "live": live,
        "requests": requests,
        "requested_cells": controls.cells(),
        "keeps_checkpoints": !controls.has(NO_CHECKPOINTS),
        "not_saved": controls.text(NOT_SAVED).map(|reason| reason.trim().to_owned()),
        "figures": figures,
        "counters": summary.as_ref().or(live.as_ref()).map(|counts| counters(counts, program)),
        "warnings": summary.as_ref().and_then(|summary| summary.get("warnings")),
        "versions": summary.as_ref().and_then(|summary| summary.get("versions")),
        "frames": of_frames.iter().map(|frame| json!({"step": frame.step, "time": frame.time})).collect::<Value>(),
        "cells": cells.iter().map(|(point, steps)| json!({"point": point, "steps": steps})).collect::<Value>(),
        "scene": folder.text("scene.toml"),
        "run": run,
        "version": version,
    })
}

/// The counters above 0 of a summary or of a live run: those that may concern the accuracy first.
fn counters(summary: &Value, program: &Program) -> Value {
    let former = summary.get("deprecated_names").and_then(Value::as_object);
    let is_former =
        |table: &str, name: &str| former.is_some_and(|names| names.contains_key(&format!("{table}.{name}")));
    let mut found: Vec<(bool, String)> = Vec::new();
    for table in ["fallbacks", "skipped"] {
        for (name, count) in summary.get(table).and_then(Value::as_object).into_iter().flatten() {
            let count = count.as_u64().unwrap_or(0);
            if count > 0 && !is_former(table, name) {
                let (label, concerns) = (program.counter)(name, count);
                found.push((!concerns || table == "skipped", label));
            }
        }
    }
    for name in ["cutbacks", "worker_restarts", "reissued_jobs"] {
        let count = summary.get(name).and_then(Value::as_u64).unwrap_or(0);
        if count > 0 {
            found.push((true, (program.counter)(name, count).0));
        }
    }
    found.sort();
    found.into_iter().map(|(harmless, text)| json!({"text": text, "harmless": harmless})).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    const PROGRAM: Program = Program {
        live: |path| path.join("alive").exists().then(|| json!({"step": 3, "fallbacks": {"overlap": 7}})),
        counter: |name, count| (format!("{count} {name}"), name == "overlap"),
    };

    #[test]
    fn the_state_follows_run_summary_and_requests() {
        let place = tempfile::tempdir().unwrap();
        fs::write(place.path().join("scene.toml"), "name = 'a'").unwrap();
        let folder = RunFolder::open(place.path()).unwrap();
        let status = || state(&folder, &PROGRAM)["status"].as_str().unwrap().to_owned();
        assert_eq!(status(), "ended without a summary");
        fs::write(place.path().join("alive"), "").unwrap();
        assert_eq!(status(), "running");
        assert_eq!(state(&folder, &PROGRAM)["counters"][0]["text"], "7 overlap");
        let before = state(&folder, &PROGRAM)["version"].clone();
        let controls = Controls::of(place.path());
        controls.request(Action::Pause).unwrap();
        controls.put(PAUSED).unwrap();
        assert_eq!(status(), "paused");
        assert_eq!(state(&folder, &PROGRAM)["requests"].to_string(), r#"["pause"]"#);
        assert!(state(&folder, &PROGRAM)["not_saved"].is_null());
        controls.put_text(NOT_SAVED, "no space left on device\n").unwrap();
        assert_eq!(state(&folder, &PROGRAM)["not_saved"], "no space left on device");
        fs::remove_file(place.path().join("alive")).unwrap();
        let summary = r#"{"status":"not_converged","reason":"no way","steps":3,"fallbacks":{"overlap":2,"old":1,"none":0,"x":1},
            "skipped":{"y":4},"deprecated_names":{"fallbacks.old":"fallbacks.overlap"},"cutbacks":5,
            "balance":{"error_of_mean":0.02},"warnings":["energy balance open by 7 %"]}"#;
        fs::write(place.path().join("summary.json"), summary).unwrap();
        let found = state(&folder, &PROGRAM);
        assert_eq!((status(), &found["reason"]), ("not_converged".to_owned(), &Value::from("no way")));
        assert_ne!(found["version"], before);
        let texts: Vec<&str> =
            found["counters"].as_array().unwrap().iter().map(|counter| counter["text"].as_str().unwrap()).collect();
        assert_eq!(texts, ["2 overlap", "1 x", "4 y", "5 cutbacks"]);
        assert_eq!(found["counters"][0]["harmless"], false);
        assert_eq!(found["warnings"][0], "energy balance open by 7 %");
        assert_eq!(found["figures"]["balance"]["error_of_mean"], 0.02, "the page reads it");
    }

    /// A run into the folder of an earlier one, of the same scene and the same size: the page kept the fields of the earlier one.
    #[test]
    fn another_run_in_the_folder_is_told_from_the_one_before() {
        let place = tempfile::tempdir().unwrap();
        let scene = place.path().join("scene.toml");
        fs::write(&scene, "name = 'a'").unwrap();
        let folder = RunFolder::open(place.path()).unwrap();
        let told = || ["run", "version"].map(|key| state(&folder, &PROGRAM)[key].clone());
        let before = told();
        assert_eq!(told(), before);
        // As a run writes it.
        let draft = place.path().join(".scene.toml.partial");
        fs::write(&draft, "name = 'a'").unwrap();
        fs::rename(&draft, &scene).unwrap();
        assert!(told().iter().zip(&before).all(|(now, before)| now != before));
    }
}
