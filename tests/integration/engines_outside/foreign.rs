//! Which engines can be started here.
#![allow(dead_code, reason = "each user compiles its own copy")]

use crate::harness::engines::skip;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The engines that ship.
pub(crate) const ENGINES: [&str; 3] = ["reference", "yade", "lammps"];

/// The interpreter for the adapters.
pub(crate) fn python() -> PathBuf {
    if let Some(named) = std::env::var_os("GRAINSPAN_TEST_PYTHON") {
        return named.into();
    }
    let made = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/adapters-venv/bin/python");
    if made.exists() { made } else { "python3".into() }
}

/// The command of a Python engine, without its role.
pub(crate) fn command(engine: &str) -> Command {
    let mut command = Command::new(python());
    command.args(["-m", &format!("grainspan_worker.engines.{engine}")]);
    command.env("PYTHONPATH", package());
    command
}

/// Where the Python package lies.
pub(crate) fn package() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("adapters/python")
}

/// Whether an engine can be started; says so when it cannot.
pub(crate) fn is_there(engine: &str) -> bool {
    let probe = format!("import iceoryx2, msgpack, numpy, xxhash, grainspan_worker.engines.{engine}");
    let tried = Command::new(python()).args(["-c", &probe]).env("PYTHONPATH", package()).output();
    let reason = match tried {
        Ok(output) if output.status.success() => return true,
        Ok(output) => {
            let words = String::from_utf8_lossy(&output.stderr).into_owned();
            words.trim().lines().last().unwrap_or("it ended without a word").to_owned()
        }
        Err(error) => error.to_string(),
    };
    skip(engine, &format!("engine `{engine}`"), &reason);
    false
}

/// A catalogue of all engines, each also with states by replay.
pub(crate) fn catalogue() -> String {
    let (python, package) = (python(), package());
    let mut text = String::new();
    for engine in ENGINES {
        for (name, extra) in [(engine.to_owned(), ""), (format!("{engine}-replay"), ", \"--replay\"")] {
            text += &format!(
                "[{name}]\ncommand = [\"{}\", \"-m\", \"grainspan_worker.engines.{engine}\"{extra}]\n\
                 environment = {{ PYTHONPATH = \"{}\" }}\n",
                python.display(),
                package.display()
            );
        }
    }
    text
}
