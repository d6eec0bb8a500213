//! How much a study may do.

use crate::stability_options::Options;

/// How long a study may measure.
#[derive(Clone, Debug, Default)]
pub(crate) struct Effort {
    /// Whether seconds must do: the numbers then show only that the study works.
    pub(crate) quick: bool,
    /// Whether hours may do: sizes as published, in studies that have a smaller one for every day.
    pub(crate) full: bool,
    /// Parts and variants that are wanted, by name; empty: all of them.
    pub(crate) only: Vec<String>,
    /// What only the study of stability reads.
    pub(crate) stability: Options,
}

impl Effort {
    /// `thorough` repetitions, or `quick` ones when seconds must do.
    pub(crate) fn choose<T>(&self, thorough: T, quick: T) -> T {
        if self.quick { quick } else { thorough }
    }

    /// Refuses a name that is none of the `parts`: everything would be measured, or nothing.
    ///
    /// # Errors
    /// The first such name, with those that there are.
    pub(crate) fn refuse_unknown(&self, parts: &[String]) -> Result<(), String> {
        let Some(unknown) = self.only.iter().find(|only| !parts.contains(only)) else { return Ok(()) };
        let quick = if self.quick { " with --quick" } else { "" };
        Err(match parts {
            [] => format!("--only {unknown}: this study has no parts\nhint: leave --only out"),
            _ => format!("--only {unknown}: there is no such part{quick}\nhint: name one of {}", parts.join(", ")),
        })
    }

    /// Whether the command line names this part or variant.
    pub(crate) fn names(&self, name: &str) -> bool {
        self.only.iter().any(|only| only == name)
    }

    /// Whether a part is to be measured: it is named, or none of its study's `parts` is.
    pub(crate) fn includes(&self, part: &str, parts: &[&str]) -> bool {
        self.names(part) || !parts.iter().any(|part| self.names(part))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A misspelt name measured the whole study.
    #[test]
    fn names_that_are_no_parts_are_refused() {
        let effort = |only: &[&str], quick| Effort {
            quick,
            only: only.iter().map(|&name| name.to_owned()).collect(),
            ..Effort::default()
        };
        let parts = ["one".to_owned(), "two".to_owned()];
        effort(&[], false).refuse_unknown(&[]).unwrap();
        effort(&["two", "one"], false).refuse_unknown(&parts).unwrap();
        let refused = effort(&["one", "tow"], false).refuse_unknown(&parts).unwrap_err();
        assert!(refused.contains("--only tow") && refused.contains("one, two"), "{refused}");
        assert!(effort(&["tow"], true).refuse_unknown(&parts).unwrap_err().contains("with --quick"));
        assert!(effort(&["one"], false).refuse_unknown(&[]).unwrap_err().contains("has no parts"));
    }
}
