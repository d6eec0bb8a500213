//! `cells/point-P.json`: the grains and contacts of one Gauss point, as the page draws them.

use crate::folder::RunFolder;
use crate::numbers::shorts;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;
use vtkio::model::{Attribute, DataSet, Vtk};

/// Folder of the cells.
pub const FOLDER: &str = "cells";

/// A grain: its centre, m, its radius, m, and whether it carries nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grain {
    /// Centre, m.
    pub centre: [f64; 3],
    /// Radius, m.
    pub radius: f64,
    /// Whether it carries nothing.
    pub is_rattler: bool,
}

/// A contact from the centre of one grain to that of the other, which may lie outside the cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Centre of the first grain, m.
    pub from: [f64; 3],
    /// Centre of the second grain or of its image, m.
    pub to: [f64; 3],
    /// Normal force, N, **compression positive**.
    pub compression: f64,
    /// Size of the tangential force, N.
    pub tangential: f64,
    /// Whether it is at the Coulomb limit.
    pub is_sliding: bool,
}

/// One cell at one step.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Gauss point, numbered through the mesh.
    pub point: usize,
    /// Accepted step.
    pub step: u64,
    /// 2 or 3.
    pub dimension: usize,
    /// Periodicity vectors, m; none if they are not known.
    pub vectors: Vec<[f64; 3]>,
    /// The grains.
    pub grains: Vec<Grain>,
    /// The contacts.
    pub contacts: Vec<Contact>,
}

impl Cell {
    /// As JSON: grains `[x, y, (z,) r, rattler]`, contacts `[x, y, (z,) dx, dy, (dz,) compression, tangential, sliding]`.
    pub fn to_json(&self) -> Value {
        let axes = self.dimension;
        let flag = |is: bool| if is { 1.0 } else { 0.0 };
        let grain = |grain: &Grain| {
            shorts(grain.centre[..axes].iter().copied().chain([grain.radius, flag(grain.is_rattler)]))
        };
        let contact = |contact: &Contact| {
            let branch = (0..axes).map(|axis| contact.to[axis] - contact.from[axis]);
            let forces = [contact.compression, contact.tangential, flag(contact.is_sliding)];
            shorts(contact.from[..axes].iter().copied().chain(branch).chain(forces))
        };
        json!({
            "point": self.point,
            "step": self.step,
            "dimension": axes,
            "vectors": self.vectors.iter().map(|vector| shorts(vector[..axes].iter().copied())).collect::<Value>(),
            "grains": self.grains.iter().map(grain).collect::<Value>(),
            "contacts": self.contacts.iter().map(contact).collect::<Value>(),
        })
    }

    /// Name of its file below the output folder.
    pub fn file(point: usize) -> String {
        format!("{FOLDER}/point-{point:04}.json")
    }
}

/// The cells of a folder: steps by Gauss point, those of `grains/` and the one of `cells/`.
pub(crate) fn available(folder: &RunFolder) -> BTreeMap<usize, Vec<u64>> {
    let mut found: BTreeMap<usize, Vec<u64>> = BTreeMap::new();
    for (point, step) in names(folder, "grains").filter_map(|name| drawn(&name)) {
        found.entry(point).or_default().push(step);
    }
    for name in names(folder, FOLDER) {
        let Some(point) = name.strip_prefix("point-").and_then(|rest| rest.strip_suffix(".json")) else { continue };
        let Ok(point) = point.parse() else { continue };
        if let Some(step) = folder.step(&Cell::file(point)) {
            found.entry(point).or_default().push(step);
        }
    }
    for steps in found.values_mut() {
        steps.sort_unstable();
        steps.dedup();
    }
    found
}

/// Of the steps of a point, in their order, the last one up to `step`, else the first after it.
pub(crate) fn nearest(steps: &[u64], step: u64) -> Option<u64> {
    steps.iter().rev().find(|known| **known <= step).or(steps.first()).copied()
}

/// The cell of a point at one of its [`available`] steps; `None` if its file is not whole.
pub(crate) fn read(folder: &RunFolder, point: usize, step: u64) -> Option<Value> {
    let file = Cell::file(point);
    if folder.step(&file) == Some(step) {
        let saved = folder.json(&file);
        // A live run may have replaced it since.
        if let Some(saved) = saved.filter(|cell| cell.get("step").and_then(Value::as_u64) == Some(step)) {
            return Some(saved);
        }
    }
    let path = |what: &str| folder.path().join(format!("grains/{what}-{point:04}-step-{step:04}.vtp"));
    from_vtk(point, step, &path("point"), &path("contacts")).map(|cell| cell.to_json())
}

fn names(folder: &RunFolder, below: &str) -> impl Iterator<Item = String> {
    let entries = std::fs::read_dir(folder.path().join(below)).into_iter().flatten().flatten();
    entries.map(|entry| entry.file_name().to_string_lossy().into_owned())
}

/// Point and step of a file of grains.
fn drawn(name: &str) -> Option<(usize, u64)> {
    let (point, step) = name.strip_prefix("point-")?.strip_suffix(".vtp")?.split_once("-step-")?;
    Some((point.parse().ok()?, step.parse().ok()?))
}

/// Points of a `.vtp` and its named values, on points and on lines.
struct Particles {
    places: Vec<[f64; 3]>,
    fields: BTreeMap<String, Vec<f64>>,
}

fn particles(path: &Path) -> Option<Particles> {
    // A file that is being written has another name; one that is damaged is left out.
    let DataSet::PolyData { pieces, .. } = Vtk::import(path).ok()?.data else { return None };
    let piece = pieces.into_iter().next()?.into_loaded_piece_data(None).ok()?;
    let places: Vec<f64> = piece.points.cast_into()?;
    let arrays = piece.data.point.into_iter().chain(piece.data.cell);
    let fields = arrays.filter_map(|attribute| match attribute {
        Attribute::DataArray(array) => Some((array.name, array.data.cast_into::<f64>()?)),
        Attribute::Field { .. } => None,
    });
    Some(Particles { places: places.as_chunks().0.to_vec(), fields: fields.collect() })
}

fn from_vtk(point: usize, step: u64, grains: &Path, contacts: &Path) -> Option<Cell> {
    let cloud = particles(grains)?;
    // A file without one of the values is not one that a run writes: nothing is drawn in place of what is not known.
    let value = |from: &Particles, name: &str, place: usize| from.fields.get(name)?.get(place).copied();
    let grain = |(place, &centre): (usize, &[f64; 3])| {
        let (radius, rattler) = (value(&cloud, "radius", place)?, value(&cloud, "rattler", place)?);
        Some(Grain { centre, radius, is_rattler: rattler != 0.0 })
    };
    let contact = |lines: &Particles, place: usize, ends: &[[f64; 3]; 2]| {
        Some(Contact {
            from: ends[0],
            to: ends[1],
            compression: -value(lines, "normal_force", place)?,
            tangential: value(lines, "tangential_force", place)?,
            is_sliding: value(lines, "sliding", place)? != 0.0,
        })
    };
    // Runs write contacts only if they are asked for them.
    let lines = particles(contacts);
    let contacts = lines.iter().flat_map(|lines| {
        lines.places.as_chunks::<2>().0.iter().enumerate().map(|(place, ends)| contact(lines, place, ends))
    });
    // Discs turn about one axis, spheres about three.
    let dimension = if cloud.fields.get("rotation")?.len() > cloud.places.len() { 3 } else { 2 };
    Some(Cell {
        point,
        step,
        dimension,
        vectors: Vec::new(),
        grains: cloud.places.iter().enumerate().map(grain).collect::<Option<_>>()?,
        contacts: contacts.collect::<Option<_>>()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// A file with one grain, whose radius has this name.
    fn grain_file(radius: &str) -> String {
        let array = |name: &str, value: &str| {
            format!("<DataArray type=\"Float64\" Name=\"{name}\" format=\"ascii\">{value}</DataArray>")
        };
        let data = [array(radius, "0.5"), array("rattler", "0"), array("rotation", "0")].concat();
        let places =
            "<DataArray type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\" format=\"ascii\">1 2 0</DataArray>";
        format!(
            "<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\"><PolyData>\
             <Piece NumberOfPoints=\"1\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"0\">\
             <PointData>{data}</PointData><Points>{places}</Points></Piece></PolyData></VTKFile>"
        )
    }

    #[test]
    fn the_cell_of_the_nearest_step_is_found_and_damaged_ones_are_not() {
        let place = tempfile::tempdir().unwrap();
        fs::write(place.path().join("scene.toml"), "").unwrap();
        let folder = RunFolder::open(place.path()).unwrap();
        assert!(available(&folder).is_empty());
        fs::create_dir(place.path().join(FOLDER)).unwrap();
        let cell = Cell {
            point: 7,
            step: 4,
            dimension: 2,
            vectors: vec![[1.0, 0.0, 0.0], [0.25, 1.0, 0.0]],
            grains: vec![Grain { centre: [0.5, 0.5, 0.0], radius: 0.5, is_rattler: true }],
            contacts: vec![Contact {
                from: [0.5, 0.5, 0.0],
                to: [1.5, 0.5, 0.0],
                compression: 12.0,
                tangential: 3.0,
                is_sliding: true,
            }],
        };
        fs::write(place.path().join(Cell::file(7)), cell.to_json().to_string()).unwrap();
        fs::write(place.path().join(Cell::file(8)), "{\"step\":").unwrap();
        fs::write(place.path().join(FOLDER).join("point-x.json"), "{}").unwrap();
        fs::create_dir(place.path().join("grains")).unwrap();
        fs::write(place.path().join("grains/point-0009-step-0002.vtp"), "<VTKFile").unwrap();
        fs::write(place.path().join("grains/point-0009-step-0003.vtp"), grain_file("radius")).unwrap();
        fs::write(place.path().join("grains/point-0009-step-0004.vtp"), grain_file("size")).unwrap();
        assert_eq!(available(&folder), BTreeMap::from([(7, vec![4]), (9, vec![2, 3, 4])]));
        assert_eq!([0, 4, 9].map(|step| nearest(&[4, 6], step)), [Some(4), Some(4), Some(6)]);
        assert_eq!(nearest(&[], 1), None);
        assert_eq!(read(&folder, 7, 4).unwrap()["contacts"].to_string(), "[[0.5,0.5,1,0,12,3,1]]");
        assert_eq!((read(&folder, 7, 5), read(&folder, 8, 0), read(&folder, 9, 2)), (None, None, None));
        assert_eq!(read(&folder, 9, 3).unwrap()["grains"].to_string(), "[[1,2,0.5,0]]");
        assert_eq!(read(&folder, 9, 4), None, "a grain without a radius is not drawn as a point");
        // A live run replaces the file of a point by that of a later step.
        let later = Cell { step: 11, ..cell };
        fs::write(place.path().join(Cell::file(7)), later.to_json().to_string()).unwrap();
        assert_eq!(available(&folder)[&7], [11]);
        assert!(read(&folder, 7, 4).is_none() && read(&folder, 7, 11).is_some());
    }
}
