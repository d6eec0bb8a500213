//! Mean curves of an ensemble: a measure over the strain, row by row the mean and the scatter of the samples.

use super::ensemble::Results;
use super::statistics::Statistics;
use scene_reader::Ensemble;

/// A row of a mean curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MeanRow {
    /// Mean strain of the samples, as the test defines it.
    pub(super) strain: f64,
    /// The measure in this row of all samples that have a number there.
    pub(super) statistics: Statistics,
}

/// The mean curve of a measure, over the samples whose paths reached their ends; rows in which no sample has a number are left out.
pub(super) fn mean_curve(results: &Results<'_>, ensemble: Ensemble, measure: usize) -> Vec<MeanRow> {
    let paths: Vec<_> = results
        .of(ensemble.recipe, ensemble.size)
        .filter_map(|sample| sample.paths.as_ref().ok())
        .map(|paths| &paths[ensemble.test])
        .filter(|path| path.stopped.is_none())
        .collect();
    let rows = paths.iter().map(|path| path.strain.len()).min().unwrap_or(0);
    let row_of = |row: usize| {
        let values: Vec<f64> =
            paths.iter().map(|path| path.measures[measure][row]).filter(|value| value.is_finite()).collect();
        let strain = paths.iter().map(|path| path.strain[row]).sum::<f64>() / paths.len() as f64;
        Statistics::of(&values).map(|statistics| MeanRow { strain, statistics })
    };
    (0..rows).filter_map(row_of).collect()
}

/// Ensembles of a study, each once whatever its quantities are.
pub(super) fn curves_of(results: &Results<'_>) -> Vec<Ensemble> {
    results.ensembles().into_iter().filter(|ensemble| ensemble.quantity == 0).collect()
}
