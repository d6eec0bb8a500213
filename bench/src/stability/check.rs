//! Whether the end of a case is right: against finer runs, and by the energy that went in.
//!
//! Past the peak a cell of some hundred grains is chaotic: equal runs with steps that differ by a hair end at stresses that
//! differ by per cents. So one difference says little. A case whose end differs from that of a finer run by more than a bound
//! is run again a few times with slightly other steps, coarse and fine. It is wrong when no coarse end comes within the bound of
//! a fine one: when the ranges of both groups lie farther apart than it.

use super::groups::{Compared, FINER, compared, gap};
use super::ledger;
use super::outcome::{BUDGET, Class, Increment, Outcome, run};
use super::packings::Slot;
use super::random_stream::{Purpose, RandomStream};
use super::restless;
use rve_server::definition::{Accuracy, Packing, RveOptions};
use rve_server::programs::rve_test::ElementTest;

/// Cases that took at most this share of their budget are all checked.
const CHEAP: f64 = 0.1;

/// Share of the others that is checked.
pub(super) const SHARE: f64 = 0.2;

/// Differences of strain count this much of their share of the path, where stresses are prescribed.
const STRAIN_WEIGHT: f64 = 0.2;

/// Budget of a finer run over that of its case.
pub(super) const ALLOWANCE: f64 = 10.0;

/// What checking a case has shown.
#[derive(Clone, Debug)]
pub(super) struct Checked {
    /// How the case ended after all.
    pub(super) class: Class,
    /// Why, where that is not plain.
    pub(super) reason: String,
    /// Largest difference of a stress component at the end from the finer run, over the mean pressure of the path; NaN
    /// without one.
    pub(super) error: f64,
    /// What it is compared with.
    pub(super) bound: f64,
    /// Distance of the ranges of coarse and fine runs; NaN where the first finer run agreed.
    pub(super) gap: f64,
    /// How far its energy ledger is [open](ledger::open).
    pub(super) open: f64,
}

impl Checked {
    /// Of a case that has no increments.
    pub(super) fn without_runs(outcome: &Outcome) -> Self {
        Self {
            class: outcome.class,
            reason: outcome.reason.clone(),
            error: f64::NAN,
            bound: f64::NAN,
            gap: f64::NAN,
            open: f64::NAN,
        }
    }
}

/// Largest accepted difference at the end of a test, over the mean pressure of its path: by default what 400 discs on a biaxial
/// path are apart from slow runs up to 2.4 % of strain (docs/lab-book/verification.md), more in drafts and less in tight ones. An error
/// that is asked for stands between the first two: with 5e-3 the strain per step is that of drafts, with 1e-3 that of the default.
pub(crate) fn bound(options: &RveOptions) -> f64 {
    match (options.error, options.accuracy) {
        (Some(error), _) => (10.0 * error).clamp(0.03, 0.05),
        (None, Accuracy::Draft) => 0.05,
        (None, Accuracy::Default) => 0.03,
        (None, Accuracy::Tight) => 0.01,
    }
}

/// The options with other steps and another tolerance: factors on both.
pub(super) fn varied(options: &RveOptions, [step, tolerance]: [f64; 2]) -> RveOptions {
    RveOptions {
        accuracy: Accuracy::Default,
        error: None,
        strain_per_step: Some(step * options.strain_per_step()),
        tolerance: Some(tolerance * options.tolerance()),
        ..options.clone()
    }
}

/// One case that has been run.
pub(super) struct Subject<'a> {
    /// What was run.
    pub(super) test: &'a ElementTest,
    /// Its packing.
    pub(super) slot: &'a Slot,
    /// The same.
    pub(super) packing: &'a Packing,
    /// What it has shown.
    pub(super) outcome: &'a Outcome,
}

impl Subject<'_> {
    /// Whether finer runs of this case are made.
    pub(super) fn is_chosen(&self, seed: u64, number: u64) -> bool {
        let Outcome { class, .. } = self.outcome;
        let work = self.packing.number() as f64 * self.outcome.evaluations() as f64;
        let is_cheap = work <= CHEAP * BUDGET[usize::from(self.slot.dimension == 3)];
        matches!(class, Class::Unchecked | Class::NoLoadBearingContacts)
            && (is_cheap || RandomStream::new(seed, Purpose::Check(number)).chance(SHARE))
    }

    /// The class of the case, with finer runs if the case `is_chosen`.
    pub(super) fn checked(&self, is_chosen: bool) -> Checked {
        let Outcome { class, reason, increments, .. } = self.outcome;
        let is_plain = matches!(class, Class::Unchecked | Class::NoLoadBearingContacts);
        let mut checked = Checked {
            class: *class,
            reason: reason.clone(),
            error: f64::NAN,
            bound: bound(&self.test.rve),
            gap: f64::NAN,
            open: ledger::open(increments),
        };
        if *class == Class::NotAtRest {
            checked.reason = restless::reason(self);
        } else if is_plain && ledger::is_open(checked.open) {
            checked.class = Class::Wrong;
            checked.reason = format!("energy ledger open by {:.0} % of the largest energy", 100.0 * checked.open);
        } else if is_chosen {
            self.compare(&mut checked);
        }
        checked
    }

    fn compare(&self, checked: &mut Checked) {
        let scale = self.scale();
        let mut refused = String::new();
        let comparison = compared(self.end(self.outcome, scale), checked.bound, |setting| {
            let outcome = run(&self.varied(setting), self.slot, self.packing, ALLOWANCE);
            if matches!(outcome.class, Class::Unchecked | Class::NoLoadBearingContacts) {
                return Some(self.end(&outcome, scale));
            }
            refused = format!("the finer run: {} {}", outcome.class.name(), outcome.reason);
            None
        });
        let found = match comparison {
            Compared::Decided(found) => found,
            Compared::Undecided(found) => {
                (checked.error, checked.gap, checked.reason) = (found.error, found.gap, refused);
                return;
            }
            Compared::Nothing => {
                (checked.class, checked.reason) = (Class::Unchecked, refused);
                return;
            }
        };
        (checked.error, checked.gap) = (found.error, found.gap);
        if found.is_apart(checked.bound) {
            checked.class = Class::Wrong;
            checked.reason = format!("ends {:.1} % of the mean pressure away from finer runs", 100.0 * checked.gap);
        } else if checked.class == Class::Unchecked {
            checked.class = Class::Right;
        }
    }

    /// The finest run: that of the outcome with half the strain per step and a tenth of the tolerance, if it comes to rest
    /// everywhere.
    pub(super) fn finer(&self) -> Option<Outcome> {
        let outcome = run(&self.varied(FINER), self.slot, self.packing, ALLOWANCE);
        matches!(outcome.class, Class::Unchecked | Class::NoLoadBearingContacts).then_some(outcome)
    }

    /// Largest difference at the end from another run of the same path, over the mean pressure of this one.
    pub(super) fn difference(&self, other: &Outcome) -> f64 {
        let scale = self.scale();
        gap(&[self.end(self.outcome, scale)], &[self.end(other, scale)])
    }

    /// The test with other steps and another tolerance.
    fn varied(&self, setting: [f64; 2]) -> ElementTest {
        // The stress control has to be finer than what it is measured by.
        let stress_tolerance = self.test.stress_tolerance * setting[1].max(0.5);
        ElementTest { rve: varied(&self.test.rve, setting), stress_tolerance, ..self.test.clone() }
    }

    /// Mean pressure of the path, Pa: the reference of stress differences. Cells that carry no load on most of their path are measured
    /// by the pressure that they began with.
    fn scale(&self) -> f64 {
        let increments = &self.outcome.increments;
        let pressure = |one: &Increment| one.pressure(self.slot.dimension).abs();
        let mean = increments.iter().map(pressure).sum::<f64>() / increments.len() as f64;
        mean.max(0.1 * pressure(&increments[0])).max(f64::MIN_POSITIVE)
    }

    /// What is compared: all stresses at the end, and the strains that a stress control has found.
    fn end(&self, outcome: &Outcome, scale: f64) -> Vec<f64> {
        let last = outcome.increments.last().expect("the packing as given is the first");
        let mut end: Vec<f64> = last.stress.as_flattened().iter().map(|stress| stress / scale).collect();
        let strains = last.deformation.as_flattened().iter().zip([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        let strains: Vec<f64> = strains.map(|(value, unit)| value - unit).collect();
        if self.test.path.iter().any(|segment| segment.stress.values().iter().any(Option::is_some)) {
            let prescribed = self
                .test
                .path
                .iter()
                .flat_map(|segment| segment.strain.values())
                .flatten()
                .fold(0.0, |largest: f64, value| largest.max(value.abs()));
            end.extend(strains.iter().map(|strain| STRAIN_WEIGHT * strain / prescribed));
        }
        end
    }
}
