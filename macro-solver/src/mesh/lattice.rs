//! Cells on a rectangular lattice, cut into elements: what all structured generators share.
//!
//! Places are counted in half cells, so that every corner and every middle node of every element kind has one.

use super::{Dimension, ElementKind, Mesh, Side};

/// A lattice with the boundaries of its cells along every axis; the plane has no boundaries along z.
pub(super) struct Lattice {
    /// Kind of all elements.
    pub(super) kind: ElementKind,
    /// Cell boundaries, ascending, m.
    pub(super) boundaries: [Vec<f64>; 3],
}

/// A mesh and where its nodes lie on the lattice.
pub(super) struct LatticeMesh {
    /// Without sets.
    pub(super) mesh: Mesh,
    /// Place of every node, half cells.
    pub(super) places: Vec<[usize; 3]>,
}

impl Lattice {
    /// Cells along an axis; a plane lattice has one layer.
    fn cells(&self, axis: usize) -> usize {
        self.boundaries[axis].len().saturating_sub(1).max(1)
    }

    /// Elements of all cells that `keep` wants, cell by cell (x fastest, then y, then z); nodes in the same order.
    pub(super) fn mesh(&self, keep: impl Fn([usize; 3]) -> bool) -> LatticeMesh {
        let mut element_places = Vec::new();
        for layer in 0..self.cells(2) {
            for row in 0..self.cells(1) {
                for column in 0..self.cells(0) {
                    if keep([column, row, layer]) {
                        element_places.extend(self.elements_of([column, row, layer]));
                    }
                }
            }
        }
        // Sorted by layer, row, column.
        let mut places: Vec<[usize; 3]> = element_places.iter().flatten().copied().collect();
        places.sort_unstable_by_key(|&[x, y, z]| [z, y, x]);
        places.dedup();
        let number = |&[x, y, z]: &[usize; 3]| {
            places.binary_search_by_key(&[z, y, x], |&[x, y, z]| [z, y, x]).expect("every place was collected")
        };
        let elements = element_places.iter().map(|nodes| nodes.iter().map(number).collect()).collect();
        let nodes = places.iter().map(|place| self.position(*place)).collect();
        LatticeMesh { mesh: Mesh::uniform(self.kind, nodes, elements), places }
    }

    /// Position of a place, m.
    fn position(&self, place: [usize; 3]) -> [f64; 3] {
        std::array::from_fn(|axis| {
            let boundaries = &self.boundaries[axis];
            let (cell, half) = (place[axis] / 2, place[axis] % 2);
            match boundaries.get(cell) {
                None => 0.0,
                Some(&from) if half == 0 => from,
                Some(&from) => 0.5 * (from + boundaries[cell + 1]),
            }
        })
    }

    /// Places of the nodes of all elements in a cell.
    fn elements_of(&self, cell: [usize; 3]) -> Vec<Vec<[usize; 3]>> {
        let corners = cell_corners(self.kind, cell);
        corners
            .into_iter()
            .map(|corners| {
                let mut places: Vec<[usize; 3]> =
                    corners.iter().map(|corner| std::array::from_fn(|i| 2 * (cell[i] + corner[i]))).collect();
                for [from, to] in self.kind.middles() {
                    places.push(std::array::from_fn(|i| (places[*from][i] + places[*to][i]) / 2));
                }
                places
            })
            .collect()
    }
}

impl LatticeMesh {
    /// Nodes whose places satisfy a condition, ascending.
    pub(super) fn nodes(&self, keep: impl Fn([usize; 3]) -> bool) -> Vec<usize> {
        (0..self.places.len()).filter(|&node| keep(self.places[node])).collect()
    }

    /// Sides all of whose nodes satisfy a condition, ascending.
    pub(super) fn sides(&self, keep: impl Fn([usize; 3]) -> bool) -> Vec<Side> {
        let mesh = &self.mesh;
        let all = (0..mesh.elements.len())
            .flat_map(|element| (0..mesh.kinds[element].side_count()).map(move |local| Side { element, local }));
        all.filter(|&side| mesh.side_nodes(side).iter().all(|&node| keep(self.places[node]))).collect()
    }
}

const SQUARE: [[usize; 3]; 4] = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]];
const CUBE: [[usize; 3]; 8] =
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];

/// Corners of the elements of a cell, in whole cells from its lowest corner. Triangles alternate their diagonals;
/// tetrahedra are Kuhn's six, whose face diagonals fit those of the neighbouring cells.
fn cell_corners(kind: ElementKind, cell: [usize; 3]) -> Vec<Vec<[usize; 3]>> {
    let pick = |locals: &[usize]| locals.iter().map(|&local| SQUARE[local]).collect::<Vec<_>>();
    match (kind.dimension(), kind.corner_count()) {
        (Dimension::Plane, 3) if (cell[0] + cell[1]).is_multiple_of(2) => vec![pick(&[0, 1, 2]), pick(&[0, 2, 3])],
        (Dimension::Plane, 3) => vec![pick(&[0, 1, 3]), pick(&[1, 2, 3])],
        (Dimension::Plane, _) => vec![SQUARE.to_vec()],
        (Dimension::Space, 4) => kuhn_tetrahedra(),
        (Dimension::Space, _) => vec![CUBE.to_vec()],
    }
}

/// One tetrahedron per order of the axes: from the lowest corner along the first, the second, the third axis.
fn kuhn_tetrahedra() -> Vec<Vec<[usize; 3]>> {
    let even = [[0, 1, 2], [1, 2, 0], [2, 0, 1]];
    let odd = [[0, 2, 1], [1, 0, 2], [2, 1, 0]];
    let path = |order: &[usize; 3]| {
        let mut corners = vec![[0; 3]];
        for &axis in order {
            let mut corner = corners[corners.len() - 1];
            corner[axis] = 1;
            corners.push(corner);
        }
        corners
    };
    let turned = odd.iter().map(|order| {
        let mut corners = path(order);
        corners.swap(1, 2);
        corners
    });
    even.iter().map(path).chain(turned).collect()
}
