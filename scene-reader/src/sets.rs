//! Names of node, side and element sets, checked where they are written.

use super::document::Document;
use super::input_error::InputError;
use keys::Located;
use macro_solver::mesh::{Dimension, Mesh};

/// The named sets of a mesh.
pub(super) struct Sets<'a> {
    pub(super) mesh: &'a Mesh,
}

impl Sets<'_> {
    /// The name, if the mesh has such a node set.
    ///
    /// # Errors
    /// No such set, with the sets there are.
    pub(super) fn node_set(&self, document: &Document, name: &Located<String>) -> Result<String, InputError> {
        let found = check(document, name, ("node set", self.side_entity()), self.mesh.node_sets.keys());
        // Gmsh numbers the groups of each dimension from 1; the nodes of several groups of one number are no set.
        found.map_err(|error| match self.is_unnamed_group(name.get_ref()) {
            true => error.hint_too("groups of several dimensions have this number: give them names in Gmsh"),
            false => error,
        })
    }

    /// Whether unnamed groups of Gmsh are side or element sets under this name.
    fn is_unnamed_group(&self, name: &str) -> bool {
        let is_set = self.mesh.side_sets.contains_key(name) || self.mesh.element_sets.contains_key(name);
        is_set && name.starts_with("group_")
    }

    /// The name, if the mesh has such a side set.
    ///
    /// # Errors
    /// No such set, with the sets there are.
    pub(super) fn side_set(&self, document: &Document, name: &Located<String>) -> Result<String, InputError> {
        check(document, name, ("side set", self.side_entity()), self.mesh.side_sets.keys())
    }

    /// The name, if the mesh has such an element set.
    ///
    /// # Errors
    /// No such set, with the sets there are.
    pub(super) fn element_set(&self, document: &Document, name: &Located<String>) -> Result<String, InputError> {
        check(document, name, ("element set", self.body_entity()), self.mesh.element_sets.keys())
    }

    /// The name, if the mesh has such an element set or the scene a region that is one.
    ///
    /// # Errors
    /// As [`Sets::element_set`].
    pub(super) fn element_set_or_region(
        &self,
        document: &Document,
        name: &Located<String>,
    ) -> Result<String, InputError> {
        self.element_set(document, name)
            .map_err(|error| error.hint_too("a [[region]] with this name and a box makes one as well"))
    }

    /// What Gmsh calls a part of the border.
    fn side_entity(&self) -> &'static str {
        if self.mesh.dimension == Dimension::Plane { "Curve" } else { "Surface" }
    }

    /// What Gmsh calls a part of the body.
    fn body_entity(&self) -> &'static str {
        if self.mesh.dimension == Dimension::Plane { "Surface" } else { "Volume" }
    }
}

/// The name, if it is among those `available`; `what` they are, and what Gmsh calls what it names.
fn check<'a>(
    document: &Document,
    name: &Located<String>,
    (what, entity): (&str, &str),
    available: impl Iterator<Item = &'a String>,
) -> Result<String, InputError> {
    let available: Vec<&str> = available.map(String::as_str).collect();
    if available.contains(&name.get_ref().as_str()) {
        return Ok(name.get_ref().clone());
    }
    let hint = match &available[..] {
        [] | ["all"] => format!(
            "there is {}; name one in Gmsh with `Physical {entity}(\"{}\") = {{...}}` and save the mesh again (format 2.2: without Mesh.SaveAll, \
             which saves no groups)",
            if available.is_empty() { "none at all" } else { "only 'all', which every mesh has" },
            name.get_ref()
        ),
        _ => format!("use one of: {}", available.join(", ")),
    };
    Err(document.error_at(name.span(), format!("the mesh has no {what} '{}'", name.get_ref())).hint(hint))
}

#[cfg(test)]
mod tests {
    use super::*;
    use macro_solver::mesh::ElementKind;
    use macro_solver::mesh::block::Block;
    use std::path::Path;

    #[test]
    fn a_number_that_groups_of_several_dimensions_have_is_no_node_set() {
        let mut mesh = Block::plane([1.0, 1.0], [1, 1], ElementKind::Q4).mesh().unwrap();
        mesh.element_sets.insert("group_1".into(), vec![0]);
        let document = Document::from_text(Path::new("scene.toml"), "a = 1".into(), &[]).unwrap();
        let reason = |name: &str| {
            let error = Sets { mesh: &mesh }.node_set(&document, &Located::new(0..5, name.to_owned())).unwrap_err();
            error.to_string()
        };
        assert!(reason("group_1").contains("groups of several dimensions have this number"), "{}", reason("group_1"));
        assert!(!reason("group_2").contains("several dimensions"));
    }
}
