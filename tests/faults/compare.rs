//! Whether two output folders hold the same results.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Keys of the summary that do not depend on what happened to workers, on times or on checkpoints.
const DETERMINISTIC: [&str; 9] = [
    "status",
    "steps",
    "gauss_points",
    "newton_iterations",
    "rve_evaluations",
    "evaluations_per_gauss_point",
    "cutbacks",
    "skipped",
    "energy",
];

/// Files whose content is about this very process: the journal, the summary (compared by its keys), the scene with its
/// keys of supervision.
const OWN: [&str; 3] = ["run.jsonl", "summary.json", "scene.toml"];

/// Compares every result; the error names the first difference.
pub fn same(disturbed: &Path, reference: &Path) -> Result<(), String> {
    let (found, expected) = (files(disturbed), files(reference));
    if found != expected {
        let odd: Vec<_> = found.symmetric_difference(&expected).collect();
        return Err(format!("the files differ: {odd:?}"));
    }
    for file in &found {
        if OWN.contains(&file.to_string_lossy().as_ref()) {
            continue;
        }
        if fs::read(disturbed.join(file)).ok() != fs::read(reference.join(file)).ok() {
            return Err(format!("{} differs", file.display()));
        }
    }
    let (found, expected) = (summary(disturbed)?, summary(reference)?);
    for key in DETERMINISTIC {
        if found[key] != expected[key] {
            return Err(format!("{key} in the summary is {} instead of {}", found[key], expected[key]));
        }
    }
    Ok(())
}

fn summary(folder: &Path) -> Result<serde_json::Value, String> {
    let text = fs::read(folder.join("summary.json")).map_err(|error| format!("no summary: {error}"))?;
    serde_json::from_slice(&text).map_err(|error| format!("the summary cannot be read: {error}"))
}

fn files(folder: &Path) -> BTreeSet<PathBuf> {
    let mut found = BTreeSet::new();
    collect(folder, Path::new(""), &mut found);
    found
}

fn collect(folder: &Path, below: &Path, found: &mut BTreeSet<PathBuf>) {
    for entry in fs::read_dir(folder.join(below)).into_iter().flatten().flatten() {
        let path = below.join(entry.file_name());
        if entry.path().is_dir() {
            collect(folder, &path, found);
        } else {
            found.insert(path);
        }
    }
}
