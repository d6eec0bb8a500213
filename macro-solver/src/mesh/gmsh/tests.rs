use super::*;
use crate::element::{node_places, point_geometry};
use crate::mesh::Dimension;
use std::fmt::Write;

/// Two quadrilaterals and two triangles in a row, groups by name, format 2.2.
const MIXED: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat
$PhysicalNames
4
0 7 \"pin\"
1 1 \"left\"
1 2 \"top\"
2 3 \"soil\"
$EndPhysicalNames
$Nodes
8
1 0 0 0
2 1 0 0
3 2 0 0
4 3 0 0
5 0 1 0
6 1 1 0
7 2 1 0
18 3 1 0
$EndNodes
$Elements
9
1 15 2 7 1 1
2 1 2 1 4 5 1
3 1 2 2 3 6 5
4 1 2 2 3 7 6
5 1 2 0 2 3 4
6 3 2 3 1 1 2 6 5
7 3 2 3 1 2 3 7 6
8 2 2 9 1 3 4 18
9 2 2 9 1 3 18 7
$EndElements
";

#[test]
fn a_mixed_plane_mesh_has_its_groups_as_sets() {
    let mesh = read(MIXED, Some(ElementKind::Q4Single)).unwrap();
    mesh.validate().unwrap();
    assert_eq!(mesh.dimension, Dimension::Plane);
    let single = ElementKind::Q4Single;
    assert_eq!(mesh.kinds, [single, single, ElementKind::T3, ElementKind::T3]);
    assert_eq!(mesh.element_sets["soil"], [0, 1]);
    assert_eq!(mesh.element_sets["group_9"], [2, 3]);
    assert_eq!(mesh.node_sets["pin"], [0]);
    assert_eq!(mesh.node_sets["top"], [4, 5, 6]);
    assert_eq!(mesh.side_sets["top"].iter().map(|side| side.local).collect::<Vec<_>>(), [2, 2]);
    assert_eq!(mesh.side_nodes(mesh.side_sets["left"][0]), [4, 0]);
    assert_eq!(mesh.point_count(), 4);
}

/// Format 2.2 repeats an element for each of its groups, and a negative group is one whose orientation differs.
#[test]
fn an_element_of_two_groups_is_one_element() {
    let last = "9 2 2 9 1 3 18 7\n";
    let twice = MIXED
        .replace("$Elements\n9\n", "$Elements\n11\n")
        .replace(last, &format!("{last}10 1 2 -4 3 6 5\n11 3 2 5 1 2 3 7 6\n"));
    let mesh = read(&twice, None).unwrap();
    mesh.validate().unwrap();
    let (plain, group) = (read(MIXED, None).unwrap(), |name: &str| mesh.element_sets[name].clone());
    assert_eq!((mesh.elements.len(), group("group_5")), (plain.elements.len(), vec![1]));
    assert_eq!(group("soil"), plain.element_sets["soil"]);
    assert_eq!(mesh.side_sets["group_4"], [mesh.side_sets["top"][0]]);
    assert_eq!(mesh.side_sets["top"], plain.side_sets["top"]);
}

/// A section that announces fewer entries than it has lost the others: the body had a hole.
#[test]
fn sections_with_more_entries_than_they_announce_are_refused() {
    let line_of = |text: &str, wanted: &str| text.lines().position(|line| line == wanted).unwrap() + 1;
    let short = MIXED.replace("$Elements\n9\n", "$Elements\n8\n");
    let error = read(&short, None).unwrap_err();
    assert_eq!(error.line, line_of(&short, "9 2 2 9 1 3 18 7"));
    assert!(error.problem.contains("$Elements goes on") && error.remedy.contains("numbers of entries"), "{error}");
    let nodes = MIXED.split_once("$Nodes\n").unwrap().1.lines().next().unwrap();
    let fewer = nodes.parse::<usize>().unwrap() - 1;
    let error = read(&MIXED.replace(&format!("$Nodes\n{nodes}\n"), &format!("$Nodes\n{fewer}\n")), None).unwrap_err();
    assert!(error.problem.contains("$Nodes goes on"), "{error}");
}

#[test]
fn defects_of_the_mesh_are_told_with_the_lines_and_numbers_of_the_file() {
    let turned = MIXED.replace("9 2 2 9 1 3 18 7", "9 2 2 9 1 18 3 7");
    let error = read(&turned, None).unwrap_err();
    let line = turned.lines().position(|line| line == "9 2 2 9 1 18 3 7").unwrap() + 1;
    assert!(error.line == line && error.problem.contains("element 9 is inverted"), "{error}");
}

#[test]
fn a_part_of_the_body_cannot_be_called_all() {
    for part in ["\"soil\"", "\"top\"", "\"pin\""] {
        let error = read(&MIXED.replace(part, "\"all\""), None).unwrap_err();
        assert!(error.problem.contains("`all` is the name of the whole body"), "{}", error.problem);
    }
    // Without the triangles and their own nodes `soil` is the whole body.
    let whole = MIXED
        .replace("$Elements\n9\n", "$Elements\n6\n")
        .replace("8 2 2 9 1 3 4 18\n9 2 2 9 1 3 18 7\n", "")
        .replace("5 1 2 0 2 3 4\n", "")
        .replace("$Nodes\n8\n", "$Nodes\n6\n")
        .replace("4 3 0 0\n", "")
        .replace("18 3 1 0\n", "")
        .replace("\"soil\"", "\"all\"");
    assert_eq!(read(&whole, None).unwrap().element_sets["all"], [0, 1]);
}

/// Gmsh numbers the groups of each dimension from 1: a curve and a surface without names were one node set under their number. A name in
/// two dimensions is meant.
#[test]
fn unnamed_groups_of_one_number_are_no_node_set_and_those_of_one_name_are_one() {
    let mesh = read(&MIXED.replace("2 1 2 1 4 5 1", "2 1 2 9 4 5 1"), None).unwrap();
    assert_eq!((mesh.element_sets["group_9"].len(), mesh.side_sets["group_9"].len()), (2, 1));
    assert!(!mesh.node_sets.contains_key("group_9"));
    let mesh = read(MIXED, None).unwrap();
    assert_eq!(mesh.node_sets["group_9"], [2, 3, 6, 7], "an unnamed group alone");
    let mesh = read(&MIXED.replace("0 7 \"pin\"", "0 7 \"top\""), None).unwrap();
    assert_eq!(mesh.node_sets["top"], [0, 4, 5, 6]);
}

/// One element of a kind in format 4.1, its nodes in Gmsh's order.
fn one_element(shape: u32, kind: ElementKind, edges: &[[usize; 2]]) -> String {
    let corners = &node_places(kind)[..kind.corner_count()];
    let middles = edges.iter().map(|[a, b]| std::array::from_fn(|i| 0.5 * (corners[*a][i] + corners[*b][i])));
    let nodes: Vec<[f64; 3]> = corners.iter().copied().chain(middles).collect();
    let dimension = kind.dimension().count();
    let mut text = String::from("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n");
    let counts = if dimension == 2 { "0 0 1 0" } else { "0 0 0 1" };
    writeln!(text, "{dimension} 5 \"body of clay\"\n$EndPhysicalNames\n$Entities\n{counts}").unwrap();
    writeln!(text, "1 0 0 0 1 1 1 1 5 0\n$EndEntities\n$Nodes\n1 {} 1 {}", nodes.len(), nodes.len()).unwrap();
    writeln!(text, "{dimension} 1 0 {}", nodes.len()).unwrap();
    (1..=nodes.len()).for_each(|tag| writeln!(text, "{tag}").unwrap());
    nodes.iter().for_each(|[x, y, z]| writeln!(text, "{x} {y} {z}").unwrap());
    let tags: Vec<String> = (1..=nodes.len()).map(|tag| tag.to_string()).collect();
    writeln!(text, "$EndNodes\n$Elements\n1 1 1 1\n{dimension} 1 {shape} 1\n1 {}\n$EndElements", tags.join(" "))
        .unwrap();
    text
}

/// Middle nodes end up between the corners where our order wants them: the mapping is the identity, volumes are right.
#[test]
fn every_shape_of_format_4_is_read_with_its_nodes_in_our_order() {
    let tetrahedron = [[0, 1], [1, 2], [2, 0], [3, 0], [2, 3], [1, 3]];
    let hexahedron = [[0, 1], [0, 3], [0, 4], [1, 2], [1, 5], [2, 3], [2, 6], [3, 7], [4, 5], [4, 7], [5, 6], [6, 7]];
    let plane: [[usize; 2]; 4] = [[0, 1], [1, 2], [2, 3], [3, 0]];
    let triangle = [[0, 1], [1, 2], [2, 0]];
    let shapes: [(u32, ElementKind, &[[usize; 2]]); 8] = [
        (2, ElementKind::T3, &[]),
        (3, ElementKind::Q4, &[]),
        (9, ElementKind::T6, &triangle),
        (16, ElementKind::Q8, &plane),
        (4, ElementKind::T4, &[]),
        (5, ElementKind::H8, &[]),
        (11, ElementKind::T10, &tetrahedron),
        (17, ElementKind::H20, &hexahedron),
    ];
    for (shape, kind, edges) in shapes {
        let mesh = read(&one_element(shape, kind, edges), None).unwrap();
        mesh.validate().unwrap();
        assert_eq!((mesh.kinds[0], mesh.element_sets["body of clay"].len()), (kind, 1));
        assert_eq!(mesh.element_positions(0), node_places(kind), "{kind:?}");
        let geometry = point_geometry(kind, &mesh.element_positions(0), 0);
        assert!(geometry.volume > 0.0);
    }
}

#[test]
fn defects_are_named_by_line_and_remedy() {
    let refused = |from: &str, to: &str| read(&MIXED.replace(from, to), None).unwrap_err();
    let error = refused("2.2 0 8", "2.2 1 8");
    assert!(error.line == 2 && error.to_string().contains("binary") && error.remedy.contains("-bin 0"));
    assert!(refused("2.2 0 8", "1.0 0 8").problem.contains("format 1.0"));
    let error = refused("4 3 0 0", "4 3 zero 0");
    assert_eq!((error.line, error.problem.as_str()), (16, "'zero' is not y"));
    assert!(refused("4 3 0 0", "4 3 inf 0").problem.contains("not a finite number"));
    assert!(refused("7 2 1 0", "6 2 1 0").problem.contains("node 6 is given twice"));
    let error = refused("7 3 2 3 1 2 3 7 6", "7 3 2 3 1 2 3 7 99");
    assert_eq!((error.line, error.problem.as_str()), (30, "there is no node 99"));
    assert!(refused("7 3 2 3 1 2 3 7 6", "7 6 2 3 1 2 3 7 6 5 1").problem.contains("prism"));
    assert!(refused("3 1 2 2 3 6 5", "3 1 2 2 3 6 1").problem.contains("group 'top' is a side of no element"));
    assert!(refused("$EndElements", "").problem.contains("no $EndElements"));
    assert!(read("solid thing", None).unwrap_err().problem.contains("not the start of a section"));
    assert_eq!(read("", None).unwrap_err().line, 1);
    let clockwise = refused("6 3 2 3 1 1 2 6 5", "6 3 2 3 1 5 6 2 1");
    assert!(clockwise.line == 29 && clockwise.problem.contains("element 6 is inverted"), "{clockwise}");
}
