//! Small scenes: one or a few elements, badly shaped, over packings and laws drawn at random, with workers in this process.

use super::case::{Range, sampled_contact};
use super::packings::Slot;
use super::random_stream::{Purpose, RandomStream};
use crate::newton::case::{STABILISATION, StrategyRun, side_by_side, solve_on_grains};
use crate::report::Report;
use crate::table::{Cell, Table};
use macro_solver::formulation::Formulation;
use macro_solver::mesh::ElementKind;
use macro_solver::mesh::block::Block;
use macro_solver::observer::Outcome;
use macro_solver::problem::{Axis, Condition, Criteria, Platen, PressureKind, Problem, Tolerances};
use protocol::Definition;
use rve_server::definition::{Accuracy, GrainDefinition, Packing, RveOptions};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Grains of the largest packing behind a Gauss point.
const LARGEST: usize = 200;

/// Elements of a scene along x and y.
const ELEMENTS: [[usize; 2]; 4] = [[1, 1], [2, 1], [1, 2], [2, 2]];

/// What is done to a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Loading {
    /// Between smooth platens.
    Compression,
    /// Between rough platens, one of which moves sideways.
    Shear,
}

/// One small scene.
struct Scene {
    number: u64,
    range: Range,
    slot: usize,
    kind: ElementKind,
    elements: [usize; 2],
    formulation: Formulation,
    loading: Loading,
    /// Strain, or angle of shear, over the whole path.
    strain: f64,
    steps: usize,
    /// Height over width, slant of the sides, narrowing towards the top.
    shape: [f64; 3],
    definition: GrainDefinition,
}

/// Runs `count` small scenes, several at a time, and reports how they ended.
///
/// # Errors
/// A shipped packing cannot be read, or the report cannot be written.
pub(super) fn run(seed: u64, count: u64, slots: &[Slot], report: &mut Report) -> anyhow::Result<()> {
    if count == 0 {
        return Ok(());
    }
    let scenes: Vec<Scene> = (0..count).map(|number| sampled(seed, number, slots)).collect::<anyhow::Result<_>>()?;
    let findings = side_by_side(scenes.len(), |place| catch_unwind(AssertUnwindSafe(|| solved(&scenes[place]))));
    let mut table = Table::new([
        "scene",
        "range",
        "packing",
        "element",
        "elements",
        "formulation",
        "loading",
        "strain",
        "aspect",
        "slant",
        "taper",
        "class",
        "steps",
        "reached_%",
        "cut_backs",
        "stabilised_steps",
        "evaluations",
        "not_at_rest",
        "wall_s",
    ]);
    for (scene, found) in scenes.iter().zip(findings) {
        let (class, costs) = match &found {
            Err(_) => ("panicked".to_owned(), [(); 7].map(|()| Cell::from(f64::NAN))),
            Ok(Err(error)) => (format!("broke off: {error:#}"), [(); 7].map(|()| Cell::from(f64::NAN))),
            Ok(Ok(finding)) => (class(finding), costs(finding)),
        };
        let [steps, reached, cut_backs, stabilisation, evaluations, not_at_rest, wall] = costs;
        let [aspect, slant, taper] = scene.shape;
        table.row([
            scene.number.into(),
            scene.range.name().into(),
            slots[scene.slot].name.as_str().into(),
            scene.kind.keyword().into(),
            format!("{} x {}", scene.elements[0], scene.elements[1]).into(),
            format!("{:?}", scene.formulation).into(),
            format!("{:?}", scene.loading).into(),
            scene.strain.into(),
            aspect.into(),
            slant.into(),
            taper.into(),
            class.into(),
            steps,
            reached,
            cut_backs,
            stabilisation,
            evaluations,
            not_at_rest,
            wall,
        ]);
    }
    Ok(report.table("scenes", "small scenes of finite elements", &table)?)
}

fn sampled(seed: u64, number: u64, slots: &[Slot]) -> anyhow::Result<Scene> {
    let stream = &mut RandomStream::new(seed, Purpose::Scene(number));
    let range = if stream.chance(0.5) { Range::Everyday } else { Range::Hard };
    let may =
        |slot: &Slot| slot.dimension == 2 && slot.number <= LARGEST && (slot.is_everyday || range == Range::Hard);
    let places: Vec<usize> = (0..slots.len()).filter(|place| may(&slots[*place])).collect();
    let slot = stream.pick(&places);
    let loading = if stream.chance(0.5) { Loading::Compression } else { Loading::Shear };
    let is_everyday = range == Range::Everyday;
    let shape = match range {
        Range::Everyday => [stream.between(0.5, 2.0), 0.0, 0.0],
        Range::Hard => [stream.decades(0.1, 10.0), stream.between(-1.0, 1.0), stream.between(0.0, 0.6)],
    };
    let strain = match (loading, is_everyday) {
        (Loading::Compression, true) => 0.01,
        (Loading::Compression, false) => stream.between(0.01, 0.05),
        (Loading::Shear, true) => 0.02,
        (Loading::Shear, false) => stream.between(0.05, 0.3),
    };
    let options = RveOptions { accuracy: Accuracy::Draft, ..RveOptions::default() };
    let contact = sampled_contact(range, &slots[slot], stream);
    let Packing::Discs(packing) = slots[slot].packing()? else {
        anyhow::bail!("small scenes stand in the plane");
    };
    Ok(Scene {
        number,
        range,
        slot,
        kind: stream.pick(&[
            ElementKind::Q4,
            ElementKind::Q8,
            ElementKind::T3,
            ElementKind::T6,
            ElementKind::Q4Single,
        ]),
        elements: stream.pick(&ELEMENTS),
        formulation: match range {
            Range::Everyday => Formulation::UpdatedLagrangian,
            Range::Hard => stream.pick(&[
                Formulation::TotalLagrangian,
                Formulation::UpdatedLagrangian,
                Formulation::Corotational,
            ]),
        },
        loading,
        strain,
        steps: if is_everyday { 10 } else { 8 + stream.below(8) },
        shape,
        definition: GrainDefinition { packing, contact, options }.validate()?,
    })
}

fn solved(scene: &Scene) -> anyhow::Result<StrategyRun> {
    let definition: Definition = scene.definition.to_protocol();
    solve_on_grains(&problem(scene)?, &[definition])
}

fn problem(scene: &Scene) -> anyhow::Result<Problem> {
    let [aspect, slant, taper] = scene.shape;
    let mut mesh = Block::plane([1.0, aspect], scene.elements, scene.kind).mesh()?;
    for node in &mut mesh.nodes {
        // Platens stay level; sides lean over and come together.
        node[0] = 0.5 + (node[0] - 0.5) * (1.0 - taper * node[1] / aspect) + slant * node[1];
    }
    let pressure = 1e5;
    let platen = |nodes: &str, contact, displacement| Condition::Platen {
        nodes: nodes.into(),
        contact,
        axis: Axis::Y,
        displacement,
    };
    let side =
        |sides: &str| Condition::Pressure { sides: sides.into(), value: pressure, kind: PressureKind::Follower };
    let mut conditions = vec![side("left"), side("right")];
    match scene.loading {
        Loading::Compression => {
            conditions.push(platen("bottom", Platen::Smooth, 0.0));
            conditions.push(platen("top", Platen::Smooth, -scene.strain * aspect));
            conditions.push(Condition::fixed("bottom_left", Axis::X));
        }
        Loading::Shear => {
            for nodes in ["bottom", "top"] {
                conditions.push(Condition::fixed(nodes, Axis::Y));
            }
            conditions.push(Condition::fixed("bottom", Axis::X));
            conditions.push(Condition::Displacement {
                nodes: "top".into(),
                axis: Axis::X,
                value: scene.strain * aspect,
            });
        }
    }
    let mut problem = Problem::new(mesh, conditions);
    problem.formulation = scene.formulation;
    let stage = &mut problem.stages[0];
    stage.control.increments = scene.steps;
    stage.control.min = 1.0 / (64 * scene.steps) as f64;
    stage.control.max_iterations = 25;
    stage.control.stabilisation = STABILISATION;
    stage.tolerances = Tolerances { force: 1e-2, criteria: Criteria::FORCE_OVER_REACTIONS, ..Tolerances::default() };
    problem.strain_per_step = scene.definition.options.strain_per_step();
    Ok(problem)
}

fn class(finding: &StrategyRun) -> String {
    if finding.steps.iter().any(|step| !step.ratio.is_finite()) {
        return "not finite".to_owned();
    }
    match &finding.run.outcome {
        Outcome::Refused(error) => format!("refused: {error}"),
        Outcome::DidNotConverge { reason } => format!("did not converge: {reason}"),
        _ => finding.end().to_owned(),
    }
}

fn costs(finding: &StrategyRun) -> [Cell; 7] {
    let statistics = &finding.run.statistics;
    [
        statistics.steps.into(),
        (100.0 * finding.run.load).into(),
        statistics.cut_backs.into(),
        statistics.stabilised_steps.into(),
        statistics.evaluations.into(),
        (statistics.flags.not_equilibrated + statistics.unfinished_trials).into(),
        finding.wall.into(),
    ]
}
