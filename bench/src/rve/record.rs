//! What a setting gave: rows of a table and points of pictures.

use super::case::Case;
use crate::table::{Cell, Table};
use anyhow::Context;
use charts::{Chart, Scale};
use std::path::Path;

/// Heads of the table of a case.
const HEADS: [&str; 9] = [
    "curve",
    "setting",
    "cpu_s",
    "force_evaluations",
    "us_per_evaluation",
    "not_equilibrated",
    "error_start",
    "error_to_peak",
    "error_after",
];

/// A setting and what it gave.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Measured {
    /// Settings that differ in one knob.
    pub(super) curve: String,
    /// The setting.
    pub(super) name: String,
    /// Processor time, median over the rounds, s.
    pub(super) processor: f64,
    /// Force evaluations.
    pub(super) evaluations: u64,
    /// Increments that ended at the step cap.
    pub(super) not_equilibrated: u64,
    /// Error of the stress in each window, in units of the pressure; NaN beyond the end of a run.
    pub(super) errors: Vec<f64>,
}

/// The table of a case.
pub(super) fn table(measured: &[Measured]) -> Table {
    let mut table = Table::new(HEADS);
    for row in measured {
        let error = |window: usize| Cell::from(row.errors.get(window).copied().unwrap_or(f64::NAN));
        table.row([
            row.curve.clone().into(),
            row.name.clone().into(),
            row.processor.into(),
            row.evaluations.into(),
            (1e6 * row.processor / row.evaluations as f64).into(),
            row.not_equilibrated.into(),
            error(0),
            error(1),
            error(2),
        ]);
    }
    table
}

/// Reads such a table back.
///
/// # Errors
/// The file cannot be read, or has other columns.
pub(super) fn read(file: &Path) -> anyhow::Result<Vec<Measured>> {
    let mut reader = csv::Reader::from_path(file)?;
    anyhow::ensure!(reader.headers()? == HEADS[..], "these are not the columns of a table of `bench rve`");
    reader.records().map(|record| row(&record?)).collect()
}

fn row(record: &csv::StringRecord) -> anyhow::Result<Measured> {
    let number = |column: usize| -> anyhow::Result<f64> {
        match &record[column] {
            "" => Ok(f64::NAN),
            text => text.parse().with_context(|| format!("{} is `{text}`", HEADS[column])),
        }
    };
    Ok(Measured {
        curve: record[0].to_owned(),
        name: record[1].to_owned(),
        processor: number(2)?,
        evaluations: number(3)? as u64,
        not_equilibrated: number(5)? as u64,
        errors: (6..9).map(number).collect::<anyhow::Result<_>>()?,
    })
}

/// For every window one picture over time and one over force evaluations, with their names.
pub(super) fn charts(case: &Case, measured: &[Measured]) -> Vec<(String, Chart)> {
    let mut curves: Vec<&str> = Vec::new();
    for row in measured {
        if !curves.contains(&row.curve.as_str()) {
            curves.push(&row.curve);
        }
    }
    let mut charts = Vec::new();
    for (window, meaning) in [(0, "start"), (1, "to the peak"), (2, "after")] {
        for (file, axis) in [("time", "processor time, s"), ("evaluations", "force evaluations")] {
            let title = format!("{}, {meaning}", case.name);
            let mut chart =
                Chart::new(&title, (axis, Scale::Logarithmic), ("stress error / pressure", Scale::Logarithmic));
            for curve in &curves {
                let mut points: Vec<[f64; 2]> = measured
                    .iter()
                    .filter(|row| row.curve == *curve)
                    .map(|row| {
                        let price = if file == "time" { row.processor } else { row.evaluations as f64 };
                        [price, row.errors[window]]
                    })
                    .collect();
                points.sort_by(|first, second| first[0].total_cmp(&second[0]));
                chart.curve(curve, points);
            }
            charts.push((format!("{}-{}-{file}", case.name, case.windows[window].name), chart));
        }
    }
    charts
}

#[cfg(test)]
mod tests {
    use super::super::case::CASES;
    use super::super::redraw;
    use super::*;

    #[test]
    fn a_table_is_read_back_and_drawn_as_it_was_written_and_others_are_refused() {
        let measured = |name: &str, errors: [f64; 3]| Measured {
            curve: "strain per step, fast".into(),
            name: name.into(),
            processor: 0.1 + 0.2,
            evaluations: 12_345,
            not_equilibrated: 2,
            errors: errors.to_vec(),
        };
        let rows = [measured("1e-5", [1e-3, 2e-3, 3e-2]), measured("1e-6", [1e-4, 2e-4, f64::NAN])];
        let folder = tempfile::tempdir().unwrap();
        let refused = redraw(folder.path()).unwrap_err().to_string();
        assert!(refused.contains("no table") && refused.contains("--out"), "{refused}");
        let file = folder.path().join("discs-400.csv");
        std::fs::write(&file, table(&rows).to_csv()).unwrap();
        let again = read(&file).unwrap();
        assert_eq!(format!("{again:?}"), format!("{rows:?}"));
        assert_eq!(charts(&CASES[0], &again).len(), 6);
        assert_eq!(redraw(folder.path()).unwrap(), 6);
        for (name, chart) in charts(&CASES[0], &again) {
            let picture = std::fs::read_to_string(folder.path().join(format!("{name}.svg"))).unwrap();
            assert_eq!(picture, chart.to_svg().unwrap());
        }
        std::fs::write(&file, "a,b\n1,2\n").unwrap();
        assert!(read(&file).unwrap_err().to_string().contains("not the columns"));
        assert!(redraw(folder.path()).is_err());
    }
}
