//! The initial state of a run: the stress of its packing, and whether the loads of the first step are in equilibrium with it.
//!
//! A packing has the stress it was prepared under. Initial loads that need another stress act on the grains at once, before the
//! first step; most often no equilibrium is found.

use crate::exit::{Exit, Failure};
use macro_solver::material::{MaterialError, PointId, PointMaterial, PointTrial};
use macro_solver::mesh::{Dimension, Mesh, point_places};
use macro_solver::observer::Silent;
use macro_solver::problem::{Amplitude, Condition, Moment, Problem, Procedure, Stage};
use macro_solver::solve::solve;
use protocol::{Cost, Observables, Observed, Scalars, TangentKind, Tensor2, Tensor4, TrialFlags, TrialResult};
use rve_server::definition::{AnyDefinition, GrainDefinition};
use rve_server::engine::{GrainRve, ListedForces};
use rve_server::homogenization::fabric::LARGE_OVERLAP_RATIO;
use rve_server::solver::SolverFor;
use scene_reader::Scene;
use std::collections::{BTreeMap, BTreeSet};

/// Out-of-balance force over the loads above which packing and loads do not match. Regions of weakened or turned cells stay
/// below it; a load of half the packing pressure is far above.
pub(crate) const MISMATCH: f64 = 0.1;

/// Largest over smallest radius above which a packing is likely to mix units.
const WIDEST_GRADING: f64 = 1e3;

/// Coefficient of friction, of 72 degrees, above which an angle was probably given.
const LARGEST_FRICTION: f64 = 3.0;

/// Meshes with more points are not assembled for a check.
const MOST_POINTS: usize = 50_000;

/// Side sets that are named one by one.
const MOST_SETS: usize = 8;

/// A packing as given, before any grain has moved.
#[derive(Clone, Debug)]
pub(crate) struct PackingState {
    /// Stress, Pa, tension positive.
    pub(crate) stress: Tensor2,
    /// Space dimension of the packing.
    pub(crate) dimension: usize,
    /// Density, contacts and overlaps.
    pub(crate) scalars: Scalars,
    /// Coordination number without rattlers.
    pub(crate) coordination_no_rattlers: f64,
    /// How many of the tangential forces in its file could be used.
    pub(crate) listed_forces: ListedForces,
    /// Largest over smallest radius.
    pub(crate) radius_ratio: f64,
    /// Coefficient of friction of the contact law.
    pub(crate) friction: f64,
    /// Whether it holds together and is far from equilibrium under the contact law.
    pub(crate) is_far_from_rest: bool,
}

impl PackingState {
    /// The state of the packing of a definition.
    ///
    /// # Errors
    /// Forces that are not finite.
    pub(crate) fn of(definition: &AnyDefinition) -> Result<Self, Failure> {
        match definition {
            AnyDefinition::Discs(discs) => Self::of_cell(discs, discs.packing.grains.iter().map(|grain| grain[2])),
            AnyDefinition::Spheres(spheres) => {
                Self::of_cell(spheres, spheres.packing.grains.iter().map(|grain| grain[3]))
            }
        }
    }

    fn of_cell<S: SolverFor>(
        definition: &GrainDefinition<S>,
        radii: impl Iterator<Item = f64>,
    ) -> Result<Self, Failure> {
        let refused = |error| Failure::new(Exit::BadInput, error);
        let mut cell = GrainRve::new(definition).map_err(refused)?;
        let answer = cell.observe(Observables::ALL).map_err(refused)?;
        let (smallest, largest) =
            radii.fold((f64::INFINITY, 0.0f64), |(low, high), radius| (low.min(radius), high.max(radius)));
        Ok(Self {
            stress: answer.stress,
            dimension: S::DIMENSION,
            scalars: answer.scalars,
            coordination_no_rattlers: answer.observed.coordination_number_no_rattlers,
            listed_forces: cell.listed_forces(),
            radius_ratio: largest / smallest,
            friction: definition.contact.friction,
            is_far_from_rest: cell.is_far_from_rest(&answer),
        })
    }

    /// Whether no chain of contacts spans the cell.
    pub(crate) fn carries_no_load(&self) -> bool {
        self.coordination_no_rattlers == 0.0 || self.stress.0.iter().all(|component| *component == 0.0)
    }

    /// Mean pressure, Pa, compression positive: over the axes of the packing.
    fn pressure(&self) -> f64 {
        pressure_of(&self.stress, self.dimension)
    }

    /// The stress tensor and its mean for people.
    pub(crate) fn stress_text(&self) -> String {
        let names = ["xx", "yy", "zz"];
        let direct = names.iter().enumerate().take(self.dimension).map(|(axis, name)| (*name, 4 * axis));
        let shear = [("xy", 1), ("xz", 2), ("yz", 5)].into_iter().take(if self.dimension == 2 { 1 } else { 3 });
        let parts: Vec<String> =
            direct.chain(shear).map(|(name, place)| format!("{name} {:.3e}", self.stress.0[place])).collect();
        format!("{} Pa (tension positive), mean pressure {:.3e} Pa", parts.join(", "), self.pressure())
    }

    /// Density and contacts for people.
    pub(crate) fn state_text(&self) -> String {
        format!(
            "void ratio {:.4}, coordination number {:.3} ({:.3} without rattlers), largest overlap {:.1e} of a diameter",
            self.scalars.void_ratio,
            self.scalars.coordination_number,
            self.coordination_no_rattlers,
            self.scalars.max_overlap_ratio
        )
    }

    /// What the contact law does not take over of the equilibrium in which the packing was written, one line each.
    pub(crate) fn remarks_on_the_law(&self) -> Vec<String> {
        let unrest = self.is_far_from_rest.then(|| {
            format!(
                "the grains are far from rest under this contact law, unbalanced forces reach {:.2} of the mean contact force: the first \
                 increment begins with their motion. Prepare the packing under the law of the scene (`grainspan pack`)",
                self.scalars.unbalanced_force_ratio
            )
        });
        self.listed_forces.warning().into_iter().chain(unrest).collect()
    }

    /// Warnings, one line each.
    pub(crate) fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        if self.carries_no_load() {
            remarks.push(
                "the packing carries no load: no chain of contacts spans the cell; the stiffness of a run would be singular. Prepare one with `grainspan pack`"
                    .to_owned(),
            );
        }
        if self.scalars.max_overlap_ratio > LARGE_OVERLAP_RATIO {
            remarks.push(format!(
                "grains overlap by {:.2} of a diameter: wrong units, a modulus that is too small, or another contact law than the \
                 packing was made with",
                self.scalars.max_overlap_ratio
            ));
        }
        if self.friction > LARGEST_FRICTION {
            remarks.push(format!(
                "contact.friction = {} is the coefficient of friction, the tangent of the angle, not the angle",
                self.friction
            ));
        }
        if self.radius_ratio > WIDEST_GRADING {
            let ratio = self.radius_ratio;
            remarks.push(format!(
                "the largest grain is {ratio:.1e} times the smallest: is one of them given in other units?"
            ));
        }
        remarks
    }
}

/// A description of the difference between the stress at the start and the loads of the first step. `None` if they match, or if
/// the first stage is a motion whose imbalance is not limited: loads may set it off.
pub(crate) fn mismatch(scene: &Scene, packing: &PackingState) -> Option<String> {
    let imbalance = imbalance(scene)?;
    if imbalance <= MISMATCH {
        return None;
    }
    Some(match scene.preparation() {
        Some(_) => format!(
            "initial residual {imbalance:.1e} (relative to applied loads): the stress that [initial_stress] brings the cells to is not in \
             balance with the initial loads; unit weight, body force and pressures on the surface belong together"
        ),
        None => comparison(scene, packing, imbalance),
    })
}

/// The stress of the packing, those of other packings in use, and the initial loads.
fn comparison(scene: &Scene, packing: &PackingState, imbalance: f64) -> String {
    let stresses = stresses_of_packings(scene).unwrap_or_default();
    let mut others: Vec<f64> = stresses
        .iter()
        .map(|stress| pressure_of(stress, packing.dimension))
        .filter(|pressure| (pressure - packing.pressure()).abs() > MISMATCH * packing.pressure().abs())
        .collect();
    others.sort_by(f64::total_cmp);
    let others = match (others.first(), others.last()) {
        (Some(least), Some(most)) => format!(
            "; {} of {} Gauss points have packings of regions with mean pressures of {least:.3e} to {most:.3e} Pa",
            others.len(),
            stresses.len()
        ),
        _ => String::new(),
    };
    format!(
        "initial residual {imbalance:.1e} (relative to applied loads): the packing has the stress {}{others}; {}",
        packing.stress_text(),
        initial_loads(&scene.problem, &stresses)
    )
}

/// Remedy if loads and packing do not match, and cells are not prepared.
const REMEDY: &str = "make the pressures those that the packing has, or start at the stress of the packing (pressures are constant from \
                      the first step on unless a history says otherwise) and apply the loads in a stage of its own (history = \"ramp\"), or prepare \
                      another packing with `grainspan pack`; `grainspan check` compares both";

/// Remedy if loads and stress at the start do not match.
pub(crate) fn remedy(scene: &Scene) -> &'static str {
    if scene.preparation().is_some() {
        "give the body force and the pressures that carry the stress of [initial_stress] with history = \"constant\" from the first \
         stage on, or correct `geostatic`; `grainspan check` compares both"
    } else {
        REMEDY
    }
}

/// Out-of-balance force of the stress at the start under the initial loads, over the loads or reactions; `None` where the
/// first stage is a motion without a limit of it, or the mesh is too large to be assembled for a check.
fn imbalance(scene: &Scene) -> Option<f64> {
    let mut problem = scene.problem.clone();
    let first = problem.stages.first()?;
    let may_move =
        matches!(first.procedure, Procedure::Dynamic(_)) && problem.initial.limits.largest_imbalance.is_none();
    if may_move || problem.point_count() > MOST_POINTS {
        return None;
    }
    let stresses = match (&problem.initial.expected, scene.preparation()) {
        (Some(expected), Some(_)) => {
            let at = |(point, place): (usize, &[f64; 3])| {
                let stress = expected.at(point, *place);
                Tensor2(std::array::from_fn(|entry| stress[(entry / 3, entry % 3)]))
            };
            point_places(&problem.mesh).iter().enumerate().map(at).collect()
        }
        _ => stresses_of_packings(scene)?,
    };
    // With this limit any residual ends the run after its first evaluation.
    problem.initial.limits.largest_imbalance = Some(0.0);
    let mut material = AsGiven { stresses, evaluated: false };
    let run = solve(&problem, &mut material, &mut Silent);
    Some(run.statistics.initial_imbalance)
}

/// The stress of the packing of every Gauss point.
fn stresses_of_packings(scene: &Scene) -> Option<Vec<Tensor2>> {
    let of_definition: Option<Vec<Tensor2>> = scene
        .materials
        .definitions
        .iter()
        .map(|one| PackingState::of(one).ok().map(|packing| packing.stress))
        .collect();
    let of_definition = of_definition?;
    Some(scene.materials.made_of.iter().map(|&kind| of_definition[kind]).collect())
}

/// A material with the given stress at every Gauss point, for a single evaluation.
struct AsGiven {
    stresses: Vec<Tensor2>,
    evaluated: bool,
}

impl PointMaterial for AsGiven {
    fn evaluate(&mut self, trials: &[PointTrial]) -> Result<Vec<TrialResult>, MaterialError> {
        if std::mem::replace(&mut self.evaluated, true) {
            return Err(MaterialError::Interrupted);
        }
        let result = |trial: &PointTrial| TrialResult {
            stress: self.stresses[trial.point],
            tangent: (trial.options.tangent != TangentKind::None).then(|| Box::new(Tensor4::ZERO)),
            scalars: Scalars::default(),
            observed: Observed::default(),
            cost: Cost::default(),
            flags: TrialFlags::default(),
        };
        Ok(trials.iter().map(result).collect())
    }

    fn commit(&mut self) -> Result<(), MaterialError> {
        Ok(())
    }

    fn rollback(&mut self) {}

    fn mark(&mut self) {}

    fn return_to_mark(&mut self) {}

    fn copy_state(&mut self, from: PointId, to: PointId) {
        self.stresses[to] = self.stresses[from];
    }
}

/// The initial loads and the free faces, set by set, with the pressure of the packings on each: those that differ if any do.
fn initial_loads(problem: &Problem, stresses: &[Tensor2]) -> String {
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

/// Mean pressure of a stress over the axes of a packing, Pa, compression positive.
fn pressure_of(stress: &Tensor2, dimension: usize) -> f64 {
    -(0..dimension).map(|axis| stress.0[4 * axis]).sum::<f64>() / dimension as f64
}

/// Pressure of the stresses of the points next to a side set along its mean normal, Pa; `None` for a set without one.
fn pressed(mesh: &Mesh, set: &str, stresses: &[Tensor2]) -> Option<f64> {
    let mut normal = [0.0f64; 3];
    let mut stress = [0.0; 9];
    let firsts = mesh.first_points();
    let sides = mesh.side_sets.get(set)?;
    for side in sides {
        let near = stresses.get(firsts[side.element])?;
        stress.iter_mut().zip(near.0).for_each(|(sum, part)| *sum += part / sides.len() as f64);
        let nodes = mesh.side_nodes(*side);
        let from = mesh.nodes[nodes[0]];
        let to =
            |place: usize| -> [f64; 3] { std::array::from_fn(|axis| mesh.nodes[nodes[place]][axis] - from[axis]) };
        let along = to(1);
        let outward = match mesh.dimension {
            Dimension::Plane => [along[1], -along[0], 0.0],
            Dimension::Space => {
                let across = to(2);
                std::array::from_fn(|axis| {
                    let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
                    along[next] * across[last] - along[last] * across[next]
                })
            }
        };
        normal.iter_mut().zip(outward).for_each(|(sum, part)| *sum += part);
    }
    let length = normal.iter().map(|part| part * part).sum::<f64>().sqrt();
    let tension: f64 = (0..3)
        .flat_map(|i| (0..3).map(move |j| (i, j)))
        .map(|(i, j)| normal[i] * stress[3 * i + j] * normal[j])
        .sum();
    // Sides around a hole have no direction in common.
    (length > 0.0).then(|| 0.0 - tension / (length * length))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn scene(file: &str, overrides: &[&str]) -> Scene {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(file);
        Scene::load(&path, &overrides.iter().map(|&given| given.to_owned()).collect::<Vec<_>>()).unwrap()
    }

    fn text_of(scene: &Scene) -> Option<String> {
        mismatch(scene, &PackingState::of(scene.definition()).unwrap())
    }

    #[test]
    fn loads_that_do_not_match_the_packing_are_named_with_both_stresses() {
        assert_eq!(text_of(&scene("biaxial-small.toml", &[])), None);
        let text = text_of(&scene("biaxial-small.toml", &["pressure.0.value=2e5", "pressure.1.value=2e5"])).unwrap();
        for part in ["xx -1.000e5", "yy -1.000e5", "2.000e5 Pa on left (the packing has 1.000e5)"] {
            assert!(text.contains(part), "'{part}' is missing in: {text}");
        }
        let text = text_of(&scene("biaxial-small.toml", &["pressure.1.value=-1e5"])).unwrap();
        assert!(text.contains("-1.000e5 Pa on right"), "{text}");
    }

    /// A face without a condition has a pressure of 0.
    #[test]
    fn free_faces_are_named() {
        let text = text_of(&scene("biaxial-small.toml", &["pressure=[]"])).unwrap();
        assert!(text.contains("0.000e0 Pa on left (the packing has 1.000e5)"), "{text}");
        assert!(!text.contains("on bottom"), "a held face is not free: {text}");
    }

    /// A set whose sides are loaded by the names of others is not free, and loads that agree are not named among those that differ.
    #[test]
    fn sides_that_other_sets_load_are_not_called_free() {
        let text = text_of(&scene("geotechnics/footing.toml", &["pressure.0.value=3e5"])).unwrap();
        assert!(text.contains("3.000e5 Pa on surface") && !text.contains("on top"), "{text}");
        let text = text_of(&scene("biaxial-small.toml", &["pressure.0.value=2e5"])).unwrap();
        assert!(text.contains("do not agree with it are") && text.contains("2.000e5 Pa on left"), "{text}");
        assert!(!text.contains("on right"), "{text}");
        // Pressures that agree do not make the body force agree.
        let weight = "body_force=[{ set = 'all', value = { y = -1e7 }, history = 'constant' }]";
        let text = text_of(&scene("biaxial-small.toml", &[weight])).unwrap();
        assert!(text.contains("the initial loads are") && text.contains("a body force of"), "{text}");
    }

    #[test]
    fn shipped_scenes_match_their_packings() {
        for file in [
            "biaxial.toml",
            "single-hexahedron-biaxial.toml",
            "compression-shear.toml",
            "single-element.toml",
            "biaxial-weak-element.toml",
        ] {
            assert_eq!(text_of(&scene(file, &[])), None, "{file}");
        }
    }

    #[test]
    fn the_mean_pressure_of_a_packing_of_spheres_is_over_three_axes() {
        let packing = PackingState::of(scene("single-hexahedron-biaxial.toml", &[]).definition()).unwrap();
        let trace: f64 = [0, 4, 8].map(|place| packing.stress.0[place]).iter().sum();
        assert!((packing.pressure() + trace / 3.0).abs() < 1e-9 * packing.pressure());
        assert!(packing.stress_text().contains("zz ") && !packing.carries_no_load());
    }
}
