//! Friction that a request reduces: a trial is then that of a cell with less friction, to the bit.

use crate::samples::{SQUARE, hundred_discs, lattice, packing_of, sand, tight};
use protocol::{
    Observables, RveError, RveSolver, TangentKind, Tensor2, TrialFlags, TrialOptions, TrialRequest, TrialResult,
};
use rve_server::contact::ContactTable;
use rve_server::definition::{GrainDefinition, RveOptions, SolverName};
use rve_server::engine::GrainRve;
use rve_server::solver::SolverFor;
use rve_server::space::{Discs, Space, Spheres};

fn coarse() -> RveOptions {
    RveOptions { strain_per_step: Some(1e-5), tolerance: Some(1e-3), ..RveOptions::default() }
}

fn with_reduction(tangent: TangentKind, friction_reduction: f64) -> TrialOptions {
    TrialOptions { tangent, observables: Observables::ALL, friction_reduction, ..TrialOptions::default() }
}

fn in_plane(h: [[f64; 2]; 2]) -> Tensor2 {
    Tensor2::from_plane(h)
}

/// Everything but times.
fn timeless(mut answer: TrialResult) -> TrialResult {
    (answer.cost.solve_nanoseconds, answer.cost.tangent_nanoseconds) = (0, 0);
    answer
}

/// The answer with reduced friction and that of a cell made with this friction.
fn assert_is_that_of_less_friction<S: Space + SolverFor>(definition: &GrainDefinition<S>, target: Tensor2) {
    let mut cell = GrainRve::new(definition).unwrap();
    for reduction in [0.4, 1.0, 0.15] {
        let mut less = definition.clone();
        less.contact.friction *= 1.0 - reduction;
        less.options.solver = SolverName::Relaxation;
        let mut other = GrainRve::new(&less).unwrap();
        for kind in [TangentKind::None, TangentKind::TrussLikeSlip, TangentKind::QuasiStatic] {
            let found = timeless(cell.trial(&target, &with_reduction(kind, reduction)).unwrap());
            let expected = timeless(other.trial(&target, &with_reduction(kind, 0.0)).unwrap());
            assert!(found == expected, "{kind:?} with friction reduced by {reduction}");
        }
        assert!(
            cell.trial(&target, &with_reduction(TangentKind::None, 0.0)).unwrap().stress
                != other_stress(&mut other, target)
        );
    }
}

fn other_stress<S: Space + SolverFor>(cell: &mut GrainRve<S>, target: Tensor2) -> Tensor2 {
    cell.trial(&target, &with_reduction(TangentKind::None, 0.0)).unwrap().stress
}

#[test]
fn a_trial_with_reduced_friction_is_that_of_a_cell_with_less_friction() {
    let shear = in_plane([[2e-4, 3e-4], [1e-4, -6e-4]]);
    for solver in [SolverName::Relaxation, SolverName::EventDriven] {
        let mut definition = hundred_discs(RveOptions { solver, ..coarse() });
        // The packing lists forces up to the friction of its law; a definition with less would cut them as it is made.
        definition.packing.contacts.clear();
        assert_is_that_of_less_friction::<Discs>(&definition, shear);
    }
    let contact = ContactTable::hertz_mindlin(2.9e10, 0.15, 0.5);
    let mut packing = packing_of::<Spheres>("spheres-100.json");
    packing.contacts.clear();
    let definition = GrainDefinition { packing, contact, options: coarse() };
    let mut target = Tensor2::ZERO;
    (target.0[0], target.0[4], target.0[8], target.0[1]) = (1e-4, 1e-4, -4e-4, 1e-4);
    assert_is_that_of_less_friction::<Spheres>(&definition, target);
}

/// Requests of several frictions in one batch are answered as they are alone, whatever was asked before.
#[test]
fn batches_mix_frictions_and_leave_no_trace() {
    let definition = hundred_discs(coarse());
    let mut cell = GrainRve::new(&definition).unwrap();
    let mut state = Vec::new();
    cell.snapshot(&mut state);
    let requests: Vec<TrialRequest<'_>> = (0..14)
        .map(|number| {
            let size = 1e-5 * f64::from(number);
            let target = in_plane([[size, 0.5 * size], [0.0, -2.0 * size]]);
            let reduction = [0.0, 0.3, 0.75][number as usize % 3];
            let (definition, options) = (cell.definition_id(), with_reduction(TangentKind::TrussLikeSlip, reduction));
            TrialRequest { definition, state: &state, target, options }
        })
        .collect();
    let together = cell.solve_batch(&requests);
    for (request, found) in requests.iter().zip(together) {
        let mut fresh = GrainRve::new(&definition).unwrap();
        let expected = protocol::solve_alone(&mut fresh, request).unwrap();
        let found = found.unwrap();
        assert!(timeless(found.0) == timeless(expected.0) && found.1 == expected.1, "{:?}", request.options);
    }
    // After all of them a target of zero is the committed state.
    cell.restore(&state).unwrap();
    let still = cell.trial(&Tensor2::ZERO, &with_reduction(TangentKind::None, 0.0)).unwrap();
    assert!(still.flags.contains(TrialFlags::SKIPPED_NULL_TARGET));
}

/// Without any strain the grains give way where their contacts carry more than the friction that is left, and come to rest below it.
#[test]
fn grains_find_a_new_equilibrium_when_friction_falls_under_their_state() {
    let mut cell = GrainRve::new(&hundred_discs(coarse())).unwrap();
    let loaded = cell.trial(&in_plane([[2e-3, 0.0], [0.0, -4e-3]]), &with_reduction(TangentKind::None, 0.0)).unwrap();
    cell.commit().unwrap();
    let friction = sand().friction;
    let most = |cell: &GrainRve| {
        let network = cell.network().unwrap();
        let ratios = network.contacts.iter().map(|contact| (contact.tangential_force / contact.normal_force).abs());
        ratios.fold(0.0, f64::max)
    };
    let still = cell.trial(&Tensor2::ZERO, &with_reduction(TangentKind::None, 0.0)).unwrap();
    assert!(still.stress == loaded.stress && (most(&cell) / friction - 1.0).abs() < 1e-9, "some contacts slide");
    let mut deviator = loaded.stress.get(0, 0) - loaded.stress.get(1, 1);
    for reduction in [0.2, 0.4, 0.6] {
        let answer = cell.trial(&Tensor2::ZERO, &with_reduction(TangentKind::None, reduction)).unwrap();
        assert!(!answer.flags.contains(TrialFlags::SKIPPED_NULL_TARGET));
        assert!(!answer.flags.contains(TrialFlags::NOT_EQUILIBRATED));
        let limit = friction * (1.0 - reduction);
        assert!(most(&cell) <= limit * (1.0 + 1e-9), "{} above {limit}", most(&cell));
        // Held in place, the cell carries less and less deviator.
        let now = answer.stress.get(0, 0) - answer.stress.get(1, 1);
        assert!(now < deviator, "{now} after {deviator}");
        deviator = now;
        cell.commit().unwrap();
    }
    // Back at the whole friction nothing moves: the state is one of rest there too.
    let back = cell.trial(&Tensor2::ZERO, &with_reduction(TangentKind::None, 0.0)).unwrap();
    assert_eq!(back.stress.get(0, 0) - back.stress.get(1, 1), deviator);
}

/// Closed form: the contacts of a sheared square lattice slide at `(1 - r) mu` times their normal force.
#[test]
fn sliding_contacts_of_a_lattice_carry_the_friction_that_is_left() {
    let friction = 0.3;
    let mut cell = GrainRve::new(&lattice(SQUARE, 1e-2, ContactTable::linear(1000.0, 0.5, friction))).unwrap();
    assert_eq!(cell.model().options.tolerance, tight().tolerance);
    for reduction in [0.0, 0.25, 0.5, 1.0] {
        cell.trial(&in_plane([[0.0, 4e-3], [4e-3, 0.0]]), &with_reduction(TangentKind::None, reduction)).unwrap();
        for contact in &cell.network().unwrap().contacts {
            let ratio = contact.tangential_force.abs() / contact.normal_force.abs();
            // A contact that sticks: k_t s / k_n o, with the slip s of the shear and the overlap o of the longer branch.
            let (shear, branch) = (4e-3_f64, 0.99);
            let stuck = 0.5 * shear * branch / (1.0 - branch * (1.0 + shear * shear).sqrt());
            let left = friction * (1.0 - reduction);
            let (expected, within) = if left < stuck { (left, 1e-9) } else { (stuck, 1e-4) };
            assert!((ratio - expected).abs() <= within, "{ratio} for {expected} with {reduction}");
        }
    }
}

#[test]
fn a_share_that_is_none_is_refused_and_changes_nothing() {
    let mut cell = GrainRve::new(&hundred_discs(coarse())).unwrap();
    let target = in_plane([[0.0, 0.0], [0.0, -1e-5]]);
    let before = timeless(cell.trial(&target, &with_reduction(TangentKind::None, 0.0)).unwrap());
    for share in [-0.1, 1.5, f64::NAN] {
        match cell.trial(&target, &with_reduction(TangentKind::None, share)) {
            Err(RveError::Unsupported(text)) => assert!(text.contains("between 0 and 1"), "{text}"),
            other => panic!("{share}: {other:?}"),
        }
    }
    assert!(timeless(cell.trial(&target, &with_reduction(TangentKind::None, 0.0)).unwrap()) == before);
}
