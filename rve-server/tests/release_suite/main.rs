//! Statistical checks of packings, frames and specimens that take minutes. Not part of the usual tests:
//!
//! `cargo test --release -p grainspan-rve-server --test release_suite -- --nocapture --test-threads 1`
//!
//! The last result is in `docs/lab-book/verification.md`.

#![expect(clippy::print_stderr, reason = "the figures are for people")]

#[path = "../support/gas.rs"]
mod gas;
mod jamming;
mod statistics;

use claims::Claim;
use protocol::{Observables, RveSolver, Tensor2, TrialOptions};
use rve_server::cell::ContactNetwork;
use rve_server::contact::ContactTable;
use rve_server::definition::{Accuracy, GrainDefinition, PackingFile, RveOptions};
use rve_server::engine::GrainRve;
use rve_server::preparation::{Grading, PackingRecipe, PackingReport, generate};
use rve_server::programs::specimen::{SpecimenEvent, SpecimenTest, run_specimen};
use rve_server::solver::SolverFor;
use rve_server::space::{Discs, Space, Spheres};
use std::path::Path;
use std::time::Instant;

/// A recipe of monodisperse or bidisperse grains of radius 1 (and 1.4), stiffness 1.
fn recipe(dimension: u32, number: usize, seed: u64, pressure: f64, friction: f64, ratio: f64) -> PackingRecipe {
    let grading = if ratio == 1.0 {
        Grading::List { radii: vec![1.0] }
    } else {
        Grading::Bidisperse { small_radius: 1.0, large_radius: ratio, large_share: 0.5 }
    };
    let text = format!(
        "dimension = {dimension}\nnumber = {number}\nseed = {seed}\npressure = {pressure:e}\ntolerance = 1e-4\n\
         stress_tolerance = 1e-2\n[grading]\ndistribution = \"list\"\nradii = [1.0]\n[contact]\nlaw = \"linear\"\n\
         normal_stiffness = 1.0\nstiffness_ratio = 0.5\nfriction = {friction:e}\n"
    );
    PackingRecipe { grading, ..PackingRecipe::from_toml(&text).unwrap() }
}

fn made<S: Space + SolverFor>(recipe: &PackingRecipe) -> (PackingFile<S>, PackingReport) {
    let started = Instant::now();
    let (packing, report) = generate::<S>(recipe, &mut |_| ()).unwrap();
    eprintln!(
        "  {} {}: friction {}, solid fraction {:.4}, z {:.3}, z* {:.3}, {} evaluations, {:.1} s",
        recipe.number,
        S::GRAINS,
        recipe.contact.friction,
        1.0 - report.porosity,
        report.coordination_number,
        report.coordination_number_no_rattlers,
        report.force_evaluations,
        started.elapsed().as_secs_f64()
    );
    (packing, report)
}

fn claim_jamming(grains: &str, report: &PackingReport, [contacts, solid]: [f64; 2]) {
    Claim::of("G-1", &format!("contacts per load-carrying grain, 1000 smooth {grains}"))
        .value(report.coordination_number_no_rattlers, contacts)
        .within_absolute(0.05);
    Claim::of("G-2", &format!("solid fraction at jamming, 1000 smooth {grains}"))
        .value(1.0 - report.porosity, solid)
        .within_absolute(5e-3);
}

/// G-1 and G-2 in the plane: frictionless discs jam at z* = 4 and a solid fraction of 0.842 (bidisperse 1 : 1.4).
#[test]
fn frictionless_discs_jam_isostatically() {
    eprintln!("G-1, G-2 (2D)");
    let (_, report) = made::<Discs>(&recipe(2, 1000, 1, 1e-5, 0.0, 1.4));
    claim_jamming("discs 1 : 1.4", &report, [4.0, 0.842]);
}

/// G-1 and G-2 in space: z* = 6, solid fraction 0.639 (equal spheres).
#[test]
fn frictionless_spheres_jam_isostatically() {
    eprintln!("G-1, G-2 (3D)");
    let (_, report) = made::<Spheres>(&recipe(3, 1000, 1, 1e-5, 0.0, 1.0));
    claim_jamming("equal spheres", &report, [6.0, 0.639]);
}

/// G-6: with ever more friction z* tends to d + 1. A friction of 10 is beyond any slope that a contact could have; discs
/// that only just jam take minutes to find their last contacts, and get a higher pressure.
#[test]
fn rough_grains_need_one_contact_more_than_dimensions() {
    eprintln!("G-6");
    let (_, discs) = made::<Discs>(&recipe(2, 1000, 2, 1e-3, 10.0, 1.4));
    Claim::of("G-6", "contacts per load-carrying grain, 1000 discs with a friction of 10")
        .value(discs.coordination_number_no_rattlers, 3.0)
        .within_absolute(0.2);
    let (_, spheres) = made::<Spheres>(&recipe(3, 1000, 2, 1e-4, 10.0, 1.0));
    Claim::of("G-6", "contacts per load-carrying grain, 1000 spheres with a friction of 10")
        .value(spheres.coordination_number_no_rattlers, 4.0)
        .within_absolute(0.2);
}

/// Major minus minor over their sum of `sum f x n`, and the three anisotropies, all from one network.
fn stress_and_anisotropies(network: &ContactNetwork) -> [f64; 4] {
    // cos 2 theta and sin 2 theta parts of contacts, normal forces and tangential forces.
    let mut sums = [[0.0; 2]; 3];
    let (mut count, mut normal) = (0.0, 0.0);
    for contact in &network.contacts {
        let [x, y] = network.branch(contact);
        let square = x * x + y * y;
        let double = [(x * x - y * y) / square, 2.0 * x * y / square];
        let force = -contact.normal_force;
        for axis in 0..2 {
            sums[0][axis] += double[axis];
            sums[1][axis] += force * double[axis];
        }
        // t x n + n x t has the doubled angle turned by 90 degrees.
        sums[2][0] += contact.tangential_force * double[1];
        sums[2][1] -= contact.tangential_force * double[0];
        count += 1.0;
        normal += force;
    }
    let contacts = sums[0].map(|part| 2.0 * part / count);
    let normals = [0, 1].map(|axis| 2.0 * sums[1][axis] / normal - contacts[axis]);
    let tangentials = sums[2].map(|part| 2.0 * part / normal);
    let size = |v: [f64; 2]| v[0].hypot(v[1]);
    let stress = network.stress();
    let mean = 0.5 * (stress[0][0] + stress[1][1]);
    let radius = (0.5 * (stress[0][0] - stress[1][1])).hypot(0.5 * (stress[0][1] + stress[1][0]));
    [radius / mean.abs(), size(contacts), size(normals), size(tangentials)]
}

/// G-7: `(s1 - s2) / (s1 + s2) = (a_c + a_n + a_t) / 2`.
#[test]
fn stress_ratio_is_half_the_sum_of_the_anisotropies() {
    eprintln!("G-7");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings/discs-400-dense.json");
    let contact = ContactTable { normal_stiffness: None, modulus: Some(6e7), ..ContactTable::linear(1.0, 0.5, 0.5) };
    let options = RveOptions { accuracy: Accuracy::Draft, ..RveOptions::default() };
    let mut cell =
        GrainRve::new(&GrainDefinition { packing: PackingFile::read(&path).unwrap(), contact, options }).unwrap();
    for increment in 1..=20 {
        let h = Tensor2::from_plane([[4e-4, 0.0], [0.0, -5e-4]]);
        cell.trial(&h, &TrialOptions { observables: Observables::NONE, ..TrialOptions::default() }).unwrap();
        let [ratio, contacts, normals, tangentials] = stress_and_anisotropies(cell.network().unwrap());
        cell.commit().unwrap();
        if increment % 5 == 0 {
            let sum = 0.5 * (contacts + normals + tangentials);
            eprintln!("  strain {:.4}: stress ratio {ratio:.4}, half the sum {sum:.4}", 5e-4 * f64::from(increment));
            Claim::of("G-7", "half the sum of the anisotropies against the stress ratio, 400 discs to 1 % strain")
                .value(sum, ratio)
                .within(0.05);
        }
    }
}

/// DNS A and B of [Liu2018]: 441 and 1681 grains between smooth walls, and how fast they run.
#[test]
fn whole_specimens_reach_the_strength_of_the_material() {
    eprintln!("DNS A, B");
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let text = std::fs::read_to_string(root.join("scenes/specimen-biaxial.toml")).unwrap();
    let packing = PackingFile::<Discs>::read(&root.join("packings/discs-liu2018.json")).unwrap();
    for tiles in [vec![1, 2], vec![2, 4]] {
        let test = SpecimenTest { tiles: tiles.clone(), ..toml::from_str::<SpecimenTest>(&text).unwrap() };
        // Strains of rows count from the packing; a peak is told by the compression since its stage began.
        let (mut best, mut before) = ((0.0, 0.0), 0.0);
        let started = Instant::now();
        let summary = run_specimen(&test, &packing, &mut |event| {
            let SpecimenEvent::Row(row, _) = event else { return };
            let [lateral, axial, _] = row.wall_stress;
            let ratio = (lateral - axial) / (lateral + axial).abs();
            if row.stage != "biaxial" {
                before = row.strain[1];
            } else if ratio > best.0 {
                best = (ratio, before - row.strain[1]);
            }
        })
        .unwrap();
        let seconds = started.elapsed().as_secs_f64();
        let rate = summary.grains as f64 * summary.steps as f64 / seconds;
        eprintln!(
            "  {} grains: peak {:.4} at {:.4}, {} steps, {seconds:.1} s, {rate:.2e} grain-steps per second",
            summary.grains, best.0, best.1, summary.steps
        );
        assert_eq!(summary.unbalanced_stages, 0);
        // J-1: 0.39 +- 0.03. The small one misses it, see `docs/lab-book/verification.md`; a third of its grains are at a wall.
        if tiles == [2, 4] {
            Claim::of("J-1", "peak stress ratio of 2 x 4 packings between smooth walls, all grains simulated")
                .value(best.0, 0.39)
                .within_absolute(0.03);
        }
    }
}

/// Speed of a specimen of some 10^5 grains.
#[test]
fn large_specimens_run() {
    eprintln!("10^5 grains");
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let text = std::fs::read_to_string(root.join("scenes/specimen-biaxial.toml")).unwrap();
    let packing = PackingFile::<Discs>::read(&root.join("packings/discs-liu2018.json")).unwrap();
    let mut test: SpecimenTest = toml::from_str(&text).unwrap();
    test.tiles = vec![16, 32];
    test.stage.truncate(1);
    test.stage[0].steps = 300;
    test.stage[0].until_balance = None;
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let started = Instant::now();
        let summary = pool.install(|| run_specimen(&test, &packing, &mut |_| ())).unwrap();
        let seconds = started.elapsed().as_secs_f64();
        let rate = summary.grains as f64 * summary.steps as f64 / seconds;
        eprintln!(
            "  {} grains, {threads} threads: {seconds:.1} s, {rate:.2e} grain-steps per second",
            summary.grains
        );
        assert!(summary.grains > 90_000 && summary.largest_energy_error < 0.05, "{summary:?}");
    }
}

/// B-2: a million steps of smooth elastic discs in a box.
#[test]
fn energy_of_a_gas_does_not_drift_in_a_million_steps() {
    eprintln!("B-2");
    let drift = gas::drift(1_000_000);
    eprintln!("  {drift:?}");
    assert!(drift.busy > 0.2);
    Claim::of("B-2", "largest deviation of the energy from the start, smooth elastic discs, a million steps")
        .error(drift.largest)
        .within(1e-4);
    Claim::of("B-2", "mean energy of the last tenth less that of the first over the energy, a million steps")
        .value(drift.secular, 0.0)
        .within_absolute(5e-5);
}
