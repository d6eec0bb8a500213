//! From Gmsh's nodes, elements and groups to a mesh with named sets.

use super::parse::{Content, RawElement};
use super::{ElementKind, GmshError, Mesh};
use crate::mesh::{Dimension, MeshError, MeshPlace, Side};
use std::collections::{BTreeMap, BTreeSet};

/// Shapes of points and edges that Gmsh numbers: number, dimension, nodes. Those of elements are in the definitions of the kinds.
const LOWER_SHAPES: [(u32, usize, usize); 3] = [(15, 0, 1), (1, 1, 2), (8, 1, 3)];

/// Dimension and number of nodes of a shape that Gmsh numbers; `None` for shapes that are not supported.
fn size_of_shape(shape: u32) -> Option<(usize, usize)> {
    let lower = LOWER_SHAPES.iter().find(|(number, _, _)| *number == shape);
    let lower = lower.map(|(_, dimension, nodes)| (*dimension, *nodes));
    lower.or_else(|| kinds_of(shape).next().map(|kind| (kind.dimension().count(), kind.node_count())))
}

/// Kinds of elements with a shape that Gmsh numbers, the usual one first.
fn kinds_of(shape: u32) -> impl Iterator<Item = ElementKind> {
    ElementKind::ALL.into_iter().filter(move |kind| kind.interpolation().gmsh == shape)
}

/// Builds the mesh.
pub(super) fn mesh(content: Content, preferred: Option<ElementKind>) -> Result<Mesh, GmshError> {
    for element in &content.elements {
        check(element, &content)?;
    }
    let highest = content.elements.iter().map(dimension_of).max().unwrap_or(0);
    let dimension = match highest {
        2 => Dimension::Plane,
        3 => Dimension::Space,
        _ => {
            let remedy = "mesh the surfaces or volumes, and give them a physical group so that Gmsh saves them";
            return Err(GmshError::new(content.lines, "the file holds no surface or volume elements", remedy));
        }
    };
    let numbers: BTreeMap<u64, usize> = content.nodes.keys().copied().zip(0..).collect();
    let mut mesh = Mesh {
        dimension,
        nodes: content.nodes.values().copied().collect(),
        elements: Vec::new(),
        kinds: Vec::new(),
        node_sets: BTreeMap::new(),
        side_sets: BTreeMap::new(),
        element_sets: BTreeMap::new(),
    };
    let mut sets: BTreeMap<String, BTreeSet<usize>> = BTreeMap::new();
    for element in content.elements.iter().filter(|element| dimension_of(element) == highest) {
        let preferred = kinds_of(element.shape).find(|kind| Some(*kind) == preferred);
        let Some(kind) = preferred.or_else(|| kinds_of(element.shape).next()) else { continue };
        let in_our_order: Vec<usize> = match kind.interpolation().gmsh_order {
            [] => (0..kind.node_count()).collect(),
            order => order.to_vec(),
        };
        for group in names(&content, element) {
            sets.entry(group).or_default().insert(mesh.elements.len());
        }
        mesh.elements.push(in_our_order.iter().map(|&place| numbers[&element.nodes[place]]).collect());
        mesh.kinds.push(kind);
    }
    mesh.element_sets = sets.into_iter().map(|(name, elements)| (name, elements.into_iter().collect())).collect();
    if mesh.element_sets.get("all").is_some_and(|elements| elements.len() < mesh.elements.len()) {
        return Err(part_named_all(&content));
    }
    mesh.element_sets.entry("all".to_owned()).or_insert_with(|| (0..mesh.elements.len()).collect());
    mesh.side_sets = match side_sets(&content, &mesh, &numbers, highest - 1) {
        Ok(sets) => sets,
        // An element whose nodes are out of order has no sides that the groups could lie on: that is what is wrong then.
        Err(_) if mesh.validate().is_err() => BTreeMap::new(),
        Err(error) => return Err(error),
    };
    mesh.node_sets = node_sets(&content, &numbers);
    let used: BTreeSet<usize> = mesh.elements.iter().flatten().copied().collect();
    if mesh.node_sets.get("all").is_some_and(|nodes| !used.is_subset(&nodes.iter().copied().collect())) {
        return Err(part_named_all(&content));
    }
    mesh.node_sets.entry("all".to_owned()).or_insert_with(|| (0..mesh.nodes.len()).collect());
    let solid: Vec<&RawElement> =
        content.elements.iter().filter(|element| dimension_of(element) == highest).collect();
    mesh.validate().map_err(|error| in_the_file(error, &solid, &content))?;
    Ok(mesh)
}

/// A defect of the mesh where the file has it, with the numbers that Gmsh shows.
fn in_the_file(error: MeshError, elements: &[&RawElement], content: &Content) -> GmshError {
    let tags: Vec<u64> = content.nodes.keys().copied().collect();
    let line = match error.place() {
        MeshPlace::Element(element) => elements.get(element).map(|element| element.line),
        MeshPlace::Node(node) => tags.get(node).and_then(|tag| content.node_lines.get(tag)).copied(),
        MeshPlace::Mesh => None,
    };
    let number = |tag: Option<u64>, place: usize| tag.and_then(|tag| usize::try_from(tag).ok()).unwrap_or(place);
    let problem = error.renumbered(
        |element| number(elements.get(element).map(|element| element.tag), element),
        |node| number(tags.get(node).copied(), node),
    );
    GmshError::new(line.unwrap_or(content.lines), problem.to_string(), "correct the mesh in Gmsh")
}

/// Loads of a scene that are meant for the whole body would act on that part alone.
fn part_named_all(content: &Content) -> GmshError {
    let problem = "the physical group `all` is a part of the body, and `all` is the name of the whole body in scenes";
    GmshError::new(content.lines, problem, "give the group another name")
}

fn check(element: &RawElement, content: &Content) -> Result<(), GmshError> {
    let Some((_, count)) = size_of_shape(element.shape) else {
        let (problem, remedy) = match element.shape {
            10 => ("a 9-node quadrilateral", "set Mesh.SecondOrderIncomplete = 1 for 8-node ones"),
            12 => ("a 27-node hexahedron", "set Mesh.SecondOrderIncomplete = 1 for 20-node ones"),
            6 | 7 | 13 | 14 | 18 | 19 => ("a prism or pyramid", "mesh with tetrahedra or hexahedra only"),
            _ => ("an element of a shape that is not supported", "use linear or quadratic elements"),
        };
        return Err(GmshError::new(element.line, format!("{problem} (shape {})", element.shape), remedy));
    };
    if element.nodes.len() != count {
        let problem = format!("{} nodes where shape {} has {count}", element.nodes.len(), element.shape);
        return Err(GmshError::new(element.line, problem, "save the mesh again"));
    }
    match element.nodes.iter().find(|node| !content.nodes.contains_key(node)) {
        Some(node) => Err(GmshError::new(element.line, format!("there is no node {node}"), "save the mesh again")),
        None => Ok(()),
    }
}

/// 4 for shapes that [`check`] refuses.
fn dimension_of(element: &RawElement) -> usize {
    size_of_shape(element.shape).map_or(4, |(dimension, _)| dimension)
}

/// Names of the groups of an element.
fn names(content: &Content, element: &RawElement) -> Vec<String> {
    let dimension = dimension_of(element);
    let name =
        |group: &i64| content.names.get(&(dimension, *group)).cloned().unwrap_or_else(|| format!("group_{group}"));
    element.groups.iter().map(name).collect()
}

/// Sides of the mesh that lie under grouped elements of one dimension less.
fn side_sets(
    content: &Content,
    mesh: &Mesh,
    numbers: &BTreeMap<u64, usize>,
    dimension: usize,
) -> Result<BTreeMap<String, Vec<Side>>, GmshError> {
    let mut owners: BTreeMap<Vec<usize>, Vec<Side>> = BTreeMap::new();
    for (element, kind) in mesh.kinds.iter().enumerate() {
        for local in 0..kind.side_count() {
            let side = Side { element, local };
            owners.entry(sorted(mesh.side_nodes(side))).or_default().push(side);
        }
    }
    let mut sets: BTreeMap<String, BTreeSet<Side>> = BTreeMap::new();
    for element in content.elements.iter().filter(|element| dimension_of(element) == dimension) {
        for name in names(content, element) {
            let nodes = sorted(element.nodes.iter().map(|node| numbers[node]).collect());
            let sides = owners.get(&nodes).map_or(&[][..], Vec::as_slice);
            let [side] = sides else {
                let found =
                    if sides.is_empty() { "of no element".into() } else { format!("of {} elements", sides.len()) };
                let problem = format!("an element of group '{name}' is a side {found}, not of exactly one");
                let remedy = match sides {
                    [] => {
                        "it must have the nodes of an element: were parts of the geometry meshed one by one (`Coherence;` joins them), or \
                         are the nodes of elements in another order than Gmsh's?"
                    }
                    _ => "groups of sides must lie on the boundary of the mesh",
                };
                return Err(GmshError::new(element.line, problem, remedy));
            };
            sets.entry(name).or_default().insert(*side);
        }
    }
    Ok(sets.into_iter().map(|(name, sides)| (name, sides.into_iter().collect())).collect())
}

/// Nodes of the groups by name. Groups of one name in several dimensions are one set. Unnamed groups of one number in several dimensions
/// are none: Gmsh numbers the groups of each dimension from 1, so that nobody meant them together.
fn node_sets(content: &Content, numbers: &BTreeMap<u64, usize>) -> BTreeMap<String, Vec<usize>> {
    let mut sets: BTreeMap<String, (BTreeSet<usize>, BTreeSet<usize>)> = BTreeMap::new();
    for element in &content.elements {
        for name in names(content, element) {
            let (dimensions, nodes) = sets.entry(name).or_default();
            dimensions.insert(dimension_of(element));
            nodes.extend(element.nodes.iter().map(|node| numbers[node]));
        }
    }
    let given: BTreeSet<&String> = content.names.values().collect();
    sets.retain(|name, (dimensions, _)| dimensions.len() == 1 || given.contains(name));
    sets.into_iter().map(|(name, (_, nodes))| (name, nodes.into_iter().collect())).collect()
}

fn sorted(mut nodes: Vec<usize>) -> Vec<usize> {
    nodes.sort_unstable();
    nodes
}
