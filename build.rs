//! Tells the program what it was built with: compiler, profile and code generation flags, for summaries and measurements.

use std::process::Command;

fn main() {
    let compiler = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let version = Command::new(compiler).arg("--version").output().ok();
    let version = version.and_then(|said| String::from_utf8(said.stdout).ok());
    let version = version.map_or_else(|| "unknown".to_owned(), |text| text.trim().to_owned());
    let optimisation = std::env::var("OPT_LEVEL").unwrap_or_default();
    // Cargo separates the flags by this control character.
    let flags = std::env::var("CARGO_ENCODED_RUSTFLAGS").unwrap_or_default().replace('\u{1f}', " ");
    println!("cargo::rustc-env=GRAINSPAN_COMPILER={version}");
    println!("cargo::rustc-env=GRAINSPAN_OPTIMISATION={optimisation}");
    println!("cargo::rustc-env=GRAINSPAN_FLAGS={flags}");
    println!("cargo::rerun-if-changed=build.rs");
}
