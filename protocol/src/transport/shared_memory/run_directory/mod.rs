//! Where a run is found by name, and where all its shared memory is accounted for.
//!
//! `/dev/shm/grainspan-<uid>/<run>/` belongs to one run. `run.json` tells workers whom they join, `i/` is iceoryx2's
//! root. Names of shared-memory segments do not contain the root, so each run also has its own prefix; root and prefix
//! together make runs invisible to each other. Directories are private to the user.

mod error;
mod record;
mod removal;
mod segments;
#[cfg(test)]
mod tests;

pub use error::RunError;
pub use record::{ChannelLimits, RunListing, RunRecord};
pub(super) use segments::{CleanupAfterEnd, SHARED_MEMORY, WORKER_ROOM, check_room, segments};

use super::ICEORYX2_VERSION;
use crate::{ContentId, PROTOCOL_VERSION};
use error::system;
use record::{pid_namespace, process_start, record_in};
use removal::{finish_removals, remove_dead};
use segments::{BASE_ROOM, remove_orphans, sweep};
use std::fs::{self, DirBuilder, File};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// A directory without a record is a run about to begin; older than this it is a run that never began.
const BIRTH: Duration = Duration::from_secs(10);

/// Root and prefix end up in the address of a Unix socket (108 bytes with iceoryx2's own part).
const ADDRESS_LIMIT: usize = 64;

/// Times in a row that other processes may remove the directory of all runs under our hands.
const MOST_REMOVALS: usize = 1000;

/// The directory of a run that this process has begun. Dropping it removes the directory and every segment of the run.
#[derive(Debug)]
pub struct RunDirectory {
    directory: PathBuf,
    record: RunRecord,
    /// Held until the process ends, however it ends: tells processes of other PID namespaces that the run lives.
    _lock: File,
}

impl RunDirectory {
    /// Shared memory that is free on this machine, bytes; `None` where the system does not tell, and where there is no limit.
    pub fn free_room() -> Option<u64> {
        segments::free_room()
    }

    /// Begins a run. What a dead run of the same name left is removed.
    ///
    /// # Errors
    /// [`RunError::Name`], [`RunError::Taken`], or the system's refusal.
    pub fn create(name: &str, limits: ChannelLimits) -> Result<Self, RunError> {
        check_name(name)?;
        check_room(BASE_ROOM + 2 * WORKER_ROOM)?;
        despite_removal(|| Self::begin(name, limits))
    }

    /// Makes the directory of a run, whose name is a good one.
    fn begin(name: &str, limits: ChannelLimits) -> Result<Self, RunError> {
        let base = base_directory()?;
        let directory = base.join(name);
        let root = directory.join("i");
        let prefix = format!("g{:08x}_", fresh_number() as u32);
        let length = root.as_os_str().len() + prefix.len();
        if length > ADDRESS_LIMIT {
            let reason = format!("it is {} characters too long", length - ADDRESS_LIMIT);
            return Err(RunError::Name { name: name.to_owned(), reason });
        }
        if let Err(error) = make_private_directory(&directory) {
            if error.kind() != ErrorKind::AlreadyExists {
                return Err(system("create", &directory)(error));
            }
            let listing = look_at_once_known(&base, name);
            if listing.alive {
                let pid = listing.record.map_or(0, |record| record.pid);
                return Err(RunError::Taken { name: name.to_owned(), pid });
            }
            // Another run may have begun meanwhile: then there is a directory again.
            remove_dead(&base, &listing);
            make_private_directory(&directory).map_err(system("create", &directory))?;
        }
        let lock = File::open(&directory).map_err(system("open", &directory))?;
        lock.lock().map_err(system("lock", &directory))?;
        let pid = std::process::id();
        let record = RunRecord {
            protocol: PROTOCOL_VERSION,
            iceoryx2: ICEORYX2_VERSION.to_owned(),
            name: name.to_owned(),
            pid,
            pid_started: process_start(pid).unwrap_or_default(),
            pid_namespace: pid_namespace(),
            prefix,
            root: root.clone(),
            limits,
            ready: false,
        };
        let run = Self { directory, record, _lock: lock };
        make_private_directory(&root).map_err(system("create", &root))?;
        run.write()?;
        Ok(run)
    }

    /// The record as workers read it.
    pub fn record(&self) -> &RunRecord {
        &self.record
    }

    /// Takes from others what iceoryx2 gives them: it makes one small file of each run that everybody may write.
    ///
    /// # Errors
    /// The system's refusal.
    pub(super) fn make_private(&self) -> Result<(), RunError> {
        for (path, metadata) in segments(&self.record.prefix) {
            let private = metadata.mode() & 0o700;
            if metadata.mode() & 0o777 != private {
                fs::set_permissions(&path, fs::Permissions::from_mode(private))
                    .map_err(system("make private", &path))?;
            }
        }
        Ok(())
    }

    /// Tells workers that they can join.
    ///
    /// # Errors
    /// The system's refusal to write the record.
    pub(super) fn announce(&mut self) -> Result<(), RunError> {
        self.record.ready = true;
        self.write()
    }

    /// The record of a living run that workers can join, or none while the run is still being set up.
    ///
    /// # Errors
    /// [`RunError::Unknown`] without such a run, [`RunError::Version`] if it was started by another version.
    pub fn open(name: &str) -> Result<Option<RunRecord>, RunError> {
        check_name(name)?;
        let listing = look_at(&despite_removal(base_directory)?, name);
        match listing.record {
            Some(record) if listing.alive => {
                check_version(&record)?;
                Ok(record.ready.then_some(record))
            }
            None if listing.alive => Ok(None),
            _ => {
                let living: Vec<String> =
                    Self::list()?.into_iter().filter(|run| run.alive).map(|run| run.name).collect();
                let living = if living.is_empty() { "none".to_owned() } else { living.join(", ") };
                Err(RunError::Unknown { name: name.to_owned(), living })
            }
        }
    }

    /// The record of a run that workers can join now; none if there is no such run, or not yet. Makes nothing and is
    /// cheap, for those who look often.
    ///
    /// # Errors
    /// [`RunError::Name`], [`RunError::Version`].
    pub fn find(name: &str) -> Result<Option<RunRecord>, RunError> {
        check_name(name)?;
        let listing = look_at(&base_path(), name);
        let Some(record) = listing.record.filter(|_| listing.alive) else { return Ok(None) };
        check_version(&record)?;
        Ok(record.ready.then_some(record))
    }

    /// All runs of this user, dead ones included, by name.
    ///
    /// # Errors
    /// The system's refusal to read the directory.
    pub fn list() -> Result<Vec<RunListing>, RunError> {
        let (base, entries) = despite_removal(|| {
            let base = base_directory()?;
            let entries = fs::read_dir(&base).map_err(system("read", &base))?;
            Ok((base, entries))
        })?;
        let mut names: Vec<String> = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok()).collect();
        // What is just being removed has a name that no run can have.
        names.retain(|name| check_name(name).is_ok());
        names.sort();
        Ok(names.iter().map(|name| look_at(&base, name)).collect())
    }

    /// Removes what a dead run left; false if the run lives and was left alone.
    ///
    /// # Errors
    /// [`RunError::Name`].
    pub fn remove(name: &str) -> Result<bool, RunError> {
        // Two threads of a worker may see its macro die and end the process when they are done: neither may do so while the other
        // is half way, or a folder without its record would stay, which everybody takes for a run that is about to begin.
        static SWEEPING: Mutex<()> = Mutex::new(());
        let _alone = SWEEPING.lock().unwrap_or_else(PoisonError::into_inner);
        check_name(name)?;
        let base = despite_removal(base_directory)?;
        let listing = look_at(&base, name);
        Ok(!listing.alive && remove_dead(&base, &listing))
    }

    /// Waits until the macro of a run has died, then removes what it left. For a worker that knows its macro is dying: the
    /// system tells a child of that a moment before the process list shows it.
    ///
    /// Returns whether the run is dead (and removed) within `timeout`.
    ///
    /// # Errors
    /// As [`RunDirectory::remove`].
    pub fn remove_once_dead(name: &str, timeout: Duration) -> Result<bool, RunError> {
        let begun = std::time::Instant::now();
        loop {
            let removed = Self::remove(name)?;
            if removed || begun.elapsed() >= timeout {
                return Ok(removed);
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Removes what all dead runs of this user left and returns their names, then those of segments that no run claims.
    ///
    /// # Errors
    /// As [`RunDirectory::list`].
    pub fn clean() -> Result<Vec<String>, RunError> {
        let mut dead: Vec<String> = Self::list()?.into_iter().filter(|run| !run.alive).map(|run| run.name).collect();
        for name in &dead {
            Self::remove(name)?;
        }
        finish_removals(&base_path());
        dead.extend(remove_orphans());
        let _ = fs::remove_dir(base_path());
        Ok(dead)
    }

    /// Readers see the old record or the new one, never a part.
    fn write(&self) -> Result<(), RunError> {
        let path = self.directory.join("run.json");
        let draft = self.directory.join("run.json.new");
        let text = serde_json::to_vec_pretty(&self.record).expect("a record has no unserialisable parts");
        fs::write(&draft, text).map_err(system("write", &draft))?;
        fs::rename(&draft, &path).map_err(system("write", &path))
    }
}

impl Drop for RunDirectory {
    fn drop(&mut self) {
        sweep(&self.directory, Some(&self.record.prefix));
        // Another run of this user may be using it: then it is not empty and stays.
        let _ = fs::remove_dir(base_path());
    }
}

fn look_at(base: &Path, name: &str) -> RunListing {
    let directory = base.join(name);
    let record = record_in(&directory);
    let alive = match &record {
        Some(record) => record.is_alive(),
        None => fs::metadata(&directory)
            .and_then(|metadata| metadata.modified())
            .is_ok_and(|time| time.elapsed().is_ok_and(|age| age < BIRTH)),
    };
    RunListing { name: name.to_owned(), record, alive }
}

/// As [`look_at`], but waits while a folder is too young to lack a record: it gets one soon, or belongs to nobody. Someone who took it for that
/// of a dead run of this name may have moved it aside and back, so that whoever made it has begun again and now meets their own folder.
fn look_at_once_known(base: &Path, name: &str) -> RunListing {
    let begun = std::time::Instant::now();
    loop {
        let listing = look_at(base, name);
        if !listing.alive || listing.record.is_some() || begun.elapsed() > BIRTH {
            return listing;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn check_version(record: &RunRecord) -> Result<(), RunError> {
    if record.protocol == PROTOCOL_VERSION && record.iceoryx2 == ICEORYX2_VERSION {
        return Ok(());
    }
    Err(RunError::Version {
        name: record.name.clone(),
        found_protocol: record.protocol,
        found_iceoryx2: record.iceoryx2.clone(),
        prefix: record.prefix.clone(),
    })
}

fn check_name(name: &str) -> Result<(), RunError> {
    let sound = |letter: char| letter.is_ascii_alphanumeric() || "-_.".contains(letter);
    if !name.is_empty() && !name.starts_with('.') && name.chars().all(sound) {
        return Ok(());
    }
    let reason = "use letters, digits, `-`, `_` and `.`, not beginning with `.`".to_owned();
    Err(RunError::Name { name: name.to_owned(), reason })
}

fn base_path() -> PathBuf {
    Path::new(SHARED_MEMORY).join(format!("grainspan-{}", rustix::process::getuid().as_raw()))
}

/// Does what needs the directory of all runs, which goes with the last of them at any moment until somebody's run is in it.
fn despite_removal<T>(act: impl Fn() -> Result<T, RunError>) -> Result<T, RunError> {
    for _ in 0..MOST_REMOVALS {
        match act() {
            Err(RunError::System { source, .. }) if source.kind() == ErrorKind::NotFound => {}
            result => return result,
        }
    }
    act()
}

/// The directory of all runs of this user; refused when somebody else has made it.
fn base_directory() -> Result<PathBuf, RunError> {
    let base = base_path();
    match make_private_directory(&base) {
        Err(error) if error.kind() != ErrorKind::AlreadyExists => return Err(system("create", &base)(error)),
        _ => {}
    }
    check_private(&base)?;
    Ok(base)
}

/// Refuses a directory that somebody else owns or may write to: who can rename a run's directory can put another one there.
fn check_private(base: &Path) -> Result<(), RunError> {
    let owner = fs::symlink_metadata(base).map_err(system("read", base))?;
    let refuse = |reason: String| system("use", base)(io::Error::new(ErrorKind::PermissionDenied, reason));
    if !owner.is_dir() || owner.uid() != rustix::process::getuid().as_raw() {
        return Err(refuse("it belongs to another user; ask them to remove it".to_owned()));
    }
    let mode = owner.mode() & 0o777;
    if mode & 0o022 != 0 {
        let path = base.display();
        return Err(refuse(format!("others may write to it (mode {mode:o}); `chmod 700 {path}` makes it private")));
    }
    Ok(())
}

fn make_private_directory(path: &Path) -> io::Result<()> {
    DirBuilder::new().mode(0o700).create(path)
}

/// A number that no other process or thread draws: names senders and prefixes.
pub(super) fn fresh_number() -> u64 {
    static DRAWN: AtomicU64 = AtomicU64::new(0);
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos());
    let seed = format!("{} {now} {}", std::process::id(), DRAWN.fetch_add(1, Ordering::Relaxed));
    let id = ContentId::of(seed.as_bytes());
    u64::from_le_bytes(id.0[..8].try_into().expect("eight of sixteen bytes"))
}
