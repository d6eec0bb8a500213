//! The engine keeps its contract: trials are pure, states are complete, bad targets are refused.

use crate::samples::{hundred_discs, trial};
use claims::Claim;
use protocol::{
    Observables, RveEngine, RveError, RveSolver, TangentKind, Tensor2, TrialFlags, TrialOptions, TrialResult,
};
use rve_server::definition::{Criterion, Damping, RveOptions};
use rve_server::engine::{GrainEngine, GrainRve};
use rve_server::space::Discs;

const FIRST: [[f64; 2]; 2] = [[2e-4, 1e-4], [-5e-5, -4e-4]];
const SECOND: [[f64; 2]; 2] = [[-1e-4, 3e-4], [0.0, -1e-4]];

fn draft() -> RveOptions {
    RveOptions { strain_per_step: Some(5e-6), ..RveOptions::default() }
}

fn cell() -> GrainRve {
    GrainRve::new(&hundred_discs(draft())).unwrap()
}

/// An answer without its timings.
fn timeless(mut answer: TrialResult) -> TrialResult {
    (answer.cost.solve_nanoseconds, answer.cost.tangent_nanoseconds) = (0, 0);
    answer
}

fn ask_all(tangent: TangentKind) -> TrialOptions {
    TrialOptions { tangent, observables: Observables::ALL, ..TrialOptions::default() }
}

/// trials do not see each other.
#[test]
fn trial_rollback_trial_gives_the_same_bits() {
    let mut cell = cell();
    let options = ask_all(TangentKind::TrussLikeSlip);
    let first = timeless(cell.trial(&Tensor2::from_plane(FIRST), &options).unwrap());
    let mut state = Vec::new();
    cell.snapshot_trial(&mut state).unwrap();
    cell.rollback();
    trial(&mut cell, &SECOND);
    cell.rollback();
    let again = timeless(cell.trial(&Tensor2::from_plane(FIRST), &options).unwrap());
    let mut state_again = Vec::new();
    cell.snapshot_trial(&mut state_again).unwrap();
    Claim::of("A-3", "answer of the first target, asked again after another").holds(first == again);
    Claim::of("A-3", "trial state of the first target, asked again after another").holds(state == state_again);
}

/// a state that went through bytes, in another solver, continues to the same bits.
#[test]
fn restored_state_continues_as_if_never_stored() {
    let mut direct = cell();
    trial(&mut direct, &FIRST);
    direct.commit().unwrap();
    let mut bytes = Vec::new();
    direct.snapshot(&mut bytes);
    let options = ask_all(TangentKind::TrussLike);
    let expected = timeless(direct.trial(&Tensor2::from_plane(SECOND), &options).unwrap());

    let definition = hundred_discs(draft()).to_protocol();
    let mut restored = GrainEngine.create(&definition).unwrap();
    restored.restore(&bytes).unwrap();
    let mut bytes_again = Vec::new();
    restored.snapshot(&mut bytes_again);
    Claim::of("A-4", "bytes of a state that was restored and saved again").holds(bytes == bytes_again);
    let found = timeless(restored.trial(&Tensor2::from_plane(SECOND), &options).unwrap());
    Claim::of("A-4", "next answer of a state that was restored in another solver").holds(found == expected);
    assert!(bytes.len() < 12_000, "a state of 100 discs takes {} bytes", bytes.len());
}

/// bad targets are refused by kind and leave the state alone.
#[test]
fn bad_targets_are_refused_and_leave_the_state_alone() {
    let mut cell = cell();
    let before = cell.committed().clone();
    let mut refused = |h: [[f64; 2]; 2]| cell.trial(&Tensor2::from_plane(h), &TrialOptions::default()).unwrap_err();
    for target in [[[f64::NAN, 0.0], [0.0, 0.0]], [[0.0, f64::INFINITY], [0.0, 0.0]]] {
        let is_refused = refused(target) == RveError::TargetNotFinite;
        Claim::of("A-6", "targets that are not finite are refused by their error").holds(is_refused);
    }
    for target in [[[-1.0, 0.0], [0.0, 0.1]], [[-2.5, 0.0], [0.0, 0.1]]] {
        let is_refused = matches!(refused(target), RveError::TargetInverted { .. });
        Claim::of("A-6", "targets that invert the cell are refused by their error").holds(is_refused);
    }
    let is_refused = matches!(refused([[0.3, 0.0], [0.0, 0.0]]), RveError::TargetTooLarge { .. });
    Claim::of("A-6", "targets that are too large are refused by their error").holds(is_refused);
    let mut out_of_plane = Tensor2::ZERO;
    out_of_plane.0[8] = 0.01;
    assert!(matches!(cell.trial(&out_of_plane, &TrialOptions::default()), Err(RveError::Unsupported(_))));
    assert_eq!(cell.commit(), Err(RveError::NothingToCommit));
    Claim::of("A-6", "committed state after the refusals, bits").holds(*cell.committed() == before);
}

/// a null target returns the committed stress, and says that nothing was solved.
#[test]
fn null_target_returns_the_committed_stress() {
    let mut cell = cell();
    let given = cell.observe(Observables::NONE).unwrap().stress;
    let answer = trial(&mut cell, &[[0.0; 2]; 2]);
    Claim::of("A-7", "stress of a cell as it was given, zero target, bits").holds(answer.stress == given);
    assert!(answer.flags.contains(TrialFlags::SKIPPED_NULL_TARGET));

    let reached = trial(&mut cell, &FIRST).stress;
    cell.commit().unwrap();
    let stayed = trial(&mut cell, &[[0.0; 2]; 2]).stress;
    for (found, expected) in stayed.0.iter().zip(reached.0) {
        let error = (found - expected).abs() / 1e5;
        Claim::of("A-7", "stress after a zero target, of the pressure").error(error).within(1e-10);
    }
    let before = cell.committed().clone();
    cell.commit().unwrap();
    assert_eq!(*cell.committed(), before);
}

#[test]
fn foreign_snapshots_and_definitions_are_refused() {
    let mut cell = cell();
    let mut bytes = Vec::new();
    cell.snapshot(&mut bytes);
    let mut other = GrainRve::new(&hundred_discs(RveOptions::default())).unwrap();
    assert!(matches!(other.restore(&bytes), Err(RveError::Snapshot(_))));
    assert!(matches!(cell.restore(&bytes[..100]), Err(RveError::Snapshot(_))));
    cell.restore(&bytes).unwrap();

    let noise = protocol::Definition { bytes: vec![1, 2, 3] };
    assert!(matches!(GrainEngine.create(&noise), Err(RveError::Definition(_))));
    let mut bad = hundred_discs(draft());
    bad.contact.friction = -1.0;
    let Err(RveError::Definition(reason)) = GrainEngine.create(&bad.to_protocol()) else {
        panic!("negative friction was accepted")
    };
    assert!(reason.contains("contact.friction"));
}

#[test]
fn step_cap_is_an_answer_with_a_flag() {
    let options = RveOptions { max_steps: Some(3), tolerance: Some(1e-9), ..draft() };
    let mut cell = GrainRve::new(&hundred_discs(options)).unwrap();
    let answer = trial(&mut cell, &FIRST);
    assert!(answer.flags.contains(TrialFlags::NOT_EQUILIBRATED));
    assert!(answer.scalars.unbalanced_force_ratio > 1e-9);
    cell.commit().unwrap();
}

/// The three criteria and both dampings lead to the same stress where the response is unique.
#[test]
fn criteria_and_dampings_agree() {
    let stress = |damping, criterion, tolerance| {
        let options =
            RveOptions { damping, criterion, tolerance: Some(tolerance), strain_per_step: Some(1e-6), ..draft() };
        let mut cell = GrainRve::new(&hundred_discs(options)).unwrap();
        let answer = trial(&mut cell, &[[5e-5, 0.0], [0.0, -1e-4]]);
        assert!(!answer.flags.contains(TrialFlags::NOT_EQUILIBRATED));
        answer.stress.plane()
    };
    let reference = stress(Damping::Fire, Criterion::MaxForce, 1e-6);
    for (damping, criterion, tolerance) in [
        (Damping::Fire, Criterion::RmsForce, 1e-5),
        (Damping::Fire, Criterion::Energy, 1e-12),
        (Damping::Local, Criterion::MaxForce, 1e-6),
    ] {
        let found = stress(damping, criterion, tolerance);
        for i in 0..2 {
            let error = (found[i][i] - reference[i][i]).abs() / 1e5;
            assert!(error < 2e-3, "{damping:?} {criterion:?}: stress differs by {error:e} of the pressure");
        }
    }
}

/// Expansion empties the cell of contacts; compression brings them back.
#[test]
fn expanded_cell_has_no_load_bearing_contacts_and_recovers() {
    let mut cell = GrainRve::new(&hundred_discs(RveOptions { strain_per_step: Some(1e-4), ..draft() })).unwrap();
    let answer = trial(&mut cell, &[[0.02, 0.0], [0.0, 0.02]]);
    assert!(answer.flags.contains(TrialFlags::NO_LOAD_BEARING_CONTACTS));
    assert_eq!(answer.stress, Tensor2::ZERO);
    assert_eq!(answer.scalars.coordination_number, 0.0);
    cell.commit().unwrap();
    let back = trial(&mut cell, &[[-0.022, 0.0], [0.0, -0.022]]);
    assert!(back.stress.get(0, 0) < 0.0 && back.stress.get(1, 1) < 0.0);
    assert!(!back.flags.contains(TrialFlags::NO_LOAD_BEARING_CONTACTS));
}

#[test]
fn a_snapshot_holds_the_rotations_of_the_grains() {
    let definition = hundred_discs(draft()).to_protocol();
    let mut cell = GrainRve::from_protocol(&definition).unwrap();
    trial(&mut cell, &[[0.0, 0.05], [0.0, 0.0]]);
    cell.commit().unwrap();
    let mut bytes = Vec::new();
    cell.snapshot(&mut bytes);
    let mut other = GrainRve::<Discs>::from_protocol(&definition).unwrap();
    other.restore(&bytes).unwrap();
    let picture = other.picture(0.0).unwrap();
    assert_eq!((picture.centres.len(), picture.radii.len(), picture.rotations.len()), (100, 100, 100));
    let mean = picture.rotations.iter().map(|rotation| rotation[2]).sum::<f64>() / 100.0;
    assert!(
        mean < -0.01 && mean > -0.05,
        "simple shear turns grains clockwise by about half its angle, found {mean}"
    );
}
