//! The packing file: grains in a periodic cell, optionally with the tangential forces that a start needs.
//!
//! A packing from any source is accepted if it can be understood; what cannot is refused with the grain or contact
//! named. Centres are wrapped into the cell when the file is read.

use crate::cell::Cell;
use crate::pairs::PairKey;
use serde::{Deserialize, Serialize};
use std::path::Path;
use thiserror::Error;

/// Why a packing was refused or could not be read or written.
#[derive(Debug, Error)]
pub enum PackingError {
    /// The file could not be read or written.
    #[error("packing file {path}: {source}")]
    Io {
        /// The file.
        path: String,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file is not JSON of the expected shape.
    #[error("packing file {path}: {source}")]
    Json {
        /// The file.
        path: String,
        /// The parser's reason, with line and column.
        source: serde_json::Error,
    },
    /// The content does not describe a usable packing.
    #[error("{0}")]
    Content(String),
}

/// A contact with a known tangential force: grain i, grain j, the integer cell shift of j along Y1 and Y2, then the
/// tangential force that acts on i along e (from i to j) rotated by +90 degrees, N.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ListedContact(pub u32, pub u32, pub i32, pub i32, pub f64);

/// The packing file, field by field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PackingFile {
    /// Always `grainspan-packing`.
    pub format: String,
    /// Always 1.
    pub version: u32,
    /// Space dimension; 2.
    pub dimension: u32,
    /// Out-of-plane thickness, m.
    #[serde(default = "unit_thickness")]
    pub thickness: f64,
    /// Periodicity vectors Y1, Y2, each a row, m.
    pub periodicity: [[f64; 2]; 2],
    /// Centre x, centre y, radius of each grain, m.
    pub grains: Vec<[f64; 3]>,
    /// Contacts with history; others start with zero tangential force.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub contacts: Vec<ListedContact>,
    /// Where the packing came from; free form, never read.
    #[serde(default, skip_serializing_if = "serde_json::Value::is_null")]
    pub provenance: serde_json::Value,
}

fn unit_thickness() -> f64 {
    1.0
}

impl PackingFile {
    /// Name of the format.
    pub const FORMAT: &'static str = "grainspan-packing";
    /// Version of the format.
    pub const VERSION: u32 = 1;

    /// Reads and checks a packing file; centres are wrapped into the cell.
    ///
    /// # Errors
    /// See [`PackingError`]; the file is named.
    pub fn read(path: &Path) -> Result<Self, PackingError> {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|source| PackingError::Io { path: name.clone(), source })?;
        let packing: Self =
            serde_json::from_str(&text).map_err(|source| PackingError::Json { path: name.clone(), source })?;
        packing.checked().map_err(|error| PackingError::Content(format!("packing file {name}: {error}")))
    }

    /// Writes the packing, one grain and one contact per line so that differences can be read.
    ///
    /// # Errors
    /// [`PackingError::Io`].
    pub fn write(&self, path: &Path) -> Result<(), PackingError> {
        let name = path.display().to_string();
        // A rename is atomic: a reader or a full disk never leaves half a packing under the final name.
        let partial = path.with_extension("partial");
        std::fs::write(&partial, self.to_json())
            .and_then(|()| std::fs::rename(&partial, path))
            .map_err(|source| PackingError::Io { path: name, source })
    }

    /// The JSON text of the file; numbers are written so that they read back to the same bits.
    pub fn to_json(&self) -> String {
        let list = |rows: Vec<String>| {
            if rows.is_empty() { "[]".to_owned() } else { format!("[\n    {}\n  ]", rows.join(",\n    ")) }
        };
        let mut text = format!(
            "{{\n  \"format\": {},\n  \"version\": {},\n  \"dimension\": {},\n  \"thickness\": {},\n  \"periodicity\": {},\n",
            json(&self.format),
            self.version,
            self.dimension,
            json(&self.thickness),
            json(&self.periodicity),
        );
        text += &format!("  \"grains\": {}", list(self.grains.iter().map(json).collect()));
        if !self.contacts.is_empty() {
            let rows = self.contacts.iter().map(json).collect();
            text += &format!(",\n  \"contacts\": {}", list(rows));
        }
        if !self.provenance.is_null() {
            text += &format!(",\n  \"provenance\": {}", json(&self.provenance));
        }
        text + "\n}\n"
    }

    /// Checks everything that can be wrong and wraps the centres, adjusting the shifts of listed contacts.
    ///
    /// # Errors
    /// [`PackingError::Content`] naming the grain or contact and the remedy.
    pub fn checked(mut self) -> Result<Self, PackingError> {
        let refuse = |reason: String| Err(PackingError::Content(reason));
        if self.format != Self::FORMAT {
            return refuse(format!("format is `{}`, but `{}` was expected", self.format, Self::FORMAT));
        }
        if self.version != Self::VERSION {
            return refuse(format!(
                "version {} is not known; this program reads version {}",
                self.version,
                Self::VERSION
            ));
        }
        if self.dimension != 2 {
            return refuse(format!("dimension {} is not supported by this engine; it serves 2", self.dimension));
        }
        if !(self.thickness.is_finite() && self.thickness > 0.0) {
            return refuse(format!("thickness = {} must be a positive length in m", self.thickness));
        }
        let cell = Cell { rows: self.periodicity };
        if !self.periodicity.iter().flatten().all(|value| value.is_finite()) {
            return refuse("periodicity holds a number that is not finite".into());
        }
        let area = cell.area();
        if area <= 0.0 {
            return refuse(format!(
                "periodicity spans an area of {area:e} m2; Y2 must lie counter-clockwise of Y1 (swap the two rows)"
            ));
        }
        if self.grains.is_empty() {
            return refuse("a packing needs at least one grain".into());
        }
        self.check_grains(&cell)?;
        let wraps = self.wrap_centres(&cell);
        self.check_contacts(&wraps)?;
        Ok(self)
    }

    fn check_grains(&self, cell: &Cell) -> Result<(), PackingError> {
        let refuse = |reason: String| Err(PackingError::Content(reason));
        let shortest = shortest_translation(cell);
        for (index, [x, y, radius]) in self.grains.iter().enumerate() {
            if !(x.is_finite() && y.is_finite() && radius.is_finite()) {
                return refuse(format!("grain {index}: [{x}, {y}, {radius}] holds a number that is not finite"));
            }
            if *radius <= 0.0 {
                return refuse(format!("grain {index}: radius {radius} must be positive"));
            }
            // A lattice of one grain per cell overlaps its own images a little; beyond that it is a mistake in units.
            if 2.0 * radius > 1.15 * shortest {
                return refuse(format!(
                    "grain {index}: diameter {} exceeds the distance {shortest} to its own image; \
                     the grain is larger than the cell",
                    2.0 * radius
                ));
            }
        }
        Ok(())
    }

    fn wrap_centres(&mut self, cell: &Cell) -> Vec<[i32; 2]> {
        self.grains
            .iter_mut()
            .map(|grain| {
                let (inside, shift) = cell.wrapped([grain[0], grain[1]]);
                if shift != [0, 0] {
                    (grain[0], grain[1]) = (inside[0], inside[1]);
                }
                shift
            })
            .collect()
    }

    fn check_contacts(&mut self, wraps: &[[i32; 2]]) -> Result<(), PackingError> {
        let refuse = |reason: String| Err(PackingError::Content(reason));
        let count = self.grains.len();
        let mut keys = Vec::with_capacity(self.contacts.len());
        for (index, contact) in self.contacts.iter_mut().enumerate() {
            let ListedContact(i, j, first, second, force) = contact;
            if *i as usize >= count || *j as usize >= count {
                return refuse(format!("contact {index}: grain {} does not exist; there are {count}", (*i).max(*j)));
            }
            if !force.is_finite() {
                return refuse(format!("contact {index}: tangential force {force} is not finite"));
            }
            let (from, to) = (wraps[*i as usize], wraps[*j as usize]);
            *first += to[0] - from[0];
            *second += to[1] - from[1];
            if i == j && [*first, *second] == [0, 0] {
                return refuse(format!("contact {index}: grain {i} cannot touch itself without a cell shift"));
            }
            keys.push((PairKey::canonical(*i, *j, [*first, *second]), index));
        }
        keys.sort_unstable();
        if let Some(twice) = keys.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            return refuse(format!("contacts {} and {} name the same pair", twice[0].1, twice[1].1));
        }
        Ok(())
    }
}

/// Length of the shortest of the vectors Y1, Y2, Y1 + Y2, Y1 - Y2, m.
fn shortest_translation(cell: &Cell) -> f64 {
    [[1, 0], [0, 1], [1, 1], [1, -1]]
        .map(|shift| {
            let vector = cell.translation(shift);
            vector[0].hypot(vector[1])
        })
        .into_iter()
        .fold(f64::INFINITY, f64::min)
}

/// JSON text of numbers, lists and JSON values.
fn json<T: Serialize + ?Sized>(value: &T) -> String {
    serde_json::to_string(value).expect("numbers, lists and JSON values always serialise")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> PackingFile {
        PackingFile {
            format: PackingFile::FORMAT.into(),
            version: 1,
            dimension: 2,
            thickness: 1.0,
            periodicity: [[4.0, 0.0], [1.0, 4.0]],
            grains: vec![[0.5, 0.5, 0.5], [1.45, 0.5, 0.5], [2.0, 3.0, 0.7]],
            contacts: vec![ListedContact(0, 1, 0, 0, 0.1)],
            provenance: serde_json::json!({ "by": "hand" }),
        }
    }

    fn reason(packing: PackingFile) -> String {
        packing.checked().unwrap_err().to_string()
    }

    #[test]
    fn file_reads_back_to_the_same_bits() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p.json");
        let mut packing = square();
        packing.grains[2] = [0.1 + 0.2, 1.0 / 3.0, 0.7000000000000001];
        packing.write(&path).unwrap();
        assert_eq!(PackingFile::read(&path).unwrap(), packing);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no partial file stays behind");
    }

    #[test]
    fn centres_outside_are_wrapped_with_their_contacts() {
        let mut packing = square();
        packing.grains[1][0] += 4.0 + 1.0;
        packing.grains[1][1] += 4.0;
        packing.contacts[0] = ListedContact(0, 1, -1, -1, 0.1);
        let wrapped = packing.checked().unwrap();
        assert!((wrapped.grains[1][0] - 1.45).abs() < 1e-14);
        assert_eq!(wrapped.contacts[0], ListedContact(0, 1, 0, 0, 0.1));
    }

    #[test]
    fn every_defect_names_its_grain_or_contact() {
        let with = |change: &dyn Fn(&mut PackingFile)| {
            let mut packing = square();
            change(&mut packing);
            reason(packing)
        };
        assert!(with(&|p| p.grains[1][2] = -0.5).contains("grain 1: radius -0.5 must be positive"));
        assert!(with(&|p| p.grains[2][0] = f64::NAN).contains("grain 2"));
        assert!(with(&|p| p.grains[2][2] = 2.4).contains("larger than the cell"));
        assert!(with(&|p| p.contacts[0].1 = 9).contains("grain 9 does not exist"));
        assert!(with(&|p| p.contacts.push(ListedContact(1, 0, 0, 0, 0.0))).contains("name the same pair"));
        assert!(with(&|p| p.contacts[0] = ListedContact(0, 0, 0, 0, 0.0)).contains("cannot touch itself"));
        assert!(with(&|p| p.periodicity.swap(0, 1)).contains("swap the two rows"));
        assert!(with(&|p| p.grains.clear()).contains("at least one grain"));
        assert!(with(&|p| p.dimension = 3).contains("dimension 3"));
        assert!(with(&|p| p.thickness = 0.0).contains("thickness"));
        assert!(with(&|p| p.format = "yade".into()).contains("grainspan-packing"));
    }
}
