//! The contents of a report, read from the files of an output folder.

use super::picture;
use crate::exit::{Exit, Failure};
use macro_solver::mesh::Dimension;
use scene_reader::Scene;
use serde_json::Value;
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

/// Warnings of the log that are shown; the rest is counted.
const MOST_WARNINGS: usize = 200;

/// The files of a run, understood as far as a report needs.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Contents {
    /// Name of the folder.
    pub(super) name: String,
    /// `summary.json`; absent while the run has not ended.
    pub(super) summary: Option<Value>,
    /// Column names of `history.csv`.
    pub(super) columns: Vec<String>,
    /// Its rows; a cell that is no number, such as the name of a stage, is NaN.
    pub(super) rows: Vec<Vec<f64>>,
    /// `scene.toml`.
    pub(super) scene: Option<String>,
    /// Whether its mesh has three dimensions.
    pub(super) is_solid: bool,
    /// A picture of the mesh.
    pub(super) mesh: Option<String>,
    /// Warnings and errors of `run.jsonl`, oldest first.
    pub(super) warnings: Vec<String>,
    /// Warnings beyond those.
    pub(super) more_warnings: usize,
}

impl Contents {
    /// Reads a folder.
    ///
    /// # Errors
    /// It holds no `history.csv`, or a file cannot be read or understood.
    pub(super) fn read(folder: &Path) -> Result<Self, Failure> {
        let history = text(folder, "history.csv")?.ok_or_else(|| {
            Failure::new(
                Exit::BadInput,
                format!(
                    "{} is no run's output: it has no history.csv\nhint: give the folder that `grainspan run` names at its \
                     end, such as out/biaxial",
                    folder.display()
                ),
            )
        })?;
        let bad = |file: &str, reason: String| {
            Failure::new(Exit::BadInput, format!("{}: {reason}", folder.join(file).display()))
        };
        let (columns, rows) = table(&history).map_err(|error| bad("history.csv", error.to_string()))?;
        let summary = text(folder, "summary.json")?
            .map(|content| serde_json::from_str(&content).map_err(|error| bad("summary.json", error.to_string())))
            .transpose()?;
        let (warnings, more_warnings) = warnings(&text(folder, "run.jsonl")?.unwrap_or_default());
        let whole = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
        let name = whole.file_name().map_or_else(|| "run".to_owned(), |name| name.to_string_lossy().into_owned());
        let scene = text(folder, "scene.toml")?;
        // A picture is a convenience: a mesh file that is not in its place any more is no reason to have no report.
        let loaded = Scene::load(&folder.join("scene.toml"), &[]).ok();
        let is_solid = loaded.as_ref().is_some_and(|scene| scene.problem.mesh.dimension == Dimension::Space);
        let mesh = loaded.as_ref().and_then(picture::mesh);
        Ok(Self { name, summary, columns, rows, scene, is_solid, mesh, warnings, more_warnings })
    }

    /// A column of the history; NaN in rows that lack it.
    pub(super) fn column(&self, name: &str) -> Vec<f64> {
        let place = self.columns.iter().position(|column| column == name);
        self.rows.iter().map(|row| place.and_then(|place| row.get(place)).copied().unwrap_or(f64::NAN)).collect()
    }
}

/// The text of a file; nothing if it does not exist.
fn text(folder: &Path, file: &str) -> Result<Option<String>, Failure> {
    let path = folder.join(file);
    match fs::read_to_string(&path) {
        Ok(content) => Ok(Some(content)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(Failure::new(Exit::BadInput, format!("{} cannot be read: {error}", path.display()))),
    }
}

fn table(content: &str) -> Result<(Vec<String>, Vec<Vec<f64>>), csv::Error> {
    let mut reader = csv::Reader::from_reader(content.as_bytes());
    let columns = reader.headers()?.iter().map(str::to_owned).collect();
    let numbers = |record: csv::StringRecord| record.iter().map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
    let rows = reader.records().map(|record| record.map(numbers)).collect::<Result<_, _>>()?;
    Ok((columns, rows))
}

/// Warnings and errors of a log, each as one line, and how many there are beyond the first ones. The last line of a run
/// that was killed may be cut off; it is passed over.
fn warnings(log: &str) -> (Vec<String>, usize) {
    let mut lines = log.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok()).filter_map(|entry| {
        let level = entry.get("level")?.as_str()?.to_owned();
        matches!(level.as_str(), "WARN" | "ERROR").then(|| line_of(&entry, &level))
    });
    let first = lines.by_ref().take(MOST_WARNINGS).collect();
    (first, lines.count())
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

    #[test]
    fn a_folder_is_read_as_far_as_it_goes() {
        let folder = tempfile::tempdir().unwrap();
        assert!(Contents::read(folder.path()).unwrap_err().message.contains("no history.csv"));
        fs::write(folder.path().join("history.csv"), "step,time,ratio,stage\n0,0,1,first\n1,0.5,1.25,first\n")
            .unwrap();
        let log = "{\"level\":\"INFO\",\"event\":\"step\"}\n{\"level\":\"WARN\",\"event\":\"cut_back\",\"step\":3}\n{\"level\"";
        fs::write(folder.path().join("run.jsonl"), log).unwrap();
        let contents = Contents::read(folder.path()).unwrap();
        assert_eq!(contents.column("ratio"), [1.0, 1.25]);
        assert!(contents.column("stage")[0].is_nan());
        assert_eq!(contents.warnings, ["WARN: cut_back, step = 3"]);
        assert_eq!((contents.summary, contents.more_warnings), (None, 0));
        fs::write(folder.path().join("summary.json"), "{").unwrap();
        assert!(Contents::read(folder.path()).unwrap_err().message.contains("summary.json"));
    }
}
