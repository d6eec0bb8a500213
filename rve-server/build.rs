//! Makes an identity of what computes: a hash of the sources of cells and of all that they are made of. Programs and libraries that are
//! built from one tree have the same one, with and without changes that are not committed; another tree has another one.

use std::fs;
use std::path::{Path, PathBuf};

/// The workspace's lock file, which names the versions of all other crates.
const LOCK: &str = "../Cargo.lock";

/// Crates whose sources decide about the bits of a cell.
const CRATES: [&str; 3] = [".", "../keys", "../protocol"];

fn main() -> Result<(), String> {
    let mut files = vec![PathBuf::from("build.rs"), PathBuf::from(LOCK)];
    for one in CRATES {
        files.push(Path::new(one).join("Cargo.toml"));
        sources(&Path::new(one).join("src"), &mut files)?;
    }
    files.sort();
    let mut hash = Fnv::new();
    for file in &files {
        // Every file by itself: a new one changes the file that names it too, and unit tests cause no build.
        println!("cargo::rerun-if-changed={}", file.display());
        let content = fs::read(file).map_err(|error| missing(file, &error))?;
        for part in [file.to_string_lossy().as_bytes(), &content] {
            hash.add(&(part.len() as u64).to_le_bytes());
            hash.add(part);
        }
    }
    println!("cargo::rustc-env=GRAINSPAN_SOURCES={:016x}", hash.0);
    Ok(())
}

fn missing(path: &Path, error: &std::io::Error) -> String {
    format!("{}: {error}; this crate is built in a clone of the whole repository", path.display())
}

/// Adds the Rust files of a folder and of those in it, without files of unit tests.
fn sources(folder: &Path, files: &mut Vec<PathBuf>) -> Result<(), String> {
    for entry in fs::read_dir(folder).map_err(|error| missing(folder, &error))? {
        let path = entry.map_err(|error| missing(folder, &error))?.path();
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        if path.is_dir() {
            sources(&path, files)?;
        } else if name.ends_with(".rs")
            && !name.starts_with('.')
            && name != "tests.rs"
            && !name.ends_with("_tests.rs")
        {
            files.push(path);
        }
    }
    Ok(())
}

/// FNV-1a of 64 bits: the same on every machine and with every compiler, which the hashes of the standard library do not promise.
struct Fnv(u64);

impl Fnv {
    fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    fn add(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
}
