//! Cells that are sheared far: the vectors of the cell are reduced on the way, and nobody notices.

use crate::samples::{hundred_discs, trial};
use claims::Claim;
use protocol::{Observables, RveSolver};
use rve_server::definition::RveOptions;
use rve_server::engine::GrainRve;
use rve_server::space::{add_scaled, largest_component};

/// S-6: simple shear to 5. The answer before and the look after every reduction agree, the cell stays short, and the
/// packing keeps a sound stress.
#[test]
fn shear_to_five_reduces_the_cell_without_a_jump() {
    let options = RveOptions { strain_per_step: Some(1e-4), tolerance: Some(1e-3), ..RveOptions::default() };
    let mut cell = GrainRve::new(&hundred_discs(options)).unwrap();
    let mut reductions = 0;
    for _ in 0..50 {
        let corner = cell.committed().cell.rows[1][0];
        let answer = trial(&mut cell, &[[0.0, 0.1], [0.0, 0.0]]);
        cell.commit().unwrap();
        let rows = cell.committed().cell.rows;
        reductions += u32::from(rows[1][0] < corner);
        assert!(rows[1][0].abs() <= 1.2 * rows[0][0], "{rows:?}");
        let seen = cell.observe(Observables::NONE).unwrap().stress.plane();
        let pressure = -0.5 * (seen[0][0] + seen[1][1]);
        let jump = largest_component(&add_scaled(&seen, -1.0, &answer.stress.plane())) / pressure;
        assert!(pressure > 0.0, "pressure {pressure}");
        Claim::of("S-6", "jump of the stress as the cell is reduced, of the pressure").error(jump).within(1e-9);
    }
    Claim::of("S-6", "reductions of the cell on the way to a shear of 5").number(f64::from(reductions)).at_least(4.0);
}
