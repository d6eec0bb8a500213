//! Everything that can be wrong with a mesh, found before the first evaluation.

use super::{Mesh, MeshError, POINTS_PER_ELEMENT};
use crate::element::point_geometry;

impl Mesh {
    /// Checks numbers, references and the mapping of every element.
    ///
    /// # Errors
    /// The first defect, in the order of [`MeshError`]'s variants.
    pub fn validate(&self) -> Result<(), MeshError> {
        if self.elements.is_empty() {
            return Err(MeshError::Empty);
        }
        self.check_references()?;
        self.check_sets()?;
        if let Some(node) = self.nodes.iter().position(|position| !position.iter().all(|x| x.is_finite())) {
            return Err(MeshError::NotFinite { node });
        }
        self.check_mapping()?;
        self.check_loose_nodes()
    }

    /// Positions of the nodes of one element, m.
    pub fn element_positions(&self, element: usize) -> Vec<[f64; 2]> {
        self.elements[element].iter().map(|&node| self.nodes[node]).collect()
    }

    fn check_references(&self) -> Result<(), MeshError> {
        for (element, nodes) in self.elements.iter().enumerate() {
            if nodes.len() != self.kind.node_count() {
                return Err(MeshError::NodeCount {
                    element,
                    found: nodes.len(),
                    expected: self.kind.node_count(),
                    kind: self.kind,
                });
            }
            self.check_nodes(nodes, || format!("element {element}"))?;
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
        for (name, edges) in &self.edge_sets {
            if let Some(edge) = edges.iter().find(|edge| edge.element >= self.elements.len() || edge.local > 3) {
                return Err(MeshError::NoSuchEdge { set: name.clone(), element: edge.element, local: edge.local });
            }
        }
        Ok(())
    }

    fn check_mapping(&self) -> Result<(), MeshError> {
        for element in 0..self.elements.len() {
            let positions = self.element_positions(element);
            for point in 0..POINTS_PER_ELEMENT {
                let determinant = point_geometry(self.kind, &positions, point).area;
                if determinant.is_nan() || determinant <= 0.0 {
                    return Err(MeshError::Inverted { element, point, determinant });
                }
            }
        }
        Ok(())
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
        Block { width: 2.0, height: 3.0, columns: 2, rows: 3, kind }.mesh().unwrap()
    }

    #[test]
    fn blocks_have_named_sides_that_bound_them() {
        for (kind, nodes, side) in [(ElementKind::Q4, 12, 4), (ElementKind::Q8, 29, 7)] {
            let mesh = block(kind);
            mesh.validate().unwrap();
            assert_eq!(mesh.nodes.len(), nodes);
            assert_eq!(mesh.node_sets["left"].len(), side);
            assert!(mesh.node_sets["top"].iter().all(|&node| mesh.nodes[node][1] == 3.0));
            assert_eq!(mesh.nodes[mesh.node_sets["bottom_right"][0]], [2.0, 0.0]);
            for (name, normal) in
                [("left", [-3.0, 0.0]), ("right", [3.0, 0.0]), ("bottom", [0.0, -2.0]), ("top", [0.0, 2.0])]
            {
                let mut sum = [0.0; 2];
                for &edge in &mesh.edge_sets[name] {
                    let nodes = crate::element::edge::edge_nodes(&mesh, edge);
                    let (from, to) = (mesh.nodes[nodes[0]], mesh.nodes[nodes[1]]);
                    sum[0] += to[1] - from[1];
                    sum[1] -= to[0] - from[0];
                    assert!(nodes.iter().all(|node| mesh.node_sets[name].contains(node)));
                }
                assert!((sum[0] - normal[0]).abs() + (sum[1] - normal[1]).abs() < 1e-14, "{name}");
            }
        }
    }

    #[test]
    fn an_inverted_element_is_named() {
        let mut mesh = block(ElementKind::Q4);
        mesh.elements[4].swap(0, 1);
        match mesh.validate() {
            Err(error @ MeshError::Inverted { element: 4, .. }) => {
                assert!(error.to_string().contains("element 4 is inverted"));
            }
            other => panic!("{other:?}"),
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
        mesh.nodes.push([9.0, 9.0]);
        assert_eq!(mesh.validate(), Err(MeshError::LooseNode { node: 12 }));
        let mut mesh = block(ElementKind::Q4);
        mesh.edge_sets.get_mut("top").unwrap()[0].local = 4;
        assert!(matches!(mesh.validate(), Err(MeshError::NoSuchEdge { local: 4, .. })));
        let flat = Block { width: 0.0, height: 1.0, columns: 1, rows: 1, kind: ElementKind::Q4 };
        assert!(matches!(flat.mesh(), Err(MeshError::Block { .. })));
    }
}
