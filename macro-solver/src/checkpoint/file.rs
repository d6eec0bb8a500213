//! Archives on the disk.
//!
//! ```text
//! mark "GSCKPT\r\n" | format u32 | 0 u32 | length of the file u64 | length of the index u64
//! index (MessagePack: sections, lengths of the snapshots) | snapshots | 128-bit checksum of all before
//! ```
//!
//! Invariants: at every instant, also while being written and after a power cut, the folder holds a whole checkpoint if it
//! ever held one; a file that is cut short, damaged or foreign is told from a whole one.

use super::CheckpointError;
use super::archive::{Archive, Section};
use protocol::StateId;
use serde::{Deserialize, Serialize};
use std::cell::Cell;
use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions, Permissions};
use std::io::{self, BufWriter, ErrorKind, Read, Write};
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use xxhash_rust::xxh3::Xxh3;

/// Version of the file's layout; sections have versions of their own.
pub const CHECKPOINT_FORMAT: u32 = 2;

/// The carriage return and line feed show a file that went through a text-mode transfer.
const MARK: [u8; 8] = *b"GSCKPT\r\n";

const HEADER: usize = 32;
const CHECKSUM: usize = 16;

/// File mode: read and write for the owner.
const OWNER_ONLY: u32 = 0o600;

/// What is in the file beside the snapshots.
#[derive(Serialize, Deserialize)]
struct Index {
    sections: BTreeMap<String, Section>,
    lengths: Vec<u64>,
}

/// Result of reading the checkpoint of a folder.
#[derive(Debug)]
pub enum StoredCheckpoint {
    /// No checkpoint was ever completed in the folder.
    Nothing,
    /// The newest complete checkpoint; with an error if a newer one is damaged.
    Archive(Box<Archive>, Option<CheckpointError>),
}

/// The checkpoint of a run, and the one before it.
#[derive(Clone, Debug)]
pub struct CheckpointFile {
    current: PathBuf,
    previous: PathBuf,
    draft: PathBuf,
    /// Whether the current file is known to be whole: this process has written or read it.
    is_whole: Cell<bool>,
}

impl CheckpointFile {
    /// Names of the files in a run's folder.
    pub const NAMES: [&str; 3] = ["checkpoint.bin", "checkpoint.previous.bin", ".checkpoint.partial"];

    /// The checkpoint of the run that writes into `folder`.
    pub fn in_folder(folder: &Path) -> Self {
        let [current, previous, draft] = Self::NAMES.map(|name| folder.join(name));
        Self { current, previous, draft, is_whole: Cell::new(false) }
    }

    /// Writes an archive and makes the last one the previous one. Returns the size, bytes.
    ///
    /// # Errors
    /// The system's refusal, such as a full disk; what was there before is still there.
    pub fn write(&self, archive: &Archive) -> Result<u64, CheckpointError> {
        let written = self.write_draft(archive);
        let placed = written.and_then(|length| self.place().map(|()| length));
        placed.map_err(|source| {
            // The first error is the one worth telling.
            let _ = fs::remove_file(&self.draft);
            CheckpointError::System { action: "write", path: self.current.clone(), source }
        })
    }

    fn write_draft(&self, archive: &Archive) -> io::Result<u64> {
        let file = private_file(&self.draft)?;
        let mut out = Hashed { out: BufWriter::with_capacity(1 << 18, file), hash: Xxh3::new() };
        let length = encode(archive, &mut out)?;
        let checksum = out.hash.digest128().to_le_bytes();
        out.out.write_all(&checksum)?;
        out.out.into_inner().map_err(|error| error.into_error())?.sync_all()?;
        Ok(length)
    }

    /// Two renames. Between them only the previous file is there, and the reader takes that. A current file that is damaged does not take the
    /// place of the previous one, which may be the only whole one.
    fn place(&self) -> io::Result<()> {
        let is_whole =
            self.is_whole.replace(false) || !matches!(read(&self.current), Err(error) if !is_absent(&error));
        match if is_whole { fs::rename(&self.current, &self.previous) } else { Ok(()) } {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        fs::rename(&self.draft, &self.current)?;
        self.is_whole.set(true);
        // The names must be on the disk too. A file system that cannot sync folders has no better to offer.
        if let Some(folder) = self.current.parent() {
            let _ = File::open(folder).and_then(|folder| folder.sync_all());
        }
        Ok(())
    }

    /// Reads the newest whole checkpoint.
    ///
    /// # Errors
    /// There are files, but none of them is whole; or the newest has another format, which is not to be skipped silently.
    pub fn read(&self) -> Result<StoredCheckpoint, CheckpointError> {
        self.is_whole.set(false);
        let first = match read(&self.current) {
            Ok(archive) => {
                self.is_whole.set(true);
                return Ok(StoredCheckpoint::Archive(Box::new(archive), None));
            }
            Err(error @ CheckpointError::Format { .. }) => return Err(error),
            Err(error) => error,
        };
        match read(&self.previous) {
            Ok(archive) => Ok(StoredCheckpoint::Archive(Box::new(archive), (!is_absent(&first)).then_some(first))),
            Err(second) if is_absent(&second) && is_absent(&first) => Ok(StoredCheckpoint::Nothing),
            Err(second) if is_absent(&first) => Err(second),
            Err(_) => Err(first),
        }
    }

    /// Removes everything that belongs to the checkpoint.
    ///
    /// # Errors
    /// The system's refusal.
    pub fn remove(&self) -> Result<(), CheckpointError> {
        for path in [&self.draft, &self.previous, &self.current] {
            match fs::remove_file(path) {
                Err(source) if source.kind() != ErrorKind::NotFound => {
                    return Err(CheckpointError::System { action: "remove", path: path.clone(), source });
                }
                _ => {}
            }
        }
        Ok(())
    }
}

/// A new, empty file that only its owner reads and writes, whatever the file mode mask of the process: a checkpoint decides what a
/// resumed run computes.
fn private_file(path: &Path) -> io::Result<File> {
    let file = OpenOptions::new().write(true).create(true).truncate(true).mode(OWNER_ONLY).open(path)?;
    // A draft that an interrupted run has left keeps the mode it was made with.
    file.set_permissions(Permissions::from_mode(OWNER_ONLY))?;
    Ok(file)
}

fn is_absent(error: &CheckpointError) -> bool {
    matches!(error, CheckpointError::System { source, .. } if source.kind() == ErrorKind::NotFound)
}

/// Writes and hashes at the same time.
struct Hashed<W: Write> {
    out: W,
    hash: Xxh3,
}

impl<W: Write> Write for Hashed<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write(bytes)?;
        self.hash.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

/// Writes everything but the checksum; returns the length of the whole file.
fn encode(archive: &Archive, out: &mut impl Write) -> io::Result<u64> {
    let lengths: Vec<u64> = archive.snapshots.values().map(|bytes| bytes.len() as u64).collect();
    let snapshots: u64 = lengths.iter().sum();
    let index = Index { sections: archive.sections.clone(), lengths };
    let index = rmp_serde::to_vec(&index).map_err(io::Error::other)?;
    let length = HEADER as u64 + index.len() as u64 + snapshots + CHECKSUM as u64;
    out.write_all(&MARK)?;
    out.write_all(&CHECKPOINT_FORMAT.to_le_bytes())?;
    out.write_all(&0u32.to_le_bytes())?;
    out.write_all(&length.to_le_bytes())?;
    out.write_all(&(index.len() as u64).to_le_bytes())?;
    out.write_all(&index)?;
    archive.snapshots.values().try_for_each(|bytes| out.write_all(bytes))?;
    Ok(length)
}

/// Reads one archive from a file of its own. The header is believed only where the system agrees, and before anything else is
/// read: a file may be far longer than what is in it.
pub(super) fn read(path: &Path) -> Result<Archive, CheckpointError> {
    let system = |source| CheckpointError::System { action: "read", path: path.to_owned(), source };
    let mut file = File::open(path).map_err(system)?;
    let length = file.metadata().map_err(system)?.len();
    let mut bytes = Vec::new();
    (&mut file).take(HEADER as u64).read_to_end(&mut bytes).map_err(system)?;
    check_header(path, &bytes, length)?;
    file.take(length - HEADER as u64).read_to_end(&mut bytes).map_err(system)?;
    decode(path, &bytes)
}

fn damaged(path: &Path, reason: &str) -> CheckpointError {
    CheckpointError::Damaged { path: path.to_owned(), kind: "checkpoint", reason: reason.to_owned() }
}

/// Whether a file of `length` bytes that begins with these can be a checkpoint of this format.
fn check_header(path: &Path, begin: &[u8], length: u64) -> Result<(), CheckpointError> {
    if begin.len() < HEADER || length < (HEADER + CHECKSUM) as u64 {
        return Err(damaged(path, "it is shorter than its header"));
    }
    if begin[..8] != MARK {
        return Err(damaged(path, "it does not begin with the mark of a checkpoint"));
    }
    let format = u32::from_le_bytes(begin[8..12].try_into().expect("four bytes"));
    if format != CHECKPOINT_FORMAT {
        return Err(CheckpointError::Format { path: path.to_owned(), found: format, expected: CHECKPOINT_FORMAT });
    }
    let promised = u64::from_le_bytes(begin[16..24].try_into().expect("eight bytes"));
    if promised != length {
        return Err(damaged(path, &format!("it has {length} bytes of {promised}")));
    }
    Ok(())
}

fn decode(path: &Path, bytes: &[u8]) -> Result<Archive, CheckpointError> {
    let damaged = |reason: &str| damaged(path, reason);
    let word = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().expect("eight bytes"));
    check_header(path, bytes, bytes.len() as u64)?;
    let (content, checksum) = bytes.split_at(bytes.len() - CHECKSUM);
    let mut hash = Xxh3::new();
    hash.update(content);
    if hash.digest128().to_le_bytes() != checksum {
        return Err(damaged("its checksum does not match its content"));
    }
    let body = &content[HEADER..];
    let (index, mut rest) = usize::try_from(word(24))
        .ok()
        .and_then(|length| body.split_at_checked(length))
        .ok_or_else(|| damaged("its index is longer than the file"))?;
    let index: Index = rmp_serde::from_slice(index).map_err(|error| damaged(&error.to_string()))?;
    let mut archive = Archive { sections: index.sections, snapshots: BTreeMap::new() };
    for length in index.lengths {
        let (snapshot, tail) = usize::try_from(length)
            .ok()
            .and_then(|length| rest.split_at_checked(length))
            .ok_or_else(|| damaged("its snapshots are longer than the file"))?;
        let snapshot: Arc<[u8]> = snapshot.into();
        archive.snapshots.insert(StateId::of(&snapshot), snapshot);
        rest = tail;
    }
    Ok(archive)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reading three gigabytes of nothing takes half a minute and as much memory.
    #[test]
    fn a_file_that_is_longer_than_its_header_says_is_refused_before_it_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let file = CheckpointFile::in_folder(folder.path());
        let length = file.write(&Archive::new()).unwrap();
        let path = folder.path().join(CheckpointFile::NAMES[0]);
        let longer = 1u64 << 40;
        File::options().write(true).open(&path).unwrap().set_len(longer).unwrap();
        let text = read(&path).unwrap_err().to_string();
        assert!(text.contains(&format!("it has {longer} bytes of {length}")), "{text}");
        File::options().write(true).open(&path).unwrap().set_len(20).unwrap();
        assert!(read(&path).unwrap_err().to_string().contains("shorter than its header"));
    }
}
