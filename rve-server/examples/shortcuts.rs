//! Two shortcuts that are not in the solver, and what they would give, as CSV:
//! `cargo run --release -p grainspan-rve-server --example shortcuts -- [PACKING] [increments]`.
//!
//! `extrapolated`: the error of the stress goes with the strain per step, so that two solves with n and 2n ramp steps give
//! a better value, `2 s(2n) - s(n)`, for 3n evaluations: against one solve with 3n steps. Errors are root mean squares over
//! the path, relative to the pressure, against 40 times as many steps; every way follows its own states.
//!
//! `predicted`: the stress of the next increment from a network tangent alone, without moving a grain, against the solver:
//! error over the change of stress, for increments onwards and back, of several sizes.

use protocol::{RveSolver, TangentKind, Tensor2, TrialOptions};
use rve_server::contact::ContactTable;
use rve_server::definition::{GrainDefinition, PackingFile, RveOptions};
use rve_server::engine::GrainRve;
use rve_server::tangent;
use std::path::Path;

/// Strain of an increment of the path.
const INCREMENT: f64 = 1e-4;

fn main() {
    let path = std::env::args().nth(1).unwrap_or_else(|| "tests/data/case-a/packing.json".into());
    let increments = std::env::args().nth(2).map_or(30, |text| text.parse().expect("a count"));
    let packing: PackingFile = PackingFile::read(Path::new(&path)).expect("a packing of discs");
    extrapolation(&packing, increments);
    prediction(&packing);
}

fn cell(packing: &PackingFile, tolerance: f64) -> GrainRve {
    let options = RveOptions { tolerance: Some(tolerance), ..RveOptions::default() };
    let contact = ContactTable::linear(1000.0, 0.5, 0.5);
    GrainRve::new(&GrainDefinition { packing: packing.clone(), contact, options }).expect("a cell")
}

fn shear(size: f64) -> Tensor2 {
    Tensor2::from_plane([[size, 0.0], [0.0, -size]])
}

/// Stress after a trial of the committed state, not committed.
fn stress(cell: &mut GrainRve, size: f64, ramp_steps: u32) -> ([f64; 4], u64) {
    let answer = cell.trial(&shear(size), &TrialOptions { ramp_steps, ..TrialOptions::default() }).expect("a trial");
    let [[xx, xy], [yx, yy]] = answer.stress.plane();
    ([xx, xy, yx, yy], answer.cost.force_evaluations)
}

fn difference(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// Stresses along the path and force evaluations. `combine` gives the stress of an increment; the last of its trials is
/// committed.
fn along(
    packing: &PackingFile,
    tolerance: f64,
    increments: usize,
    combine: impl Fn(&mut GrainRve) -> ([f64; 4], u64),
) -> (Vec<[f64; 4]>, u64) {
    let mut cell = cell(packing, tolerance);
    let mut spent = 0;
    let stresses = (0..increments)
        .map(|_| {
            let (stress, evaluations) = combine(&mut cell);
            spent += evaluations;
            cell.commit().expect("a trial");
            stress
        })
        .collect();
    (stresses, spent)
}

#[expect(clippy::print_stdout, reason = "a program for people")]
fn extrapolation(packing: &PackingFile, increments: usize) {
    println!("shortcut,steps_of_1e-4,way,rms_error,force_evaluations");
    let (reference, _) = along(packing, 1e-7, increments, |cell| stress(cell, INCREMENT, 4000));
    for steps in [10, 20, 40, 100] {
        let [single, double] = [3 * steps, 2 * steps]
            .map(|count| along(packing, 1e-3, increments, |cell| stress(cell, INCREMENT, count)));
        let extrapolated = along(packing, 1e-3, increments, |cell| {
            let (coarse, first) = stress(cell, INCREMENT, steps);
            let (fine, second) = stress(cell, INCREMENT, 2 * steps);
            (std::array::from_fn(|place| 2.0 * fine[place] - coarse[place]), first + second)
        });
        for (name, (stresses, spent)) in [("3n", single), ("2n", double), ("extrapolated", extrapolated)] {
            let squares = stresses.iter().zip(&reference).map(|(a, b)| difference(a, b).powi(2));
            let error = (squares.sum::<f64>() / increments as f64).sqrt();
            println!("extrapolated,{steps},{name},{error:.3e},{spent}");
        }
    }
}

#[expect(clippy::print_stdout, reason = "a program for people")]
fn prediction(packing: &PackingFile) {
    println!("shortcut,strain_before,increment,kind,relative_error,error_over_pressure,force_evaluations_saved");
    for before in [1e-3, 4e-3] {
        let mut cell = cell(packing, 1e-7);
        for _ in 0..(before / INCREMENT).round() as usize {
            stress(&mut cell, INCREMENT, 0);
            cell.commit().expect("a trial");
        }
        let (_, _) = stress(&mut cell, INCREMENT, 0);
        let network = cell.network().expect("a trial").clone();
        cell.commit().expect("a trial");
        let (start, _) = stress(&mut cell, 1e-12, 0);
        for size in [1e-7, 1e-6, 1e-5, 1e-4, -1e-7, -1e-6, -1e-5, -1e-4] {
            let (end, spent) = stress(&mut cell, size, 0);
            for kind in [TangentKind::TrussLike, TangentKind::TrussLikeSlip] {
                let operator = tangent::evaluate(&network, kind).operator.plane();
                let guess: [f64; 4] =
                    std::array::from_fn(|row| start[row] + size * (operator[row][0] - operator[row][3]));
                let (missed, change) = (difference(&guess, &end), difference(&end, &start));
                println!(
                    "predicted,{before:e},{size:e},{},{:.3e},{missed:.3e},{spent}",
                    kind.keyword(),
                    missed / change
                );
            }
        }
    }
}
