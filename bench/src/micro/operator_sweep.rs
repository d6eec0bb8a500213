//! How good operators are on a packing of discs, as CSV: checks T-7 (relaxed over uniform-strain moduli with k_t = k_n),
//! T-4 (deviation of operators from major symmetry) and T-8 (distance of consistent and quasi-static operators from PSTLO over the
//! size of the perturbation).
//! `grainspan bench micro operator_sweep [PACKING]`.

use anyhow::Context;
use protocol::{RveError, RveSolver, TangentKind, Tensor2, Tensor4, TrialOptions};
use rve_server::contact::ContactTable;
use rve_server::definition::{GrainDefinition, OperatorOptions, PackingFile, RveOptions};
use rve_server::engine::GrainRve;
use std::path::Path;

/// See the head of this file.
pub(super) fn run(arguments: &[String]) -> anyhow::Result<()> {
    let path = arguments.first().map_or("tests/data/case-a/packing.json", String::as_str);
    let packing: PackingFile = PackingFile::read(Path::new(path))?;
    moduli(&packing)?;
    symmetry(&packing)?;
    sweep(&packing)
}

fn cell(packing: &PackingFile, ratio: f64, options: RveOptions) -> Result<GrainRve, RveError> {
    let contact = ContactTable::linear(1000.0, ratio, 0.5);
    GrainRve::new(&GrainDefinition { packing: packing.clone(), contact, options })
}

fn operator(cell: &mut GrainRve, target: &Tensor2, kind: TangentKind) -> anyhow::Result<(Tensor4, u64)> {
    let result = cell.trial(target, &TrialOptions { tangent: kind, ..TrialOptions::default() })?;
    Ok((*result.tangent.context("no tangent")?, result.cost.force_evaluations))
}

#[expect(clippy::print_stdout, reason = "a program for people")]
fn moduli(packing: &PackingFile) -> anyhow::Result<()> {
    let mut cell = cell(packing, 1.0, RveOptions { tolerance: Some(1e-6), ..RveOptions::default() })?;
    let small = Tensor2::from_plane([[-1e-8, 0.0], [0.0, -1e-8]]);
    let pair = |operator: &Tensor4| {
        let bulk = 0.25
            * (operator.get(0, 0, 0, 0)
                + operator.get(0, 0, 1, 1)
                + operator.get(1, 1, 0, 0)
                + operator.get(1, 1, 1, 1));
        let shear = 0.25
            * (operator.get(0, 0, 0, 0) - operator.get(0, 0, 1, 1) - operator.get(1, 1, 0, 0)
                + operator.get(1, 1, 1, 1));
        [bulk, shear]
    };
    let (relaxed, _) = operator(&mut cell, &small, TangentKind::TrussLike)?;
    let (uniform, _) = operator(&mut cell, &small, TangentKind::Kruyt)?;
    let ([bulk, shear], [bulk_bound, shear_bound]) = (pair(&relaxed), pair(&uniform));
    println!("check,bulk_ratio,shear_ratio,C1111_over_kn,C1122_over_kn,C1212_over_kn");
    println!(
        "T-7,{:.4},{:.4},{:.4},{:.4},{:.4}",
        bulk / bulk_bound,
        shear / shear_bound,
        relaxed.get(0, 0, 0, 0) / 1e3,
        relaxed.get(0, 0, 1, 1) / 1e3,
        relaxed.get(0, 1, 0, 1) / 1e3
    );
    Ok(())
}

/// `|C - C^T| / |C|` of the operator of the true stress and of that of the nominal stress, `C_ijkl + sigma_ij d_kl -
/// sigma_il d_jk`, which is symmetric where the forces have a potential.
#[expect(clippy::print_stdout, reason = "a program for people")]
fn symmetry(packing: &PackingFile) -> anyhow::Result<()> {
    println!("check,strain,kind,true_stress,nominal_stress,pressure_over_C1111");
    let mut cell = cell(packing, 0.5, RveOptions { tolerance: Some(1e-6), ..RveOptions::default() })?;
    for strain in [1e-8, 2e-3] {
        let target = Tensor2::from_plane([[strain, 0.0], [0.0, -strain]]);
        for kind in [TangentKind::TrussLike, TangentKind::TrussLikeReleased, TangentKind::TrussLikeSlip] {
            let answer = cell.trial(&target, &TrialOptions { tangent: kind, ..TrialOptions::default() })?;
            let (operator, stress) = (*answer.tangent.context("no tangent")?, answer.stress);
            let (mut nominal, mut turned) = (operator, [operator, operator]);
            for [i, j, k, l] in (0..16).map(|place| [place & 1, place >> 1 & 1, place >> 2 & 1, place >> 3]) {
                let volume = if k == l { stress.get(i, j) } else { 0.0 };
                let turn = if j == k { stress.get(i, l) } else { 0.0 };
                nominal.set(i, j, k, l, operator.get(i, j, k, l) + volume - turn);
                turned[0].set(k, l, i, j, operator.get(i, j, k, l));
                turned[1].set(k, l, i, j, operator.get(i, j, k, l) + volume - turn);
            }
            println!(
                "T-4,{strain:e},{},{:.2e},{:.2e},{:.2e}",
                kind.keyword(),
                distance(&turned[0], &operator),
                distance(&turned[1], &nominal),
                -0.5 * (stress.get(0, 0) + stress.get(1, 1)) / operator.get(0, 0, 0, 0)
            );
        }
    }
    Ok(())
}

#[expect(clippy::print_stdout, reason = "a program for people")]
fn sweep(packing: &PackingFile) -> anyhow::Result<()> {
    println!("check,strain_before,kind,size,distance_from_truss_like,force_evaluations");
    let target = Tensor2::from_plane([[1e-4, 0.0], [0.0, -1e-4]]);
    for before in [0.0, 2e-3] {
        for exponent in [-8, -7, -6, -5, -4, -3] {
            let size = 10f64.powi(exponent);
            let operator_options = OperatorOptions {
                perturbation: Some(size),
                quasi_static_perturbation: Some(size),
                ..OperatorOptions::default()
            };
            let options =
                RveOptions { operator: operator_options, strain_per_step: Some(2e-6), ..RveOptions::default() };
            let mut cell = cell(packing, 0.5, options)?;
            if before > 0.0 {
                let path = Tensor2::from_plane([[before, 0.0], [0.0, -before]]);
                cell.trial(&path, &TrialOptions::default())?;
                cell.commit()?;
            }
            let elastic = operator(&mut cell, &target, TangentKind::TrussLike)?.0;
            for kind in [TangentKind::Consistent, TangentKind::ConsistentCentral, TangentKind::QuasiStatic] {
                let (perturbed, evaluations) = operator(&mut cell, &target, kind)?;
                println!(
                    "T-8,{before:e},{},{size:e},{:.3e},{evaluations}",
                    kind.keyword(),
                    distance(&perturbed, &elastic)
                );
            }
        }
    }
    Ok(())
}

/// Frobenius distance relative to `expected`.
fn distance(operator: &Tensor4, expected: &Tensor4) -> f64 {
    let square = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>();
    let difference = square(&mut operator.0.iter().zip(expected.0).map(|(value, wanted)| value - wanted));
    (difference / square(&mut expected.0.into_iter())).sqrt()
}
