//! The map of ARCHITECTURE.md and the guide for contributors against the sources.

use super::text::{files, no_faults, normalised, read, root, section, spans};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::PathBuf;

/// Folders of the workspace members as the manifest lists them, and `.` for the program.
pub(super) fn members() -> Vec<String> {
    let manifest: toml::Table = read("Cargo.toml").parse().expect("the manifest is TOML");
    let listed = manifest["workspace"]["members"].as_array().expect("members are a list");
    let members = listed.iter().map(|member| member.as_str().expect("a member is a path").to_owned());
    members.chain([".".to_owned()]).collect()
}

/// Folders of source files that are not tests.
fn source_folders() -> Vec<String> {
    let mut found = Vec::new();
    for member in members() {
        let source = root().join(member).join("src");
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

/// Libraries of the workspace that a member depends on, those of its tests left out.
fn dependencies(member: &str) -> BTreeSet<String> {
    let manifest: toml::Table = read(&format!("{member}/Cargo.toml")).parse().expect("the manifest is TOML");
    let named = manifest.get("dependencies").and_then(toml::Value::as_table).expect("it has dependencies");
    named.keys().filter(|name| members().contains(name)).cloned().collect()
}

#[test]
fn the_table_of_crates_names_what_they_depend_on() {
    let text = read("ARCHITECTURE.md");
    let mut faults = Vec::new();
    for member in members().iter().filter(|member| *member != ".") {
        let begin = format!("| `{member}/` |");
        let Some(row) = section(&text, "Crates and folders").lines().find(|line| line.starts_with(&begin)) else {
            faults.push(format!("ARCHITECTURE.md: the table of crates lacks `{member}/`"));
            continue;
        };
        let column = row.split('|').nth(3).expect("the table has three columns");
        let said: BTreeSet<String> = spans(column).into_iter().map(str::to_owned).collect();
        let found = dependencies(member);
        if said != found {
            faults.push(format!("ARCHITECTURE.md: `{member}/` depends on {found:?}, not on {said:?}"));
        }
    }
    no_faults(&faults);
}

/// First names of paths behind `crate::` in the source text of a module so many levels below the crate, also of grouped imports and
/// behind as many `super::`; comments and tests left out.
fn imported(text: &str, level: usize) -> BTreeSet<String> {
    let sources = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or(text);
    let plain: String =
        sources.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
    let plain = plain.replace(&"super::".repeat(level), "crate::");
    let name = |rest: &str| {
        let letters = rest.trim_start().chars().take_while(|letter| letter.is_alphanumeric() || *letter == '_');
        letters.collect::<String>()
    };
    let mut found = BTreeSet::new();
    for rest in plain.split("crate::").skip(1) {
        match rest.strip_prefix('{') {
            Some(group) => found.extend(parts_of_group(group).into_iter().map(name)),
            None => {
                found.insert(name(rest));
            }
        }
    }
    found
}

/// The parts between the commas of `a, b::{c, d}} ...`, up to the brace that closes the group.
fn parts_of_group(group: &str) -> Vec<&str> {
    let (mut depth, mut begin, mut parts) = (0, 0, Vec::new());
    for (at, letter) in group.char_indices() {
        match letter {
            '{' => depth += 1,
            '}' if depth == 0 => {
                parts.push(&group[begin..at]);
                parts.retain(|part| !part.trim().is_empty());
                return parts;
            }
            '}' => depth -= 1,
            ',' if depth == 0 => {
                parts.push(&group[begin..at]);
                begin = at + 1;
            }
            _ => {}
        }
    }
    parts
}

/// Whether a file belongs to the product: no test.
pub(super) fn is_product(file: &str) -> bool {
    file.ends_with(".rs") && !file.contains("/tests") && !file.ends_with("tests.rs")
}

/// Top-level modules of a crate, files or folders directly below `src/`, each with the others that it names.
fn arrows(member: &str, files: &[String]) -> BTreeMap<String, BTreeSet<String>> {
    let source = normalised(&PathBuf::from(member).join("src")) + "/";
    let mut named: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for file in files.iter().filter(|file| is_product(file)) {
        let Some(inside) = file.strip_prefix(&source) else { continue };
        let module = inside.split('/').next().unwrap_or(inside).trim_end_matches(".rs");
        if !["lib", "main"].contains(&module) {
            let level = inside.trim_end_matches("/mod.rs").split('/').count();
            named.entry(module.to_owned()).or_default().extend(imported(&read(file), level));
        }
    }
    let modules: BTreeSet<String> = named.keys().cloned().collect();
    let other = |module: &String, names: &BTreeSet<String>| {
        names.iter().filter(|name| modules.contains(*name) && *name != module).cloned().collect()
    };
    named.iter().map(|(module, names)| (module.clone(), other(module, names))).collect()
}

/// The largest set of modules that reach each other; empty if none reaches itself.
pub(super) fn largest_circle(arrows: &BTreeMap<String, BTreeSet<String>>) -> BTreeSet<String> {
    let reached = |from: &String| {
        let (mut found, mut open) = (BTreeSet::new(), vec![from]);
        while let Some(module) = open.pop() {
            open.extend(arrows[module].iter().filter(|next| found.insert((*next).clone())));
        }
        found
    };
    let reach: BTreeMap<&String, BTreeSet<String>> = arrows.keys().map(|module| (module, reached(module))).collect();
    let circle = |module: &String| {
        let both = reach[module].iter().filter(|other| reach[other].contains(module));
        both.cloned().collect::<BTreeSet<String>>()
    };
    arrows.keys().map(circle).max_by_key(BTreeSet::len).unwrap_or_default()
}

/// The map says "lowest first": a folder imports only from folders above it in the list of its crate.
#[test]
fn folders_import_in_the_order_of_the_map() {
    let text = read("ARCHITECTURE.md");
    let map = section(&text, "Map inside the crates");
    let files = files();
    let mut faults = Vec::new();
    let mut ordered = 0;
    for member in members() {
        let lead = format!("{}/", normalised(&PathBuf::from(&member).join("src")));
        let order: Vec<&str> = map
            .lines()
            .filter(|line| line.starts_with("* `"))
            .flat_map(|line| spans(line.split(" — ").next().unwrap_or(line)))
            .filter_map(|path| path.strip_prefix(lead.as_str())?.strip_suffix('/'))
            .collect();
        let arrows = arrows(&member, &files);
        ordered += usize::from(order.len() > 1);
        for (place, folder) in order.iter().enumerate() {
            let Some(named) = arrows.get(*folder) else { continue };
            let higher = named.iter().filter(|name| order[place + 1..].contains(&name.as_str()));
            faults.extend(
                higher.map(|name| format!("{member}: `{folder}` imports `{name}`, which the map lists after it")),
            );
        }
    }
    assert!(ordered >= 7, "crates with an order were found: {ordered}");
    no_faults(&faults);
}

/// Two files of one subject may name each other.
#[test]
fn no_three_top_level_modules_import_each_other_in_a_circle() {
    let files = files();
    let circles = members().into_iter().map(|member| (largest_circle(&arrows(&member, &files)), member));
    let faults = circles.filter(|(circle, _)| circle.len() > 2);
    no_faults(&faults.map(|(circle, member)| format!("{member}: {circle:?} import each other")).collect::<Vec<_>>());
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
fn parts_of_this_test_work() {
    let text = "use crate::{\n    a::b,\n    c::{d, e},\n};\nuse crate::f; // crate::g\n//! crate::h\n";
    assert_eq!(imported("use super::a;\nuse super::super::b;\n", 2), ["b".to_owned()].into());
    assert_eq!(imported(text, 1), ["a", "c", "f", "g"].map(str::to_owned).into());
    let arrows = |pairs: &[(&str, &str)]| {
        let mut found: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for (from, to) in pairs {
            found.entry((*from).to_owned()).or_default().insert((*to).to_owned());
            found.entry((*to).to_owned()).or_default();
        }
        found
    };
    assert!(largest_circle(&arrows(&[("a", "b"), ("b", "c"), ("a", "c")])).is_empty());
    assert_eq!(largest_circle(&arrows(&[("a", "b"), ("b", "c"), ("c", "b")])), ["b", "c"].map(str::to_owned).into());
}
