//! The energy ledger of a case: work done on the cell against what is stored and what friction took.
//!
//! The work is integrated by trapezoids over committed states, between which stresses rise and break down. So where the ledger of a case is
//! open, the case is run again with each increment cut into smaller ones, and where it stays open the cause is named.

use super::outcome::{Class, Increment, Outcome};
use protocol::TrialFlags;
use rve_server::contact::ContactTable;

/// Energy that may be missing or left over, over the largest of the energies.
const LIMIT: f64 = 0.1;

/// A run of the same path on which a ledger is looked at again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Refinement {
    /// Parts that each increment is cut into.
    pub(super) split: u32,
    /// Strain per step over that of the case.
    pub(super) strain_per_step: f64,
}

/// What is tried where the ledger is open, the second and third only where energy seems to come out of nothing. Cuts bring the committed
/// states, whose stresses the work is taken from, nearer to each other; a smaller strain per step brings the grains nearer to equilibrium
/// within a trial, so that transient forces, which friction is charged for and the work is not, vanish.
const REFINEMENTS: [Refinement; 3] = [
    Refinement { split: 8, strain_per_step: 1.0 },
    Refinement { split: 64, strain_per_step: 1.0 },
    Refinement { split: 1, strain_per_step: 0.1 },
];

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
    /// Strain per step for it over that of the case.
    pub(super) strain_per_step: f64,
    /// Why the ledger is open over the increments of the case; empty where it is not.
    pub(super) cause: &'static str,
}

impl Default for Ledger {
    fn default() -> Self {
        Self { open: f64::NAN, finest: f64::NAN, split: 1, strain_per_step: 1.0, cause: "" }
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

    /// With the cause named; `run` runs the case refined.
    pub(super) fn explained(
        self,
        contact: &ContactTable,
        outcome: &Outcome,
        mut run: impl FnMut(Refinement) -> Outcome,
    ) -> Self {
        if self.open.is_nan() || self.open.abs() <= LIMIT {
            return self;
        }
        let mut found = self;
        let mut finest = outcome.increments.clone();
        for refinement in REFINEMENTS {
            let finer = run(refinement);
            if !matches!(finer.class, Class::Unchecked | Class::NoLoadBearingContacts) {
                break;
            }
            let Refinement { split, strain_per_step } = refinement;
            found = Self { finest: open(&finer.increments), split, strain_per_step, ..found };
            finest = finer.increments;
            if found.finest <= LIMIT {
                break;
            }
        }
        found.cause = match found.best() {
            best if best > LIMIT => "energy out of nothing",
            _ if found.strain_per_step < 1.0 => {
                "transient forces within trials: no gain at a tenth of the strain per step"
            }
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

/// Energy stored and lost beyond the work done on the cell, over the largest of the three; NaN for a path of no energy.
fn open(increments: &[Increment]) -> f64 {
    let (Some(first), Some(last)) = (increments.first(), increments.last()) else { return f64::NAN };
    // Cohesion stores energy below zero.
    let largest = |scale: f64, one: &Increment| scale.max(one.work.abs()).max(one.stored.abs());
    let scale = increments.iter().fold(last.lost, largest);
    if scale > 0.0 { gained(first, last) / scale } else { f64::NAN }
}

/// Energy stored and lost beyond the work between two states, J/m3.
fn gained(before: &Increment, after: &Increment) -> f64 {
    after.stored - before.stored + after.lost - before.lost - (after.work - before.work)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(work: f64, stored: f64, lost: f64) -> Increment {
        Increment { work, stored, lost, ..Increment::default() }
    }

    #[test]
    fn what_is_neither_stored_nor_lost_to_friction_is_open() {
        let states = |stored: f64, lost: f64| [state(0.0, 1.0, 0.0), state(2.0, 2.0, 0.5), state(5.0, stored, lost)];
        assert!(open(&states(4.0, 2.0)).abs() < 1e-14);
        // Two of five are missing, and one too many.
        assert!((open(&states(2.0, 2.0)) + 0.4).abs() < 1e-14);
        assert!((open(&states(4.0, 3.0)) - 0.2).abs() < 1e-14);
        assert!((gained(&states(4.0, 3.0)[1], &states(4.0, 3.0)[2]) - 1.5).abs() < 1e-14);
    }

    fn outcome(work: f64) -> Outcome {
        let increments = vec![state(0.0, 1.0, 0.0), state(work, 1.0, 10.0)];
        Outcome { class: Class::Unchecked, reason: String::new(), increments, seconds: 0.0 }
    }

    /// Friction of 10 for a work of 5: a gain that smaller increments leave, and a smaller strain per step may or may not.
    #[test]
    fn energy_that_a_smaller_strain_per_step_does_not_gain_is_not_out_of_nothing() {
        let contact = ContactTable::linear(1.0, 0.5, 0.5);
        let given = outcome(5.0);
        let explained = |work_of_finer_steps: f64| {
            Ledger::of(&given.increments).explained(&contact, &given, |refinement| {
                outcome(if refinement.strain_per_step < 1.0 { work_of_finer_steps } else { 5.0 })
            })
        };
        let transient = explained(9.9);
        assert!(!transient.is_free() && transient.cause.starts_with("transient"), "{transient:?}");
        let free = explained(5.0);
        assert!(free.is_free() && free.cause == "energy out of nothing", "{free:?}");
    }
}
