//! Places of Gauss points for people.

use macro_solver::mesh::{Mesh, point_places};

/// The place of a Gauss point for people.
pub(super) fn place_text(mesh: &Mesh, point: usize) -> String {
    let [x, y, z] = point_places(mesh)[point];
    if mesh.dimension.count() == 2 { format!("({x:.4}, {y:.4}) m") } else { format!("({x:.4}, {y:.4}, {z:.4}) m") }
}
