//! The numbers of a study against those that are expected of it.

use super::ensemble::Results;
use super::statistics::Statistics;
use crate::cli::comparison::{Comparison, Theirs, Tolerance};
use scene_reader::{Ensemble, EnsembleStatistic, Expectation, Expected};
use std::collections::BTreeMap;

/// The rows of the comparison, and which of them belong to each entry of the verification catalogue.
pub(super) fn compared(results: &Results<'_>) -> (Vec<Comparison>, BTreeMap<String, Vec<String>>) {
    let mut rows = Vec::new();
    let mut entries: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for expectation in &results.study.expectations {
        let row = row(results, expectation);
        if let Some(entry) = &expectation.entry {
            entries.entry(entry.clone()).or_default().push(row.quantity().to_owned());
        }
        rows.push(row);
    }
    (rows, entries)
}

fn row(results: &Results<'_>, expectation: &Expectation) -> Comparison {
    let Expectation { ours, statistic, expected, tolerance, is_relative, source, .. } = expectation;
    let fit = (*statistic == EnsembleStatistic::Power).then(|| results.power(*ours));
    let of = |ensemble: Ensemble| {
        let found = results.statistics(ensemble).0;
        let value = |value: fn(&Statistics) -> f64| found.as_ref().map_or(f64::NAN, value);
        match statistic {
            EnsembleStatistic::Mean => value(|one| one.mean),
            EnsembleStatistic::Deviation => value(|one| one.deviation),
            EnsembleStatistic::Largest => value(|one| one.largest),
            EnsembleStatistic::Smallest => value(|one| one.smallest),
            EnsembleStatistic::Power => results.power(ensemble).map_or(f64::NAN, |fit| fit.power),
        }
    };
    let number = of(*ours);
    let (theirs, mut origin) = match expected {
        Expected::Value(value) => (Theirs::Value(*value), String::new()),
        Expected::Between(low, high) => (Theirs::Between(*low, *high), String::new()),
        Expected::Like(other) => {
            (Theirs::Value(of(*other)), format!("{} of {}", in_words(*statistic), differing(results, *ours, *other)))
        }
        Expected::Nothing => (Theirs::Nothing, String::new()),
    };
    if !source.is_empty() {
        origin = if origin.is_empty() { source.clone() } else { format!("{source}; {origin}") };
    }
    let tolerance = match (tolerance, fit.flatten()) {
        (Some(share), _) if *is_relative => Tolerance::Relative(*share),
        (Some(largest), _) => Tolerance::Absolute(*largest),
        // What eight or so samples a size can tell.
        (None, Some(fit)) if *expected != Expected::Nothing => Tolerance::Absolute(fit.half_width),
        // A power that no samples give is none that was expected.
        (None, None) if *statistic == EnsembleStatistic::Power => Tolerance::Absolute(0.0),
        (None, _) if matches!(expected, Expected::Between(..)) => Tolerance::Absolute(0.0),
        (None, _) => Tolerance::Nothing,
    };
    let unit = match statistic {
        EnsembleStatistic::Power => "-",
        EnsembleStatistic::Mean
        | EnsembleStatistic::Deviation
        | EnsembleStatistic::Largest
        | EnsembleStatistic::Smallest => results.study.quantities[ours.quantity].unit(),
    };
    Comparison::new(described(results, *ours, *statistic), unit, theirs, origin, number, tolerance)
}

/// A number of an ensemble in words, as short as the study allows.
fn described(results: &Results<'_>, ensemble: Ensemble, statistic: EnsembleStatistic) -> String {
    let study = results.study;
    let mut text = study.quantities[ensemble.quantity].name.replace('_', " ");
    if study.recipes.len() > 1 {
        text += &format!(", {}", study.recipes[ensemble.recipe].name);
    }
    if study.tests.len() > 1 {
        text += &format!(", {}", study.tests[ensemble.test].name);
    }
    if statistic != EnsembleStatistic::Power {
        text += &format!(", {} grains", results.grains(ensemble.recipe, ensemble.size));
    }
    format!("{text}: {}", in_words(statistic))
}

fn in_words(statistic: EnsembleStatistic) -> &'static str {
    match statistic {
        EnsembleStatistic::Mean => "mean",
        EnsembleStatistic::Deviation => "standard deviation",
        EnsembleStatistic::Largest => "largest sample",
        EnsembleStatistic::Smallest => "smallest sample",
        EnsembleStatistic::Power => "power of the number of grains in the standard deviation",
    }
}

/// In what one ensemble differs from another, by name.
fn differing(results: &Results<'_>, ours: Ensemble, other: Ensemble) -> String {
    let study = results.study;
    let parts = [
        (ours.quantity != other.quantity).then(|| study.quantities[other.quantity].name.replace('_', " ")),
        (ours.recipe != other.recipe).then(|| study.recipes[other.recipe].name.clone()),
        (ours.test != other.test).then(|| study.tests[other.test].name.clone()),
    ];
    let parts: Vec<String> = parts.into_iter().flatten().collect();
    if parts.is_empty() { "the same ensemble".to_owned() } else { parts.join(", ") }
}
