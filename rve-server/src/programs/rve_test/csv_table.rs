//! Rows of an element test as CSV. Equal rows give equal bytes; no column holds a time.

use super::path::flat;
use super::row::ElementRow;
use super::run::run_element_on;
use super::start_check::start_note;
use super::summary::ElementEnd;
use super::test_file::{COMPONENT_KEYS, ElementTest, is_in_plane};
use crate::definition::Packing;
use protocol::TangentKind;
use std::io::Write;
use std::ops::ControlFlow;

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

/// A whole test as a table.
#[derive(Debug)]
pub struct ElementTable {
    /// Its rows as CSV, those of [`ElementCsv`].
    pub csv: Vec<u8>,
    /// How it ended.
    pub end: ElementEnd,
    /// Whether `keep_going` has ended it.
    pub is_interrupted: bool,
    /// What [`start_note`] has to say about it.
    pub note: Option<String>,
}

/// Runs `test` on a packing in memory, see [`run_element_on`], and returns its table. `keep_going` is called after every row; `false`
/// ends the test.
///
/// # Errors
/// A row that cannot be encoded.
pub fn element_table(
    test: &ElementTest,
    packing: Packing,
    tangent: TangentKind,
    has_units: bool,
    keep_going: &mut dyn FnMut() -> bool,
) -> csv::Result<ElementTable> {
    let mut csv = Vec::new();
    let mut encoder = ElementCsv::new(&mut csv, tangent)?.with_units(has_units);
    let mut written = Ok(());
    let (mut is_interrupted, mut note) = (false, None);
    let end = run_element_on(test, packing, tangent, &mut |row| {
        if row.increment == 0 {
            note = start_note(test, row);
        }
        written = encoder.write(row);
        is_interrupted = !keep_going();
        if written.is_err() || is_interrupted { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    drop(encoder);
    written?;
    Ok(ElementTable { csv, end, is_interrupted, note })
}

/// Writes the header and then one line per row, each as soon as it is given.
pub struct ElementCsv<W: Write> {
    writer: csv::Writer<W>,
    tangent: TangentKind,
    has_header: bool,
    has_units: bool,
}

impl<W: Write> ElementCsv<W> {
    /// Starts a table; operator columns appear unless `tangent` is [`TangentKind::None`]. The header is written with the
    /// first row, which decides the components.
    ///
    /// # Errors
    /// Errors of the output.
    pub fn new(output: W, tangent: TangentKind) -> csv::Result<Self> {
        Ok(Self { writer: csv::Writer::from_writer(output), tangent, has_header: false, has_units: false })
    }

    /// Whether the header holds units, `sigma_xx [Pa]`.
    #[must_use]
    pub fn with_units(self, has_units: bool) -> Self {
        Self { has_units, ..self }
    }

    fn write_header(&mut self, row: &ElementRow) -> csv::Result<()> {
        let dimension = row.dimension;
        let mut names = vec!["increment".to_owned()];
        for quantity in ["F", "sigma"] {
            names.extend(places(dimension).map(|place| format!("{quantity}_{}", COMPONENT_KEYS[place])));
        }
        names.extend(SCALARS.map(str::to_owned));
        if self.tangent != TangentKind::None {
            let pair = |place: usize| format!("{}{}", place / 3 + 1, place % 3 + 1);
            names.extend(
                places(dimension)
                    .flat_map(|row| places(dimension).map(move |column| format!("C_{}{}", pair(row), pair(column)))),
            );
        }
        names.extend(["elastic_energy", "frictional_dissipation"].map(str::to_owned));
        names.extend(upper(row.dimension).map(|place| format!("fabric_{}", COMPONENT_KEYS[place])));
        if row.force_anisotropy.is_some() {
            names.extend(["a_c", "a_n", "a_t"].map(str::to_owned));
        }
        names.push("work".to_owned());
        if row.damping_work.is_some() {
            names.push("damping_work".to_owned());
        }
        self.has_header = true;
        if self.has_units {
            names.iter_mut().for_each(|name| *name = headed(name));
        }
        self.writer.write_record(&names)
    }

    /// Writes one row.
    ///
    /// # Errors
    /// Errors of the output.
    pub fn write(&mut self, row: &ElementRow) -> csv::Result<()> {
        if !self.has_header {
            self.write_header(row)?;
        }
        let mut numbers: Vec<f64> = Vec::new();
        for tensor in [&row.deformation, &row.stress] {
            numbers.extend(places(row.dimension).map(|place| flat(tensor)[place]));
        }
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
            let operator = &outcome.operator;
            fields.extend(places(row.dimension).flat_map(|line| {
                places(row.dimension)
                    .map(move |column| shortest(operator.get(line / 3, line % 3, column / 3, column % 3)))
            }));
        }
        let mut last = vec![row.elastic_energy, row.frictional_dissipation];
        last.extend(upper(row.dimension).map(|place| flat(&row.fabric)[place]));
        last.extend(row.force_anisotropy.iter().flat_map(|one| [one.contacts, one.normal, one.tangential]));
        last.push(row.work);
        last.extend(row.damping_work);
        fields.extend(last.into_iter().map(shortest));
        self.writer.write_record(&fields)?;
        self.writer.flush()?;
        Ok(())
    }
}

/// A column's name with its unit.
fn headed(name: &str) -> String {
    match name.split('_').next() {
        Some("sigma" | "C") => format!("{name} [Pa]"),
        Some("elastic" | "frictional" | "work" | "damping") => format!("{name} [J/m3]"),
        _ => name.to_owned(),
    }
}

/// Numbers of the components that a cell of this dimension has.
fn places(dimension: u32) -> impl Iterator<Item = usize> {
    (0..9).filter(move |place| dimension == 3 || is_in_plane(*place))
}

/// Numbers of the components on and above the diagonal: those of a symmetric tensor.
fn upper(dimension: u32) -> impl Iterator<Item = usize> {
    places(dimension).filter(|place| place / 3 <= place % 3)
}

/// The shortest text that reads back to the same bits.
fn shortest(value: f64) -> String {
    format!("{value:e}")
}
