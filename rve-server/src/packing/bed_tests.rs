//! Cells that are hard to bring to a stress.

use super::{PackingRecipe, generate};
use crate::space::Discs;

/// Soft discs that never slide: a cell that had lost its load crept, and contacts that open under one operator and close
/// under the next can lead the servo round in circles.
#[test]
fn discs_that_never_slide_come_to_their_stress() {
    let text = "dimension = 2\nnumber = 60\nseed = 3\npressure = 1e-2\ntolerance = 1e-4\nstress_tolerance = 1e-2\n\
                [grading]\ndistribution = \"list\"\nradii = [1.0]\n[contact]\nlaw = \"linear\"\nnormal_stiffness = 1.0\n\
                stiffness_ratio = 2.0\nfriction = 1e9\n";
    let mut steps = 0;
    let (_, report) = generate::<Discs>(&PackingRecipe::from_toml(text).unwrap(), &mut |_| steps += 1).unwrap();
    assert!(report.stress_error < 1e-2 && steps < 1000, "{steps} steps, stress error {:e}", report.stress_error);
}
