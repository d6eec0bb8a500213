//! Rows of a specimen test as CSV. Equal rows give equal bytes; no column holds a wall-clock time.

use super::axes::axis_of;
use super::results::SpecimenRow;
use super::test_file::SpecimenTest;
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
    /// Per component of shear, whether its walls have a stress.
    shear: Vec<bool>,
    has_gravity: bool,
}

impl<W: Write> SpecimenCsv<W> {
    /// Starts a table whose header may hold units, `sigma_xx [Pa]`. Columns of shear come last, where a stage asks for it,
    /// and after them the work of gravity, where there is any.
    ///
    /// # Errors
    /// Errors of the output.
    pub fn new(output: W, has_units: bool, test: &SpecimenTest) -> csv::Result<Self> {
        let mut writer = csv::Writer::from_writer(output);
        let mut names = NAMES.map(str::to_owned).to_vec();
        let mut shear = Vec::new();
        for sheared in test.sheared() {
            let is_walled = !test.periodic.iter().any(|axis| axis_of(axis) == Some(sheared.side));
            names.push(format!("shear_{}", sheared.name));
            names.extend(is_walled.then(|| format!("wall_sigma_{}", sheared.name)));
            shear.push(is_walled);
        }
        names.extend((!shear.is_empty()).then(|| "shear_work".to_owned()));
        let has_gravity = test.motion.gravity.iter().any(|part| *part != 0.0);
        names.extend(has_gravity.then(|| "gravity_work".to_owned()));
        // With scaled masses a step is one unit of time, whatever its strain: no seconds.
        let unit = |name: &String| unit(name).filter(|_| name != "time" || !test.motion.scaled_masses);
        writer.write_record(names.iter().map(|name| match unit(name) {
            Some(unit) if has_units => format!("{name} [{unit}]"),
            _ => name.clone(),
        }))?;
        writer.flush()?;
        Ok(Self { writer, shear, has_gravity })
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
        for ([strain, stress], is_walled) in row.shear.iter().zip(&self.shear) {
            cells.push(strain.to_string());
            cells.extend(is_walled.then(|| stress.to_string()));
        }
        cells.extend((!self.shear.is_empty()).then(|| row.shear_work.to_string()));
        cells.extend(self.has_gravity.then(|| row.gravity_work.to_string()));
        self.writer.write_record(&cells)?;
        self.writer.flush()?;
        Ok(())
    }
}

impl SpecimenCsv<Vec<u8>> {
    /// Goes on behind the rows of an earlier process, which [`so_far`](Self::so_far) gave.
    ///
    /// # Errors
    /// Errors of the output.
    pub fn resumed(table: Vec<u8>, has_units: bool, test: &SpecimenTest) -> csv::Result<Self> {
        let Self { shear, has_gravity, .. } = Self::new(Vec::new(), has_units, test)?;
        Ok(Self { writer: csv::Writer::from_writer(table), shear, has_gravity })
    }

    /// The bytes so far.
    pub fn so_far(&self) -> &[u8] {
        self.writer.get_ref()
    }

    /// The bytes of the table.
    ///
    /// # Errors
    /// Errors of the output.
    pub fn into_inner(self) -> csv::Result<Vec<u8>> {
        self.writer.into_inner().map_err(|error| csv::Error::from(error.into_error()))
    }
}
