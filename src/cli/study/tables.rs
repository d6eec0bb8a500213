//! Tables of a study: samples, statistics, powers; as CSV and for the screen.

use super::ensemble::Results;
use super::mean_curves::{MeanRow, curves_of, mean_curve};
use crate::exit::{Exit, Failure};
use charts::short;
use scene_reader::{Ensemble, SAMPLE_COLUMNS};

fn csv_of(rows: impl IntoIterator<Item = Vec<String>>) -> Result<Vec<u8>, Failure> {
    let unwritable = |error: String| Failure::new(Exit::BadInput, format!("a table cannot be written: {error}"));
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        writer.write_record(row).map_err(|error| unwritable(error.to_string()))?;
    }
    writer.into_inner().map_err(|error| unwritable(error.to_string()))
}

fn words<const N: usize>(words: [&str; N]) -> Vec<String> {
    words.map(str::to_owned).into()
}

/// The shortest text that reads back to the same bits; empty for a number that does not exist.
fn exact(value: f64) -> String {
    if value.is_finite() { format!("{value:e}") } else { String::new() }
}

/// A row for every sample and test; a value that is missing is empty, with the reason in the last column.
///
/// # Errors
/// The table cannot be encoded.
pub(super) fn samples_csv(results: &Results<'_>) -> Result<Vec<u8>, Failure> {
    let study = results.study;
    let [recipe, grains, seed, test, problem] = SAMPLE_COLUMNS;
    let mut header = words([recipe, grains, seed, test]);
    header.extend(study.quantities.iter().map(|quantity| quantity.name.clone()));
    header.push(problem.to_owned());
    let mut rows = vec![header];
    for sample in &results.samples {
        for (test, entry) in study.tests.iter().enumerate() {
            let values: Vec<Result<f64, String>> =
                (0..study.quantities.len()).map(|quantity| results.value(sample, test, quantity)).collect();
            let stopped = sample.paths.as_ref().ok().and_then(|paths| paths[test].stopped.clone());
            let problem = stopped.or_else(|| values.iter().find_map(|value| value.clone().err()));
            let place = sample.place;
            let mut row = vec![
                study.recipes[place.recipe].name.clone(),
                place.grains.to_string(),
                place.seed.to_string(),
                entry.name.clone(),
            ];
            row.extend(values.into_iter().map(|value| value.map_or_else(|_| String::new(), exact)));
            row.push(problem.unwrap_or_default());
            rows.push(row);
        }
    }
    csv_of(rows)
}

/// Recipe, test and number of grains of an ensemble.
fn names_of(results: &Results<'_>, ensemble: Ensemble) -> Vec<String> {
    vec![
        results.study.recipes[ensemble.recipe].name.clone(),
        results.study.tests[ensemble.test].name.clone(),
        results.grains(ensemble.recipe, ensemble.size).to_string(),
    ]
}

/// A row for every ensemble. `bias` is its mean minus that of the largest size.
///
/// # Errors
/// The table cannot be encoded.
pub(super) fn statistics_csv(results: &Results<'_>) -> Result<Vec<u8>, Failure> {
    let study = results.study;
    let mut rows = vec![words([
        "recipe",
        "test",
        "grains",
        "quantity",
        "measure",
        "unit",
        "samples",
        "failed",
        "mean",
        "standard_deviation",
        "standard_error",
        "smallest",
        "largest",
        "bias",
    ])];
    let last = study.sizes().len() - 1;
    for ensemble in results.ensembles() {
        let (found, failed) = results.statistics(ensemble);
        let largest = results.statistics(Ensemble { size: last, ..ensemble }).0;
        let quantity = &study.quantities[ensemble.quantity];
        let number = |of: fn(&super::statistics::Statistics) -> f64| found.as_ref().map_or(f64::NAN, of);
        let bias = number(|one| one.mean) - largest.map_or(f64::NAN, |one| one.mean);
        let mut row = names_of(results, ensemble);
        row.extend([&quantity.name, quantity.measure.keyword(), quantity.unit()].map(str::to_owned));
        row.extend([found.map_or(0, |one| one.count).to_string(), failed.to_string()]);
        let numbers = [
            number(|one| one.mean),
            number(|one| one.deviation),
            number(|one| one.standard_error()),
            number(|one| one.smallest),
            number(|one| one.largest),
            bias,
        ];
        row.extend(numbers.map(exact));
        rows.push(row);
    }
    csv_of(rows)
}

/// A row for every row of every mean curve: what the pictures show.
///
/// # Errors
/// The table cannot be encoded.
pub(super) fn curves_csv(results: &Results<'_>) -> Result<Vec<u8>, Failure> {
    let mut rows = vec![words([
        "recipe",
        "test",
        "grains",
        "measure",
        "unit",
        "strain",
        "samples",
        "mean",
        "standard_deviation",
        "standard_error",
    ])];
    for ensemble in curves_of(results) {
        for (number, measure) in results.measures.iter().enumerate() {
            for MeanRow { strain, statistics } in mean_curve(results, ensemble, number) {
                let mut row = names_of(results, ensemble);
                row.extend([measure.keyword(), measure.unit()].map(str::to_owned));
                row.extend([exact(strain), statistics.count.to_string()]);
                row.extend([statistics.mean, statistics.deviation, statistics.standard_error()].map(exact));
                rows.push(row);
            }
        }
    }
    csv_of(rows)
}

/// A row for every quantity of several sizes: the power of the number of grains with which its standard deviation goes.
///
/// # Errors
/// The table cannot be encoded.
pub(super) fn powers_csv(results: &Results<'_>) -> Result<Vec<u8>, Failure> {
    let study = results.study;
    let mut rows = vec![words([
        "recipe",
        "test",
        "quantity",
        "sizes",
        "power",
        "lower_95",
        "upper_95",
        "deviation_of_one_grain",
        "holds_-1/2",
    ])];
    for ensemble in results.ensembles().into_iter().filter(|ensemble| ensemble.size == 0) {
        let Some(fit) = results.power(ensemble) else { continue };
        let mut row = vec![
            study.recipes[ensemble.recipe].name.clone(),
            study.tests[ensemble.test].name.clone(),
            study.quantities[ensemble.quantity].name.clone(),
            fit.sizes.to_string(),
        ];
        let (lower, upper) = (fit.power - fit.half_width, fit.power + fit.half_width);
        row.extend([fit.power, lower, upper, fit.factor].map(exact));
        row.push(holds_half_power(lower, upper).to_owned());
        rows.push(row);
    }
    csv_of(rows)
}

/// Whether a deviation falls with the square root of the number of grains, by the confidence interval of its power. An interval that holds 0 as well
/// cannot tell.
fn holds_half_power(lower: f64, upper: f64) -> &'static str {
    match (lower..=upper).contains(&-0.5) {
        true if upper >= 0.0 => "undecided",
        true => "yes",
        false => "no",
    }
}

/// Statistics and powers for the screen.
pub(super) fn text(results: &Results<'_>) -> String {
    let study = results.study;
    let mut rows = vec![words([
        "recipe", "test", "quantity", "grains", "samples", "failed", "mean", "s.d.", "smallest", "largest",
    ])];
    for ensemble in results.ensembles() {
        let (found, failed) = results.statistics(ensemble);
        let number = |of: fn(&super::statistics::Statistics) -> f64| {
            found.as_ref().map_or("-".to_owned(), |one| short(of(one)))
        };
        rows.push(vec![
            study.recipes[ensemble.recipe].name.clone(),
            study.tests[ensemble.test].name.clone(),
            study.quantities[ensemble.quantity].name.clone(),
            results.grains(ensemble.recipe, ensemble.size).to_string(),
            found.map_or(0, |one| one.count).to_string(),
            failed.to_string(),
            number(|one| one.mean),
            number(|one| one.deviation),
            number(|one| one.smallest),
            number(|one| one.largest),
        ]);
    }
    let mut text = aligned(&rows);
    for ensemble in results.ensembles().into_iter().filter(|ensemble| ensemble.size == 0) {
        let Some(fit) = results.power(ensemble) else { continue };
        text += &format!(
            "{}, {}, {}: standard deviation with grains^({:.2} +- {:.2}), 95 % confidence, {} sizes\n",
            study.recipes[ensemble.recipe].name,
            study.tests[ensemble.test].name,
            study.quantities[ensemble.quantity].name,
            fit.power,
            fit.half_width,
            fit.sizes
        );
    }
    text
}

/// Rows with columns of equal width.
fn aligned(rows: &[Vec<String>]) -> String {
    let columns = rows.first().map_or(0, Vec::len);
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut text = String::new();
    for row in rows {
        let cells: Vec<String> = row.iter().zip(&widths).map(|(cell, width)| format!("{cell:<width$}")).collect();
        text += cells.join("  ").trim_end();
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wide_intervals_tell_nothing_about_the_power() {
        let found = [(-0.7, -0.4), (-1.5, 0.3), (-0.3, 0.1), (-0.5, 0.0)]
            .map(|(lower, upper)| holds_half_power(lower, upper));
        assert_eq!(found, ["yes", "undecided", "no", "undecided"]);
    }
}
