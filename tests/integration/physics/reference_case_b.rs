//! Goal. Spheres with Hertz-Mindlin contacts reproduce two independent DEM codes on one packing ("case B"): 1000 spheres,
//! (E*/p)^(2/3) = 300, friction 0.5, tangential force by increments.
//! Path. Simple shear at constant volume, 100 rows of gamma = 2.998e-4, dimensionless.
//! Reference. Yade 2023.02a and LAMMPS 22 Jul 2025 at inertial number 1e-4, see `tests/data/case-b/README.md`.
//! Tolerance. 0.2 % of the shear stress, twice what the two programs differ by; this packing is not chaotic.

use crate::harness::table::Table;
use protocol::{Observables, RveEngine, TangentKind, Tensor2, TrialFlags, TrialOptions};
use rve_server::contact::ContactTable;
use rve_server::definition::{AnyDefinition, Packing, RveOptions};
use rve_server::engine::GrainEngine;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Stress components of the reference in the order of their columns, as places of a row-major tensor.
const PLACES: [usize; 6] = [0, 4, 8, 1, 5, 2];

/// Largest difference allowed: of a normal component relative to itself, of a shear component relative to the driven one.
const TOLERANCE: f64 = 2e-3;

#[derive(Deserialize)]
struct ShearTest {
    contact: ContactTable,
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/case-b")
}

fn close(value: f64, wanted: f64, allowed: f64, what: &str) {
    assert!((value - wanted).abs() <= allowed, "{what}: {value} instead of {wanted}, allowed {allowed:.1e}");
}

#[test]
fn sheared_spheres_follow_both_codes() {
    let test: toml::Table = toml::from_str(&std::fs::read_to_string(folder().join("shear.toml")).unwrap()).unwrap();
    let ShearTest { contact } = toml::Table::try_into(test).unwrap();
    let packing = Packing::read(&folder().join("packing.json")).unwrap();
    let definition = AnyDefinition::new(packing, contact, RveOptions::default());
    let mut cell = GrainEngine.create(&definition.to_protocol()).unwrap();
    let options = TrialOptions {
        tangent: TangentKind::None,
        ramp_steps: 0,
        observables: Observables::NONE,
        ..TrialOptions::default()
    };

    let given = cell.trial(&Tensor2([0.0; 9]), &options).unwrap();
    assert_eq!(given.scalars.coordination_number, 2.0 * 3317.0 / 1000.0);
    // Yade, before any grain has moved.
    let unstrained =
        [-0.998_557_662, -1.000_778_29, -1.000_658_17, -5.390_532_46e-3, 4.073_484_64e-3, 9.500_036_12e-3];
    for (place, wanted) in PLACES.into_iter().zip(unstrained) {
        close(given.stress.0[place], wanted, 1e-8, "unstrained");
    }

    let mut step = [0.0; 9];
    step[1] = 2.997_712_01e-4;
    let mut worst: (f64, f64) = (0.0, 0.0);
    for row in Table::read(&folder().join("shear-reference.csv")).rows() {
        let answer = cell.trial(&Tensor2(step), &options).unwrap();
        assert!(!answer.flags.contains(TrialFlags::NOT_EQUILIBRATED));
        cell.commit().unwrap();
        for (column, place) in PLACES.into_iter().enumerate() {
            let (yade, lammps) = (row[2 + column], row[8 + column]);
            let wanted = 0.5 * (yade + lammps);
            // Shear components are small against the one that is driven; early on even that one is.
            let scale = if column < 3 { wanted.abs() } else { row[5].abs().max(0.1) };
            close(answer.stress.0[place], wanted, TOLERANCE * scale, &format!("gamma {}, column {column}", row[1]));
            if column == 3 {
                let error = (answer.stress.0[place] / wanted - 1.0).abs();
                worst = if error > worst.0 && row[1] > 1e-3 { (error, row[1]) } else { worst };
            }
        }
    }
    eprintln!("largest difference of the shear stress beyond 0.1 %: {:.2e} at gamma {:.4}", worst.0, worst.1);
}
