//! Whether a file has changed, and what was read from it while it has not.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// A file at one time: its number, when it was written, s and ns, and its length, bytes. A file that is replaced by another has another
/// number, whatever the clock of the file system resolves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Stamp([i64; 4]);

impl Stamp {
    /// Of a file; `None` if it is missing.
    pub(crate) fn of(path: &Path) -> Option<Self> {
        let known = fs::metadata(path).ok()?;
        Some(Self([known.ino().cast_signed(), known.mtime(), known.mtime_nsec(), known.size().cast_signed()]))
    }
}

/// What was read from files, until they change.
#[derive(Debug)]
pub(crate) struct Remembered<T>(Mutex<BTreeMap<PathBuf, (Stamp, T)>>);

impl<T> Default for Remembered<T> {
    fn default() -> Self {
        Self(Mutex::default())
    }
}

impl<T: Clone> Remembered<T> {
    /// What `read` finds in the file, or has found there before; `None` if it is missing.
    pub(crate) fn of(&self, path: &Path, read: impl FnOnce() -> T) -> Option<T> {
        let stamp = Stamp::of(path)?;
        let known = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, found)) = known().get(path).filter(|(of, _)| *of == stamp) {
            return Some(found.clone());
        }
        // The stamp is older than what is read: a file that changes in between is read once more.
        let found = read();
        known().insert(path.to_owned(), (stamp, found.clone()));
        Some(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_again_only_when_it_has_changed() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("a");
        let remembered = Remembered::default();
        let mut reads = 0;
        let mut text = || {
            remembered.of(&path, || {
                reads += 1;
                fs::read_to_string(&path).unwrap()
            })
        };
        assert_eq!(text(), None);
        fs::write(&path, "one").unwrap();
        assert_eq!([text(), text()], [Some("one".to_owned()), Some("one".to_owned())]);
        fs::write(&path, "longer").unwrap();
        assert_eq!(text().as_deref(), Some("longer"));
        // As the files of a run are written: another file takes the name.
        fs::write(path.with_extension("new"), "latest").unwrap();
        fs::rename(path.with_extension("new"), &path).unwrap();
        assert_eq!(text().as_deref(), Some("latest"));
        fs::remove_file(&path).unwrap();
        assert_eq!(text(), None);
        assert_eq!(reads, 3);
    }
}
