//! Cost of an element test, counts of rows with fallbacks, and how it ended.

use super::error::ElementError;
use super::row::ElementRow;
use crate::engine::ListedForces;
use protocol::TrialFlags;

/// Cost of a whole RVE test, and its rows with fallbacks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ElementSummary {
    /// Rows delivered, row 0 included.
    pub rows: u64,
    /// Trials made, rejected ones included.
    pub trials: u64,
    /// DEM steps of all trials.
    pub dem_steps: u64,
    /// DEM steps of the perturbations of all operators.
    pub operator_steps: u64,
    /// Rows in whose increments the cell snapped across a controlled stress: the nearer side was kept, outside the tolerance.
    pub stress_jumps: u64,
    /// Rows whose increment was cut because no strain was found for the controlled stresses.
    pub cut_increments: u64,
    /// Rows in whose increments the unbalanced stress strained the cell in committed steps, because the search for the controlled stresses had
    /// failed.
    pub relaxed_increments: u64,
    /// Rows whose relaxation ended before the grains were at rest; a packing that was to be brought to rest counts as one.
    pub not_equilibrated: u64,
    /// Rows of a cell without load-bearing contacts.
    pub no_load_bearing_contacts: u64,
    /// Rows whose relaxation stagnated and went on with another damping and smaller steps.
    pub damping_changed: u64,
    /// Rows in whose increments numerical damping took more than a tenth of the energy that the contacts store: grains have rearranged suddenly.
    pub sudden_rearrangements: u64,
    /// Rows with an overlap above 10 % of a grain diameter.
    pub large_overlap: u64,
    /// Rows whose operator columns hold the uniform-strain operator because the one requested failed.
    pub tangent_fallbacks: u64,
    /// Rows whose operator needed mechanisms to be held.
    pub tangent_regularised: u64,
    /// Packings, or frames cut out of them, that were far from equilibrium under the law, and were brought to rest before the first increment: 0 or 1.
    pub settled: u64,
    /// The same where the first increment controls a stress: it begins with the motion of the grains.
    pub begins_with_motion: u64,
    /// Packings whose stress and the first stresses of the path differ by more than a factor of ten: 0 or 1.
    pub far_from_targets: u64,
    /// Rows whose grains have more volume than their cell.
    pub negative_void_ratio: u64,
    /// Tangential forces of the packing that were not taken over.
    pub listed_forces: ListedForces,
}

impl ElementSummary {
    /// Counts a row by its flags, its operator and its cost; how its stresses were controlled is for who controls them.
    pub(super) fn note(&mut self, row: &ElementRow) {
        self.rows += 1;
        self.trials += u64::from(row.trials);
        self.dem_steps += row.dem_steps;
        self.not_equilibrated += u64::from(row.flags.contains(TrialFlags::NOT_EQUILIBRATED));
        self.no_load_bearing_contacts += u64::from(row.flags.contains(TrialFlags::NO_LOAD_BEARING_CONTACTS));
        self.damping_changed += u64::from(row.flags.contains(TrialFlags::DAMPING_CHANGED));
        self.large_overlap += u64::from(row.flags.contains(TrialFlags::LARGE_OVERLAP));
        self.negative_void_ratio += u64::from(row.void_ratio < 0.0);
        if let Some(outcome) = &row.tangent {
            self.tangent_fallbacks += u64::from(outcome.fallback);
            self.tangent_regularised += u64::from(outcome.regularised);
        }
    }

    /// All counts by the names that scripts know them by.
    pub fn counts(&self) -> [(&'static str, u64); 19] {
        [
            ("rows", self.rows),
            ("trials", self.trials),
            ("dem_steps", self.dem_steps),
            ("operator_steps", self.operator_steps),
            ("stress_jumps", self.stress_jumps),
            ("cut_increments", self.cut_increments),
            ("relaxed_increments", self.relaxed_increments),
            ("not_equilibrated", self.not_equilibrated),
            ("no_load", self.no_load_bearing_contacts),
            ("large_overlap", self.large_overlap),
            ("damping_changed", self.damping_changed),
            ("sudden_rearrangements", self.sudden_rearrangements),
            ("tangent_fallbacks", self.tangent_fallbacks),
            ("tangents_regularised", self.tangent_regularised),
            ("settled", self.settled),
            ("begins_with_motion", self.begins_with_motion),
            ("far_from_targets", self.far_from_targets),
            ("negative_void_ratio", self.negative_void_ratio),
            ("listed_forces_changed", self.listed_forces.changed() as u64),
        ]
    }

    /// What makes rows less accurate than they were asked for, or the test another one, in words, with the number of rows; those without any
    /// are left out.
    pub fn warnings(&self) -> Vec<(&'static str, u64)> {
        with_any([
            (
                "stress of the packing and the first stresses of the path differ more than tenfold (units, thickness, modulus?)",
                self.far_from_targets,
            ),
            ("void ratio below zero", self.negative_void_ratio),
            (
                "packing, or the frame cut out of it, not at rest under this contact law, brought to rest before the first increment",
                self.settled,
            ),
            (
                "packing, or the frame cut out of it, not at rest under this contact law, the first increment begins with its motion",
                self.begins_with_motion,
            ),
            ("not equilibrated", self.not_equilibrated),
            (
                "controlled stress missed (a sudden rearrangement, or a stress_tolerance below what the tolerance of the grains allows)",
                self.stress_jumps,
            ),
            (
                "controlled stress reached by relaxation in committed steps (no strain met it: a sudden rearrangement, or too small a stress_tolerance)",
                self.relaxed_increments,
            ),
            (
                "sudden rearrangement, after which the path depends on the accuracy (compare seeds, more grains or a smaller `rve.tolerance`)",
                self.sudden_rearrangements,
            ),
            ("no load-bearing contacts", self.no_load_bearing_contacts),
            ("overlap above 10 %", self.large_overlap),
            (
                "operator replaced by truss_like, or by the uniform-strain one where that is singular",
                self.tangent_fallbacks,
            ),
            ("operator with constrained mechanisms", self.tangent_regularised),
        ])
    }

    /// Detours by which rows met the same tolerances, in words, with the number of rows; those without any are left out.
    pub fn fallbacks(&self) -> Vec<(&'static str, u64)> {
        with_any([
            ("relaxed with another damping", self.damping_changed),
            ("increments taken in shorter parts for the stress control", self.cut_increments),
        ])
    }
}

fn with_any<const N: usize>(counts: [(&'static str, u64); N]) -> Vec<(&'static str, u64)> {
    counts.into_iter().filter(|(_, rows)| *rows > 0).collect()
}

/// How an element test has ended.
#[derive(Debug)]
pub struct ElementEnd {
    /// Cost and counts of all rows that were delivered, however the test has ended.
    pub summary: ElementSummary,
    /// Why it was refused or stopped, see [`ElementError`]; rows delivered before stay valid; `Ok` also where `on_row` has ended it.
    pub result: Result<(), ElementError>,
}

impl From<ElementError> for ElementEnd {
    /// A test without any row.
    fn from(error: ElementError) -> Self {
        Self { summary: ElementSummary::default(), result: Err(error) }
    }
}
