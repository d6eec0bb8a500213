//! A TOML input file with `--set` overrides: parsing, and errors that name file and line.
//!
//! Overrides are applied to the parsed document before anything is read from it, so an overridden key is checked
//! exactly like a written one. The trick that keeps places apart: the text of an override is parsed behind as many
//! blanks as the file and the earlier overrides are long, so every byte offset belongs to exactly one source.

use super::input_error::InputError;
use serde::de::DeserializeOwned;
use std::borrow::Cow;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// One `--set key.path=VALUE`.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Override {
    /// As given on the command line.
    text: String,
    /// Path to the key; a number selects an entry of an array, from 0.
    path: Vec<String>,
    /// The value as TOML text.
    value: String,
    /// `v=VALUE` behind as many blanks as the file and the earlier overrides are long.
    padded: String,
}

/// What an input file is for, told from the keys that only one kind has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// `grainspan run` and `grainspan check`.
    Scene,
    /// `grainspan element`.
    ElementTest,
    /// `grainspan pack`.
    Recipe,
    /// `grainspan specimen`.
    Specimen,
}

impl Kind {
    const ALL: [Self; 4] = [Self::Scene, Self::ElementTest, Self::Recipe, Self::Specimen];

    /// The key at the top that tells it.
    fn mark(self) -> &'static str {
        match self {
            Self::Scene => "mesh",
            Self::ElementTest => "path",
            Self::Recipe => "grading",
            Self::Specimen => "cut",
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Scene => "a scene",
            Self::ElementTest => "an element test",
            Self::Recipe => "a recipe of a packing",
            Self::Specimen => "a test of a whole specimen",
        }
    }

    fn command(self) -> &'static str {
        match self {
            Self::Scene => "run",
            Self::ElementTest => "element",
            Self::Recipe => "pack",
            Self::Specimen => "specimen",
        }
    }

    /// Where its keys are described.
    fn reference(self) -> &'static str {
        match self {
            Self::Scene | Self::ElementTest => "docs/scene.md",
            Self::Recipe => "docs/guide/packings.md",
            Self::Specimen => "docs/guide/specimens.md",
        }
    }
}

/// An input file and what the command line changes in it.
#[derive(Clone, Debug)]
pub struct Document {
    path: PathBuf,
    text: String,
    overrides: Vec<Override>,
}

impl Document {
    /// Reads a file and parses the overrides; the document is known to be well-formed TOML afterwards.
    ///
    /// # Errors
    /// The file cannot be read, is not TOML, holds a NaN or infinity, or an override does not fit it.
    pub fn read(path: &Path, overrides: &[String]) -> Result<Self, InputError> {
        let text = std::fs::read_to_string(path).map_err(|source| {
            InputError::at(path.display(), format!("could not read it: {source}"))
                .hint("check the path; it is relative to the current folder")
        })?;
        Self::from_text(path, text, overrides)
    }

    /// A document whose text is at hand; `path` is what errors call it and what paths in it are relative to.
    ///
    /// # Errors
    /// As [`Document::read`], but for the reading.
    pub fn from_text(path: &Path, text: String, overrides: &[String]) -> Result<Self, InputError> {
        let mut document = Self { path: path.to_owned(), text, overrides: Vec::new() };
        for given in overrides {
            let parsed = document.parse_override(given)?;
            document.overrides.push(parsed);
        }
        let root = document.table()?;
        document.refuse_non_finite(root.get_ref())?;
        Ok(document)
    }

    /// What the file is, if one of its keys tells.
    fn kind(&self) -> Option<Kind> {
        // Of the file itself: errors about overrides ask for the kind as well.
        let root = DeTable::parse(&self.text).ok()?;
        Kind::ALL.into_iter().find(|kind| root.get_ref().contains_key(kind.mark()))
    }

    /// Refuses a file of another command, which would be told of unknown keys.
    ///
    /// # Errors
    /// The file is of another kind; the command that takes it is named.
    pub fn expect(&self, wanted: Kind) -> Result<(), InputError> {
        match self.kind() {
            Some(found) if found != wanted => Err(self
                .error(format!("this is {}, not {}: it has the key `{}`", found.name(), wanted.name(), found.mark()))
                .hint(format!("grainspan {} {}", found.command(), self.path.display()))),
            _ => Ok(()),
        }
    }

    /// Where the keys of this file are described.
    fn reference(&self) -> &'static str {
        self.kind().unwrap_or(Kind::Scene).reference()
    }

    /// Where the file lies.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A path written in the file, taken relative to the file's own folder.
    pub fn resolve(&self, written: &Path) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(written)
    }

    /// Reads the whole document into `T`.
    ///
    /// # Errors
    /// Unknown keys, wrong types and missing keys, each with file and line.
    pub fn deserialize<T: DeserializeOwned>(&self) -> Result<T, InputError> {
        let root = self.table()?;
        T::deserialize(toml::de::Deserializer::from(root)).map_err(|error| self.toml_error(&error))
    }

    /// An error about the text at `span`, with its place.
    pub fn error_at(&self, span: Range<usize>, problem: impl ToString) -> InputError {
        let (place, excerpt) = self.place(&span);
        InputError::at(place, problem.to_string()).excerpt(excerpt)
    }

    /// An error about the file as a whole.
    pub fn error(&self, problem: impl ToString) -> InputError {
        InputError::at(self.path.display(), problem.to_string())
    }

    /// An error about the value at `path`, or about the nearest table above it that is written.
    pub fn error_at_key(&self, path: &[&str], problem: impl ToString) -> InputError {
        let path: Vec<String> = path.iter().map(|&part| part.to_owned()).collect();
        let written = self
            .table()
            .ok()
            .and_then(|root| (1..=path.len()).rev().find_map(|depth| find(root.get_ref(), &path[..depth])));
        match written {
            Some(span) => self.error_at(span, problem),
            None => self.error(problem),
        }
    }

    /// Whether the file or an override has a value at `path`.
    pub fn is_written(&self, path: &[&str]) -> bool {
        let path: Vec<String> = path.iter().map(|&part| part.to_owned()).collect();
        self.table().is_ok_and(|root| find(root.get_ref(), &path).is_some())
    }

    /// An error whose message begins with `table.key` or `path segment N`, as those of the grain side do: that gives
    /// the place.
    pub fn table_error(&self, problem: impl ToString) -> InputError {
        let problem = problem.to_string();
        let located = if let Some(rest) = problem.strip_prefix("path segment ") {
            let number: usize = rest.split(':').next().and_then(|text| text.parse().ok()).unwrap_or(1);
            self.error_at_key(&["path", &(number - 1).to_string()], &problem)
        } else {
            let is_key = |letter: &char| letter.is_ascii_alphanumeric() || "._".contains(*letter);
            let key: String = problem.chars().take_while(is_key).collect();
            self.error_at_key(&key.split('.').collect::<Vec<_>>(), &problem)
        };
        located.hint(format!("the keys, their units and defaults are in {}", self.reference()))
    }

    /// The document with overrides applied and `replacements` made (path to a key with dots, its new value), as TOML text.
    /// Comments and layout of the file are kept as long as every change concerns a key that the file has.
    pub fn as_run(&self, replacements: &[(&str, &str)]) -> Result<String, InputError> {
        let overrides = self.overrides.iter().map(|given| (given.path.clone(), given.value.clone()));
        let more = replacements
            .iter()
            .map(|(path, value)| (parts(path), toml::Value::String((*value).to_owned()).to_string()));
        let changes: Vec<(Vec<String>, String)> = overrides.chain(more).collect();
        let mut edits: Vec<(Range<usize>, &str)> = Vec::new();
        let root = DeTable::parse(&self.text).map_err(|error| self.toml_error(&error))?;
        for (path, value) in &changes {
            match find(root.get_ref(), path) {
                Some(span) => {
                    edits.retain(|(other, _)| *other != span);
                    edits.push((span, value));
                }
                None => return self.rewritten(&changes),
            }
        }
        edits.sort_by_key(|(span, _)| std::cmp::Reverse(span.start));
        let mut text = self.text.clone();
        for (span, value) in edits {
            text.replace_range(span, value);
        }
        Ok(text)
    }

    /// The document written anew, without comments: the way when a change adds a key.
    fn rewritten(&self, changes: &[(Vec<String>, String)]) -> Result<String, InputError> {
        let mut table: toml::Table = self.deserialize()?;
        for (path, value) in changes {
            replace(&mut table, path, toml_value(value));
        }
        toml::to_string(&table).map_err(|error| self.error(format!("could not be written anew: {error}")))
    }

    fn parse_override(&self, given: &str) -> Result<Override, InputError> {
        let place = format!("--set {given}");
        let Some((path, value)) = given.split_once('=') else {
            return Err(InputError::at(place, "there is no '='").hint("write --set key.path=VALUE"));
        };
        let path: Vec<String> = path.trim().split('.').map(|part| part.trim().to_owned()).collect();
        if path.iter().any(String::is_empty) || value.contains('\n') {
            return Err(InputError::at(place, "the key path is not usable").hint("write --set key.path=VALUE"));
        }
        let value = toml_value(value.trim()).to_string();
        let blanks = self.overrides.last().map_or(self.text.len(), |last| last.padded.len()) + 1;
        let padded = format!("{}v={value}", " ".repeat(blanks));
        Ok(Override { text: given.to_owned(), path, value, padded })
    }

    fn table(&self) -> Result<Spanned<DeTable<'_>>, InputError> {
        let mut root = DeTable::parse(&self.text).map_err(|error| self.toml_error(&error))?;
        for given in &self.overrides {
            let mut parsed = DeTable::parse(&given.padded).map_err(|error| self.toml_error(&error))?;
            let value = parsed.get_mut().remove("v").expect("the padded text sets v");
            insert(root.get_mut(), &given.path, value).map_err(|problem| {
                InputError::at(format!("--set {}", given.text), problem)
                    .hint("name an existing table; entries of [[lists]] are numbered from 0, as in boundary.0.set")
            })?;
        }
        Ok(root)
    }

    fn refuse_non_finite(&self, table: &DeTable<'_>) -> Result<(), InputError> {
        table.iter().try_for_each(|(key, value)| self.refuse_non_finite_value(key.get_ref(), value))
    }

    fn refuse_non_finite_value(&self, key: &str, value: &Spanned<DeValue<'_>>) -> Result<(), InputError> {
        match value.get_ref() {
            DeValue::Float(number) if !number.as_str().replace('_', "").parse().is_ok_and(f64::is_finite) => {
                Err(self
                    .error_at(value.span(), format!("`{key}` is {}, which is not a finite number", number.as_str()))
                    .hint("every quantity has to be a finite number in SI units"))
            }
            DeValue::Array(entries) => entries.iter().try_for_each(|entry| self.refuse_non_finite_value(key, entry)),
            DeValue::Table(table) => self.refuse_non_finite(table),
            _ => Ok(()),
        }
    }

    fn toml_error(&self, error: &toml::de::Error) -> InputError {
        let message = in_plain_words(error.message());
        let located = match error.span() {
            Some(span) => self.error_at(span, &message),
            None => self.error(&message),
        };
        located.hint(suggestion(&message, &format!("all keys are described in {}", self.reference())))
    }

    /// Name of the place of a byte range, and the line to show.
    fn place(&self, span: &Range<usize>) -> (String, Option<String>) {
        if span.start > self.text.len() {
            let given = self.overrides.iter().find(|given| span.start < given.padded.len());
            return (given.map_or("--set".to_owned(), |given| format!("--set {}", given.text)), None);
        }
        let before = &self.text[..self.text.floor_char_boundary(span.start)];
        let line = before.matches('\n').count();
        let excerpt = self.text.lines().nth(line).map(|text| format!("{:>5} | {}", line + 1, text.trim_end()));
        (format!("{}:{}", self.path.display(), line + 1), excerpt)
    }
}

/// Sets the value at `path`; tables on the way are made, array entries have to exist.
fn insert<'a>(table: &mut DeTable<'a>, path: &[String], value: Spanned<DeValue<'a>>) -> Result<(), String> {
    let (key, rest) = path.split_first().expect("a path has at least one part");
    if rest.is_empty() {
        table.insert(Spanned::new(value.span(), Cow::Owned(key.clone())), value);
        return Ok(());
    }
    if !table.contains_key(key.as_str()) {
        let empty = Spanned::new(value.span(), DeValue::Table(DeTable::new()));
        table.insert(Spanned::new(value.span(), Cow::Owned(key.clone())), empty);
    }
    let next = table.get_mut(key.as_str()).expect("just inserted if it was missing");
    insert_below(next.get_mut(), key, rest, value)
}

fn insert_below<'a>(
    parent: &mut DeValue<'a>,
    name: &str,
    path: &[String],
    value: Spanned<DeValue<'a>>,
) -> Result<(), String> {
    match parent {
        DeValue::Table(table) => insert(table, path, value),
        DeValue::Array(entries) => {
            let count = entries.len();
            let (index, rest) = path.split_first().expect("a path has at least one part");
            let entry = index
                .parse::<usize>()
                .ok()
                .and_then(|index| entries.get_mut(index))
                .ok_or_else(|| format!("`{name}` is a list of {count} entries, and '{index}' is none of them"))?;
            if rest.is_empty() {
                *entry = value;
                return Ok(());
            }
            insert_below(entry.get_mut(), name, rest, value)
        }
        other => Err(format!("`{name}` is a {}, which has no keys", other.type_str())),
    }
}

/// The parts of a path with dots.
fn parts(path: &str) -> Vec<String> {
    path.split('.').map(str::to_owned).collect()
}

/// Replaces the value at `path`, where there is one or could be one.
fn replace(table: &mut toml::Table, path: &[String], value: toml::Value) {
    let Some((key, rest)) = path.split_first() else { return };
    if rest.is_empty() {
        table.insert(key.clone(), value);
        return;
    }
    let Some(mut place) = table.get_mut(key) else { return };
    for part in rest {
        let below = match place {
            toml::Value::Table(table) => table.get_mut(part),
            toml::Value::Array(entries) => part.parse::<usize>().ok().and_then(|index| entries.get_mut(index)),
            _ => None,
        };
        let Some(below) = below else { return };
        place = below;
    }
    *place = value;
}

/// Where the value at `path` stands in the file, if it does.
fn find(table: &DeTable<'_>, path: &[String]) -> Option<Range<usize>> {
    let (key, rest) = path.split_first()?;
    let mut value = table.get(key.as_str())?;
    for part in rest {
        value = match value.get_ref() {
            DeValue::Table(table) => table.get(part.as_str())?,
            DeValue::Array(entries) => entries.get(part.parse::<usize>().ok()?)?,
            _ => return None,
        };
    }
    Some(value.span())
}

/// A command-line value: TOML if it is, else a string.
fn toml_value(text: &str) -> toml::Value {
    match format!("v = {text}").parse::<toml::Table>() {
        Ok(mut table) if table.len() == 1 => table.remove("v").unwrap_or(toml::Value::String(text.to_owned())),
        _ => toml::Value::String(text.to_owned()),
    }
}

/// The parser's message without the words of the programming language.
fn in_plain_words(message: &str) -> String {
    let words = [
        ("\n", ", "),
        ("unknown field", "unknown key"),
        ("missing field", "missing key"),
        ("unknown variant", "unknown word"),
        ("expected usize", "expected a whole number from 0 on"),
        ("expected u64", "expected a whole number from 0 on"),
        ("expected u32", "expected a whole number from 0 on"),
        ("expected f64", "expected a number"),
        ("expected path string", "expected a path in quotes"),
        ("struct Components", "a table such as { y = 0.0 }"),
    ];
    words.into_iter().fold(message.trim().to_owned(), |text, (from, to)| text.replace(from, to))
}

/// "did you mean" for messages that list what is possible: `...` names in backticks, the first is the wrong one.
fn suggestion(message: &str, reference: &str) -> String {
    if !message.starts_with("unknown") {
        return reference.to_owned();
    }
    let mut names = message.split('`').skip(1).step_by(2);
    let Some(wrong) = names.next() else { return reference.to_owned() };
    let distance = |name: &str| if name.starts_with(wrong) { 0 } else { edit_distance(wrong, name) };
    match names.map(|name| (distance(name), name)).min() {
        Some((distance, name)) if distance <= wrong.len().div_ceil(2).min(4) => {
            format!("did you mean `{name}`? {reference}")
        }
        _ => reference.to_owned(),
    }
}

/// Number of single-character insertions, deletions and replacements between two short names.
fn edit_distance(from: &str, to: &str) -> usize {
    let to: Vec<char> = to.chars().collect();
    let mut row: Vec<usize> = (0..=to.len()).collect();
    for (line, character) in from.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = line + 1;
        for column in 0..to.len() {
            let replaced = diagonal + usize::from(to[column] != character);
            diagonal = row[column + 1];
            row[column + 1] = replaced.min(diagonal + 1).min(row[column] + 1);
        }
    }
    row[to.len()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Sample {
        size: f64,
        #[serde(default)]
        list: Vec<Entry>,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Entry {
        set: String,
    }

    const TEXT: &str = "# comment\nsize = 2.0 # m\n[[list]]\nset = \"left\"\n";

    fn document(text: &str, overrides: &[&str]) -> Result<Document, InputError> {
        let overrides: Vec<String> = overrides.iter().map(|&given| given.to_owned()).collect();
        Document::from_text(Path::new("sample.toml"), text.to_owned(), &overrides)
    }

    #[test]
    fn overrides_change_keys_entries_of_lists_and_bare_words() {
        let document = document(TEXT, &["size=3.5", "list.0.set = right"]).unwrap();
        let sample: Sample = document.deserialize().unwrap();
        assert_eq!((sample.size, sample.list[0].set.as_str()), (3.5, "right"));
        let text = document.as_run(&[]).unwrap();
        assert_eq!(text, "# comment\nsize = 3.5 # m\n[[list]]\nset = \"right\"\n");
    }

    #[test]
    fn errors_name_the_line_or_the_override() {
        let wrong = document("\nsize = \"big\"\n", &[]).unwrap().deserialize::<Sample>().unwrap_err().to_string();
        assert!(wrong.starts_with("sample.toml:2: invalid type: string \"big\", expected a number"), "{wrong}");
        let unknown = document(TEXT, &["list.0.sett=1"]).unwrap().deserialize::<Sample>().unwrap_err().to_string();
        assert!(unknown.starts_with("--set list.0.sett=1: unknown key `sett`"), "{unknown}");
        assert!(unknown.contains("hint: did you mean `set`?"), "{unknown}");
        let second = document(TEXT, &["size=1.0", "list.0.set=[1]"]).unwrap();
        let second = second.deserialize::<Sample>().unwrap_err().to_string();
        assert!(second.starts_with("--set list.0.set=[1]: invalid type"), "{second}");
        let malformed = document("size = 1.0\nlist = [\n", &[]).unwrap_err().to_string();
        assert!(malformed.starts_with("sample.toml:2: ") || malformed.starts_with("sample.toml:3: "), "{malformed}");
    }

    #[test]
    fn numbers_that_are_not_finite_are_refused_wherever_they_stand() {
        let written = document("a = 1\n[t]\nx = [1.0, nan]\n", &[]).unwrap_err().to_string();
        assert!(written.starts_with("sample.toml:3: `x` is nan"), "{written}");
        let given = document(TEXT, &["size=-inf"]).unwrap_err().to_string();
        assert!(given.starts_with("--set size=-inf: `size` is -inf"), "{given}");
    }

    #[test]
    fn overrides_that_do_not_fit_say_why() {
        let list = document(TEXT, &["list.3.set=x"]).unwrap_err().to_string();
        assert!(list.contains("`list` is a list of 1 entries, and '3' is none of them"), "{list}");
        let scalar = document(TEXT, &["size.x=1"]).unwrap_err().to_string();
        assert!(scalar.contains("`size` is a float, which has no keys"), "{scalar}");
        assert!(document(TEXT, &["size"]).unwrap_err().to_string().contains("there is no '='"));
    }

    #[test]
    fn an_added_key_appears_in_the_document_as_run() {
        let document = document(TEXT, &["solver.force=1e-4"]).unwrap();
        let table: toml::Table = document.as_run(&[("size", "new")]).unwrap().parse().unwrap();
        assert_eq!(table["solver"]["force"].as_float(), Some(1e-4));
        assert_eq!(table["size"].as_str(), Some("new"));
    }
}
