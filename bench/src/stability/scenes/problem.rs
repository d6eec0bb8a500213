//! The boundary value problem of a small scene.

use super::draw::{Loading, Scene};
use anyhow::Context;
use macro_solver::mesh::Mesh;
use macro_solver::mesh::block::Block;
use macro_solver::problem::{
    Axis, Condition, Criteria, ErrorControl, NamedStrategy, Platen, PressureKind, Problem, Stabilisation, Tolerances,
};
use rve_server::definition::RveOptions;

/// The force of a step that keeps to no error, over the reactions.
const FORCE: f64 = 1e-2;

/// The shipped scene whose head is rigid.
const HEAD: &str = include_str!("../../../../scenes/single-hexahedron-shear.toml");
const PACKING: &str = include_str!("../../../../packings/spheres-100.json");

/// The problem of a scene whose cells are solved with these options; `tightness` multiplies the tolerances of its steps.
///
/// # Errors
/// A mesh that cannot be made, or a shipped scene that cannot be read.
pub(super) fn problem(scene: &Scene, options: &RveOptions, tightness: f64) -> anyhow::Result<Problem> {
    let mut problem = match scene.loading {
        Loading::Head => head(scene)?,
        _ => Problem::new(mesh(scene)?, conditions(scene)),
    };
    problem.formulation = scene.formulation;
    let is_plane = scene.elements[2] == 0;
    let stage = &mut problem.stages[0];
    stage.control.increments = scene.steps;
    stage.control.min = 1.0 / (64 * scene.steps) as f64;
    stage.control.max_iterations = 25;
    // Tolerances of the scene itself: a finer run has none of its own.
    let given = match scene.options.error {
        Some(error) => Tolerances::within(error),
        None => Tolerances { force: FORCE, criteria: Criteria::FORCE_OVER_REACTIONS, ..Tolerances::default() },
    };
    stage.tolerances =
        Tolerances { force: tightness * given.force, displacement: tightness * given.displacement, ..given };
    if !is_plane {
        stage.strategy = NamedStrategy::default_of(3).preset();
    }
    // As in scenes that do not say otherwise.
    stage.control.stabilisation = Some(Stabilisation::under_moving_supports(&stage.strategy));
    problem.strain_per_step = options.strain_per_step();
    let [smallest, largest] = options.strain_per_step_bounds();
    problem.error_control = options.error.map(|error| ErrorControl { error, smallest, largest });
    Ok(problem)
}

fn mesh(scene: &Scene) -> anyhow::Result<Mesh> {
    let [aspect, slant, taper] = scene.shape;
    let [x, y, z] = scene.elements;
    let block = match z {
        0 => Block::plane([1.0, aspect], [x, y], scene.kind),
        _ => Block::space([1.0, aspect, 1.0], scene.elements, scene.kind),
    };
    let mut mesh = block.mesh()?;
    for node in &mut mesh.nodes {
        // Platens stay level; sides lean over and come together.
        node[0] = 0.5 + (node[0] - 0.5) * (1.0 - taper * node[1] / aspect) + slant * node[1];
    }
    Ok(mesh)
}

fn conditions(scene: &Scene) -> Vec<Condition> {
    let is_plane = scene.elements[2] == 0;
    let aspect = scene.shape[0];
    let platen = |nodes: &str, displacement| Condition::Platen {
        nodes: nodes.into(),
        contact: Platen::Smooth,
        axis: Axis::Y,
        displacement,
    };
    let side = |sides: &str| Condition::Pressure {
        sides: sides.into(),
        value: scene.pressure,
        kind: PressureKind::Follower,
    };
    let mut conditions = vec![side("left"), side("right")];
    if !is_plane {
        conditions.extend([side("back"), side("front")]);
    }
    let fixed = |nodes: &str, axes: &[Axis]| -> Vec<Condition> {
        axes.iter().map(|&axis| Condition::fixed(nodes, axis)).collect()
    };
    if scene.loading == Loading::Compression {
        conditions.push(platen("bottom", 0.0));
        conditions.push(platen("top", -scene.strain * aspect));
        conditions.extend(match is_plane {
            true => fixed("bottom_left", &[Axis::X]),
            // No motion along the platens and no turn about their normal.
            false => {
                [fixed("bottom_left_back", &[Axis::X, Axis::Z]), fixed("bottom_right_back", &[Axis::Z])].concat()
            }
        });
        return conditions;
    }
    let lateral: &[Axis] = if is_plane { &[] } else { &[Axis::Z] };
    for nodes in ["bottom", "top"] {
        conditions.extend(fixed(nodes, &[&[Axis::Y], lateral].concat()));
    }
    conditions.extend(fixed("bottom", &[Axis::X]));
    conditions.push(Condition::Displacement { nodes: "top".into(), axis: Axis::X, value: scene.strain * aspect });
    conditions
}

/// The problem of the shipped scene, at the scene's own pressure and strain.
fn head(scene: &Scene) -> anyhow::Result<Problem> {
    let folder = tempfile::tempdir()?;
    let (file, packing) = (folder.path().join("head.toml"), folder.path().join("packing.json"));
    std::fs::write(&packing, PACKING)?;
    std::fs::write(&file, HEAD.replace("../packings/spheres-100.json", "packing.json"))?;
    let height = 0.01;
    let overrides = [
        format!("rigid_body.0.displacement.x={}", scene.strain * height),
        format!("pressure.0.value={}", scene.pressure),
    ];
    let read = scene_reader::Scene::load(&file, &overrides).map_err(|error| anyhow::anyhow!("{error:#}"));
    Ok(read.context("the shipped scene")?.problem)
}
