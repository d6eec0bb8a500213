//! The shared-memory segments of runs: whose they are, whether there is room for more, and the removal of those that dead runs left.

use super::BIRTH;
use super::error::RunError;
use super::record::{RunRecord, record_in};
use std::fs;
use std::io::ErrorKind;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Where POSIX shared memory lives on Linux; a directory in memory, so joining a run takes a millisecond.
pub(in crate::transport::shared_memory) const SHARED_MEMORY: &str = "/dev/shm";

/// Reserve, bytes: enough for the small files that iceoryx2 makes.
const RESERVE: u64 = 128 << 10;

/// Memory of a run and of each worker before any message, bytes; measured: 80 kB and 160 kB.
pub(super) const BASE_ROOM: u64 = 256 << 10;

/// See [`BASE_ROOM`].
pub(in crate::transport::shared_memory) const WORKER_ROOM: u64 = 256 << 10;

/// Removes what a worker has made in the memory of a run that had ended meanwhile: a worker that is just joining may
/// make folders and files again while the macro removes them. While the run lives nothing happens.
#[derive(Debug)]
pub(in crate::transport::shared_memory) struct CleanupAfterEnd(pub(in crate::transport::shared_memory) RunRecord);

impl Drop for CleanupAfterEnd {
    fn drop(&mut self) {
        self.sweep();
    }
}

impl CleanupAfterEnd {
    /// See [`CleanupAfterEnd`].
    pub(in crate::transport::shared_memory) fn sweep(&self) {
        let Some(directory) = self.0.root.parent() else { return };
        if record_in(directory).is_some_and(|record| record.prefix == self.0.prefix) {
            return;
        }
        // No other run has this prefix, not even one of the same name.
        remove_segments(&self.0.prefix);
        let orphaned = || {
            let inode = fs::metadata(directory).ok()?.ino();
            (!directory.join("run.json").exists()).then_some(inode)
        };
        // A run of the same name may be about to begin: it has its record within this time.
        let first = orphaned();
        if first.is_some() {
            std::thread::sleep(Duration::from_millis(50));
        }
        if first.is_some() && orphaned() == first {
            sweep(directory, Some(&self.0.prefix));
        }
    }
}

/// Checks that shared memory has room for `bytes` bytes, and for what others may take at the same moment.
///
/// # Errors
/// [`RunError::Room`].
pub(in crate::transport::shared_memory) fn check_room(bytes: u64) -> Result<(), RunError> {
    let needed = bytes + RESERVE;
    match free_room() {
        Some(free) if free < needed => Err(RunError::Room { free, needed }),
        _ => Ok(()),
    }
}

/// Free shared memory, bytes; `None` where the system does not tell, and where there is no limit.
pub(super) fn free_room() -> Option<u64> {
    let room = rustix::fs::statvfs(SHARED_MEMORY).ok()?;
    // A file system without a limit shows no blocks at all.
    (room.f_blocks > 0).then(|| room.f_bavail.saturating_mul(room.f_frsize))
}

/// Shared-memory files whose names begin with `prefix`, with their metadata.
pub(in crate::transport::shared_memory) fn segments(prefix: &str) -> impl Iterator<Item = (PathBuf, fs::Metadata)> {
    let entries = fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
    let prefix = prefix.to_owned();
    entries.filter_map(move |entry| {
        let ours = entry.file_name().to_str()?.starts_with(&prefix);
        let metadata = ours.then(|| entry.metadata().ok()).flatten()?;
        Some((entry.path(), metadata))
    })
}

/// Removes a run's segments and directory. Best effort: whatever is already gone is as wanted.
pub(super) fn sweep(directory: &Path, prefix: Option<&str>) {
    if let Some(prefix) = prefix {
        remove_segments(prefix);
    }
    // A worker that is just joining may put something into a folder that has been emptied.
    for _ in 0..5 {
        match fs::remove_dir_all(directory) {
            Err(error) if error.kind() == ErrorKind::DirectoryNotEmpty => {}
            _ => return,
        }
    }
}

/// Removes all segments of a prefix, if it is one: an empty prefix would match everybody's segments.
fn remove_segments(prefix: &str) {
    if prefix_of(prefix) == Some(prefix) {
        for (path, _) in segments(prefix) {
            let _ = fs::remove_file(path);
        }
    }
}

/// The part of a segment's name that tells its run: `g`, eight hexadecimal digits, `_`.
pub(super) fn prefix_of(name: &str) -> Option<&str> {
    let digit = |letter: u8| letter.is_ascii_digit() || (b'a'..=b'f').contains(&letter);
    let prefix = name.get(..10)?;
    let bytes = prefix.as_bytes();
    (bytes[0] == b'g' && bytes[9] == b'_' && bytes[1..9].iter().copied().all(digit)).then_some(prefix)
}

/// Removes segments of this user that no run claims and no process maps, and returns their prefixes. A process that is killed
/// while it closes its channels may make one anew after its run was removed.
pub(super) fn remove_orphans() -> Vec<String> {
    let own = rustix::process::getuid().as_raw();
    let is_old =
        |metadata: &fs::Metadata| metadata.modified().is_ok_and(|time| time.elapsed().is_ok_and(|age| age >= BIRTH));
    let unclaimed = |prefix: &str, claimed: &[String]| !claimed.iter().any(|one| one == prefix);
    let mut found: Vec<(PathBuf, String)> = segments("g")
        .filter(|(_, metadata)| metadata.is_file() && metadata.uid() == own && is_old(metadata))
        .filter_map(|(path, _)| {
            let prefix = prefix_of(path.file_name()?.to_str()?)?.to_owned();
            Some((path, prefix))
        })
        .collect();
    if found.is_empty() {
        return Vec::new();
    }
    // Looked at afterwards: a run has its record before it has its first segment.
    let claimed = claimed_prefixes();
    found.retain(|(path, prefix)| unclaimed(prefix, &claimed) && !is_mapped(path));
    let mut prefixes: Vec<String> = found
        .into_iter()
        .filter(|(path, _)| fs::remove_file(path).is_ok())
        .map(|(_, prefix)| format!("{prefix}*"))
        .collect();
    prefixes.sort();
    prefixes.dedup();
    prefixes
}

/// Prefixes of all runs that can be seen; in a container the same user may have another number.
fn claimed_prefixes() -> Vec<String> {
    let children = |path: &Path| fs::read_dir(path).into_iter().flatten().flatten().map(|entry| entry.path());
    let bases = children(Path::new(SHARED_MEMORY))
        .filter(|path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("grainspan-")));
    bases.flat_map(|base| children(&base)).filter_map(|run| Some(record_in(&run)?.prefix)).collect()
}

/// Whether a process that can be seen has the file in its memory.
fn is_mapped(path: &Path) -> bool {
    let Some(path) = path.to_str() else { return true };
    let processes = fs::read_dir("/proc").into_iter().flatten().flatten();
    processes.filter_map(|entry| fs::read_to_string(entry.path().join("maps")).ok()).any(|maps| maps.contains(path))
}
