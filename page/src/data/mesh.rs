//! The mesh and its Gauss points: what does not change during a run.

use crate::folder::RunFolder;
use crate::numbers::{short, shorts};
use macro_solver::element::shapes_at_points;
use macro_solver::mesh::{Dimension, Mesh};
use scene_reader::Scene;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// `dimension`; `nodes` (three numbers each, m); `outlines`: node numbers around each element, or around each face on the surface of
/// a solid mesh, with `of`: the element of each outline; `points`: of each Gauss point its element and `[node, weight]` pairs of its
/// place; `packing` of each element. An object with `problem` if the scene cannot be read any more.
pub(crate) fn mesh(folder: &RunFolder) -> Value {
    match Scene::load(&folder.path().join("scene.toml"), &[]) {
        Ok(scene) => of_mesh(&scene.problem.mesh, &scene.materials.made_of),
        Err(error) => json!({"problem": format!("the mesh is not shown, as the scene cannot be read: {error}")}),
    }
}

fn of_mesh(mesh: &Mesh, made_of: &[usize]) -> Value {
    let starts = mesh.first_points();
    let (outlines, of): (Vec<Vec<usize>>, Vec<usize>) = match mesh.dimension {
        Dimension::Plane => (0..mesh.elements.len()).map(|element| (plane_outline(mesh, element), element)).unzip(),
        Dimension::Space => surface(mesh).into_iter().unzip(),
    };
    let points = mesh.kinds.iter().enumerate().flat_map(|(element, &kind)| {
        shapes_at_points(kind).iter().map(move |shape| {
            let pairs = mesh.elements[element].iter().zip(shape.values);
            let weights: Value = pairs.map(|(&node, weight)| json!([node, short(weight)])).collect();
            json!([element, weights])
        })
    });
    json!({
        "dimension": mesh.dimension.count(),
        "nodes": shorts(mesh.nodes.iter().flatten().copied()),
        "outlines": outlines,
        "of": of,
        "points": points.collect::<Value>(),
        "packing": (0..mesh.elements.len()).map(|element| made_of.get(starts[element])).collect::<Vec<_>>(),
    })
}

/// Nodes around a plane element, the middles of its edges in their places.
fn plane_outline(mesh: &Mesh, element: usize) -> Vec<usize> {
    let kind = mesh.kinds[element];
    let nodes = &mesh.elements[element];
    let mut outline = Vec::new();
    for side in 0..kind.side_count() {
        // Corners first: begin, end, then the middle.
        let local = kind.side(side);
        outline.push(nodes[local[0]]);
        outline.extend(local.get(2).map(|&middle| nodes[middle]));
    }
    outline
}

/// Corners of the faces that belong to one element only, with the element.
fn surface(mesh: &Mesh) -> Vec<(Vec<usize>, usize)> {
    let mut faces: BTreeMap<Vec<usize>, (Vec<usize>, usize, usize)> = BTreeMap::new();
    for (element, &kind) in mesh.kinds.iter().enumerate() {
        for side in 0..kind.side_count() {
            let local = kind.side(side);
            let corners = if local.len() == 3 || local.len() == 6 { 3 } else { 4 };
            let nodes: Vec<usize> = local[..corners].iter().map(|&place| mesh.elements[element][place]).collect();
            let mut key = nodes.clone();
            key.sort_unstable();
            faces.entry(key).or_insert((nodes, element, 0)).2 += 1;
        }
    }
    faces.into_values().filter(|(_, _, uses)| *uses == 1).map(|(nodes, element, _)| (nodes, element)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn of_scene(name: &str) -> Value {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes").join(name);
        let scene = Scene::load(&path, &[]).unwrap();
        of_mesh(&scene.problem.mesh, &scene.materials.made_of)
    }

    #[test]
    fn outlines_go_around_and_gauss_points_lie_inside() {
        let mesh = of_scene("biaxial-small.toml");
        assert_eq!(mesh["outlines"].as_array().unwrap().len(), 8);
        assert_eq!(mesh["points"].as_array().unwrap().len(), 32);
        let nodes: Vec<f64> = mesh["nodes"].as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect();
        for outline in mesh["outlines"].as_array().unwrap() {
            let places: Vec<[f64; 2]> = outline
                .as_array()
                .unwrap()
                .iter()
                .map(|node| node.as_u64().unwrap() as usize)
                .map(|node| [nodes[3 * node], nodes[3 * node + 1]])
                .collect();
            let next = places.iter().cycle().skip(1);
            let area: f64 = places.iter().zip(next).map(|(a, b)| 0.5 * (a[0] * b[1] - b[0] * a[1])).sum();
            assert!((area - 0.05 * 0.1 / 8.0).abs() < 1e-9, "{area}");
        }
        let sum: f64 = mesh["points"][5][1].as_array().unwrap().iter().map(|pair| pair[1].as_f64().unwrap()).sum();
        assert!((sum - 1.0).abs() < 1e-3);
    }

    #[test]
    fn a_solid_shows_its_surface() {
        let mesh = of_scene("single-hexahedron-biaxial.toml");
        assert_eq!((&mesh["dimension"], mesh["outlines"].as_array().unwrap().len()), (&Value::from(3), 6));
    }
}
