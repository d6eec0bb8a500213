//! Tables that the program writes: comma-separated, with a header.

use std::path::Path;

/// A table, by the names in its header.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    names: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// Reads a file; rows that are not as wide as the header fail the test.
    pub fn read(path: &Path) -> Self {
        Self::of(&std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display())))
    }

    /// The table of a text.
    pub fn of(text: &str) -> Self {
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let texts = |row: &csv::StringRecord| row.iter().map(str::to_owned).collect();
        let names = texts(reader.headers().expect("the table has a header"));
        let rows = reader.records().map(|row| texts(&row.expect("a row is as wide as the header"))).collect();
        Self { names, rows }
    }

    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// How many rows there are, the header not among them.
    pub fn count(&self) -> usize {
        self.rows.len()
    }

    /// A column as it is written.
    pub fn texts(&self, name: &str) -> Vec<&str> {
        let place = self.place(name);
        self.rows.iter().map(|row| row[place].as_str()).collect()
    }

    /// The numbers of a column; what is left empty is NaN.
    pub fn column(&self, name: &str) -> Vec<f64> {
        self.texts(name).into_iter().map(number).collect()
    }

    /// The last number of a column.
    pub fn last(&self, name: &str) -> f64 {
        *self.column(name).last().expect("the table has rows")
    }

    /// The numbers of some columns, row by row.
    pub fn columns<const N: usize>(&self, names: [&str; N]) -> Vec<[f64; N]> {
        let places = names.map(|name| self.place(name));
        self.rows.iter().map(|row| places.map(|place| number(&row[place]))).collect()
    }

    /// All numbers of each row.
    pub fn rows(&self) -> Vec<Vec<f64>> {
        self.rows.iter().map(|row| row.iter().map(|text| number(text)).collect()).collect()
    }

    fn place(&self, name: &str) -> usize {
        let place = self.names.iter().position(|one| one == name);
        place.unwrap_or_else(|| panic!("no column {name} among {:?}", self.names))
    }
}

fn number(text: &str) -> f64 {
    if text.is_empty() { f64::NAN } else { text.parse().unwrap_or_else(|_| panic!("'{text}' is no number")) }
}
