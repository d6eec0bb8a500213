//! Cells that the checks share.

use protocol::{RveSolver, Tensor2, TrialOptions, TrialResult};
use rve_server::cell::ContactNetwork;
use rve_server::contact::ContactTable;
use rve_server::definition::{Accuracy, GrainDefinition, PackingFile, RveOptions};
use rve_server::engine::GrainRve;
use rve_server::space::plane::{self, Plane};
use rve_server::space::{Discs, Space, Tensor};
use std::path::Path;

/// Options for checks against closed forms.
pub(crate) fn tight() -> RveOptions {
    RveOptions { accuracy: Accuracy::Tight, strain_per_step: Some(1e-6), ..RveOptions::default() }
}

/// The contact law that the committed packings are used with.
pub(crate) fn sand() -> ContactTable {
    ContactTable { normal_stiffness: None, modulus: Some(1.0e8), ..ContactTable::linear(1.0, 0.5, 0.5) }
}

/// A committed packing of discs.
pub(crate) fn packing(name: &str) -> PackingFile {
    packing_of(name)
}

/// A committed packing of discs or spheres.
pub(crate) fn packing_of<S: Space>(name: &str) -> PackingFile<S> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings").join(name);
    PackingFile::read(&path).unwrap()
}

/// 100 discs at 100 kPa with the given options.
pub(crate) fn hundred_discs(options: RveOptions) -> GrainDefinition {
    GrainDefinition { packing: packing("discs-100.json"), contact: sand(), options }
}

/// One grain of unit diameter per primitive cell, pressed together by `overlap`.
pub(crate) fn lattice(rows: Plane, overlap: f64, contact: ContactTable) -> GrainDefinition {
    let packing = PackingFile::<Discs> {
        format: PackingFile::FORMAT.into(),
        version: PackingFile::VERSION,
        dimension: 2,
        thickness: 1.0,
        periodicity: rows.map(|row| row.map(|value| value * (1.0 - overlap))),
        grains: vec![[0.2, 0.1, 0.5]],
        contacts: Vec::new(),
        rolling_moments: Vec::new(),
        provenance: serde_json::Value::Null,
    };
    GrainDefinition { packing, contact, options: tight() }
}

pub(crate) const SQUARE: Plane = [[1.0, 0.0], [0.0, 1.0]];

/// Triangular lattice of unit spacing.
pub(crate) const TRIANGULAR: Plane = [[1.0, 0.0], [0.5, 0.866_025_403_784_438_6]];

/// The stress from the contacts that cross the border of the cell alone: `1/V sum f x (sum_k shift_k Yk)`, Pa. It differs
/// from [`ContactNetwork::stress`] by the unbalanced forces only, so the difference measures them.
pub(crate) fn border_stress<S: Space>(network: &ContactNetwork<S>) -> S::Tensor {
    let mut sum = S::Tensor::ZERO;
    for contact in &network.contacts {
        let (force, across) = (network.force(contact), network.translation(contact));
        for i in 0..S::DIMENSION {
            for j in 0..S::DIMENSION {
                sum[i][j] += force[i] * across[j];
            }
        }
    }
    let scale = 1.0 / network.volume();
    S::Tensor::from_fn(|i, j| sum[i][j] * scale)
}

pub(crate) fn trial(cell: &mut GrainRve, h: &Plane) -> TrialResult {
    cell.trial(&Tensor2::from_plane(*h), &TrialOptions::default()).unwrap()
}

/// `d sigma_ij / d F_kl` by central differences of trials, pairs ordered 11, 12, 21, 22.
pub(crate) fn perturbed_operator(cell: &mut GrainRve, size: f64) -> [[f64; 4]; 4] {
    let mut operator = [[0.0; 4]; 4];
    for column in 0..4 {
        let stress = |cell: &mut GrainRve, sign: f64| {
            let mut h = [[0.0; 2]; 2];
            h[column / 2][column % 2] = sign * size;
            trial(cell, &h).stress.plane()
        };
        let (plus, minus) = (stress(cell, 1.0), stress(cell, -1.0));
        let difference = plane::add_scaled(&plus, -1.0, &minus);
        for (row, values) in operator.iter_mut().enumerate() {
            values[column] = difference[row / 2][row % 2] / (2.0 * size);
        }
    }
    operator
}

#[track_caller]
pub(crate) fn assert_close(found: f64, expected: f64, tolerance: f64, what: &str) {
    assert!((found - expected).abs() <= tolerance, "{what}: found {found}, expected {expected} within {tolerance:e}");
}
