//! Operators by perturbation on 100 discs: what they agree with, what they cost, what they leave behind.

use crate::contact::ContactTable;
use crate::definition::{GrainDefinition, OperatorOptions, PackingFile, RveOptions};
use crate::engine::GrainRve;
use crate::tangent::Closeness;
use claims::Claim;
use protocol::{RveSolver, TangentKind, Tensor2, Tensor4, TrialFlags, TrialOptions, TrialResult};
use std::path::Path;

fn discs(friction: f64, options: RveOptions) -> GrainRve {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings/discs-100.json");
    let packing = PackingFile::read(&file).unwrap();
    let contact =
        ContactTable { normal_stiffness: None, modulus: Some(1e8), ..ContactTable::linear(1.0, 0.5, friction) };
    GrainRve::new(&GrainDefinition { packing, contact, options }).unwrap()
}

fn fast() -> RveOptions {
    RveOptions { strain_per_step: Some(5e-6), tolerance: Some(1e-6), ..RveOptions::default() }
}

const STEP: [[f64; 2]; 2] = [[1e-4, 2e-5], [0.0, -2e-4]];

fn trial(cell: &mut GrainRve, kind: TangentKind) -> TrialResult {
    cell.trial(&Tensor2::from_plane(STEP), &TrialOptions { tangent: kind, ..TrialOptions::default() }).unwrap()
}

fn operator(cell: &mut GrainRve, kind: TangentKind) -> Tensor4 {
    let answer = trial(cell, kind);
    assert!(!answer.flags.contains(TrialFlags::TANGENT_FALLBACK), "{}", kind.keyword());
    *answer.tangent.unwrap()
}

/// Frobenius distance relative to `expected`.
fn distance(operator: &Tensor4, expected: &Tensor4) -> f64 {
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>().sqrt();
    let difference = norm(&mut operator.0.iter().zip(expected.0).map(|(value, wanted)| value - wanted));
    difference / norm(&mut expected.0.into_iter())
}

#[test]
fn quasi_static_operator_equals_the_truss_like_one() {
    // Sliding in the step must not matter: the perturbations stick.
    let mut cell = discs(0.5, fast());
    let (perturbed, solved) =
        (operator(&mut cell, TangentKind::QuasiStatic), operator(&mut cell, TangentKind::TrussLike));
    let error = distance(&perturbed, &solved);
    // Measured 2.5e-4.
    assert!(error < 5e-4, "{error:.2e}");
    // T-2 for perturbations: the skew part of dF turns the stress.
    let stress = trial(&mut cell, TangentKind::None).stress;
    let difference = perturbed.get(0, 1, 1, 0) - perturbed.get(0, 1, 0, 1);
    let expected = stress.get(0, 0) - stress.get(1, 1);
    let scale = perturbed.get(0, 0, 0, 0);
    Claim::of("T-2", "C1221 - C1212 by quasi-static perturbations against the stress difference, over C1111")
        .value(difference / scale, expected / scale)
        .within_absolute(1e-3);
}

#[test]
fn consistent_operators_are_elastic_where_nothing_slides() {
    let options = RveOptions { tolerance: Some(1e-9), ..fast() };
    let mut cell = discs(1e9, options);
    let elastic = operator(&mut cell, TangentKind::TrussLike);
    let [one_sided, central] = [TangentKind::Consistent, TangentKind::ConsistentCentral]
        .map(|kind| distance(&operator(&mut cell, kind), &elastic));
    // Measured 9.5e-5 and 9.3e-5.
    assert!(one_sided < 2e-4, "{one_sided:.2e}");
    assert!(central < 2e-4, "{central:.2e}");
}

/// Whatever operator is requested, stress and states keep their bits; perturbations are counted and the ramp is the trial's own.
#[test]
fn perturbations_leave_no_trace_but_their_cost() {
    let mut cell = discs(0.5, RveOptions { tolerance: Some(1e-4), ..fast() });
    let plain = trial(&mut cell, TangentKind::None);
    let (mut bytes, mut plain_bytes) = (Vec::new(), Vec::new());
    cell.snapshot_trial(&mut plain_bytes).unwrap();
    // The same step once more for each perturbation: solved by hand with the ramp of the trial, and added up.
    let ramp_steps = u32::try_from(plain.cost.ramp_steps).unwrap();
    let mut solved_by_hand = |sign: f64| -> u64 {
        let size = sign * OperatorOptions::default().perturbation();
        let mut sum = 0;
        for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            // (I + g) (I + H) - I with g of one component.
            let mut h = STEP;
            for k in 0..2 {
                h[row][k] += size * (STEP[column][k] + if column == k { 1.0 } else { 0.0 });
            }
            let options = TrialOptions { ramp_steps, ..TrialOptions::default() };
            sum += cell.trial(&Tensor2::from_plane(h), &options).unwrap().cost.force_evaluations;
        }
        sum
    };
    let [forward, backward] = [1.0, -1.0].map(&mut solved_by_hand);
    for (kind, expected) in [
        (TangentKind::Consistent, forward..=forward),
        (TangentKind::ConsistentCentral, forward + backward..=forward + backward),
        // Five solves: each of one ramp step, the evaluation that begins it and at least ten of hold, and none as long as the trial.
        (TangentKind::QuasiStatic, 5 * 12..=plain.cost.force_evaluations * 5),
        (TangentKind::KruytCalibrated, forward..=forward),
    ] {
        let answer = trial(&mut cell, kind);
        assert_eq!(answer.stress, plain.stress);
        assert_eq!(answer.scalars, plain.scalars);
        assert_eq!(answer.observed, plain.observed);
        let spent = answer.cost.force_evaluations - plain.cost.force_evaluations;
        assert!(expected.contains(&spent), "{}: {spent}, not {expected:?}", kind.keyword());
        if kind != TangentKind::KruytCalibrated {
            cell.snapshot_trial(&mut bytes).unwrap();
            assert_eq!(bytes, plain_bytes, "{}", kind.keyword());
        }
    }
    let again = trial(&mut cell, TangentKind::None);
    assert_eq!((again.stress, again.scalars), (plain.stress, plain.scalars));
}

#[test]
fn elastic_average_is_the_mean_of_the_first_committed_steps_and_then_stays() {
    let operator_options = OperatorOptions { average_steps: Some(2), ..OperatorOptions::default() };
    let options = RveOptions { tolerance: Some(1e-4), operator: operator_options, ..fast() };
    let mut cell = discs(0.5, options.clone());
    let mut samples = Vec::new();
    let mut averages = Vec::new();
    let mut costs = Vec::new();
    for step in 0..3 {
        samples.push(operator(&mut cell, TangentKind::Consistent));
        // A trial that is not committed teaches nothing.
        trial(&mut cell, TangentKind::ElasticAverage);
        cell.rollback();
        if step == 1 {
            // A state that went through its bytes remembers.
            let mut bytes = Vec::new();
            cell.snapshot(&mut bytes);
            cell = discs(0.5, options.clone());
            cell.restore(&bytes).unwrap();
        }
        let answer = trial(&mut cell, TangentKind::ElasticAverage);
        costs.push(answer.cost.force_evaluations);
        averages.push(*answer.tangent.unwrap());
        cell.commit().unwrap();
    }
    let mean = Tensor4(std::array::from_fn(|place| (samples[0].0[place] + samples[1].0[place]) / 2.0));
    assert_eq!(averages[0], samples[0]);
    assert_eq!(averages[1], mean);
    assert_eq!(averages[2], mean);
    assert!(3 * costs[2] < costs[1]);
}

#[test]
fn calibrated_operators_meet_the_components_they_are_calibrated_by() {
    for (kind, printed, lateral) in [
        (TangentKind::KruytCalibrated, TangentKind::Kruyt, false),
        (TangentKind::KruytCalibratedPrinted, TangentKind::KruytPrinted, false),
        (TangentKind::KruytTwiceCalibrated, TangentKind::Kruyt, true),
        (TangentKind::KruytTwiceCalibratedPrinted, TangentKind::KruytPrinted, true),
    ] {
        let mut cell = discs(0.5, RveOptions { tolerance: Some(1e-4), ..fast() });
        let consistent = operator(&mut cell, TangentKind::Consistent);
        let bound = operator(&mut cell, printed);
        let calibrated = operator(&mut cell, kind);
        let scale = consistent.get(0, 0, 0, 0);
        assert!((calibrated.get(0, 0, 0, 0) - scale).abs() < 1e-12 * scale);
        if lateral {
            assert!((calibrated.get(0, 0, 1, 1) - consistent.get(0, 0, 1, 1)).abs() < 1e-12 * scale);
        } else {
            let factor = scale / bound.get(0, 0, 0, 0);
            assert!(distance(&calibrated, &Tensor4(bound.0.map(|value| factor * value))) < 1e-12);
        }
        // Calibrated once: the next step costs no perturbations.
        cell.commit().unwrap();
        let with = trial(&mut cell, kind).cost.force_evaluations;
        assert_eq!(with, trial(&mut cell, TangentKind::None).cost.force_evaluations);
    }
}

/// A perturbation that cannot come to rest leaves the truss-like operator, marked.
#[test]
fn failed_perturbations_fall_back_and_say_so() {
    let operator_options = OperatorOptions { quasi_static_tolerance: Some(1e-300), ..OperatorOptions::default() };
    let options = RveOptions { tolerance: Some(1e-3), max_steps: Some(300), operator: operator_options, ..fast() };
    let mut cell = discs(0.5, options);
    let answer = trial(&mut cell, TangentKind::QuasiStatic);
    assert!(answer.flags.contains(TrialFlags::TANGENT_FALLBACK));
    // What falls back is exact, also where other operators only steer iterations.
    cell.solve_operators_to(Closeness::RESULT);
    assert_eq!(*answer.tangent.unwrap(), operator(&mut cell, TangentKind::TrussLike));
}

#[test]
fn options_with_defects_are_refused_by_key() {
    let refused = |text: &str| {
        let options: RveOptions = toml::from_str(text).unwrap();
        options.validate().unwrap_err().to_string()
    };
    assert!(refused("[operator]\nperturbation = 0.0").contains("rve.operator.perturbation"));
    assert!(
        refused("[operator]\nquasi_static_perturbation = 0.1").contains("rve.operator.quasi_static_perturbation")
    );
    assert!(refused("[operator]\nquasi_static_tolerance = -1.0").contains("quasi_static_tolerance"));
    assert!(refused("[operator]\naverage_steps = 0").contains("average_steps"));
}
