//! A figure as data: what it runs, and how it is drawn from the results.

use super::error::ReproduceError;
use super::results::Results;
use crate::cli::comparison::Comparison;
use charts::{Chart, Map};

/// Size of the calculation behind a figure.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Size {
    /// The same physics on two cores within minutes
    Small,
    /// The parameters of the paper
    Paper,
}

impl Size {
    /// The word for it on the command line.
    pub(super) fn keyword(self) -> &'static str {
        match self {
            Self::Small => "small",
            Self::Paper => "paper",
        }
    }
}

/// Which command makes a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Command {
    /// `grainspan run`.
    Scene,
    /// `grainspan element`, with the columns of a tangent operator if one is named.
    Element(Option<&'static str>),
    /// `grainspan element` with grains, contacts and their pictures in the folder `contacts`.
    Contacts(At),
    /// `grainspan specimen`.
    Specimen,
    /// `grainspan run` that may stop before its end: what it reached belongs to the figure.
    Stopping,
    /// `grainspan run` that may be refused before it begins, with one of these words: the refusal belongs to the figure.
    Refused(&'static [&'static str]),
}

/// Increments of an element test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum At {
    /// The packing as given.
    Start,
    /// The packing as given and the last increment.
    Ends,
}

/// One run of a figure.
#[derive(Clone, Debug)]
pub(super) struct Run {
    /// Name of its folder and of its curve.
    pub(super) name: String,
    /// Input file, from the folder that holds `scenes`.
    pub(super) input: &'static str,
    /// What runs it.
    pub(super) command: Command,
    /// `--size` of the input file; `None`: as the file stands.
    pub(super) size: Option<&'static str>,
    /// Arguments of `--set`.
    pub(super) settings: Vec<String>,
    /// Worker processes where their number belongs to the figure; `None`: those of the command line.
    pub(super) workers: Option<usize>,
}

impl Run {
    /// A run of a file in the size that belongs to that of the figure.
    pub(super) fn new(name: impl Into<String>, input: &'static str, command: Command, size: Size) -> Self {
        let size = (size == Size::Small).then_some("small");
        Self { name: name.into(), input, command, size, settings: Vec::new(), workers: None }
    }

    /// The same run with another setting.
    pub(super) fn set(mut self, setting: impl Into<String>) -> Self {
        self.settings.push(setting.into());
        self
    }

    /// The same run on this number of worker processes, whatever the command line says.
    pub(super) fn on_workers(mut self, count: usize) -> Self {
        self.workers = Some(count);
        self
    }
}

/// A figure of a paper, or one of ours that belongs to a paper's claim.
#[derive(Debug)]
pub(super) struct Figure {
    /// Name on the command line.
    pub(super) name: &'static str,
    /// Paper and figure.
    pub(super) source: &'static str,
    /// What it shows, in one line.
    pub(super) shows: &'static str,
    /// Entries of the verification catalogue, each with a part of the quantities that belong to it; an empty part fits all.
    pub(super) entries: &'static [(&'static str, &'static str)],
    /// Expected run times on two cores, small and paper size.
    pub(super) run_time: (&'static str, &'static str),
    /// The runs that it needs.
    pub(super) runs: fn(Size) -> Vec<Run>,
    /// Pictures and comparison from the results.
    pub(super) evaluate: fn(&Results, Size) -> Result<Outcome, ReproduceError>,
}

/// What a figure says.
#[derive(Debug, Default)]
pub(super) struct Outcome {
    /// Pictures, each with the part of its file name behind that of the figure; empty for the main one.
    pub(super) charts: Vec<(&'static str, Chart)>,
    /// Meshes coloured by a quantity, each with the part of its file name.
    pub(super) maps: Vec<(&'static str, Map)>,
    /// Pictures that a run has drawn, each with the part of its file name.
    pub(super) drawn: Vec<(String, String)>,
    /// Their numbers and ours.
    pub(super) comparisons: Vec<Comparison>,
    /// Remarks: runs that stopped early and why.
    pub(super) notes: Vec<String>,
}
