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

    /// Whether the command line names this part or variant.
    pub(crate) fn names(&self, name: &str) -> bool {
        self.only.iter().any(|only| only == name)
    }

    /// Whether a part is to be measured: it is named, or none of its study's `parts` is.
    pub(crate) fn includes(&self, part: &str, parts: &[&str]) -> bool {
        self.names(part) || !parts.iter().any(|part| self.names(part))
    }
}
