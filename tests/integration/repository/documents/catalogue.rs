//! The verification catalogue has every id and the files that name it.

use super::text::{files, no_faults, read, root};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;

const CATALOGUE: &str = "docs/reference/verification-catalogue.md";

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
    for file in files
        .iter()
        .filter(|file| (file.ends_with(".rs") || file.ends_with(".py")) && !file.contains("repository/documents/"))
    {
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
    if std::env::var_os("GRAINSPAN_UPDATE_DOCUMENTS").is_some() {
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
}
