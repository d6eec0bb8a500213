//! The cases of a campaign, their packings, and the tests that are run.

use super::case::{Case, Range, sampled};
use super::packings::{Slot, slots};
use super::path::Kind;
use crate::effort::Effort;
use crate::stability_options::Options;
use anyhow::Context;
use grainspan::exit::{Exit, Failure};
use rayon::prelude::*;
use rve_server::definition::Packing;
use rve_server::programs::rve_test::ElementTest;
use scene_reader::Document;
use std::collections::BTreeSet;
use std::path::Path;
use std::time::Instant;

/// Seed unless the command line has one.
const SEED: u64 = 1;

/// Cases of a campaign, thorough and quick.
const CASES: [u64; 2] = [2500, 24];

/// Most grains of a packing in a quick campaign.
const QUICK_GRAINS: usize = 100;

/// Numbers looked at for one case that passes all filters: no filter is that rare.
const NUMBERS_PER_CASE: u64 = 10_000;

/// A campaign whose cases have been drawn and whose packings have been made.
pub(super) struct Campaign {
    /// Its seed.
    pub(super) seed: u64,
    /// Cases in the order of their numbers.
    pub(super) cases: Vec<Case>,
    /// All packings that there may be.
    pub(super) slots: Vec<Slot>,
    /// Those that cases use, in the places of `slots`; a recipe that found no packing says why.
    pub(super) packings: Vec<Option<Result<Packing, String>>>,
    /// Wall time that each of them took, s.
    pub(super) seconds: Vec<f64>,
    overrides: Vec<String>,
}

impl Campaign {
    /// Draws the cases that the command line asks for and makes their packings.
    ///
    /// # Errors
    /// Filters that let nothing through.
    pub(super) fn new(options: &Options, effort: &Effort) -> anyhow::Result<Self> {
        let seed = options.seed.unwrap_or(SEED);
        let slots = slots(seed)?;
        let cases = chosen(seed, &slots, options, effort)?;
        let used: BTreeSet<usize> = cases.iter().map(|case| case.slot).collect();
        let (packings, seconds) = (0..slots.len())
            .into_par_iter()
            .with_max_len(1)
            .map(|place| {
                let begun = Instant::now();
                let made =
                    used.contains(&place).then(|| slots[place].packing().map_err(|error| format!("{error:#}")));
                (made, begun.elapsed().as_secs_f64())
            })
            .unzip();
        Ok(Self { seed, cases, slots, packings, seconds, overrides: options.overrides.clone() })
    }

    /// The packing of a case, or why there is none.
    pub(super) fn packing(&self, case: &Case) -> Result<&Packing, &String> {
        self.packings[case.slot].as_ref().expect("packings of all cases have been made").as_ref()
    }

    /// The test of a case with the overrides of the command line and `more` of them, and its text.
    ///
    /// # Errors
    /// An override that the test does not take, with its place.
    pub(super) fn test(&self, case: &Case, more: &[String]) -> anyhow::Result<(ElementTest, String)> {
        let text = toml::to_string(&case.test).context("a case as TOML")?;
        let overrides: Vec<String> = self.overrides.iter().chain(more).cloned().collect();
        let name = format!("case {}", case.number);
        let refused = |error: scene_reader::InputError| anyhow::Error::from(Failure::from(error));
        let document = Document::from_text(Path::new(&name), text, &overrides).map_err(refused)?;
        let test = document
            .deserialize::<ElementTest>()
            .map_err(refused)?
            .validated()
            .map_err(|error| refused(document.table_error(error)))?;
        let text = document.as_run(&[]).map_err(refused)?;
        Ok((test, text))
    }
}

fn chosen(seed: u64, slots: &[Slot], options: &Options, effort: &Effort) -> anyhow::Result<Vec<Case>> {
    let names_kind = Kind::ALL.iter().any(|kind| effort.names(kind.name()));
    let names_range = Range::ALL.iter().any(|range| effort.names(range.name()));
    let largest = options.largest.unwrap_or(effort.choose(usize::MAX, QUICK_GRAINS));
    let is_wanted = |case: &Case| {
        let slot = &slots[case.slot];
        options.dimension.is_none_or(|dimension| dimension == slot.dimension)
            && slot.number <= largest
            && (!names_kind || effort.names(case.kind.name()))
            && (!names_range || effort.names(case.range.name()))
    };
    let case = |number| sampled(seed, number, slots, options.long_cycles);
    if let Some(number) = options.case {
        return Ok(vec![case(number)]);
    }
    if options.scene.is_some() {
        return Ok(Vec::new());
    }
    let count = options.cases.unwrap_or(effort.choose(CASES[0], CASES[1]));
    let cases: Vec<Case> =
        (0..count.saturating_mul(NUMBERS_PER_CASE)).map(case).filter(is_wanted).take(count as usize).collect();
    if (cases.len() as u64) < count {
        let text = format!(
            "only {} of {count} cases pass --dimension, --largest and --only\nhint: widen the filters",
            cases.len()
        );
        return Err(Failure::new(Exit::BadInput, text).into());
    }
    Ok(cases)
}
