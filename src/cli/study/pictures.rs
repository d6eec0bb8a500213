//! Pictures of a study: mean curves of every measure, and the scatter over the number of grains.

use super::ensemble::Results;
use super::mean_curves::mean_curve;
use super::statistics::Statistics;
use charts::{Chart, Scale};
use scene_reader::{Ensemble, PathStrain, StudyQuantity};
use std::collections::BTreeSet;

/// All pictures, each with the part of its file name behind that of the study.
pub(super) fn charts(results: &Results<'_>) -> Vec<(String, Chart)> {
    let mut found: Vec<(String, Chart)> = (0..results.measures.len())
        .map(|measure| (results.measures[measure].keyword().replace('_', "-"), means(results, measure)))
        .collect();
    if results.study.sizes().len() > 1 {
        found.push(("scatter".to_owned(), scatter(results)));
    }
    found
}

/// What a curve is called: what differs between the curves of the picture.
fn name(results: &Results<'_>, ensemble: Ensemble, more: Option<&str>, has_size: bool) -> String {
    let study = results.study;
    let parts = [
        (study.recipes.len() > 1).then(|| study.recipes[ensemble.recipe].name.clone()),
        (study.tests.len() > 1).then(|| study.tests[ensemble.test].name.clone()),
        more.map(|more| more.replace('_', " ")),
        has_size.then(|| format!("{} grains", results.grains(ensemble.recipe, ensemble.size))),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// The mean of a measure over the samples whose paths reached their ends, over the strain, with a band of the standard deviation.
fn means(results: &Results<'_>, measure: usize) -> Chart {
    let study = results.study;
    let sheared = study.tests.iter().filter(|test| test.strain == PathStrain::ShearXy).count();
    let x = match sheared {
        0 => "compression",
        _ if sheared == study.tests.len() => "shear angle",
        _ => "compression or shear angle",
    };
    let unit = match results.measures[measure].unit() {
        "-" => String::new(),
        unit => format!(", {unit}"),
    };
    let quantity = results.measures[measure].keyword().replace('_', " ");
    let mut chart = Chart::new(
        &format!("{}: {quantity}, mean and standard deviation of the samples", study.name),
        (x, Scale::Linear),
        (&format!("{quantity}{unit}"), Scale::Linear),
    );
    for recipe in 0..study.recipes.len() {
        for test in 0..study.tests.len() {
            for size in 0..study.sizes().len() {
                let ensemble = Ensemble { recipe, size, test, quantity: 0 };
                let rows = mean_curve(results, ensemble, measure);
                if !rows.is_empty() {
                    chart.curve(
                        &name(results, ensemble, None, true),
                        rows.iter().map(|row| [row.strain, row.statistics.mean]),
                    );
                    chart.band(rows.iter().filter(|row| row.statistics.count > 1).map(|row| {
                        let Statistics { mean, deviation, .. } = row.statistics;
                        [row.strain, mean - deviation, mean + deviation]
                    }));
                }
            }
        }
    }
    chart
}

/// Standard deviations over the number of grains, with the fitted powers and the slope of -1/2.
fn scatter(results: &Results<'_>) -> Chart {
    let units: BTreeSet<&str> = results.study.quantities.iter().map(StudyQuantity::unit).collect();
    let y = match units.into_iter().collect::<Vec<_>>()[..] {
        ["-"] => "standard deviation".to_owned(),
        [unit] => format!("standard deviation, {unit}"),
        _ => "standard deviation, in the unit of each quantity".to_owned(),
    };
    let mut chart = Chart::new(
        &format!("{}: scatter over the number of grains", results.study.name),
        ("grains", Scale::Logarithmic),
        (&y, Scale::Logarithmic),
    );
    let sizes = results.study.sizes().len();
    let mut has_slope = false;
    for first in results.ensembles().into_iter().filter(|ensemble| ensemble.size == 0) {
        let quantity = &results.study.quantities[first.quantity].name;
        let points: Vec<[f64; 2]> = (0..sizes)
            .filter_map(|size| {
                let found = results.statistics(Ensemble { size, ..first }).0?;
                (found.deviation > 0.0).then_some([results.grains(first.recipe, size) as f64, found.deviation])
            })
            .collect();
        let Some(fit) = results.power(first).filter(|_| !points.is_empty()) else { continue };
        let name = format!(
            "{}: power {:.2} +- {:.2}",
            name(results, first, Some(quantity), false),
            fit.power,
            fit.half_width
        );
        let ends = [points[0][0], points[points.len() - 1][0]];
        chart.curve(&name, points);
        if !has_slope {
            // Through the middle of the first fit; the slope is that of all.
            let middle = (ends[0] * ends[1]).sqrt();
            let through = fit.deviation(middle);
            chart.reference("power -1/2", ends.map(|grains| [grains, through * (grains / middle).powf(-0.5)]));
            has_slope = true;
        }
    }
    chart
}
