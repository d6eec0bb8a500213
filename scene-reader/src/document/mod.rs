//! A TOML input file with `--set` overrides: parsing, and errors that name file and line.
//!
//! Overrides are applied to the parsed document before anything is read from it, so an overridden key is checked
//! exactly like a written one. To keep places apart, the text of an override is parsed after as many
//! blanks as the file and the earlier overrides are long, so every byte offset belongs to exactly one source.

mod as_run;
mod friction;
mod kind;
mod overrides;
pub(crate) mod renamed;
mod sizes;

pub use kind::Kind;
pub(crate) use sizes::SizesTable;

use crate::input_error::InputError;
use keys::{Fault, Node, Table, Value, deserialize};
use overrides::{Override, insert};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::de::DeTable;

/// An input file and what the command line changes in it.
#[derive(Clone, Debug)]
pub struct Document {
    path: PathBuf,
    text: String,
    overrides: Vec<Override>,
    /// The values, overrides applied, under their present names.
    root: Node,
    warnings: Vec<String>,
}

impl Document {
    /// Reads a file and parses the overrides; the document is known to be well-formed TOML afterwards.
    ///
    /// # Errors
    /// The file cannot be read, is not TOML, holds a NaN or infinity, or an override does not fit it.
    pub fn read(path: &Path, overrides: &[String]) -> Result<Self, InputError> {
        Self::read_in_size(path, None, overrides)
    }

    /// As [`Document::read`], in one of the sizes that the file names; `None`: as the file stands. The overrides come last.
    ///
    /// # Errors
    /// As [`Document::read`]; the file has no such size.
    pub fn read_in_size(path: &Path, size: Option<&str>, overrides: &[String]) -> Result<Self, InputError> {
        let unread = |problem: String| InputError::at(path.display(), format!("could not read it: {problem}"));
        let bytes = std::fs::read(path).map_err(|source| {
            unread(source.to_string()).hint("check the path; it is relative to the current folder")
        })?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let line = 1 + error.as_bytes()[..error.utf8_error().valid_up_to()]
                .iter()
                .filter(|byte| **byte == b'\n')
                .count();
            unread(format!("line {line} is not UTF-8")).hint("save the file in UTF-8")
        })?;
        Self::in_size(path, text, size, overrides)
    }

    /// A document whose text is at hand; `path` is what errors call it and what paths in it are relative to.
    ///
    /// # Errors
    /// As [`Document::read`], but for the reading.
    pub fn from_text(path: &Path, text: String, overrides: &[String]) -> Result<Self, InputError> {
        Self::in_size(path, text, None, overrides)
    }

    fn in_size(path: &Path, text: String, size: Option<&str>, overrides: &[String]) -> Result<Self, InputError> {
        let mut document =
            Self { path: path.to_owned(), text, overrides: Vec::new(), root: Node::table(), warnings: Vec::new() };
        let mut root = document.parse(&document.text)?;
        document.warn(&mut root);
        let sized = sizes::overrides(&document, &mut root, size)?;
        let given = overrides.iter().map(|given| ("--set".to_owned(), given.clone()));
        for (source, given) in sized.into_iter().chain(given) {
            let length = document.overrides.last().map_or(document.text.len(), |last| last.padded.len());
            let (given, warning) = Override::parse(&source, &given, length)?;
            document.warnings.extend(warning.map(|warning| format!("{}: {warning}", given.text)));
            document.overrides.push(given.clone());
            let parsed = document.parse(&given.padded)?;
            let value = parsed.get("v").cloned().unwrap_or_else(Node::table);
            insert(&mut root, "", &given.path, value).map_err(|problem| {
                InputError::at(&given.text, problem)
                    .hint("name an existing table; entries of [[lists]] are numbered from 0, as in boundary.0.set")
            })?;
        }
        document.warn(&mut root);
        document.refuse_non_finite("", &root)?;
        for (span, remark) in friction::remarks(&root) {
            let (place, _) = document.place(&span);
            document.warnings.push(format!("{place}: {remark}"));
        }
        document.root = root;
        Ok(document)
    }

    fn parse(&self, text: &str) -> Result<Node, InputError> {
        Ok(Node::from(&DeTable::parse(text).map_err(|error| self.toml_error(&error))?))
    }

    /// Renames what has an old name, and keeps the warnings.
    fn warn(&mut self, root: &mut Node) {
        for renaming in renamed::rename(root) {
            let (place, _) = self.place(&renaming.span);
            self.warnings.push(format!("{place}: {}", renaming.message));
        }
    }

    /// The sizes that the file names besides the one in which it stands, in alphabetical order.
    pub fn sizes(&self) -> Vec<String> {
        self.parse(&self.text).map(|root| sizes::names(&root)).unwrap_or_default()
    }

    /// Old names that were read as their present ones, and numbers that are probably not what was meant, each with its place: for people.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// What the file is, if one of its keys tells.
    pub(crate) fn kind(&self) -> Option<Kind> {
        // Of the file itself: an override cannot make it another kind.
        let root = self.parse(&self.text).ok()?;
        Kind::ALL.into_iter().find(|kind| root.get(kind.mark()).is_some())
    }

    /// Refuses a file of another command, whose keys would be called unknown.
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

    /// Where the file lies.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A path written in the file, taken relative to the file's own folder.
    pub fn resolve(&self, written: &Path) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(written)
    }

    /// Checks the whole document against the keys of `T` and reads it.
    ///
    /// # Errors
    /// Unknown keys, wrong types, missing keys and numbers out of range, each with file and line.
    pub fn deserialize<T: DeserializeOwned + JsonSchema>(&self) -> Result<T, InputError> {
        let read = keys::check(&self.root, &Table::of::<T>(), &[]).and_then(|()| deserialize(&self.root));
        read.map_err(|fault| self.fault(&fault))
    }

    /// An error about a value that a check has refused.
    pub(crate) fn fault(&self, fault: &Fault) -> InputError {
        let error = if fault.path.is_empty() && fault.span.is_empty() {
            self.error(fault)
        } else if fault.span.is_empty() {
            let path: Vec<&str> = fault.path.iter().map(String::as_str).collect();
            self.error_at_key(&path, fault)
        } else if fault.span == self.root.span {
            self.error(fault)
        } else {
            self.error_at(fault.span.clone(), fault)
        };
        let explain = explain_command(&fault.path);
        error.hint(match &fault.hint {
            Some(hint) if hint.ends_with('?') => format!("{hint} {explain}"),
            Some(hint) => format!("{hint}; {explain}"),
            None => explain,
        })
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
        let written = (1..=path.len()).rev().find_map(|depth| self.root.at(path[..depth].iter().copied()));
        match written {
            Some(node) => self.error_at(node.span.clone(), problem),
            None => self.error(problem),
        }
    }

    /// Where the value at `path` stands, if there is one.
    pub(crate) fn span_of(&self, path: &[&str]) -> Option<Range<usize>> {
        self.root.at(path.iter().copied()).map(|node| node.span.clone())
    }

    /// Whether the file or an override has a value at `path`.
    pub fn is_written(&self, path: &[&str]) -> bool {
        self.root.at(path.iter().copied()).is_some()
    }

    /// An error whose message begins with `table.key`, or with `path segment N:`, `stage N:` or `region N:`, as those of the grain side
    /// do: that gives the place.
    pub fn table_error(&self, problem: impl ToString) -> InputError {
        let problem = problem.to_string();
        let of_list = [("path segment ", "path"), ("stage ", "stage"), ("region ", "region")].into_iter().find_map(
            |(words, list)| {
                let number: usize = problem.strip_prefix(words)?.split(':').next()?.parse().ok()?;
                Some((list, number.saturating_sub(1).to_string()))
            },
        );
        if let Some((list, entry)) = of_list {
            return self.error_at_key(&[list, &entry], &problem).hint(explain_command(&[list.to_owned()]));
        }
        let is_key = |letter: &char| letter.is_ascii_alphanumeric() || "._".contains(*letter);
        let key: String = problem.chars().take_while(is_key).collect();
        let path: Vec<&str> = key.split('.').collect();
        let known: Vec<String> = path
            .iter()
            .enumerate()
            .take_while(|(depth, _)| self.is_written(&path[..=*depth]))
            .map(|(_, part)| (*part).to_owned())
            .collect();
        self.error_at_key(&path, &problem).hint(explain_command(&known))
    }

    fn refuse_non_finite(&self, key: &str, node: &Node) -> Result<(), InputError> {
        match &node.value {
            Value::Number(number) if !number.is_finite() => {
                let number = number.to_string().to_lowercase();
                Err(self
                    .error_at(node.span.clone(), format!("`{key}` is {number}, which is not a finite number"))
                    .hint("every quantity has to be a finite number in SI units"))
            }
            Value::List(entries) => entries.iter().try_for_each(|entry| self.refuse_non_finite(key, entry)),
            Value::Table(members) => {
                members.iter().try_for_each(|(key, member)| self.refuse_non_finite(key, &member.node))
            }
            _ => Ok(()),
        }
    }

    fn toml_error(&self, error: &toml::de::Error) -> InputError {
        let message = error.message().trim().replace('\n', ", ");
        if self.text.trim_start().starts_with('{') {
            return self.error("this is a JSON file, and input files are in TOML").hint(
                "a packing is named in a scene or an element test, as in packing = \"packings/discs-400.json\"",
            );
        }
        let is_twice = message.starts_with("duplicate key");
        let span = error.span();
        let error = match span.clone() {
            Some(span) => self.error_at(span, message),
            None => self.error(message),
        };
        if is_twice {
            error.hint(
                "write each key and each [table] once; entries of a list have double brackets, as in [[boundary]]",
            )
        } else if span.is_some_and(|span| self.has_decimal_comma(&span)) {
            error.hint("numbers have a decimal point, as in 0.45")
        } else {
            error
        }
    }

    /// Whether the line of a byte range has a value like `0,45`.
    fn has_decimal_comma(&self, span: &Range<usize>) -> bool {
        let before = &self.text[..self.text.floor_char_boundary(span.start.min(self.text.len()))];
        let line = self.text.lines().nth(before.matches('\n').count()).unwrap_or_default();
        let value = line.split_once('=').map_or("", |(_, value)| value.trim());
        let is_number = |text: &str| !text.is_empty() && text.chars().all(|sign| sign.is_ascii_digit());
        let is_fraction = |text: &str| is_number(text.split(['e', 'E', ' ', '#']).next().unwrap_or_default());
        value
            .split_once(',')
            .is_some_and(|(whole, rest)| is_number(whole.trim_start_matches(['-', '+'])) && is_fraction(rest))
    }

    /// Name of the place of a byte range, and the line to show.
    fn place(&self, span: &Range<usize>) -> (String, Option<String>) {
        if span.start > self.text.len() {
            let given = self.overrides.iter().find(|given| span.start < given.padded.len());
            return (given.map_or("--set".to_owned(), |given| given.text.clone()), None);
        }
        let before = &self.text[..self.text.floor_char_boundary(span.start)];
        let line = before.matches('\n').count();
        let excerpt = self.text.lines().nth(line).map(|text| format!("{:>5} | {}", line + 1, text.trim_end()));
        (format!("{}:{}", self.path.display(), line + 1), excerpt)
    }
}

/// The command that explains a key or the table that it belongs to.
pub(crate) fn explain_command(path: &[String]) -> String {
    let names: Vec<&str> = path.iter().map(String::as_str).filter(|part| part.parse::<usize>().is_err()).collect();
    match names.join(".") {
        key if key.is_empty() => "`grainspan explain` lists all tables and their keys".to_owned(),
        key => format!("`grainspan explain {key}` describes it"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Deserialize, JsonSchema)]
    #[serde(deny_unknown_fields)]
    struct Sample {
        size: f64,
        #[serde(default)]
        list: Vec<Entry>,
    }

    #[derive(Debug, Deserialize, JsonSchema)]
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
        assert!(wrong.starts_with("sample.toml:2: size must be a number, not the text \"big\""), "{wrong}");
        let unknown = document(TEXT, &["list.0.sett=1"]).unwrap().deserialize::<Sample>().unwrap_err().to_string();
        assert!(unknown.starts_with("--set list.0.sett=1: unknown key `sett` in list.0"), "{unknown}");
        assert!(unknown.contains("hint: did you mean `set`?"), "{unknown}");
        let second = document(TEXT, &["size=1.0", "list.0.set=[1]"]).unwrap();
        let second = second.deserialize::<Sample>().unwrap_err().to_string();
        assert!(second.starts_with("--set list.0.set=[1]: list.0.set must be a text"), "{second}");
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
        assert!(scalar.contains("`size` is a number, which has no keys"), "{scalar}");
        assert!(document(TEXT, &["size"]).unwrap_err().to_string().contains("there is no '='"));
    }

    #[test]
    fn an_added_key_appears_in_the_document_as_run() {
        let document = document(TEXT, &["solver.force=1e-4"]).unwrap();
        let table: toml::Table = document.as_run(&[("size", "new")]).unwrap().parse().unwrap();
        assert_eq!(table["solver"]["force"].as_float(), Some(1e-4));
        assert_eq!(table["size"].as_str(), Some("new"));
    }

    /// Found by a run that could not be continued: the value had taken the place of the header alone, and the text was no TOML.
    #[test]
    fn a_list_of_tables_that_is_replaced_leaves_a_document() {
        let text = "size = 2.0\n[[list]]\nset = \"left\"\n[[list]]\nset = \"right\"\n[mesh]\nkind = \"block\"\n";
        for (given, entries) in [("list=[]", 0), ("list=[{ set = 'top' }]", 1)] {
            let table: toml::Table = document(text, &[given]).unwrap().as_run(&[]).unwrap().parse().unwrap();
            assert_eq!(table["list"].as_array().map(Vec::len), Some(entries));
            assert_eq!(table["mesh"]["kind"].as_str(), Some("block"));
        }
        let table: toml::Table =
            document(text, &["mesh={ kind = 'ring' }"]).unwrap().as_run(&[]).unwrap().parse().unwrap();
        assert_eq!(table["mesh"]["kind"].as_str(), Some("ring"));
    }

    /// The key of a mesh file that goes along with a run is replaced within a table that was replaced itself.
    #[test]
    fn a_key_is_replaced_within_a_table_that_is_replaced() {
        for text in ["mesh = { file = \"a-long-name-of-a-mesh.msh\" }", "[mesh]\nfile = \"a.msh\"\n"] {
            let document = document(text, &["mesh={ file = 'b.msh', element = 'q4' }"]).unwrap();
            let table: toml::Table = document.as_run(&[("mesh.file", "mesh.msh")]).unwrap().parse().unwrap();
            assert_eq!(table["mesh"]["file"].as_str(), Some("mesh.msh"), "{table}");
            assert_eq!(table["mesh"]["element"].as_str(), Some("q4"), "{table}");
        }
    }
}
