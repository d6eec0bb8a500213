//! A structured rectangle or box of elements with named sides, edges and corners, evenly spaced or graded.

use super::lattice::{Lattice, LatticeMesh};
use super::{Dimension, ElementKind, Mesh, MeshError};

/// A rectangle or box with its lowest corner at the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// Extent along x, y and z, m; z is not used in the plane.
    pub size: [f64; 3],
    /// Cells along x, y and z; triangles and tetrahedra share a cell. z is not used in the plane.
    pub elements: [usize; 3],
    /// Length of the last cell along an axis over that of the first; 1 spaces evenly.
    pub grading: [f64; 3],
    /// Kind of the elements.
    pub kind: ElementKind,
}

/// Words for the lower and upper end of each axis.
const ENDS: [[&str; 2]; 3] = [["left", "right"], ["bottom", "top"], ["back", "front"]];

/// Order of words in names of edges and corners: `bottom_left`, `bottom_left_back`.
const NAMING: [usize; 3] = [1, 0, 2];

impl Block {
    /// An evenly spaced rectangle.
    pub fn plane(size: [f64; 2], elements: [usize; 2], kind: ElementKind) -> Self {
        Self { size: [size[0], size[1], 0.0], elements: [elements[0], elements[1], 0], grading: [1.0; 3], kind }
    }

    /// An evenly spaced box.
    pub fn space(size: [f64; 3], elements: [usize; 3], kind: ElementKind) -> Self {
        Self { size, elements, grading: [1.0; 3], kind }
    }

    /// Generates the mesh. Cells are numbered from the lowest corner, x fastest.
    ///
    /// Side sets: `left` and `right` (x), `bottom` and `top` (y), in space `back` and `front` (z). Node sets: the same,
    /// their edges and corners (`bottom_left`, `left_back`, `bottom_left_back`, ...) and `all`. Element set: `all`.
    ///
    /// # Errors
    /// [`MeshError::Block`] for sizes or gradings that are not positive and finite or counts of zero.
    pub fn mesh(&self) -> Result<Mesh, MeshError> {
        let axes = self.kind.dimension().count();
        let sound = |value: f64| value.is_finite() && value > 0.0;
        if !(0..axes).all(|axis| sound(self.size[axis]) && sound(self.grading[axis]) && self.elements[axis] > 0) {
            return Err(MeshError::Block { size: join(&self.size[..axes]), elements: join(&self.elements[..axes]) });
        }
        let boundaries = std::array::from_fn(|axis| match (self.kind.dimension(), axis) {
            (Dimension::Plane, 2) => Vec::new(),
            _ => graded(0.0, self.size[axis], self.elements[axis], self.grading[axis]),
        });
        let mut lattice = Lattice { kind: self.kind, boundaries }.mesh(|_| true);
        self.name_sets(&mut lattice, axes);
        Ok(lattice.mesh)
    }

    fn name_sets(&self, lattice: &mut LatticeMesh, axes: usize) {
        let bounds: [[usize; 2]; 3] = self.elements.map(|count| [0, 2 * count]);
        for ends in end_choices(axes) {
            let words: Vec<&str> = NAMING.iter().filter_map(|&axis| ends[axis].map(|end| ENDS[axis][end])).collect();
            let on =
                |place: [usize; 3]| (0..3).all(|axis| ends[axis].is_none_or(|end| place[axis] == bounds[axis][end]));
            let name = if words.is_empty() { "all".to_owned() } else { words.join("_") };
            let nodes = lattice.nodes(on);
            if words.len() == 1 {
                let sides = lattice.sides(on);
                lattice.mesh.side_sets.insert(name.clone(), sides);
            }
            lattice.mesh.node_sets.insert(name, nodes);
        }
        let all = (0..lattice.mesh.elements.len()).collect();
        lattice.mesh.element_sets.insert("all".to_owned(), all);
    }
}

/// Every way to choose the lower end, the upper end or neither along each axis.
fn end_choices(axes: usize) -> Vec<[Option<usize>; 3]> {
    let mut choices = vec![[None; 3]];
    for axis in 0..axes {
        for choice in choices.clone() {
            for end in 0..2 {
                let mut next = choice;
                next[axis] = Some(end);
                choices.push(next);
            }
        }
    }
    choices
}

/// Boundaries of `count` cells from `from` over `length`, whose lengths form a geometric series from the first to
/// `ratio` times the first.
pub(super) fn graded(from: f64, length: f64, count: usize, ratio: f64) -> Vec<f64> {
    let cells = count as f64;
    if ratio == 1.0 || count == 1 {
        return (0..=count).map(|cell| from + length * cell as f64 / cells).collect();
    }
    let factor = ratio.powf(1.0 / (cells - 1.0));
    let whole = factor.powf(cells) - 1.0;
    let inner = (0..count).map(|cell| from + length * (factor.powf(cell as f64) - 1.0) / whole);
    // The last boundary is exact, so that blocks meet.
    inner.chain(std::iter::once(from + length)).collect()
}

fn join(values: &[impl ToString]) -> String {
    values.iter().map(ToString::to_string).collect::<Vec<_>>().join(" x ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::element::point_geometry;
    use crate::element::side::side_shapes;
    use nalgebra::Vector3;

    fn block(kind: ElementKind) -> Block {
        match kind.dimension() {
            Dimension::Plane => Block::plane([2.0, 3.0], [2, 3], kind),
            Dimension::Space => Block::space([2.0, 3.0, 1.0], [2, 3, 2], kind),
        }
    }

    #[test]
    fn blocks_of_every_kind_fill_their_volume_and_have_named_sides_that_bound_them() {
        for kind in ElementKind::ALL {
            let mut block = block(kind);
            block.grading = [2.0, 0.5, 3.0];
            let mesh = block.mesh().unwrap();
            mesh.validate().unwrap();
            let volume: f64 = (0..mesh.elements.len())
                .flat_map(|element| (0..kind.point_count()).map(move |local| (element, local)))
                .map(|(element, local)| point_geometry(kind, &mesh.element_positions(element), local).volume)
                .sum();
            assert!((volume - 6.0).abs() < 1e-12, "{kind:?}: {volume}");
            for (axis, ends) in ENDS.iter().enumerate().take(kind.dimension().count()) {
                for (end, name) in ends.iter().enumerate() {
                    let mut area: Vector3<f64> = Vector3::zeros();
                    for &side in &mesh.side_sets[*name] {
                        let nodes = mesh.side_nodes(side);
                        assert!(nodes.iter().all(|node| mesh.node_sets[*name].contains(node)));
                        for shape in side_shapes(kind.side_kind()) {
                            let [first, second] = shape.tangents(nodes.iter().map(|&node| mesh.nodes[node]));
                            area += first.cross(&second) * shape.weight;
                        }
                    }
                    let full: f64 = [3.0, 2.0, 6.0][axis];
                    let mut exact = Vector3::zeros();
                    exact[axis] = if end == 0 { -full } else { full };
                    assert!((area - exact).norm() < 1e-12, "{kind:?} {name}: {area}");
                }
            }
        }
    }

    #[test]
    fn nodes_are_numbered_row_by_row_and_corners_are_named() {
        for (kind, nodes, side) in [(ElementKind::Q4, 12, 4), (ElementKind::Q8, 29, 7), (ElementKind::T6, 35, 7)] {
            let mesh = block(kind).mesh().unwrap();
            assert_eq!(mesh.nodes.len(), nodes);
            assert_eq!(mesh.node_sets["left"].len(), side);
            assert!(mesh.node_sets["top"].iter().all(|&node| mesh.nodes[node][1] == 3.0));
            assert_eq!(mesh.nodes[mesh.node_sets["bottom_right"][0]], [2.0, 0.0, 0.0]);
        }
        let solid = block(ElementKind::H20).mesh().unwrap();
        assert_eq!(solid.nodes[solid.node_sets["top_left_front"][0]], [0.0, 3.0, 1.0]);
        assert_eq!(solid.node_sets["bottom_back"].len(), 5);
        assert_eq!(block(ElementKind::T4).mesh().unwrap().elements.len(), 72);
    }

    #[test]
    fn graded_cells_grow_by_the_ratio() {
        let boundaries = graded(1.0, 7.0, 3, 4.0);
        assert!((boundaries[1] - 2.0).abs() + (boundaries[2] - 4.0).abs() < 1e-14 && boundaries[3] == 8.0);
    }

    #[test]
    fn impossible_blocks_are_refused() {
        let flat = Block::plane([0.0, 1.0], [1, 1], ElementKind::Q4);
        assert!(matches!(flat.mesh(), Err(MeshError::Block { .. })));
        let empty = Block::space([1.0; 3], [1, 1, 0], ElementKind::H8);
        assert_eq!(
            empty.mesh().unwrap_err().to_string(),
            "a block of 1 x 1 x 1 m with 1 x 1 x 0 elements is not possible"
        );
    }
}
