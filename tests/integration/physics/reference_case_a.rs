//! Goal. The element test reproduces two independent DEM codes on one packing ("case A"): 400 discs, k_n/p = 1000,
//! k_t/k_n = 0.5, friction 0.5, prepared without friction, so marginally rigid (z = 4.0).
//! Paths. Biaxial at constant area, lengths growing as exp(+e) and shrinking as exp(-e); drained biaxial at constant
//! lateral stress. Units are dimensionless; every comparison is on the strains of the reference rows themselves.
//! Reference. Yade 2023.02a and LAMMPS 22 Jul 2025, see `tests/data/case-a/README.md`.
//! Tolerance. The scatter of the references: 0.5 % to 0.2 % strain, 2.5 % to 0.5 %, 5 % beyond. The packing is chaotic
//! beyond 0.5 % strain and at some point collapses locally, in each run at another strain: at constant area between
//! 2.45 % and never, drained from 1.7 %. The comparisons end before, for a single run has no number there.

use crate::harness::table::Table;
use protocol::TangentKind;
use rve_server::programs::rve_test::{ElementRow, ElementTest, run_element};
use std::path::{Path, PathBuf};

/// Scatter of the references up to a strain, relative.
const BANDS: [(f64, f64); 3] = [(0.002, 0.005), (0.005, 0.025), (0.024, 0.05)];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/case-a")
}

/// Row 0 and the first `count` rows of one of the two tests.
fn run(name: &str, count: u32) -> Vec<ElementRow> {
    let text = std::fs::read_to_string(folder().join(name)).unwrap();
    let mut test = ElementTest::from_toml(&text).unwrap();
    test.path[0].repeat = count;
    let mut rows = Vec::new();
    let summary = run_element(&test, &folder(), TangentKind::None, &mut |row| rows.push(row.clone())).unwrap();
    assert_eq!((summary.not_equilibrated, summary.large_overlap), (0, 0));
    rows
}

/// Checks `values` against `expected` row by row and prints the largest difference in each band.
fn check_bands(what: &str, strains: &[f64], values: &[f64], expected: &[f64]) {
    let mut from = 0.0;
    for (to, tolerance) in BANDS {
        let mut worst: (f64, f64) = (0.0, 0.0);
        let mut compared = 0;
        for ((strain, value), wanted) in strains.iter().zip(values).zip(expected) {
            let error = (value / wanted - 1.0).abs();
            if *strain > from && *strain <= to {
                compared += 1;
                worst = if error > worst.0 { (error, *strain) } else { worst };
            }
        }
        eprintln!("{what}: up to {to}, {compared} rows, at most {:.2e} (at strain {:.4})", worst.0, worst.1);
        assert!(compared >= 5, "{what}: too few rows up to {to}");
        assert!(worst.0 <= tolerance, "{what}: {worst:?} exceeds {tolerance} up to strain {to}");
        from = to;
    }
}

#[test]
fn stress_before_any_grain_moves_is_that_of_both_codes() {
    // Yade and LAMMPS (its run without viscous forces) agree on these to ten digits.
    let expected =
        [[-0.999_801_691_523_032_7, 0.077_451_716_818_333], [0.077_451_716_818_333, -1.000_200_325_886_063]];
    let row = unstrained_row();
    for (stress_row, expected_row) in row.stress.iter().zip(&expected) {
        for (value, wanted) in stress_row.iter().zip(expected_row) {
            assert!((value - wanted).abs() < 1e-9, "{:?}", row.stress);
        }
    }
    assert_eq!(row.coordination_number, 2.0 * 803.0 / 400.0);
}

fn unstrained_row() -> ElementRow {
    let text = std::fs::read_to_string(folder().join("constant-area.toml")).unwrap();
    let mut test = ElementTest::from_toml(&text).unwrap();
    test.path[0].repeat = 1;
    let mut first = None;
    run_element(&test, &folder(), TangentKind::None, &mut |row| {
        first.get_or_insert_with(|| row.clone());
    })
    .unwrap();
    first.unwrap()
}

#[test]
fn constant_area_curve_lies_in_the_scatter_of_the_codes() {
    let rows = run("constant-area.toml", 80);
    let reference = Table::read(&folder().join("constant-area-reference.csv"));
    let strains = reference.column("strain");
    for (row, strain) in rows[1..].iter().zip(&strains) {
        assert!((row.deformation[0][0].ln() - strain).abs() < 1e-12);
        assert!((row.deformation[1][1].ln() + strain).abs() < 1e-12);
    }
    let deviator: Vec<f64> = rows[1..].iter().map(|row| 0.5 * (row.stress[0][0] - row.stress[1][1])).collect();
    check_bands("constant area, q", &strains, &deviator, &reference.column("q_mean"));
}

#[test]
fn drained_curve_follows_the_code_that_held_the_lateral_stress() {
    let rows = run("drained.toml", 56);
    let reference = Table::read(&folder().join("drained-yade.csv"));
    // Row 0 of the reference is the unstrained packing.
    let strains = reference.column("strain")[1..].to_vec();
    for row in &rows[1..] {
        assert!((row.stress[0][0] + 1.0).abs() < 1e-3, "{row:?}");
    }
    let axial: Vec<f64> = rows[1..].iter().map(|row| row.stress[1][1]).collect();
    check_bands("drained, sigma_yy", &strains, &axial, &reference.column("syy")[1..]);
    let (widths, heights) = (reference.column("cell_xx"), reference.column("cell_yy"));
    for (number, row) in rows.iter().enumerate().skip(1) {
        let area = row.deformation[0][0] * row.deformation[1][1];
        let expected = widths[number] * heights[number] / (widths[0] * heights[0]);
        // Measured 1.2e-04 and 3.8e-04; the two codes differ by up to 7e-4.
        let tolerance = if strains[number - 1] <= 0.01 { 2.3e-04 } else { 7.7e-04 };
        assert!((area - expected).abs() < tolerance, "row {number}: area {area:.6}, reference {expected:.6}");
    }
}
