//! Attacks on a cell: each must end in a right answer or in a refusal that says why.

use crate::samples::{TRIANGULAR, border_stress, hundred_discs, lattice, tight, trial};
use claims::Claim;
use protocol::{Observables, RveError, RveSolver, TangentKind, Tensor2, TrialFlags, TrialOptions, TrialResult};
use rve_server::contact::ContactTable;
use rve_server::definition::RveOptions;
use rve_server::engine::GrainRve;
use rve_server::space::plane::{self, Plane};

const PRESSURE: f64 = 1e5;

fn coarse() -> RveOptions {
    RveOptions { strain_per_step: Some(5e-6), tolerance: Some(1e-4), ..RveOptions::default() }
}

fn difference(a: &Plane, b: &Plane) -> f64 {
    plane::largest_component(&plane::add_scaled(a, -1.0, b)) / PRESSURE
}

fn mean_overlap(cell: &GrainRve) -> f64 {
    let contacts = &cell.network().unwrap().contacts;
    contacts.iter().map(|contact| -contact.normal_force / contact.normal_stiffness).sum::<f64>()
        / contacts.len() as f64
}

/// S-1: before the packing yields the stress does not depend on how the way is split, and in no step do the grains move
/// by more than a twentieth of their overlap against each other.
#[test]
fn one_call_or_a_hundred_lead_to_the_same_stress() {
    for direction in [[[0.0, 0.0], [0.0, -1.0]], [[0.0, 0.5], [0.5, 0.0]]] {
        let end_after = |calls: u32| {
            let options = RveOptions { strain_per_step: Some(1e-6), ..coarse() };
            let mut cell = GrainRve::new(&hundred_discs(options)).unwrap();
            let size = 1e-3 / f64::from(calls);
            let mut stress = [[0.0; 2]; 2];
            for _ in 0..calls {
                let answer = trial(&mut cell, &plane::add_scaled(&[[0.0; 2]; 2], size, &direction));
                let diameter = 2.0 * cell.model().largest_radius();
                let moved = size / answer.cost.ramp_steps as f64 * diameter;
                let quantity = "motion of the grains in a step, of their mean overlap";
                Claim::of("S-1", quantity).number(moved / mean_overlap(&cell)).at_most(0.05);
                cell.commit().unwrap();
                stress = answer.stress.plane();
            }
            stress
        };
        let once = end_after(1);
        for calls in [10, 100] {
            let error = difference(&end_after(calls), &once);
            let quantity = format!("stress after {calls} calls against one call, of the pressure");
            Claim::of("S-1", &quantity).error(error).within(5e-3);
        }
    }
}

/// S-1, the ends of the range: a target of 1e-6 is answered like any other, one of 0.2 is answered and says what it has
/// done to the grains, one beyond is refused.
#[test]
fn tiny_and_huge_targets_are_answered_or_refused() {
    let options = RveOptions { strain_per_step: Some(2e-5), ..coarse() };
    for direction in [[[0.0, 0.0], [0.0, -1.0]], [[0.0, 1.0], [0.0, 0.0]]] {
        let at = |size: f64| plane::add_scaled(&[[0.0; 2]; 2], size, &direction);
        let mut cell = GrainRve::new(&hundred_discs(options.clone())).unwrap();
        let before = cell.observe(Observables::NONE).unwrap().stress.plane();
        let small = trial(&mut cell, &at(1e-6));
        let change = difference(&small.stress.plane(), &before);
        assert!(change > 0.0, "{change:e}");
        Claim::of("S-1", "change of the stress by a strain of 1e-6, of the pressure").number(change).at_most(5e-3);
        let answer = trial(&mut cell, &at(0.19));
        let is_answered = answer.stress.is_finite() && !answer.flags.contains(TrialFlags::NOT_EQUILIBRATED);
        Claim::of("S-1", "a strain of 0.19 ends at rest with a finite stress").holds(is_answered);
        // Compressed by a fifth, grains as stiff as a thousand pressures overlap by more than a tenth.
        let is_compressed = direction[1][1] != 0.0;
        assert_eq!(answer.flags.contains(TrialFlags::LARGE_OVERLAP), is_compressed);
        let refusal = cell.trial(&Tensor2::from_plane(at(0.5)), &TrialOptions::default());
        let is_refused = matches!(refusal, Err(RveError::TargetTooLarge { .. }));
        Claim::of("S-1", "a strain of 0.5 is refused as too large").holds(is_refused);
    }
}

/// S-2: expanded until nothing touches, a cell has no stress and no stiffness and says so. S-3: pressed together again it
/// carries its pressure again, and contacts begin without a tangential force.
#[test]
fn a_cell_that_came_apart_bears_no_load_until_it_is_pressed_together() {
    let mut cell = GrainRve::new(&hundred_discs(RveOptions { strain_per_step: Some(2e-5), ..coarse() })).unwrap();
    let options = TrialOptions {
        tangent: TangentKind::TrussLikeSlip,
        observables: Observables::ALL,
        ramp_steps: 0,
        ..TrialOptions::default()
    };
    let mut go = |size: f64| -> (TrialResult, GrainRve) {
        let answer = cell.trial(&Tensor2::from_plane([[size, 0.0], [0.0, size]]), &options).unwrap();
        cell.commit().unwrap();
        (answer, cell.clone())
    };
    let (apart, expanded) = go(0.02);
    let is_told = apart.flags.contains(TrialFlags::NO_LOAD_BEARING_CONTACTS);
    Claim::of("S-2", "a cell that came apart says that nothing bears load").holds(is_told);
    for value in apart.stress.0 {
        Claim::of("S-2", "stress of a cell that came apart, Pa").value(value, 0.0).within_absolute(0.0);
    }
    for value in apart.tangent.unwrap().0 {
        Claim::of("S-2", "stiffness of a cell that came apart, Pa").value(value, 0.0).within_absolute(0.0);
    }
    assert_eq!((apart.scalars.coordination_number, apart.scalars.max_overlap_ratio), (0.0, 0.0));
    assert_eq!((apart.observed.elastic_energy, apart.observed.sliding_fraction), (0.0, 0.0));
    assert!(expanded.committed().contacts.is_empty());
    let (still_apart, _) = go(1e-3);
    assert!(
        still_apart.flags.contains(TrialFlags::NO_LOAD_BEARING_CONTACTS)
            && still_apart.scalars.unbalanced_force_ratio == 0.0
    );

    // Back to the area of the start.
    let (back, _) = go(1.0 / (1.02 * 1.001) - 1.0);
    let pressed = [2e-3, 2e-3].map(|step| go(-step).0);
    let pressure = |answer: &TrialResult| -0.5 * (answer.stress.get(0, 0) + answer.stress.get(1, 1)) / PRESSURE;
    let rises = pressure(&back) < pressure(&pressed[0]) && pressure(&pressed[0]) < pressure(&pressed[1]);
    Claim::of("S-3", "the pressure rises with every compression").holds(rises);
    let quantity = "pressure at 0.4 % less than the first length, over the first pressure";
    Claim::of("S-3", quantity).number(pressure(&pressed[1])).at_least(1.0);
    assert!(!pressed[1].flags.contains(TrialFlags::NO_LOAD_BEARING_CONTACTS) && pressed[1].tangent.is_some());
    let network = cell.network();
    assert!(network.is_none(), "committed");
    let frozen = cell.committed_network().unwrap();
    for contact in &frozen.contacts {
        let limit = frozen.friction * contact.normal_force.abs();
        let quantity = "tangential force over the friction limit, contacts that closed again";
        Claim::of("S-3", quantity).number(contact.tangential_force.abs() / limit).at_most(1.0 + 1e-12);
    }
}

/// S-7: four discs in a cell that is smaller than two contact ranges answer as one.
#[test]
fn cells_smaller_than_the_contact_range_are_exact() {
    let strain = [[2e-4, 1e-4], [0.0, -3e-4]];
    let one = lattice(TRIANGULAR, 1e-3, ContactTable::linear(1.0, 0.5, 1e9));
    let mut four = one.clone();
    let rows = one.packing.periodicity;
    let centre = |i: f64, j: f64| {
        let at = |axis: usize| one.packing.grains[0][axis] + i * rows[0][axis] + j * rows[1][axis];
        [at(0), at(1), 0.5]
    };
    four.packing.grains = vec![centre(0.0, 0.0), centre(1.0, 0.0), centre(0.0, 1.0), centre(1.0, 1.0)];
    four.packing.periodicity = rows.map(|row| row.map(|value| 2.0 * value));
    let [single, quadruple] =
        [one, four].map(|definition| trial(&mut GrainRve::new(&definition).unwrap(), &strain).stress.plane());
    let scale = plane::largest_component(&single);
    let error = plane::largest_component(&plane::add_scaled(&quadruple, -1.0, &single)) / scale;
    Claim::of("S-7", "stress of a crystal, cell of four discs against one disc").error(error).within(1e-9);
}

/// S-13: a crystal in which every fifth grain touches nothing. The network operator needs no help, and the stress from
/// the border is that of the contacts.
#[test]
fn a_fifth_of_rattlers_harms_neither_stress_nor_operator() {
    let one = lattice(TRIANGULAR, 1e-3, ContactTable::linear(1.0, 0.5, 1e9));
    let rows = one.packing.periodicity;
    let mut definition = one.clone();
    // One grain of each five in a row, two further on in the next: no two rattlers are neighbours.
    definition.packing.grains = (0..25)
        .map(|number| {
            let (i, j) = (number % 5, number / 5);
            let at = |axis: usize| f64::from(i) * rows[0][axis] + f64::from(j) * rows[1][axis];
            [at(0), at(1), if (i + 3 * j) % 5 == 0 { 0.3 } else { 0.5 }]
        })
        .collect();
    definition.packing.periodicity = rows.map(|row| row.map(|value| 5.0 * value));
    let mut cell = GrainRve::new(&definition).unwrap();
    let options = TrialOptions {
        tangent: TangentKind::TrussLike,
        observables: Observables::ALL,
        ramp_steps: 0,
        ..TrialOptions::default()
    };
    let answer = cell.trial(&Tensor2::from_plane([[1e-5, 0.0], [0.0, -3e-5]]), &options).unwrap();
    assert!(!answer.flags.contains(TrialFlags::NOT_EQUILIBRATED), "{:?}", answer.flags);
    let is_regular = ![TrialFlags::TANGENT_FALLBACK, TrialFlags::TANGENT_REGULARISED]
        .into_iter()
        .any(|flag| answer.flags.contains(flag));
    Claim::of("S-13", "the operator of discs of which a fifth bears nothing is regular").holds(is_regular);
    let rattlers = cell.committed_network().unwrap();
    assert_eq!(rattlers.contacts.len(), 25 * 3 - 5 * 6);
    let network = cell.network().unwrap();
    let scale = plane::largest_component(&network.stress());
    let jump = plane::add_scaled(&network.stress(), -1.0, &border_stress(network));
    let error = plane::largest_component(&jump) / scale / answer.scalars.unbalanced_force_ratio.max(1e-12);
    let quantity = "stress from the border against the contacts, discs, in unbalanced force ratios";
    Claim::of("S-13", quantity).error(error).within(1.0);
    let operator = answer.tangent.unwrap().plane();
    let step = 1e-8;
    let stress =
        |cell: &mut GrainRve, sign: f64| trial(cell, &[[1e-5 + sign * step, 0.0], [0.0, -3e-5]]).stress.plane();
    let [plus, minus] = [1.0, -1.0].map(|sign| stress(&mut cell, sign));
    let perturbed = (plus[0][0] - minus[0][0]) / (2.0 * step);
    let quantity = "stiffness C1111 against perturbations, a fifth of the discs bears nothing, Pa";
    Claim::of("S-13", quantity).value(perturbed, operator[0][0]).within(1e-3);
}

/// D-11: before anything yields, a packing and four copies of it side by side have the same stress and the same operator.
#[test]
fn four_copies_of_a_packing_answer_as_one() {
    let mut one = hundred_discs(RveOptions { tolerance: Some(1e-10), ..tight() });
    one.contact.friction = 1e9;
    // Listed forces belong to one numbering; both cells start from the same geometry without them.
    one.packing.contacts.clear();
    let mut four = one.clone();
    let rows = one.packing.periodicity;
    four.packing.grains = (0..4)
        .flat_map(|copy| {
            let shift = |axis: usize| f64::from(copy % 2) * rows[0][axis] + f64::from(copy / 2) * rows[1][axis];
            let shift = [shift(0), shift(1)];
            one.packing.grains.iter().map(move |[x, y, radius]| [x + shift[0], y + shift[1], *radius])
        })
        .collect();
    four.packing.periodicity = rows.map(|row| row.map(|value| 2.0 * value));
    let options = TrialOptions { tangent: TangentKind::TrussLike, ..TrialOptions::default() };
    let [first, second] = [one, four].map(|definition| {
        let mut cell = GrainRve::new(&definition).unwrap();
        cell.trial(&Tensor2::from_plane([[1e-5, 5e-6], [5e-6, -2e-5]]), &options).unwrap()
    });
    let error = difference(&first.stress.plane(), &second.stress.plane());
    Claim::of("D-11", "stress of four copies against one packing, of the pressure").error(error).within(1e-6);
    let [first, second] = [first, second].map(|answer| answer.tangent.unwrap().0);
    let scale = first.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
    let error = first.iter().zip(&second).fold(0.0, |worst: f64, (a, b)| worst.max((a - b).abs())) / scale;
    Claim::of("D-11", "operator of four copies against one packing").error(error).within(1e-6);
}
