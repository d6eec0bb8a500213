//! The curve of `history.svg`: which columns of the history it shows.

use charts::{ChartError, PathPoint, path_svg};
use macro_solver::output::HistoryRow;

/// Draws one column of the history over another, with units; `probes` are names and units, `-` for none. `None` without rows or if a number is not finite.
///
/// # Errors
/// The drawing library refuses.
pub(super) fn curve(
    rows: &[HistoryRow],
    probes: &[(String, &str)],
    x: &str,
    y: &str,
) -> Result<Option<String>, ChartError> {
    let value = |row: &HistoryRow, column: &str| match column {
        "time" => row.time,
        "load" => row.load,
        name => probes.iter().position(|(probe, _)| probe == name).map_or(f64::NAN, |index| row.probes[index]),
    };
    let column = probes.iter().position(|(probe, _)| probe == y);
    let error =
        |row: &HistoryRow| column.and_then(|column| row.probe_errors.get(column).copied().flatten()).unwrap_or(0.0);
    let points: Vec<PathPoint> = rows
        .iter()
        .map(|row| PathPoint {
            place: (value(row, x), value(row, y)),
            error: error(row),
            cut_back: row.cut_backs > 0,
            stabilised: row.stabilised > 0,
        })
        .collect();
    let label = |column: &str| match probes.iter().find(|(probe, _)| probe == column) {
        Some((_, unit)) if *unit != "-" => format!("{column}, {unit}"),
        None if column == "time" => "time, s".to_owned(),
        _ => column.to_owned(),
    };
    path_svg([&label(x), &label(y)], &points)
}

#[cfg(test)]
mod tests {
    use super::*;
    use macro_solver::observer::StepAccuracy;

    #[test]
    fn columns_are_found_by_name_and_an_unknown_one_gives_no_picture() {
        let row = |step: u64| HistoryRow {
            step,
            time: step as f64,
            load: 0.1 * step as f64,
            iterations: 1,
            evaluations: 8,
            stage: 0,
            probes: vec![2.0 * step as f64],
            cut_backs: u64::from(step == 1),
            stabilised: 0,
            committed_iterates: 0,
            accuracy: StepAccuracy::default(),
            probe_errors: Vec::new(),
        };
        let (rows, probes) = ([row(0), row(1), row(2)], [("ratio".to_owned(), "-")]);
        let text = curve(&rows, &probes, "load", "ratio").unwrap().unwrap();
        assert!(text.contains("load") && text.contains("ratio") && text.contains("after cut-backs"));
        assert_eq!(curve(&rows, &probes, "load", "missing").unwrap(), None);
        let text = curve(&rows, &[("force".to_owned(), "N/m")], "time", "force").unwrap().unwrap();
        assert!(text.contains("force, N/m") && text.contains("time, s"));
    }
}
