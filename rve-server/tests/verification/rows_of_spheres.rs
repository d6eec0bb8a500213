//! Rows of spheres with two contacts each. They buckle under compression unless contacts hold them, and tangent operators know which do.

use crate::samples::tight;
use crate::spheres::{Matrix, tensor, trial};
use protocol::{RveSolver, TangentKind, Tensor2, TrialOptions};
use rve_server::contact::{ContactTable, Rotations};
use rve_server::definition::{GrainDefinition, PackingFile};
use rve_server::engine::GrainRve;
use rve_server::space::{Spheres, scaled};

/// A sphere: centre and radius, m.
type Sphere = [f64; 4];

/// A large sphere that touches its images, and a row of two small ones between itself and its image along the first axis.
const ROW: (Matrix, [Sphere; 3]) = (
    [[3.599_97, 0.0, 0.0], [0.0, 1.999_99, 0.0], [0.0, 0.0, 1.999_99]],
    [[0.1, 0.1, 0.1, 1.0], [1.499_99, 0.1, 0.1, 0.4], [2.299_98, 0.1, 0.1, 0.4]],
);

fn sticking() -> ContactTable {
    ContactTable::linear(1e6, 0.5, 1.0)
}

/// `C_1111` and `C_1212` of a cell: of the frozen network, and by central differences of trials.
fn stiffness(rows: Matrix, grains: &[Sphere], contact: ContactTable) -> [[f64; 2]; 2] {
    let packing = PackingFile::new(rows, grains.to_vec());
    let mut cell = GrainRve::<Spheres>::new(&GrainDefinition { packing, contact, options: tight() }).unwrap();
    let mut still = Tensor2::ZERO;
    still.0[0] = -1e-9;
    let options = TrialOptions { tangent: TangentKind::TrussLike, ..TrialOptions::default() };
    let tangent = cell.trial(&still, &options).unwrap().tangent.unwrap();
    let slope = |cell: &mut GrainRve<Spheres>, axis: usize| {
        let mut h = [[0.0; 3]; 3];
        h[0][axis] = 1e-8;
        let [plus, minus] = [1.0, -1.0].map(|sign| tensor(&trial(cell, &scaled(&h, sign))));
        0.5e8 * (plus[0][axis] - minus[0][axis])
    };
    let [axial, shear] = [0, 1].map(|axis| slope(&mut cell, axis));
    [[tangent.get(0, 0, 0, 0), axial], [tangent.get(0, 1, 0, 1), shear]]
}

fn assert_agrees([found, expected]: [f64; 2], what: &str) {
    assert!(expected > 1e4 && (found / expected - 1.0).abs() < 1e-3, "{what}: {found} for {expected}");
}

#[test]
fn rolling_springs_hold_a_row() {
    let of = |rolling: f64| {
        let (rolling_stiffness, rolling_friction) = (rolling, 0.5 * rolling);
        stiffness(ROW.0, &ROW.1, ContactTable { rolling_stiffness, rolling_friction, ..sticking() })
    };
    let held = of(1.0);
    assert_agrees(held[0], "axial");
    assert_agrees(held[1], "shear");
    assert!(of(0.0)[0][0] < 1e-6 * held[0][0], "without them the row buckles");
}

/// Spheres that do not turn are held across by their tangential springs: the operator left the row out.
#[test]
fn blocked_rotations_hold_a_row() {
    let [axial, shear] = stiffness(ROW.0, &ROW.1, ContactTable { rotations: Rotations::Blocked, ..sticking() });
    assert_agrees(axial, "axial");
    assert_agrees(shear, "shear");
    let smooth = ContactTable { rotations: Rotations::Blocked, ..ContactTable::linear(1e6, 0.0, 0.0) };
    assert!(stiffness(ROW.0, &ROW.1, smooth)[0][0] < 1e-6 * axial[0], "nothing holds smooth spheres");
}

/// A row that is pulled stays straight by itself, as far as cohesion bears it.
#[test]
fn tension_holds_a_row() {
    let [axial, _] = stiffness(ROW.0, &ROW.1, ContactTable { cohesion: 3e-5, ..sticking() });
    assert_agrees(axial, "axial");
}

/// The contact of a sphere with its own image counted twice for it, and it was taken for a link of a row.
#[test]
fn a_sphere_that_touches_its_image_bears() {
    let rows = [[0.999_99, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 3.0]];
    let [axial, _] = stiffness(rows, &[[0.1, 0.1, 0.1, 0.5]], sticking());
    assert_agrees(axial, "axial");
}
