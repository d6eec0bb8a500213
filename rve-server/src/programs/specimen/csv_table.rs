//! Rows of a specimen test as CSV. Equal rows give equal bytes; no column holds a wall-clock time.

use super::results::SpecimenRow;
use std::io::Write;

const NAMES: [&str; 28] = [
    "stage",
    "step",
    "time",
    "strain_xx",
    "strain_yy",
    "strain_zz",
    "wall_sigma_xx",
    "wall_sigma_yy",
    "wall_sigma_zz",
    "sigma_xx",
    "sigma_yy",
    "sigma_zz",
    "sigma_xy",
    "sigma_xz",
    "sigma_yz",
    "void_ratio",
    "coordination_number",
    "fabric_anisotropy",
    "sliding_fraction",
    "unbalanced_force_ratio",
    "max_overlap_ratio",
    "kinetic_energy",
    "elastic_energy",
    "friction_work",
    "viscous_work",
    "damping_work",
    "wall_work",
    "missing_energy",
];

/// Unit of a column that has one.
fn unit(name: &str) -> Option<&'static str> {
    match name.rsplit('_').next() {
        Some("time") => Some("s"),
        Some("energy" | "work") => Some("J"),
        _ if name.contains("sigma_") => Some("Pa"),
        _ => None,
    }
}

/// Writes the header and then one line per row.
pub struct SpecimenCsv<W: Write> {
    writer: csv::Writer<W>,
}

impl<W: Write> SpecimenCsv<W> {
    /// Starts a table whose header may hold units, `sigma_xx [Pa]`.
    ///
    /// # Errors
    /// Errors of the output.
    pub fn new(output: W, has_units: bool) -> csv::Result<Self> {
        let mut writer = csv::Writer::from_writer(output);
        writer.write_record(NAMES.map(|name| match unit(name) {
            Some(unit) if has_units => format!("{name} [{unit}]"),
            _ => name.to_owned(),
        }))?;
        Ok(Self { writer })
    }

    /// Writes one row.
    ///
    /// # Errors
    /// Errors of the output.
    pub fn write(&mut self, row: &SpecimenRow) -> csv::Result<()> {
        let mut cells = vec![row.stage.clone(), row.step.to_string(), row.time.to_string()];
        let numbers = row.strain.iter().chain(&row.wall_stress).chain(&row.contact_stress).copied().chain([
            row.void_ratio,
            row.coordination_number,
            row.fabric_anisotropy,
            row.sliding_fraction,
            row.unbalanced_force_ratio,
            row.max_overlap_ratio,
            row.kinetic_energy,
            row.elastic_energy,
            row.friction_work,
            row.viscous_work,
            row.damping_work,
            row.wall_work,
            row.missing_energy,
        ]);
        cells.extend(numbers.map(|number| number.to_string()));
        self.writer.write_record(&cells)?;
        self.writer.flush()?;
        Ok(())
    }
}

impl SpecimenCsv<Vec<u8>> {
    /// The bytes of the table.
    ///
    /// # Errors
    /// Errors of the output.
    pub fn into_inner(self) -> csv::Result<Vec<u8>> {
        self.writer.into_inner().map_err(|error| csv::Error::from(error.into_error()))
    }
}
