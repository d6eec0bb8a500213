//! Cells at the corners of the range of grains: soft and stiff, smooth and rough, equal and unequal, discs and spheres.

use crate::samples::{border_stress, tight};
use claims::Claim;
use protocol::{RveSolver, TangentKind, Tensor2, TrialFlags, TrialOptions, TrialResult};
use rve_server::contact::ContactTable;
use rve_server::definition::{GrainDefinition, RveOptions};
use rve_server::engine::GrainRve;
use rve_server::preparation::{Grading, PackingRecipe, generate};
use rve_server::solver::SolverFor;
use rve_server::space::{Discs, Spheres, add_scaled, largest_component};

/// One corner.
#[derive(Clone, Copy, Debug)]
struct Corner {
    /// Mean overlap over the radius of small grains that the pressure makes, roughly.
    overlap: f64,
    /// k_t / k_n of linear springs; of Hertz-Mindlin contacts Poisson's ratio.
    ratio: f64,
    friction: f64,
    /// Largest over smallest radius.
    sizes: f64,
}

const fn corner(overlap: f64, ratio: f64, friction: f64, sizes: f64) -> Corner {
    Corner { overlap, ratio, friction, sizes }
}

/// What the grains of a corner are made of, and the pressure that makes an overlap.
struct Material {
    name: &'static str,
    /// With a tangential stiffness, or Poisson's ratio, and a friction.
    contact: fn(f64, f64) -> ContactTable,
    /// Pressure, Pa, of an overlap in a cell of this dimension whose large grains have this radius, m.
    pressure: fn(f64, usize, f64) -> f64,
}

const SPRINGS: Material = Material {
    name: "linear",
    contact: |ratio, friction| ContactTable::linear(1.0, ratio, friction),
    // Linear springs of spheres press the less per area the larger these are.
    pressure: |overlap, dimension, radius| if dimension == 3 { overlap / radius } else { overlap },
};

const HERTZIAN: Material = Material {
    name: "Hertz-Mindlin",
    contact: |ratio, friction| ContactTable::hertz_mindlin(1.0, ratio, friction),
    pressure: |overlap, _, _| overlap.powf(1.5),
};

/// Corners of cells with linear springs.
const WITH_SPRINGS: [Corner; 7] = [
    corner(1e-4, 0.0, 0.0, 1.5),
    corner(1e-6, 0.5, 0.5, 1.5),
    corner(1e-6, 2.0, 1e9, 10.0),
    corner(1e-3, 1.0, 0.5, 10.0),
    corner(1e-2, 0.0, 0.5, 10.0),
    corner(1e-1, 0.5, 0.5, 10.0),
    corner(1e-1, 2.0, 1e9, 1.5),
];

/// Corners of cells with Hertz-Mindlin contacts.
const HERTZ_MINDLIN: [Corner; 7] = [
    corner(1e-4, 0.2, 0.0, 1.5),
    corner(1e-6, 0.2, 0.5, 1.5),
    corner(1e-6, 0.0, 1e9, 10.0),
    corner(1e-3, 0.49, 0.5, 10.0),
    corner(1e-2, 0.2, 0.5, 10.0),
    corner(1e-1, 0.2, 0.5, 10.0),
    corner(1e-1, 0.49, 1e9, 1.5),
];

/// S-5: the stable step holds, the stress from the border is that of the contacts, and every answer is finite.
#[test]
fn discs_at_the_corners_come_to_rest() {
    all_come_to_rest::<Discs>("discs with linear springs", &SPRINGS, &WITH_SPRINGS, 60);
}

/// S-5 in space, with linear springs.
#[test]
fn spheres_at_the_corners_come_to_rest() {
    all_come_to_rest::<Spheres>("spheres with linear springs", &SPRINGS, &WITH_SPRINGS, 100);
}

/// S-5 in space, with the springs of Hertz and Mindlin.
#[test]
fn hertzian_spheres_at_the_corners_come_to_rest() {
    all_come_to_rest::<Spheres>("Hertz-Mindlin spheres", &HERTZIAN, &HERTZ_MINDLIN, 100);
}

/// States how many of the cells of `number` grains do not come to rest.
fn all_come_to_rest<S: SolverFor>(kind: &str, material: &Material, corners: &[Corner], number: usize) {
    let restless = corners.iter().filter(|&&corner| !comes_to_rest::<S>(material, corner, number)).count();
    let quantity = format!("cells at corners of the range that do not come to rest, {kind}");
    Claim::of("S-5", &quantity).value(restless as f64, 0.0).within_absolute(0.0);
}

/// Prepares the cell of a corner, strains it a little and returns whether it came to rest; states what its stress is then.
fn comes_to_rest<S: SolverFor>(material: &Material, corner: Corner, number: usize) -> bool {
    let Corner { overlap, ratio, friction, sizes } = corner;
    let name = format!("{} {corner:?}", material.name);
    let pressure_of = |overlap: f64| (material.pressure)(overlap, S::DIMENSION, sizes);
    let pressure = pressure_of(overlap);
    // A packing with overlaps above a tenth is refused: the softest cells are compressed afterwards. The stiffest are
    // unloaded, because the servo creeps at 1e-6 k_n, from a packing without friction, which does not come apart on the way; and
    // the servo circles where every contact sticks, so that friction without bound comes after the preparation.
    let prepared = if overlap > 1e-2 { 4e-3 } else { overlap.clamp(1e-4, 1e-2) };
    // With seed 3 discs of size ratio 10 overlap by 0.111 at 5e-3, and such a packing is refused as it should be.
    let text = format!(
        "dimension = {}\nnumber = {number}\nseed = 4\npressure = {:e}\ntolerance = 1e-4\nstress_tolerance = 1e-2\n\
         [grading]\ndistribution = \"list\"\nradii = [1.0]\n[contact]\nlaw = \"linear\"\nnormal_stiffness = 1.0\n\
         stiffness_ratio = 0.5\nfriction = 0.5\n",
        S::DIMENSION,
        pressure_of(prepared),
    );
    let grading = Grading::Bidisperse { small_radius: 1.0, large_radius: sizes, large_share: 0.5 };
    let contact = (material.contact)(ratio, if overlap < prepared { 0.0 } else { friction.min(0.5) });
    let recipe = PackingRecipe { grading, contact, ..PackingRecipe::from_toml(&text).unwrap() };
    let (packing, _) = generate::<S>(&recipe, &mut |_| ()).unwrap_or_else(|error| panic!("{name}: {error}"));
    let contact = (material.contact)(ratio, friction);
    let options = RveOptions { strain_per_step: Some(0.05 * prepared), tolerance: Some(1e-7), ..tight() };
    let mut cell = GrainRve::<S>::new(&GrainDefinition { packing, contact, options }).unwrap();
    if overlap > prepared {
        let softened = cell.trial(&isotropic(S::DIMENSION, -0.07), &TrialOptions::default()).unwrap();
        assert!(softened.flags.contains(TrialFlags::LARGE_OVERLAP), "{name}");
        assert!(-softened.stress.get(0, 0) > 0.5 * pressure, "{name}: {:?}", softened.stress);
        cell.commit().unwrap();
    }
    if overlap < prepared {
        unload(&mut cell, pressure, &name);
    }
    let strain = Tensor2([0.5 * overlap, 0.2 * overlap, 0.0, 0.0, -overlap, 0.0, 0.0, 0.0, 0.0]);
    let answer = cell.trial(&strain, &TrialOptions::default()).unwrap();
    if answer.flags.contains(TrialFlags::NOT_EQUILIBRATED) {
        return false;
    }
    let network = cell.network().unwrap();
    let jump = add_scaled(&network.stress(), -1.0, &border_stress(network));
    let error = largest_component(&jump) / pressure;
    let quantity = format!(
        "stress from the border against the contacts, corners of the range, {}D, {}, of the pressure",
        S::DIMENSION,
        material.name
    );
    Claim::of("S-5", &quantity).error(error).within(1e-6);
    true
}

fn isotropic(dimension: usize, size: f64) -> Tensor2 {
    let out_of_plane = if dimension == 3 { size } else { 0.0 };
    Tensor2([size, 0.0, 0.0, 0.0, size, 0.0, 0.0, 0.0, out_of_plane])
}

/// Expands a cell until it bears a pressure, within a factor of two.
fn unload<S: SolverFor>(cell: &mut GrainRve<S>, pressure: f64, name: &str) {
    let dimension = S::DIMENSION;
    let options = TrialOptions { tangent: TangentKind::TrussLike, ..TrialOptions::default() };
    let mean =
        |answer: &TrialResult| -(0..dimension).map(|i| answer.stress.get(i, i)).sum::<f64>() / dimension as f64;
    let mut strain = 1e-9;
    for _ in 0..60 {
        let answer = cell.trial(&isotropic(dimension, strain), &options).unwrap();
        let now = mean(&answer);
        if now < 0.5 * pressure {
            cell.rollback();
            strain *= 0.5;
            continue;
        }
        cell.commit().unwrap();
        if now < 2.0 * pressure {
            return;
        }
        let tangent = answer.tangent.unwrap();
        let bulk = (0..dimension).map(|j| tangent.get(0, 0, j, j)).sum::<f64>();
        strain = 0.7 * (now - pressure) / bulk;
    }
    panic!("{name}: still not at {pressure:e}");
}
