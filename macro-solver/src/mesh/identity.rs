//! The identity of a mesh by its content.

use super::Mesh;
use protocol::ContentId;

impl Mesh {
    /// Identity of nodes, elements and sets: two meshes share it only if runs on them are the same. Names that a file gives its nodes and
    /// elements are no part of it, nor is how the file is laid out.
    ///
    /// # Panics
    /// When the mesh cannot be encoded, which plain numbers and names always can.
    pub fn identity(&self) -> ContentId {
        let kinds: Vec<&str> = self.kinds.iter().map(|kind| kind.keyword()).collect();
        let sides: Vec<(&String, Vec<(usize, usize)>)> = (self.side_sets.iter())
            .map(|(name, sides)| (name, sides.iter().map(|side| (side.element, side.local)).collect()))
            .collect();
        let content =
            (self.dimension.count(), &self.nodes, &self.elements, kinds, &self.node_sets, sides, &self.element_sets);
        ContentId::of(&rmp_serde::to_vec(&content).expect("meshes are plain data"))
    }
}

#[cfg(test)]
mod tests {
    use crate::mesh::ElementKind;
    use crate::mesh::block::Block;

    #[test]
    fn one_node_or_one_name_makes_another_mesh() {
        let mesh = Block::plane([2.0, 1.0], [2, 1], ElementKind::Q4).mesh().unwrap();
        assert_eq!(mesh.identity(), mesh.clone().identity());
        let mut moved = mesh.clone();
        moved.nodes[4][0] += 1e-12;
        assert_ne!(mesh.identity(), moved.identity());
        let mut renamed = mesh.clone();
        let top = renamed.side_sets.remove("top").unwrap();
        renamed.side_sets.insert("lid".into(), top);
        assert_ne!(mesh.identity(), renamed.identity());
    }
}
