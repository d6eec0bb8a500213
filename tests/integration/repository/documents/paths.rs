//! Paths, links and headings that a document names exist; the indexes are complete.

use super::text::{documents, files, lines, no_faults, normalised, read, root, spans};
use std::collections::BTreeSet;
use std::path::Path;

/// Targets of the links and pictures of a line that lie in the repository.
fn links(line: &str) -> Vec<&str> {
    let parts = line.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    parts.filter(|target| !target.contains("://") && !target.starts_with("mailto:")).collect()
}

/// Whether a pattern with `*` fits a text.
fn fits(pattern: &str, text: &str) -> bool {
    match pattern.split_once('*') {
        None => pattern == text,
        Some((head, tail)) => text
            .strip_prefix(head)
            .is_some_and(|rest| (0..=rest.len()).any(|at| rest.is_char_boundary(at) && fits(tail, &rest[at..]))),
    }
}

/// `a/{b,c}.rs` as `a/b.rs`, `a/c.rs`.
fn alternatives(path: &str) -> Vec<String> {
    let Some((head, rest)) = path.split_once('{') else { return vec![path.to_owned()] };
    let Some((inner, tail)) = rest.split_once('}') else { return vec![path.to_owned()] };
    inner.split(',').flat_map(|part| alternatives(&format!("{head}{}{tail}", part.trim()))).collect()
}

/// What of a code span or a word of a command is meant as a path in the repository.
fn as_path(text: &str) -> Option<&str> {
    const ENDINGS: [&str; 16] = [
        ".rs", ".toml", ".md", ".json", ".jsonl", ".py", ".h", ".c", ".svg", ".csv", ".png", ".txt", ".sh",
        ".service", ".slurm", "/",
    ];
    let path = text.split(['#', ':']).next().unwrap_or(text).trim_end_matches([')', ',', ';']);
    let inside = !path.starts_with(['/', '~', '-', '<', '.']) || path.starts_with(".ci/");
    let plain = !path.contains([' ', '<', '>', '=', '(', '$', '"', '@', '|', '\\']);
    let products = [
        "api/",
        "cells/",
        "control/",
        "dist/",
        "files/",
        "mine/",
        "out/",
        "points/",
        "profiles/",
        "site/",
        "target/",
    ];
    let product = products.iter().any(|prefix| path.starts_with(prefix));
    let capitals = path.split('/').any(|part| {
        let stem = part.split('.').next().unwrap_or(part);
        stem.len() > 1 && stem.chars().all(|letter| letter.is_ascii_uppercase()) && part.ends_with(".rs")
    });
    let named = path.contains('/') && (ENDINGS.iter().any(|ending| path.ends_with(ending)) || top_level(path));
    (inside && plain && !product && !capitals && named).then_some(path)
}

/// Whether the first folder of a path is one of the repository that a document can only mean as a path.
fn top_level(path: &str) -> bool {
    const FOLDERS: [&str; 22] = [
        ".ci",
        "adapters",
        "bench",
        "charts",
        "claims",
        "deploy",
        "docs",
        "grain-pool",
        "hosts",
        "keys",
        "macro-solver",
        "packings",
        "page",
        "pool-c",
        "protocol",
        "python",
        "rve-server",
        "scene-reader",
        "scenes",
        "src",
        "tests",
        "worker-c",
    ];
    path.split('/').next().is_some_and(|first| FOLDERS.contains(&first))
}

/// Whether a path exists: from the root, from the document's folder, or as the end of a longer path.
fn exists(path: &str, document: &str, files: &[String]) -> bool {
    let folder = Path::new(document).parent().unwrap_or(Path::new(""));
    alternatives(path).iter().all(|path| {
        let near = normalised(&folder.join(path));
        let bare = path.trim_end_matches('/');
        if root().join(bare).exists() || root().join(&near).exists() {
            return true;
        }
        let ending = format!("*/{bare}");
        let within = format!("{bare}/*");
        let deep = format!("*/{bare}/*");
        files.iter().any(|file| fits(bare, file) || fits(&ending, file) || fits(&within, file) || fits(&deep, file))
    })
}

/// Paths of documents and scenes that a source file names.
fn named_by_source(text: &str) -> Vec<&str> {
    let plain = |letter: char| letter.is_ascii_alphanumeric() || "/-_.".contains(letter);
    let words = text.split(|letter: char| !plain(letter)).map(|word| word.trim_end_matches('.'));
    words
        .filter(|word| {
            (word.starts_with("docs/") && word.ends_with(".md"))
                || (word.starts_with("scenes/") && word.ends_with(".toml"))
        })
        .collect()
}

/// The anchor that a heading has on the common hosts of Markdown.
fn anchor(heading: &str) -> String {
    let lower = heading.trim().to_lowercase();
    let kept = lower.chars().filter(|letter| letter.is_alphanumeric() || [' ', '-', '_'].contains(letter));
    kept.map(|letter| if letter == ' ' { '-' } else { letter }).collect()
}

fn anchors(text: &str) -> BTreeSet<String> {
    let headings = lines(text).into_iter().filter(|(_, line, code)| !code && line.starts_with('#'));
    headings.map(|(_, line, _)| anchor(&line.trim_start_matches('#').replace('`', ""))).collect()
}

#[test]
fn paths_in_documents_exist() {
    let files = files();
    let mut faults = Vec::new();
    let mut checked = 0;
    for document in documents(&files) {
        let text = read(&document);
        for (number, line, code) in lines(&text) {
            let words: Vec<&str> = if code { line.split_whitespace().collect() } else { spans(line) };
            for path in words.into_iter().filter_map(as_path) {
                // A block of commands may name what it makes; only what the repository ships is looked for.
                if code
                    && !["scenes/", "packings/", "docs/", "adapters/"].iter().any(|folder| path.starts_with(folder))
                {
                    continue;
                }
                checked += 1;
                if !exists(path, &document, &files) {
                    faults.push(format!("{document}:{number}: there is no `{path}`"));
                }
            }
        }
    }
    assert!(checked > 100, "paths were found: {checked}");
    no_faults(&faults);
}

#[test]
fn documents_and_scenes_named_by_sources_exist() {
    let files = files();
    let source = |path: &&String| {
        [".rs", ".py", ".h", ".c", ".toml", ".yaml", ".service"].iter().any(|ending| path.ends_with(ending))
            || path.starts_with(".ci/")
            || path.starts_with("deploy/")
    };
    let mut faults = Vec::new();
    for file in files.iter().filter(source).filter(|file| !file.contains("repository/documents/")) {
        let text = read(file);
        let missing = named_by_source(&text).into_iter().filter(|path| !root().join(path).exists());
        faults.extend(missing.map(|path| format!("{file}: there is no {path}")));
    }
    no_faults(&faults);
}

#[test]
fn links_in_documents_lead_somewhere() {
    let files = files();
    let mut faults = Vec::new();
    for document in documents(&files) {
        let text = read(&document);
        let folder = Path::new(&document).parent().unwrap_or(Path::new(""));
        for (number, line, code) in lines(&text) {
            for link in links(line).into_iter().filter(|_| !code) {
                let (path, heading) =
                    link.split_once('#').map_or((link, None), |(path, heading)| (path, Some(heading)));
                let target = if path.is_empty() { document.clone() } else { normalised(&folder.join(path)) };
                if !root().join(&target).exists() {
                    faults.push(format!("{document}:{number}: the link leads to no file: {link}"));
                } else if heading.is_some_and(|heading| !anchors(&read(&target)).contains(heading)) {
                    faults.push(format!("{document}:{number}: {target} has no such heading: {link}"));
                }
            }
        }
    }
    no_faults(&faults);
}

#[test]
fn the_indexes_list_every_document_and_every_scene() {
    let files = files();
    let mut faults = Vec::new();
    let index = read("docs/README.md");
    for document in
        documents(&files).iter().filter_map(|path| path.strip_prefix("docs/")).filter(|path| *path != "README.md")
    {
        if !index.contains(&format!("({document})")) {
            faults.push(format!("docs/README.md lacks {document}"));
        }
    }
    let index = read("scenes/README.md");
    let scenes = files.iter().filter_map(|path| path.strip_prefix("scenes/")).filter(|path| path.ends_with(".toml"));
    for scene in scenes {
        let row = index.lines().find(|line| line.contains(&format!("({scene})")));
        if !row.is_some_and(|row| row.contains("![")) {
            faults.push(format!("scenes/README.md lacks {scene}, or its picture"));
        }
    }
    no_faults(&faults);
}

#[test]
fn parts_of_this_test_work() {
    assert_eq!(as_path("scenes/biaxial.toml"), Some("scenes/biaxial.toml"));
    assert_eq!(as_path("out/small/quarantine.replay"), None);
    assert_eq!(as_path("k_t / k_n"), None);
    assert_eq!(named_by_source("see docs/guide/operations.md."), ["docs/guide/operations.md"]);
    assert!(fits("tests/pool_*.rs", "tests/pool_processes.rs") && !fits("a*b", "abc"));
    assert_eq!(anchor("Case A: two codes"), "case-a-two-codes");
}

/// Two commands of the README do everything: one runs the main job, the other the tests, and that is the one that a submission has to pass.
#[test]
fn the_readme_runs_the_main_job_and_the_tests() {
    let tests = "cargo test --release --workspace";
    let readme = read("README.md");
    for command in ["cargo run --release -- run scenes/biaxial.toml", tests] {
        assert!(readme.lines().any(|line| line == command), "README.md has no line `{command}`");
    }
    assert!(read(".ci/run").contains(tests), ".ci/run does not run `{tests}`");
}
