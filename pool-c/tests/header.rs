//! The committed header is the one that the sources give.

use std::fs;
use std::path::Path;
use std::process::Command;

fn folder() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Names of the functions that C calls, each with the names of its parameters.
fn functions(text: &str, begin: &str, name_of: impl Fn(&str) -> Option<String>) -> Vec<(String, Vec<String>)> {
    let mut found = Vec::new();
    for rest in text.split(begin).skip(1) {
        let Some((name, rest)) = rest.split_once('(') else { continue };
        let Some((parameters, _)) = rest.split_once(')') else { continue };
        let parameters = parameters.split(',').filter_map(|one| name_of(one.trim()));
        found.push((name.trim().to_owned(), parameters.collect()));
    }
    found.sort();
    found
}

#[test]
fn the_header_has_the_functions_and_parameters_of_the_sources() {
    let sources = fs::read_to_string(folder().join("src/functions.rs")).unwrap();
    let declared = functions(&sources, "extern \"C\" fn ", |one| Some(one.split_once(':')?.0.to_owned()));
    let header = fs::read_to_string(folder().join("grainspan_pool.h")).unwrap();
    let plain: String =
        header.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
    let last_word = |one: &str| {
        let word: String =
            one.chars().rev().take_while(|letter| letter.is_alphanumeric() || *letter == '_').collect();
        let word: String = word.chars().rev().collect();
        (word != "void" && !word.is_empty()).then_some(word)
    };
    let listed = functions(&plain, " *grainspan_", last_word);
    let mut listed: Vec<_> = listed.into_iter().chain(functions(&plain, " grainspan_", last_word)).collect();
    listed.iter_mut().for_each(|(name, _)| name.insert_str(0, "grainspan_"));
    listed.sort();
    assert_eq!(declared, listed);
    assert!(declared.len() >= 10);
}

/// `GRAINSPAN_UPDATE_HEADER=1 cargo test --release -p grainspan-pool-c` writes it. Needs the program `cbindgen`.
#[test]
fn the_header_is_what_cbindgen_writes() {
    let generated = Command::new("cbindgen")
        .args(["--config", "cbindgen.toml", "src/functions.rs"])
        .current_dir(folder())
        .output();
    let Ok(generated) = generated else {
        return eprintln!("SKIPPED: there is no cbindgen (cargo install cbindgen)");
    };
    assert!(generated.status.success(), "{}", String::from_utf8_lossy(&generated.stderr));
    let header = folder().join("grainspan_pool.h");
    if std::env::var_os("GRAINSPAN_UPDATE_HEADER").is_some() {
        fs::write(&header, &generated.stdout).unwrap();
    }
    let committed = fs::read(&header).unwrap_or_default();
    assert!(committed == generated.stdout, "pool-c/grainspan_pool.h is stale; see the comment of this test");
}
