//! Strength of ensembles of packings.

use super::{made, recipe};
use claims::Claim;
use protocol::TangentKind;
use rve_server::definition::PackingFile;
use rve_server::preparation::PackingRecipe;
use rve_server::programs::rve_test::{ElementRow, ElementTest, run_element};
use rve_server::space::Discs;
use std::path::Path;

/// Largest miss of the controlled stress over the mean pressure: to a few per cent of strain, and in flow, where packings collapse and
/// recover all the time.
const CLOSE: f64 = 5e-3;
const FLOWING: f64 = 1e-2;

/// Biaxial compression along y at constant sigma_xx; the rows.
fn biaxial(
    packing: &Path,
    contact: &str,
    pressure: f64,
    (strain, increments): (f64, u32),
    stress_tolerance: f64,
) -> Vec<ElementRow> {
    let text = format!(
        "packing = \"{}\"\nstress_tolerance = {stress_tolerance}\n[contact]\nlaw = \"linear\"\n{contact}\n[rve]\naccuracy = \"draft\"\n\
         strain_per_step = 1e-5\n[[path]]\nincrements = {increments}\nstrain = {{ yy = -{strain} }}\nstress = {{ xx = -{pressure:e} }}\n",
        packing.display()
    );
    let test = ElementTest::from_toml(&text).unwrap();
    let mut rows = Vec::new();
    let ended = run_element(&test, Path::new(""), TangentKind::None, &mut |row| rows.push(row.clone()));
    if let Err(error) = ended {
        eprintln!("  ended early, after {} rows: {error}", rows.len());
    }
    rows
}

/// `(s1 - s2) / (s1 + s2)`.
pub(crate) fn strength(row: &ElementRow) -> f64 {
    (row.stress[0][0] - row.stress[1][1]) / (row.stress[0][0] + row.stress[1][1]).abs()
}

/// Relative change of area.
fn dilation(row: &ElementRow) -> f64 {
    row.deformation[0][0] * row.deformation[1][1] - row.deformation[0][1] * row.deformation[1][0] - 1.0
}

fn mean(values: impl Iterator<Item = f64> + Clone) -> f64 {
    values.clone().sum::<f64>() / values.count() as f64
}

fn deviation(values: &[f64]) -> f64 {
    let mean = mean(values.iter().copied());
    (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (values.len() - 1) as f64).sqrt()
}

/// Samples of the material of [Liu2018] here, and in the independent code.
const SAMPLES: [u64; 2] = [8, 3];

/// A sample of the material of [Liu2018], p/k_n = 0.015, compacted with the friction that brings it to the density of the independent
/// code.
fn published_packing(folder: &Path, seed: u64) -> std::path::PathBuf {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings/discs-liu2018.toml"));
    let recipe = PackingRecipe::from_toml(&text.unwrap()).unwrap();
    let mut recipe =
        PackingRecipe { number: 228, seed, tolerance: 1e-6, stress_tolerance: 1e-4, anisotropy: None, ..recipe };
    recipe.contact.friction = 0.07;
    let path = folder.join(format!("{seed}.json"));
    made::<Discs>(&recipe).0.write(&path).unwrap();
    path
}

/// G-10: strength of the material of [Liu2018]: the mean over samples is that of an independent code, whose three samples had a solid
/// fraction of 0.858 and 4.32 contacts a grain. The bound is two standard errors of the difference of both means, with the scatter of the samples
/// here: that of three (0.002 to 0.026) is not known well.
#[test]
fn strength_of_the_published_material_is_that_of_an_independent_code() {
    eprintln!("G-10");
    let folder = tempfile::tempdir().unwrap();
    let packings: Vec<_> = (1..=SAMPLES[0]).map(|seed| published_packing(folder.path(), seed)).collect();
    for (name, friction, rotations, expected) in [
        ("friction 0.2", 0.2, "free", 0.298),
        ("friction 0.4", 0.4, "free", 0.406),
        ("friction 0.6", 0.6, "free", 0.455),
        ("blocked, friction 0.4", 0.4, "blocked", 0.594),
    ] {
        let contact = format!(
            "normal_stiffness = 1e7\nstiffness_ratio = 0.2\nfriction = {friction}\nrotations = \"{rotations}\"\n"
        );
        let all: Vec<Vec<ElementRow>> =
            packings.iter().map(|packing| biaxial(packing, &contact, 1.5e5, (0.12, 60), CLOSE)).collect();
        let solid = mean(all.iter().map(|rows| 1.0 / (1.0 + rows[0].void_ratio)));
        let contacts = mean(all.iter().map(|rows| rows[0].coordination_number));
        Claim::of("G-10", "solid fraction before shear, mean of eight samples")
            .value(solid, 0.858)
            .within_absolute(3e-3);
        Claim::of("G-10", "contacts per grain before shear, mean of eight samples")
            .value(contacts, 4.32)
            .within_absolute(0.1);
        let peaks: Vec<f64> = all.iter().map(|rows| rows.iter().map(strength).fold(0.0, f64::max)).collect();
        let (found, scatter) = (mean(peaks.iter().copied()), deviation(&peaks));
        let bound = 2.0 * scatter * SAMPLES.map(|samples| 1.0 / samples as f64).iter().sum::<f64>().sqrt();
        let compaction = mean(all.iter().map(|rows| dilation(&rows[15])));
        eprintln!(
            "  {name}: solid fraction {solid:.4}, {contacts:.3} contacts; peak {found:.4} (s.d. {scatter:.4}), expected {expected} +- \
             {bound:.4}; change of area at 3 % {compaction:.4}"
        );
        // Of four comparisons one lies beyond two standard errors by chance in every fifth campaign: it is recorded as missed, and the
        // test fails beyond three standard errors.
        Claim::of("G-10", &format!("peak stress ratio, {name}, two standard errors of the difference of means"))
            .value(found, expected)
            .missed_up_to(1.5 * bound)
            .within_absolute(bound);
    }
}

/// G-8: five dense and five loose packings reach one critical state at 20 to 25 % strain. G-9: without a change of volume the stress ratio is
/// Rowe's constant of the critical state; on the way to it loose packings keep to it within the 10 % of the catalogue, dense ones
/// do not, which is printed. With two packings each the means of two seeds in turn differ by more than the tolerance.
/// The studies with five packings of another material each are in `docs/lab-book/ensembles.md`.
#[test]
fn dense_and_loose_packings_reach_one_critical_state() {
    eprintln!("G-8, G-9");
    let folder = tempfile::tempdir().unwrap();
    let contact = "normal_stiffness = 1.0\nstiffness_ratio = 0.5\nfriction = 0.5";
    let mut states = Vec::new();
    for (name, friction) in [("dense", 0.0), ("loose", 0.5)] {
        let mut samples: Vec<[f64; 4]> = Vec::new();
        for seed in 1..=5 {
            let path = folder.path().join(format!("{name}-{seed}.json"));
            let packing: PackingFile<Discs> = made(&recipe(2, 400, 200 + seed, 3e-3, friction, 1.4)).0;
            packing.write(&path).unwrap();
            let rows = biaxial(&path, contact, 3e-3, (0.25, 250), FLOWING);
            assert_eq!(rows.len(), 251, "{name} packings reach the end of the path");
            let ratio = |row: &ElementRow| row.stress[1][1] / row.stress[0][0];
            // -d(eps_3) / d(eps_1) from 5 to 15 % strain.
            let [early, later] =
                [&rows[50], &rows[150]].map(|row| [row.deformation[0][0].ln(), row.deformation[1][1].ln()]);
            let dilatancy = (later[0] - early[0]) / (early[1] - later[1]);
            let late = &rows[200..];
            samples.push([
                mean(late.iter().map(ratio)),
                mean(late.iter().map(|row| row.void_ratio)),
                mean(late.iter().map(|row| row.coordination_number_no_rattlers)),
                mean(rows[50..=150].iter().map(ratio)) / dilatancy,
            ]);
        }
        let of = |place: usize| mean(samples.iter().map(|sample| sample[place]));
        let state: [f64; 4] = std::array::from_fn(of);
        eprintln!(
            "  {name}: s1/s3 {:.3}, void ratio {:.4}, z* {:.3}; stress ratio over dilatancy from 5 to 15 % {:.3}, {:+.1} % of s1/s3",
            state[0],
            state[1],
            state[2],
            state[3],
            100.0 * (state[3] / state[0] - 1.0)
        );
        states.push(state);
    }
    for (place, name) in ["stress ratio", "void ratio", "contacts per load-carrying grain"].iter().enumerate() {
        Claim::of("G-8", &format!("{name} at 20 to 25 % strain, five dense samples against five loose ones"))
            .value(states[0][place], states[1][place])
            .within(0.05);
    }
    Claim::of(
        "G-9",
        "stress ratio over dilatancy at 5 to 15 % strain against the critical state, five loose samples",
    )
    .value(states[1][3], states[1][0])
    .within(0.1);
}

/// G-11: small cells scatter: the spread of the strength falls at least with the root of the number of grains.
#[test]
fn strength_scatters_less_in_larger_cells() {
    eprintln!("G-11");
    let folder = tempfile::tempdir().unwrap();
    let contact = "normal_stiffness = 1.0\nstiffness_ratio = 0.5\nfriction = 0.5";
    let mut spreads = Vec::new();
    for number in [50, 200] {
        let (mut peaks, mut fabrics) = (Vec::new(), Vec::new());
        for seed in 1..=8 {
            let recipe = recipe(2, number, 100 + seed, 1e-3, 0.1, 1.4);
            let path = folder.path().join(format!("{number}-{seed}.json"));
            let packing: PackingFile<Discs> = made(&recipe).0;
            packing.write(&path).unwrap();
            let rows = biaxial(&path, contact, 1e-3, (0.05, 50), CLOSE);
            fabrics.push(rows[0].fabric_anisotropy);
            peaks.push(rows.iter().map(strength).fold(0.0, f64::max));
        }
        let spread = deviation(&peaks);
        eprintln!(
            "  {number} discs: strength {:.4}, s.d. {spread:.4}; fabric anisotropy {:.4} on average, {:.4} at most",
            mean(peaks.iter().copied()),
            mean(fabrics.iter().copied()),
            fabrics.iter().copied().fold(0.0, f64::max)
        );
        spreads.push(spread);
    }
    let slope = (spreads[1] / spreads[0]).ln() / 4f64.ln();
    eprintln!("  s.d. goes with the number of grains to the power of {slope:.2}");
    // Four times the grains should scatter half; eight samples know a deviation to a quarter of itself.
    Claim::of("G-11", "exponent of the scatter of the strength over the number of grains, 50 and 200 discs")
        .number(slope)
        .at_most(-0.25);
}
