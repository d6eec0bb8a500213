//! Keys explained: for the command line and for shells that complete them.

use super::shape::{Bounds, Key, Shape, Table};
use std::fmt::Write;

/// A key and the path to it, with dots. Lists of tables have no number in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry<'a> {
    /// The table that has it.
    pub table: &'a Table,
    /// The key.
    pub key: &'a Key,
}

/// All keys of a table and of the tables below it, with their paths. `item` is put after the names of lists.
fn entries<'a>(table: &'a Table, prefix: &str, item: &str, found: &mut Vec<(String, Entry<'a>)>) {
    for key in &table.keys {
        let path = format!("{prefix}{}", key.name);
        found.push((path.clone(), Entry { table, key }));
        below(&key.shape, &path, item, found);
    }
}

fn below<'a>(shape: &'a Shape, path: &str, item: &str, found: &mut Vec<(String, Entry<'a>)>) {
    match shape {
        Shape::Table(table) => entries(table, &format!("{path}."), item, found),
        Shape::List { of, .. } => below(of, &format!("{path}{item}"), item, found),
        Shape::Either(shapes) => shapes.iter().for_each(|shape| below(shape, path, item, found)),
        // Free names cannot be listed.
        Shape::Map(_) => {}
        Shape::Boolean | Shape::Integer(_) | Shape::Number(_) | Shape::Text | Shape::Words(_) | Shape::Anything => {}
    }
}

/// The keys that a query means: a path, with or without the numbers of entries, or the last name of one.
pub fn find<'a>(table: &'a Table, query: &str) -> Vec<(String, Entry<'a>)> {
    let parts: Vec<&str> = query.split('.').filter(|part| part.parse::<usize>().is_err()).collect();
    let query = parts.join(".");
    let mut found = Vec::new();
    entries(table, "", "", &mut found);
    if found.iter().any(|(path, _)| *path == query) {
        found.retain(|(path, _)| *path == query);
        found.truncate(1);
        return found;
    }
    let last = format!(".{query}");
    found.retain(|(path, _)| path.ends_with(&last));
    // What a stage has as well is explained once.
    let outside: Vec<String> = found.iter().map(|(path, _)| path.clone()).collect();
    found.retain(|(path, _)| path.strip_prefix("stage.").is_none_or(|rest| !outside.iter().any(|path| path == rest)));
    found
}

/// Paths of all keys as `--set` takes them, with the first sentence of their documentation. Entries of lists are numbered 0.
pub fn paths(table: &Table) -> Vec<(String, String)> {
    let mut found = Vec::new();
    entries(table, "", ".0", &mut found);
    found.sort_by(|one, other| one.0.cmp(&other.0));
    found.dedup_by(|one, other| one.0 == other.0);
    found.into_iter().map(|(path, entry)| (path, first_sentence(&entry.key.doc).to_owned())).collect()
}

/// Keys that mention something: all words of `query` begin a word of their path, of their documentation or of their values, whatever
/// the case. Each with the first sentence of its documentation; those whose names say it come first, then those whose first sentence does.
pub fn mentions(table: &Table, query: &str) -> Vec<(String, String)> {
    let wanted: Vec<String> = words_in(query).collect();
    if wanted.is_empty() {
        return Vec::new();
    }
    let has = |text: &str| {
        let words: Vec<String> = words_in(text).collect();
        wanted.iter().all(|wanted| words.iter().any(|word| word.starts_with(wanted.as_str())))
    };
    let mut found = Vec::new();
    entries(table, "", "", &mut found);
    let mut ranked: Vec<(u8, String, String)> = found
        .into_iter()
        .filter_map(|(path, entry)| {
            let first = first_sentence(&entry.key.doc);
            let mut all = format!("{path} {}\n", entry.key.doc);
            words(&mut all, &entry.key.shape);
            let rank = [&path, &format!("{path} {first}"), &all].into_iter().position(|text| has(text))?;
            Some((rank as u8, path, first.to_owned()))
        })
        .collect();
    // What a stage has as well is listed once.
    let outside: Vec<String> = ranked.iter().map(|(_, path, _)| path.clone()).collect();
    ranked.retain(|(_, path, _)| {
        path.strip_prefix("stage.").is_none_or(|rest| !outside.iter().any(|path| path == rest))
    });
    ranked.sort_by_key(|(rank, ..)| *rank);
    ranked.dedup_by(|one, other| one.1 == other.1);
    ranked.into_iter().map(|(_, path, sentence)| (path, sentence)).collect()
}

fn words_in(text: &str) -> impl Iterator<Item = String> + '_ {
    text.split(|letter: char| !letter.is_alphanumeric()).filter(|word| !word.is_empty()).map(str::to_lowercase)
}

/// A key explained: documentation, type, unit, default and range.
pub fn explain(path: &str, key: &Key) -> String {
    let mut text = format!("{path}\n");
    for line in wrapped(&key.doc, 96) {
        let _ = writeln!(text, "  {line}");
    }
    let mut row = |name: &str, value: &str| {
        if !value.is_empty() {
            let _ = writeln!(text, "  {name:<10} {value}");
        }
    };
    row("value", &kind(&key.shape));
    row("unit", &key.unit);
    row("default", if key.required { "none: the key is required" } else { &key.default });
    row("range", &range(&key.shape));
    row("at most", &key.most_inverse_of.as_ref().map_or_else(String::new, |other| format!("1 / {other}")));
    row("not with", key.instead_of.as_deref().unwrap_or_default());
    row("used by", &key.procedures.join(", "));
    if key.run_wide {
        row("holds for", "the whole run; not allowed in a stage");
    }
    words(&mut text, &key.shape);
    if let Some(table) = key.shape.table() {
        text += &summary(table, &format!("{path}."));
    }
    if let Shape::Either(shapes) = &key.shape {
        shapes.iter().filter_map(Shape::table).for_each(|table| text += &summary(table, &format!("{path}.")));
    }
    text
}

/// The keys of a table, a line each.
pub fn summary(table: &Table, prefix: &str) -> String {
    let width = table.keys.iter().map(|key| key.name.len()).max().unwrap_or(0) + prefix.len();
    let line = |key: &Key| format!("  {:<width$}  {}\n", format!("{prefix}{}", key.name), first_sentence(&key.doc));
    table.keys.iter().map(line).collect()
}

fn words(text: &mut String, shape: &Shape) {
    match shape {
        Shape::Words(words) => {
            for word in words.iter().filter(|word| !word.doc.is_empty()) {
                let mut lines = wrapped(&word.doc, 80).into_iter();
                let _ = writeln!(text, "  \"{}\": {}", word.word, lines.next().unwrap_or_default());
                lines.for_each(|line| {
                    let _ = writeln!(text, "      {line}");
                });
            }
        }
        other => other.parts().iter().for_each(|shape| words(text, shape)),
    }
}

/// What a value may be, in a few words.
pub(super) fn kind(shape: &Shape) -> String {
    match shape {
        Shape::Boolean => "true or false".to_owned(),
        Shape::Integer(_) => "whole number".to_owned(),
        Shape::Number(_) => "number".to_owned(),
        Shape::Text => "text".to_owned(),
        Shape::Words(words) => words.iter().map(|word| format!("\"{}\"", word.word)).collect::<Vec<_>>().join(", "),
        Shape::Either(shapes) => shapes.iter().map(kind).collect::<Vec<_>>().join(", or "),
        Shape::List { of, .. } if of.table().is_some() => "list of tables".to_owned(),
        Shape::List { of, .. } => format!("list of: {}", kind(of)),
        Shape::Table(table) => {
            let names: Vec<&str> = table.keys.iter().map(|key| key.name.as_str()).collect();
            format!("table {{ {} }}", names.join(", "))
        }
        Shape::Map(of) if **of == Shape::Anything => "table of free names".to_owned(),
        Shape::Map(of) => format!("table of free names, each: {}", kind(of)),
        Shape::Anything => String::new(),
    }
}

/// Limits in words, of a number or of the entries of a list; empty without any.
pub(super) fn range(shape: &Shape) -> String {
    match shape {
        Shape::Integer(bounds) | Shape::Number(bounds) => bounds.words(),
        Shape::List { of, entries } => {
            let count = match entries {
                Bounds { least: Some(least), most: Some(most), .. } if least == most => format!("{least} entries"),
                bounds => match bounds.words() {
                    words if words.is_empty() => words,
                    words => format!("{words} entries"),
                },
            };
            let each = if of.table().is_some() { String::new() } else { range(of) };
            [count, each].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(", each ")
        }
        Shape::Boolean
        | Shape::Text
        | Shape::Words(_)
        | Shape::Either(_)
        | Shape::Table(_)
        | Shape::Map(_)
        | Shape::Anything => String::new(),
    }
}

/// Up to the first full stop that ends a sentence.
fn first_sentence(text: &str) -> &str {
    let end = [". ", "; ", ": "].iter().filter_map(|stop| text.find(stop)).min();
    end.map_or(text.trim_end_matches('.'), |end| &text[..end])
}

fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}
