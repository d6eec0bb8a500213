//! Crystals with one grain per cell: every contact is with an image of the same grain, and all answers are closed forms.

use crate::samples::{SQUARE, TRIANGULAR, assert_close, lattice, perturbed_operator, trial};
use claims::Claim;
use protocol::{RveSolver, TangentKind, Tensor2, TrialOptions};
use rve_server::contact::{ContactTable, Rotations};
use rve_server::engine::GrainRve;

const NORMAL: f64 = 1.0;
const TANGENTIAL: f64 = 0.5;

fn sticking() -> ContactTable {
    ContactTable::linear(NORMAL, TANGENTIAL / NORMAL, 1e9)
}

/// D-1 and D-6: the perturbed operator of the triangular lattice, without and with pressure. With `f` the contact force
/// and `p = sqrt(3) f / d` the pressure, the pressure takes p/4 from C1111, adds 5p/4 to C1122 and takes 3p/4 from
/// C1212 = C1221.
#[test]
fn triangular_lattice_has_its_moduli_with_and_without_pressure() {
    for (entry, overlap) in [("D-1", 1e-6), ("D-6", 0.02)] {
        let mut cell = GrainRve::new(&lattice(TRIANGULAR, overlap, sticking())).unwrap();
        let pressure = -cell.observe(protocol::Observables::NONE).unwrap().stress.get(0, 0);
        assert_close(pressure, 3f64.sqrt() * NORMAL * overlap / (1.0 - overlap), 1e-12, "pressure");
        let operator = perturbed_operator(&mut cell, (overlap * 1e-2).min(1e-5));
        let quarter = 3f64.sqrt() / 4.0;
        let expected = [
            (0, 0, "C1111 and C2222", quarter * (3.0 * NORMAL + TANGENTIAL) - 0.25 * pressure),
            (3, 3, "C1111 and C2222", quarter * (3.0 * NORMAL + TANGENTIAL) - 0.25 * pressure),
            (0, 3, "C1122 and C2211", quarter * (NORMAL - TANGENTIAL) + 1.25 * pressure),
            (3, 0, "C1122 and C2211", quarter * (NORMAL - TANGENTIAL) + 1.25 * pressure),
            (1, 1, "C1212 and C1221", quarter * (NORMAL + TANGENTIAL) - 0.75 * pressure),
            (1, 2, "C1212 and C1221", quarter * (NORMAL + TANGENTIAL) - 0.75 * pressure),
            (0, 1, "C1112 and C2221", 0.0),
            (3, 2, "C1112 and C2221", 0.0),
        ];
        for (row, column, name, value) in expected {
            Claim::of(entry, &format!("{name} by differences of stresses, over the normal stiffness"))
                .value(operator[row][column], value)
                .within_absolute(1e-4);
        }
    }
}

/// D-2: square lattice.
#[test]
fn square_lattice_has_its_moduli() {
    let mut cell = GrainRve::new(&lattice(SQUARE, 1e-6, sticking())).unwrap();
    let operator = perturbed_operator(&mut cell, 1e-8);
    for (row, column, name, value) in [
        (0, 0, "C1111 and C2222", NORMAL),
        (3, 3, "C1111 and C2222", NORMAL),
        (0, 3, "C1122", 0.0),
        (1, 1, "C1212 and C2112", 0.5 * TANGENTIAL),
        (2, 1, "C1212 and C2112", 0.5 * TANGENTIAL),
    ] {
        Claim::of("D-2", &format!("{name} by differences of stresses, over the normal stiffness"))
            .value(operator[row][column], value)
            .within_absolute(1e-4);
    }
}

/// D-7: pressure of the triangular lattice under finite isotropic compression, `sqrt(3) k_n (d - b) / b`.
#[test]
fn finite_compression_follows_the_closed_form() {
    let mut cell = GrainRve::new(&lattice(TRIANGULAR, 0.0, sticking())).unwrap();
    let mut spacing = 1.0;
    for _ in 0..5 {
        let answer = trial(&mut cell, &[[-0.01, 0.0], [0.0, -0.01]]);
        cell.commit().unwrap();
        spacing *= 0.99;
        let expected = -3f64.sqrt() * NORMAL * (1.0 - spacing) / spacing;
        for axis in 0..2 {
            Claim::of("D-7", "normal stress of the triangular lattice, compressed by up to 5 %, over k_n")
                .value(answer.stress.get(axis, axis), expected)
                .within_absolute(1e-12);
        }
        Claim::of("D-7", "shear stress of the triangular lattice, compressed by up to 5 %, over k_n")
            .value(answer.stress.get(0, 1), 0.0)
            .within_absolute(1e-14);
    }
}

/// D-7: the square lattice, `k_n (d - b) / b`.
#[test]
fn finite_compression_of_the_square_lattice_follows_the_closed_form() {
    let mut cell = GrainRve::new(&lattice(SQUARE, 0.0, sticking())).unwrap();
    let mut spacing = 1.0;
    for _ in 0..5 {
        let answer = trial(&mut cell, &[[-0.01, 0.0], [0.0, -0.01]]);
        cell.commit().unwrap();
        spacing *= 0.99;
        let expected = -NORMAL * (1.0 - spacing) / spacing;
        for (i, j, name, value) in [(0, 0, "normal", expected), (1, 1, "normal", expected), (0, 1, "shear", 0.0)] {
            Claim::of("D-7", &format!("{name} stress of the square lattice, compressed by up to 5 %, over k_n"))
                .value(answer.stress.get(i, j), value)
                .within_absolute(1e-12);
        }
    }
}

/// D-9: once the horizontal rows have lost contact and the inclined contacts slide, the stress ratio is
/// `tan(theta) tan(theta + phi_mu)` all along the softening branch, in finite strain.
#[test]
fn frictional_lattice_softens_along_its_closed_form() {
    for (friction, angles) in [(0.1, [59.5, 59.029, 57.0, 54.65]), (0.3, [59.512, 58.0, 56.31, 54.65])] {
        let overlap: f64 = 1e-5;
        let contact = ContactTable::linear(NORMAL, TANGENTIAL, friction);
        let mut cell = GrainRve::new(&lattice(TRIANGULAR, overlap, contact)).unwrap();
        let mut before = 60f64.to_radians();
        for degrees in angles {
            // The inclined contacts keep their length: the cell widens by the cosine and sinks by the sine.
            let angle = f64::to_radians(degrees);
            let h = [[angle.cos() / before.cos() - 1.0, 0.0], [0.0, angle.sin() / before.sin() - 1.0]];
            let answer = trial(&mut cell, &h);
            cell.commit().unwrap();
            before = angle;
            let ratio = answer.stress.get(1, 1) / answer.stress.get(0, 0);
            let expected = angle.tan() * (angle + friction.atan()).tan();
            assert_eq!(answer.scalars.coordination_number, 4.0, "two families of contacts at {degrees} degrees");
            Claim::of("D-9", &format!("stress ratio on the softening branch, friction {friction}"))
                .value(ratio, expected)
                .within(1e-3);
        }
    }
}

/// Blocked rotations: grains turn with the cell and not otherwise, so the response stays objective; the tangent that the
/// engine returns is the derivative of what it does.
#[test]
fn blocked_rotations_keep_grains_with_the_cell() {
    let contact = ContactTable { rotations: Rotations::Blocked, ..sticking() };
    let skewed = [[1.0, 0.0], [0.45, 0.893_028_554_974_587_5]];
    let mut cell = GrainRve::new(&lattice(skewed, 1e-3, contact)).unwrap();
    let perturbed = perturbed_operator(&mut cell, 1e-7);
    let stress = cell.observe(protocol::Observables::NONE).unwrap().stress.plane();
    assert_close(perturbed[1][2] - perturbed[1][1], stress[0][0] - stress[1][1], 1e-6, "objectivity");
    let options = TrialOptions { tangent: TangentKind::TrussLike, ..TrialOptions::default() };
    let tangent = cell.trial(&Tensor2::ZERO, &options).unwrap().tangent.unwrap().plane();
    for row in 0..4 {
        for column in 0..4 {
            assert_close(tangent[row][column], perturbed[row][column], 1e-6, &format!("C[{row}][{column}]"));
        }
    }
    trial(&mut cell, &[[0.0, 1e-3], [1e-3, 0.0]]);
    cell.commit().unwrap();
    assert_eq!(cell.committed().rotations, [0.0]);
    trial(&mut cell, &[[0.0, -1e-3], [1e-3, 0.0]]);
    cell.commit().unwrap();
    assert_close(cell.committed().rotations[0], 1e-3, 1e-6, "rotation of the grain with the cell");
}
