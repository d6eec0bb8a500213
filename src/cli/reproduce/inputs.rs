//! Where scenes and packings lie: in a copy of the repository, or where a package has put them.

use super::error::ReproduceError;
use std::path::{Path, PathBuf};

/// The folder that holds `scenes` and `packings`.
#[derive(Clone, Debug)]
pub(super) struct Inputs {
    folder: PathBuf,
}

impl Inputs {
    /// The folder given, or the first one found: the current folder and those above it, those above the program, and the
    /// `share/grainspan` of an installation.
    ///
    /// # Errors
    /// There is none.
    pub(super) fn find(given: Option<&Path>) -> Result<Self, ReproduceError> {
        let candidates = match given {
            Some(folder) => vec![folder.to_owned()],
            None => candidates(),
        };
        let found = candidates.iter().find(|folder| is_complete(folder));
        let places = || candidates.iter().map(|folder| folder.display().to_string()).collect::<Vec<_>>().join(", ");
        found.map(|folder| Self { folder: folder.clone() }).ok_or_else(|| ReproduceError::NoInputs(places()))
    }

    /// A file, named from the folder that holds `scenes`.
    pub(super) fn file(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// The folder that holds `scenes`.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }
}

fn is_complete(folder: &Path) -> bool {
    folder.join("scenes/liu2018").is_dir() && folder.join("packings").is_dir()
}

fn candidates() -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> =
        std::env::current_dir().iter().flat_map(|folder| folder.ancestors().map(Path::to_owned)).collect();
    if let Ok(program) = std::env::current_exe() {
        found.extend(program.ancestors().skip(1).map(Path::to_owned));
        found.extend(program.ancestors().skip(2).map(|folder| folder.join("share/grainspan")));
    }
    found
}
