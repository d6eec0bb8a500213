//! Structured meshes of three problems of soil mechanics: a slope, half a footing, a retaining wall.
//!
//! All stand on a rectangular lattice whose axes are cut into sections, so that loaded parts of the boundary end at
//! nodes. x is horizontal, y vertical; in space the section is extruded along z.

use super::block::graded;
use super::lattice::{Lattice, LatticeMesh};
use super::{Dimension, ElementKind, Mesh, MeshError};
use std::collections::BTreeSet;

/// A named part of the boundary and the places that belong to it.
pub(super) type Part<'a> = (&'a str, &'a dyn Fn([usize; 3]) -> bool);

/// A part of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Length, m.
    pub length: f64,
    /// Cells.
    pub cells: usize,
    /// Length of the last cell over that of the first.
    pub grading: f64,
}

impl Section {
    /// Evenly spaced.
    pub fn even(length: f64, cells: usize) -> Self {
        Self { length, cells, grading: 1.0 }
    }
}

/// A slope above level ground: a block `[0, body + toe] x [0, base]` under a block whose right side leans back by
/// `run` over the height of the slope. Side sets: `left`, `right`, `bottom`, `crest`, `face`, `ground`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slope {
    /// Ground under crest and face, along x.
    pub body: Section,
    /// Level ground before the toe, along x.
    pub toe: Section,
    /// Ground below the toe, along y.
    pub base: Section,
    /// Height of the slope, along y.
    pub rise: Section,
    /// Horizontal extent of the face, m, less than the body's length.
    pub run: f64,
    /// Along z; not used in the plane.
    pub thickness: Section,
    /// Kind of the elements.
    pub kind: ElementKind,
}

/// The right half of a strip footing on a rectangle of ground. Side sets: `left` (the axis of symmetry), `right`,
/// `bottom`, `top`, and the two parts of the top, `footing` and `surface`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfFooting {
    /// Under the footing, along x.
    pub footing: Section,
    /// Beside it, along x.
    pub beside: Section,
    /// Over the depth, along y from the bottom.
    pub depth: Section,
    /// Along z; not used in the plane.
    pub thickness: Section,
    /// Kind of the elements.
    pub kind: ElementKind,
}

/// Ground behind a wall that ends above the bottom. Side sets: `left` and its two parts, `wall` and `below`, `right`,
/// `bottom`, `top`. Of the nodes, those at the foot of the wall belong to `wall` alone, so that it can move past what is
/// held below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RetainingWall {
    /// Along x from the wall.
    pub width: Section,
    /// Below the foot of the wall, along y.
    pub below: Section,
    /// Height of the wall, along y.
    pub wall: Section,
    /// Along z; not used in the plane.
    pub thickness: Section,
    /// Kind of the elements.
    pub kind: ElementKind,
}

impl Slope {
    /// Generates the mesh.
    ///
    /// # Errors
    /// [`MeshError::Block`] for impossible sections or a face that is wider than the body.
    pub fn mesh(&self) -> Result<Mesh, MeshError> {
        let (x, y) = ([self.body, self.toe], [self.base, self.rise]);
        if !(self.run >= 0.0 && self.run < self.body.length) {
            let size = format!("{} m of face over {}", self.run, self.body.length);
            return Err(MeshError::Block { size, elements: "any".into() });
        }
        let lattice = lattice(self.kind, [&x, &y, &[self.thickness]])?;
        let ([right, wide], [low, high]) = (ends(&x), ends(&y));
        let mut found = lattice.mesh(|[column, row, _]| 2 * column < right || 2 * row < low);
        for (node, place) in found.mesh.nodes.iter_mut().zip(&found.places) {
            if place[1] > low {
                let share = (node[1] - self.base.length) / self.rise.length;
                node[0] *= 1.0 - share * self.run / self.body.length;
            }
        }
        let parts: [Part<'_>; 6] = [
            ("left", &|p| p[0] == 0),
            ("right", &|p| p[0] == wide),
            ("bottom", &|p| p[1] == 0),
            ("crest", &|p| p[1] == high),
            ("face", &|p| p[0] == right && p[1] >= low),
            ("ground", &|p| p[1] == low && p[0] >= right),
        ];
        Ok(named(&mut found, &parts, self.kind, self.thickness))
    }
}

impl HalfFooting {
    /// Generates the mesh.
    ///
    /// # Errors
    /// [`MeshError::Block`] for impossible sections.
    pub fn mesh(&self) -> Result<Mesh, MeshError> {
        let x = [self.footing, self.beside];
        let mut found = lattice(self.kind, [&x, &[self.depth], &[self.thickness]])?.mesh(|_| true);
        let ([edge, wide], high) = (ends(&x), 2 * self.depth.cells);
        let parts: [Part<'_>; 6] = [
            ("left", &|p| p[0] == 0),
            ("right", &|p| p[0] == wide),
            ("bottom", &|p| p[1] == 0),
            ("top", &|p| p[1] == high),
            ("footing", &|p| p[1] == high && p[0] <= edge),
            ("surface", &|p| p[1] == high && p[0] >= edge),
        ];
        Ok(named(&mut found, &parts, self.kind, self.thickness))
    }
}

impl RetainingWall {
    /// Generates the mesh.
    ///
    /// # Errors
    /// [`MeshError::Block`] for impossible sections.
    pub fn mesh(&self) -> Result<Mesh, MeshError> {
        let y = [self.below, self.wall];
        let mut found = lattice(self.kind, [&[self.width], &y, &[self.thickness]])?.mesh(|_| true);
        let ([foot, high], wide) = (ends(&y), 2 * self.width.cells);
        let parts: [Part<'_>; 6] = [
            ("left", &|p| p[0] == 0),
            ("right", &|p| p[0] == wide),
            ("bottom", &|p| p[1] == 0),
            ("top", &|p| p[1] == high),
            ("wall", &|p| p[0] == 0 && p[1] >= foot),
            ("below", &|p| p[0] == 0 && p[1] <= foot),
        ];
        let mut mesh = named(&mut found, &parts, self.kind, self.thickness);
        // The foot of the wall moves with it; the ground below is held without it. Sides meet there all the same.
        let of_wall: BTreeSet<usize> = mesh.node_sets["wall"].iter().copied().collect();
        mesh.node_sets.entry("below".to_owned()).and_modify(|below| below.retain(|node| !of_wall.contains(node)));
        Ok(mesh)
    }
}

/// Places at which two sections end, half cells.
fn ends(sections: &[Section; 2]) -> [usize; 2] {
    [2 * sections[0].cells, 2 * (sections[0].cells + sections[1].cells)]
}

pub(super) fn lattice(kind: ElementKind, axes: [&[Section]; 3]) -> Result<Lattice, MeshError> {
    let used = &axes[..kind.dimension().count()];
    let sound = |value: f64| value.is_finite() && value > 0.0;
    let possible = |section: &Section| sound(section.length) && sound(section.grading) && section.cells > 0;
    if let Some(section) = used.iter().flat_map(|sections| sections.iter()).find(|section| !possible(section)) {
        return Err(MeshError::Block { size: section.length.to_string(), elements: section.cells.to_string() });
    }
    let boundaries = std::array::from_fn(|axis| {
        let mut boundaries = Vec::new();
        for section in used.get(axis).copied().unwrap_or_default() {
            let from = boundaries.pop().unwrap_or(0.0);
            boundaries.extend(graded(from, section.length, section.cells, section.grading));
        }
        boundaries
    });
    Ok(Lattice { kind, boundaries })
}

/// Names sides and their nodes, the ends along z and the whole.
pub(super) fn named(found: &mut LatticeMesh, parts: &[Part<'_>], kind: ElementKind, thickness: Section) -> Mesh {
    let deep = 2 * thickness.cells;
    let along_z: [Part<'_>; 2] = [("back", &|p| p[2] == 0), ("front", &|p| p[2] == deep)];
    let more = if kind.dimension() == Dimension::Space { &along_z[..] } else { &[] };
    for (name, on) in parts.iter().chain(more) {
        let (nodes, sides) = (found.nodes(on), found.sides(on));
        found.mesh.node_sets.insert((*name).to_owned(), nodes);
        found.mesh.side_sets.insert((*name).to_owned(), sides);
    }
    found.mesh.node_sets.insert("all".to_owned(), (0..found.mesh.nodes.len()).collect());
    found.mesh.element_sets.insert("all".to_owned(), (0..found.mesh.elements.len()).collect());
    found.mesh.clone()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::volume;

    fn thin() -> Section {
        Section::even(0.5, 1)
    }

    #[test]
    fn a_slope_has_its_area_and_its_face_leans() {
        for (kind, thickness) in [(ElementKind::Q8, 1.0), (ElementKind::T3, 1.0), (ElementKind::H8, 0.5)] {
            let slope = Slope {
                body: Section::even(8.0, 6),
                toe: Section::even(4.0, 3),
                base: Section::even(3.0, 2),
                rise: Section { length: 5.0, cells: 4, grading: 1.5 },
                run: 5.0,
                thickness: thin(),
                kind,
            };
            let mesh = slope.mesh().unwrap();
            mesh.validate().unwrap();
            let area = 12.0 * 3.0 + 0.5 * (8.0 + 3.0) * 5.0;
            assert!((volume(&mesh) / thickness - area).abs() < 1e-10, "{kind:?}: {}", volume(&mesh));
            for &node in &mesh.node_sets["face"] {
                let [x, y, _] = mesh.nodes[node];
                assert!((x + y - 11.0).abs() < 1e-12, "{x} {y}");
            }
            assert!(mesh.node_sets["crest"].iter().all(|&node| mesh.nodes[node][0] < 3.0 + 1e-12));
            assert!(
                ["left", "right", "bottom", "crest", "face", "ground"].iter().all(|s| !mesh.side_sets[*s].is_empty())
            );
            assert!(Slope { run: 9.0, ..slope }.mesh().is_err());
        }
    }

    #[test]
    fn footing_and_wall_end_at_nodes() {
        let footing = HalfFooting {
            footing: Section::even(1.0, 4),
            beside: Section { length: 9.0, cells: 6, grading: 4.0 },
            depth: Section { length: 6.0, cells: 5, grading: 0.25 },
            thickness: thin(),
            kind: ElementKind::Q8,
        };
        let mesh = footing.mesh().unwrap();
        mesh.validate().unwrap();
        assert!((volume(&mesh) - 60.0).abs() < 1e-10);
        assert_eq!((mesh.side_sets["footing"].len(), mesh.side_sets["surface"].len()), (4, 6));
        assert!(mesh.node_sets["footing"].iter().all(|&node| mesh.nodes[node][0] <= 1.0));
        let wall = RetainingWall {
            width: Section { length: 10.0, cells: 5, grading: 3.0 },
            below: Section::even(2.0, 2),
            wall: Section::even(4.0, 4),
            thickness: thin(),
            kind: ElementKind::H20,
        };
        let mesh = wall.mesh().unwrap();
        mesh.validate().unwrap();
        assert!((volume(&mesh) - 30.0).abs() < 1e-10);
        assert_eq!(
            (mesh.side_sets["wall"].len(), mesh.side_sets["below"].len(), mesh.side_sets["left"].len()),
            (4, 2, 6)
        );
        let [above, below, left] = ["wall", "below", "left"].map(|set| &mesh.node_sets[set]);
        assert!(below.iter().all(|node| !above.contains(node)), "the foot moves with the wall");
        assert_eq!(above.len() + below.len(), left.len());
        assert!(
            above.iter().any(|&node| mesh.nodes[node][1] == 2.0)
                && below.iter().any(|&node| mesh.nodes[node][1] == 0.0)
        );
        assert!(RetainingWall { wall: Section::even(4.0, 0), ..wall }.mesh().is_err());
    }
}
