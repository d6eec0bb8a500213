//! Where an agent finds its run: an endpoint with a secret, or the file that the run writes with both.

use crate::secret::{Secret, SecretError, read_private, write_private};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// What an agent needs to reach a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    /// Addresses with ports, tried in order.
    pub endpoints: Vec<String>,
    /// The shared secret.
    pub secret: Secret,
}

/// Why a target or a join file cannot be used.
#[derive(Debug, Error)]
pub enum JoinFileError {
    /// The secret, or the file.
    #[error(transparent)]
    Secret(#[from] SecretError),
    /// The content is none.
    #[error("{}: not a join file: {reason}\nhint: `grainspan run --listen` writes one into its output folder", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// It is not there.
    #[error(
        "{}: there is no such file\nhint: a run writes the file `join` into its output folder when it begins to listen, and removes it when it ends",
        .0.display()
    )]
    Missing(PathBuf),
    /// An endpoint without a secret.
    #[error(
        "`{0}` needs a secret: give --secret FILE, the same as the run, or --join the file `join` in the run's output folder"
    )]
    NoSecret(String),
}

impl JoinFileError {
    /// Whether the file is not there, and may yet come.
    pub fn is_missing(&self) -> bool {
        let is_absent = |source: &std::io::Error| source.kind() == std::io::ErrorKind::NotFound;
        matches!(self, Self::Missing(_))
            || matches!(self, Self::Secret(SecretError::File { source, .. }) if is_absent(source))
    }
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    endpoints: Vec<String>,
    secret: String,
}

/// The file that a run writes for its agents: readable by its owner only, removed when the run ends.
pub struct JoinFile {
    path: PathBuf,
    text: String,
}

impl fmt::Debug for JoinFile {
    /// Without the text, which holds the secret.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("JoinFile").field("path", &self.path).finish_non_exhaustive()
    }
}

impl JoinFile {
    /// Writes the file of a run that listens at `address`. `advertised` are the addresses that agents are to use, each with or
    /// without a port; without any it is the one that the run listens at, or the name of this host if it listens at all of them.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(
        path: &Path,
        address: SocketAddr,
        advertised: &[String],
        secret: &Secret,
    ) -> Result<Self, JoinFileError> {
        let port = address.port();
        let with_port = |text: &String| if is_endpoint(text) { text.clone() } else { format!("{text}:{port}") };
        let endpoints = if !advertised.is_empty() {
            advertised.iter().map(with_port).collect()
        } else if address.ip().is_unspecified() {
            // The name that the cluster knows this host by.
            let name = rustix::system::uname().nodename().to_string_lossy().into_owned();
            vec![format!("{name}:{port}")]
        } else {
            vec![address.to_string()]
        };
        let content = Content { endpoints, secret: secret.text() };
        let failed = |reason: String| JoinFileError::Content { path: path.to_owned(), reason };
        let text = toml::to_string(&content).map_err(|error| failed(error.to_string()))?;
        write_private(path, &text)?;
        Ok(Self { path: path.to_owned(), text })
    }

    /// Reads a join file.
    ///
    /// # Errors
    /// It cannot be read, others may read it, or it is none.
    pub fn read(path: &Path) -> Result<Target, JoinFileError> {
        let failed = |reason: String| JoinFileError::Content { path: path.to_owned(), reason };
        let text = read_private(path).map_err(|error| match error {
            SecretError::File { source, .. } if source.kind() == std::io::ErrorKind::NotFound => {
                JoinFileError::Missing(path.to_owned())
            }
            error => error.into(),
        })?;
        let content: Content = toml::from_str(&text).map_err(|error| failed(error.message().to_owned()))?;
        if content.endpoints.is_empty() {
            return Err(failed("it names no endpoint".to_owned()));
        }
        Ok(Target { endpoints: content.endpoints, secret: Secret::from_text(&content.secret, path)? })
    }
}

impl Drop for JoinFile {
    fn drop(&mut self) {
        // A run that was started meanwhile in the same folder has its own there.
        if read_private(&self.path).is_ok_and(|text| text == self.text) {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

impl Target {
    /// Reads `--join`: ADDRESS:PORT, which needs a secret file, or the path of a join file.
    ///
    /// # Errors
    /// See [`JoinFileError`].
    pub fn find(join: &str, secret: Option<&Path>) -> Result<Self, JoinFileError> {
        if !is_endpoint(join) {
            let mut target = JoinFile::read(Path::new(join))?;
            if let Some(path) = secret {
                target.secret = Secret::read(path)?;
            }
            return Ok(target);
        }
        let path = secret.ok_or_else(|| JoinFileError::NoSecret(join.to_owned()))?;
        Ok(Self { endpoints: vec![join.to_owned()], secret: Secret::read(path)? })
    }
}

/// Whether it is ADDRESS:PORT and not a path.
pub(crate) fn is_endpoint(text: &str) -> bool {
    !text.contains('/') && text.rsplit_once(':').is_some_and(|(_, port)| port.parse::<u16>().is_ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_join_file_says_where_and_goes_with_its_run() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("join");
        let secret = Secret::draw().unwrap();
        let file = JoinFile::write(&path, "127.0.0.1:7400".parse().unwrap(), &[], &secret).unwrap();
        let target = Target::find(path.to_str().unwrap(), None).unwrap();
        assert_eq!(target, Target { endpoints: vec!["127.0.0.1:7400".into()], secret: secret.clone() });
        assert!(!format!("{file:?} {target:?}").contains(&secret.text()));
        let later = JoinFile::write(&path, "127.0.0.1:7401".parse().unwrap(), &[], &secret).unwrap();
        drop(file);
        assert!(path.exists(), "it belongs to the later run");
        drop(later);
        assert!(!path.exists());
        let everywhere = JoinFile::write(&path, "0.0.0.0:7400".parse().unwrap(), &[], &secret).unwrap();
        let target = Target::find(path.to_str().unwrap(), None).unwrap();
        assert!(!target.endpoints[0].starts_with("0.0.0.0"), "{target:?}");
        drop(everywhere);
        let names = ["node1-ib".to_owned(), "10.0.0.1:99".to_owned()];
        let several = JoinFile::write(&path, "0.0.0.0:7400".parse().unwrap(), &names, &secret).unwrap();
        let target = Target::find(path.to_str().unwrap(), None).unwrap();
        assert_eq!(target.endpoints, ["node1-ib:7400", "10.0.0.1:99"]);
        drop(several);
    }

    #[test]
    fn endpoints_and_paths_are_told_apart_and_an_endpoint_needs_a_secret() {
        assert!(["node7:7400", "10.0.0.1:7400", "[::1]:7400"].iter().all(|text| is_endpoint(text)));
        assert!(["out/slope/join", "join", "a:b", "./node7:7400"].iter().all(|text| !is_endpoint(text)));
        let error = Target::find("node7:7400", None).unwrap_err().to_string();
        assert!(error.contains("--secret"), "{error}");
        let error = Target::find("none/here", None).unwrap_err();
        assert!(error.is_missing() && error.to_string().contains("none/here: there is no such file"), "{error}");
        assert!(!error.to_string().contains("urandom"), "the remedy for secrets: {error}");
        let error = Target::find("node7:7400", Some(Path::new("none/secret"))).unwrap_err();
        assert!(error.is_missing() && error.to_string().contains("urandom"), "{error}");
    }
}
