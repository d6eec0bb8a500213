//! How many evaluations each strategy needs: on one element over several packings, and on the biaxial test of
//! [Argilaga2018] with all eight operators (T-10). What committed iterates save. What a coupled run costs for its error (P-2).
//!
//! Evaluations are counted twice: as the solver requests them, and as workers compute them, which is less where several points
//! have bitwise equal trials.

mod biaxial;
pub(super) mod case;
mod committed_iterates;
mod element;
mod strategies;
mod work_precision;

use super::report::Report;
use crate::effort::Effort;
use biaxial::Grains;
use grainspan::exit::{Exit, Failure};
use strategies::{Variant, chosen, operators, own, rounded};

/// Parts that `--only` may name, besides strategies and operators.
const PARTS: [&str; 5] = ["element", "biaxial", "mixed", "committed-iterates", "work-precision"];

/// What `--only` may name.
pub(super) fn parts(_: &Effort) -> Vec<String> {
    let variants = [own(), rounded(), operators()].concat().into_iter().map(|variant| variant.name);
    PARTS.map(str::to_owned).into_iter().chain(variants).collect()
}

/// Measures the parts that were chosen, or all; where strategies or operators are named, those parts that have one of them.
///
/// # Errors
/// No part has a variant that is named, a packing cannot be made, workers are lost, or the report cannot be written.
pub(super) fn run(effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    let wanted = Wanted::of(effort);
    if wanted.is_empty() {
        let text = "bench newton: no part that is chosen has a variant that --only names\nhint: `element` has all strategies, those with \
                    rounded targets, UKO and PSTLO; `biaxial` and `mixed` have all strategies and operators";
        return Err(Failure::new(Exit::BadInput, text).into());
    }
    if !wanted.element.is_empty() {
        element::run(&wanted.element, effort, report)?;
    }
    for (kind, variants) in [(Grains::Alike, &wanted.biaxial), (Grains::Mixed, &wanted.mixed)] {
        if !variants.is_empty() {
            biaxial::run(kind, variants, effort, report)?;
        }
    }
    if wanted.committed_iterates {
        committed_iterates::run(effort, report)?;
    }
    if wanted.work_precision {
        work_precision::run(effort, report)?;
    }
    Ok(())
}

/// The variants of each part; none of a part that is left out.
struct Wanted {
    element: Vec<Variant>,
    biaxial: Vec<Variant>,
    mixed: Vec<Variant>,
    /// These two have no variants that could be chosen.
    committed_iterates: bool,
    work_precision: bool,
}

impl Wanted {
    fn of(effort: &Effort) -> Self {
        let of = |part: &str, variants: Vec<Variant>| match effort.includes(part, &PARTS) {
            true => chosen(variants, effort, &PARTS),
            false => Vec::new(),
        };
        Self {
            element: of("element", element::variants()),
            biaxial: of("biaxial", biaxial::variants()),
            mixed: of("mixed", biaxial::variants()),
            committed_iterates: effort.only.is_empty() || effort.names("committed-iterates"),
            work_precision: effort.only.is_empty() || effort.names("work-precision"),
        }
    }

    fn is_empty(&self) -> bool {
        [&self.element, &self.biaxial, &self.mixed].iter().all(|variants| variants.is_empty())
            && !self.committed_iterates
            && !self.work_precision
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A part without the variant that was named measured all of its own.
    #[test]
    fn parts_without_a_variant_that_is_named_are_left_out() {
        let counts = |only: &[&str], quick: bool| {
            let only = only.iter().map(|&name| name.to_owned()).collect();
            let wanted = Wanted::of(&Effort { only, quick, ..Effort::default() });
            let [element, biaxial, mixed] =
                [&wanted.element, &wanted.biaxial, &wanted.mixed].map(|variants| variants.len());
            let others = wanted.committed_iterates || wanted.work_precision;
            assert_eq!(wanted.is_empty(), element + biaxial + mixed == 0 && !others);
            (element, biaxial, mixed, wanted.committed_iterates)
        };
        let all = (element::variants().len(), biaxial::variants().len(), biaxial::variants().len(), true);
        assert_eq!(counts(&[], false), all);
        assert_eq!(counts(&["element"], false), (all.0, 0, 0, false));
        assert_eq!(counts(&["slip_secant_rounded"], false), (1, 0, 0, false));
        assert_eq!(counts(&["mixed", "CTO", "slip_secant_rounded"], false), (0, 0, 1, false));
        assert_eq!(counts(&["biaxial", "slip_secant_rounded"], false), (0, 0, 0, false));
        assert_eq!(counts(&["committed-iterates"], false), (0, 0, 0, true));
        assert_eq!(counts(&["work-precision"], false), (0, 0, 0, false));
        // A quick look has few variants, unless others are named.
        assert_eq!(counts(&[], true), (3, 2, 2, true));
        assert_eq!(counts(&["CTO"], true), (0, 1, 1, false));
    }
}
