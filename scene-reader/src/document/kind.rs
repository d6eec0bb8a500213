//! The kinds of input files, told apart by a key that only one kind has.

/// What an input file is for.
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
    /// `grainspan study`.
    Study,
}

protocol::keywords! {
    pub Kind {
        Scene => "scene",
        ElementTest => "rve-test",
        Recipe => "packing",
        Specimen => "specimen",
        Study => "study",
    }
}

impl Kind {
    /// The key at the top that only this kind has.
    pub(super) fn mark(self) -> &'static str {
        match self {
            Self::Scene => "mesh",
            Self::ElementTest => "path",
            Self::Recipe => "grading",
            Self::Specimen => "tiles",
            Self::Study => "seeds",
        }
    }

    /// What people call it, with its article.
    pub fn name(self) -> &'static str {
        match self {
            Self::Scene => "a scene",
            Self::ElementTest => "an element test",
            Self::Recipe => "a packing recipe",
            Self::Specimen => "a specimen test",
            Self::Study => "a study",
        }
    }

    /// The command that takes it.
    pub fn command(self) -> &'static str {
        match self {
            Self::Scene => "run",
            Self::ElementTest => "element",
            Self::Recipe => "pack",
            Self::Specimen => "specimen",
            Self::Study => "study",
        }
    }
}
