//! Where a run is found by name, and where all its shared memory is accounted for.
//!
//! `/dev/shm/grainspan-<uid>/<run>/` belongs to one run. `run.json` tells workers whom they join, `i/` is iceoryx2's
//! root. Names of shared-memory segments do not contain the root, so each run also has its own prefix; root and prefix
//! together make runs invisible to each other. Directories are private to the user.

use super::ICEORYX2_VERSION;
use super::waiting::Waiting;
use crate::{ContentId, PROTOCOL_VERSION};
use serde::{Deserialize, Serialize};
use std::fs::{self, DirBuilder, File, TryLockError};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use thiserror::Error;

/// Where POSIX shared memory lives on Linux; a directory in memory, so joining a run takes a millisecond.
pub(super) const SHARED_MEMORY: &str = "/dev/shm";

/// Root and prefix end up in the address of a Unix socket (108 bytes with iceoryx2's own part).
const ADDRESS_LIMIT: usize = 64;

/// What is never used up, bytes: enough for the small files that iceoryx2 makes.
const RESERVE: u64 = 128 << 10;

/// What a run takes for itself and for each worker before it carries anything, bytes; measured: 80 kB and 160 kB.
const BASE_ROOM: u64 = 256 << 10;

/// See [`BASE_ROOM`].
pub(super) const WORKER_ROOM: u64 = 256 << 10;

/// A directory without a record is a run about to begin; older than this it is a run that never began.
const BIRTH: Duration = Duration::from_secs(10);

/// Why a run cannot be made or found.
#[derive(Debug, Error)]
pub enum RunError {
    /// The name cannot be part of a path, or is too long for the system's socket addresses.
    #[error("`{name}` cannot be the name of a run: {reason}")]
    Name {
        /// The name.
        name: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A living run has the name.
    #[error("a run named `{name}` is alive (process {pid}); choose another name or end that run")]
    Taken {
        /// The name.
        name: String,
        /// Process of its macro.
        pid: u32,
    },
    /// No living run has the name.
    #[error("no run named `{name}` is alive; living runs: {living}")]
    Unknown {
        /// The name.
        name: String,
        /// Names of those that are, for the reader.
        living: String,
    },
    /// The run was started by another version of this program.
    #[error(
        "run `{name}` speaks protocol {found_protocol} over iceoryx2 {found_iceoryx2}, but this program speaks protocol \
         {PROTOCOL_VERSION} over iceoryx2 {ICEORYX2_VERSION}; start macro and workers from the same build of grainspan"
    )]
    Version {
        /// The name.
        name: String,
        /// Protocol version of the run.
        found_protocol: u32,
        /// iceoryx2 version of the run.
        found_iceoryx2: String,
        /// Its prefix of shared-memory names, which tells it from later runs of the name.
        prefix: String,
    },
    /// Shared memory is full. Writing to memory that the system cannot provide would end the process without a word.
    #[error(
        "shared memory is full: {} kB are free in /dev/shm and {} kB are needed; `grainspan clean` removes what dead runs \
         have left, a container gets more with --shm-size",
        free / 1024, needed / 1024
    )]
    Room {
        /// Bytes that are free.
        free: u64,
        /// Bytes that are needed.
        needed: u64,
    },
    /// The operating system refused.
    #[error("could not {action} `{}`: {source}", path.display())]
    System {
        /// What was tried.
        action: &'static str,
        /// On what.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
}

/// How much a run's channel carries, and how its ends wait. Memory is reserved by address and used only as touched.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ChannelLimits {
    /// Largest message, bytes: a job slice or its replies with all snapshots.
    pub message_bytes: u64,
    /// Workers at the same time, the not yet cleaned up dead ones included.
    pub workers: u32,
    /// How both ends wait for messages.
    #[serde(default)]
    pub waiting: Waiting,
}

impl Default for ChannelLimits {
    fn default() -> Self {
        Self { message_bytes: 4 << 20, workers: 64, waiting: Waiting::default() }
    }
}

/// What a worker must know to join a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunRecord {
    /// [`PROTOCOL_VERSION`] of the macro.
    pub protocol: u32,
    /// Version of iceoryx2; every process of a run needs the same one.
    pub iceoryx2: String,
    /// Name of the run.
    pub name: String,
    /// Process of the macro.
    pub pid: u32,
    /// When that process started, clock ticks since boot: tells it from a later process with the same number.
    pub pid_started: u64,
    /// The kernel's name of the PID namespace in which that number holds; none in records of older programs.
    #[serde(default)]
    pub pid_namespace: Option<String>,
    /// Prefix of all shared-memory names of the run.
    pub prefix: String,
    /// iceoryx2's root directory.
    pub root: PathBuf,
    /// Capacity.
    pub limits: ChannelLimits,
    /// Whether the services exist, so that a worker can join.
    pub ready: bool,
}

impl RunRecord {
    /// Whether the macro's process lives. Process numbers of another container that shares `/dev/shm` say nothing here; the
    /// lock that the macro holds on its directory is seen by all.
    pub fn is_alive(&self) -> bool {
        if self.is_foreign() {
            return self.root.parent().is_some_and(is_locked);
        }
        process_start(self.pid) == Some(self.pid_started)
    }

    /// Whether the macro lives in another PID namespace: its process cannot be watched from here.
    pub fn is_foreign(&self) -> bool {
        let own = pid_namespace();
        self.pid_namespace.is_some() && own.is_some() && self.pid_namespace != own
    }
}

/// One entry of [`RunDirectory::list`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunListing {
    /// Name of the run.
    pub name: String,
    /// Its record, if one can be read.
    pub record: Option<RunRecord>,
    /// Whether its macro lives (or may be about to begin).
    pub alive: bool,
}

/// The directory of a run that this process has begun. Dropping it removes the directory and every segment of the run.
#[derive(Debug)]
pub struct RunDirectory {
    directory: PathBuf,
    record: RunRecord,
    /// Held until the process ends, however it ends: tells processes of other PID namespaces that the run lives.
    _lock: File,
}

impl RunDirectory {
    /// Begins a run. What a dead run of the same name left is removed.
    ///
    /// # Errors
    /// [`RunError::Name`], [`RunError::Taken`], or the system's refusal.
    pub fn create(name: &str, limits: ChannelLimits) -> Result<Self, RunError> {
        check_name(name)?;
        check_room(BASE_ROOM + 2 * WORKER_ROOM)?;
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
            let listing = look_at(&base, name);
            if listing.alive {
                let pid = listing.record.map_or(0, |record| record.pid);
                return Err(RunError::Taken { name: name.to_owned(), pid });
            }
            sweep(&directory, listing.record.as_ref().map(|record| record.prefix.as_str()));
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

    /// What workers read.
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
        let listing = look_at(&base_directory()?, name);
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
        let base = base_directory()?;
        let mut names: Vec<String> = fs::read_dir(&base)
            .map_err(system("read", &base))?
            .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
            .collect();
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
        let base = base_directory()?;
        let listing = look_at(&base, name);
        if !listing.alive {
            sweep(&base.join(name), listing.record.as_ref().map(|record| record.prefix.as_str()));
        }
        Ok(!listing.alive)
    }

    /// Waits until the macro of a run has died, then removes what it left. For a worker that knows its macro is dying: the
    /// system tells a child of that a moment before the process list shows it.
    ///
    /// Returns whether the run is dead (and removed) within `patience`.
    ///
    /// # Errors
    /// As [`RunDirectory::remove`].
    pub fn remove_once_dead(name: &str, patience: Duration) -> Result<bool, RunError> {
        let begun = std::time::Instant::now();
        loop {
            let removed = Self::remove(name)?;
            if removed || begun.elapsed() >= patience {
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

/// Removes what a worker has made in the memory of a run that had ended meanwhile: a worker that is just joining makes
/// folders and files anew behind the back of a macro that removes them. While the run lives nothing happens.
#[derive(Debug)]
pub(super) struct Latecomer(pub(super) RunRecord);

impl Drop for Latecomer {
    fn drop(&mut self) {
        self.sweep();
    }
}

impl Latecomer {
    /// See [`Latecomer`].
    pub(super) fn sweep(&self) {
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

/// Checks that shared memory has room for so many bytes, and for what others may take at the same moment.
///
/// # Errors
/// [`RunError::Room`].
pub(super) fn check_room(bytes: u64) -> Result<(), RunError> {
    let needed = bytes + RESERVE;
    // Where the system does not tell, there is nothing to check.
    let Ok(room) = rustix::fs::statvfs(SHARED_MEMORY) else { return Ok(()) };
    let free = room.f_bavail.saturating_mul(room.f_frsize);
    // A file system without a limit shows no blocks at all.
    if room.f_blocks == 0 || free >= needed { Ok(()) } else { Err(RunError::Room { free, needed }) }
}

/// A number that no other process or thread draws: names senders and prefixes.
pub(super) fn fresh_number() -> u64 {
    static DRAWN: AtomicU64 = AtomicU64::new(0);
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos());
    let seed = format!("{} {now} {}", std::process::id(), DRAWN.fetch_add(1, Ordering::Relaxed));
    let id = ContentId::of(seed.as_bytes());
    u64::from_le_bytes(id.0[..8].try_into().expect("eight of sixteen bytes"))
}

/// Shared-memory files whose names begin with `prefix`, with their metadata.
pub(super) fn segments(prefix: &str) -> impl Iterator<Item = (PathBuf, fs::Metadata)> {
    let entries = fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
    let prefix = prefix.to_owned();
    entries.filter_map(move |entry| {
        let ours = entry.file_name().to_str()?.starts_with(&prefix);
        let metadata = ours.then(|| entry.metadata().ok()).flatten()?;
        Some((entry.path(), metadata))
    })
}

/// Removes a run's segments and directory. Best effort: whatever is already gone is as wanted.
fn sweep(directory: &Path, prefix: Option<&str>) {
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
fn prefix_of(name: &str) -> Option<&str> {
    let digit = |letter: u8| letter.is_ascii_digit() || (b'a'..=b'f').contains(&letter);
    let prefix = name.get(..10)?;
    let bytes = prefix.as_bytes();
    (bytes[0] == b'g' && bytes[9] == b'_' && bytes[1..9].iter().copied().all(digit)).then_some(prefix)
}

/// Removes segments of this user that no run claims and no process maps, and returns their prefixes. A process that is killed
/// while it closes its channels may make one anew after its run was removed.
fn remove_orphans() -> Vec<String> {
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

fn record_in(directory: &Path) -> Option<RunRecord> {
    serde_json::from_slice(&fs::read(directory.join("run.json")).ok()?).ok()
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
        return Err(refuse("it belongs to somebody else; ask them to remove it".to_owned()));
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

/// Start time of a process in clock ticks since boot (field 22 of its `stat`), none when it does not live.
fn process_start(pid: u32) -> Option<u64> {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // The second field is the command in parentheses and may contain anything.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace();
    let state = fields.next()?;
    // An unreaped zombie has ended.
    (state != "Z" && state != "X").then(|| fields.nth(18)?.parse().ok()).flatten()
}

/// The kernel's name of this process's PID namespace.
fn pid_namespace() -> Option<String> {
    fs::read_link("/proc/self/ns/pid").ok()?.into_os_string().into_string().ok()
}

/// Whether somebody holds the lock of a run's directory. What cannot be judged counts as held.
fn is_locked(directory: &Path) -> bool {
    match File::open(directory) {
        Ok(file) => matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock | TryLockError::Error(_))),
        Err(error) => error.kind() != ErrorKind::NotFound,
    }
}

fn system(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> RunError {
    move |source| RunError::System { action, path: path.to_owned(), source }
}

#[cfg(test)]
mod tests;
