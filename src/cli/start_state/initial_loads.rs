//! The initial loads of a scene, set by set, for people.

use super::MISMATCH;
use macro_solver::mesh::Mesh;
use macro_solver::problem::{Amplitude, Condition, Moment, Problem, Stage};
use protocol::Tensor2;
use std::collections::{BTreeMap, BTreeSet};

/// Side sets that are named one by one.
const MOST_SETS: usize = 8;

/// The initial loads and the free faces, set by set, with the pressure of the packings on each: those that differ if any do.
pub(super) fn initial_loads(problem: &Problem, stresses: &[Tensor2]) -> String {
    let Some(stage) = problem.stages.first() else { return "there are no initial loads".to_owned() };
    let mut loads: BTreeMap<&str, f64> = BTreeMap::new();
    let mut others = Vec::new();
    for applied in &stage.conditions {
        let factor = at_start(&applied.history);
        match &applied.condition {
            Condition::Pressure { sides, value, .. } => *loads.entry(sides).or_default() += factor * value,
            Condition::Traction { sides, value } => {
                let value = value.map(|component| factor * component);
                others.push(format!(
                    "a traction of ({:.3e}, {:.3e}, {:.3e}) Pa on {sides}",
                    value[0], value[1], value[2]
                ));
            }
            Condition::BodyForce { elements, value } => {
                let value = value.map(|component| factor * component);
                if value.iter().any(|component| *component != 0.0) {
                    others.push(format!(
                        "a body force of ({:.3e}, {:.3e}, {:.3e}) N/m3 in {elements}",
                        value[0], value[1], value[2]
                    ));
                }
            }
            Condition::Displacement { .. }
            | Condition::Platen { .. }
            | Condition::MultiPointConstraint(_)
            | Condition::Friction { .. } => {}
        }
    }
    for free in problem.mesh.side_sets.keys().filter(|set| is_free(&problem.mesh, stage, set)) {
        loads.entry(free).or_insert(0.0);
    }
    let compared: Vec<(&str, f64, Option<f64>)> =
        loads.into_iter().map(|(set, pressure)| (set, pressure, pressed(&problem.mesh, set, stresses))).collect();
    let differs = |&(_, pressure, carried): &(&str, f64, Option<f64>)| {
        carried.is_none_or(|carried| (pressure - carried).abs() > MISMATCH * pressure.abs().max(carried.abs()))
    };
    let some_differ = compared.iter().any(differs);
    let shown = compared.iter().filter(|load| !some_differ || differs(load));
    let pressures = shown.map(|&(set, pressure, carried)| match carried {
        Some(carried) => format!("a pressure of {pressure:.3e} Pa on {set} (the packing has {carried:.3e})"),
        None => format!("a pressure of {pressure:.3e} Pa on {set}"),
    });
    let agree = !some_differ && !compared.is_empty() && others.is_empty();
    let mut parts: Vec<String> = pressures.chain(others).collect();
    let more = parts.len().saturating_sub(MOST_SETS);
    parts.truncate(MOST_SETS);
    let mut text = parts.join(", ");
    if more > 0 {
        text += &format!(" and {more} more");
    }
    if text.is_empty() {
        "there are no initial loads".to_owned()
    } else if some_differ {
        format!("the initial loads that do not agree with it are {text}")
    } else if agree {
        format!(
            "the initial loads agree with it: {text}. What is out of balance lies between regions with different packings, or at \
             supports that do not bear the stress"
        )
    } else {
        format!("the initial loads are {text}")
    }
}

fn at_start(history: &Amplitude) -> f64 {
    history.factor(Moment { load: 0.0, time: 0.0 })
}

/// Whether nothing acts on a side set: no side of it is loaded, and not all of its nodes are held.
fn is_free(mesh: &Mesh, stage: &Stage, set: &str) -> bool {
    let sides = &mesh.side_sets[set];
    let mut nodes: BTreeSet<usize> = sides.iter().flat_map(|side| mesh.side_nodes(*side)).collect();
    for applied in &stage.conditions {
        match &applied.condition {
            Condition::Displacement { nodes: held, .. } | Condition::Platen { nodes: held, .. } => {
                for node in mesh.node_sets.get(held).into_iter().flatten() {
                    nodes.remove(node);
                }
            }
            Condition::Pressure { sides: loaded, .. } | Condition::Traction { sides: loaded, .. } => {
                let loaded = mesh.side_sets.get(loaded);
                if loaded.is_some_and(|loaded| loaded.iter().any(|side| sides.contains(side))) {
                    return false;
                }
            }
            Condition::BodyForce { .. } | Condition::Friction { .. } => {}
            Condition::MultiPointConstraint(_) => return false,
        }
    }
    !nodes.is_empty()
}

/// Pressure of the stresses of the points next to a side set along its mean normal, Pa; `None` for a set without one.
fn pressed(mesh: &Mesh, set: &str, stresses: &[Tensor2]) -> Option<f64> {
    // Sides around a hole have no direction in common.
    let normal = mesh.mean_normal(set)?;
    let firsts = mesh.first_points();
    let sides = mesh.side_sets.get(set)?;
    let mut pressure = 0.0;
    for side in sides {
        let stress = stresses.get(firsts[side.element])?;
        let tension: f64 = (0..3)
            .flat_map(|i| (0..3).map(move |j| (i, j)))
            .map(|(i, j)| normal[i] * stress.get(i, j) * normal[j])
            .sum();
        pressure -= tension / sides.len() as f64;
    }
    Some(pressure)
}
