//! Requests to a run: files in `control/` of its output folder, which it looks at after every accepted step.
//!
//! A request is a file with a fixed name; the run removes it when it has carried it out. `pause` stays until it is removed by
//! `resume`. Whatever is asked for, the results of the run keep their bytes.

use crate::error::PageError;
use macro_solver::output::write_without_flush;
use std::fs;
use std::path::{Path, PathBuf};

/// Folder of the requests.
const FOLDER: &str = "control";

/// A file that a run keeps in the folder while it is paused.
pub const PAUSED: &str = "paused";

/// A file that a run without checkpoints keeps in the folder.
pub const NO_CHECKPOINTS: &str = "no-checkpoints";

/// A file that a run keeps in the folder from a request to save its state that failed until the next one; its text is the reason.
pub const NOT_SAVED: &str = "not-saved";

/// What a run can be asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Wait after the step, with the state saved.
    Pause,
    /// Go on.
    Resume,
    /// Save the state.
    Checkpoint,
    /// End after the step, with the state saved: `--resume` continues.
    Stop,
}

impl Action {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Pause, Self::Resume, Self::Checkpoint, Self::Stop];

    /// Its name on the command line and, with the exception of `resume`, as a file.
    pub fn keyword(self) -> &'static str {
        match self {
            Self::Pause => "pause",
            Self::Resume => "resume",
            Self::Checkpoint => "checkpoint",
            Self::Stop => "stop",
        }
    }
}

/// The requests in one output folder: both sides use it.
#[derive(Clone, Debug)]
pub struct Controls {
    folder: PathBuf,
}

impl Controls {
    /// The requests of the run that writes to `output`.
    pub fn of(output: &Path) -> Self {
        Self { folder: output.join(FOLDER) }
    }

    /// Removes all requests: those of a run that has ended concern no other.
    pub fn clear(&self) {
        // What cannot be removed is found again by the first look, which reports it.
        let _ = fs::remove_dir_all(&self.folder);
    }

    /// Makes a request.
    ///
    /// # Errors
    /// The folder cannot be written to.
    pub fn request(&self, action: Action) -> Result<(), PageError> {
        match action {
            Action::Resume => self.done(Action::Pause.keyword()),
            other @ (Action::Pause | Action::Checkpoint | Action::Stop) => self.put(other.keyword()),
        }
    }

    /// Requests the cell of a Gauss point.
    ///
    /// # Errors
    /// The folder cannot be written to.
    pub fn request_cell(&self, point: usize) -> Result<(), PageError> {
        self.put(&format!("{CELL}{point}"))
    }

    /// Whether a request is there.
    pub fn asks(&self, action: Action) -> bool {
        self.has(action.keyword())
    }

    /// Whether a file is there.
    pub fn has(&self, name: &str) -> bool {
        self.folder.join(name).exists()
    }

    /// Gauss points whose cells are requested, ascending.
    pub fn cells(&self) -> Vec<usize> {
        let entries = fs::read_dir(&self.folder).into_iter().flatten().flatten();
        let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
        let mut points: Vec<usize> = names.filter_map(|name| name.strip_prefix(CELL)?.parse().ok()).collect();
        points.sort_unstable();
        points
    }

    /// Text of a file, if it is there.
    pub fn text(&self, name: &str) -> Option<String> {
        fs::read_to_string(self.folder.join(name)).ok()
    }

    /// Puts an empty file there.
    ///
    /// # Errors
    /// The folder cannot be written to.
    pub fn put(&self, name: &str) -> Result<(), PageError> {
        self.put_text(name, "")
    }

    /// Puts a file there, whole: the other process never reads a part of it.
    ///
    /// # Errors
    /// The folder cannot be written to.
    pub fn put_text(&self, name: &str, text: &str) -> Result<(), PageError> {
        let path = self.folder.join(name);
        let failed =
            |error: &dyn std::fmt::Display| PageError(format!("could not write {}: {error}", path.display()));
        fs::create_dir_all(&self.folder).map_err(|error| failed(&error))?;
        write_without_flush(&path, text.as_bytes()).map_err(|error| failed(&error))
    }

    /// Removes a file; a request is done.
    ///
    /// # Errors
    /// It is there and cannot be removed.
    pub fn done(&self, name: &str) -> Result<(), PageError> {
        let path = self.folder.join(name);
        match fs::remove_file(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(PageError(format!("could not remove {}: {error}", path.display())))
            }
            _ => Ok(()),
        }
    }

    /// A request for a cell is done.
    ///
    /// # Errors
    /// It is there and cannot be removed.
    pub fn cell_done(&self, point: usize) -> Result<(), PageError> {
        self.done(&format!("{CELL}{point}"))
    }
}

/// Beginning of the names of requests for cells.
const CELL: &str = "cell-";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_stay_until_they_are_done() {
        let place = tempfile::tempdir().unwrap();
        let controls = Controls::of(place.path());
        assert!(!controls.asks(Action::Pause) && controls.cells().is_empty());
        controls.request(Action::Pause).unwrap();
        controls.request_cell(12).unwrap();
        controls.request_cell(3).unwrap();
        assert!(controls.asks(Action::Pause));
        assert_eq!(controls.cells(), [3, 12]);
        controls.request(Action::Resume).unwrap();
        controls.cell_done(3).unwrap();
        assert!(!controls.asks(Action::Pause));
        assert_eq!(controls.cells(), [12]);
        controls.clear();
        assert!(controls.cells().is_empty());
        controls.request(Action::Resume).unwrap();
    }
}
