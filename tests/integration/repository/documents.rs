//! Documents against the repository: paths, links, headings, folders, seams, ids and words that a document uses exist or are allowed.
//!
//! The last column of the verification catalogue is written by
//! `GRAINSPAN_UPDATE_CATALOGUE=1 cargo test --release --test integration documents`.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

const CATALOGUE: &str = "docs/reference/verification-catalogue.md";

/// Words that have a meaning of their own in the field, or none, and phrases that a plain sentence replaces. Code spans are exempt:
/// keys and old names may have to be written.
const BANNED: [&str; 37] = [
    "a lot of its own",
    "abreast",
    "anew",
    "asked elsewhere",
    "beside",
    "border guard",
    "condemn",
    "condemned",
    "creep",
    "creeping",
    "creeps",
    "crept",
    "culprit",
    "deadly",
    "dealt out",
    "desk",
    "equal questions",
    "fell short",
    "foresees",
    "foretells",
    "in words",
    "is told",
    "keeper",
    "last words",
    "nobody",
    "null targets",
    "pulls nothing",
    "remember their way",
    "roster",
    "rota",
    "shelf",
    "so many",
    "somebody",
    "turned down",
    "vitals",
    "with words",
    "yardstick",
];

fn root() -> &'static Path {
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

fn files() -> Vec<String> {
    let mut found = Vec::new();
    walk(root(), &mut found);
    found
}

fn read(path: &str) -> String {
    fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Markdown written by people; reports of benchmarks are not.
fn documents(files: &[String]) -> Vec<String> {
    let written = |path: &&String| path.ends_with(".md") && !path.starts_with("docs/lab-book/runs/");
    files.iter().filter(written).cloned().collect()
}

/// A line of a document: number from 1, text, whether it stands in a code block.
fn lines(text: &str) -> Vec<(usize, &str, bool)> {
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
fn spans(line: &str) -> Vec<&str> {
    line.split('`').skip(1).step_by(2).collect()
}

/// A line without its code spans and link targets.
fn prose(line: &str) -> String {
    let plain: Vec<&str> = line.split('`').step_by(2).collect();
    let mut text = plain.join(" ");
    while let Some(begin) = text.find("](") {
        let end = text[begin..].find(')').map_or(text.len(), |end| begin + end + 1);
        text.replace_range(begin..end, " ");
    }
    text
}

/// Targets of the links and pictures of a line that lie in the repository.
fn links(line: &str) -> Vec<&str> {
    let parts = line.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    parts.filter(|target| !target.contains("://") && !target.starts_with("mailto:")).collect()
}

/// `a/../b` as `b`.
fn normalised(path: &Path) -> String {
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
    const FOLDERS: [&str; 21] = [
        ".ci",
        "adapters",
        "bench",
        "charts",
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

fn no_faults(faults: &[String]) {
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
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
    for file in files.iter().filter(source).filter(|file| !file.ends_with("repository/documents.rs")) {
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

/// Words of a text without punctuation, in lower case, with single spaces.
fn words(text: &str) -> String {
    let plain: String = text
        .to_lowercase()
        .chars()
        .map(|letter| if letter.is_alphanumeric() || letter == '-' { letter } else { ' ' })
        .collect();
    format!(" {} ", plain.split_whitespace().collect::<Vec<_>>().join(" "))
}

fn banned_in(text: &str) -> Vec<&'static str> {
    let text = words(text);
    BANNED.into_iter().filter(|word| text.contains(&format!(" {word} "))).collect()
}

#[test]
fn documents_use_the_words_of_the_field() {
    let mut faults = Vec::new();
    for document in documents(&files()) {
        for (number, line, code) in lines(&read(&document)) {
            let found = if code { Vec::new() } else { banned_in(&prose(line)) };
            faults.extend(found.iter().map(|word| format!("{document}:{number}: \"{word}\"")));
        }
    }
    no_faults(&faults);
}

#[test]
fn help_uses_the_words_of_the_field() {
    let Some(program) = option_env!("CARGO_BIN_EXE_grainspan") else { return };
    let help = |arguments: &[&str]| {
        let output = std::process::Command::new(program).args(arguments).arg("--help").output().unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    let main = help(&[]);
    let commands = main.split("Commands:").nth(1).expect("the help lists commands");
    let named = commands.lines().skip(1).take_while(|line| line.starts_with("  "));
    let named: Vec<&str> =
        named.filter(|line| !line.starts_with("   ")).filter_map(|line| line.split_whitespace().next()).collect();
    assert!(named.len() > 5, "{named:?}");
    let mut faults = Vec::new();
    for command in named.into_iter().filter(|command| *command != "help") {
        faults.extend(
            banned_in(&help(&[command])).iter().map(|word| format!("grainspan {command} --help: \"{word}\"")),
        );
    }
    faults.extend(banned_in(&main).iter().map(|word| format!("grainspan --help: \"{word}\"")));
    no_faults(&faults);
}

/// The part of a document below a heading of the second level.
fn section<'a>(text: &'a str, heading: &str) -> &'a str {
    let begin = text.find(&format!("\n## {heading}\n")).unwrap_or_else(|| panic!("there is a section \"{heading}\""));
    let rest = &text[begin + 1..];
    rest[3..].find("\n## ").map_or(rest, |end| &rest[..end + 3])
}

/// Folders of source files that are not tests.
fn source_folders() -> Vec<String> {
    let mut found = Vec::new();
    for krate in [
        "protocol",
        "rve-server",
        "macro-solver",
        "keys",
        "scene-reader",
        "grain-pool",
        "pool-c",
        "bench",
        "charts",
        "page",
        "worker-c",
        "python",
        ".",
    ] {
        let source = root().join(krate).join("src");
        let Ok(entries) = fs::read_dir(&source) else { continue };
        let folders = entries.map(|entry| entry.unwrap().path()).filter(|path| path.is_dir());
        let outside = folders.filter(|path| path.file_name().is_some_and(|name| name != "tests"));
        found.extend(outside.map(|path: PathBuf| normalised(path.strip_prefix(root()).unwrap())));
    }
    found.sort();
    found
}

#[test]
fn the_map_of_the_architecture_names_every_source_folder() {
    let text = read("ARCHITECTURE.md");
    let map = section(&text, "Map inside the crates");
    let missing = source_folders().into_iter().filter(|folder| !map.contains(&format!("`{folder}/`")));
    no_faults(&missing.map(|folder| format!("ARCHITECTURE.md: the map lacks `{folder}/`")).collect::<Vec<_>>());
}

/// Names behind `crate::` in the sources of a file, comments and tests left out.
fn imported(text: &str) -> BTreeSet<String> {
    let sources = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or(text);
    let plain: String =
        sources.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
    let name =
        |rest: &str| rest.chars().take_while(|letter| letter.is_alphanumeric() || *letter == '_').collect::<String>();
    plain.split("crate::").skip(1).map(name).collect()
}

/// The map says "lowest first": a folder imports only from folders above it in the list of its crate.
#[test]
fn folders_import_in_the_order_of_the_map() {
    let text = read("ARCHITECTURE.md");
    let map = section(&text, "Map inside the crates");
    let files = files();
    let mut faults = Vec::new();
    for krate in ["rve-server", "macro-solver"] {
        let lead = format!("* `{krate}/src/");
        let order: Vec<&str> = map
            .lines()
            .filter_map(|line| line.strip_prefix(lead.as_str()))
            .filter_map(|rest| rest.split('/').next())
            .collect();
        assert!(order.len() > 8, "{krate}: {order:?}");
        for (place, folder) in order.iter().enumerate() {
            let inside = format!("{krate}/src/{folder}/");
            let product =
                |file: &&String| file.starts_with(&inside) && !file.contains("/tests") && !file.ends_with("tests.rs");
            for file in files.iter().filter(product) {
                let higher =
                    imported(&read(file)).into_iter().filter(|name| order[place + 1..].contains(&name.as_str()));
                faults.extend(
                    higher.map(|name| format!("{file} imports `{name}`, which the map lists after `{folder}`")),
                );
            }
        }
    }
    no_faults(&faults);
}

#[test]
fn the_seams_of_the_architecture_are_types_of_the_files_they_name() {
    let text = read("ARCHITECTURE.md");
    let mut checked = 0;
    let mut faults = Vec::new();
    for line in section(&text, "Seams").lines().filter(|line| line.starts_with("| `")) {
        let cells: Vec<&str> = line.split('|').collect();
        let file = spans(cells[2])[0];
        let source = read(file);
        for name in spans(cells[1]) {
            checked += 1;
            let kinds = ["trait", "struct", "enum"];
            let defined = kinds.iter().any(|kind| {
                ["<", " ", ":", ";", "("].iter().any(|next| source.contains(&format!("pub {kind} {name}{next}")))
            });
            if !defined {
                faults.push(format!("ARCHITECTURE.md: {file} has no public type `{name}`"));
            }
        }
    }
    assert!(checked >= 8, "seams were found: {checked}");
    no_faults(&faults);
}

#[test]
fn every_change_of_the_guide_for_contributors_names_files_test_and_document() {
    let text = read("CONTRIBUTING.md");
    let mut faults = Vec::new();
    let mut changes = 0;
    for change in section(&text, "Changes").split("\n### ").skip(1) {
        changes += 1;
        let heading = change.lines().next().unwrap();
        for part in ["Files", "Test", "Document"] {
            if !change.lines().any(|line| line.starts_with(&format!("- **{part}**"))) {
                faults.push(format!("CONTRIBUTING.md: \"{heading}\" has no line {part}"));
            }
        }
    }
    assert!(changes >= 12, "changes were found: {changes}");
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

/// Ids such as `T-4` in a text, ranges such as `D-3 to D-5` spelt out.
fn ids(text: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut last: Option<(char, u32, usize)> = None;
    let letters: Vec<char> = text.chars().collect();
    for (at, window) in letters.windows(3).enumerate() {
        let [letter, '-', digit] = window else { continue };
        let begins = at == 0 || !(letters[at - 1].is_alphanumeric() || ['-', '_'].contains(&letters[at - 1]));
        if !begins || !"ABCDEGHIJKLPST".contains(*letter) || !digit.is_ascii_digit() {
            continue;
        }
        let digits: String = letters[at + 2..].iter().take_while(|letter| letter.is_ascii_digit()).collect();
        let next = letters.get(at + 2 + digits.len());
        if digits.len() > 2 || next.is_some_and(|next| next.is_alphanumeric() || *next == '_') {
            continue;
        }
        let number: u32 = digits.parse().unwrap();
        if let Some((family, first, end)) = last
            && family == *letter
            && letters[end..at].iter().collect::<String>() == " to "
        {
            found.extend((first..number).map(|between| format!("{family}-{between}")));
        }
        found.insert(format!("{letter}-{number}"));
        last = Some((*letter, number, at + 2 + digits.len()));
    }
    found
}

/// Where each id is named: test sources, benchmarks and examples; if none names it, other sources.
fn places(files: &[String]) -> BTreeMap<String, BTreeSet<String>> {
    let mut found: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for file in files.iter().filter(|file| {
        (file.ends_with(".rs") || file.ends_with(".py")) && *file != "tests/integration/repository/documents.rs"
    }) {
        for id in ids(&read(file)) {
            found.entry(id).or_default().insert(file.clone());
        }
    }
    let test = |file: &String| {
        ["tests/", "bench/"].iter().any(|folder| file.starts_with(folder))
            || ["/tests/", "/bench/", "/examples/", "tests.rs"].iter().any(|part| file.contains(part))
    };
    for files in found.values_mut() {
        if files.iter().any(test) {
            files.retain(test);
        }
    }
    found
}

/// The catalogue with the column of files as the sources have it. An id that no source names keeps its text.
fn catalogue_with(text: &str, places: &BTreeMap<String, BTreeSet<String>>) -> String {
    let mut lines: Vec<String> = Vec::new();
    for line in text.lines() {
        let cells: Vec<&str> = line.split(" | ").collect();
        let id = cells[0].trim_start_matches("| ");
        match places.get(id) {
            Some(files) if cells.len() == 5 && line.starts_with("| ") => {
                let files: Vec<String> = files.iter().map(|file| format!("`{file}`")).collect();
                lines.push(format!("{} | {} |", cells[..4].join(" | "), files.join(", ")));
            }
            _ => lines.push(line.to_owned()),
        }
    }
    lines.join("\n") + "\n"
}

#[test]
fn the_verification_catalogue_has_every_id_and_the_files_that_name_it() {
    let text = read(CATALOGUE);
    let places = places(&files());
    let listed: BTreeSet<&str> =
        text.lines().filter_map(|line| line.strip_prefix("| ")).filter_map(|line| line.split(" | ").next()).collect();
    let missing = places.iter().filter(|(id, _)| !listed.contains(id.as_str()));
    no_faults(&missing.map(|(id, files)| format!("{CATALOGUE} lacks {id}, named in {files:?}")).collect::<Vec<_>>());
    let updated = catalogue_with(&text, &places);
    if std::env::var_os("GRAINSPAN_UPDATE_CATALOGUE").is_some() {
        fs::write(root().join(CATALOGUE), &updated).unwrap();
    } else {
        let differing: Vec<String> = text
            .lines()
            .zip(updated.lines())
            .filter(|(old, new)| old != new)
            .map(|(_, new)| format!("{CATALOGUE}: should be {new}"))
            .collect();
        no_faults(&differing);
    }
}

#[test]
fn parts_of_this_test_work() {
    assert_eq!(
        ids("D-3 to D-5, E-1; utf-8, SC-2, T-10x, AVX-512"),
        ["D-3", "D-4", "D-5", "E-1"].map(str::to_owned).into()
    );
    assert_eq!(as_path("scenes/biaxial.toml"), Some("scenes/biaxial.toml"));
    assert_eq!(as_path("out/small/quarantine.replay"), None);
    assert_eq!(as_path("k_t / k_n"), None);
    assert_eq!(named_by_source("see docs/guide/operations.md."), ["docs/guide/operations.md"]);
    assert!(fits("tests/pool_*.rs", "tests/pool_processes.rs") && !fits("a*b", "abc"));
    assert_eq!(anchor("Case A: two codes"), "case-a-two-codes");
    assert_eq!(banned_in("A body CREEPS, so many."), ["creeps", "so many"]);
    assert_eq!(prose("a `creep` [x](creep.md) b"), "a   [x  b");
}
