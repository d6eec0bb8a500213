//! How the workers of one engine are started.

use rve_server::server::{BUILT_IN_ENGINES, built_in_engine};
use scene_reader::BUILT_IN_ENGINE;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::PathBuf;

/// The system's link to the file that a process executes, which also leads there after another file has taken its place on the disk.
pub const RUNNING_PROGRAM: &str = "/proc/self/exe";

/// Name of the program in lists of processes and in messages.
pub const OWN_NAME: &str = "grainspan";

/// How the workers of one engine are started.
#[derive(Clone, Debug, PartialEq)]
pub struct Engine {
    /// Keyword.
    pub name: String,
    /// Program.
    pub program: PathBuf,
    /// First arguments; the role's own arguments follow.
    pub arguments: Vec<OsString>,
    /// Added to the environment of the worker.
    pub environment: BTreeMap<String, String>,
}

impl Engine {
    /// An engine inside the program `grainspan`, which lies at `program`.
    pub fn built_in(name: &str, program: PathBuf) -> Self {
        Self {
            name: name.to_owned(),
            program,
            arguments: vec!["rve-server".into(), "--engine".into(), name.into()],
            environment: BTreeMap::new(),
        }
    }

    /// Whether it is an engine inside the program, of periodic cells or of frames.
    pub fn is_of_this_program(&self) -> bool {
        built_in_engine(&self.name).is_some()
    }

    /// Whether it is the engine of periodic cells inside the program.
    pub fn is_built_in(&self) -> bool {
        self.name == BUILT_IN_ENGINE || self.name == BUILT_IN_ENGINES[0].keyword
    }
}
