//! When a trial ends: the three criteria by their definitions, the step cap, and damping that stays stable at the bound.

use crate::samples::{TRIANGULAR, hundred_discs, lattice, trial};
use protocol::{RveError, RveSolver, Tensor2, TrialFlags, TrialOptions, TrialRequest};
use rve_server::cell::ContactNetwork;
use rve_server::contact::ContactTable;
use rve_server::definition::{AtStepCap, Criterion, Damping, GrainDefinition, ListedContact, Packing, RveOptions};
use rve_server::engine::GrainRve;

const STRAIN: [[f64; 2]; 2] = [[2e-4, 1e-4], [1e-4, -4e-4]];

fn draft() -> RveOptions {
    RveOptions { strain_per_step: Some(5e-6), ..RveOptions::default() }
}

/// Squared force and squared moment over radius left on every grain, N2, from the contacts of a network.
fn squares_out_of_balance(network: &ContactNetwork) -> Vec<[f64; 2]> {
    let mut sums = vec![[0.0; 3]; network.radii.len()];
    for contact in &network.contacts {
        let (force, branch) = (network.force(contact), network.branch(contact));
        let length = branch[0].hypot(branch[1]);
        let ends = [contact.origin as usize, contact.end as usize];
        let [first, second] = ends.map(|grain| network.radii[grain]);
        let overlap = first + second - length;
        for (grain, sign, radius) in [(ends[0], 1.0, first), (ends[1], -1.0, second)] {
            sums[grain][0] += sign * force[0];
            sums[grain][1] += sign * force[1];
            sums[grain][2] += contact.tangential_force * (radius - 0.5 * overlap) / radius;
        }
    }
    sums.iter().map(|[x, y, turning]| [x * x + y * y, turning * turning]).collect()
}

/// `max_force`: largest force or moment over radius left on a grain over the mean normal force [Argilaga2018].
/// `rms_force`: root mean square of what is left over that of the contact forces, [Liu2015] eq. 57.
#[test]
fn force_criteria_are_what_they_are_called() {
    for criterion in [Criterion::MaxForce, Criterion::RmsForce] {
        let options = RveOptions { criterion, tolerance: Some(1e-3), ..draft() };
        let mut cell = GrainRve::new(&hundred_discs(options)).unwrap();
        let answer = trial(&mut cell, &STRAIN);
        let reported = answer.scalars.unbalanced_force_ratio;
        assert!(reported <= 1e-3 && !answer.flags.contains(TrialFlags::NOT_EQUILIBRATED));
        let network = cell.network().unwrap();
        let (squares, contacts) = (squares_out_of_balance(network), network.contacts.len() as f64);
        let expected = if criterion == Criterion::MaxForce {
            let largest = squares.iter().flatten().fold(0.0, |largest: f64, square| largest.max(*square)).sqrt();
            let mean = network.contacts.iter().map(|contact| contact.normal_force.abs()).sum::<f64>() / contacts;
            largest / mean
        } else {
            let left = squares.iter().flatten().sum::<f64>() / squares.len() as f64;
            let carried = network.contacts.iter().map(|contact| {
                let [x, y] = network.force(contact);
                x * x + y * y
            });
            (left / (carried.sum::<f64>() / contacts)).sqrt()
        };
        assert!((reported / expected - 1.0).abs() < 1e-6, "{criterion:?}: {reported:e} against {expected:e}");
    }
}

/// `energy`: kinetic over stored energy [Liu2018], ten evaluations in a row, so that a turning point of the motion does
/// not pass for rest; a tolerance that every evaluation meets therefore costs ten of the hold.
#[test]
fn energy_criterion_waits_for_ten_hits() {
    let evaluations = |criterion: Criterion, tolerance: f64| {
        let options = RveOptions { criterion, tolerance: Some(tolerance), ..draft() };
        let mut cell = GrainRve::new(&hundred_discs(options)).unwrap();
        let options = TrialOptions { ramp_steps: 50, ..TrialOptions::default() };
        let answer = cell.trial(&Tensor2::from_plane(STRAIN), &options).unwrap();
        assert!(answer.scalars.unbalanced_force_ratio <= tolerance);
        answer.cost.force_evaluations
    };
    // One evaluation of the given state, fifty of the ramp, ten of the hold.
    assert_eq!(evaluations(Criterion::Energy, 1e9), 61);
    let [loose, tight] = [1e-4, 1e-12].map(|tolerance| evaluations(Criterion::Energy, tolerance));
    assert!(loose < tight, "{loose} evaluations at 1e-4, {tight} at 1e-12");
}

fn gave_up(answer: Result<protocol::TrialResult, RveError>) -> [f64; 7] {
    match answer {
        Err(RveError::NotEquilibrated {
            strain,
            target,
            increments,
            of,
            unbalanced,
            tolerance,
            force_evaluations,
        }) => [strain, target, increments as f64, of as f64, unbalanced, tolerance, force_evaluations as f64],
        other => panic!("{other:?}"),
    }
}

/// A cap that strikes in the ramp or in the hold says how far the trial got; the committed state is as it was, and a
/// target within reach is answered afterwards.
#[test]
fn step_cap_says_how_far_the_trial_got() {
    let target = Tensor2::from_plane(STRAIN);
    let options = RveOptions { max_evaluations: Some(60), ..draft() };
    let mut cell = GrainRve::new(&hundred_discs(options)).unwrap();
    let before = cell.committed().clone();
    let [strain, whole, increments, of, unbalanced, tolerance, evaluations] =
        gave_up(cell.trial(&target, &TrialOptions { ramp_steps: 80, ..TrialOptions::default() }));
    // The first evaluation is that of the given state.
    assert_eq!([increments, of, evaluations], [59.0, 80.0, 60.0]);
    assert!((strain / whole - 59.0 / 80.0).abs() < 1e-12 && (whole / 4e-4 - 1.0).abs() < 1e-2, "{strain} of {whole}");
    assert!(unbalanced.is_finite() && unbalanced > 0.0 && tolerance == 1e-3);
    assert_eq!(*cell.committed(), before);
    assert!(cell.commit().is_err(), "a trial that gave up leaves nothing to commit");
    let small = cell.trial(&Tensor2::from_plane([[1e-7, 0.0], [0.0, 0.0]]), &TrialOptions::default()).unwrap();
    assert!(small.cost.force_evaluations <= 60);

    let options =
        RveOptions { max_steps: Some(20), at_step_cap: AtStepCap::Refuse, tolerance: Some(1e-9), ..draft() };
    let mut cell = GrainRve::new(&hundred_discs(options)).unwrap();
    let refusal = cell.trial(&target, &TrialOptions { ramp_steps: 80, ..TrialOptions::default() });
    let text = refusal.clone().unwrap_err().to_string();
    assert!(text.contains("80 of 80 increments") && text.contains("101 force evaluations"), "{text}");
    let [strain, whole, increments, of, unbalanced, ..] = gave_up(refusal);
    assert_eq!([strain, increments], [whole, of]);
    assert!(unbalanced > 1e-9);
}

/// Definitions that differ in the places of their grains only are solved side by side, and nobody can tell.
#[test]
fn cells_of_several_definitions_in_lanes_are_as_they_are_alone() {
    let definitions: Vec<GrainDefinition> = [0.0, 0.4, 1.1]
        .iter()
        .map(|&angle| {
            let whole = hundred_discs(draft());
            let Packing::Discs(packing) = Packing::Discs(whole.packing.clone()).rotated(angle).unwrap() else {
                panic!("discs stay discs")
            };
            GrainDefinition { packing, ..whole }
        })
        .collect();
    let mut cells: Vec<GrainRve> = definitions.iter().map(|definition| GrainRve::new(definition).unwrap()).collect();
    let identities: Vec<_> = cells.iter().map(|cell| cell.model_identity().unwrap()).collect();
    assert!(identities[0] == identities[1] && identities[0] == identities[2]);
    let other = GrainRve::new(&hundred_discs(RveOptions { max_evaluations: Some(70), ..draft() })).unwrap();
    assert_ne!(other.model_identity().unwrap(), identities[0]);
    let states: Vec<Vec<u8>> = cells
        .iter()
        .map(|cell| {
            let mut state = Vec::new();
            cell.snapshot(&mut state);
            state
        })
        .collect();
    let requests: Vec<TrialRequest<'_>> = (0..7)
        .map(|number| TrialRequest {
            definition: cells[number % 3].definition_id(),
            state: &states[number % 3],
            // The first moves nothing, and is answered without the solver.
            target: Tensor2::from_plane(STRAIN.map(|row| row.map(|value| 0.02 * number as f64 * value))),
            options: TrialOptions::default(),
        })
        .collect();
    let together = cells[1].solve_batch(&requests);
    for (number, (request, found)) in requests.iter().zip(together).enumerate() {
        let (answer, state) = found.unwrap();
        let (expected, expected_state) = protocol::solve_alone(&mut cells[number % 3], request).unwrap();
        assert_eq!((answer.stress, answer.flags), (expected.stress, expected.flags), "{number}");
        assert_eq!(state, expected_state, "{number}");
    }
}

/// Cells side by side give up as single cells do, and their mates do not notice.
#[test]
fn step_cap_in_lanes_is_that_of_single_cells() {
    let options = RveOptions { max_evaluations: Some(70), ..draft() };
    let definition = hundred_discs(options);
    let mut cell = GrainRve::new(&definition).unwrap();
    let mut state = Vec::new();
    cell.snapshot(&mut state);
    let questions: Vec<TrialRequest<'_>> = [10u32, 90, 20, 200, 30]
        .iter()
        .map(|&ramp_steps| TrialRequest {
            definition: cell.definition_id(),
            state: &state,
            target: Tensor2::from_plane(STRAIN.map(|row| row.map(|value| 0.1 * value))),
            options: TrialOptions { ramp_steps, ..TrialOptions::default() },
        })
        .collect();
    let together = cell.solve_batch(&questions);
    assert_eq!(together.iter().map(Result::is_ok).collect::<Vec<_>>(), [true, false, true, false, true]);
    for (question, found) in questions.iter().zip(&together) {
        let mut alone = GrainRve::new(&definition).unwrap();
        match (alone.trial(&question.target, &question.options), found) {
            (Ok(answer), Ok((found, _))) => assert_eq!(answer.stress, found.stress),
            (Err(reason), Err(found)) => assert_eq!(reason, *found),
            (alone, together) => panic!("{alone:?} alone, {together:?} in lanes"),
        }
    }
}

/// All grains of a triangular crystal with `k_t = k_n` spinning alike are its fastest motion and meet the stiffness bound
/// exactly. A descent, which FIRE is while the power of the forces is negative, is stable for half of the frequency that
/// free motion allows: at the full step this crystal would spin ever faster. At the step in force the worst mode loses 4 %
/// a step.
#[test]
fn crystals_that_meet_the_stiffness_bound_come_to_rest() {
    for (damping, most) in [(Damping::Fire, 600), (Damping::Kinetic, 1000), (Damping::Local, 1000)] {
        for ratio in [0.5, 1.0, 2.0] {
            let overlap = 1e-3;
            let mut definition = lattice(TRIANGULAR, overlap, ContactTable::linear(1.0, ratio, 0.5));
            definition.options = RveOptions { damping, tolerance: Some(1e-9), ..draft() };
            // The same tangential force in every contact: a moment on the grain and nothing else.
            definition.packing.contacts = [[1, 0], [0, 1], [-1, 1]]
                .map(|shift| ListedContact { origin: 0, end: 0, shift, tangential_force: 0.2 * overlap })
                .to_vec();
            let mut cell = GrainRve::new(&definition).unwrap();
            assert_eq!(cell.listed_forces().dropped, 0);
            let answer = trial(&mut cell, &[[1e-6, 0.0], [0.0, 0.0]]);
            assert!(!answer.flags.contains(TrialFlags::NOT_EQUILIBRATED), "{damping:?}, k_t/k_n {ratio}");
            assert!(answer.cost.force_evaluations <= most, "{damping:?} {ratio}: {}", answer.cost.force_evaluations);
        }
    }
}
