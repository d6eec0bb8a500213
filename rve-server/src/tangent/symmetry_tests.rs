//! T-4: what of an operator is symmetric, and how far the rest goes with the stress.

use super::sample_networks::{evaluate, random, stress};
use crate::cell::ContactNetwork;
use crate::contact::ContactTable;
use crate::definition::{GrainDefinition, PackingFile, RveOptions};
use crate::engine::GrainRve;
use crate::space::Discs;
use claims::Claim;
use nalgebra::Matrix4;
use protocol::TangentKind;
use std::path::Path;

/// `d P / d F` at `F = I` from `d sigma / d F`, pairs ordered 11, 12, 21, 22: `A_ijkl = C_ijkl + sigma_ij d_kl - sigma_il d_jk`.
fn nominal(operator: &Matrix4<f64>, network: &ContactNetwork) -> Matrix4<f64> {
    let stress = stress(network);
    let unit = |a: usize, b: usize| f64::from(u8::from(a == b));
    Matrix4::from_fn(|row, column| {
        let ([i, j], [k, l]) = ([row / 2, row % 2], [column / 2, column % 2]);
        operator[(row, column)] + stress[i][j] * unit(k, l) - stress[i][l] * unit(j, k)
    })
}

fn truss_like(network: &ContactNetwork) -> Matrix4<f64> {
    let operator = evaluate(network, TangentKind::TrussLike).operator.plane();
    Matrix4::from_fn(|row, column| operator[row][column])
}

fn asymmetry(operator: &Matrix4<f64>) -> f64 {
    (operator - operator.transpose()).norm() / operator.norm()
}

/// Forces that have a potential make an operator of nominal stress that is symmetric as far as the grains are at rest.
#[test]
fn packing_without_tangential_forces_has_a_symmetric_nominal_operator() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings/discs-400-dense.json");
    let contact = ContactTable { normal_stiffness: None, modulus: Some(6e7), ..ContactTable::linear(1.0, 0.5, 0.5) };
    let packing = PackingFile::<Discs>::read(&file).unwrap();
    assert!(packing.contacts.is_empty(), "it was made without friction");
    let definition = GrainDefinition { packing, contact, options: RveOptions::default() };
    let network = GrainRve::<Discs>::new(&definition).unwrap().committed_network().unwrap();
    let nominal = nominal(&truss_like(&network), &network);
    Claim::of("T-4", "asymmetry of the operator of nominal stress, 400 discs without tangential forces")
        .error(asymmetry(&nominal))
        .within(1e-8);
}

/// Tangential forces have none; what they take from the symmetry goes with the stress over the stiffness.
#[test]
fn asymmetry_goes_with_stress_over_stiffness() {
    for seed in 0..5 {
        let of = |pressure_ratio: f64| {
            let network = random(seed, pressure_ratio);
            let operator = truss_like(&network);
            [asymmetry(&operator), asymmetry(&nominal(&operator, &network))]
        };
        for unloaded in of(0.0) {
            Claim::of("T-4", "asymmetry of the operators of networks of discs without stress")
                .error(unloaded)
                .within(1e-12);
        }
        let [strong, weak] = [1e-2, 1e-4].map(of);
        for ((name, strong), weak) in ["true", "nominal"].into_iter().zip(strong).zip(weak) {
            Claim::of(
                "T-4",
                &format!("growth of the asymmetry with a hundredfold pressure, operator of {name} stress"),
            )
            .value(strong / weak, 100.0)
            .within(0.1);
            assert!(strong < 0.05, "seed {seed}: {strong:e}");
        }
    }
}
