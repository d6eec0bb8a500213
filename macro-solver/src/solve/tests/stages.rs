//! Several stages: what holds over a stage, histories, and going on within and between stages to the same bits.

use super::*;
use crate::checkpoint::{Archive, CheckpointStore, Progress};
use crate::observer::Outcome;
use crate::problem::{Amplitude, Applied, Origin, Platen, PressureKind, ProblemError, Stage};
use crate::solve::solve_with_checkpoints;

const PRESSURE: f64 = 1e5;

fn platen(nodes: &str, displacement: f64) -> Condition {
    Condition::Platen { nodes: nodes.into(), contact: Platen::Smooth, axis: Axis::Y, displacement }
}

fn pressure(sides: &str) -> Condition {
    Condition::Pressure { sides: sides.into(), value: PRESSURE, kind: PressureKind::Follower }
}

/// Isotropic compression to 100 kPa by pressures, then the top moves down while the sides stay loaded.
fn compression_and_shear() -> Problem {
    let supports = || [Applied::from(Condition::fixed("bottom_left", Axis::X)), Applied::from(platen("bottom", 0.0))];
    let mut problem = Problem::new(block(ElementKind::Q8, 2, 2), Vec::new());
    let ramped = |sides: &str| Applied::new(pressure(sides), Amplitude::RAMP);
    let first = supports().into_iter().chain(["left", "right", "top"].map(ramped)).collect();
    let second =
        supports().into_iter().chain([platen("top", -0.02), pressure("left"), pressure("right")].map(Into::into));
    problem.stages = vec![Stage::new("compression", first), Stage::new("shear", second.collect())];
    for (stage, (increments, duration)) in problem.stages.iter_mut().zip([(2, 10.0), (3, 0.5)]) {
        (stage.control.increments, stage.duration, stage.tolerances) = (increments, duration, TIGHT);
    }
    problem
}

fn stress(record: &Recorder) -> [[f64; 2]; 2] {
    record.points[3].stress.plane()
}

#[test]
fn compression_then_shear_is_one_run_with_steps_counted_through() {
    let problem = compression_and_shear();
    let mut material = elastic(ElasticLaw::SmallStrain, &problem);
    let (finished, record) = run(&problem, &mut material);
    assert!(matches!(finished.outcome, Outcome::Completed), "{:?}", finished.outcome);
    assert_eq!((finished.stage, finished.load, finished.statistics.steps), (1, 1.0, 5));
    let steps: Vec<_> = record.steps.iter().map(|step| (step.step, step.stage, step.load)).collect();
    let thirds = [1.0 / 3.0, 2.0 / 3.0];
    assert_eq!(steps, [(0, 0, 0.0), (1, 0, 0.5), (2, 0, 1.0), (3, 1, thirds[0]), (4, 1, thirds[1]), (5, 1, 1.0)]);
    let times: Vec<f64> = record.steps.iter().map(|step| step.time).collect();
    assert!(
        times
            .iter()
            .zip([0.0, 5.0, 10.0, 10.0 + 0.5 / 3.0, 10.0 + 1.0 / 3.0, 10.5])
            .all(|(a, b)| (a - b).abs() < 1e-12)
    );
    assert_eq!((record.steps[2].share, record.steps[5].share), (0.5, 1.0));
    assert_eq!(record.stages, ["compression", "shear"]);
    assert_eq!(finished.statistics.symbolic_factorizations, 2, "one for the equations of each stage");
    // The pressure of the sides has stayed, within the change of their length; the top has been pushed further.
    let [[xx, _], [_, yy]] = stress(&record);
    assert!((xx / -PRESSURE - 1.0).abs() < 0.03, "{xx}");
    let shortened = 0.5 * PRESSURE / 2.0e7;
    let top = problem.mesh.node_sets["top"].iter().map(|&node| record.displacements[node][1]);
    for moved in top {
        assert!((moved + 2.0 * shortened + 0.02).abs() < 2e-4, "from where the stage found it: {moved}");
    }
    // Plane stress of a small strain: sigma_yy = -p + E' eps_yy with E' = 4 G K / (K + G).
    let stiffness = 4.0 * 1e7 * 2e7 / 3e7;
    assert!((yy + PRESSURE + stiffness * 0.01 / (1.0 - shortened)).abs() < 0.03 * stiffness * 0.01, "{yy}");
}

/// Takes steps until the store has seen `stop` of them, then stops; hands out what was kept.
#[derive(Default)]
pub(super) struct Shelf {
    pub(super) earlier: Option<Archive>,
    pub(super) kept: Vec<(Progress, Archive)>,
}

impl CheckpointStore for Shelf {
    fn earlier(&mut self) -> Option<Archive> {
        self.earlier.take()
    }

    fn save_step(&mut self, mark: Progress, fill: &mut dyn FnMut(&mut Archive)) {
        let mut archive = Archive::new();
        fill(&mut archive);
        self.kept.push((mark, archive));
    }
}

#[test]
fn a_run_goes_on_within_and_between_stages_to_the_same_bits() {
    let problem = compression_and_shear();
    let mut shelf = Shelf::default();
    let mut whole = Recorder::default();
    let undisturbed =
        solve_with_checkpoints(&problem, &mut elastic(ElasticLaw::SaintVenant, &problem), &mut whole, &mut shelf);
    assert_eq!(shelf.kept.len(), 6);
    let marks: Vec<(u64, u64)> = shelf.kept.iter().map(|(mark, _)| (mark.step, mark.stage)).collect();
    assert_eq!(marks, [(0, 0), (1, 0), (2, 0), (3, 1), (4, 1), (5, 1)]);
    for (mark, archive) in shelf.kept {
        let mut rest = Recorder::default();
        let mut shelf = Shelf { earlier: Some(archive), ..Shelf::default() };
        let mut material = elastic(ElasticLaw::SaintVenant, &problem);
        let resumed = solve_with_checkpoints(&problem, &mut material, &mut rest, &mut shelf);
        assert_eq!((resumed.stage, resumed.load), (1, 1.0));
        assert_eq!(resumed.statistics.symbolic_factorizations, undisturbed.statistics.symbolic_factorizations);
        assert_eq!(resumed.statistics.numeric_factorizations, undisturbed.statistics.numeric_factorizations);
        if mark.step < 5 {
            assert_eq!(rest.steps[..], whole.steps[mark.step as usize + 1..]);
            assert_eq!((&rest.displacements, &rest.reactions), (&whole.displacements, &whole.reactions));
            assert_eq!(rest.points, whole.points);
        }
    }
}

/// A bar under a traction: ramped up, kept, and taken back by a history; displacements follow the force.
#[test]
fn weight_stays_on_and_histories_lead_forces_and_displacements() {
    let held =
        || [Applied::from(Condition::fixed("bottom", Axis::Y)), Applied::from(Condition::fixed("left", Axis::X))];
    let weight = Condition::BodyForce { elements: "all".into(), value: [0.0, -1e3, 0.0] };
    let pulled = Condition::Traction { sides: "top".into(), value: [0.0, 1e4, 0.0] };
    let cycle = Amplitude::Sine { frequency: 1.0, phase: 0.0 };
    let table = Amplitude::Table(vec![[0.0, 0.0], [0.5, 2.0], [1.0, 1.0]]);
    let mut problem = Problem::new(block(ElementKind::Q4, 1, 1), Vec::new());
    let top = |value| Condition::Displacement { nodes: "top".into(), axis: Axis::Y, value };
    let back = Applied { condition: top(0.0), history: Amplitude::RAMP, origin: Origin::Run };
    let weighted = |name, history, more: Option<Applied>| {
        let weight = Applied::new(weight.clone(), history);
        Stage::new(name, held().into_iter().chain([weight]).chain(more).collect())
    };
    problem.stages = vec![
        weighted("gravity", Amplitude::RAMP, None),
        weighted("pull", Amplitude::Constant, Some(Applied::new(pulled, table))),
        weighted("cycle", Amplitude::Constant, Some(Applied::new(top(1e-3), cycle))),
        weighted("back", Amplitude::Constant, Some(back)),
    ];
    for stage in &mut problem.stages {
        (stage.control.increments, stage.tolerances) = (4, TIGHT);
    }
    let mut watch = Watch::default();
    let outcome = solve(&problem, &mut elastic(ElasticLaw::SmallStrain, &problem), &mut watch).outcome;
    assert!(matches!(outcome, Outcome::Completed), "{outcome:?}");
    let near = |step: usize, load: f64| {
        let found = watch.bottom[step];
        assert!((found - load).abs() < 1e-3 * load.abs().max(1.0), "step {step}: {found} instead of {load}");
    };
    (1..=4).for_each(|step| near(step, 1e3 * step as f64 / 4.0));
    // Pulled by 1, 2, 1.5, 1 times 1e4 N.
    [1.0, 2.0, 1.5, 1.0].iter().enumerate().for_each(|(step, factor)| near(5 + step, 1e3 - 1e4 * factor));
    let start = watch.top[8];
    for (step, factor) in [1.0, 0.0, -1.0, 0.0].into_iter().enumerate() {
        assert!((watch.top[9 + step] - start - 1e-3 * factor).abs() < 1e-15, "sine");
    }
    assert!(
        watch.top[16].abs() < 1e-18 && watch.top[14] != 0.0,
        "back to where the run began: {:?}",
        &watch.top[12..]
    );
}

/// Reaction of the bottom along y and displacement of the top, at every step.
#[derive(Default)]
struct Watch {
    bottom: Vec<f64>,
    top: Vec<f64>,
}

impl Observer for Watch {
    fn accepted(&mut self, _: &StepReport, view: &FieldsView<'_>) -> Result<(), StopRequest> {
        self.bottom.push(view.mesh.node_sets["bottom"].iter().map(|&node| view.reactions[node][1]).sum());
        self.top.push(view.displacements[view.mesh.node_sets["top"][0]][1]);
        Ok(())
    }
}

#[test]
fn a_defect_names_its_stage() {
    let mut problem = compression_and_shear();
    problem.stages[1].conditions.remove(0);
    match problem.validate() {
        Err(ProblemError::Stage { number: 1, stage, error }) => {
            assert!(stage == "shear" && matches!(*error, ProblemError::RigidMotion { .. }));
        }
        other => panic!("{other:?}"),
    }
    problem = compression_and_shear();
    problem.stages[0].conditions[2].history = Amplitude::Table(Vec::new());
    let text = problem.validate().unwrap_err().to_string();
    assert!(text.starts_with("stage 'compression': ") && text.contains("at least one point"), "{text}");
    problem.stages.clear();
    assert_eq!(problem.validate(), Err(ProblemError::NoStage));
}
