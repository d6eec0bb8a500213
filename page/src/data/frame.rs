//! Fields on the mesh at the steps that were written.

use crate::folder::RunFolder;
use crate::numbers::shorts;
use macro_solver::output::{FieldSeries, step_of_frame};
use serde_json::{Map, Value, json};
use std::path::Path;
use vtkio::model::{Attribute, DataSet, UnstructuredGridPiece, Vtk};

/// Axes of tensors and vectors.
const AXES: [&str; 3] = ["x", "y", "z"];

/// A step whose fields were written.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Frame {
    /// Accepted step.
    pub(crate) step: u64,
    /// Time, s.
    pub(crate) time: f64,
    /// File below the output folder.
    pub(super) file: String,
}

/// The frames that `fields.pvd` lists.
pub(crate) fn frames(folder: &RunFolder) -> Vec<Frame> {
    let text = folder.text("fields.pvd").unwrap_or_default();
    let frame = |(time, file): (f64, String)| Some(Frame { step: step_of_frame(&file)?, time, file });
    FieldSeries::listed(&text).into_iter().filter_map(frame).collect()
}

/// A grid with its data, `None` if the file is missing or not whole.
pub(super) fn grid(path: &Path) -> Option<UnstructuredGridPiece> {
    let DataSet::UnstructuredGrid { pieces, .. } = Vtk::import(path).ok()?.data else { return None };
    pieces.into_iter().next()?.into_loaded_piece_data(None).ok()
}

/// The frame of a step: `displacement` (three numbers a node, m), `fields` (names and units of what can be shown, a number an
/// element), and the `values` of those in `wanted`; without one, of all.
pub(crate) fn frame(folder: &RunFolder, step: u64, wanted: Option<&str>) -> Option<Value> {
    let frame = frames(folder).into_iter().find(|frame| frame.step == step)?;
    let grid = grid(&folder.path().join(&frame.file))?;
    let displacement = grid.data.point.iter().find_map(|attribute| match attribute {
        Attribute::DataArray(array) if array.name == "displacement" => array.data.clone().cast_into::<f64>(),
        _ => None,
    })?;
    let units = folder.json("units.json").unwrap_or_default();
    let is_plane = grid.points.clone().cast_into::<f64>()?.iter().skip(2).step_by(3).all(|height| *height == 0.0);
    let elements = grid.cells.types.len();
    let mut values = Map::new();
    let mut fields = Vec::new();
    for attribute in grid.data.cell {
        let Attribute::DataArray(array) = attribute else { continue };
        let Some(numbers) = array.data.cast_into::<f64>() else { continue };
        let unit = units.get("fields").and_then(|fields| fields.get(&array.name)).cloned().unwrap_or(Value::Null);
        for (name, part) in scalars(&array.name, &numbers, elements, is_plane) {
            fields.push(json!({"name": name, "unit": unit}));
            if wanted.is_none_or(|wanted| wanted == name) {
                values.insert(name, shorts(part));
            }
        }
    }
    Some(json!({
        "step": step,
        "time": frame.time,
        "displacement": shorts(displacement),
        "fields": fields,
        "values": values,
    }))
}

/// A field as numbers, one an element each: components of tensors (the upper ones) and vectors. In a plane body those out of its plane are
/// left out where they are zero everywhere. Others stay, so that every frame has them: cells at rest have no shear and no rotation.
fn scalars(name: &str, numbers: &[f64], elements: usize, is_plane: bool) -> Vec<(String, Vec<f64>)> {
    // Bodies in the plane turn about the axis that they do not extend along.
    let is_axial = name.ends_with("rotation");
    let is_out_of_plane = |axes: &str| is_plane && (axes.contains('z') != is_axial);
    let components = numbers.len().checked_div(elements).unwrap_or(0);
    let part = |place: usize| -> Vec<f64> { numbers.iter().skip(place).step_by(components).copied().collect() };
    let of_places = |places: Vec<(usize, String)>| {
        let parts = places.into_iter().map(|(place, axes)| (part(place), axes));
        let shown = parts.filter(|(values, axes)| !is_out_of_plane(axes) || values.iter().any(|value| *value != 0.0));
        shown.map(|(values, axes)| (format!("{name}_{axes}"), values)).collect()
    };
    match components {
        0 => Vec::new(),
        1 => vec![(name.to_owned(), numbers.to_vec())],
        3 => of_places((0..3).map(|axis| (axis, AXES[axis].to_owned())).collect()),
        9 => {
            let upper = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];
            of_places(
                upper.map(|(row, column)| (3 * row + column, format!("{}{}", AXES[row], AXES[column]))).to_vec(),
            )
        }
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use macro_solver::mesh::ElementKind;
    use macro_solver::output::{Field, FieldGrid, write_grid};
    use std::fs;

    #[test]
    fn a_frame_gives_components_with_units_and_a_damaged_one_nothing() {
        let place = tempfile::tempdir().unwrap();
        fs::write(place.path().join("scene.toml"), "").unwrap();
        fs::create_dir(place.path().join("fields")).unwrap();
        let nodes = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let grid = FieldGrid { nodes: &nodes, elements: &[vec![0, 1, 2]], kinds: &[ElementKind::T3] };
        let stress = protocol_stress();
        let path = place.path().join("fields/step-0004.vtu");
        let on_nodes = [Field::vector("displacement", &[[0.0; 3], [0.5, 0.0, 0.0], [0.0; 3]])];
        write_grid(&path, grid, &on_nodes, &[stress, Field::scalar("p", vec![7.0])]).unwrap();
        let mut series = FieldSeries::new(&place.path().join("fields.pvd"));
        series.add(0.5, "fields/step-0004.vtu".into()).unwrap();
        series.add(0.75, "fields/step-0005.vtu".into()).unwrap();
        fs::write(place.path().join("units.json"), r#"{"fields":{"stress":"Pa"}}"#).unwrap();
        let folder = RunFolder::open(place.path()).unwrap();
        let found = frame(&folder, 4, None).unwrap();
        assert_eq!(found["displacement"].to_string(), "[0,0,0,0.5,0,0,0,0,0]");
        assert_eq!(found["values"].to_string(), r#"{"p":[7],"stress_xx":[-1],"stress_xy":[2],"stress_yy":[-3]}"#);
        assert_eq!(found["fields"][0].to_string(), r#"{"name":"stress_xx","unit":"Pa"}"#);
        assert_eq!(frame(&folder, 4, Some("p")).unwrap()["values"].to_string(), r#"{"p":[7]}"#);
        assert_eq!((frame(&folder, 5, None), frame(&folder, 6, None)), (None, None));
        let whole = fs::read(&path).unwrap();
        for end in [0, 1, whole.len() / 4, whole.len() / 2, whole.len() - 20] {
            fs::write(&path, &whole[..end]).unwrap();
            assert_eq!(frame(&folder, 4, None), None, "the first {end} bytes");
        }
    }

    /// At step 0 a shear stress is zero, and the page lost it as the field that was chosen.
    #[test]
    fn every_frame_has_the_components_that_a_body_may_have() {
        let names = |name: &str, numbers: &[f64], is_plane: bool| -> Vec<String> {
            scalars(name, numbers, 1, is_plane).into_iter().map(|(name, _)| name).collect()
        };
        assert_eq!(names("s", &[0.0; 9], true), ["s_xx", "s_yy", "s_xy"]);
        assert_eq!(names("s", &[0.0; 9], false), ["s_xx", "s_yy", "s_zz", "s_xy", "s_xz", "s_yz"]);
        // Spheres behind a plane mesh.
        let of_spheres = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0];
        assert_eq!(names("s", &of_spheres, true), ["s_xx", "s_yy", "s_zz", "s_xy"]);
        assert_eq!(names("grain_rotation", &[0.0; 3], true), ["grain_rotation_z"]);
        assert_eq!(names("grain_rotation", &[0.0; 3], false).len(), 3);
        assert_eq!(names("u", &[0.0; 3], true), ["u_x", "u_y"]);
    }

    fn protocol_stress() -> Field {
        Field { name: "stress".into(), components: 9, values: vec![-1.0, 2.0, 0.0, 2.0, -3.0, 0.0, 0.0, 0.0, 0.0] }
    }
}
