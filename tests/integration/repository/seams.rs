//! The architecture's promises that a compiler does not check: who depends on whom, and what is absent.

use std::fs;
use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Names in the `[dependencies]` table of a member's manifest.
fn dependencies_of(member: &str) -> Vec<String> {
    let text = fs::read_to_string(root().join(member).join("Cargo.toml")).expect("a member has a manifest");
    let manifest: toml::Table = text.parse().expect("a manifest is TOML");
    manifest["dependencies"].as_table().expect("dependencies are a table").keys().cloned().collect()
}

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a source folder can be listed") {
        let path = entry.expect("a folder entry can be read").path();
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

#[test]
fn grains_and_elements_never_see_each_other() {
    assert!(!dependencies_of("macro-solver").contains(&"rve-server".to_owned()));
    assert!(!dependencies_of("rve-server").contains(&"macro-solver".to_owned()));
    let protocol = dependencies_of("protocol");
    assert!(!protocol.contains(&"macro-solver".to_owned()) && !protocol.contains(&"rve-server".to_owned()));
    assert!(!protocol.contains(&"faer".to_owned()), "protocol carries messages, it does not compute");
}

#[test]
fn numerics_neither_print_nor_touch_files_nor_threads() {
    let mut files = Vec::new();
    // Element assembly (`macro-solver/src/model/`) uses threads over fixed blocks through rayon alone.
    let folders = [
        "rve-server/src/simd",
        "rve-server/src/space",
        "rve-server/src/cell",
        "rve-server/src/contact",
        "rve-server/src/solver",
        "rve-server/src/homogenization",
        "rve-server/src/tangent",
        "rve-server/src/engine",
        "rve-server/src/preparation",
        "macro-solver/src/formulation",
        "macro-solver/src/element",
        "macro-solver/src/nonlocal",
        "macro-solver/src/problem",
        "macro-solver/src/material",
        "macro-solver/src/model",
        "macro-solver/src/solve",
    ];
    for folder in folders {
        let before = files.len();
        rust_files(&root().join(folder), &mut files);
        assert!(files.len() > before, "{folder} has sources");
    }
    let product = |file: &PathBuf| {
        let name = file.to_string_lossy();
        !name.ends_with("tests.rs") && !name.contains("/tests/")
    };
    for file in files.into_iter().filter(product) {
        let text = fs::read_to_string(&file).expect("a source file can be read");
        for banned in ["std::fs", "std::thread", "std::net", "println!", "SystemTime"] {
            assert!(!text.contains(banned), "{} uses {banned}", file.display());
        }
    }
}

#[test]
fn random_iteration_order_is_absent() {
    let mut files = Vec::new();
    let folders = [
        "protocol/src",
        "rve-server/src",
        "macro-solver/src",
        "scene-reader/src",
        "keys/src",
        "charts/src",
        "page/src",
        "grain-pool/src",
        "hosts/src",
        "python/src",
        "pool-c/src",
        "worker-c/src",
        "bench/src",
        "src",
    ];
    for folder in folders {
        rust_files(&root().join(folder), &mut files);
    }
    for file in files {
        let text = fs::read_to_string(&file).expect("a source file can be read");
        for banned in ["HashMap", "HashSet"] {
            assert!(!text.contains(banned), "{} uses {banned}: its order is random", file.display());
        }
    }
}

/// Every command of the README and of the first guide that starts with `cargo run --release -- ` or `grainspan ` names a subcommand
/// that exists and shipped files that exist.
#[test]
fn the_first_commands_name_existing_commands_and_files() {
    let texts = ["README.md", "docs/guide/getting-started.md"]
        .map(|file| fs::read_to_string(root().join(file)).expect("the documents can be read"));
    let mut checked = 0;
    for line in texts.iter().flat_map(|text| text.lines()) {
        let prefixes = ["cargo run --release -- ", "grainspan "];
        let Some(arguments) = prefixes.iter().find_map(|prefix| line.trim().strip_prefix(prefix)) else { continue };
        let mut words = arguments.split_whitespace();
        let command = words.next().expect("a command follows");
        let help = std::process::Command::new(env!("CARGO_BIN_EXE_grainspan"))
            .args([command, "--help"])
            .output()
            .expect("the binary starts");
        assert!(help.status.success(), "the documents name `{command}`, which the binary does not have");
        let is_shipped = |word: &&str| word.ends_with(".toml") && word.contains('/');
        for file in words.filter(is_shipped) {
            assert!(root().join(file).exists(), "the documents name {file}, which does not exist");
        }
        checked += 1;
    }
    assert!(checked >= 4, "only {checked} commands found");
}
