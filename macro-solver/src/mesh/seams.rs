//! Where elements lie next to each other without being joined: meshes that were put together of parts.
//!
//! A side that belongs to one element should be part of the boundary of the body. It is not if nodes lie at the place of others or on a side
//! that does not have them (hanging nodes), or if triangles cover a quadrilateral: the mesh does not conform there. Nor may a side belong to
//! three elements.

use super::{Mesh, Side};
use std::collections::{BTreeMap, BTreeSet};

/// Distance over the extent of the mesh up to which places are the same.
const SAME_PLACE: f64 = 1e-7;

/// Distance from a side over its length up to which a node lies on it.
const ON_SIDE: f64 = 1e-4;

/// What is not joined.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum SeamKind {
    /// Nodes of different elements at the same place.
    CoincidentNodes,
    /// A node on a side that does not have it.
    HangingNode,
    /// A quadrilateral that is covered by triangles: their displacements differ inside it.
    QuadrilateralOnTriangles,
    /// A side of three elements or more: they lie upon each other.
    SideOfMany,
}

/// All places of one kind where a mesh is not joined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seam {
    /// What is wrong.
    pub kind: SeamKind,
    /// How often it is found.
    pub count: usize,
    /// Two nodes of the first case: those at the same place, the hanging one and one of the side, or two corners of the side.
    pub nodes: [usize; 2],
    /// Place of the first of them, m.
    pub place: [f64; 3],
}

impl Mesh {
    /// Where elements lie next to each other without being joined, one entry for each kind. A valid mesh may have such places, if links
    /// join them.
    pub fn seams(&self) -> Vec<Seam> {
        let mut owners: BTreeMap<Vec<usize>, Vec<Side>> = BTreeMap::new();
        for (element, kind) in self.kinds.iter().enumerate() {
            for local in 0..kind.side_count() {
                let side = Side { element, local };
                let mut nodes = self.side_nodes(side);
                nodes.sort_unstable();
                owners.entry(nodes).or_default().push(side);
            }
        }
        let boundary: Vec<Side> = owners.values().filter(|sides| sides.len() == 1).map(|sides| sides[0]).collect();
        let many = owners.iter().filter(|(_, sides)| sides.len() > 2).map(|(nodes, _)| [nodes[0], nodes[1]]);
        let found = [
            (SeamKind::CoincidentNodes, self.coincident_nodes(&boundary)),
            (SeamKind::HangingNode, self.hanging_nodes(&boundary)),
            (SeamKind::QuadrilateralOnTriangles, self.covered_quadrilaterals(&boundary)),
            (SeamKind::SideOfMany, many.collect()),
        ];
        let seam = |(kind, cases): (SeamKind, Vec<[usize; 2]>)| {
            let nodes = *cases.first()?;
            Some(Seam { kind, count: cases.len(), nodes, place: self.nodes[nodes[0]] })
        };
        found.into_iter().filter_map(seam).collect()
    }

    /// Largest extent along an axis, m.
    fn extent(&self) -> f64 {
        let along = |axis: usize| {
            let places = self.nodes.iter().map(|node| node[axis]);
            let (low, high) =
                places.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
            high - low
        };
        (0..3).map(along).fold(0.0, f64::max)
    }

    fn nodes_of(&self, sides: &[Side]) -> BTreeSet<usize> {
        sides.iter().flat_map(|side| self.side_nodes(*side)).collect()
    }

    fn corners(&self, side: Side) -> Vec<usize> {
        let mut nodes = self.side_nodes(side);
        nodes.truncate(self.kinds[side.element].side_kind().corner_count());
        nodes
    }

    fn coincident_nodes(&self, boundary: &[Side]) -> Vec<[usize; 2]> {
        let nodes = self.nodes_of(boundary);
        let tolerance = SAME_PLACE * self.extent();
        let grid = Grid::of(nodes.iter().copied(), &self.nodes, 2.0 * tolerance);
        let near = |node: usize| {
            let place = self.nodes[node];
            let others = grid.within(place.map(|x| x - tolerance), place.map(|x| x + tolerance));
            others.into_iter().filter(move |other| *other > node).map(move |other| [node, other])
        };
        let pairs = nodes.iter().flat_map(|node| near(*node));
        pairs.filter(|[node, other]| distance(&self.nodes[*node], &self.nodes[*other]) <= tolerance).collect()
    }

    fn hanging_nodes(&self, boundary: &[Side]) -> Vec<[usize; 2]> {
        let nodes = self.nodes_of(boundary);
        let same = SAME_PLACE * self.extent();
        let lengths = boundary.iter().map(|side| self.length(*side));
        let usual = lengths.sum::<f64>() / boundary.len().max(1) as f64;
        let grid = Grid::of(nodes.iter().copied(), &self.nodes, usual);
        let mut found = BTreeMap::new();
        for side in boundary {
            let own = self.side_nodes(*side);
            let corners: Vec<[f64; 3]> = self.corners(*side).iter().map(|&node| self.nodes[node]).collect();
            let margin = ON_SIDE * self.length(*side);
            let bound = |axis: usize, sign: f64| {
                sign * corners.iter().map(|corner| sign * corner[axis]).fold(f64::NEG_INFINITY, f64::max)
                    + sign * margin
            };
            let (low, high) =
                (std::array::from_fn(|axis| bound(axis, -1.0)), std::array::from_fn(|axis| bound(axis, 1.0)));
            for node in grid.within(low, high) {
                let place = &self.nodes[node];
                let at_own = own.iter().any(|&other| other == node || distance(place, &self.nodes[other]) <= same);
                if !at_own && is_on(place, &corners, margin) {
                    found.entry(node).or_insert(own[0]);
                }
            }
        }
        found.into_iter().map(|(node, other)| [node, other]).collect()
    }

    /// Length of the longest edge of a side, m.
    fn length(&self, side: Side) -> f64 {
        let corners = self.corners(side);
        let next = corners.iter().cycle().skip(1);
        corners.iter().zip(next).map(|(a, b)| distance(&self.nodes[*a], &self.nodes[*b])).fold(0.0, f64::max)
    }

    fn covered_quadrilaterals(&self, boundary: &[Side]) -> Vec<[usize; 2]> {
        let sorted = |side: &Side| {
            let mut corners = self.corners(*side);
            corners.sort_unstable();
            corners
        };
        let corners: Vec<Vec<usize>> = boundary.iter().map(sorted).collect();
        let triangles: BTreeSet<&[usize]> =
            corners.iter().filter(|side| side.len() == 3).map(Vec::as_slice).collect();
        let is_covered = |side: &&Vec<usize>| {
            let without = |left_out: usize| {
                let rest = side.iter().enumerate().filter(|(place, _)| *place != left_out);
                rest.map(|(_, node)| *node).collect::<Vec<usize>>()
            };
            side.len() == 4 && (0..4).any(|left_out| triangles.contains(without(left_out).as_slice()))
        };
        corners.iter().filter(is_covered).map(|side| [side[0], side[1]]).collect()
    }
}

/// Nodes by the cube of a lattice that they lie in.
struct Grid<'a> {
    places: &'a [[f64; 3]],
    width: f64,
    cubes: BTreeMap<[i64; 3], Vec<usize>>,
}

impl<'a> Grid<'a> {
    fn of(nodes: impl Iterator<Item = usize>, places: &'a [[f64; 3]], width: f64) -> Self {
        let width = if width > 0.0 { width } else { 1.0 };
        let mut cubes: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
        nodes.for_each(|node| cubes.entry(cube(&places[node], width)).or_default().push(node));
        Self { places, width, cubes }
    }

    /// The nodes in a box, ascending.
    fn within(&self, low: [f64; 3], high: [f64; 3]) -> Vec<usize> {
        let (first, last) = (cube(&low, self.width), cube(&high, self.width));
        let mut found = Vec::new();
        for x in first[0]..=last[0] {
            for y in first[1]..=last[1] {
                let row = self.cubes.range([x, y, first[2]]..=[x, y, last[2]]);
                let nodes = row.flat_map(|(_, nodes)| nodes).copied();
                found.extend(nodes.filter(|&node| {
                    let place = &self.places[node];
                    (0..3).all(|axis| (low[axis]..=high[axis]).contains(&place[axis]))
                }));
            }
        }
        found.sort_unstable();
        found
    }
}

fn cube(place: &[f64; 3], width: f64) -> [i64; 3] {
    place.map(|x| (x / width).floor() as i64)
}

fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    norm(difference(a, b))
}

fn difference(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

fn norm(vector: [f64; 3]) -> f64 {
    dot(&vector, &vector).sqrt()
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (0..3).map(|axis| a[axis] * b[axis]).sum()
}

/// Whether a place lies on an edge, or on one of the triangles between the first corner of a face and its edges.
fn is_on(place: &[f64; 3], corners: &[[f64; 3]], margin: f64) -> bool {
    match corners {
        [a, b] => {
            let (edge, from) = (difference(b, a), difference(place, a));
            let along = dot(&from, &edge) / dot(&edge, &edge);
            (0.0..=1.0).contains(&along) && norm(std::array::from_fn(|i| from[i] - along * edge[i])) <= margin
        }
        [a, rest @ ..] => rest.windows(2).any(|pair| is_on_triangle(place, [a, &pair[0], &pair[1]], margin)),
        [] => false,
    }
}

fn is_on_triangle(place: &[f64; 3], [a, b, c]: [&[f64; 3]; 3], margin: f64) -> bool {
    let (first, second, from) = (difference(b, a), difference(c, a), difference(place, a));
    let (ff, fs, ss) = (dot(&first, &first), dot(&first, &second), dot(&second, &second));
    let (pf, ps) = (dot(&from, &first), dot(&from, &second));
    let determinant = ff * ss - fs * fs;
    if determinant <= 0.0 {
        return false;
    }
    let (u, v) = ((ss * pf - fs * ps) / determinant, (ff * ps - fs * pf) / determinant);
    let slack = margin / ff.max(ss).sqrt();
    let off = std::array::from_fn(|i| from[i] - u * first[i] - v * second[i]);
    u >= -slack && v >= -slack && u + v <= 1.0 + slack && norm(off) <= margin
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::ElementKind;
    use crate::mesh::block::Block;

    fn kinds(mesh: &Mesh) -> Vec<(SeamKind, usize)> {
        mesh.seams().iter().map(|seam| (seam.kind, seam.count)).collect()
    }

    #[test]
    fn generated_blocks_of_all_kinds_are_joined() {
        for kind in ElementKind::ALL {
            let mesh = match kind.dimension().count() {
                2 => Block::plane([2.0, 3.0], [2, 3], kind).mesh().unwrap(),
                _ => Block::space([2.0, 3.0, 1.0], [2, 3, 2], kind).mesh().unwrap(),
            };
            assert_eq!(mesh.seams(), [], "{kind:?}");
        }
    }

    /// Two blocks beside each other, each with its own nodes on the boundary between them, `fine` times as many in the second.
    fn two_blocks(kind: ElementKind, fine: usize) -> Mesh {
        let (first, second) =
            (Block::plane([1.0, 1.0], [1, 1], kind).mesh(), Block::plane([1.0, 1.0], [1, fine], kind).mesh());
        let (mut mesh, other) = (first.unwrap(), second.unwrap());
        let before = mesh.nodes.len();
        mesh.nodes.extend(other.nodes.iter().map(|[x, y, z]| [x + 1.0, *y, *z]));
        mesh.elements.extend(other.elements.iter().map(|nodes| nodes.iter().map(|node| node + before).collect()));
        mesh.kinds.extend(other.kinds);
        mesh
    }

    #[test]
    fn parts_that_are_not_joined_are_found() {
        let parts = two_blocks(ElementKind::Q4, 1);
        assert_eq!(kinds(&parts), [(SeamKind::CoincidentNodes, 2)]);
        assert_eq!(parts.seams()[0].place[0], 1.0);
        let finer = two_blocks(ElementKind::Q4, 3);
        assert_eq!(kinds(&finer), [(SeamKind::CoincidentNodes, 2), (SeamKind::HangingNode, 2)]);
        // The same with the corners of the boundary in common: only the nodes between them hang.
        let mut hanging = finer.clone();
        for [keep, drop] in finer.coincident_nodes(&all_sides(&finer)) {
            hanging.elements.iter_mut().flatten().filter(|node| **node == drop).for_each(|node| *node = keep);
        }
        assert_eq!(kinds(&hanging), [(SeamKind::HangingNode, 2)]);
    }

    #[test]
    fn faces_that_do_not_match_are_found() {
        let mut mesh = Block::space([1.0, 1.0, 1.0], [1, 1, 1], ElementKind::H8).mesh().unwrap();
        let top: Vec<usize> = (0..8).filter(|&node| mesh.nodes[node][2] == 1.0).collect();
        mesh.nodes.push([0.5, 0.5, 2.0]);
        mesh.elements.push(vec![top[0], top[1], top[2], 8]);
        mesh.kinds.push(ElementKind::T4);
        assert!(kinds(&mesh).contains(&(SeamKind::QuadrilateralOnTriangles, 1)), "{:?}", mesh.seams());
        let mut upon = Block::plane([1.0, 2.0], [1, 2], ElementKind::Q4).mesh().unwrap();
        let shared = upon.elements[0].clone();
        upon.nodes.push([0.5, 0.5, 0.0]);
        upon.elements.push(vec![shared[2], shared[3], upon.nodes.len() - 1]);
        upon.kinds.push(ElementKind::T3);
        assert!(kinds(&upon).contains(&(SeamKind::SideOfMany, 1)), "{:?}", upon.seams());
    }

    fn all_sides(mesh: &Mesh) -> Vec<Side> {
        let of_element =
            |element: usize| (0..mesh.kinds[element].side_count()).map(move |local| Side { element, local });
        (0..mesh.elements.len()).flat_map(of_element).collect()
    }
}
