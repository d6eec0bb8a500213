//! What every engine must do, said once and asked of each over each transport.

use super::conversation::{Conversation, Partner, Said};
use super::{foreign, native};
use protocol::wire::{ReplyStatus, TrialJob};
use protocol::{ContentId, Definition, Observables, OptionalResult, RveError, StateId, TrialFlags};
use rve_server::contact::ContactTable;
use rve_server::definition::{EngineFeature, GrainDefinition, PackingFile};
use rve_server::space::Discs;
use std::path::Path;

/// 100 discs, draft accuracy.
pub(crate) fn discs() -> Definition {
    discs_of(|packing| packing)
}

/// The same with a changed packing.
fn discs_of(change: impl FnOnce(PackingFile<Discs>) -> PackingFile<Discs>) -> Definition {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("packings/discs-100.json");
    let contact = ContactTable { normal_stiffness: None, modulus: Some(1e8), ..ContactTable::linear(1.0, 0.5, 0.5) };
    let options = toml::from_str("accuracy = \"draft\"").unwrap();
    let packing = change(PackingFile::<Discs>::read(&path).unwrap());
    GrainDefinition { packing, contact, options }.to_protocol()
}

const SHORTER: [[f64; 2]; 2] = [[5e-5, 0.0], [0.0, -1e-4]];
const SHEARED: [[f64; 2]; 2] = [[0.0, 1e-4], [2e-5, 0.0]];

#[test]
fn built_in_engine_in_process() {
    conforms(Partner::ThreadInProcess);
}

#[test]
fn built_in_engine_over_shared_memory() {
    conforms(Partner::ThreadInSharedMemory);
}

#[test]
fn reference_engine_over_shared_memory() {
    if foreign::is_there("reference") {
        conforms(Partner::Process(|| foreign::command("reference")));
    }
}

#[test]
fn reference_engine_over_a_pipe() {
    if foreign::is_there("reference") {
        conforms(Partner::Pipe(|| foreign::command("reference")));
    }
}

#[test]
fn yade_over_a_pipe() {
    if foreign::is_there("yade") {
        conforms(Partner::Pipe(|| foreign::command("yade")));
    }
}

#[test]
fn lammps_over_a_pipe() {
    if foreign::is_there("lammps") {
        conforms(Partner::Pipe(|| foreign::command("lammps")));
    }
}

#[test]
fn reference_engine_by_replay_of_paths() {
    if foreign::is_there("reference") {
        conforms(Partner::Process(|| {
            let mut command = foreign::command("reference");
            command.arg("--replay");
            command
        }));
    }
}

#[test]
fn yade_over_shared_memory() {
    if foreign::is_there("yade") {
        conforms(Partner::Process(|| foreign::command("yade")));
    }
}

#[test]
fn lammps_over_shared_memory() {
    if foreign::is_there("lammps") {
        conforms(Partner::Process(|| foreign::command("lammps")));
    }
}

#[test]
fn native_engine_behind_the_c_header() {
    if native::is_there() {
        conforms(Partner::Process(native::command));
    }
}

/// All claims in one conversation: starting some engines takes seconds.
fn conforms(partner: Partner) {
    let mut talk = Conversation::begin(partner);
    let made_of = discs();
    unknown_questions_are_told_apart(&mut talk, &made_of);
    definitions_that_make_no_cell_are_refused(&mut talk);
    packings_with_rolling_moments_are_read_by_engines_that_say_so(&mut talk);
    let first = a_trial_leaves_the_committed_state_alone(&mut talk, &made_of);
    refusals_change_nothing(&mut talk, &made_of, &first);
    optional_results_are_those_of_the_capabilities(&mut talk, &made_of);
    let second = a_state_is_the_same_with_and_without_its_bytes(&mut talk, &made_of, &first);
    a_null_target_answers_with_the_committed_state(&mut talk, &made_of, &first);
    a_fresh_worker_goes_on_to_the_same_bits(&mut talk, &made_of, &first, &second);
    assert_eq!(talk.drain(), "drained");
}

fn unknown_questions_are_told_apart(talk: &mut Conversation, made_of: &Definition) {
    let job = talk.job(made_of, StateId::NONE, SHORTER);
    assert_eq!(status(&talk.ask_one(job, b"")), ReplyStatus::NeedDefinition);
    talk.define(made_of);
    let job = talk.job(made_of, ContentId::of(b"never seen"), SHORTER);
    assert_eq!(status(&talk.ask_one(job, b"")), ReplyStatus::NeedState);
}

fn definitions_that_make_no_cell_are_refused(talk: &mut Conversation) {
    let nonsense = Definition { bytes: b"not a cell".to_vec() };
    talk.define(&nonsense);
    assert!(!talk.refusal_of(&nonsense).is_empty());
    let job = talk.job(&nonsense, StateId::NONE, SHORTER);
    assert_eq!(status(&talk.ask_one(job, b"")), ReplyStatus::NeedDefinition);
}

/// A worker that joins by hand has not been compared with the scene: it must not solve grains without the moments that they have.
fn packings_with_rolling_moments_are_read_by_engines_that_say_so(talk: &mut Conversation) {
    let made_of = discs_of(|packing| PackingFile {
        version: PackingFile::VERSION_WITH_MOMENTS,
        rolling_moments: vec![0.0; packing.contacts.len()],
        ..packing
    });
    talk.define(&made_of);
    let feature = EngineFeature::RollingMoments.keyword();
    if talk.capabilities.features.iter().any(|word| word == feature) {
        let job = talk.job(&made_of, StateId::NONE, SHORTER);
        sound(&talk.ask_one(job, b""));
    } else {
        let reason = talk.refusal_of(&made_of);
        assert!(reason.contains("version 2"), "{reason}");
    }
}

/// The run takes the numbers of what an engine delivers, and shows what it does not deliver as NaN.
fn optional_results_are_those_of_the_capabilities(talk: &mut Conversation, made_of: &Definition) {
    let job = talk.job(made_of, StateId::NONE, SHORTER);
    let said = talk.ask_one(TrialJob { observables: Observables::ALL.0, ..job }, b"");
    sound(&said);
    let observed = said.reply.observed;
    let numbers = |result: OptionalResult| match result {
        OptionalResult::FirstPiola => observed.first_piola.0.to_vec(),
        OptionalResult::Fabric => observed.fabric.0.to_vec(),
        OptionalResult::FabricAnisotropy => vec![observed.fabric_anisotropy],
        OptionalResult::CoordinationNumberNoRattlers => vec![observed.coordination_number_no_rattlers],
        OptionalResult::SlidingFraction => vec![observed.sliding_fraction],
        OptionalResult::ElasticEnergy => vec![observed.elastic_energy],
        OptionalResult::FrictionalDissipation => vec![observed.frictional_dissipation],
        OptionalResult::DampingWork => vec![observed.damping_work],
        OptionalResult::MeanRotation => observed.mean_rotation.to_vec(),
    };
    let lacking = talk.capabilities.lacking();
    for result in OptionalResult::ALL {
        let is_zero = numbers(result).iter().all(|number| *number == 0.0);
        // In so small a trial no contact need slide.
        let may_be_zero = [
            OptionalResult::SlidingFraction,
            OptionalResult::FrictionalDissipation,
            OptionalResult::DampingWork,
            OptionalResult::MeanRotation,
        ];
        if lacking.contains(&result) {
            assert!(is_zero, "{} is delivered, and the capabilities do not say so", result.keyword());
        } else if !may_be_zero.contains(&result) {
            assert!(!is_zero, "the capabilities have {}, and it did not come", result.keyword());
        }
    }
}

/// Trial and rollback: whatever was tried before, the same question has the same answer. Duplicates likewise.
fn a_trial_leaves_the_committed_state_alone(talk: &mut Conversation, made_of: &Definition) -> Said {
    let [one, other, again] = [SHORTER, SHEARED, SHORTER].map(|target| talk.job(made_of, StateId::NONE, target));
    let answers = talk.ask(&[(one, b""), (other, b""), (again, b""), (one, b"")]);
    answers.iter().for_each(sound);
    same(&answers[0], &answers[2]);
    same(&answers[0], &answers[3]);
    assert_eq!((answers[3].reply.job, answers[3].reply.point), (one.job, one.point));
    assert_ne!(answers[0].reply.stress, answers[1].reply.stress);
    answers[0].clone()
}

fn refusals_change_nothing(talk: &mut Conversation, made_of: &Definition, first: &Said) {
    let base = talk.job(made_of, StateId::NONE, SHORTER);
    let refused = |talk: &mut Conversation, job: TrialJob, bytes: &[u8]| {
        let said = talk.ask_one(job, bytes);
        assert_eq!((status(&said), said.state.len()), (ReplyStatus::Failed, 0));
        said.error.expect("a failed trial says why")
    };
    let mut wrong = base;
    wrong.target.0[0] = f64::NAN;
    assert_eq!(refused(talk, wrong, b""), RveError::TargetNotFinite);
    let inverted = talk.job(made_of, StateId::NONE, [[-2.0, 0.0], [0.0, 0.0]]);
    assert!(matches!(refused(talk, inverted, b""), RveError::TargetInverted { .. }));
    let far = talk.job(made_of, StateId::NONE, [[0.5, 0.0], [0.0, 0.0]]);
    assert!(matches!(refused(talk, far, b""), RveError::TargetTooLarge { .. }));
    let mut wrong = base;
    wrong.target.0[2] = 1e-4;
    assert!(matches!(refused(talk, wrong, b""), RveError::Unsupported(_)));
    let unknown = TrialJob { tangent: 99, ..base };
    assert!(matches!(refused(talk, unknown, b""), RveError::Unsupported(_)));
    // A snapshot that was damaged on its way, and one that is no snapshot although its name is right.
    let damaged = TrialJob { state: first.reply.state, ..base };
    assert!(matches!(refused(talk, damaged, b"damaged"), RveError::Snapshot(_)));
    let nonsense = TrialJob { state: ContentId::of(b"nonsense"), ..base };
    assert!(matches!(refused(talk, nonsense, b"nonsense"), RveError::Snapshot(_)));
    same(&talk.ask_one(base, b""), first);
}

/// Commit is nothing but asking from the trial state: the worker holds it, or is given it.
fn a_state_is_the_same_with_and_without_its_bytes(
    talk: &mut Conversation,
    made_of: &Definition,
    first: &Said,
) -> Said {
    let job = talk.job(made_of, first.reply.state, SHEARED);
    let held = talk.ask_one(job, b"");
    sound(&held);
    let elsewhere = talk.job(made_of, StateId::NONE, SHEARED);
    sound(&talk.ask_one(elsewhere, b""));
    same(&talk.ask_one(job, &first.state), &held);
    held
}

fn a_null_target_answers_with_the_committed_state(talk: &mut Conversation, made_of: &Definition, first: &Said) {
    let still = talk.job(made_of, first.reply.state, [[0.0; 2]; 2]);
    let said = talk.ask_one(still, &first.state);
    sound(&said);
    assert!(TrialFlags(said.reply.flags).contains(TrialFlags::SKIPPED_NULL_TARGET));
    let scale = first.reply.stress.0.iter().fold(0.0f64, |most, value| most.max(value.abs()));
    for (found, expected) in said.reply.stress.0.iter().zip(&first.reply.stress.0) {
        // Engines that report the forces of their last step differ by that step.
        assert!((found - expected).abs() < 1e-3 * scale, "{found} {expected}");
    }
}

/// A point that is handed to another worker equals one that was not: by snapshot or by replay of its path.
fn a_fresh_worker_goes_on_to_the_same_bits(
    talk: &mut Conversation,
    made_of: &Definition,
    first: &Said,
    second: &Said,
) {
    let onwards = talk.job(made_of, second.reply.state, SHORTER);
    let stayed = talk.ask_one(onwards, b"");
    sound(&stayed);
    talk.replace_worker();
    talk.define(made_of);
    let job = talk.job(made_of, first.reply.state, SHEARED);
    assert_eq!(status(&talk.ask_one(job, b"")), ReplyStatus::NeedState);
    same(&talk.ask_one(onwards, &second.state), &stayed);
    same(&talk.ask_one(job, &first.state), second);
}

fn status(said: &Said) -> ReplyStatus {
    ReplyStatus::from_wire(said.reply.status).expect("a known status")
}

/// A finished trial with a state that has its name.
fn sound(said: &Said) {
    assert_eq!(status(said), ReplyStatus::Done, "{:?}", said.error);
    assert!(said.reply.is_finite());
    assert_eq!(ContentId::of(&said.state), said.reply.state);
    assert!(said.reply.cost.force_evaluations > 0);
}

/// Equal but for what depends on the clock and on the number of the job.
fn same(found: &Said, expected: &Said) {
    let timeless = |said: &Said| {
        let mut said = said.clone();
        (said.reply.job, said.reply.overhead_nanoseconds, said.reply.checksum) = (0, 0, 0);
        // How much of a path had to be solved again is no part of the answer.
        said.reply.replayed = 0;
        (said.reply.cost.solve_nanoseconds, said.reply.cost.tangent_nanoseconds) = (0, 0);
        said
    };
    let (found, expected) = (timeless(found), timeless(expected));
    assert_eq!(found.reply, expected.reply);
    assert!(found.state == expected.state, "the trial states differ");
}
