//! Networks of spheres: crystals with closed-form moduli (D-3 to D-5), identities and bound on random networks (T-2, T-5),
//! rattlers (S-13), the grain solver itself (T-1), and the two ways to solve.

use super::evaluate::frobenius_norm;
use super::link::LinkedGrains;
use super::sample_networks::{Springs, crystal, disordered, evaluate};
use super::sliding::{Sliding, SlidingSet};
use super::*;
use crate::cell::ContactNetwork;
use crate::contact::ContactTable;
use crate::definition::{GrainDefinition, PackingFile, RveOptions};
use crate::engine::GrainRve;
use crate::space::Spheres;
use claims::Claim;
use protocol::{RveSolver, TangentKind, Tensor2, Tensor4, TrialOptions};

fn truss_like(network: &ContactNetwork<Spheres>) -> Tensor4 {
    let outcome = evaluate(network, TangentKind::TrussLike);
    assert!(!outcome.fallback && !outcome.regularised);
    outcome.operator
}

/// States that an operator over `unit`, the normal stiffness over the diameter, has three cubic moduli.
fn claim_cubic(entry: &str, unit: f64, operator: &Tensor4, [c11, c12, c44]: [f64; 3]) {
    let zero = "components that vanish by symmetry";
    for i in 0..3 {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        for (name, value, wanted) in [
            ("C11", operator.get(i, i, i, i), c11),
            ("C12", operator.get(i, i, j, j), c12),
            ("C12", operator.get(j, j, i, i), c12),
            ("C44", operator.get(i, j, i, j), c44),
            ("C44", operator.get(i, j, j, i), c44),
            (zero, operator.get(i, i, j, k), 0.0),
            (zero, operator.get(i, j, k, k), 0.0),
        ] {
            Claim::of(entry, &format!("{name} of the network of contacts, over k_n / d"))
                .value(value / unit, wanted / unit)
                .within_absolute(1e-10);
        }
    }
}

#[test]
fn crystals_have_their_closed_form_moduli() {
    let (root2, root3) = (2.0_f64.sqrt(), 3.0_f64.sqrt());
    for (normal, tangential, d) in [(1.0, 0.5, 1.0), (3e6, 1e6, 2e-3)] {
        let springs = Springs { normal, tangential, normal_force: 0.0 };
        for counts in [[1, 1, 1], [3, 3, 3], [3, 1, 5]] {
            let simple =
                truss_like(&crystal([[d, 0.0, 0.0], [0.0, d, 0.0], [0.0, 0.0, d]], &SIMPLE, counts, springs));
            claim_cubic("D-3", normal / d, &simple, [normal / d, 0.0, 0.5 * tangential / d]);
            let h = d / root2;
            let faces = [[0.0, h, h], [h, 0.0, h], [h, h, 0.0]];
            let scale = 1.0 / (root2 * d);
            let expected = [2.0 * (normal + tangential), normal - tangential, normal + tangential].map(|c| c * scale);
            claim_cubic("D-4", normal / d, &truss_like(&crystal(faces, &FACES, counts, springs)), expected);
            let h = d / root3;
            let bodies = [[-h, h, h], [h, -h, h], [h, h, -h]];
            let scale = root3 / (3.0 * d);
            let expected =
                [normal + 2.0 * tangential, normal - tangential, normal + 0.5 * tangential].map(|c| c * scale);
            claim_cubic("D-5", normal / d, &truss_like(&crystal(bodies, &BODIES, counts, springs)), expected);
        }
    }
}

const SIMPLE: [[i32; 3]; 3] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
const FACES: [[i32; 3]; 6] = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, -1, 0], [1, 0, -1], [0, 1, -1]];
const BODIES: [[i32; 3]; 4] = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]];

#[test]
fn superposed_rotation_turns_the_stress_in_space() {
    let network = disordered(3, 3, 0.01);
    let stress = network.stress();
    let kinds = [TangentKind::TrussLike, TangentKind::TrussLikeSlip, TangentKind::KruytAugmentedPrinted];
    for operator in kinds.map(|kind| evaluate(&network, kind).operator) {
        let scale = operator.get(0, 0, 0, 0);
        for (k, l) in [(0, 1), (1, 2), (0, 2)] {
            for i in 0..3 {
                for j in 0..3 {
                    // W = e_l e_k - e_k e_l.
                    let w = |m: usize, n: usize| f64::from(i8::from(m == l && n == k) - i8::from(m == k && n == l));
                    let turned: f64 = (0..3).map(|m| w(i, m) * stress[m][j] - stress[i][m] * w(m, j)).sum();
                    let found = operator.get(i, j, l, k) - operator.get(i, j, k, l);
                    Claim::of(
                        "T-2",
                        "C_ijlk - C_ijkl against the turned stress over C1111, spheres, three operators",
                    )
                    .error((found - turned) / scale)
                    .within(1e-12);
                }
            }
        }
    }
}

/// Quadratic form of an operator on a strain.
fn energy(operator: &Tensor4, strain: &[[f64; 3]; 3]) -> f64 {
    let mut sum = 0.0;
    for place in 0..81 {
        let [i, j, k, l] = [place / 27, place / 9 % 3, place / 3 % 3, place % 3];
        sum += strain[i][j] * operator.get(i, j, k, l) * strain[k][l];
    }
    sum
}

#[test]
fn uniform_strain_bounds_the_relaxed_network_in_space() {
    let strains = [
        [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
        [[0.0, 0.5, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 0.0]],
        [[0.3, 0.1, -0.4], [0.1, -0.7, 0.2], [-0.4, 0.2, 0.5]],
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    ];
    let network = disordered(3, 5, 0.0);
    let (relaxed, uniform) = (truss_like(&network), evaluate(&network, TangentKind::Kruyt).operator);
    for strain in &strains {
        let (soft, stiff) = (energy(&relaxed, strain), energy(&uniform, strain));
        assert!(soft > 0.0, "{soft}");
        Claim::of("T-5", "energy of the relaxed network over that of uniform strain, 27 spheres")
            .number(soft / stiff)
            .between(0.0, 1.0 - 1e-3);
    }
}

/// S-13: a fifth of the grains touch nothing or hang on one contact.
#[test]
fn rattlers_change_nothing_in_space() {
    let network = disordered(3, 7, 0.01);
    let reference = truss_like(&network);
    let mut crowded = network.clone();
    let (grains, bond) = (network.radii.len(), network.contacts[0]);
    for rattler in 0..grains / 4 {
        crowded.positions.push([0.3 + 0.01 * rattler as f64, 0.7, 0.2]);
        crowded.radii.push(0.2);
        if rattler % 2 == 0 {
            crowded.contacts.push(crate::cell::NetworkContact {
                origin: rattler as u32,
                end: (grains + rattler) as u32,
                tangential_force: [0.0; 3],
                normal_force: 0.0,
                ..bond
            });
        }
    }
    let operator = truss_like(&crowded);
    let scale = reference.get(0, 0, 0, 0);
    for (with, without) in operator.0.iter().zip(reference.0) {
        Claim::of("S-13", "change of the operator over C1111, a fifth of the spheres with one contact or none")
            .error((with - without) / scale)
            .within(1e-10);
    }
}

fn error_of_iteration(network: &ContactNetwork<Spheres>, sliding: Sliding, closeness: Closeness) -> f64 {
    let grains = LinkedGrains::<3>::of(network);
    let [direct, iterated] = [usize::MAX, 0].map(|most| {
        let solved = network::solve_within::<3, 6, 8>(&mut Orderings::default(), &grains, sliding, closeness, most);
        let solved = solved.unwrap();
        assert!(!solved.regularised);
        solved.operator
    });
    let square: f64 = direct.0.iter().zip(iterated.0).map(|(a, b)| (a - b) * (a - b)).sum();
    square.sqrt() / frobenius_norm(&direct)
}

#[test]
fn iterations_and_factors_give_the_same_operator() {
    // Several groups of grains each; the residual's share of a symmetric operator is corrected but for the prestress.
    for pressure_ratio in [0.0, 1e-3, 0.01] {
        let network = disordered(5, 11, pressure_ratio);
        let error = error_of_iteration(&network, Sliding::Sticks, Closeness::RESULT);
        assert!(error < if pressure_ratio == 0.0 { 1e-7 } else { 1e-6 }, "{pressure_ratio}: {error:.2e}");
        let slips = Sliding::Slips(SlidingSet::OfRamp);
        let error = error_of_iteration(&network, slips, Closeness::RESULT);
        assert!(error < 1e-5, "slip, {pressure_ratio}: {error:.2e}");
    }
}

#[test]
fn operators_that_steer_iterations_are_right_to_a_percent() {
    for seed in 0..6 {
        for pressure_ratio in [0.0, 1e-3, 0.01, 0.1] {
            let network = disordered(5, seed, pressure_ratio);
            let error = error_of_iteration(&network, Sliding::Sticks, Closeness::STEERING);
            assert!(error < 0.01, "{seed}, {pressure_ratio}: {error:.2e}");
            if pressure_ratio < 0.1 {
                let slips = Sliding::Slips(SlidingSet::OfRamp);
                let error = error_of_iteration(&network, slips, Closeness::STEERING);
                assert!(error < 0.01, "slip, {seed}, {pressure_ratio}: {error:.2e}");
            }
        }
    }
}

/// Prestress that leaves nothing of the symmetry: conjugate gradients give up or are corrected, the answer holds.
#[test]
fn iterations_survive_heavy_prestress() {
    let network = disordered(4, 3, 0.1);
    let error = error_of_iteration(&network, Sliding::Sticks, Closeness::RESULT);
    assert!(error < 1e-4, "{error:.2e}");
}

/// T-1 in space: a disturbed crystal of rough spheres, strained so that all kinds of forces are there.
#[test]
fn truss_like_operator_equals_probes_of_spheres() {
    check_probes_of_spheres(ContactTable::linear(1000.0, 0.5, 1e9), "linear springs", 1e-5);
}

/// T-1 with springs against rolling. Left out of the operator is that their moments turn with the contacts.
#[test]
fn truss_like_operator_of_spheres_knows_rolling_springs() {
    let contact =
        ContactTable { rolling_stiffness: 0.4, rolling_friction: 1e9, ..ContactTable::linear(1000.0, 0.5, 1e9) };
    check_probes_of_spheres(contact, "linear and rolling springs", 1e-4);
}

fn check_probes_of_spheres(contact: ContactTable, name: &str, allowed: f64) {
    let network = disordered(2, 1, 0.0);
    let grains: Vec<[f64; 4]> =
        network.positions.iter().zip(&network.radii).map(|(p, r)| [p[0], p[1], p[2], 1.03 * r]).collect();
    let text = serde_json::json!({
        "format": "grainspan-packing", "version": 1, "dimension": 3, "periodicity": network.cell, "grains": grains,
    });
    let packing: PackingFile<Spheres> = serde_json::from_value(text).unwrap();
    let options = RveOptions { tolerance: Some(1e-10), ..RveOptions::default() };
    let mut cell = GrainRve::new(&GrainDefinition { packing, contact, options }).unwrap();
    let stress = |cell: &mut GrainRve<Spheres>, h: [f64; 9], ramp_steps| {
        cell.trial(&Tensor2(h), &TrialOptions { ramp_steps, ..TrialOptions::default() }).unwrap().stress
    };
    stress(&mut cell, [1e-3, 5e-4, 0.0, 0.0, -1e-3, 2e-4, 0.0, 0.0, 5e-4], 200);
    let operator = evaluate(cell.network().unwrap(), TangentKind::TrussLike);
    assert!(!operator.fallback && !operator.regularised);
    cell.commit().unwrap();
    let size = 1e-7;
    let scale = frobenius_norm(&operator.operator);
    for (k, l) in [(0, 0), (1, 2), (2, 1), (0, 1)] {
        let mut h = [0.0; 9];
        h[3 * k + l] = size;
        let forward = stress(&mut cell, h, 1);
        let backward = stress(&mut cell, h.map(|value| -value), 1);
        for i in 0..3 {
            for j in 0..3 {
                let perturbed = (forward.get(i, j) - backward.get(i, j)) / (2.0 * size);
                let found = operator.operator.get(i, j, k, l);
                Claim::of(
                    "T-1",
                    &format!("component of the operator of 8 spheres against central differences, {name}"),
                )
                .error((found - perturbed) / scale)
                .within(allowed);
            }
        }
    }
}
