//! From counts to differences and verdicts.

use super::cases::Claim;

/// Largest difference, over the plain run, of a run that asks for nothing more.
pub(super) const BOUND: f64 = 1e-3;

/// What a run executed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Measured {
    pub(super) instructions: u64,
    pub(super) force_evaluations: u64,
}

/// What the count says about the claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// Nothing is claimed.
    None,
    /// As the plain run, within the bound.
    AsPlain,
    /// Increments that do not ask for it execute what they do in the plain run, within the bound.
    WhenAsked,
    /// Paid for without being asked for.
    Paid,
}

protocol::keywords! {
    pub(super) Verdict {
        None => "",
        AsPlain => "as plain",
        WhenAsked => "only when asked",
        Paid => "PAID UNASKED",
    }
}

impl Verdict {
    pub(super) fn is_good(self) -> bool {
        self != Self::Paid
    }
}

/// A run against the plain one of its group.
#[derive(Clone, Debug)]
pub(super) struct Finding {
    pub(super) name: String,
    pub(super) claim: Claim,
    pub(super) measured: Measured,
    /// Instructions more than in the plain run.
    pub(super) difference: f64,
    /// The same over those of the plain run.
    pub(super) share: f64,
    /// Instructions per force evaluation, the start of the process left out; NaN where it is not known.
    pub(super) per_evaluation: f64,
    pub(super) verdict: Verdict,
}

/// Compares the runs of a group with its first. `start`: instructions of a process that solves nothing.
pub(super) fn findings(runs: &[(String, Claim, Measured)], start: Option<u64>) -> Vec<Finding> {
    let Some((_, _, plain)) = runs.first() else { return Vec::new() };
    let base = plain.instructions as f64;
    let difference = |measured: &Measured| measured.instructions as f64 - base;
    let share = |measured: &Measured| difference(measured) / base;
    let judged = |is_good: bool, good: Verdict| if is_good { good } else { Verdict::Paid };
    let all = runs.iter().enumerate().map(|(place, (name, claim, measured))| {
        let verdict = match claim {
            Claim::Plain | Claim::Before | Claim::Asked | Claim::Law => Verdict::None,
            Claim::Unasked => judged(share(measured).abs() <= BOUND, Verdict::AsPlain),
            Claim::Last => match runs.get(place + 1..place + 3) {
                Some([(_, Claim::Before, before), (_, Claim::Asked, every)]) => {
                    // Below 0: the request itself costs more when it is repeated.
                    let rest = share(measured) + share(before) - share(every);
                    judged(rest <= BOUND, Verdict::WhenAsked)
                }
                _ => Verdict::None,
            },
        };
        let solved = start.map_or(f64::NAN, |start| measured.instructions.saturating_sub(start) as f64);
        Finding {
            name: name.clone(),
            claim: *claim,
            measured: *measured,
            difference: difference(measured),
            share: share(measured),
            per_evaluation: solved / measured.force_evaluations as f64,
            verdict,
        }
    });
    all.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(runs: &[(Claim, u64)]) -> Vec<Finding> {
        let named = |(claim, instructions): &(Claim, u64)| {
            (String::new(), *claim, Measured { instructions: *instructions, force_evaluations: 100 })
        };
        findings(&runs.iter().map(named).collect::<Vec<_>>(), Some(200_000))
    }

    #[test]
    fn a_run_that_asks_for_nothing_more_has_to_execute_what_the_plain_one_does() {
        let runs = [(Claim::Plain, 1_000_000), (Claim::Unasked, 1_000_900), (Claim::Unasked, 1_002_000)];
        let found = found(&runs);
        let verdicts: Vec<Verdict> = found.iter().map(|one| one.verdict).collect();
        assert_eq!(verdicts, [Verdict::None, Verdict::AsPlain, Verdict::Paid]);
        assert_eq!((found[1].difference, found[1].share), (900.0, 9e-4));
        assert_eq!(found[0].per_evaluation, 8_000.0);
    }

    #[test]
    fn costs_of_requests_at_different_increments_add_up_unless_others_pay_too() {
        let of = |last, before, all| {
            let runs = [(Claim::Plain, 1_000_000), (Claim::Last, last), (Claim::Before, before), (Claim::Asked, all)];
            found(&runs)[1].verdict
        };
        assert_eq!(of(1_025_000, 1_074_500, 1_100_000), Verdict::WhenAsked);
        // A request that finds what others have left costs more than one that finds nothing.
        assert_eq!(of(1_025_000, 1_075_000, 1_110_000), Verdict::WhenAsked);
        // The first request switches something on for the whole run.
        assert_eq!(of(1_100_000, 1_100_000, 1_100_000), Verdict::Paid);
    }
}
