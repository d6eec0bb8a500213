//! What is wrong with an input: where, what, and the remedy.

use std::fmt;

/// One problem of an input file, a command-line value or a file that they name. Ends the program with exit code 2.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputError {
    place: String,
    problem: String,
    excerpt: Option<String>,
    hint: Option<String>,
}

impl InputError {
    /// The same, of input that is named at a place of another file.
    pub(crate) fn named_at(self, other: &Self) -> Self {
        Self { place: format!("{}: {}", other.place, self.place), ..self }
    }

    /// A problem at a place: `file:line`, a file, or a command-line argument.
    pub fn at(place: impl ToString, problem: impl ToString) -> Self {
        Self { place: place.to_string(), problem: problem.to_string(), excerpt: None, hint: None }
    }

    /// Adds the remedy.
    pub fn hint(mut self, hint: impl ToString) -> Self {
        self.hint = Some(hint.to_string());
        self
    }

    /// Adds another remedy.
    pub fn hint_too(mut self, more: &str) -> Self {
        self.hint = Some(self.hint.map_or_else(|| more.to_owned(), |hint| format!("{hint}; {more}")));
        self
    }

    /// Adds the line in question.
    pub fn excerpt(mut self, excerpt: Option<String>) -> Self {
        self.excerpt = excerpt;
        self
    }
}

impl fmt::Display for InputError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}: {}", self.place, self.problem)?;
        if let Some(excerpt) = &self.excerpt {
            write!(formatter, "\n{excerpt}")?;
        }
        if let Some(hint) = &self.hint {
            write!(formatter, "\nhint: {hint}")?;
        }
        Ok(())
    }
}

impl std::error::Error for InputError {}
