//! Every cell comes to rest: away from the cells that the solver was tuned on, and where nothing is left to carry load.

use crate::samples::packing_of;
use claims::Claim;
use protocol::{Observables, RveSolver, TangentKind, Tensor2, TrialFlags, TrialOptions, TrialResult};
use rve_server::contact::ContactTable;
use rve_server::definition::{AtStepCap, Damping, GrainDefinition, RveOptions};
use rve_server::engine::GrainRve;
use rve_server::solver::SolverFor;
use rve_server::space::{Discs, Spheres};

fn options(damping: Damping) -> RveOptions {
    RveOptions { strain_per_step: Some(1e-5), tolerance: Some(1e-3), damping, ..RveOptions::default() }
}

fn cell<S: SolverFor>(name: &str, contact: &ContactTable, options: RveOptions) -> GrainRve<S> {
    let definition = GrainDefinition { packing: packing_of::<S>(name), contact: contact.clone(), options };
    GrainRve::new(&definition).unwrap()
}

fn linear(modulus: f64, ratio: f64, friction: f64) -> ContactTable {
    ContactTable { normal_stiffness: None, modulus: Some(modulus), ..ContactTable::linear(1.0, ratio, friction) }
}

fn target(components: [f64; 4]) -> Tensor2 {
    let [xx, yy, zz, xy] = components;
    Tensor2([xx, xy, 0.0, 0.0, yy, 0.0, 0.0, 0.0, zz])
}

fn pressure(answer: &TrialResult, dimension: usize) -> f64 {
    -(0..dimension).map(|i| answer.stress.get(i, i)).sum::<f64>() / dimension as f64
}

/// Strains a cell in equal increments and returns how many of them did not end at rest, and the costliest.
fn strained<S: SolverFor>(cell: &mut GrainRve<S>, step: [f64; 4], increments: u32) -> (u32, u64) {
    let (mut restless, mut largest) = (0, 0);
    for _ in 0..increments {
        let answer = cell.trial(&target(step), &TrialOptions::default()).unwrap();
        restless += u32::from(answer.flags.contains(TrialFlags::NOT_EQUILIBRATED));
        largest = largest.max(answer.cost.force_evaluations);
        cell.commit().unwrap();
    }
    (restless, largest)
}

/// States that every increment of a cell ended at rest.
fn ends_at_rest(kind: &str, restless: u32) {
    let quantity = format!("increments that do not end at rest, {kind}");
    Claim::of("S-5", &quantity).value(f64::from(restless), 0.0).within_absolute(0.0);
}

/// States that the costliest increment of a cell took less than 4000 evaluations.
fn ends_soon(kind: &str, largest: u64) {
    let quantity = format!("force evaluations of the costliest increment, {kind}");
    Claim::of("S-5", &quantity).number(largest as f64).at_most(3_999.0);
}

/// S-5: tangential springs as stiff as the normal ones, and stiffer: sheared cells have just below four contacts a grain, and their
/// rotation modes meet the stability bound exactly.
#[test]
fn sheared_cells_of_any_tangential_stiffness_come_to_rest() {
    for ratio in [0.2, 0.67, 0.8, 1.0, 1.3] {
        for friction in [0.1, 0.5, 1.0] {
            for modulus in [6e6, 1e8] {
                for damping in [Damping::Fire, Damping::Kinetic] {
                    let contact = linear(modulus, ratio, friction);
                    let mut discs = cell::<Discs>("discs-100.json", &contact, options(damping));
                    let (restless, largest) = strained(&mut discs, [1e-3, -1e-3, 0.0, 0.0], 12);
                    ends_at_rest("sheared discs", restless);
                    ends_soon("sheared discs", largest);
                    let mut spheres = cell::<Spheres>("spheres-100.json", &contact, options(damping));
                    let (restless, largest) = strained(&mut spheres, [5e-4, 5e-4, -1e-3, 0.0], 4);
                    ends_at_rest("sheared spheres", restless);
                    ends_soon("sheared spheres", largest);
                }
            }
        }
    }
}

/// S-5: contact viscosity holds nothing back: sliding contacts, of which cells of little friction have many, once resisted by it alone,
/// and most increments ended with forces 10 to 60 times the tolerance out of balance.
#[test]
fn cells_with_contact_viscosity_come_to_rest() {
    for viscosity in [0.5, 1.0] {
        for ratio in [0.2, 1.3] {
            for friction in [0.02, 0.3] {
                let contact = ContactTable { damping: viscosity, ..linear(1e8, ratio, friction) };
                let mut discs = cell::<Discs>("discs-100.json", &contact, options(Damping::Fire));
                let (restless, _) = strained(&mut discs, [1e-3, -1e-3, 0.0, 0.0], 10);
                ends_at_rest("discs with contact viscosity", restless);
                let mut spheres = cell::<Spheres>("spheres-100.json", &contact, options(Damping::Fire));
                let (restless, largest) = strained(&mut spheres, [5e-4, 5e-4, -1e-3, 0.0], 5);
                ends_at_rest("spheres with contact viscosity", restless);
                ends_soon("spheres with contact viscosity", largest);
            }
        }
    }
}

/// S-5: a cell that its contact law can no longer hold up (without friction, or without tangential springs, from a packing that
/// needs them) comes apart in the time of an ordinary trial, says so, and costs next to nothing from then on.
#[test]
fn a_cell_that_loses_its_load_says_so_at_once() {
    let hertz = ContactTable::hertz_mindlin(1e9, 0.2, 0.0);
    lost::<Discs>("discs-100.json", "frictionless discs", &linear(1e8, 0.5, 0.0));
    lost::<Discs>("discs-100.json", "discs without tangential springs", &linear(1e8, 0.0, 0.5));
    lost::<Spheres>("spheres-100.json", "spheres without tangential springs", &linear(1e8, 0.0, 0.5));
    lost::<Spheres>("spheres-100.json", "frictionless Hertzian spheres", &hertz);
}

fn lost<S: SolverFor>(packing: &str, name: &str, contact: &ContactTable) {
    let mut cell = cell::<S>(packing, contact, options(Damping::Fire));
    let before = pressure(&cell.observe(protocol::Observables::NONE).unwrap(), S::DIMENSION);
    // A little room, then sheared at constant volume.
    let mut out = [0.0; 4];
    out[..S::DIMENSION].fill(4e-3);
    let options = TrialOptions { tangent: TangentKind::TrussLike, ..TrialOptions::default() };
    let mut evaluations = Vec::new();
    for step in [out, [0.0, 0.0, 0.0, 1e-3], [0.0, 0.0, 0.0, 1e-3]] {
        let answer = cell.trial(&target(step), &options).unwrap();
        assert!(!answer.flags.contains(TrialFlags::NOT_EQUILIBRATED), "{name}: {:?}", answer.scalars);
        let is_told = answer.flags.contains(TrialFlags::NO_LOAD_BEARING_CONTACTS);
        Claim::of("S-5", "a cell that has lost its load says so").holds(is_told);
        for value in answer.stress.0 {
            let quantity = "stress in a cell that has lost its load, of the pressure before";
            Claim::of("S-5", quantity).error(value / before).within(1e-3);
        }
        assert!(answer.tangent.unwrap().0.iter().all(|value| *value == 0.0), "{name}");
        evaluations.push(answer.cost.force_evaluations);
        cell.commit().unwrap();
    }
    let costs = |quantity: &str, evaluations: u64, limit: f64| {
        Claim::of("S-5", quantity).number(evaluations as f64).at_most(limit);
    };
    costs("force evaluations as a cell loses its load", evaluations[0], 5_999.0);
    for count in &evaluations[1..] {
        costs("force evaluations of a trial after a cell has lost its load", *count, 1_999.0);
    }
    // Pressed together again it carries load, comes to rest and says nothing.
    let mut back = [0.0; 4];
    back[..S::DIMENSION].fill(-1e-3);
    let mut last = None;
    for _ in 0..12 {
        last = Some(cell.trial(&target(back), &options).unwrap());
        cell.commit().unwrap();
    }
    let last = last.unwrap();
    let flags = last.flags;
    assert!(
        !flags.contains(TrialFlags::NO_LOAD_BEARING_CONTACTS) && !flags.contains(TrialFlags::NOT_EQUILIBRATED),
        "{name}"
    );
    assert!(pressure(&last, S::DIMENSION) > before, "{name}: {} of {before}", pressure(&last, S::DIMENSION));
}

/// A tolerance below what rounding leaves: the trial is changed twice, ends long before its step cap, says both, and is the same
/// in a batch. Refused, it names how far it got.
#[test]
fn a_trial_without_headway_ends_soon_and_says_so() {
    let contact = linear(1e8, 0.5, 0.5);
    let endless = RveOptions { tolerance: Some(1e-18), max_steps: Some(1_000_000), ..options(Damping::Fire) };
    let mut discs = cell::<Discs>("discs-100.json", &contact, endless.clone());
    let step = target([1e-4, -1e-4, 0.0, 0.0]);
    let answer = discs.trial(&step, &TrialOptions::default()).unwrap();
    assert!(
        answer.flags.contains(TrialFlags::NOT_EQUILIBRATED) && answer.flags.contains(TrialFlags::DAMPING_CHANGED)
    );
    assert!(answer.cost.force_evaluations < 20_000, "{:?}", answer.cost);
    assert!(answer.scalars.unbalanced_force_ratio < 1e-10, "{:?}", answer.scalars);

    let refusing = RveOptions { at_step_cap: AtStepCap::Refuse, ..endless };
    let refusal =
        cell::<Discs>("discs-100.json", &contact, refusing).trial(&step, &TrialOptions::default()).unwrap_err();
    assert!(refusal.to_string().contains("did not come to rest"), "{refusal}");
}

/// Listed tangential forces of a law without tangential springs are dropped and counted.
#[test]
fn contacts_without_tangential_springs_carry_no_tangential_force() {
    let discs = cell::<Discs>("discs-100.json", &linear(1e8, 0.0, 0.5), RveOptions::default());
    assert!(discs.committed().contacts.iter().all(|contact| contact.tangential_force == 0.0));
    assert!(discs.listed_forces().springless > 50);
    assert!(discs.listed_forces().warning().unwrap().contains("stiffness_ratio"));
}

/// So are listed rolling moments: the spring against rolling is a share of the tangential one. Kept, they would turn their grains round
/// for ever.
#[test]
fn contacts_without_tangential_springs_carry_no_rolling_moment() {
    let mut packing = packing_of::<Discs>("discs-100.json");
    packing.version = 2;
    packing.rolling_moments = packing.contacts.iter().map(|_| 1e-6).collect();
    let law = |stiffness_ratio| ContactTable {
        rolling_stiffness: 1.0,
        rolling_friction: 0.3,
        ..linear(1e8, stiffness_ratio, 0.5)
    };
    let of = |stiffness_ratio| {
        let definition = GrainDefinition {
            packing: packing.clone(),
            contact: law(stiffness_ratio),
            options: RveOptions::default(),
        };
        GrainRve::new(&definition).unwrap()
    };
    let (springless, springs) = (of(0.0), of(0.5));
    assert!(springs.committed().rolling_moments.iter().any(|moment| *moment != 0.0));
    assert!(springless.committed().rolling_moments.iter().all(|moment| *moment == 0.0));
    assert_eq!(springless.listed_forces().moments_springless, packing.contacts.len());
    assert!(springless.listed_forces().warning().unwrap().contains("rolling moments were dropped"));
}

/// Rattlers of a wide grading pull the mean number of contacts below what holds a cell together; they do not count.
#[test]
fn a_cell_of_many_rattlers_may_be_far_from_rest() {
    let mut cell = cell::<Discs>("discs-100.json", &linear(1e8, 0.5, 0.5), RveOptions::default());
    let mut answer = cell.observe(Observables::ALL).unwrap();
    assert!(!cell.is_far_from_rest(&answer), "as it was prepared");
    answer.scalars.unbalanced_force_ratio = 0.5;
    answer.scalars.coordination_number = 1.2;
    assert!(cell.is_far_from_rest(&answer));
    answer.observed.coordination_number_no_rattlers = 0.0;
    assert!(!cell.is_far_from_rest(&answer), "nothing bears anything");
}
