//! Files of the repository and the parts of a document that the checks look at.

use std::fs;
use std::path::Path;

pub(crate) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Paths of all files below a folder, relative to the repository, without build products.
fn walk(folder: &Path, found: &mut Vec<String>) {
    let mut entries: Vec<_> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let hidden = name.starts_with('.') && name != ".ci";
        if hidden || ["target", "dist", "out", "shared", "__pycache__"].contains(&name.as_str()) {
            continue;
        }
        if path.is_dir() {
            walk(&path, found);
        } else {
            found.push(path.strip_prefix(root()).unwrap().to_string_lossy().into_owned());
        }
    }
}

pub(crate) fn files() -> Vec<String> {
    let mut found = Vec::new();
    walk(root(), &mut found);
    found
}

pub(crate) fn read(path: &str) -> String {
    fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Markdown written by people; reports of benchmarks are not.
pub(crate) fn documents(files: &[String]) -> Vec<String> {
    let written = |path: &&String| path.ends_with(".md") && !path.starts_with("docs/lab-book/runs/");
    files.iter().filter(written).cloned().collect()
}

/// A line of a document: number from 1, text, whether it stands in a code block.
pub(crate) fn lines(text: &str) -> Vec<(usize, &str, bool)> {
    let mut inside = false;
    let mut found = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let fence = line.trim_start().starts_with("```");
        found.push((index + 1, line, inside || fence));
        inside ^= fence;
    }
    found
}

/// Contents of the code spans of a line.
pub(crate) fn spans(line: &str) -> Vec<&str> {
    line.split('`').skip(1).step_by(2).collect()
}

/// A line without its code spans and link targets.
pub(crate) fn prose(line: &str) -> String {
    let plain: Vec<&str> = line.split('`').step_by(2).collect();
    let mut text = plain.join(" ");
    while let Some(begin) = text.find("](") {
        let end = text[begin..].find(')').map_or(text.len(), |end| begin + end + 1);
        text.replace_range(begin..end, " ");
    }
    text
}

/// `a/../b` as `b`.
pub(crate) fn normalised(path: &Path) -> String {
    let mut parts: Vec<String> = Vec::new();
    for part in path.components() {
        match part {
            std::path::Component::ParentDir => {
                parts.pop();
            }
            std::path::Component::CurDir => {}
            other => parts.push(other.as_os_str().to_string_lossy().into_owned()),
        }
    }
    parts.join("/")
}

pub(crate) fn no_faults(faults: &[String]) {
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
}

/// The part of a document below a heading of the second level.
pub(crate) fn section<'a>(text: &'a str, heading: &str) -> &'a str {
    let begin = text.find(&format!("\n## {heading}\n")).unwrap_or_else(|| panic!("there is a section \"{heading}\""));
    let rest = &text[begin + 1..];
    rest[3..].find("\n## ").map_or(rest, |end| &rest[..end + 3])
}
