//! Runs one case and classifies its end.

use super::packings::Slot;
use protocol::{RveError, TangentKind, TrialFlags};
use rve_server::definition::Packing;
use rve_server::programs::rve_test::{ElementError, ElementRow, ElementTest, run_element_on};
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Instant;

/// Grains times force evaluations, after which a case is ended: ten seconds or so of one core. Counted, not timed, so that a
/// case ends at the same increment on every machine.
pub(super) const BUDGET: [f64; 2] = [3e8, 1e8];

/// Share of the pressure of the packing as given, below which a cell bears nothing that anybody could feel: what the grains are
/// not at rest under are touches of rounding errors.
pub(super) const VANISHED: f64 = 1e-8;

/// How a case ended. The order is that of tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Class {
    /// All increments at rest, and a finer run agrees.
    Right,
    /// All increments at rest; no finer run was made, or it had no answer.
    Unchecked,
    /// The grains bear nothing at the end, and the answer says so.
    NoLoadBearingContacts,
    /// Ended by the campaign because it took too much work; all increments so far at rest.
    OverBudget,
    /// An error that says what was the matter.
    Refused,
    /// At least one increment whose answer is flagged as not in equilibrium.
    NotAtRest,
    /// A finer run disagrees, or energy came out of nothing.
    Wrong,
    /// A stress or a strain that is not a finite number.
    NotFinite,
    /// The program panicked.
    Panicked,
}

impl Class {
    /// All classes.
    pub(super) const ALL: [Self; 9] = [
        Self::Right,
        Self::Unchecked,
        Self::NoLoadBearingContacts,
        Self::OverBudget,
        Self::Refused,
        Self::NotAtRest,
        Self::Wrong,
        Self::NotFinite,
        Self::Panicked,
    ];

    /// Name in tables.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::Unchecked => "unchecked",
            Self::NoLoadBearingContacts => "no load-bearing contacts",
            Self::OverBudget => "over budget",
            Self::Refused => "refused",
            Self::NotAtRest => "not at rest",
            Self::Wrong => "wrong",
            Self::NotFinite => "not finite",
            Self::Panicked => "panicked",
        }
    }
}

/// One accepted increment.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Increment {
    /// Deformation gradient relative to the packing.
    pub(super) deformation: [[f64; 3]; 3],
    /// Cauchy stress, Pa, tension positive.
    pub(super) stress: [[f64; 3]; 3],
    /// Stored energy over the volume of the packing as given, J/m3.
    pub(super) stored: f64,
    /// Energy lost to friction over the same volume, J/m3.
    pub(super) lost: f64,
    /// Energy that numerical damping has taken over the same volume, J/m3.
    pub(super) damped: f64,
    /// Work done on the cell over the same volume, J/m3, states between increments included.
    pub(super) work: f64,
    /// Force evaluations, those of rejected trials of the stress control included.
    pub(super) evaluations: u64,
    /// Value of the equilibrium criterion.
    pub(super) unbalanced: f64,
    /// 2 x contacts over grains.
    pub(super) coordination: f64,
    /// Shortcuts.
    pub(super) flags: TrialFlags,
}

impl Increment {
    /// Mean pressure, Pa, compression positive.
    pub(super) fn pressure(&self, dimension: u32) -> f64 {
        -(self.stress[0][0] + self.stress[1][1] + self.stress[2][2]) / f64::from(dimension)
    }
}

/// Result of a run of a case.
#[derive(Clone, Debug)]
pub(super) struct Outcome {
    /// How it ended; never [`Class::Right`] or [`Class::Wrong`], which take a finer run or a look at the energy.
    pub(super) class: Class,
    /// What the program said, for ends that are not plain.
    pub(super) reason: String,
    /// The state of the packing as given, and the accepted increments.
    pub(super) increments: Vec<Increment>,
    /// Wall time, s.
    pub(super) seconds: f64,
}

impl Outcome {
    /// Increments that were answered.
    pub(super) fn answered(&self) -> usize {
        self.increments.len().saturating_sub(1)
    }

    /// Increments whose answer is not in equilibrium.
    pub(super) fn not_at_rest(&self) -> usize {
        self.increments.iter().filter(|one| one.flags.contains(TrialFlags::NOT_EQUILIBRATED)).count()
    }

    /// Those of them in which the cell has lost its pressure.
    pub(super) fn not_at_rest_unloaded(&self, dimension: u32) -> usize {
        let Some(first) = self.increments.first() else { return 0 };
        let limit = VANISHED * first.pressure(dimension).abs();
        let is_gas = |one: &&Increment| {
            one.flags.contains(TrialFlags::NOT_EQUILIBRATED) && one.pressure(dimension).abs() <= limit
        };
        self.increments.iter().filter(is_gas).count()
    }

    /// Force evaluations of all increments.
    pub(super) fn evaluations(&self) -> u64 {
        self.increments.iter().map(|one| one.evaluations).sum()
    }

    /// Force evaluations of the slowest increment.
    pub(super) fn slowest(&self) -> u64 {
        self.increments.iter().map(|one| one.evaluations).max().unwrap_or(0)
    }
}

/// Runs a test on a packing; `allowance` multiplies the budget.
pub(super) fn run(test: &ElementTest, slot: &Slot, packing: &Packing, allowance: f64) -> Outcome {
    let begun = Instant::now();
    let grains = packing.number() as f64;
    let budget = allowance * BUDGET[usize::from(slot.dimension == 3)];
    let mut increments: Vec<Increment> = Vec::new();
    let mut work = 0.0;
    let mut is_finite = true;
    let mut on_row = |row: &ElementRow| {
        let increment = increment_of(row);
        is_finite &= increment
            .stress
            .as_flattened()
            .iter()
            .chain(increment.deformation.as_flattened())
            .all(|value| value.is_finite())
            && increment.stored.is_finite()
            && increment.lost.is_finite();
        work += grains * row.dem_steps as f64;
        increments.push(increment);
        if work > budget || !is_finite { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let ended = catch_unwind(AssertUnwindSafe(|| {
        run_element_on(test, packing.clone(), TangentKind::None, &mut on_row).result
    }));
    let planned: u64 =
        test.path.iter().map(|segment| u64::from(segment.increments) * u64::from(segment.repeat)).sum();
    let mut outcome = Outcome {
        class: Class::Unchecked,
        reason: String::new(),
        increments,
        seconds: begun.elapsed().as_secs_f64(),
    };
    (outcome.class, outcome.reason) = match ended {
        Err(panic) => (Class::Panicked, said(panic.as_ref())),
        Ok(Err(error)) => ended_early(&error),
        Ok(Ok(())) if !is_finite => (Class::NotFinite, "an answer that is not finite".to_owned()),
        Ok(Ok(())) if outcome.not_at_rest() > 0 => (Class::NotAtRest, String::new()),
        Ok(Ok(())) if (outcome.answered() as u64) < planned => (Class::OverBudget, String::new()),
        Ok(Ok(())) => {
            let is_apart = outcome
                .increments
                .last()
                .is_some_and(|last| last.flags.contains(TrialFlags::NO_LOAD_BEARING_CONTACTS));
            (if is_apart { Class::NoLoadBearingContacts } else { Class::Unchecked }, String::new())
        }
    };
    outcome
}

fn increment_of(row: &ElementRow) -> Increment {
    let [[a, b, c], [d, e, f], [g, h, i]] = row.deformation;
    let volume = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
    Increment {
        deformation: row.deformation,
        stress: row.stress,
        stored: row.elastic_energy * volume,
        lost: row.frictional_dissipation * volume,
        damped: row.damping_work.unwrap_or(0.0) * volume,
        work: row.work * volume,
        evaluations: row.dem_steps,
        unbalanced: row.unbalanced_force_ratio,
        coordination: row.coordination_number,
        flags: row.flags,
    }
}

fn ended_early(error: &ElementError) -> (Class, String) {
    let class = match error {
        ElementError::Cell { reason: RveError::NotFinite { .. }, .. } => Class::NotFinite,
        _ => Class::Refused,
    };
    (class, error.to_string())
}

/// Message of a panic.
fn said(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
    text.unwrap_or("a panic without a message").to_owned()
}
