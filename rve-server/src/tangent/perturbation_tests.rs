//! Checks against the grain solver itself, on 400 discs at k_n/p = 1000: T-1 (the truss-like operator equals central
//! differences when nothing slides) and the gain of the slip operator in the direction of loading.

use super::sample_networks::{PlaneOperator, evaluate};
use crate::contact::ContactTable;
use crate::definition::{GrainDefinition, PackingFile, RveOptions};
use crate::engine::GrainRve;
use claims::Claim;
use protocol::{RveSolver, TangentKind, Tensor2, TrialOptions};
use std::path::Path;

type Plane = [[f64; 2]; 2];

fn discs(friction: f64, options: RveOptions) -> GrainRve {
    discs_of(ContactTable::linear(1000.0, 0.5, friction), options)
}

fn discs_of(contact: ContactTable, options: RveOptions) -> GrainRve {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/case-a/packing.json");
    let packing = PackingFile::read(&file).unwrap();
    GrainRve::new(&GrainDefinition { packing, contact, options }).unwrap()
}

fn norm(operator: &PlaneOperator) -> f64 {
    operator.iter().flatten().map(|value| value * value).sum::<f64>().sqrt()
}

fn stress_after(cell: &mut GrainRve, strain: Plane, ramp_steps: u32) -> [f64; 4] {
    let options = TrialOptions { ramp_steps, ..TrialOptions::default() };
    let answer = cell.trial(&Tensor2::from_plane(strain), &options).unwrap();
    assert_eq!(answer.flags.0, 0, "{:?}", answer.flags);
    let [[s11, s12], [s21, s22]] = answer.stress.plane();
    [s11, s12, s21, s22]
}

/// `(sigma(+strain) - sigma(-strain)) / 2`.
fn central_difference(cell: &mut GrainRve, strain: Plane) -> [f64; 4] {
    let forward = stress_after(cell, strain, 1);
    let backward = stress_after(cell, strain.map(|row| row.map(|value| -value)), 1);
    std::array::from_fn(|place| 0.5 * (forward[place] - backward[place]))
}

#[test]
fn truss_like_operator_equals_perturbations_of_the_grain_solver() {
    let rough = ContactTable::linear(1000.0, 0.5, 1e9);
    let rolling = ContactTable { rolling_stiffness: 0.4, rolling_friction: 1e9, ..rough.clone() };
    // Measured 5.8e-8 without rolling springs.
    for (contact, name) in [(rough, "linear springs"), (rolling, "linear and rolling springs")] {
        check_perturbations(contact, name);
    }
}

fn check_perturbations(contact: ContactTable, name: &str) {
    let mut cell = discs_of(contact, RveOptions { tolerance: Some(1e-11), ..RveOptions::default() });
    // A strain first, so that tangential forces and rotations are not zero.
    let strain = [[1e-4, 5e-5], [0.0, -1e-4]];
    stress_after(&mut cell, strain, 100);
    let operator = evaluate(cell.network().unwrap(), TangentKind::TrussLike);
    let linearised = operator.operator.plane();
    cell.commit().unwrap();
    let step = 1e-8;
    let mut perturbed = [[0.0; 4]; 4];
    for direction in 0..4 {
        let mut strain = [[0.0; 2]; 2];
        strain[direction / 2][direction % 2] = step;
        for (row, change) in central_difference(&mut cell, strain).into_iter().enumerate() {
            perturbed[row][direction] = change / step;
        }
    }
    let difference: PlaneOperator =
        std::array::from_fn(|row| std::array::from_fn(|column| linearised[row][column] - perturbed[row][column]));
    let error = norm(&difference) / norm(&perturbed);
    Claim::of("T-1", &format!("operator of 400 discs against central differences, {name}"))
        .error(error)
        .within(1.2e-7);
    assert!(!operator.fallback && !operator.regularised);
}

#[test]
fn slip_operator_foresees_the_next_increment_of_loading() {
    let mut cell = discs(0.5, RveOptions::default());
    let increment = [[1e-4, 0.0], [0.0, -1e-4]];
    for number in 1..=40 {
        let before = stress_after(&mut cell, increment, 0);
        let network = cell.network().unwrap().clone();
        cell.commit().unwrap();
        if ![10, 20, 40].contains(&number) {
            continue;
        }
        let after = stress_after(&mut cell, increment, 0);
        let change: [f64; 4] = std::array::from_fn(|place| after[place] - before[place]);
        let error = |kind| {
            let operator = evaluate(&network, kind).operator.plane();
            let missed = operator.iter().zip(&change).map(|(row, actual)| 1e-4 * (row[0] - row[3]) - actual);
            let (missed, total) =
                (missed.map(|value| value * value).sum::<f64>(), change.iter().map(|v| v * v).sum::<f64>());
            (missed / total).sqrt()
        };
        let [elastic, slip] = [TangentKind::TrussLike, TangentKind::TrussLikeSlip].map(error);
        // Measured 0.054, 0.044, 0.027 for slip and 1.3, 1.5, 1.1 for the elastic operator.
        assert!(slip < 0.11, "increment {number}: {slip:.3}");
        assert!(elastic > 10.0 * slip, "increment {number}: {elastic:.3} against {slip:.3}");
    }
}
