//! The energy ledger of a case: work done on the cell against what is stored and what friction took.
//!
//! The work is integrated by trapezoids over increments, in which stresses rise and break down. So where the ledger of a case is
//! open, the case is run again with each increment cut into smaller ones, and where it stays open the cause is named.

use super::outcome::{Class, Increment, Outcome};
use protocol::TrialFlags;
use rve_server::contact::ContactTable;
use rve_server::programs::rve_test::ElementTest;

/// Energy that may be missing or left over, over the largest of the energies.
const LIMIT: f64 = 0.1;

/// Parts that an increment is cut into where the ledger is open; the second only where energy seems to come out of nothing.
const SPLITS: [u32; 2] = [8, 64];

/// Share of the increments that is looked at for snaps, the largest losses first.
const FEW: f64 = 0.05;

/// How well the energy of a case is accounted for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ledger {
    /// Energy stored and lost beyond the work done, over the largest of the three; negative where some is missing.
    pub(super) open: f64,
    /// The same of the run with the smallest increments; NaN where there is none.
    pub(super) finest: f64,
    /// Parts that each increment was cut into for it.
    pub(super) split: u32,
    /// Why the ledger is open over the increments of the case; empty where it is not.
    pub(super) cause: &'static str,
}

impl Default for Ledger {
    fn default() -> Self {
        Self { open: f64::NAN, finest: f64::NAN, split: 1, cause: "" }
    }
}

impl Ledger {
    /// Over the increments as they are.
    pub(super) fn of(increments: &[Increment]) -> Self {
        let open = open(increments);
        let cause = if open.abs() > LIMIT { "not examined: the case has no answer" } else { "" };
        Self { open, cause, ..Self::default() }
    }

    /// The value over the smallest increments that there are.
    pub(super) fn best(&self) -> f64 {
        if self.finest.is_nan() { self.open } else { self.finest }
    }

    /// Whether energy comes out of nothing even over the smallest increments.
    pub(super) fn is_free(&self) -> bool {
        self.best() > LIMIT
    }

    /// Whether the ledger closes over the smallest increments.
    pub(super) fn is_closed(&self) -> bool {
        self.best().abs() <= LIMIT
    }

    /// With the cause named; `run` runs the case with increments cut into so many parts.
    pub(super) fn explained(
        self,
        contact: &ContactTable,
        outcome: &Outcome,
        mut run: impl FnMut(u32) -> Outcome,
    ) -> Self {
        if self.open.is_nan() || self.open.abs() <= LIMIT {
            return self;
        }
        let mut found = self;
        let mut finest = outcome.increments.clone();
        for split in SPLITS {
            let finer = run(split);
            if !matches!(finer.class, Class::Unchecked | Class::NoLoadBearingContacts) {
                break;
            }
            (found.finest, found.split, finest) = (open(&finer.increments), split, finer.increments);
            if found.finest <= LIMIT {
                break;
            }
        }
        found.cause = match found.best() {
            best if best > LIMIT => "energy out of nothing",
            best if best >= -LIMIT => "work by trapezoids: closes over smaller increments",
            _ => cause_of_loss(contact, &finest),
        };
        found
    }
}

/// What took the energy that is missing over these increments.
fn cause_of_loss(contact: &ContactTable, increments: &[Increment]) -> &'static str {
    let mut losses: Vec<f64> = increments.windows(2).map(|pair| -gained(&pair[0], &pair[1])).collect();
    let total: f64 = losses.iter().sum();
    let first = losses[0];
    losses.sort_by(|one, other| other.total_cmp(one));
    let few = ((FEW * losses.len() as f64).ceil() as usize).max(3);
    let in_few: f64 = losses.iter().take(few).sum();
    let came_apart = increments.iter().any(|one| one.flags.contains(TrialFlags::NO_LOAD_BEARING_CONTACTS));
    if first > 0.5 * total {
        "release: the packing as given is not at rest under this law"
    } else if came_apart {
        "the cell came apart: damping takes what its grains have left"
    } else if contact.damping > 0.0 {
        "contact viscosity is not in the ledger"
    } else if in_few > 0.5 * total {
        "snaps: damping takes what few increments release"
    } else {
        "damping takes some in many increments"
    }
}

/// The test with its increments cut into `split` parts each: the same path.
pub(super) fn split(test: &ElementTest, split: u32) -> ElementTest {
    let mut finer = test.clone();
    for segment in &mut finer.path {
        segment.increments *= split;
    }
    finer
}

/// Energy stored and lost beyond the work done on the cell, over the largest of the three; NaN for a path of no energy.
fn open(increments: &[Increment]) -> f64 {
    let (Some(first), Some(last)) = (increments.first(), increments.last()) else { return f64::NAN };
    let mut work = 0.0;
    let mut scale = first.stored.abs().max(last.lost);
    for pair in increments.windows(2) {
        work += work_between(&pair[0], &pair[1]);
        // Cohesion stores energy below zero.
        scale = scale.max(work.abs()).max(pair[1].stored.abs());
    }
    let gained = last.stored - first.stored + last.lost - first.lost;
    if scale > 0.0 { (gained - work) / scale } else { f64::NAN }
}

/// Energy stored and lost beyond the work from one state to the next, J/m3.
fn gained(before: &Increment, after: &Increment) -> f64 {
    after.stored - before.stored + after.lost - before.lost - work_between(before, after)
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

    fn state(deformation: [[f64; 3]; 3], stress: [[f64; 3]; 3], stored: f64) -> Increment {
        Increment { deformation, stress, stored, ..Increment::default() }
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
        assert!(open(&states(5.0)).abs() < 1e-4, "{}", open(&states(5.0)));
        assert!((open(&states(0.0)) + 1.0).abs() < 1e-4);
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
