//! Whether linear responses pay, decided from what they have cost and saved on the way to the state.

use crate::cell::EventMemory;
use crate::definition::RveOptions;
use crate::space::Space;

/// Force evaluations that take as long as one factorisation with its solutions: 38 while nothing slides, 55 otherwise (400 discs).
const OF_FACTORISATION: i32 = 45;

/// Force evaluations that take as long as an attempt besides its own evaluations and factorisations: the start of every pair, products with
/// the stored response, the check of the answer.
const OF_ATTEMPT: i32 = 2;

/// Force evaluations of relaxation in lanes that take as long as one of a single cell: 1.9 to 2.9 us for 10 (400 discs). Linear responses are
/// those of single cells.
const OF_SINGLE_IN_LANES: i32 = 4;

/// Bound of the balance in either direction. At the lower one the solver pauses.
const BOUND: i32 = 330;

/// Trials that relaxation answers then, at first and at most. Each pause is twice the last one.
const PAUSE: [u32; 2] = [8, 512];

/// Force evaluations that may be lost after a pause until the next one: two factorisations show whether modes still change.
const AFTER_REST: i32 = 90;

/// Force evaluations that relaxation spends on each decade of the tolerance below 1e-3.
const PER_DECADE: f64 = 30.0;

/// Fewest force evaluations after a ramp.
const AFTER_RAMP: f64 = 11.0;

/// What one attempt has cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Spent {
    /// Contact-force evaluations.
    pub(super) evaluations: i32,
    /// Factorisations.
    pub(super) factorisations: i32,
}

impl Spent {
    /// In force evaluations of the relaxation that would have answered.
    fn in_evaluations(self, options: &RveOptions) -> i32 {
        let single = OF_ATTEMPT + self.evaluations + OF_FACTORISATION * self.factorisations;
        if options.side_by_side == Some(true) { OF_SINGLE_IN_LANES * single } else { single }
    }
}

/// Force evaluations that relaxation would spend, roughly.
fn of_relaxation(options: &RveOptions, ramp_steps: u32) -> i32 {
    let decades = (1e-3 / options.tolerance()).log10().clamp(0.0, 10.0);
    (f64::from(ramp_steps) + AFTER_RAMP + PER_DECADE * decades).min(f64::from(BOUND)) as i32
}

/// Books an attempt that has answered, or one in vain.
pub(super) fn book<S: Space>(
    memory: &mut EventMemory<S>,
    spent: Spent,
    answered: bool,
    options: &RveOptions,
    ramp_steps: u32,
) {
    let saved = if answered { of_relaxation(options, ramp_steps) } else { 0 };
    memory.balance = (memory.balance + saved - spent.in_evaluations(options)).clamp(-BOUND, BOUND);
    if memory.balance == -BOUND {
        memory.balance = AFTER_REST - BOUND;
        memory.pause = (2 * memory.last_pause).clamp(PAUSE[0], PAUSE[1]);
        memory.last_pause = memory.pause;
        memory.response = None;
    } else if memory.balance >= 0 {
        memory.last_pause = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::Discs;

    #[test]
    fn what_does_not_pay_rests_longer_and_longer_until_it_pays_again() {
        let options = RveOptions::default();
        let mut memory = EventMemory::<Discs>::default();
        let dear = Spent { evaluations: 10, factorisations: 4 };
        let mut pauses = Vec::new();
        for _ in 0..30 {
            book(&mut memory, dear, false, &options, 5);
            if memory.pause > 0 {
                pauses.push(memory.pause);
                memory.pause = 0;
            }
        }
        assert_eq!(pauses[..4], [8, 16, 32, 64]);
        let cheap = Spent { evaluations: 1, factorisations: 0 };
        for _ in 0..100 {
            book(&mut memory, cheap, true, &options, 5);
        }
        assert_eq!((memory.last_pause, memory.balance), (0, BOUND));
    }

    /// A response for every ten answers pays for a single cell, and not in lanes; stored responses pay in both.
    #[test]
    fn responses_are_measured_by_the_relaxation_that_they_save() {
        let ends = |side_by_side: bool, factorised_every: u32| {
            let options = RveOptions { side_by_side: Some(side_by_side), ..RveOptions::default() };
            let mut memory = EventMemory::<Discs>::default();
            for number in 0..200 {
                let factorisations = i32::from(number % factorised_every == 0);
                book(&mut memory, Spent { evaluations: 1, factorisations }, true, &options, 5);
            }
            memory.last_pause > 0
        };
        assert_eq!([ends(false, 10), ends(true, 10), ends(false, 100), ends(true, 100)], [false, true, false, false]);
    }
}
