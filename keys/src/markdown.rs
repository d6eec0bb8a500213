//! The reference: tables of all keys in Markdown.

use super::explain::{kind, range};
use super::shape::{Key, Shape, Table};
use std::fmt::Write;

/// One Markdown table for the keys at the top, and one for each table below it. Tables that stand in a table of the same
/// shape at the top, as those of a stage do, are referred to.
pub fn markdown(root: &Table) -> String {
    let mut text = String::new();
    section(&mut text, root, root.keys.iter().filter(|key| !is_section(key)), root);
    for key in root.keys.iter().filter(|key| is_section(key)) {
        let is_list = matches!(key.shape, Shape::List { .. });
        let (open, close) = if is_list { ("[[", "]]") } else { ("[", "]") };
        let _ = write!(text, "\n## `{open}{}{close}`\n\n{}\n\n", key.name, key.doc);
        let facts = facts(key);
        if !facts.is_empty() {
            let _ = write!(text, "{}.\n\n", facts.join("; "));
        }
        if let Some(table) = key.shape.table() {
            section(&mut text, table, table.keys.iter(), root);
        } else if let Shape::Either(shapes) = &key.shape {
            for table in shapes.iter().filter_map(Shape::table) {
                if !table.doc.is_empty() {
                    let _ = write!(text, "{}\n\n", table.doc);
                }
                section(&mut text, table, table.keys.iter(), root);
                text.push('\n');
            }
        }
    }
    text
}

/// Keys without documentation, and numbers without a unit; their paths.
pub fn undocumented(root: &Table) -> Vec<String> {
    let mut found = Vec::new();
    look(root, "", &mut found);
    found
}

fn look(table: &Table, prefix: &str, found: &mut Vec<String>) {
    for key in &table.keys {
        let path = format!("{prefix}{}", key.name);
        // The key that tells tables apart is documented by them.
        let is_tag = matches!(&key.shape, Shape::Words(words) if words.len() == 1);
        if key.doc.is_empty() && !is_tag {
            found.push(path.clone());
        }
        if key.unit.is_empty() && is_measured(&key.shape) {
            found.push(format!("{path} (unit)"));
        }
        look_below(&key.shape, &path, found);
    }
}

fn look_below(shape: &Shape, path: &str, found: &mut Vec<String>) {
    match shape {
        Shape::Table(table) => look(table, &format!("{path}."), found),
        other => other.parts().iter().for_each(|shape| look_below(shape, path, found)),
    }
}

/// Whether it is a number that needs a unit.
fn is_measured(shape: &Shape) -> bool {
    match shape {
        Shape::Number(_) => true,
        other => other.parts().iter().any(is_measured),
    }
}

/// Whether a key gets a section of its own.
fn is_section(key: &Key) -> bool {
    match &key.shape {
        Shape::Either(shapes) => shapes.iter().all(|shape| shape.table().is_some()),
        shape => shape.table().is_some(),
    }
}

fn section<'a>(text: &mut String, table: &Table, keys: impl Iterator<Item = &'a Key>, root: &Table) {
    text.push_str("| key | unit | default | value | meaning |\n| --- | --- | --- | --- | --- |\n");
    for key in keys {
        rows(text, "", key, table, root);
    }
}

fn rows(text: &mut String, prefix: &str, key: &Key, table: &Table, root: &Table) {
    let at_top = root.key(&key.name).filter(|top| !std::ptr::eq(*top, key) && top.shape.table().is_some());
    let repeated = at_top.filter(|top| has_same_keys(&top.shape, &key.shape) && !std::ptr::eq(table, root));
    let default = if key.required { "required".to_owned() } else { code(&key.default) };
    let value = match repeated {
        Some(top) => format!("as `{}` at the top", top.name),
        None => [kind_in_table(&key.shape), range(&key.shape)]
            .into_iter()
            .filter(|part| !part.is_empty())
            .collect::<Vec<_>>()
            .join(", "),
    };
    let mut meaning = vec![key.doc.clone()];
    meaning.extend(words(&key.shape));
    let facts = facts(key);
    if !facts.is_empty() {
        meaning.push(format!("{}.", facts.join("; ")));
    }
    let name = format!("{prefix}{}", key.name);
    let cells = [format!("`{name}`"), key.unit.clone(), default, value, meaning.join(" ")];
    let _ = writeln!(text, "| {} |", cells.map(|cell| cell.replace('|', "\\|")).join(" | "));
    if repeated.is_none() {
        below(text, &name, &key.shape, root);
    }
}

/// Whether two tables, or lists of them, have the same keys, whatever their own documentation says.
fn has_same_keys(one: &Shape, other: &Shape) -> bool {
    match (one.table(), other.table()) {
        (Some(one), Some(other)) => one.keys == other.keys,
        _ => false,
    }
}

fn below(text: &mut String, name: &str, shape: &Shape, root: &Table) {
    match shape {
        Shape::Table(table) if table.folded => {}
        Shape::Table(table) => table.keys.iter().for_each(|key| rows(text, &format!("{name}."), key, table, root)),
        Shape::Map(of) => below(text, &format!("{name}.NAME"), of, root),
        other => other.parts().iter().for_each(|shape| below(text, name, shape, root)),
    }
}

fn facts(key: &Key) -> Vec<String> {
    let mut facts = Vec::new();
    if let Some(other) = &key.most_inverse_of {
        facts.push(format!("At most 1 / `{other}`"));
    }
    if let Some(other) = &key.instead_of {
        facts.push(format!("Not together with `{other}`"));
    }
    if !key.procedures.is_empty() {
        facts.push(format!("Used by: {}", key.procedures.join(", ")));
    }
    if key.run_wide {
        facts.push("Holds for the whole run".to_owned());
    }
    facts
}

fn words(shape: &Shape) -> Vec<String> {
    match shape {
        Shape::Words(words) if words.iter().any(|word| !word.doc.is_empty()) => {
            words.iter().map(|word| format!("`\"{}\"`: {}", word.word, word.doc)).collect()
        }
        Shape::Words(_) => Vec::new(),
        other => other.parts().iter().flat_map(words).collect(),
    }
}

/// What a value may be; words whose meanings follow are not listed twice.
fn kind_in_table(shape: &Shape) -> String {
    match shape {
        Shape::Words(_) if !words(shape).is_empty() => "word".to_owned(),
        Shape::List { of, .. } if !words(of).is_empty() => "list of words".to_owned(),
        Shape::Either(shapes) => shapes.iter().map(kind_in_table).collect::<Vec<_>>().join(", or "),
        Shape::Table(table) if !table.folded => "table".to_owned(),
        shape => kind(shape),
    }
}

/// A value in code quotes; words as they are.
fn code(default: &str) -> String {
    match default {
        "" => String::new(),
        words if words.contains(' ') && !words.starts_with(['[', '"']) => words.to_owned(),
        value => format!("`{value}`"),
    }
}
