//! The output folder of a run: reading of files that may be missing or half written, and paths that stay inside.

use crate::error::PageError;
use crate::stamp::{Remembered, Stamp};
use std::fs;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

/// Remedy of a folder that is none of a run.
const HINT: &str = "hint: give the folder that `grainspan run` names at its end, such as out/biaxial";

/// The output folder of a run.
#[derive(Clone, Debug)]
pub struct RunFolder {
    path: PathBuf,
    /// Steps that files of cells tell: a live page asks for them every second.
    steps: Arc<Remembered<Option<u64>>>,
}

impl RunFolder {
    /// A folder that a run has written to.
    ///
    /// # Errors
    /// It does not exist, or holds neither a scene nor a history.
    pub fn open(path: &Path) -> Result<Self, PageError> {
        let whole = path.canonicalize().map_err(|error| PageError(format!("{}: {error}\n{HINT}", path.display())))?;
        if ["scene.toml", "history.csv"].iter().any(|name| whole.join(name).is_file()) {
            return Ok(Self { path: whole, steps: Arc::default() });
        }
        Err(PageError(format!(
            "{} is no run's output: it has neither scene.toml nor history.csv\n{HINT}",
            path.display()
        )))
    }

    /// Where it lies; absolute.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its last part.
    pub fn name(&self) -> String {
        self.path.file_name().map_or_else(|| "run".to_owned(), |name| name.to_string_lossy().into_owned())
    }

    /// The text of a file; `None` if it is missing or cannot be read now.
    pub(crate) fn text(&self, name: &str) -> Option<String> {
        fs::read(self.path.join(name)).ok().map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
    }

    /// The complete lines of a file that grows.
    pub(crate) fn complete_lines(&self, name: &str) -> String {
        let mut text = self.text(name).unwrap_or_default();
        text.truncate(text.rfind('\n').map_or(0, |end| end + 1));
        text
    }

    /// The JSON of a file; `None` if it is missing or not whole.
    pub(crate) fn json(&self, name: &str) -> Option<serde_json::Value> {
        serde_json::from_str(&self.text(name)?).ok()
    }

    /// The entry `step` of a JSON file, which is read again only when it has changed; `None` if it is missing or not whole.
    pub(crate) fn step(&self, name: &str) -> Option<u64> {
        self.steps.of(&self.path.join(name), || self.json(name)?.get("step")?.as_u64()).flatten()
    }

    /// Tells one run into the folder from the next: a run that begins writes its scene again, one that continues leaves it.
    pub(crate) fn run(&self) -> String {
        Stamp::of(&self.path.join("scene.toml")).map_or_else(String::new, |stamp| format!("{stamp:?}"))
    }

    /// Length of a file in bytes, 0 if it is missing: tells whether it has changed.
    pub(crate) fn length(&self, name: &str) -> u64 {
        fs::metadata(self.path.join(name)).map_or(0, |known| known.len())
    }

    /// A file below the folder by its relative path; `None` for what lies elsewhere, also by a link, for hidden files and for
    /// what is no file.
    pub(crate) fn file(&self, relative: &str) -> Option<PathBuf> {
        let relative = Path::new(relative);
        let plain = |part: Component<'_>| match part {
            Component::Normal(name) => !name.to_string_lossy().starts_with('.'),
            _ => false,
        };
        if relative.as_os_str().is_empty() || !relative.components().all(plain) {
            return None;
        }
        let path = self.path.join(relative).canonicalize().ok()?;
        (path.starts_with(&self.path) && path.is_file()).then_some(path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_stay_inside() {
        let place = tempfile::tempdir().unwrap();
        let run = place.path().join("run");
        fs::create_dir_all(run.join("fields")).unwrap();
        assert!(RunFolder::open(&run).unwrap_err().0.contains("no run's output"));
        fs::write(run.join("scene.toml"), "").unwrap();
        fs::write(run.join("fields/a.vtu"), "inside").unwrap();
        fs::write(run.join(".hidden"), "hidden").unwrap();
        fs::write(place.path().join("secret"), "outside").unwrap();
        std::os::unix::fs::symlink(place.path().join("secret"), run.join("link")).unwrap();
        let folder = RunFolder::open(&run).unwrap();
        assert!(folder.file("fields/a.vtu").is_some());
        for bad in
            ["../secret", "fields/../../secret", "/etc/passwd", "link", ".hidden", "fields", "", "./scene.toml/.."]
        {
            assert_eq!(folder.file(bad), None, "{bad}");
        }
    }

    #[test]
    fn half_written_files_are_cut_back_or_left_out() {
        let place = tempfile::tempdir().unwrap();
        fs::write(place.path().join("scene.toml"), "").unwrap();
        fs::write(place.path().join("history.csv"), "a,b\n1,2\n3").unwrap();
        fs::write(place.path().join("summary.json"), "{\"status\":").unwrap();
        let folder = RunFolder::open(place.path()).unwrap();
        assert_eq!(folder.complete_lines("history.csv"), "a,b\n1,2\n");
        assert_eq!(folder.json("summary.json"), None);
        assert_eq!(folder.complete_lines("none"), "");
    }
}
