//! The mesh of a scene as a picture.

use macro_solver::mesh::Dimension;
use scene_reader::Scene;
use std::fmt::Write;

/// Meshes of more elements are a grey area.
const MOST_ELEMENTS: usize = 20_000;

/// Longer side of the picture, px.
const SIZE: f64 = 600.0;

/// Colours of packings; the first is the packing of the scene itself.
const FILLINGS: [&str; 6] = ["#f2efe6", "#d9e5f2", "#f2d9d0", "#dcecd9", "#e8dcf0", "#f0e8c0"];

/// A plane mesh as SVG text, its elements filled by the first of the packings behind them; `None` for others and for very fine
/// ones.
pub(super) fn mesh(scene: &Scene) -> Option<String> {
    let mesh = &scene.problem.mesh;
    if mesh.dimension != Dimension::Plane || mesh.elements.len() > MOST_ELEMENTS {
        return None;
    }
    let bound = |axis: usize| {
        mesh.nodes
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), node| (low.min(node[axis]), high.max(node[axis])))
    };
    let ((left, right), (bottom, top)) = (bound(0), bound(1));
    let scale = SIZE / (right - left).max(top - bottom);
    let (width, height) = (scale * (right - left), scale * (top - bottom));
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"-4 -4 {:.1} {:.1}\" width=\"{width:.0}\" height=\"{height:.0}\">",
        width + 8.0,
        height + 8.0
    );
    let starts = mesh.first_points();
    for (element, kind) in mesh.kinds.iter().enumerate() {
        let corners = mesh.element_positions(element);
        let points: Vec<String> = corners[..kind.corner_count()]
            .iter()
            .map(|node| format!("{:.1},{:.1}", scale * (node[0] - left), scale * (top - node[1])))
            .collect();
        let filling = FILLINGS[scene.materials.made_of[starts[element]] % FILLINGS.len()];
        let points = points.join(" ");
        write!(text, "<polygon points=\"{points}\" fill=\"{filling}\" stroke=\"#555\" stroke-width=\"0.7\"/>")
            .expect("writing to a String cannot fail");
    }
    text.push_str("</svg>");
    Some(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn every_element_is_drawn_in_the_colour_of_its_packing() {
        let load =
            |file: &str| Scene::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(file), &[]).unwrap();
        let scene = load("biaxial-weak-element.toml");
        let text = mesh(&scene).unwrap();
        assert_eq!(text.matches("<polygon").count(), scene.problem.mesh.elements.len());
        assert!(text.contains(FILLINGS[4]), "the weakened cell of one element");
        assert_eq!(mesh(&load("single-hexahedron-biaxial.toml")), None);
    }
}
