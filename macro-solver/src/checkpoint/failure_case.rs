//! A trial that ended its workers, with all that is needed to repeat it: `grainspan element --replay` reads it.

use super::CheckpointError;
use protocol::{ContentId, Definition, Observables, TangentKind, Tensor2, TrialOptions};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// First bytes of the file.
const MARK: &[u8; 8] = b"GSREPLAY";

/// Version of the file.
const FORMAT: u32 = 1;

/// State, target and options of one trial, with the definition of the RVE.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FailureCase {
    /// Program that wrote it, for people.
    pub program: String,
    /// Engine that the trial was sent to; empty where the run has a single one that it does not name.
    #[serde(default)]
    pub engine: String,
    /// Gauss point.
    pub point: u64,
    /// Why the workers ended that solved it, oldest first.
    #[serde(rename = "ends")]
    pub failures: Vec<String>,
    /// What the RVE is.
    pub definition: Definition,
    /// Sealed snapshot of the committed state; empty: the initial state of the definition.
    #[serde(with = "serde_bytes")]
    pub state: Vec<u8>,
    /// Total displacement gradient from that state.
    pub target: Tensor2,
    /// Tangent asked for.
    pub tangent: TangentKind,
    /// Ramp increments; 0 = the engine chooses.
    pub ramp_steps: u32,
    /// Optional results asked for.
    pub observables: Observables,
    /// Share by which the friction was below that of the definition.
    #[serde(default)]
    pub friction_reduction: f64,
}

impl FailureCase {
    /// The options of the trial.
    pub fn options(&self) -> TrialOptions {
        TrialOptions {
            tangent: self.tangent,
            ramp_steps: self.ramp_steps,
            observables: self.observables,
            friction_reduction: self.friction_reduction,
        }
    }

    /// Content of the file.
    ///
    /// # Panics
    /// Never: all fields are plain data.
    pub fn encode(&self) -> Vec<u8> {
        let body = rmp_serde::to_vec_named(self).expect("a failure case is plain data");
        let mut bytes = MARK.to_vec();
        bytes.extend(FORMAT.to_le_bytes());
        bytes.extend(ContentId::of(&body).0);
        bytes.extend(body);
        bytes
    }

    /// Reads the file.
    ///
    /// # Errors
    /// It cannot be read, is not a failure case, is damaged, or has another format.
    pub fn read(path: &Path) -> Result<Self, CheckpointError> {
        let bytes = std::fs::read(path).map_err(|source| CheckpointError::System {
            action: "read",
            path: path.to_owned(),
            source,
        })?;
        let damaged = |reason: &str| CheckpointError::Damaged {
            path: path.to_owned(),
            kind: "failure case",
            reason: reason.to_owned(),
        };
        let rest = bytes.strip_prefix(MARK).ok_or_else(|| damaged("it does not begin with the mark of one"))?;
        let (format, rest) = rest.split_first_chunk::<4>().ok_or_else(|| damaged("it is cut short"))?;
        let format = u32::from_le_bytes(*format);
        if format != FORMAT {
            return Err(CheckpointError::Format { path: path.to_owned(), found: format, expected: FORMAT });
        }
        let (checksum, body) = rest.split_first_chunk::<16>().ok_or_else(|| damaged("it is cut short"))?;
        if ContentId::of(body).0 != *checksum {
            return Err(damaged("its checksum does not match its content"));
        }
        rmp_serde::from_slice(body).map_err(|error| damaged(&error.to_string()))
    }
}
