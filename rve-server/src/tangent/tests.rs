//! Checks D-1, D-2, D-6 (lattices with closed-form moduli), T-2, T-3, T-5 (identities and bound on random networks), and
//! the ways in which a network can be unfit: rattlers, floating clusters, mechanisms, grains that only slide.

use super::sample_networks::{PlaneOperator, Springs, evaluate, frozen, random, square, stress, triangular};
use super::*;
use crate::cell::{ContactNetwork, NetworkContact};
use claims::Claim;
use nalgebra::Matrix3;
use protocol::{TangentKind, Tensor4};

const SQRT_3: f64 = 1.732_050_807_568_877_2;

fn truss_like(network: &ContactNetwork) -> PlaneOperator {
    let outcome = evaluate(network, TangentKind::TrussLike);
    assert!(!outcome.fallback && !outcome.regularised);
    outcome.operator.plane()
}

fn kruyt(network: &ContactNetwork) -> PlaneOperator {
    evaluate(network, TangentKind::Kruyt).operator.plane()
}

/// Largest difference over the largest value of `expected`.
fn distance(operator: &PlaneOperator, expected: &PlaneOperator) -> f64 {
    let scale = expected.iter().flatten().fold(0.0, |largest: f64, value| largest.max(value.abs()));
    let pairs = operator.iter().flatten().zip(expected.iter().flatten());
    pairs.map(|(value, wanted)| (value - wanted).abs()).fold(0.0, f64::max) / scale
}

/// An operator with the symmetry of a square: C1111 = C2222, C1122 = C2211, all shear components equal.
fn cubic(uniaxial: f64, lateral: f64, shear: f64) -> PlaneOperator {
    [[uniaxial, 0.0, 0.0, lateral], [0.0, shear, shear, 0.0], [0.0, shear, shear, 0.0], [lateral, 0.0, 0.0, uniaxial]]
}

/// States that an operator over the normal stiffness is the expected one, component by component.
fn claim_components(entry: &str, normal: f64, operator: &PlaneOperator, expected: &PlaneOperator) {
    for row in 0..4 {
        for column in 0..4 {
            let name = match (row, column) {
                (0, 0) | (3, 3) => "C1111 and C2222",
                (0, 3) | (3, 0) => "C1122 and C2211",
                (1 | 2, 1 | 2) => "C1212, C1221, C2112 and C2121",
                _ => "components that vanish by symmetry",
            };
            Claim::of(entry, &format!("{name} of the network of contacts, over the normal stiffness"))
                .value(operator[row][column] / normal, expected[row][column] / normal)
                .within_absolute(1e-10);
        }
    }
}

fn triangular_operator(springs: Springs, spacing: f64) -> PlaneOperator {
    let (normal, tangential) = (springs.normal, springs.tangential);
    let pressure = -SQRT_3 * springs.normal_force / spacing;
    cubic(
        SQRT_3 / 4.0 * (3.0 * normal + tangential) - pressure / 4.0,
        SQRT_3 / 4.0 * (normal - tangential) + 5.0 * pressure / 4.0,
        SQRT_3 / 4.0 * (normal + tangential) - 3.0 * pressure / 4.0,
    )
}

#[test]
fn triangular_lattice_has_its_closed_form_moduli_with_and_without_pressure() {
    let unloaded = Springs { normal: 1.0, tangential: 0.5, normal_force: 0.0 };
    let loaded = Springs { normal_force: -0.02, ..unloaded };
    assert!((triangular_operator(unloaded, 1.0)[0][0] - 1.515_544).abs() < 1e-6);
    assert!((triangular_operator(loaded, 1.0)[1][2] - 0.623_538).abs() < 1e-6);
    let stiff = Springs { normal: 3e8, tangential: 1e8, normal_force: -40.0 };
    for (entry, springs) in [("D-1", unloaded), ("D-6", loaded), ("D-6", stiff)] {
        for (counts, angle) in [([1, 1], 0.0), ([1, 1], 0.7), ([2, 1], 0.0), ([2, 2], 0.3), ([5, 4], 0.0)] {
            for spacing in [1.0, 0.013] {
                let force = Springs { normal_force: springs.normal_force * spacing, ..springs };
                let network = triangular(spacing, angle, counts, force);
                let expected = triangular_operator(force, spacing);
                claim_components(entry, springs.normal, &truss_like(&network), &expected);
            }
        }
    }
}

#[test]
fn square_lattice_has_its_closed_form_moduli() {
    let springs = Springs { normal: 2.0, tangential: 0.6, normal_force: 0.0 };
    for counts in [[1, 1], [3, 3], [4, 3]] {
        let operator = truss_like(&square(0.3, counts, springs));
        claim_components("D-2", springs.normal, &operator, &cubic(2.0, 0.0, 0.3));
    }
}

#[test]
fn square_lattice_with_blocked_rotations_is_as_objective_as_any() {
    let springs = Springs { normal: 2.0, tangential: 0.6, normal_force: 0.0 };
    for counts in [[1, 1], [3, 2]] {
        let mut network = square(1.0, counts, springs);
        network.rotations_free = false;
        // Blocked grains turn with the cell, so that one family shears each way.
        Claim::of("D-2", "largest error of a component with blocked rotations, over C1111")
            .error(distance(&truss_like(&network), &cubic(2.0, 0.0, 0.3)))
            .within(1e-10);
    }
}

#[test]
fn uniform_strain_operator_is_exact_on_lattices_where_affine_motion_is() {
    let springs = Springs { normal: 1.0, tangential: 0.5, normal_force: 0.0 };
    let network = triangular(0.2, 0.4, [3, 2], springs);
    let outcome = evaluate(&network, TangentKind::Kruyt);
    Claim::of("D-1", "largest error of a component by uniform strain, over C1111")
        .error(distance(&outcome.operator.plane(), &triangular_operator(springs, 0.2)))
        .within(1e-12);
    assert!(!outcome.fallback);
}

#[test]
fn superposed_rotation_turns_the_stress_and_stress_stays_symmetric() {
    for seed in 0..20 {
        let network = random(seed, 0.01);
        let operator = truss_like(&network);
        let [[s11, s12], [s21, s22]] = stress(&network);
        let scale = operator[0][0].abs();
        // W sigma - sigma W for the unit spin W = e2 e1 - e1 e2.
        let turned = [-s21 - s12, s11 - s22, s11 - s22, s12 + s21];
        for row in 0..4 {
            let error = (operator[row][2] - operator[row][1] - turned[row]).abs() / scale;
            Claim::of("T-2", "C_ij21 - C_ij12 against the turned stress over C1111, relaxed networks of discs")
                .error(error)
                .within(1e-12);
        }
        for (upper, lower) in operator[1].iter().zip(&operator[2]) {
            Claim::of("T-3", "C_12kl against C_21kl over C1111, relaxed networks of discs")
                .error((upper - lower).abs() / scale)
                .within(1e-12);
        }
    }
}

#[test]
fn uniform_strain_is_never_softer_than_the_relaxed_network() {
    for seed in 0..20 {
        let mut network = random(seed, 0.0);
        for blocked in [false, true] {
            network.rotations_free = !blocked;
            let relaxed = strain_form(&truss_like(&network));
            let uniform = strain_form(&kruyt(&network));
            let softest = (uniform - relaxed).symmetric_eigenvalues().min();
            Claim::of("T-5", "least eigenvalue of uniform strain minus relaxed, discs, mean normal stiffness of 1")
                .number(softest)
                .at_least(-1e-9);
            assert!((uniform - relaxed).norm() > 1e-3 * uniform.norm(), "the networks do relax");
            assert!((relaxed - relaxed.transpose()).norm() < 1e-12 * uniform.norm());
        }
    }
}

/// The quadratic form on symmetric strain in the basis 11, 22, sqrt 2 x 12.
fn strain_form(operator: &PlaneOperator) -> Matrix3<f64> {
    let root = std::f64::consts::SQRT_2;
    let basis = [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0], [0.0, 1.0 / root, 1.0 / root, 0.0]];
    Matrix3::from_fn(|i, j| {
        let mut sum = 0.0;
        for (row, left) in basis[i].iter().enumerate() {
            for (column, right) in basis[j].iter().enumerate() {
                sum += left * operator[row][column] * right;
            }
        }
        sum
    })
}

#[test]
fn units_and_thickness_only_scale_the_operator() {
    let network = random(7, 0.01);
    let reference = truss_like(&network);
    let (length, stiffness, thickness) = (3e-3, 4e7, 0.25);
    let mut scaled = network.clone();
    scaled.cell = scaled.cell.map(|row| row.map(|value| value * length));
    scaled.positions.iter_mut().flatten().for_each(|value| *value *= length);
    scaled.radii.iter_mut().for_each(|value| *value *= length);
    scaled.thickness = thickness;
    for contact in &mut scaled.contacts {
        contact.normal_stiffness *= stiffness;
        contact.tangential_stiffness *= stiffness;
        contact.normal_force *= stiffness * length;
        contact.tangential_force *= stiffness * length;
    }
    let expected = reference.map(|row| row.map(|value| value * stiffness / thickness));
    assert!(distance(&truss_like(&scaled), &expected) < 1e-11);
}

fn bond(origin: usize, end: usize) -> NetworkContact {
    NetworkContact {
        origin: origin as u32,
        end: end as u32,
        shift: [0, 0],
        normal_stiffness: 1.0,
        tangential_stiffness: 0.5,
        rolling_stiffness: 0.0,
        normal_force: 0.0,
        tangential_force: 0.0,
        slid: false,
        at_limit: false,
    }
}

#[test]
fn rattlers_and_floating_clusters_change_nothing() {
    let network = random(3, 0.01);
    let reference = truss_like(&network);
    let grains = network.positions.len();
    let mut crowded = network.clone();
    // A chain of two grains hangs from grain 0, a triangle of three floats free, and one grain touches nothing.
    crowded.positions.extend([[0.4, 0.3], [0.8, 0.6], [2.0, 2.0], [3.0, 2.0], [2.5, 2.9], [9.0, 9.0]]);
    crowded.radii.extend([0.2; 6]);
    crowded.contacts.extend([bond(0, grains), bond(grains, grains + 1)]);
    crowded.contacts.extend([
        bond(grains + 2, grains + 3),
        bond(grains + 2, grains + 4),
        bond(grains + 3, grains + 4),
    ]);
    assert!(distance(&truss_like(&crowded), &reference) < 1e-12);
}

#[test]
fn empty_network_has_no_stiffness() {
    let mut network = random(1, 0.01);
    network.contacts.clear();
    let kinds = TangentKind::ALL.into_iter().filter(|kind| matches!(Method::of(*kind), Method::Frozen(_)));
    for kind in kinds {
        let outcome = evaluate(&network, kind);
        assert_eq!(outcome, TangentOutcome::exact(Tensor4::ZERO));
    }
}

#[test]
fn mechanisms_are_held_and_reported() {
    let springs = Springs { normal: 2.0, tangential: 0.0, normal_force: 0.0 };
    let outcome = evaluate(&square(1.0, [4, 3], springs), TangentKind::TrussLike);
    assert!(outcome.regularised && !outcome.fallback);
    assert!(distance(&outcome.operator.plane(), &cubic(2.0, 0.0, 0.0)) < 1e-6);
    // An even square lattice is a gear train: neighbours may spin against each other for nothing.
    let gears = Springs { tangential: 0.6, ..springs };
    let outcome = evaluate(&square(1.0, [4, 2], gears), TangentKind::TrussLike);
    assert!(outcome.regularised && !outcome.fallback, "{outcome:?}");
    assert!(distance(&outcome.operator.plane(), &cubic(2.0, 0.0, 0.3)) < 1e-6);
}

#[test]
fn damaged_network_falls_back_and_says_so() {
    let mut network = random(2, 0.01);
    network.contacts[5].normal_force = f64::NAN;
    let outcome = evaluate(&network, TangentKind::TrussLike);
    assert!(outcome.fallback);
    assert_eq!(outcome.operator.plane(), kruyt(&network));
}

#[test]
fn without_sliding_contacts_slip_equals_truss_like() {
    let network = random(4, 0.01);
    let slip = evaluate(&network, TangentKind::TrussLikeSlip).operator.plane();
    assert!(distance(&slip, &truss_like(&network)) < 1e-12);
}

/// One grain per cell; its horizontal contact slides with `f_t = friction |f_n|`, its vertical contact sticks and takes
/// up the moment. Stretching along 1 unloads the sliding contact, whose shear force must follow the cone on both faces.
#[test]
fn sliding_contact_follows_the_cone() {
    let (friction, stiffness, force) = (0.3, 1000.0, 2.0);
    let springs = Springs { normal: stiffness, tangential: 400.0, normal_force: -force };
    for direction in [1.0, -1.0] {
        let mut network = square(1.0, [1, 1], springs);
        network.friction = friction;
        network.contacts[0].tangential_force = direction * friction * force;
        network.contacts[1].tangential_force = -direction * friction * force;
        network.contacts[0].slid = true;
        let outcome = evaluate(&network, TangentKind::TrussLikeSlip);
        assert!(!outcome.fallback && !outcome.regularised);
        let operator = outcome.operator.plane();
        assert!((operator[0][0] - stiffness).abs() < 1e-9);
        for row in [1, 2] {
            assert!((operator[row][0] + direction * friction * stiffness).abs() < 1e-9, "{:?}", operator);
        }
        // Shear finds no resistance but that of the prestress.
        assert!(operator[1][1].abs() < 5.0 * force);
    }
}

#[test]
fn grain_that_only_slides_is_reported() {
    let springs = Springs { normal: 1000.0, tangential: 400.0, normal_force: -2.0 };
    let mut network = square(1.0, [1, 1], springs);
    for (contact, sign) in network.contacts.iter_mut().zip([1.0, -1.0]) {
        contact.slid = true;
        contact.tangential_force = sign;
    }
    let outcome = evaluate(&network, TangentKind::TrussLikeSlip);
    assert!(outcome.regularised && !outcome.fallback);
    assert!((outcome.operator.plane()[0][0] - 1000.0).abs() < 1e-9);
}

/// `C_ij21 - C_ij12` against `W sigma - sigma W` for the unit spin `W = e2 e1 - e1 e2`, over the largest component.
fn objectivity_error(operator: &PlaneOperator, network: &ContactNetwork) -> f64 {
    let [[s11, s12], [s21, s22]] = stress(network);
    let turned = [-s21 - s12, s11 - s22, s11 - s22, s12 + s21];
    let scale = operator[0][0].abs();
    (0..4).map(|row| (operator[row][2] - operator[row][1] - turned[row]).abs() / scale).fold(0.0, f64::max)
}

#[test]
fn augmented_uniform_strain_is_objective_and_the_printed_one_is_not_symmetric() {
    for seed in 0..10 {
        let network = random(seed, 0.01);
        let [objective, printed] = [TangentKind::KruytAugmented, TangentKind::KruytAugmentedPrinted]
            .map(|kind| evaluate(&network, kind).operator.plane());
        for (name, operator) in [("", &objective), (" as printed", &printed)] {
            Claim::of("T-2", &format!("C_ij21 - C_ij12 against the turned stress, augmented uniform strain{name}"))
                .error(objectivity_error(operator, &network))
                .within(1e-12);
        }
        Claim::of("T-3", "C_12kl equals C_21kl, augmented uniform strain, bits").holds(objective[1] == objective[2]);
        assert_ne!(printed[1], printed[2]);
        // Without prestress it is UKO.
        let unloaded = random(seed, 0.0);
        let augmented = evaluate(&unloaded, TangentKind::KruytAugmented).operator.plane();
        assert!(distance(&augmented, &kruyt(&unloaded)) < 1e-12);
    }
}

/// T-6: `l^2`-weighted contacts spread evenly over all directions.
#[test]
fn uniform_strain_moduli_of_isotropic_contacts_are_the_closed_form() {
    let (normal, tangential, count) = (1.0, 0.5, 12);
    let mut network = random(0, 0.0);
    network.positions = (0..=count)
        .map(|place| {
            let angle = std::f64::consts::PI * f64::from(place) / f64::from(count);
            if place == 0 { [0.0, 0.0] } else { [angle.cos(), angle.sin()] }
        })
        .collect();
    network.radii = vec![0.5; network.positions.len()];
    network.contacts = (1..=count as usize)
        .map(|end| NetworkContact { normal_stiffness: normal, tangential_stiffness: tangential, ..bond(0, end) })
        .collect();
    let sum = f64::from(count) / (network.volume());
    let (bulk, shear) = (sum * normal / 4.0, sum * (normal + tangential) / 8.0);
    let operator = kruyt(&network);
    for (name, found, expected) in
        [("bulk", 0.5 * (operator[0][0] + operator[0][3]), bulk), ("shear", operator[1][1], shear)]
    {
        Claim::of("T-6", &format!("uniform-strain {name} modulus of contacts in 12 even directions of the plane"))
            .value(found, expected)
            .within(1e-12);
    }
    // The printed form agrees on stretches, shears one contact family twice as hard and feels rotations.
    let printed = evaluate(&network, TangentKind::KruytPrinted).operator.plane();
    assert!((printed[0][0] - operator[0][0]).abs() + (printed[0][3] - operator[0][3]).abs() < 1e-12);
    assert!((printed[1][1] - sum * (normal + 3.0 * tangential) / 8.0).abs() < 1e-12);
    assert!((printed[1][2] - sum * (normal - tangential) / 8.0).abs() < 1e-12);
}

#[test]
fn released_contacts_soften_and_keep_symmetry() {
    let mut network = random(5, 0.0);
    for contact in network.contacts.iter_mut().step_by(7) {
        contact.slid = true;
    }
    let released = evaluate(&network, TangentKind::TrussLikeReleased).operator.plane();
    let stiff = strain_form(&truss_like(&network));
    let soft = strain_form(&released);
    assert!((stiff - soft).symmetric_eigenvalues().min() > -1e-12);
    assert!((stiff - soft).norm() > 1e-3 * stiff.norm());
    assert!((soft - soft.transpose()).norm() < 1e-12 * stiff.norm());
}

/// Orders of elimination that are kept from networks before reach no bit of an operator.
#[test]
fn kept_orderings_leave_every_bit_alone() {
    let mut orderings = Orderings::default();
    for _ in 0..2 {
        for seed in 1..4 {
            let network = random(seed, 1e-3);
            for kind in [TangentKind::TrussLike, TangentKind::TrussLikeSlip, TangentKind::TrussLikeReleased] {
                assert_eq!(
                    evaluate_with(&mut orderings, &network, frozen(kind), Closeness::RESULT),
                    evaluate(&network, kind)
                );
            }
        }
    }
    assert_eq!(orderings.found(), 2 * 9 - 3, "each network was ordered once");
}
