//! Everything that can be wrong with a mesh, found before the first evaluation.

use super::{Dimension, Mesh, MeshError};
use crate::element::{geometry_of_shape, node_places, point_geometry, shape};
use std::collections::BTreeMap;

/// Largest negative determinant at a corner, relative to the largest one of the element, that passes as slight; the
/// irregular patch of hexahedra of MacNeal and Harder has 0.03.
const SLIGHT_FOLD: f64 = 0.1;

impl Mesh {
    /// Checks numbers, references and the mapping of every element.
    ///
    /// # Errors
    /// The first defect, in the order of [`MeshError`]'s variants.
    pub fn validate(&self) -> Result<(), MeshError> {
        if self.elements.is_empty() {
            return Err(MeshError::Empty);
        }
        if self.kinds.len() != self.elements.len() {
            return Err(MeshError::KindCount { elements: self.elements.len(), kinds: self.kinds.len() });
        }
        self.check_references()?;
        self.check_repetitions()?;
        self.check_sets()?;
        self.check_positions()?;
        self.check_mapping()?;
        self.check_loose_nodes()
    }

    fn check_references(&self) -> Result<(), MeshError> {
        for (element, (nodes, &kind)) in self.elements.iter().zip(&self.kinds).enumerate() {
            if kind.dimension() != self.dimension {
                return Err(MeshError::MixedDimensions { element, kind, dimension: self.dimension.count() });
            }
            if nodes.len() != kind.node_count() {
                return Err(MeshError::NodeCount { element, found: nodes.len(), expected: kind.node_count(), kind });
            }
            self.check_nodes(nodes, || format!("element {element}"))?;
        }
        Ok(())
    }

    fn check_repetitions(&self) -> Result<(), MeshError> {
        let mut known: BTreeMap<Vec<usize>, usize> = BTreeMap::new();
        for (second, nodes) in self.elements.iter().enumerate() {
            let mut nodes = nodes.clone();
            nodes.sort_unstable();
            if let Some(first) = known.insert(nodes, second) {
                return Err(MeshError::SameNodes { first, second });
            }
        }
        Ok(())
    }

    fn check_nodes(&self, nodes: &[usize], entity: impl Fn() -> String) -> Result<(), MeshError> {
        match nodes.iter().find(|&&node| node >= self.nodes.len()) {
            Some(&node) => {
                Err(MeshError::NoSuchNode { entity: entity(), node, last: self.nodes.len().saturating_sub(1) })
            }
            None => Ok(()),
        }
    }

    fn check_sets(&self) -> Result<(), MeshError> {
        for (name, nodes) in &self.node_sets {
            self.check_nodes(nodes, || format!("node set '{name}'"))?;
        }
        for (name, sides) in &self.side_sets {
            let exists =
                |element: usize, local| self.kinds.get(element).is_some_and(|kind| local < kind.side_count());
            if let Some(side) = sides.iter().find(|side| !exists(side.element, side.local)) {
                return Err(MeshError::NoSuchSide { set: name.clone(), element: side.element, local: side.local });
            }
        }
        for (name, elements) in &self.element_sets {
            if let Some(&element) = elements.iter().find(|&&element| element >= self.elements.len()) {
                return Err(MeshError::NoSuchElement { set: name.clone(), element });
            }
        }
        Ok(())
    }

    fn check_positions(&self) -> Result<(), MeshError> {
        if let Some(node) = self.nodes.iter().position(|position| !position.iter().all(|x| x.is_finite())) {
            return Err(MeshError::NotFinite { node });
        }
        let plane = self.dimension == Dimension::Plane;
        match self.nodes.iter().position(|position| plane && position[2] != 0.0) {
            Some(node) => Err(MeshError::OutOfPlane { node, height: self.nodes[node][2] }),
            None => Ok(()),
        }
    }

    fn check_mapping(&self) -> Result<(), MeshError> {
        for (element, &kind) in self.kinds.iter().enumerate() {
            let positions = self.element_positions(element);
            for point in 0..kind.point_count() {
                let determinant = point_geometry(kind, &positions, point).volume;
                if determinant.is_nan() || determinant <= 0.0 {
                    return Err(MeshError::Inverted { element, point, determinant });
                }
            }
            self.check_corners(element, &positions)?;
        }
        Ok(())
    }

    /// An element can be folded at a corner although all its Gauss points are sound, for instance when two of its
    /// nodes are exchanged. Collapsed corners and slight folds, which the integrals never see, are allowed.
    fn check_corners(&self, element: usize, positions: &[[f64; 3]]) -> Result<(), MeshError> {
        let kind = self.kinds[element];
        let places = &node_places(kind)[..kind.corner_count()];
        let determinants: Vec<f64> =
            places.iter().map(|&place| geometry_of_shape(kind, &shape(kind, place), positions).volume).collect();
        let least = -SLIGHT_FOLD * determinants.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
        match determinants.iter().position(|determinant| *determinant < least) {
            Some(corner) => Err(MeshError::Folded {
                element,
                node: self.elements[element][corner],
                determinant: determinants[corner],
            }),
            None => Ok(()),
        }
    }

    fn check_loose_nodes(&self) -> Result<(), MeshError> {
        let mut used = vec![false; self.nodes.len()];
        self.elements.iter().flatten().for_each(|&node| used[node] = true);
        match used.iter().position(|used| !used) {
            Some(node) => Err(MeshError::LooseNode { node }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::ElementKind;
    use crate::mesh::block::Block;

    fn block(kind: ElementKind) -> Mesh {
        match kind.dimension() {
            Dimension::Plane => Block::plane([2.0, 3.0], [2, 3], kind).mesh().unwrap(),
            Dimension::Space => Block::space([2.0, 3.0, 1.0], [2, 3, 1], kind).mesh().unwrap(),
        }
    }

    #[test]
    fn an_inverted_element_of_any_kind_is_named() {
        for kind in ElementKind::ALL {
            let mut mesh = block(kind);
            mesh.elements[4].swap(0, 1);
            match mesh.validate() {
                Err(error @ MeshError::Inverted { element: 4, .. }) => {
                    assert!(error.to_string().contains("element 4 is inverted"));
                }
                Err(MeshError::Folded { element: 4, .. }) => {}
                other => panic!("{kind:?}: {other:?}"),
            }
        }
    }

    #[test]
    fn dangling_references_and_bad_numbers_are_refused() {
        let mut mesh = block(ElementKind::Q8);
        mesh.elements[0][7] = 99;
        assert!(matches!(mesh.validate(), Err(MeshError::NoSuchNode { node: 99, .. })));
        let mut mesh = block(ElementKind::Q8);
        mesh.nodes[3][1] = f64::NAN;
        assert_eq!(mesh.validate(), Err(MeshError::NotFinite { node: 3 }));
        let mut mesh = block(ElementKind::Q4);
        mesh.nodes.push([9.0, 9.0, 0.0]);
        assert_eq!(mesh.validate(), Err(MeshError::LooseNode { node: 12 }));
        let mut mesh = block(ElementKind::Q4);
        mesh.side_sets.get_mut("top").unwrap()[0].local = 4;
        assert!(matches!(mesh.validate(), Err(MeshError::NoSuchSide { local: 4, .. })));
        let mut mesh = block(ElementKind::Q4);
        mesh.elements[5] = mesh.elements[2].iter().rev().copied().collect();
        assert_eq!(mesh.validate(), Err(MeshError::SameNodes { first: 2, second: 5 }));
        let mut mesh = block(ElementKind::T4);
        mesh.element_sets.get_mut("all").unwrap().push(999);
        assert!(matches!(mesh.validate(), Err(MeshError::NoSuchElement { element: 999, .. })));
    }

    #[test]
    fn plane_and_spatial_parts_do_not_mix() {
        let mut mesh = block(ElementKind::Q4);
        mesh.nodes[2][2] = 0.1;
        assert_eq!(mesh.validate(), Err(MeshError::OutOfPlane { node: 2, height: 0.1 }));
        let mut mesh = block(ElementKind::H8);
        mesh.kinds[1] = ElementKind::Q8;
        assert!(matches!(mesh.validate(), Err(MeshError::MixedDimensions { element: 1, .. })));
        mesh.kinds.pop();
        assert_eq!(mesh.validate(), Err(MeshError::KindCount { elements: 6, kinds: 5 }));
    }
}
