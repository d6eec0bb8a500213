//! Pictures of the grains of a specimen.

use crate::cli::cell_files::{arrows, force_chains, rotations, write_contacts};
use crate::cli::earlier_files::{remove, remove_numbered};
use crate::exit::Failure;
use macro_solver::output::{Field, FieldSeries, OutputError, write_atomically, write_particles};
use rve_server::homogenization::picture::{CellPicture, ContactLine};
use rve_server::programs::specimen::{Shown, SpecimenPicture, SpecimenRow, less_linear_field};
use std::path::{Path, PathBuf};

/// Endings of the files of a row, behind `grains-NNNN`; contacts have the first one behind `contacts-NNNN`.
const GRAINS: &str = ".vtp";
const FLUCTUATIONS: &str = "-fluctuations.svg";
const FORCE_CHAINS: &str = "-force-chains.svg";
const ROTATIONS: &str = "-rotations.svg";

/// ParaView files of the grains and their contacts, and of discs pictures of fluctuations, force chains and rotations.
pub(super) struct Pictures {
    folder: PathBuf,
    pub(super) series: FieldSeries,
    /// That of the contacts, if they are drawn.
    contacts: Option<FieldSeries>,
    drawn: usize,
    /// 2 for discs, 3 for spheres.
    dimension: usize,
    /// Stage from whose start fluctuations are counted.
    from: Option<usize>,
    /// Centres at that moment, m; empty before it, and where fluctuations are not asked for.
    pub(super) start: Vec<[f64; 3]>,
}

impl Pictures {
    /// Makes the folder.
    ///
    /// # Errors
    /// It cannot be made.
    pub(super) fn create(
        folder: &Path,
        from: Option<usize>,
        has_contacts: bool,
        dimension: usize,
    ) -> Result<Self, Failure> {
        std::fs::create_dir_all(folder).map_err(|source| OutputError::write(folder, source))?;
        let series = FieldSeries::new(&folder.join("grains.pvd"));
        let contacts = has_contacts.then(|| FieldSeries::new(&folder.join("contacts.pvd")));
        Ok(Self { folder: folder.to_owned(), series, contacts, drawn: 0, dimension, from, start: Vec::new() })
    }

    /// Fluctuations may be counted from this stage on.
    pub(super) fn begun(&mut self, stage: usize, picture: &dyn Fn() -> SpecimenPicture) {
        if self.from == Some(stage) {
            self.start = picture().centres;
        }
    }

    /// Writes the files of a row.
    ///
    /// # Errors
    /// A file cannot be written.
    pub(super) fn draw(&mut self, row: &SpecimenRow, shown: &dyn Shown) -> Result<(), OutputError> {
        if self.drawn == 0 {
            remove_numbered(&self.folder, "grains", &[GRAINS, FLUCTUATIONS, FORCE_CHAINS, ROTATIONS])?;
            remove_numbered(&self.folder, "contacts", &[GRAINS])?;
            if self.contacts.is_none() {
                remove(&self.folder.join("contacts.pvd"))?;
            }
        }
        let picture = shown.grains();
        let contacts = if self.contacts.is_some() { shown.contacts() } else { Vec::new() };
        let body = as_body(self.dimension, &picture, contacts);
        let name = format!("grains-{:04}{GRAINS}", self.drawn);
        self.drawn += 1;
        let title = format!("stage {}, step {}", row.stage, row.step);
        let mut fields = vec![
            Field::scalar("radius", picture.radii.clone()),
            Field::vector("rotation", &picture.rotations),
            Field::vector("velocity", &picture.velocities),
        ];
        if !self.start.is_empty() {
            let fluctuations = less_linear_field(&self.start, &picture.centres);
            if self.dimension == 2 {
                let file = self.folder.join(name.replace(GRAINS, FLUCTUATIONS));
                write_atomically(&file, arrows(&title, &body, &fluctuations).to_svg().as_bytes())?;
            }
            fields.push(Field::vector("displacement_fluctuation", &fluctuations));
        }
        self.draw_contacts(row.step, &name, &title, &body)?;
        write_particles(&self.folder.join(&name), &picture.centres, &fields)?;
        self.series.add(row.step as f64, name)
    }

    /// The files of a row for ParaView, given that of the grains.
    pub(super) fn files(&self, grains: &str) -> Vec<String> {
        let contacts = self.contacts.is_some().then(|| of_contacts(grains));
        std::iter::once(grains.to_owned()).chain(contacts).collect()
    }

    /// Goes on behind the rows of an earlier process.
    ///
    /// # Errors
    /// The lists of files cannot be written.
    pub(super) fn go_on(&mut self, frames: &[(f64, String)], start: &[[f64; 3]]) -> Result<(), OutputError> {
        self.drawn = frames.len();
        self.start = start.to_vec();
        if let Some(series) = &mut self.contacts {
            series.restore(frames.iter().map(|(step, name)| (*step, of_contacts(name))).collect())?;
        }
        self.series.restore(frames.to_vec())
    }

    /// The contacts, if they are drawn, and of discs force chains and rotations.
    fn draw_contacts(&mut self, step: u64, name: &str, title: &str, body: &CellPicture) -> Result<(), OutputError> {
        let Some(series) = &mut self.contacts else { return Ok(()) };
        write_contacts(&self.folder.join(of_contacts(name)), body)?;
        series.add(step as f64, of_contacts(name))?;
        if self.dimension == 2 {
            let write = |ending: &str, text: String| {
                write_atomically(&self.folder.join(name.replace(GRAINS, ending)), text.as_bytes())
            };
            write(FORCE_CHAINS, force_chains(title, body).to_svg())?;
            write(ROTATIONS, rotations(title, body).to_svg())?;
        }
        Ok(())
    }
}

/// The file of the contacts next to one of grains.
fn of_contacts(grains: &str) -> String {
    grains.replacen("grains", "contacts", 1)
}

/// A body as the pictures of cells have it, in the box around its grains.
fn as_body(dimension: usize, picture: &SpecimenPicture, contacts: Vec<ContactLine>) -> CellPicture {
    let [[left, right], [low, high]] = [0, 1].map(|axis| extent(picture, axis));
    CellPicture {
        dimension,
        cell: Vec::new(),
        outline: [[left, low], [right, low], [right, high], [left, high]].map(|[x, y]| [x, y, 0.0]).to_vec(),
        centres: picture.centres.clone(),
        radii: picture.radii.clone(),
        rotations: picture.rotations.clone(),
        rattlers: Vec::new(),
        contacts,
    }
}

/// Where the grains begin and end along an axis, m.
fn extent(picture: &SpecimenPicture, axis: usize) -> [f64; 2] {
    let grains = picture.centres.iter().zip(&picture.radii);
    let ends = grains.flat_map(|(centre, radius)| [centre[axis] - radius, centre[axis] + radius]);
    ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
}
