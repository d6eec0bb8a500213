//! `--profiles DIR`: shear of the layers of a specimen at every row, and the band that it shows.

use macro_solver::output::{LayerBand, OutputError, write_atomically};
use rve_server::programs::specimen::{Layers, ProfileTable, Shown, SpecimenPicture, SpecimenRow};
use serde::{Deserialize, Serialize};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// What a continued run needs: the layers and the tables so far.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Kept {
    layers: Option<Layers>,
    profile: String,
    band: String,
}

/// The tables of one run.
pub(super) struct Profiles {
    folder: PathBuf,
    table: ProfileTable,
    /// 2 for discs, 3 for spheres.
    dimension: usize,
    /// Names of the stages.
    stages: Vec<String>,
    kept: Kept,
}

impl Profiles {
    /// Tables in `folder`, which is made.
    ///
    /// # Errors
    /// The folder cannot be made.
    pub(super) fn create(
        folder: &Path,
        table: &ProfileTable,
        dimension: usize,
        stages: Vec<String>,
    ) -> Result<Self, OutputError> {
        std::fs::create_dir_all(folder).map_err(|source| OutputError::write(folder, source))?;
        let kept = Kept {
            layers: None,
            profile: "stage,step,coordinate,displacement,shear_strain,shear_strain_growth\n".to_owned(),
            band: "stage,step,band_width,band_position,band_quality\n".to_owned(),
        };
        Ok(Self { folder: folder.to_owned(), table: table.clone(), dimension, stages, kept })
    }

    /// What a checkpoint keeps.
    pub(super) fn kept(&self) -> &Kept {
        &self.kept
    }

    /// Goes on behind an earlier process.
    pub(super) fn go_on(&mut self, kept: Kept) {
        self.kept = kept;
    }

    /// Counting may begin with this stage.
    pub(super) fn begun(&mut self, stage: usize, picture: &dyn Fn() -> SpecimenPicture) {
        let name = self.stages.get(stage).map_or("", String::as_str);
        if self.table.begins_with(stage, name) {
            self.kept.layers = Some(Layers::new(&self.table, self.dimension, &picture()));
        }
    }

    /// Adds the layers of a row; none before the counting has begun.
    pub(super) fn add(&mut self, row: &SpecimenRow, shown: &dyn Shown) {
        let Kept { layers: Some(layers), profile, band } = &mut self.kept else { return };
        let interfaces = layers.advance(&shown.grains());
        for interface in &interfaces {
            let numbers = [interface.coordinate, interface.displacement, interface.shear_strain, interface.growth]
                .map(|number| number.to_string());
            // Writing to a string cannot fail.
            let _ = writeln!(profile, "{},{},{}", quoted(&row.stage), row.step, numbers.join(","));
        }
        // A band may shear to either side.
        let mean: f64 = interfaces.iter().map(|interface| interface.thickness * interface.growth).sum();
        let sign = if mean < 0.0 { -1.0 } else { 1.0 };
        let samples: Vec<[f64; 3]> = interfaces
            .iter()
            .map(|interface| [interface.coordinate, interface.thickness, sign * interface.growth])
            .collect();
        let [width, position, quality] =
            LayerBand::across(&samples).map_or([f64::NAN; 3], |band| [band.width, band.position, band.quality]);
        let _ = writeln!(band, "{},{},{width},{position},{quality}", quoted(&row.stage), row.step);
    }

    /// Writes the tables.
    ///
    /// # Errors
    /// See [`write_atomically`].
    pub(super) fn write(&self) -> Result<(), OutputError> {
        write_atomically(&self.folder.join("profile.csv"), self.kept.profile.as_bytes())?;
        write_atomically(&self.folder.join("band.csv"), self.kept.band.as_bytes())
    }
}

/// The name of a stage as a field of a table.
fn quoted(name: &str) -> std::borrow::Cow<'_, str> {
    if name.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", name.replace('"', "\"\"")).into()
    } else {
        name.into()
    }
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn names_of_stages_stay_one_field() {
        for name in ["shear", "shear, slow", "the \"fast\" one", "two\nlines", ""] {
            let text = format!("{},1,2\n", quoted(name));
            let mut reader = csv::ReaderBuilder::new().has_headers(false).from_reader(text.as_bytes());
            let row = reader.records().next().unwrap().unwrap();
            assert_eq!((&row[0], row.len()), (name, 3));
        }
        assert_eq!(quoted("shear"), "shear");
    }
}
