//! Where a run begins: from the start, from a checkpoint, or not at all because it is complete.

#[cfg(test)]
mod tests;

use crate::build_info::this_program;
use crate::engines::EngineAssignment;
use crate::exit::{Exit, Failure};
use crate::folder_lock::SECTION_OF_RUNS;
use macro_solver::checkpoint::{
    Archive, CheckpointError, CheckpointFigures, CheckpointFile, Progress, StoredCheckpoint,
};
use macro_solver::output::{RunStatus, Summary, write_atomically};
use scene_reader::{InputCopy, Scene, changes};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::Display;
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

/// Counts changes of [`RunDescription`].
const VERSION: u32 = 2;

/// Description of a run in its checkpoints.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct RunDescription {
    /// The scene as run.
    pub(super) scene: String,
    /// What the scene only refers to.
    pub(super) contents: Contents,
    /// The program that wrote it, see [`this_program`].
    pub(super) program: String,
    /// Whether another build has written an earlier part of the run.
    pub(super) other_builds: bool,
    /// Accepted steps.
    pub(super) step: u64,
    /// Load factor reached, 0 to 1.
    pub(super) load: f64,
    /// Wall time of all processes so far, s.
    pub(super) wall_s: f64,
    /// Cost of checkpoints so far.
    pub(super) figures: CheckpointFigures,
    /// What happened between hosts so far, by name.
    #[serde(default)]
    pub(super) hosts: HostFigures,
}

/// What happened between hosts, by name.
pub(super) type HostFigures = BTreeMap<String, u64>;

/// The figures of two parts of a run together.
pub(super) fn added_up(mut before: HostFigures, later: HostFigures) -> HostFigures {
    for (name, count) in later {
        *before.entry(name).or_default() += count;
    }
    before
}

/// What decides the results of a run and does not stand in its scene.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Contents {
    /// Content identity of the grains' definition; empty where the cells have yet to be prepared, and then it is not compared.
    pub(super) definition: String,
    /// Content identity of the mesh; empty if the scene generates it.
    pub(super) mesh: String,
    /// The engines with their points; `--engine` takes the place of the one in the scene.
    pub(super) engines: String,
    /// Versions of the engines outside this program.
    #[serde(default)]
    pub(super) versions: String,
}

impl Contents {
    /// Of a scene whose points these engines solve.
    pub(super) fn new(scene: &Scene, assignment: &EngineAssignment) -> Self {
        let is_prepared = scene.preparation().is_none() || scene.prepared.is_some();
        Self {
            definition: if is_prepared { scene.materials.identity() } else { String::new() },
            // In full: the display of an identity is a shortened one.
            mesh: scene.mesh_identity.map_or_else(String::new, |identity| format!("{identity:?}")),
            engines: assignment.by_points(),
            versions: assignment.outside_versions(),
        }
    }

    /// The parts with their names in the `versions` of a summary; a mesh that the scene generates has none.
    pub(super) fn recorded(&self) -> impl Iterator<Item = (String, String)> {
        let parts = [("definition", &self.definition), ("mesh", &self.mesh), ("points", &self.engines)];
        parts.into_iter().filter(|(_, part)| !part.is_empty()).map(|(name, part)| (name.to_owned(), part.clone()))
    }

    /// Those of a complete run, by the `versions` of its summary; what an earlier build has not recorded is taken to be the same.
    fn of_summary(versions: &BTreeMap<String, String>, now: &Self) -> Self {
        let part = |name: &str, now: &String| versions.get(name).unwrap_or(now).clone();
        Self {
            definition: part("definition", &now.definition),
            mesh: part("mesh", &now.mesh),
            engines: part("points", &now.engines),
            versions: now.versions.clone(),
        }
    }

    /// One sentence for each part that was another one before.
    fn changes(&self, before: &Self) -> Vec<String> {
        let mut found = Vec::new();
        if !self.definition.is_empty() && self.definition != before.definition {
            found.push("packing: the content of the packing file is not the same".to_owned());
        }
        if self.mesh != before.mesh {
            found.push("mesh.file: the content is not the same".to_owned());
        }
        if self.engines != before.engines {
            found.push(format!("--engine: the points were solved by {} and are by {}", before.engines, self.engines));
        }
        found
    }
}

impl RunDescription {
    /// Puts the description into an archive.
    pub(super) fn put(
        &self,
        archive: &mut Archive,
        mark: Progress,
        wall_s: f64,
        figures: &CheckpointFigures,
        hosts: HostFigures,
    ) {
        let (step, load, figures) = (mark.step, mark.load, figures.clone());
        let description = Self { step, load, wall_s, figures, hosts, ..self.clone() };
        archive.put(SECTION_OF_RUNS, VERSION, &description);
    }

    /// The description of the same run in a process that begins it or continues it.
    pub(super) fn of(self, continued: Option<&Continued>) -> Self {
        Self { other_builds: continued.is_some_and(|continued| continued.other_build), ..self }
    }

    /// The description of a run that begins now.
    pub(super) fn new(scene: &str, contents: Contents) -> Self {
        Self {
            scene: scene.to_owned(),
            contents,
            program: this_program(),
            other_builds: false,
            step: 0,
            load: 0.0,
            wall_s: 0.0,
            figures: CheckpointFigures::default(),
            hosts: HostFigures::default(),
        }
    }
}

/// A run to be continued.
pub(super) struct Continued {
    /// Its state.
    pub(super) archive: Archive,
    /// Its description.
    pub(super) description: RunDescription,
    /// Remarks for the user.
    pub(super) remarks: Vec<String>,
    /// Whether another build of this program has written the checkpoint, or an earlier one of the run.
    pub(super) other_build: bool,
}

impl Continued {
    /// Compares the definition of the grains, once the cells are prepared.
    ///
    /// # Errors
    /// It is another one than that of the checkpoint in `folder`.
    pub(super) fn expect_definition(&self, folder: &Path, now: &Contents) -> Result<(), Failure> {
        let found = now.changes(&self.description.contents);
        if found.is_empty() { Ok(()) } else { Err(refusal(folder, &found, false)) }
    }
}

/// Where to begin.
pub(super) enum Start {
    /// At the beginning: there is nothing to continue.
    Beginning,
    /// At the last checkpoint.
    From(Box<Continued>),
    /// The run has reached its end before.
    Complete,
}

/// Finds where a run of this scene, which names these files, starts, from what an earlier process of it left in `folder`. Of a complete run
/// whose cells would have to be prepared scene and files tell what they are.
///
/// # Errors
/// The folder belongs to a run of another scene, or its checkpoint cannot be used.
pub(super) fn start(folder: &Path, description: &RunDescription, files: &[&InputCopy]) -> Result<Start, Failure> {
    match CheckpointFile::in_folder(folder).read().map_err(unusable)? {
        StoredCheckpoint::Archive(archive, damage) => {
            let mut earlier: RunDescription = archive.get(SECTION_OF_RUNS, VERSION).map_err(unusable)?;
            // The figures were taken before this checkpoint was written.
            earlier.figures.written += 1;
            earlier.figures.bytes = archive.size();
            // A copy that cannot be read counts as none: the checkpoint holds the scene, and only what differs is put in order.
            let stored = fs::read_to_string(folder.join("scene.toml")).ok();
            // Keys that may change from one process of a run to the next do not count.
            let is_changed = stored.is_some_and(|stored| !changes(&stored, &earlier.scene).is_empty());
            refuse_changes(folder, &earlier.scene, description, is_changed)?;
            if is_changed {
                // The checkpoint is checked by its sum; the file next to it is for people and `report`.
                write_atomically(&folder.join("scene.toml"), earlier.scene.as_bytes())?;
            }
            let found = description.contents.changes(&earlier.contents);
            if !found.is_empty() {
                return Err(refusal(folder, &found, false));
            }
            let restored = format!(
                "{} was not the scene that the checkpoint was written with; it is restored from the checkpoint",
                folder.join("scene.toml").display()
            );
            let mut remarks: Vec<String> = damage
                .map(|error| format!("{error}; continuing from the checkpoint before it"))
                .into_iter()
                .collect();
            remarks.extend(is_changed.then_some(restored));
            let is_other_build = earlier.program != description.program;
            if is_other_build {
                remarks.push(format!(
                    "the checkpoint was written by another build ({}, this is {}): the rest of the run may differ in \
                     the last digits from a run in one piece",
                    earlier.program, description.program
                ));
            }
            let is_other_engine = earlier.contents.versions != description.contents.versions;
            if is_other_engine {
                remarks.push(format!(
                    "the checkpoint was written with engines of another version ({}, now {}): the rest of the run is that of the new ones",
                    earlier.contents.versions, description.contents.versions
                ));
            }
            let other_build = is_other_build || is_other_engine || earlier.other_builds;
            Ok(Start::From(Box::new(Continued { archive: *archive, description: earlier, remarks, other_build })))
        }
        StoredCheckpoint::Nothing => {
            let Some(before) = left(folder, "scene.toml", |bytes| str::from_utf8(bytes).map(str::to_owned))? else {
                return Ok(Start::Beginning);
            };
            refuse_changes(folder, &before, description, true)?;
            refuse_other_files(folder, files)?;
            let summary = left(folder, "summary.json", |bytes| serde_json::from_slice::<Summary>(bytes))?;
            let Some(summary) = summary.filter(|summary| summary.status == RunStatus::Done) else {
                return Ok(Start::Beginning);
            };
            let contents = &description.contents;
            let found = contents.changes(&Contents::of_summary(&summary.versions, contents));
            if found.is_empty() { Ok(Start::Complete) } else { Err(refusal(folder, &found, false)) }
        }
    }
}

/// What an earlier process left in a file of the folder; none if there is no such file.
///
/// # Errors
/// It cannot be read. The folder may hold a complete run then, which a run from the beginning would remove.
fn left<T, E: Display>(
    folder: &Path,
    name: &str,
    read: impl Fn(&[u8]) -> Result<T, E>,
) -> Result<Option<T>, Failure> {
    let path = folder.join(name);
    let refused = |reason: &dyn Display| {
        Failure::new(
            Exit::BadInput,
            format!(
                "{} cannot be read ({reason}), and the folder may hold a complete run: give another --out, or remove the file to \
                 begin the run again",
                path.display()
            ),
        )
    };
    match fs::read(&path) {
        Ok(bytes) => read(&bytes).map(Some).map_err(|error| refused(&error)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(refused(&error)),
    }
}

/// `doubtful`: the scene in the folder may be damaged, or is known to be another one than the run's.
fn refuse_changes(folder: &Path, before: &str, description: &RunDescription, doubtful: bool) -> Result<(), Failure> {
    match &changes(before, &description.scene)[..] {
        [] => Ok(()),
        found => Err(refusal(folder, found, doubtful)),
    }
}

/// Without a checkpoint nothing but the copies in the folder tells what the files of the run held: the scene as run names the copies.
fn refuse_other_files(folder: &Path, files: &[&InputCopy]) -> Result<(), Failure> {
    let is_same =
        |file: &InputCopy| fs::read(folder.join(&file.name)).is_ok_and(|bytes| bytes == file.text.as_bytes());
    let found: Vec<String> = files
        .iter()
        .filter(|file| !is_same(file))
        .map(|file| format!("{}: the content is not that of {} in the folder", file.key, file.name))
        .collect();
    if found.is_empty() { Ok(()) } else { Err(refusal(folder, &found, false)) }
}

fn refusal(folder: &Path, found: &[String], doubtful: bool) -> Failure {
    let scene = folder.join("scene.toml");
    let remedy = if doubtful {
        format!(
            "if the scene was changed, continue with it as it was; if {} is damaged, there is no copy to compare it with: start the run \
             from the beginning without --resume, or another one elsewhere",
            scene.display()
        )
    } else {
        format!(
            "continue it with the scene as it was, {} with --out {}, and with the same files and --engine, or start another run \
             elsewhere",
            scene.display(),
            folder.display()
        )
    };
    let text = format!(
        "the run in {} cannot be continued with another scene:\n  {}\nhint: {remedy}",
        folder.display(),
        found.join("\n  "),
    );
    Failure::new(Exit::BadInput, text)
}

fn unusable(error: CheckpointError) -> Failure {
    let hint = match &error {
        CheckpointError::Damaged { .. } => {
            "\nhint: no whole checkpoint is left; without --resume the run starts from the beginning and replaces what is there"
        }
        _ => "",
    };
    Failure::new(Exit::BadInput, format!("{error}{hint}"))
}
