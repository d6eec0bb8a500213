//! The program as a user calls it, to its end.

use std::path::Path;
use std::process::{Command, Output};

/// Calls the program in the root of the repository.
pub fn grainspan(arguments: &[&str]) -> Output {
    grainspan_in(Path::new(env!("CARGO_MANIFEST_DIR")), arguments)
}

/// Calls the program in a folder.
pub fn grainspan_in(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_grainspan"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("the binary starts")
}

/// Calls the program in the root of the repository; it has to end well.
pub fn succeeded(arguments: &[&str]) -> Output {
    let output = grainspan(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    output
}
