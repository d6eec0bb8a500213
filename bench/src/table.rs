//! A table of a study: exact in its CSV, short on the screen.

use charts::short;
use std::fmt::Write;

/// One entry.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Cell {
    /// Words.
    Text(String),
    /// A count.
    Count(u64),
    /// A measured value; NaN stands for "not measured".
    Value(f64),
}

impl Cell {
    fn exact(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Count(count) => count.to_string(),
            Self::Value(value) if value.is_nan() => String::new(),
            Self::Value(value) => value.to_string(),
        }
    }

    fn short(&self) -> String {
        match self {
            Self::Value(value) => short(*value),
            other => other.exact(),
        }
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<f64> for Cell {
    fn from(value: f64) -> Self {
        Self::Value(value)
    }
}

impl From<u64> for Cell {
    fn from(count: u64) -> Self {
        Self::Count(count)
    }
}

impl From<usize> for Cell {
    fn from(count: usize) -> Self {
        Self::Count(count as u64)
    }
}

/// Columns with their units in the head, rows of as many cells.
#[derive(Clone, Debug)]
pub(crate) struct Table {
    heads: Vec<String>,
    rows: Vec<Vec<Cell>>,
}

impl Table {
    /// An empty table; a head names the quantity and its unit, `round_trip_us`.
    pub(crate) fn new<const N: usize>(heads: [&str; N]) -> Self {
        Self { heads: heads.map(str::to_owned).to_vec(), rows: Vec::new() }
    }

    /// Adds a row.
    ///
    /// # Panics
    /// When it has not as many cells as the table has columns.
    pub(crate) fn row<const N: usize>(&mut self, cells: [Cell; N]) {
        assert_eq!(N, self.heads.len(), "a row has one cell per column");
        self.rows.push(cells.to_vec());
    }

    /// Every digit, for programs.
    pub(crate) fn to_csv(&self) -> Vec<u8> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        let rows = self.rows.iter().map(|row| row.iter().map(Cell::exact).collect());
        for record in std::iter::once(self.heads.clone()).chain(rows) {
            writer.write_record(&record).expect("rows have one length, and memory takes everything");
        }
        writer.into_inner().expect("memory takes everything")
    }

    /// Four digits, for documents.
    pub(crate) fn to_markdown(&self) -> String {
        let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
        let mut text = line(self.heads.clone()) + &line(vec!["---".to_owned(); self.heads.len()]);
        for row in &self.rows {
            text += &line(row.iter().map(|cell| cell.short().replace('|', "\\|").replace('\n', " ")).collect());
        }
        text
    }

    /// Aligned columns of four digits, for people.
    pub(crate) fn to_text(&self) -> String {
        let rows: Vec<Vec<String>> = self.rows.iter().map(|row| row.iter().map(Cell::short).collect()).collect();
        let width = |column: usize| {
            let cells = rows.iter().map(|row| row[column].chars().count());
            cells.chain([self.heads[column].chars().count()]).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..self.heads.len()).map(width).collect();
        let mut text = String::new();
        for row in std::iter::once(&self.heads).chain(&rows) {
            let line: Vec<String> = row.iter().zip(&widths).map(|(cell, width)| format!("{cell:>width$}")).collect();
            writeln!(text, "  {}", line.join("  ").trim_end()).expect("writing to a String cannot fail");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_exact_for_programs_and_aligned_for_people() {
        let mut table = Table::new(["what", "time_us"]);
        table.row(["a, b".into(), (1.0 / 3.0).into()]);
        table.row(["c".into(), f64::NAN.into()]);
        assert_eq!(table.to_csv(), b"what,time_us\n\"a, b\",0.3333333333333333\nc,\n");
        assert_eq!(table.to_markdown(), "| what | time_us |\n| --- | --- |\n| a, b | 0.3333 |\n| c | - |\n");
        assert_eq!(table.to_text(), "  what  time_us\n  a, b   0.3333\n     c        -\n");
    }
}
