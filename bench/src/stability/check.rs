//! Whether the end of a case is right: against finer runs, and by the energy that went in.
//!
//! Past the peak a cell of some hundred grains is chaotic: equal runs with steps that differ by a hair end at stresses that
//! differ by per cents. So one difference says little. A case whose end differs from that of a finer run by more than a bound
//! is run again a few times with slightly other steps, coarse and fine. It is wrong when no coarse end comes within the bound of
//! a fine one: when the ranges of both groups lie farther apart than it.

use super::outcome::{BUDGET, Class, Increment, Outcome, run};
use super::packings::Slot;
use super::random_stream::{Purpose, RandomStream};
use rve_server::definition::{Accuracy, Packing, RveOptions};
use rve_server::programs::rve_test::ElementTest;

/// Cases that took at most this share of their budget are all checked.
const CHEAP: f64 = 0.1;

/// Share of the others that is checked.
pub(super) const SHARE: f64 = 0.2;

/// Finer runs have half the strain per step and a tenth of the tolerance; both groups vary the step by these factors.
const VARIED: [f64; 6] = [1.0, 0.87, 0.93, 0.81, 0.97, 0.9];

/// Runs of each group before it is decided, and after a first look that found them apart.
const ROUNDS: [usize; 2] = [3, 6];

/// Energy that may seem to come out of nothing, over the largest of the energies: the work is integrated by trapezoids over
/// increments, in which stresses rise and break down.
const FREE_ENERGY: f64 = 0.5;

/// Differences of strain count this much of their share of the path, where stresses are prescribed.
const STRAIN_WEIGHT: f64 = 0.2;

/// Budget of a finer run over that of its case.
const ALLOWANCE: f64 = 10.0;

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
    /// Stored and lost energy that no work was done for, over the largest of them; negative where damping took some.
    pub(super) energy: f64,
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
            energy: f64::NAN,
        }
    }
}

/// Largest accepted difference at the end of a test, over the mean pressure of its path: by default what 400 discs on a biaxial
/// path are apart from slow runs up to 2.4 % of strain (docs/lab-book/verification.md), more in drafts and less in tight ones.
fn bound(accuracy: Accuracy) -> f64 {
    match accuracy {
        Accuracy::Draft => 0.05,
        Accuracy::Default => 0.03,
        Accuracy::Tight => 0.01,
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
        let energy = energy(increments);
        let mut checked = Checked {
            class: *class,
            reason: reason.clone(),
            error: f64::NAN,
            bound: bound(self.test.rve.accuracy),
            gap: f64::NAN,
            energy,
        };
        if matches!(class, Class::Unchecked | Class::NoLoadBearingContacts) && energy > FREE_ENERGY {
            checked.class = Class::Wrong;
            checked.reason = format!("energy out of nothing, {:.0} % of the largest", 100.0 * energy);
        } else if is_chosen {
            self.compare(&mut checked);
        }
        checked
    }

    fn compare(&self, checked: &mut Checked) {
        let scale = self.scale();
        let mut coarse = vec![self.end(self.outcome, scale)];
        let mut fine: Vec<Vec<f64>> = Vec::new();
        for round in ROUNDS.iter().copied().enumerate().flat_map(|(round, count)| {
            // The first finer run alone decides if it agrees.
            if round == 0 { vec![1, count] } else { vec![count] }
        }) {
            for place in fine.len()..round {
                let outcome = run(&self.varied(0.5 * VARIED[place], 0.1), self.slot, self.packing, ALLOWANCE);
                if !matches!(outcome.class, Class::Unchecked | Class::NoLoadBearingContacts) {
                    if place == 0 {
                        checked.class = Class::Unchecked;
                        checked.reason = format!("the finer run: {} {}", outcome.class.name(), outcome.reason);
                    }
                    return;
                }
                fine.push(self.end(&outcome, scale));
            }
            if round == 1 {
                checked.error = gap(&coarse, &fine);
                if checked.error <= checked.bound {
                    break;
                }
                continue;
            }
            for place in coarse.len()..round {
                let outcome = run(&self.varied(VARIED[place], 1.0), self.slot, self.packing, ALLOWANCE);
                if matches!(outcome.class, Class::Unchecked | Class::NoLoadBearingContacts) {
                    coarse.push(self.end(&outcome, scale));
                }
            }
            checked.gap = gap(&coarse, &fine);
            if checked.gap <= checked.bound {
                break;
            }
        }
        let is_apart = checked.error > checked.bound && checked.gap > checked.bound;
        if is_apart {
            checked.class = Class::Wrong;
            checked.reason = format!("ends {:.1} % of the mean pressure away from finer runs", 100.0 * checked.gap);
        } else if checked.class == Class::Unchecked {
            checked.class = Class::Right;
        }
    }

    /// The finest run: that of the outcome with half the strain per step and a tenth of the tolerance, if it comes to rest
    /// everywhere.
    pub(super) fn finer(&self) -> Option<Outcome> {
        let outcome = run(&self.varied(0.5, 0.1), self.slot, self.packing, ALLOWANCE);
        matches!(outcome.class, Class::Unchecked | Class::NoLoadBearingContacts).then_some(outcome)
    }

    /// Largest difference at the end from another run of the same path, over the mean pressure of this one.
    pub(super) fn difference(&self, other: &Outcome) -> f64 {
        let scale = self.scale();
        gap(&[self.end(self.outcome, scale)], &[self.end(other, scale)])
    }

    /// The test with other steps and another tolerance.
    fn varied(&self, step: f64, tolerance: f64) -> ElementTest {
        let options = &self.test.rve;
        let rve = RveOptions {
            strain_per_step: Some(step * options.strain_per_step()),
            tolerance: Some(tolerance * options.tolerance()),
            ..options.clone()
        };
        // The stress control has to be finer than what it is measured by.
        let stress_tolerance = self.test.stress_tolerance * tolerance.max(0.5);
        ElementTest { rve, stress_tolerance, ..self.test.clone() }
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

/// Largest distance, over the components, between the ranges of two groups; 0 where they overlap.
fn gap(one: &[Vec<f64>], other: &[Vec<f64>]) -> f64 {
    let range = |group: &[Vec<f64>], component: usize| {
        group
            .iter()
            .map(|end| end[component])
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
    };
    (0..one[0].len())
        .map(|component| {
            let ((low, high), (other_low, other_high)) = (range(one, component), range(other, component));
            (other_low - high).max(low - other_high).max(0.0)
        })
        .fold(0.0, f64::max)
}

/// Energy stored and lost beyond the work done on the cell, over the largest of the three; NaN for a path of no energy.
fn energy(increments: &[Increment]) -> f64 {
    let (Some(first), Some(last)) = (increments.first(), increments.last()) else { return f64::NAN };
    let mut work = 0.0;
    let mut largest = 0.0f64;
    for pair in increments.windows(2) {
        work += work_between(&pair[0], &pair[1]);
        largest = largest.max(work.abs()).max(pair[1].stored);
    }
    let gained = last.stored - first.stored + last.lost - first.lost;
    let scale = largest.max(first.stored).max(last.lost);
    if scale > 0.0 { (gained - work) / scale } else { f64::NAN }
}

/// Work from one state to the next over the volume of the packing as given, J/m3: mean second Piola stress on the change of
/// the Green strain. Rotations do not enter, however large.
fn work_between(before: &Increment, after: &Increment) -> f64 {
    let pioles = [second_piola(before), second_piola(after)];
    let strains = [right_cauchy_green(before), right_cauchy_green(after)];
    (0..9).map(|k| 0.25 * (pioles[0][k] + pioles[1][k]) * (strains[1][k] - strains[0][k])).sum()
}

/// `F^T F`, as 11, 12, 13, 21, ...
fn right_cauchy_green(one: &Increment) -> [f64; 9] {
    let f = &one.deformation;
    std::array::from_fn(|place| (0..3).map(|k| f[k][place / 3] * f[k][place % 3]).sum())
}

/// Second Piola stress relative to the packing as given, Pa: `J F^-1 sigma F^-T` by cofactors.
fn second_piola(one: &Increment) -> [f64; 9] {
    let f = &one.deformation;
    // `J F^-T`.
    let cofactor: [[f64; 3]; 3] = std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let ([a, b], [c, d]) = ([(i + 1) % 3, (i + 2) % 3], [(j + 1) % 3, (j + 2) % 3]);
            f[a][c] * f[b][d] - f[a][d] * f[b][c]
        })
    });
    let volume: f64 = (0..3).map(|k| f[0][k] * cofactor[0][k]).sum();
    std::array::from_fn(|place| {
        let (i, j) = (place / 3, place % 3);
        let terms = (0..9).map(|pair| cofactor[pair / 3][i] * one.stress[pair / 3][pair % 3] * cofactor[pair % 3][j]);
        terms.sum::<f64>() / volume
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::TrialFlags;

    fn state(deformation: [[f64; 3]; 3], stress: [[f64; 3]; 3], stored: f64) -> Increment {
        Increment { deformation, stress, stored, lost: 0.0, evaluations: 1, flags: TrialFlags::default() }
    }

    #[test]
    fn ranges_that_overlap_have_no_gap_and_others_the_distance_between_them() {
        let group = |values: &[f64]| -> Vec<Vec<f64>> { values.iter().map(|value| vec![0.0, *value]).collect() };
        assert_eq!(gap(&group(&[1.0, 3.0]), &group(&[2.0, 5.0])), 0.0);
        assert_eq!(gap(&group(&[1.0, 2.0]), &group(&[2.5])), 0.5);
        assert_eq!(gap(&group(&[2.5]), &group(&[1.0, 2.0])), 0.5);
    }

    /// A pressure of 10 against which a cell is compressed to half of its height in a hundred increments, turned by 0.3 in
    /// each: the work is 5. All of it stored, the energy is closed; nothing stored, all of it is missing.
    #[test]
    fn work_of_a_constant_pressure_is_pressure_times_volume_whatever_the_rotation() {
        let pressed = [[-10.0, 0.0, 0.0], [0.0, -10.0, 0.0], [0.0, 0.0, -10.0]];
        let states = |stored: f64| -> Vec<Increment> {
            (0..=100)
                .map(|number| {
                    let share = f64::from(number) / 100.0;
                    let (sine, cosine) = (0.3 * f64::from(number)).sin_cos();
                    let height = 1.0 - 0.5 * share;
                    let turned = [[cosine, -sine * height, 0.0], [sine, cosine * height, 0.0], [0.0, 0.0, 1.0]];
                    state(turned, pressed, 1.0 + stored * share)
                })
                .collect()
        };
        // Measured 2e-5.
        assert!(energy(&states(5.0)).abs() < 1e-4, "{}", energy(&states(5.0)));
        assert!((energy(&states(0.0)) + 1.0).abs() < 1e-4);
    }

    /// A uniaxial stress that turns with the cell does no work.
    #[test]
    fn a_stressed_cell_that_only_turns_takes_no_work() {
        let (sine, cosine) = 0.3f64.sin_cos();
        let turned = [[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]];
        let unit = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let along = [[7.0, 0.0, 0.0], [0.0; 3], [0.0; 3]];
        let along_turned = [
            [7.0 * cosine * cosine, 7.0 * cosine * sine, 0.0],
            [7.0 * cosine * sine, 7.0 * sine * sine, 0.0],
            [0.0; 3],
        ];
        assert!(work_between(&state(unit, along, 1.0), &state(turned, along_turned, 1.0)).abs() < 1e-14);
    }
}
