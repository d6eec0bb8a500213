//! Structured meshes of a ring: a quarter, a half or the whole, in space extruded along z.

use super::geotechnical::{Section, lattice, named};
use super::lattice::LatticeMesh;
use super::{ElementKind, Mesh, MeshError};
use std::f64::consts::FRAC_PI_2;

/// How much of a ring there is. All parts begin on the x axis and go counter-clockwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RingPart {
    /// 0 to 90 degrees.
    Quarter,
    /// 0 to 180 degrees.
    Half,
    /// All of it: its two ends are one.
    Whole,
}

impl RingPart {
    /// Quarters that it has.
    fn quarters(self) -> usize {
        match self {
            Self::Quarter => 1,
            Self::Half => 2,
            Self::Whole => 4,
        }
    }
}

/// A ring about the origin. Side sets: `inner`, `outer`, and its ends: `bottom` on the x axis, of a quarter also `left` on the y axis; a
/// whole ring has no ends. Node sets: the same, and `axis_x` and `axis_y`, all nodes on the axes, as far as cells end there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ring {
    /// Inner radius, m.
    pub inner: f64,
    /// From the inner to the outer radius.
    pub across: Section,
    /// Cells along the part that there is, all of one angle.
    pub around: usize,
    /// How much of the ring there is.
    pub part: RingPart,
    /// Along z; not used in the plane.
    pub thickness: Section,
    /// Kind of the elements.
    pub kind: ElementKind,
}

impl Ring {
    /// Generates the mesh; elements are numbered outwards first, then around. Corners and middle nodes lie on circles.
    ///
    /// # Errors
    /// [`MeshError::Ring`] for an impossible hole, or a whole ring of fewer than three cells; [`MeshError::Block`] for impossible sections.
    pub fn mesh(&self) -> Result<Mesh, MeshError> {
        let least = if self.part == RingPart::Whole { 3 } else { 1 };
        if !(self.inner.is_finite() && self.inner > 0.0) || self.around < least {
            return Err(MeshError::Ring { inner: self.inner, around: self.around, least });
        }
        let turn = Section::even(self.part.quarters() as f64, self.around);
        let mut found = lattice(self.kind, [&[self.across], &[turn], &[self.thickness]])?.mesh(|_| true);
        if self.part == RingPart::Whole {
            close(&mut found, 2 * self.around);
        }
        for node in &mut found.mesh.nodes {
            // The lattice has quarters of a turn along y.
            let [radius, quarters] = [self.inner + node[0], node[1]];
            (node[0], node[1]) = polar(radius, quarters);
        }
        let (wide, end) = (2 * self.across.cells, 2 * self.around);
        let is_whole = self.part == RingPart::Whole;
        // Places of the axes: a place is on one where its count of half cells makes whole quarters.
        let quarters = |place: usize| place * self.part.quarters();
        let on = |place: usize, odd: usize| quarters(place).is_multiple_of(end) && (quarters(place) / end) % 2 == odd;
        let is_quarter = self.part == RingPart::Quarter;
        let mut mesh = named(
            &mut found,
            &[
                ("inner", &|p| p[0] == 0),
                ("outer", &|p| p[0] == wide),
                ("bottom", &|p| !is_whole && (p[1] == 0 || (!is_quarter && p[1] == end))),
                ("left", &|p| is_quarter && p[1] == end),
            ],
            self.kind,
            self.thickness,
        );
        for name in ["bottom", "left"] {
            if mesh.node_sets.get(name).is_some_and(Vec::is_empty) {
                mesh.node_sets.remove(name);
                mesh.side_sets.remove(name);
            }
        }
        for (name, odd) in [("axis_x", 0), ("axis_y", 1)] {
            let nodes = found.nodes(|place| on(place[1], odd));
            if !nodes.is_empty() {
                mesh.node_sets.insert(name.to_owned(), nodes);
            }
        }
        Ok(mesh)
    }
}

/// Position of a radius turned by quarters of a turn, exact on the axes.
fn polar(radius: f64, quarters: f64) -> (f64, f64) {
    let whole = quarters.floor();
    let (sine, cosine) = if quarters == whole { (0.0, 1.0) } else { ((quarters - whole) * FRAC_PI_2).sin_cos() };
    let (x, y) = (radius * cosine, radius * sine);
    match whole as usize % 4 {
        0 => (x, y),
        1 => (-y, x),
        2 => (-x, -y),
        _ => (y, -x),
    }
}

/// Makes the nodes at the place `end` around the ring those at its beginning.
fn close(found: &mut LatticeMesh, end: usize) {
    let kept: Vec<usize> = (0..found.places.len()).filter(|&node| found.places[node][1] != end).collect();
    let places: Vec<[usize; 3]> = kept.iter().map(|&node| found.places[node]).collect();
    let new = |node: usize| {
        let [x, y, z] = found.places[node];
        let wanted = [z, y % end, x];
        places.binary_search_by_key(&wanted, |&[x, y, z]| [z, y, x]).expect("the beginning has the nodes of the end")
    };
    let elements: Vec<Vec<usize>> =
        found.mesh.elements.iter().map(|nodes| nodes.iter().map(|&node| new(node)).collect()).collect();
    found.mesh.nodes = kept.iter().map(|&node| found.mesh.nodes[node]).collect();
    (found.mesh.elements, found.places) = (elements, places);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::volume;

    fn ring(part: RingPart, around: usize, kind: ElementKind) -> Ring {
        let across = Section { length: 0.3, cells: 4, grading: 2.0 };
        Ring { inner: 0.1, across, around, part, thickness: Section::even(0.5, 2), kind }
    }

    /// Straight sides: the area between two polygons, `n/2 sin(a/n) (b^2 - a^2)`. Curved ones: that of the ring.
    #[test]
    fn parts_of_a_ring_have_their_area_and_their_sets() {
        for (part, angle) in [(RingPart::Quarter, 1.0), (RingPart::Half, 2.0), (RingPart::Whole, 4.0)] {
            let angle = angle * FRAC_PI_2;
            for (kind, thickness) in [(ElementKind::Q4, 1.0), (ElementKind::T3, 1.0), (ElementKind::H8, 0.5)] {
                let mesh = ring(part, 8, kind).mesh().unwrap();
                mesh.validate().unwrap();
                let polygon = 4.0 * (angle / 8.0).sin() * (0.16 - 0.01);
                assert!((volume(&mesh) / thickness - polygon).abs() < 1e-13, "{part:?} {kind:?}: {}", volume(&mesh));
            }
            let mesh = ring(part, 8, ElementKind::Q8).mesh().unwrap();
            mesh.validate().unwrap();
            let circle = 0.5 * angle * (0.16 - 0.01);
            assert!((volume(&mesh) / circle - 1.0).abs() < 2e-3, "{part:?}: {}", volume(&mesh));
            for (set, radius) in [("inner", 0.1), ("outer", 0.4)] {
                assert_eq!(mesh.side_sets[set].len(), 8, "{part:?} {set}");
                let far = |node: &usize| (mesh.nodes[*node][0].hypot(mesh.nodes[*node][1]) - radius).abs() > 1e-15;
                assert!(!mesh.node_sets[set].iter().any(far), "{part:?} {set}");
            }
            let ends = ["bottom", "left"].map(|set| mesh.side_sets.get(set).map_or(0, Vec::len));
            let expected = match part {
                RingPart::Quarter => [4, 4],
                RingPart::Half => [8, 0],
                RingPart::Whole => [0, 0],
            };
            assert_eq!(ends, expected, "{part:?}");
            for (axis, across, ways) in [("axis_x", 1, [1, 2, 2]), ("axis_y", 0, [1, 1, 2])] {
                let nodes = &mesh.node_sets[axis];
                assert!(nodes.iter().all(|&node| mesh.nodes[node][across] == 0.0), "{axis} is exact");
                assert_eq!(nodes.len(), 9 * ways[part as usize], "{part:?} {axis}");
            }
        }
    }

    #[test]
    fn cells_that_end_beside_an_axis_leave_its_set_out_and_impossible_rings_are_refused() {
        let mesh = ring(RingPart::Whole, 5, ElementKind::Q4).mesh().unwrap();
        mesh.validate().unwrap();
        assert!(mesh.node_sets.contains_key("axis_x") && !mesh.node_sets.contains_key("axis_y"));
        for wrong in [
            Ring { inner: 0.0, ..ring(RingPart::Quarter, 4, ElementKind::Q4) },
            ring(RingPart::Whole, 2, ElementKind::Q4),
            ring(RingPart::Half, 0, ElementKind::Q4),
        ] {
            assert!(matches!(wrong.mesh(), Err(MeshError::Ring { .. })), "{wrong:?}");
        }
    }
}
