//! Displacements that are tied to one another: periodic cells, tilting platens, rigid bodies.

use super::*;
use crate::observer::Outcome;
use crate::problem::{Applied, ConstraintTerm, MultiPointConstraint, Platen, ProblemError};

fn linked(link: MultiPointConstraint) -> Condition {
    Condition::MultiPointConstraint(link)
}

fn periodic(from: &str, to: &str, jump: [Option<f64>; 3]) -> Condition {
    linked(MultiPointConstraint::Periodic { from: from.into(), to: to.into(), jump })
}

fn solved(mesh: Mesh, conditions: Vec<Condition>, law: ElasticLaw) -> (Problem, Recorder) {
    let mut problem = Problem::new(mesh, conditions);
    (problem.stages[0].control.increments, problem.stages[0].tolerances) = (2, TIGHT);
    problem.stages[0].strategy.capped_change = 1.0;
    let (run, record) = run(&problem, &mut elastic(law, &problem));
    assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
    (problem, record)
}

/// A cell with irregular elements inside: displacements of its faces differ by the mean strain, and nothing else is said.
#[test]
fn a_periodic_cell_of_one_material_strains_uniformly() {
    for (kind, law) in [
        (ElementKind::Q4, ElasticLaw::SmallStrain),
        (ElementKind::Q8, ElasticLaw::SaintVenant),
        (ElementKind::H8, ElasticLaw::SaintVenant),
    ] {
        let space = kind == ElementKind::H8;
        let mut mesh = match space {
            false => block(kind, 3, 2),
            true => Block::space([3.0, 2.0, 2.0], [3, 2, 2], kind).mesh().unwrap(),
        };
        if kind != ElementKind::Q8 {
            let inside = |place: &[f64; 3]| place[0] > 0.5 && place[0] < 2.5 && (place[1] - 1.0).abs() < 0.5;
            for (number, place) in mesh.nodes.iter_mut().enumerate() {
                if inside(place) && (!space || (place[2] - 1.0).abs() < 0.5) {
                    place[0] += 0.2 * (number as f64).sin();
                    place[1] += 0.1 * (number as f64).cos();
                }
            }
        }
        let strain = [[-2e-3, 1e-3, 0.0], [5e-4, 3e-3, 0.0], [0.0, 0.0, -1e-3]];
        let jump = |axis: usize, length: f64| [0, 1, 2].map(|i| (space || i < 2).then_some(strain[i][axis] * length));
        let mut conditions = vec![periodic("left", "right", jump(0, 3.0)), periodic("bottom", "top", jump(1, 2.0))];
        let corner = if space { "bottom_left_back" } else { "bottom_left" };
        conditions.extend([Axis::X, Axis::Y].map(|axis| Condition::fixed(corner, axis)));
        if space {
            conditions.extend([periodic("back", "front", jump(2, 2.0)), Condition::fixed(corner, Axis::Z)]);
        }
        let (problem, record) = solved(mesh, conditions, law);
        let total = nalgebra::Matrix3::from_fn(|i, j| {
            let within = space || (i < 2 && j < 2);
            f64::from(u8::from(i == j)) + if within { strain[i][j] } else { 0.0 }
        });
        let exact = elastic(law, &problem).stress(&total);
        for point in &record.points {
            let error = (crate::formulation::tensor::matrix(&point.stress) - exact).amax() / exact.amax();
            assert!(error < 1e-7, "{kind:?}: {error:e}");
        }
    }
}

/// A jump that is left out finds its own value: the cell is squeezed upright and widens until it is free of lateral stress.
#[test]
fn a_free_jump_carries_no_mean_stress() {
    let conditions = vec![
        periodic("left", "right", [None, Some(0.0), None]),
        periodic("bottom", "top", [Some(0.0), Some(-2e-3), None]),
        Condition::fixed("bottom_left", Axis::X),
        Condition::fixed("bottom_left", Axis::Y),
    ];
    let (problem, record) = solved(block(ElementKind::Q4, 2, 2), conditions, ElasticLaw::SmallStrain);
    for point in &record.points {
        let [[xx, xy], [_, yy]] = point.stress.plane();
        assert!(xx.abs() < 1e-6 * yy.abs() && xy.abs() < 1e-6 * yy.abs() && yy < 0.0, "{xx} {yy}");
    }
    let right = problem.mesh.node_sets["right"][0];
    // Lateral strain of plane stress: (K - G) / (K + G) of the axial one.
    assert!((record.displacements[right][0] - 2.0 * 1e-3 / 3.0).abs() < 1e-9);
}

/// Force along y and its moment about the middle of a set, from what is on its nodes.
fn resultant(problem: &Problem, record: &Recorder, set: &str) -> (f64, f64, f64) {
    let nodes = &problem.mesh.node_sets[set];
    let middle = nodes.iter().map(|&node| problem.mesh.nodes[node][0]).sum::<f64>() / nodes.len() as f64;
    let mut sums = (0.0, 0.0, 0.0);
    for &node in nodes {
        let (force, arm) = (record.reactions[node][1], problem.mesh.nodes[node][0] - middle);
        sums = (sums.0 + force, sums.1 + force * arm, sums.2 + (force * arm).abs());
    }
    sums
}

/// A column that is pushed sideways bends: a platen that may tilt stays plane and takes no moment, one that may not does.
#[test]
fn a_tilting_platen_stays_plane_and_carries_no_moment() {
    let side = || Condition::Traction { sides: "left".into(), value: [2e4, 0.0, 0.0] };
    let floor = || [Axis::X, Axis::Y].map(|axis| Condition::fixed("bottom", axis));
    let tilting = |displacement| {
        linked(MultiPointConstraint::TiltingPlaten {
            nodes: "top".into(),
            axis: Axis::Y,
            displacement,
            rotation: [None; 3],
        })
    };
    for displacement in [Some(-1e-3), None] {
        let mut conditions = vec![side(), tilting(displacement)];
        conditions.extend(floor());
        let (problem, record) = solved(block(ElementKind::Q8, 2, 4), conditions, ElasticLaw::SaintVenant);
        let (force, moment, size) = resultant(&problem, &record, "top");
        assert!(moment.abs() < 1e-7 * size, "{moment:e} of {size:e}");
        match displacement {
            Some(_) => assert!(force < -1e3, "it pushes: {force}"),
            None => assert!(force.abs() < 1e-6 * size, "it hangs free: {force:e}"),
        }
        let nodes = &problem.mesh.node_sets["top"];
        let heights = |node: &usize| (problem.mesh.nodes[*node][0] - 1.0, record.displacements[*node][1]);
        let places: Vec<(f64, f64)> = nodes.iter().map(heights).collect();
        let middle = places.iter().map(|place| place.1).sum::<f64>() / places.len() as f64;
        let slope = places.iter().find(|place| place.0 == 1.0).unwrap().1 - middle;
        assert!(slope.abs() > 1e-5, "it tilts: {slope:e}");
        assert!(places.iter().all(|(arm, height)| (height - middle - slope * arm).abs() < 1e-12), "{places:?}");
        assert!(displacement.is_none_or(|wanted| (middle - wanted).abs() < 1e-15));
    }
    let platen =
        Condition::Platen { nodes: "top".into(), contact: Platen::Smooth, axis: Axis::Y, displacement: -1e-3 };
    let conditions = [side(), platen].into_iter().chain(floor()).collect();
    let (problem, record) = solved(block(ElementKind::Q8, 2, 4), conditions, ElasticLaw::SaintVenant);
    let (_, moment, size) = resultant(&problem, &record, "top");
    assert!(moment.abs() > 0.1 * size, "the other platen holds the column upright: {moment:e} of {size:e}");
}

/// A rigid head that is turned: its nodes turn with it about its middle, which is free to move.
#[test]
fn a_rigid_body_turns_in_the_plane_and_in_space() {
    let turned = 2e-3;
    let head = |free: [Option<f64>; 3], rotation| {
        linked(MultiPointConstraint::RigidBody { nodes: "top".into(), displacement: free, rotation })
    };
    let plane = vec![
        Condition::fixed("bottom", Axis::X),
        Condition::fixed("bottom", Axis::Y),
        head([None; 3], [None, None, Some(turned)]),
    ];
    let (problem, record) = solved(block(ElementKind::Q8, 2, 2), plane, ElasticLaw::SmallStrain);
    let (force, moment, _) = resultant(&problem, &record, "top");
    assert!(moment > 0.0 && force.abs() < 1e-6 * moment, "a pure couple: {force:e} {moment:e}");
    let nodes = &problem.mesh.node_sets["top"];
    let displacements = &record.displacements;
    let moved = |component: usize| nodes.iter().map(move |&node| displacements[node][component]);
    let sideways: Vec<f64> = moved(0).collect();
    assert!(sideways.iter().all(|value| (value - sideways[0]).abs() < 1e-14), "no arm across the head");
    let middle = moved(1).sum::<f64>() / nodes.len() as f64;
    for (&node, height) in nodes.iter().zip(moved(1)) {
        let arm = problem.mesh.nodes[node][0] - 1.0;
        assert!((height - middle - turned * arm).abs() < 1e-14);
    }
    let mesh = Block::space([1.0, 1.0, 1.0], [2, 2, 2], ElementKind::H8).mesh().unwrap();
    let mut space: Vec<Condition> = Axis::ALL.map(|axis| Condition::fixed("bottom", axis)).into();
    space.push(head([Some(0.0); 3], [None, Some(turned), None]));
    let (problem, record) = solved(mesh, space, ElasticLaw::SmallStrain);
    for &node in &problem.mesh.node_sets["top"] {
        let [x, _, z] = problem.mesh.nodes[node].map(|place| place - 0.5);
        let [right, up, out] = record.displacements[node];
        assert!((right - turned * z).abs() < 1e-14 && (out + turned * x).abs() < 1e-14, "about the vertical");
        assert!(up.abs() < 1e-12, "no couple about the other axes, by symmetry");
    }
}

/// Two blocks that do not touch move alike through one sum, and are looked at together.
#[test]
fn a_sum_ties_two_parts_together() {
    let mut mesh = block(ElementKind::Q4, 1, 1);
    let first = mesh.nodes.len();
    mesh.nodes.extend([[3.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 1.0, 0.0], [3.0, 1.0, 0.0]]);
    mesh.kinds.push(ElementKind::Q4);
    mesh.elements.push((first..first + 4).collect());
    mesh.node_sets.insert("foot".into(), vec![first, first + 1]);
    mesh.node_sets.insert("head".into(), vec![first + 2, first + 3]);
    let term = |nodes: &str, coefficient| ConstraintTerm { nodes: nodes.into(), axis: Axis::Y, coefficient };
    let tie = linked(MultiPointConstraint::Sum { terms: vec![term("head", 1.0), term("top", -1.0)], value: 1e-3 });
    let held =
        |sets: &[(&str, Axis)]| sets.iter().map(|(set, axis)| Condition::fixed(*set, *axis)).collect::<Vec<_>>();
    let mut conditions = held(&[("bottom", Axis::X), ("bottom", Axis::Y), ("foot", Axis::X), ("head", Axis::X)]);
    assert!(matches!(
        Problem::new(mesh.clone(), conditions.clone()).validate(),
        Err(ProblemError::RigidMotion { element: 1, .. })
    ));
    conditions.push(tie);
    let (problem, record) = solved(mesh, conditions, ElasticLaw::SmallStrain);
    let mean = |set: &str| {
        let nodes = &problem.mesh.node_sets[set];
        nodes.iter().map(|&node| record.displacements[node][1]).sum::<f64>() / nodes.len() as f64
    };
    assert!((mean("head") - mean("top") - 1e-3).abs() < 1e-15);
    assert!(mean("top").abs() < 1e-12, "nothing pulls");
}

#[test]
fn links_that_cannot_hold_are_refused() {
    let floor = [Axis::X, Axis::Y].map(|axis| Condition::fixed("bottom", axis));
    let error = |mesh: Mesh, more: Vec<Condition>| {
        let problem = Problem::new(mesh, floor.iter().cloned().chain(more).collect());
        problem.validate().unwrap_err().into_cause()
    };
    let square = || block(ElementKind::Q4, 2, 2);
    let up = Condition::Displacement { nodes: "top".into(), axis: Axis::Y, value: 1e-3 };
    let tilting = linked(MultiPointConstraint::TiltingPlaten {
        nodes: "top".into(),
        axis: Axis::Y,
        displacement: Some(0.0),
        rotation: [None; 3],
    });
    assert!(matches!(error(square(), vec![up, tilting]), ProblemError::MultiPointConstraint { .. }));
    let mut skewed = square();
    let corner = skewed.node_sets["right"][1];
    skewed.nodes[corner][1] += 0.1;
    let pairs = periodic("left", "right", [None; 3]);
    assert!(matches!(error(skewed, vec![pairs]), ProblemError::NoImage { .. }));
    // Nodes that are to move as themselves would be free, without a word.
    let itself = periodic("left", "left", [Some(0.0); 3]);
    assert!(matches!(error(square(), vec![itself]), ProblemError::MultiPointConstraint { .. }));
    let empty = linked(MultiPointConstraint::Sum { terms: Vec::new(), value: 0.0 });
    assert!(matches!(error(square(), vec![empty]), ProblemError::MultiPointConstraint { .. }));
    let missing = periodic("left", "wall", [None; 3]);
    assert!(matches!(error(square(), vec![missing]), ProblemError::UnknownNodeSet { .. }));
    let across = linked(MultiPointConstraint::TiltingPlaten {
        nodes: "right".into(),
        axis: Axis::Y,
        displacement: None,
        rotation: [None; 3],
    });
    let text = error(square(), vec![across]).to_string();
    assert!(text.contains("wider along its normal"), "{text}");
    let deep = linked(MultiPointConstraint::TiltingPlaten {
        nodes: "top".into(),
        axis: Axis::Z,
        displacement: None,
        rotation: [None; 3],
    });
    assert_eq!(error(square(), vec![deep]), ProblemError::NoThirdAxis);
}

/// What a link has reached stays, as a support does, and a later stage goes on from there.
#[test]
fn links_count_from_their_stage() {
    let mut problem = Problem::new(
        block(ElementKind::Q4, 2, 2),
        vec![
            Condition::fixed("bottom", Axis::X),
            Condition::fixed("bottom", Axis::Y),
            linked(MultiPointConstraint::TiltingPlaten {
                nodes: "top".into(),
                axis: Axis::Y,
                displacement: Some(-1e-3),
                rotation: [None; 3],
            }),
        ],
    );
    problem.stages[0].tolerances = TIGHT;
    problem.stages[0].control.increments = 2;
    let mut second = problem.stages[0].clone();
    second.name = "more".into();
    let Applied { condition: Condition::MultiPointConstraint(link), .. } = &mut second.conditions[2] else {
        panic!("the platen")
    };
    *link = match link.held() {
        MultiPointConstraint::TiltingPlaten { nodes, axis, displacement: Some(0.0), rotation } => {
            MultiPointConstraint::TiltingPlaten { nodes, axis, displacement: Some(-5e-4), rotation }
        }
        other => panic!("{other:?}"),
    };
    problem.stages.push(second);
    let (run, record) = run(&problem, &mut elastic(ElasticLaw::SaintVenant, &problem));
    assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
    let nodes = &problem.mesh.node_sets["top"];
    let mean = nodes.iter().map(|&node| record.displacements[node][1]).sum::<f64>() / nodes.len() as f64;
    assert!((mean + 1.5e-3).abs() < 1e-14, "{mean:e}");
}
