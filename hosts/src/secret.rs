//! The secret that macro and agents share, and the files that hold it.

use rustix::process::geteuid;
use std::fmt;
use std::fs;
use std::io::{self, Read, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Fewest bytes of a secret. It is not a password: whoever connects once is shown a public key that was made of it, and may try guesses
/// against that key at leisure. Each costs some 0.1 s of a processor (see `tls.rs`), which does not protect words; a short secret invites
/// people to choose some.
const SHORTEST: usize = 16;

/// Most bytes of a secret file.
const LONGEST: u64 = 4096;

/// A shared secret. Whoever knows it may take part in the run, on either side.
#[derive(Clone, PartialEq, Eq)]
pub struct Secret(Vec<u8>);

impl fmt::Debug for Secret {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Secret(..)")
    }
}

/// Why there is no secret.
#[derive(Debug, Error)]
pub enum SecretError {
    /// The file cannot be read or written.
    #[error("{}: {source}\nhint: make one with `(umask 077; head -c 32 /dev/urandom | base64 > {})`", path.display(), path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// Others may read or replace the file.
    #[error(
        "{}: a secret must belong to you and be readable by you alone (it belongs to user {owner}, mode {mode:o})\nhint: chmod 600 {}",
        path.display(), path.display()
    )]
    Readable {
        /// The file.
        path: PathBuf,
        /// User number of the owner.
        owner: u32,
        /// Permission bits.
        mode: u32,
    },
    /// Too short to be one.
    #[error("{}: a secret has at least {SHORTEST} characters, this one {length}", path.display())]
    Short {
        /// The file.
        path: PathBuf,
        /// Its length.
        length: usize,
    },
    /// Too long to be one.
    #[error("{}: a secret has at most {LONGEST} bytes; this file is no secret", path.display())]
    Long {
        /// The file.
        path: PathBuf,
    },
    /// The system has no random numbers.
    #[error("the system gave no random numbers for a secret")]
    Random,
}

impl Secret {
    /// A new secret of 256 random bits.
    ///
    /// # Errors
    /// [`SecretError::Random`].
    pub fn draw() -> Result<Self, SecretError> {
        let mut bytes = [0u8; 32];
        let random = ring::rand::SystemRandom::new();
        ring::rand::SecureRandom::fill(&random, &mut bytes).map_err(|_| SecretError::Random)?;
        Ok(Self(bytes.iter().flat_map(|byte| format!("{byte:02x}").into_bytes()).collect()))
    }

    /// A secret from its text; blanks around it do not count.
    ///
    /// # Errors
    /// [`SecretError::Short`], with the place that it came from.
    pub fn from_text(text: &str, path: &Path) -> Result<Self, SecretError> {
        let text = text.trim();
        if text.len() < SHORTEST {
            return Err(SecretError::Short { path: path.to_owned(), length: text.len() });
        }
        Ok(Self(text.as_bytes().to_vec()))
    }

    /// Reads a secret file.
    ///
    /// # Errors
    /// It cannot be read, is readable by others, or is too short.
    pub fn read(path: &Path) -> Result<Self, SecretError> {
        Self::from_text(&read_private(path)?, path)
    }

    /// Its text.
    pub(crate) fn text(&self) -> String {
        String::from_utf8_lossy(&self.0).into_owned()
    }

    /// Its bytes.
    pub(crate) fn bytes(&self) -> &[u8] {
        &self.0
    }
}

/// The text of a file that only its owner, who must be the present user, may read.
///
/// # Errors
/// [`SecretError::File`], [`SecretError::Readable`], [`SecretError::Long`].
pub(crate) fn read_private(path: &Path) -> Result<String, SecretError> {
    let failed = |source| SecretError::File { path: path.to_owned(), source };
    let file = fs::File::open(path).map_err(failed)?;
    // Asked of the open file: a name may be given to another file between two questions.
    let metadata = file.metadata().map_err(failed)?;
    let (owner, mode) = (metadata.uid(), metadata.mode() & 0o7777);
    if owner != geteuid().as_raw() || mode & 0o077 != 0 {
        return Err(SecretError::Readable { path: path.to_owned(), owner, mode });
    }
    let mut text = String::new();
    let length = file.take(LONGEST + 1).read_to_string(&mut text).map_err(failed)?;
    // Half of a secret would be another one.
    if length as u64 > LONGEST { Err(SecretError::Long { path: path.to_owned() }) } else { Ok(text) }
}

/// Writes a file that only its owner may read, whole or not at all.
///
/// # Errors
/// [`SecretError::File`].
pub(crate) fn write_private(path: &Path, text: &str) -> Result<(), SecretError> {
    let failed = |source| SecretError::File { path: path.to_owned(), source };
    let mut unfinished = path.as_os_str().to_owned();
    unfinished.push(".part");
    // What an earlier process left may have other permissions.
    let _ = fs::remove_file(&unfinished);
    let mut file =
        fs::OpenOptions::new().write(true).create_new(true).mode(0o600).open(&unfinished).map_err(failed)?;
    file.write_all(text.as_bytes()).and_then(|()| file.sync_all()).map_err(failed)?;
    fs::rename(&unfinished, path).map_err(failed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn secrets_differ_and_do_not_show() {
        let (one, two) = (Secret::draw().unwrap(), Secret::draw().unwrap());
        assert_ne!(one, two);
        assert_eq!(one.bytes().len(), 64);
        assert_eq!(format!("{one:?}"), "Secret(..)");
    }

    #[test]
    fn a_file_that_others_may_read_is_refused_with_the_remedy() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("secret");
        let text = Secret::draw().unwrap().text();
        write_private(&path, &text).unwrap();
        assert_eq!(Secret::read(&path).unwrap().text(), text);
        for mode in [0o640, 0o604, 0o620] {
            fs::set_permissions(&path, fs::Permissions::from_mode(mode)).unwrap();
            let error = Secret::read(&path).unwrap_err().to_string();
            assert!(error.contains("chmod 600"), "{error}");
        }
        write_private(&path, "too short").unwrap();
        assert!(matches!(Secret::read(&path), Err(SecretError::Short { length: 9, .. })));
        // Half of a secret would be another one.
        let longest = "x".repeat(4096);
        write_private(&path, &longest).unwrap();
        assert_eq!(Secret::read(&path).unwrap().text(), longest);
        write_private(&path, &(longest + "x")).unwrap();
        assert!(matches!(Secret::read(&path), Err(SecretError::Long { .. })));
        let missing = Secret::read(&folder.path().join("none")).unwrap_err().to_string();
        assert!(missing.contains("/dev/urandom"), "{missing}");
    }
}
