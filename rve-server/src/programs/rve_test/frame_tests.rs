//! Frames of boundary grains go through the same search for stresses as periodic cells.

use super::*;
use protocol::TangentKind;
use std::path::Path;

fn rows(frame: &str, path: &str) -> (Vec<ElementRow>, ElementSummary) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let text = format!(
        "packing = \"packings/discs-100.json\"\n[contact]\nmodulus = 6e7\nstiffness_ratio = 0.5\nfriction = 0.5\n[frame]\n{frame}\n{path}"
    );
    let test = ElementTest::from_toml(&text).unwrap();
    let mut rows = Vec::new();
    let summary = run_element(&test, &root, TangentKind::None, &mut |row| rows.push(row.clone())).unwrap();
    (rows, summary)
}

/// A frame whose sides count half is the periodic cell, and so are its stresses along a drained path.
#[test]
fn a_periodic_frame_with_shared_sides_follows_the_cell_under_controlled_stress() {
    let path = "[[path]]\nincrements = 4\nstrain = { yy = -2e-3 }\nstress = { xx = -1e5 }";
    let (framed, summary) = rows("constraint = \"periodic\"\nshared_sides = true", path);
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let text = format!(
        "packing = \"packings/discs-100.json\"\n[contact]\nmodulus = 6e7\nstiffness_ratio = 0.5\nfriction = 0.5\n[rve]\naccuracy = \"default\"\n{path}"
    );
    let test = ElementTest::from_toml(&text).unwrap();
    let mut cell = Vec::new();
    run_element(&test, &root, TangentKind::None, &mut |row| cell.push(row.clone())).unwrap();
    assert_eq!(framed.len(), cell.len());
    for (framed, cell) in framed.iter().zip(&cell) {
        let apart = (framed.stress[1][1] / cell.stress[1][1] - 1.0).abs();
        assert!(apart < 0.02, "row {}: {:?} and {:?} Pa", framed.increment, framed.stress, cell.stress);
        assert!(framed.damping_work.is_none() && cell.damping_work.is_some());
    }
    assert_eq!(summary.dem_steps, framed.iter().map(|row| row.dem_steps).sum::<u64>(), "probes count with their row");
}

/// One increment of 4 % under the constant stress of soft sides needs shorter parts.
#[test]
fn increments_that_are_too_large_for_a_frame_are_taken_in_parts() {
    let path = "[[path]]\nincrements = 1\nstrain = { yy = -0.04 }\nstress = { xx = -1e5 }";
    let (rows, summary) = rows("constraint = \"traction\"", path);
    assert_eq!(rows.len(), 2);
    let reached = rows[1].stress[0][0];
    let share = if summary.stress_jumps > 0 { 0.05 } else { 1e-3 };
    let scale = (-0.5 * (reached + rows[1].stress[1][1])).max(1e5);
    assert!((reached + 1e5).abs() <= share * scale, "{reached} Pa, {summary:?}");
    assert!(rows[1].trials > 16, "one at least for each part: {summary:?}");
}
