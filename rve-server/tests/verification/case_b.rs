//! Goal. The element test of spheres reproduces two independent DEM codes on one packing ("case B"): 1000 spheres,
//! Hertz-Mindlin with incremental tangential forces, (E*/p)^(2/3) = 300, friction 0.5.
//! Path. Simple shear at constant volume to a shear of 0.6 %; `grainspan element tests/data/case-b/shear.toml` goes
//! on to 3 %. Units are dimensionless.
//! Reference. Yade 2023.02a and LAMMPS 22 Jul 2025, see `tests/data/case-b/README.md`.
//! Tolerance. 0.2 % of the shear stress and of the mean stress from a shear of 0.09 % on: the response is not chaotic, and
//! the two codes differ by 0.1 % among themselves. Before, the rate of the references takes a larger share of a small
//! stress.

use protocol::TangentKind;
use rve_server::element::{ElementRow, ElementTest, run_element};
use std::path::{Path, PathBuf};

/// Rows of the reference that the test follows.
const ROWS: u32 = 20;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/case-b")
}

fn rows() -> Vec<ElementRow> {
    let text = std::fs::read_to_string(folder().join("shear.toml")).unwrap();
    let mut test = ElementTest::from_toml(&text).unwrap();
    test.path[0].repeat = ROWS;
    let mut rows = Vec::new();
    let summary = run_element(&test, &folder(), TangentKind::None, &mut |row| rows.push(row.clone())).unwrap();
    assert_eq!((summary.not_equilibrated, summary.large_overlap), (0, 0));
    rows
}

/// A column of the reference by name.
fn reference(column: &str) -> Vec<f64> {
    let text = std::fs::read_to_string(folder().join("shear-reference.csv")).unwrap();
    let mut lines = text.lines();
    let place = lines.next().unwrap().split(',').position(|heading| heading == column).unwrap();
    lines.map(|line| line.split(',').nth(place).unwrap().parse().unwrap()).collect()
}

#[test]
fn simple_shear_of_spheres_follows_both_codes() {
    let rows = rows();
    // Before any grain moves the stress is a function of the packing alone; both codes give it to nine digits.
    for (axis, expected) in [-0.998_557_662, -1.000_778_285, -1.000_658_168].into_iter().enumerate() {
        assert!((rows[0].stress[axis][axis] - expected).abs() < 1e-8, "{:?}", rows[0].stress);
    }
    assert_eq!(rows[0].coordination_number, 2.0 * 3317.0 / 1000.0);
    let strains = reference("strain");
    let mut worst = [0.0f64; 2];
    for code in ["yade", "lammps"] {
        let column = |name: &str| reference(&format!("{code}_{name}"));
        let (sxx, syy, szz, sxy) = (column("sxx"), column("syy"), column("szz"), column("sxy"));
        for (number, row) in rows[1..].iter().enumerate().skip(2) {
            assert!((row.deformation[0][1] - strains[number]).abs() < 1e-9);
            let shear = (row.stress[0][1] / sxy[number] - 1.0).abs();
            let trace = row.stress[0][0] + row.stress[1][1] + row.stress[2][2];
            let mean = (trace / (sxx[number] + syy[number] + szz[number]) - 1.0).abs();
            worst = [worst[0].max(shear), worst[1].max(mean)];
        }
    }
    eprintln!(
        "case B to a shear of {:.4}: sxy within {:.2e}, mean stress within {:.2e}",
        strains[ROWS as usize - 1],
        worst[0],
        worst[1]
    );
    assert!(worst[0] < 2e-3 && worst[1] < 2e-3, "{worst:?}");
}
