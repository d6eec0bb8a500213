//! Files that are damaged in every way, and runs that go on from them to the same bits.

use super::*;
use crate::material::PointMaterial;
use crate::material::elastic::{ElasticLaw, ElasticMaterial};
use crate::mesh::ElementKind;
use crate::mesh::block::Block;
use crate::observer::Observer;
use crate::observer::{FieldsView, Outcome, Run, Silent, StepReport, StopRequest};
use crate::problem::{Axis, Condition, NamedStrategy, PathControl, Platen, PressureKind, Problem, Stabilisation};
use crate::solve::tests::stabilisation::{pulled, softening_column, weak_at_the_bottom};
use crate::solve::{solve, solve_with_checkpoints};
use protocol::StateId;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::sync::Arc;
use std::time::Duration;

fn archive(text: &str) -> Archive {
    let mut archive = Archive::new();
    archive.put("part", 3, &(text.to_owned(), -0.0f64, f64::NAN));
    for length in [1usize, 5000, 20] {
        let bytes: Arc<[u8]> = text.bytes().cycle().take(length).collect();
        archive.keep_snapshot(StateId::of(&bytes), &bytes);
    }
    archive
}

fn text_of(archive: &Archive) -> String {
    let (text, zero, nan): (String, f64, f64) = archive.get("part", 3).unwrap();
    assert!(zero.to_bits() == (-0.0f64).to_bits() && nan.is_nan());
    text
}

#[test]
fn checkpoints_belong_to_their_owner_alone() {
    let folder = tempfile::tempdir().unwrap();
    let file = CheckpointFile::in_folder(folder.path());
    let mode = |name: &str| fs::metadata(folder.path().join(name)).unwrap().permissions().mode() & 0o777;
    // What a run that was killed has left behind, made under a mask that forbids nothing.
    let draft = folder.path().join(CheckpointFile::NAMES[2]);
    fs::write(&draft, "cut short").unwrap();
    fs::set_permissions(&draft, fs::Permissions::from_mode(0o666)).unwrap();
    for text in ["first", "second"] {
        file.write(&archive(text)).unwrap();
        assert_eq!(mode("checkpoint.bin"), 0o600, "{text}");
    }
    assert_eq!(mode("checkpoint.previous.bin"), 0o600);
}

/// A run that goes on from the previous checkpoint, since the newest is damaged, keeps the previous one until it has written the next. It put the
/// damaged file in its place.
#[test]
fn a_damaged_checkpoint_never_replaces_a_whole_one() {
    let folder = tempfile::tempdir().unwrap();
    let [current, previous, _] = CheckpointFile::NAMES.map(|name| folder.path().join(name));
    let first = CheckpointFile::in_folder(folder.path());
    for text in ["first", "second"] {
        first.write(&archive(text)).unwrap();
    }
    let whole = fs::read(&previous).unwrap();
    fs::write(&current, b"GSCKPT").unwrap();
    for reads_before in [true, false] {
        let next = CheckpointFile::in_folder(folder.path());
        if reads_before {
            assert!(matches!(next.read().unwrap(), StoredCheckpoint::Archive(_, Some(_))));
        }
        next.write(&archive("third")).unwrap();
        assert_eq!(fs::read(&previous).unwrap(), whole);
        fs::write(&current, b"GSCKPT").unwrap();
    }
}

#[test]
fn the_newest_whole_checkpoint_is_found_whatever_was_cut_short() {
    let folder = tempfile::tempdir().unwrap();
    let file = CheckpointFile::in_folder(folder.path());
    assert!(matches!(file.read().unwrap(), StoredCheckpoint::Nothing));
    for text in ["first", "second", "third"] {
        file.write(&archive(text)).unwrap();
    }
    let current = folder.path().join("checkpoint.bin");
    let whole = fs::read(&current).unwrap();
    let StoredCheckpoint::Archive(found, None) = file.read().unwrap() else { panic!("the newest is whole") };
    assert_eq!(text_of(&found), "third");
    assert_eq!(*found, archive("third"), "snapshots included");
    for length in (0..whole.len()).step_by(97).chain([whole.len() - 1]) {
        fs::write(&current, &whole[..length]).unwrap();
        let StoredCheckpoint::Archive(found, Some(_)) = file.read().unwrap() else {
            panic!("{length} bytes are not whole")
        };
        assert_eq!(text_of(&found), "second");
    }
    for place in (0..whole.len()).filter(|place| !(8..12).contains(place)).step_by(61) {
        let mut damaged = whole.clone();
        damaged[place] ^= 4;
        fs::write(&current, &damaged).unwrap();
        assert!(matches!(file.read().unwrap(), StoredCheckpoint::Archive(_, Some(_))), "byte {place}");
    }
    fs::remove_file(&current).unwrap();
    assert!(matches!(file.read().unwrap(), StoredCheckpoint::Archive(_, None)), "between the two renames");
    fs::write(folder.path().join("checkpoint.previous.bin"), b"GSCKPT").unwrap();
    assert!(file.read().unwrap_err().to_string().contains("shorter than its header"));
    file.remove().unwrap();
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn another_format_or_section_version_is_refused_with_both_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let file = CheckpointFile::in_folder(folder.path());
    file.write(&archive("old")).unwrap();
    file.write(&archive("new")).unwrap();
    let current = folder.path().join("checkpoint.bin");
    let mut bytes = fs::read(&current).unwrap();
    bytes[8] = 77;
    fs::write(&current, bytes).unwrap();
    let text = file.read().unwrap_err().to_string();
    assert!(
        text.contains("77") && text.contains(&CHECKPOINT_FORMAT.to_string()) && text.contains("--resume"),
        "{text}"
    );
    let text = archive("x").get::<String>("part", 4).unwrap_err().to_string();
    assert!(text.contains("version 3") && text.contains("version 4"), "{text}");
    assert!(matches!(archive("x").get::<String>("other", 1), Err(CheckpointError::Missing { .. })));
    assert!(matches!(archive("x").get::<u64>("part", 3), Err(CheckpointError::Unfit { .. })));
}

#[test]
fn a_checkpoint_that_finds_no_room_leaves_the_last_one_and_the_run_alone() {
    let folder = tempfile::tempdir().unwrap();
    let file = CheckpointFile::in_folder(folder.path());
    file.write(&archive("good")).unwrap();
    // A folder in the way of the draft makes the write fail at its first step.
    fs::create_dir(folder.path().join(".checkpoint.partial")).unwrap();
    let policy = CheckpointPolicy { steps: Some(1), ..CheckpointPolicy::default() };
    let mut store = PeriodicCheckpoints::new(file.clone(), policy, None, CheckpointFigures::default(), |_, _, _| {});
    store.save_step(Progress { step: 1, stage: 0, load: 0.5 }, &mut |archive| archive.put("part", 3, &1));
    assert_eq!((store.figures().written, store.figures().failed), (0, 1));
    assert!(store.figures().last_failure.as_ref().unwrap().contains("checkpoint.bin"));
    let StoredCheckpoint::Archive(found, _) = file.read().unwrap() else { panic!("it was there") };
    assert_eq!(text_of(&found), "good");
    // The state is kept until there is room.
    assert!(store.flush().unwrap_err().contains("checkpoint.bin"));
    fs::remove_dir(folder.path().join(".checkpoint.partial")).unwrap();
    store.flush().unwrap();
    assert_eq!((store.figures().written, store.figures().failed), (1, 2));
    let StoredCheckpoint::Archive(found, _) = file.read().unwrap() else { panic!("it was there") };
    assert_eq!(found.get::<i32>("part", 3).unwrap(), 1);
}

#[test]
fn checkpoints_come_after_steps_or_time_and_at_the_end() {
    let folder = tempfile::tempdir().unwrap();
    let file = CheckpointFile::in_folder(folder.path());
    let written = |policy: CheckpointPolicy| {
        let mut store =
            PeriodicCheckpoints::new(file.clone(), policy, None, CheckpointFigures::default(), |_, _, _| {});
        let counts: Vec<u64> = (0..5)
            .map(|step| {
                store.save_step(Progress { step, stage: 0, load: 0.0 }, &mut |archive| archive.put("part", 1, &step));
                store.figures().written
            })
            .collect();
        store.flush().unwrap();
        (counts, store.figures().written)
    };
    let policy = CheckpointPolicy::default();
    assert_eq!(written(CheckpointPolicy { steps: Some(2), ..policy }), (vec![0, 1, 1, 2, 2], 3));
    assert_eq!(written(policy), (vec![0; 5], 1));
    assert_eq!(written(CheckpointPolicy { enabled: false, ..policy }), (vec![0; 5], 0));
    let eager = CheckpointPolicy { pause: Duration::ZERO, ..policy };
    assert_eq!(written(eager).0[0], 1);
}

/// Collecting a long curve after every step took more time than all steps together.
#[test]
fn a_state_that_is_costly_to_collect_is_not_collected_after_every_step() {
    let folder = tempfile::tempdir().unwrap();
    let file = CheckpointFile::in_folder(folder.path());
    let policy = CheckpointPolicy::default();
    let mut store = PeriodicCheckpoints::new(file.clone(), policy, None, CheckpointFigures::default(), |_, _, _| {});
    let mut collected = Vec::new();
    let at = |step| Progress { step, stage: 0, load: 0.0 };
    let mut fill = |step: u64, archive: &mut Archive| {
        std::thread::sleep(Duration::from_millis(50));
        collected.push(step);
        archive.put("part", 1, &step);
    };
    for step in 0..5 {
        store.save_step(at(step), &mut |archive| fill(step, archive));
    }
    let saved = || {
        let StoredCheckpoint::Archive(found, _) = file.read().unwrap() else { panic!("it was written") };
        found.get::<u64>("part", 1).unwrap()
    };
    store.flush().unwrap();
    assert_eq!(saved(), 0);
    // Whoever asks for the last one gets it, once.
    for _ in 0..2 {
        store.collect_latest(at(4), &mut |archive| fill(4, archive));
        store.flush().unwrap();
    }
    assert_eq!(saved(), 4);
    assert_eq!(collected, [0, 4]);
}

#[test]
fn a_failure_case_reads_back_and_damage_is_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("point.replay");
    let written = FailureCase {
        program: "grainspan".into(),
        engine: "yade".into(),
        point: 7,
        failures: vec!["signal: 11".into()],
        definition: protocol::Definition { bytes: vec![1, 2, 3] },
        state: vec![9; 100],
        target: protocol::Tensor2::from_plane([[1e-3, -0.0], [0.0, 2e-3]]),
        tangent: protocol::TangentKind::TrussLike,
        ramp_steps: 12,
        observables: protocol::Observables::ALL,
        friction_reduction: 0.25,
    };
    fs::write(&path, written.encode()).unwrap();
    assert_eq!(FailureCase::read(&path).unwrap(), written);
    let mut bytes = fs::read(&path).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    fs::write(&path, &bytes).unwrap();
    assert!(matches!(FailureCase::read(&path), Err(CheckpointError::Damaged { .. })));
    bytes[8] = 9;
    fs::write(&path, &bytes).unwrap();
    assert!(matches!(FailureCase::read(&path), Err(CheckpointError::Format { found: 9, .. })));
}

/// Rough enough to need several iterations and a cut-back: a pressed block under a follower load.
fn problem() -> Problem {
    let mesh = Block::plane([1.0, 2.0], [2, 3], ElementKind::Q8).mesh().unwrap();
    let mut problem = Problem::new(
        mesh,
        vec![
            Condition::fixed("bottom_left", Axis::X),
            Condition::Platen { nodes: "bottom".into(), contact: Platen::Smooth, axis: Axis::Y, displacement: 0.0 },
            Condition::Platen { nodes: "top".into(), contact: Platen::Rough, axis: Axis::Y, displacement: -0.2 },
            Condition::Pressure { sides: "left".into(), value: 1.0e5, kind: PressureKind::Dead },
            Condition::Pressure { sides: "right".into(), value: 1.0e5, kind: PressureKind::Follower },
        ],
    );
    problem.stages[0].control.increments = 6;
    problem.stages[0].control.max_iterations = 8;
    problem
}

fn law(problem: &Problem) -> ElasticMaterial {
    let law = ElasticMaterial::new(ElasticLaw::SaintVenant, 2.0e7, 1.0e7, problem.point_count());
    law.with_initial_stress([[-0.9e5, 0.0, 0.0], [0.0; 3], [0.0; 3]])
}

/// Keeps every archive.
#[derive(Default)]
struct Shelf {
    earlier: Option<Archive>,
    kept: Vec<Archive>,
}

impl CheckpointStore for Shelf {
    fn earlier(&mut self) -> Option<Archive> {
        self.earlier.take()
    }

    fn save_step(&mut self, _mark: Progress, fill: &mut dyn FnMut(&mut Archive)) {
        let mut archive = Archive::new();
        fill(&mut archive);
        self.kept.push(archive);
    }
}

/// Writes down every bit that it is shown, and saves nothing.
#[derive(Default)]
struct Witness(Vec<String>);

impl Observer for Witness {
    fn accepted(&mut self, report: &StepReport, view: &FieldsView<'_>) -> Result<(), StopRequest> {
        let mut statistics = view.statistics.clone();
        (statistics.material_nanoseconds, statistics.assembly_nanoseconds) = (0, 0);
        statistics.linear_solver_nanoseconds = 0;
        self.0.push(format!(
            "{report:?} {:?} {:?} {:?} {:?} {statistics:?}",
            view.displacements, view.reactions, view.loads, view.points
        ));
        Ok(())
    }
}

#[test]
fn a_run_continued_after_any_step_shows_the_same_bits() {
    for named in NamedStrategy::ALL {
        let mut problem = problem();
        problem.stages[0].strategy = named.preset();
        assert!(continues_to_the_same_bits(&problem) > 0, "{named:?} needs no cut-back");
    }
}

#[test]
fn a_run_whose_load_factor_is_unknown_continues_to_the_same_bits() {
    let indirect = PathControl::Indirect {
        nodes: "top".into(),
        relative_to: Some("bottom".into()),
        axis: Axis::Y,
        growth: -0.1,
    };
    for path in [PathControl::ArcLength { first_load: 0.1, set: None, component: None }, indirect] {
        let mut problem = problem();
        problem.stages[0].control.path = path;
        continues_to_the_same_bits(&problem);
    }
}

/// A step that was stabilised leaves no increment behind from which the next could be guessed.
#[test]
fn a_run_goes_on_after_a_snap_to_the_same_bits() {
    let run = continues_with(&pulled(1e-2), weak_at_the_bottom);
    assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
    assert_eq!(run.statistics.stabilised_steps, 1);
}

/// A step that was stabilised in vain and cut back leaves something behind for the next: they are not stabilised at once.
#[test]
fn a_run_goes_on_after_a_stabilisation_that_was_taken_back_to_the_same_bits() {
    let mut problem = softening_column(Condition::Traction { sides: "top".into(), value: [0.0, 3.3e4, 0.0] });
    problem.stages[0].control.stabilisation = Some(Stabilisation { after: Some(1), ..Stabilisation::default() });
    let run = continues_with(&problem, weak_at_the_bottom);
    assert!(matches!(run.outcome, Outcome::DidNotConverge { .. }), "{:?}", run.outcome);
    assert_eq!(run.statistics.stabilisations_taken_back, 2);
}

/// Continues after every step, and returns how often one was cut back.
fn continues_to_the_same_bits(problem: &Problem) -> u64 {
    let run = continues_with(problem, || law(problem).with_largest_target(0.0165));
    assert!(matches!(run.outcome, Outcome::Completed), "{:?} {:?}", problem.stages[0].strategy, run.outcome);
    run.statistics.cut_backs
}

fn continues_with<M: PointMaterial>(problem: &Problem, material: impl Fn() -> M) -> Run {
    let (mut whole, mut shelf) = (Witness::default(), Shelf::default());
    let run = solve_with_checkpoints(problem, &mut material(), &mut whole, &mut shelf);
    assert!(whole.0.len() > 6, "{} steps", whole.0.len());
    assert_eq!(shelf.kept.len(), whole.0.len());
    for (step, archive) in shelf.kept.iter().enumerate() {
        let (mut rest, mut store) = (Witness::default(), Shelf { earlier: Some(archive.clone()), kept: Vec::new() });
        solve_with_checkpoints(problem, &mut material(), &mut rest, &mut store);
        assert_eq!(rest.0, whole.0[step + 1..], "continued after step {step}");
    }
    run
}

#[test]
fn an_archive_of_another_mesh_is_refused_before_anything_is_solved() {
    let mut shelf = Shelf::default();
    let small = problem();
    solve_with_checkpoints(&small, &mut law(&small), &mut Silent, &mut shelf);
    let mut other = problem();
    other.mesh = Block::plane([1.0, 2.0], [2, 4], ElementKind::Q8).mesh().unwrap();
    let mut store = Shelf { earlier: shelf.kept.pop(), kept: Vec::new() };
    let run = solve_with_checkpoints(&other, &mut law(&other), &mut Silent, &mut store);
    let Outcome::CheckpointRefused(error) = run.outcome else { panic!("{:?}", run.outcome) };
    assert!(error.to_string().contains("does not fit"), "{error}");
    assert_eq!(run.statistics.evaluations, 0);
    let mut store = Shelf { earlier: Some(Archive::new()), kept: Vec::new() };
    let run = solve_with_checkpoints(&small, &mut law(&small), &mut Silent, &mut store);
    assert!(matches!(run.outcome, Outcome::CheckpointRefused(_)));
    assert!(matches!(solve(&small, &mut law(&small), &mut Silent).outcome, Outcome::Completed));
}
