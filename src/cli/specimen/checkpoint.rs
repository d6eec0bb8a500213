//! Checkpoints of a specimen: table, pictures and state in one file, written while it runs and read by `--resume`.

use super::profile;
use crate::exit::{Exit, Failure};
use crate::folder_lock::{holds_a_run, lock_folder};
use crate::stderr::tell;
use macro_solver::checkpoint::{Archive, CheckpointError, CheckpointFile, StoredCheckpoint};
use protocol::ContentId;
use scene_reader::changes;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::path::{Path, PathBuf};

const SECTION: &str = "specimen";

/// Counts changes of [`Kept`] and of the state that it holds.
const VERSION: u32 = 9;

/// What a checkpoint holds.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Kept {
    /// The test as run.
    test: String,
    /// Content identity of the packing file.
    packing: String,
    /// The program that wrote it.
    program: String,
    /// What was asked for on the command line.
    asked: Asked,
    /// Table so far.
    #[serde(with = "serde_bytes")]
    pub(super) table: Vec<u8>,
    /// Pictures so far: step and file.
    pub(super) frames: Vec<(f64, String)>,
    /// Centres from which fluctuations are counted, m.
    pub(super) start: Vec<[f64; 3]>,
    /// Layers and their tables so far.
    pub(super) profiles: Option<profile::Kept>,
    /// State of the run.
    #[serde(with = "serde_bytes")]
    pub(super) state: Vec<u8>,
}

/// Choices of the command line that shape the files of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Asked {
    /// Whether the header of the table has units.
    pub(super) units: bool,
    /// Whether pictures are drawn.
    pub(super) pictures: bool,
    /// Whether layers are followed.
    pub(super) profiles: bool,
    /// Stage from whose start fluctuations are counted.
    pub(super) fluctuations_from: Option<String>,
    /// Whether contacts are drawn.
    pub(super) contacts: bool,
}

/// What a checkpoint is made of.
pub(super) struct Now<'a> {
    /// Table so far.
    pub(super) table: &'a [u8],
    /// Pictures so far: step and file.
    pub(super) frames: &'a [(f64, String)],
    /// Centres from which fluctuations are counted, m.
    pub(super) start: &'a [[f64; 3]],
    /// Layers and their tables so far.
    pub(super) profiles: Option<&'a profile::Kept>,
    /// State of the run.
    pub(super) state: &'a [u8],
}

/// Where checkpoints of this run go.
pub(super) struct SpecimenCheckpoint {
    folder: PathBuf,
    file: CheckpointFile,
    /// What is the same in every checkpoint.
    blank: Kept,
    /// Whether a checkpoint could not be written; people are told once.
    has_failed: bool,
    /// Held as long as the specimen may write.
    _lock: File,
}

impl SpecimenCheckpoint {
    /// Checkpoints in `folder` of the test `test` with the packing in `packing`.
    ///
    /// # Errors
    /// The folder cannot be made, is that of a run, or another specimen writes to it; the packing cannot be read again.
    pub(super) fn new(folder: &Path, test: String, packing: &Path, asked: Asked) -> Result<Self, Failure> {
        let system = |action, path: &Path, source| {
            let error = CheckpointError::System { action, path: path.to_owned(), source };
            Failure::new(Exit::BadInput, error)
        };
        std::fs::create_dir_all(folder).map_err(|source| system("make", folder, source))?;
        let bytes = std::fs::read(packing).map_err(|source| system("read", packing, source))?;
        let blank = Kept {
            test,
            packing: ContentId::of(&bytes).to_string(),
            program: crate::build_info::this_program(),
            asked,
            ..Kept::default()
        };
        if folder.join("scene.toml").exists() || holds_a_run(folder) {
            let problem = format!(
                "--checkpoint {}: this is the folder of a run, whose checkpoints have the same name",
                folder.display()
            );
            return Err(Failure::new(Exit::BadInput, format!("{problem}\nhint: name a folder of its own")));
        }
        let lock = lock_folder(folder, "--checkpoint", "specimen", "wait for its end, or name another folder")?;
        let file = CheckpointFile::in_folder(folder);
        Ok(Self { folder: folder.to_owned(), file, blank, has_failed: false, _lock: lock })
    }

    /// What an earlier process of the same run has left; `None`, with a remark for people, if it has left nothing.
    ///
    /// # Errors
    /// Its checkpoint cannot be used, or belongs to another test.
    pub(super) fn earlier(&self) -> Result<Option<Kept>, Failure> {
        let unusable = |error: CheckpointError| Failure::new(Exit::BadInput, error);
        let (archive, damage) = match self.file.read().map_err(unusable)? {
            StoredCheckpoint::Nothing => {
                tell(format_args!("{} holds no checkpoint; starting from the beginning", self.folder.display()));
                return Ok(None);
            }
            StoredCheckpoint::Archive(archive, damage) => (archive, damage),
        };
        if let Some(damage) = damage {
            tell(format_args!("warning: {damage}; continuing from the checkpoint before it"));
        }
        let kept: Kept = archive.get(SECTION, VERSION).map_err(unusable)?;
        let mut found = changes(&kept.test, &self.blank.test);
        if kept.packing != self.blank.packing {
            found.push("packing: the content of the packing file is not the same".to_owned());
        }
        let (before, now) = (&kept.asked, &self.blank.asked);
        for (flag, is_same) in [
            ("--units", before.units == now.units),
            ("--pictures", before.pictures == now.pictures),
            ("--profiles", before.profiles == now.profiles),
            ("--fluctuations-from", before.fluctuations_from == now.fluctuations_from),
            ("--contacts", before.contacts == now.contacts),
        ] {
            if !is_same {
                found.push(format!("{flag}: the run was begun otherwise"));
            }
        }
        if !found.is_empty() {
            let text = format!(
                "the specimen in {} cannot be continued with another test:\n  {}\nhint: continue it as it was, or start \
                 again without --resume, which replaces the checkpoint",
                self.folder.display(),
                found.join("\n  ")
            );
            return Err(Failure::new(Exit::BadInput, text));
        }
        if kept.program != self.blank.program {
            tell(format_args!(
                "warning: the checkpoint was written by another build ({}, this is {}): the rest of the run may differ in the last \
                 digits from a run in one piece",
                kept.program, self.blank.program
            ));
        }
        Ok(Some(kept))
    }

    /// Writes a checkpoint. A disk that is full does not end the run: the checkpoint before is still there.
    pub(super) fn write(&mut self, now: Now<'_>) {
        let kept = Kept {
            table: now.table.to_vec(),
            frames: now.frames.to_vec(),
            start: now.start.to_vec(),
            profiles: now.profiles.cloned(),
            state: now.state.to_vec(),
            ..self.blank.clone()
        };
        let mut archive = Archive::new();
        archive.put(SECTION, VERSION, &kept);
        if let Err(error) = self.file.write(&archive)
            && !std::mem::replace(&mut self.has_failed, true)
        {
            tell(format_args!("warning: {error}; the run goes on"));
        }
    }

    /// Nothing is left to be continued.
    ///
    /// # Errors
    /// The system's refusal.
    pub(super) fn remove(&self) -> Result<(), Failure> {
        self.file.remove().map_err(|error| Failure::new(Exit::BadInput, error))
    }
}
