//! Rows of an element test as CSV. Equal rows give equal bytes; no column holds a time.

use super::ElementRow;
use super::path::flat;
use protocol::TangentKind;
use std::io::Write;

const SUFFIXES: [&str; 4] = ["xx", "xy", "yx", "yy"];
const PAIRS: [&str; 4] = ["11", "12", "21", "22"];
const SCALARS: [&str; 8] = [
    "void_ratio",
    "coordination_number",
    "coordination_number_no_rattlers",
    "fabric_anisotropy",
    "sliding_fraction",
    "unbalanced_force_ratio",
    "max_overlap_ratio",
    "dem_steps",
];

/// Writes the header and then one line per row, each as soon as it is given.
pub struct ElementCsv<W: Write> {
    writer: csv::Writer<W>,
}

impl<W: Write> ElementCsv<W> {
    /// Starts a table; operator columns appear unless `tangent` is [`TangentKind::None`].
    ///
    /// # Errors
    /// Whatever the output reports.
    pub fn new(output: W, tangent: TangentKind) -> csv::Result<Self> {
        let mut writer = csv::Writer::from_writer(output);
        let mut names = vec!["increment".to_owned()];
        names.extend(SUFFIXES.map(|suffix| format!("F_{suffix}")));
        names.extend(SUFFIXES.map(|suffix| format!("sigma_{suffix}")));
        names.extend(SCALARS.map(str::to_owned));
        if tangent != TangentKind::None {
            names.extend(PAIRS.iter().flat_map(|row| PAIRS.map(|column| format!("C_{row}{column}"))));
        }
        writer.write_record(&names)?;
        Ok(Self { writer })
    }

    /// Writes one row.
    ///
    /// # Errors
    /// Whatever the output reports.
    pub fn write(&mut self, row: &ElementRow) -> csv::Result<()> {
        let mut numbers: Vec<f64> = Vec::new();
        numbers.extend(flat(&row.deformation));
        numbers.extend(flat(&row.stress));
        numbers.extend([
            row.void_ratio,
            row.coordination_number,
            row.coordination_number_no_rattlers,
            row.fabric_anisotropy,
            row.sliding_fraction,
            row.unbalanced_force_ratio,
            row.max_overlap_ratio,
        ]);
        let mut fields = vec![row.increment.to_string()];
        fields.extend(numbers.iter().map(|value| shortest(*value)));
        fields.push(row.dem_steps.to_string());
        if let Some(outcome) = &row.tangent {
            fields.extend(outcome.operator.plane().iter().flatten().map(|value| shortest(*value)));
        }
        self.writer.write_record(&fields)?;
        self.writer.flush()?;
        Ok(())
    }
}

/// The shortest text that reads back to the same bits.
fn shortest(value: f64) -> String {
    format!("{value:e}")
}
