//! The packing file: grains in a periodic cell, optionally with the tangential forces that a start needs.
//!
//! [`PackingFile`] is typed by its dimension; [`Packing`] is whichever a file holds.
//! A packing from any source is accepted if it can be understood; what cannot is refused with the grain or contact
//! named. Centres are wrapped into the cell when the file is read.

use super::listed_contact::ListedContact;
use crate::cell::{ContactRecord, PairKey};
use crate::space::{Components, Discs, Space, Spheres};
use serde::{Deserialize, Serialize};
use std::io::Write;
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

/// The packing file, field by field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, bound = "")]
pub struct PackingFile<S: Space = Discs> {
    /// Always `grainspan-packing`.
    pub format: String,
    /// 1, or 2 for files with rolling moments.
    pub version: u32,
    /// Space dimension, 2 or 3; that of the type.
    pub dimension: u32,
    /// Out-of-plane thickness of a plane packing, m; 1 in space.
    #[serde(default = "unit_thickness")]
    pub thickness: f64,
    /// Periodicity vectors, each a row, m.
    pub periodicity: S::Tensor,
    /// Centre coordinates and radius of each grain, m.
    pub grains: Vec<S::Grain>,
    /// Contacts with history; others start with zero tangential force.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub contacts: Vec<ListedContact<S>>,
    /// Moment of rolling resistance on grain i of each row of `contacts`, N m: about z in the plane, a vector in space. Empty
    /// if there are none; files that hold them are of version 2.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rolling_moments: Vec<S::Spin>,
    /// Where the packing came from; free form, never read.
    #[serde(default, skip_serializing_if = "serde_json::Value::is_null")]
    pub provenance: serde_json::Value,
}

/// A packing of either dimension.
#[derive(Clone, Debug, PartialEq)]
pub enum Packing {
    /// Discs in a plane.
    Discs(PackingFile<Discs>),
    /// Spheres in space.
    Spheres(PackingFile<Spheres>),
}

impl Packing {
    /// Reads and checks a packing file of either dimension; centres are wrapped into the cell.
    ///
    /// # Errors
    /// See [`PackingError`]; the file is named.
    pub fn read(path: &Path) -> Result<Self, PackingError> {
        let (name, text) = text_of(path)?;
        Self::from_json(&name, &text)
    }

    /// Reads and checks the text of a packing file; errors call it `name`.
    ///
    /// # Errors
    /// See [`PackingError`].
    pub fn from_json(name: &str, text: &str) -> Result<Self, PackingError> {
        match dimension_of(name, text)? {
            2 => PackingFile::from_json(name, text).map(Self::Discs),
            3 => PackingFile::from_json(name, text).map(Self::Spheres),
            other => Err(PackingError::Content(format!("packing file {name}: {}", no_dimension(other)))),
        }
    }

    /// 2 or 3.
    pub fn dimension(&self) -> u32 {
        match self {
            Self::Discs(_) => 2,
            Self::Spheres(_) => 3,
        }
    }

    /// Number of grains.
    pub fn number(&self) -> usize {
        match self {
            Self::Discs(packing) => packing.grains.len(),
            Self::Spheres(packing) => packing.grains.len(),
        }
    }
}

/// Name and text of a file.
fn text_of(path: &Path) -> Result<(String, String), PackingError> {
    let name = path.display().to_string();
    match std::fs::read_to_string(path) {
        Ok(text) => {
            // Editors of some systems begin a file with a byte order mark.
            let marked = text.strip_prefix('\u{feff}').map(str::to_owned);
            Ok((name, marked.unwrap_or(text)))
        }
        Err(source) => Err(PackingError::Io { path: name, source }),
    }
}

/// The key `dimension` alone.
fn dimension_of(name: &str, text: &str) -> Result<u32, PackingError> {
    #[derive(Deserialize)]
    struct DimensionOnly {
        dimension: u32,
    }
    let only: DimensionOnly =
        serde_json::from_str(text).map_err(|source| PackingError::Json { path: name.to_owned(), source })?;
    Ok(only.dimension)
}

fn unit_thickness() -> f64 {
    1.0
}

impl PackingFile {
    /// Name of the format.
    pub const FORMAT: &'static str = "grainspan-packing";
    /// Version of the format.
    pub const VERSION: u32 = 1;
    /// Version of files that hold rolling moments: readers that do not know them refuse such a file.
    pub const VERSION_WITH_MOMENTS: u32 = 2;
}

impl<S: Space> PackingFile<S> {
    /// Grains in a cell, without contact history, thickness 1.
    pub fn new(periodicity: S::Tensor, grains: Vec<S::Grain>) -> Self {
        Self {
            format: PackingFile::FORMAT.into(),
            version: PackingFile::VERSION,
            dimension: S::DIMENSION as u32,
            thickness: unit_thickness(),
            periodicity,
            grains,
            contacts: Vec::new(),
            rolling_moments: Vec::new(),
            provenance: serde_json::Value::Null,
        }
    }

    /// Reads and checks a packing file; centres are wrapped into the cell.
    ///
    /// # Errors
    /// See [`PackingError`]; the file is named.
    pub fn read(path: &Path) -> Result<Self, PackingError> {
        let (name, text) = text_of(path)?;
        let dimension = dimension_of(&name, &text)?;
        if dimension as usize != S::DIMENSION {
            return Err(PackingError::Content(format!("packing file {name}: {}", wrong_dimension::<S>(dimension))));
        }
        Self::from_json(&name, &text)
    }

    fn from_json(name: &str, text: &str) -> Result<Self, PackingError> {
        let packing: Self =
            serde_json::from_str(text).map_err(|source| PackingError::Json { path: name.to_owned(), source })?;
        packing.checked().map_err(|error| PackingError::Content(format!("packing file {name}: {error}")))
    }

    /// Writes the packing, one grain and one contact per line so that differences can be read.
    ///
    /// # Errors
    /// [`PackingError::Io`].
    pub fn write(&self, path: &Path) -> Result<(), PackingError> {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        // A rename is atomic: a reader or a full disk never leaves half a packing under the final name.
        let draft = path.with_file_name(format!(".{name}.{}.partial", std::process::id()));
        let written = std::fs::File::create(&draft)
            .and_then(|mut file| file.write_all(self.to_json().as_bytes()).and_then(|()| file.sync_data()))
            .and_then(|()| std::fs::rename(&draft, path));
        written.map_err(|source| {
            // The first error is the one worth telling.
            let _ = std::fs::remove_file(&draft);
            PackingError::Io { path: path.display().to_string(), source }
        })
    }

    /// The JSON text of the file; numbers are written so that they read back to the same bits.
    pub fn to_json(&self) -> String {
        let list = |rows: Vec<String>| {
            if rows.is_empty() { "[]".to_owned() } else { format!("[\n    {}\n  ]", rows.join(",\n    ")) }
        };
        let mut text = format!(
            "{{\n  \"format\": {},\n  \"version\": {},\n  \"dimension\": {},\n",
            json(&self.format),
            self.version,
            self.dimension,
        );
        if S::DIMENSION == 2 {
            text += &format!("  \"thickness\": {},\n", json(&self.thickness));
        }
        text += &format!("  \"periodicity\": {},\n", json(&self.periodicity));
        text += &format!("  \"grains\": {}", list(self.grains.iter().map(json).collect()));
        if !self.contacts.is_empty() {
            let rows = self.contacts.iter().map(json).collect();
            text += &format!(",\n  \"contacts\": {}", list(rows));
        }
        if !self.rolling_moments.is_empty() {
            let rows = self.rolling_moments.iter().map(json).collect();
            text += &format!(",\n  \"rolling_moments\": {}", list(rows));
        }
        if !self.provenance.is_null() {
            text += &format!(",\n  \"provenance\": {}", json(&self.provenance));
        }
        text + "\n}\n"
    }

    /// The listed contacts under their canonical names, in the order of the file, with their rolling moments if there are any.
    pub(crate) fn histories(&self) -> impl Iterator<Item = (ContactRecord<S>, Option<S::Spin>)> + '_ {
        self.contacts.iter().enumerate().map(|(place, listed)| {
            let PairKey { origin, end, shift } = PairKey::<S>::canonical(listed.origin, listed.end, listed.shift);
            let is_swapped = (origin, shift) != (listed.origin, listed.shift);
            let tangential_force = S::seen_from(listed.tangential_force, is_swapped);
            let moment =
                self.rolling_moments.get(place).map(|moment| moment.times(if is_swapped { -1.0 } else { 1.0 }));
            (ContactRecord { origin, end, shift, tangential_force }, moment)
        })
    }
}

/// Why a file of `dimension` is no packing at all.
pub(super) fn no_dimension(dimension: u32) -> String {
    format!("dimension {dimension} was found, but 2 (discs) or 3 (spheres) is needed")
}

/// Why a file of `dimension` cannot be a packing of this type.
pub(super) fn wrong_dimension<S: Space>(dimension: u32) -> String {
    format!("dimension {dimension} was found, but {} ({} dimensions) are needed here", S::GRAINS, S::DIMENSION)
}

/// JSON text of numbers, lists and JSON values.
fn json<T: Serialize + ?Sized>(value: &T) -> String {
    serde_json::to_string(value).expect("numbers, lists and JSON values always serialise")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn listed(origin: u32, end: u32, shift: [i32; 2]) -> ListedContact {
        ListedContact { origin, end, shift, tangential_force: 0.1 }
    }

    fn square() -> PackingFile {
        PackingFile::<Discs> {
            format: PackingFile::FORMAT.into(),
            version: 1,
            dimension: 2,
            thickness: 1.0,
            periodicity: [[4.0, 0.0], [1.0, 4.0]],
            grains: vec![[0.5, 0.5, 0.5], [1.45, 0.5, 0.5], [2.0, 3.0, 0.7]],
            contacts: vec![listed(0, 1, [0, 0])],
            rolling_moments: vec![],
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
        packing.contacts[0] = listed(0, 1, [-1, -1]);
        let wrapped = packing.checked().unwrap();
        assert!((wrapped.grains[1][0] - 1.45).abs() < 1e-14);
        assert_eq!(wrapped.contacts[0], listed(0, 1, [0, 0]));
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
        for far in [1e7, -1e300] {
            assert!(with(&|p| p.grains[1][0] = far).contains("grain 1"));
        }
        assert!(with(&|p| p.contacts[0].shift = [0, i32::MIN]).contains("contact 0: its cell shift"));
        assert!(with(&|p| p.contacts[0].end = 9).contains("grain 9 does not exist"));
        assert!(with(&|p| p.contacts.push(listed(1, 0, [0, 0]))).contains("name the same pair"));
        assert!(with(&|p| p.contacts[0] = listed(0, 0, [0, 0])).contains("cannot touch itself"));
        assert!(with(&|p| p.periodicity.swap(0, 1)).contains("swap the two rows"));
        // The search for pairs ran out of numbers in such a cell: it found none, and the packing bore nothing.
        let leaning = |p: &mut PackingFile| {
            let [[a, b], [c, d]] = p.periodicity;
            p.periodicity[1] = [c + 1e5 * a, d + 1e5 * b];
        };
        assert!(with(&leaning).contains("nearly parallel: the product of their lengths is 1.0e5 times"));
        assert!(with(&|p| p.grains.clear()).contains("at least one grain"));
        assert!(
            with(&|p| p.grains[1] = [0.5, 0.5, 0.4]).contains("grains 0 and 1 have their centres at the same place")
        );
        assert!(with(&|p| p.dimension = 3).contains("dimension 3 was found"));
        assert!(with(&|p| p.thickness = 0.0).contains("thickness"));
        assert!(with(&|p| p.format = "yade".into()).contains("grainspan-packing"));
    }

    /// The nearest image of a grain in a cell that leans far is not among those next to it: Y2 - 3 Y1 is the shortest way here, 0.51.
    #[test]
    fn a_grain_that_overlaps_a_far_image_of_itself_is_refused() {
        let with = |diameter: f64| {
            let grains = vec![[0.5, 0.2, 0.5 * diameter]];
            PackingFile::<Discs> { periodicity: [[1.0, 0.0], [2.9, 0.5]], grains, contacts: vec![], ..square() }
        };
        assert!(reason(with(0.9)).contains("larger than the cell"));
        assert!(with(0.5).checked().is_ok());
    }

    #[test]
    fn either_dimension_is_read_and_a_contact_in_space_carries_a_vector() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p.json");
        let text = r#"{ "format": "grainspan-packing", "version": 1, "dimension": 3,
            "periodicity": [[2.0, 0.0, 0.0], [0.5, 2.0, 0.0], [0.0, 0.0, 2.0]],
            "grains": [[0.5, 0.5, 0.5, 0.5], [1.45, 0.5, 2.5, 0.5]],
            "contacts": [[0, 1, 0, 0, 1, [0.0, 0.1, -0.2]]] }"#;
        std::fs::write(&path, text).unwrap();
        let Packing::Spheres(packing) = Packing::read(&path).unwrap() else { panic!("three axes") };
        assert_eq!(packing.grains[1], [1.45, 0.5, 0.5, 0.5]);
        assert_eq!((packing.contacts[0].shift, packing.contacts[0].tangential_force), ([0, 0, 2], [0.0, 0.1, -0.2]));
        packing.write(&path).unwrap();
        assert_eq!(PackingFile::<Spheres>::read(&path).unwrap(), packing);
        assert!(PackingFile::<Discs>::read(&path).unwrap_err().to_string().contains("dimension 3 was found"));
        let mut thick = packing;
        thick.thickness = 2.0;
        assert!(thick.checked().unwrap_err().to_string().contains("thickness belongs to plane packings"));
    }
}
