//! Specimens and packings with the settings that a user gets: default masses, default step, rolling resistance, contact damping,
//! packings that list their histories. The closed forms of single contacts are tested elsewhere; here the whole must come to rest,
//! start where its packing is, and account for its energy (B-7).

use claims::Claim;
use protocol::Observables;
use rve_server::contact::ContactTable;
use rve_server::definition::{GrainDefinition, PackingFile, RveOptions};
use rve_server::engine::GrainRve;
use rve_server::preparation::{PackingRecipe, generate};
use rve_server::programs::specimen::assembly::Joinable;
use rve_server::programs::specimen::{
    SpecimenEvent, SpecimenFor, SpecimenRow, SpecimenSummary, SpecimenTest, run_specimen,
};
use rve_server::space::{Discs, Spheres};
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings")
}

fn discs(name: &str) -> PackingFile<Discs> {
    PackingFile::read(&folder().join(name)).unwrap()
}

/// The packing with all radii 0.3 % larger and no histories: far out of balance.
fn squeezed<S: Joinable>(mut packing: PackingFile<S>) -> PackingFile<S> {
    for grain in &mut packing.grains {
        grain[S::DIMENSION] *= 1.003;
    }
    packing.contacts.clear();
    packing
}

const STONES: &str = "law = \"linear\"\nmodulus = 1e8\nstiffness_ratio = 0.5\nfriction = 0.5\ndensity = 2000.0\n";

/// A test with these lines of `[contact]`, before it of the top, and after it.
fn test(top: &str, contact: &str, rest: &str) -> SpecimenTest {
    let text = format!("packing = \"not read\"\n{top}\n[contact]\n{contact}\n{rest}");
    toml::from_str(&text).unwrap()
}

fn run<S: SpecimenFor>(test: &SpecimenTest, packing: &PackingFile<S>) -> (Vec<SpecimenRow>, SpecimenSummary) {
    let mut rows = Vec::new();
    let summary = run_specimen(test, packing, &mut |event| {
        if let SpecimenEvent::Row(row, _) = event {
            rows.push((*row).clone());
        }
    });
    (rows, summary.unwrap())
}

const ISOTROPIC: &str =
    "[[stage]]\nname = \"isotropic\"\nsteps = 12000\nrows = 1\nstress = { xx = -1e5, yy = -1e5 }\n";
const NOTHING: &str = "[[stage]]\nname = \"rest\"\nsteps = 6000\nrows = 1\n";

/// A wall's rolling spring has the grain's own arm, and the step knows the rolling stiffness: grains between smooth and between
/// rough walls come to rest, and friction takes no more than was put in.
#[test]
fn rolling_grains_come_to_rest_between_walls() {
    for wall in [0.0, 0.5] {
        let contact = format!("{STONES}rolling_stiffness = 1.0\nrolling_friction = 0.1\n");
        let test = test("tiles = [1, 1]", &contact, &format!("[walls]\nfriction = {wall}\n{ISOTROPIC}"));
        let (rows, summary) = run(&test, &discs("discs-100.json"));
        let row = rows.last().unwrap();
        assert!(row.unbalanced_force_ratio < 2e-3, "wall {wall}: {row:?}");
        assert!(row.friction_work < row.wall_work + 1e-2 * row.elastic_energy, "wall {wall}: {row:?}");
        Claim::of("B-7", "energy missing over energy turned over, rolling discs between walls")
            .error(summary.largest_energy_error)
            .missed_up_to(1e-2)
            .within(1e-3);
    }
}

/// The same without walls, for rolling springs up to a hundred times the tangential ones.
#[test]
fn stiff_rolling_springs_shorten_the_step() {
    for stiffness in [1.0, 5.0, 100.0] {
        let contact = format!("{STONES}rolling_stiffness = {stiffness}\nrolling_friction = 0.1\n");
        let test = test("tiles = [1, 1]\nperiodic = [\"x\", \"y\"]", &contact, NOTHING);
        let (rows, summary) = run(&test, &discs("discs-100.json"));
        let row = rows.last().unwrap();
        assert!(row.unbalanced_force_ratio < 1e-3, "rolling {stiffness}: {row:?}");
        assert!(row.friction_work < 1e-2 * row.elastic_energy, "rolling {stiffness}: {row:?}");
        Claim::of("B-7", "energy missing over energy turned over, discs with stiff rolling springs")
            .error(summary.largest_energy_error)
            .within(1e-3);
    }
}

/// Contact damping follows the masses of the motion, and the step follows the damping: whatever the masses, dashpots take the
/// same share of what a squeezed packing stores, and none of them makes the motion unstable.
#[test]
fn contact_damping_damps_with_either_masses_and_never_blows_up() {
    let packing = squeezed(discs("discs-100.json"));
    for damping in [0.2, 1.0, 5.0, 10.0] {
        let taken = [true, false].map(|scaled| {
            let contact = format!("{STONES}damping = {damping}\n");
            let motion = format!("[motion]\nlocal_damping = 0.0\nscaled_masses = {scaled}\n{NOTHING}");
            let test = test("tiles = [1, 1]\nperiodic = [\"x\", \"y\"]", &contact, &motion);
            let (rows, summary) = run(&test, &packing);
            let row = rows.last().unwrap();
            Claim::of("B-7", "energy missing over energy turned over, squeezed discs with contact damping")
                .error(summary.largest_energy_error)
                .within(1e-3);
            assert!(row.kinetic_energy < 1e-2 * row.elastic_energy, "damping {damping}, scaled {scaled}: {row:?}");
            row.viscous_work / row.elastic_energy
        });
        let ratio = taken[0] / taken[1];
        assert!((0.99..1.01).contains(&ratio), "damping {damping}: with scaled masses {} of it: {taken:?}", ratio);
    }
}

/// Away from walls a specimen is the packing: its stress and its balance at the start are the cell's, to rounding, skewed
/// as the cell may be, and copies change nothing.
#[test]
fn a_periodic_specimen_starts_with_the_stress_of_its_packing() {
    let packing = discs("discs-liu2018.json");
    let [_, [lean, height]] = packing.periodicity;
    assert!((lean / height).abs() > 0.02, "the cell is skewed");
    let law = "law = \"linear\"\nnormal_stiffness = 1e7\nstiffness_ratio = 0.2\nfriction = 0.4\ndensity = 2000.0\n";
    let contact: ContactTable = toml::from_str(law).unwrap();
    let definition = GrainDefinition { packing: packing.clone(), contact, options: RveOptions::default() };
    let expected = GrainRve::<Discs>::new(&definition).unwrap().observe(Observables::NONE).unwrap();
    for tiles in ["[1, 1]", "[3, 2]"] {
        let one_step = "[[stage]]\nname = \"rest\"\nsteps = 1\nrows = 1\n";
        let test = test(&format!("tiles = {tiles}\nperiodic = [\"x\", \"y\"]"), law, one_step);
        let (_, summary) = run(&test, &packing);
        let start = summary.start;
        assert!(start.histories > 100 && start.dropped == 0 && start.cut_through == 0, "{start:?}");
        for (place, component) in [(0, (0, 0)), (1, (1, 1)), (3, (0, 1))] {
            let wanted = expected.stress.get(component.0, component.1);
            let error = (start.stress[place] - wanted).abs();
            assert!(error < 1e-9 * 1.5e5, "tiles {tiles}: {} instead of {wanted}", start.stress[place]);
        }
        assert!(start.unbalanced_force_ratio < 2.0 * expected.scalars.unbalanced_force_ratio + 1e-9, "{start:?}");
    }
}

/// Between walls the contacts inside keep what they have; what the walls cut through is counted; what cannot be upright is
/// refused or told with its figure.
#[test]
fn walls_cut_a_skewed_packing_without_moving_it() {
    let packing = discs("discs-liu2018.json");
    let law = "law = \"linear\"\nnormal_stiffness = 1e7\nstiffness_ratio = 0.2\nfriction = 0.4\ndensity = 2000.0\n";
    let one_step = "[[stage]]\nname = \"rest\"\nsteps = 1\nrows = 1\n";
    let (_, summary) = run(&test("tiles = [2, 2]", law, one_step), &packing);
    let start = summary.start;
    assert_eq!(start.histories + start.cut_through, 4 * packing.contacts.len());
    assert!(start.dropped == 0 && start.slant == 0.0, "{start:?}");
    // The grains inside still press on each other as they did; those at the border have lost their neighbours.
    assert!((start.stress[0] / -1.5e5 - 1.0).abs() < 0.15 && start.stress[3].abs() < 0.02 * 1.5e5, "{start:?}");

    let frames = test("tiles = [1, 2]\ncut = \"frames\"", law, one_step);
    let start = run(&frames, &packing).1.start;
    assert!((start.slant - 0.028).abs() < 1e-3 && start.histories > 0 && start.dropped == 0, "{start:?}");

    let leaning = test("tiles = [2, 2]\nperiodic = [\"y\"]", law, one_step);
    let reason = run_specimen(&leaning, &packing, &mut |_| ()).unwrap_err().to_string();
    assert!(reason.contains("leans by 0.02") && reason.contains("periodic as well"), "{reason}");
}

const ROLLING_RECIPE: &str = "number = 50\nseed = 4\npressure = 1e5\nthickness = 9e-3\ntolerance = 1e-4\nstress_tolerance = 1e-3\n\
    [grading]\ndistribution = \"uniform\"\nsmallest_radius = 3e-3\nlargest_radius = 6e-3\n[contact]\nlaw = \"linear\"\nmodulus = 1e8\n\
    stiffness_ratio = 0.5\nfriction = 0.5\nrolling_stiffness = 1.0\nrolling_friction = 0.1\n";

/// A packing prepared with rolling resistance holds its moments: it passes its own acceptance, and whoever reads the file finds it
/// at rest, as a cell, turned, and as a specimen.
#[test]
fn a_packing_with_rolling_resistance_is_at_rest_in_its_file() {
    let recipe = PackingRecipe::from_toml(ROLLING_RECIPE).unwrap();
    let (made, report) = generate::<Discs>(&recipe, &mut |_| ()).unwrap();
    report.refuse_misses().unwrap();
    assert_eq!(made.rolling_moments.len(), made.contacts.len());
    assert_eq!(made.version, 2);
    let file = tempfile::NamedTempFile::new().unwrap();
    made.write(file.path()).unwrap();
    let packing = PackingFile::<Discs>::read(file.path()).unwrap();
    assert_eq!(packing, made);
    let unbalanced = |packing: &PackingFile<Discs>, contact: &ContactTable| {
        let definition =
            GrainDefinition { packing: packing.clone(), contact: contact.clone(), options: RveOptions::default() };
        let mut cell = GrainRve::<Discs>::new(&definition).unwrap();
        (cell.observe(Observables::NONE).unwrap().scalars.unbalanced_force_ratio, cell.listed_forces())
    };
    let (ratio, kept) = unbalanced(&packing, &recipe.contact);
    assert!(ratio < 2e-4 && kept.warning().is_none(), "{ratio}");
    // Another law drops the moments and says so.
    let without = ContactTable { rolling_stiffness: 0.0, rolling_friction: 0.0, ..recipe.contact.clone() };
    let (ratio, kept) = unbalanced(&packing, &without);
    assert!(ratio > 1e-2 && kept.warning().unwrap().contains("rolling moments"), "{ratio}");

    let one_step = "[[stage]]\nname = \"rest\"\nsteps = 1\nrows = 1\n";
    let contact = format!("{STONES}rolling_stiffness = 1.0\nrolling_friction = 0.1\n");
    let (_, summary) = run(&test("tiles = [2, 1]\nperiodic = [\"x\", \"y\"]", &contact, one_step), &packing);
    // Moments are part of the balance: without them the first step would already turn the grains.
    let (rows, _) = run(
        &test(
            "tiles = [2, 1]\nperiodic = [\"x\", \"y\"]",
            &contact,
            "[[stage]]\nname = \"rest\"\nsteps = 200\nrows = 1\n",
        ),
        &packing,
    );
    assert!(summary.start.unbalanced_force_ratio < 2e-4 && summary.start.dropped == 0, "{summary:?}");
    assert!(rows[0].kinetic_energy < 1e-8 * rows[0].elastic_energy, "{:?}", rows[0]);
    // What is left is what the tolerance of the recipe left, and a contact at its limit may give it (2e-5 and 2e-4 in two packings).
    assert!(rows[0].friction_work < 1e-3 * rows[0].elastic_energy, "{:?}", rows[0]);
}

/// Files with moments say so in their version, and a list that does not fit is refused.
#[test]
fn rolling_moments_are_checked_like_everything_in_a_packing() {
    let recipe = PackingRecipe::from_toml(&ROLLING_RECIPE.replace("number = 50", "number = 20")).unwrap();
    let (made, _) = generate::<Discs>(&recipe, &mut |_| ()).unwrap();
    let reason = |packing: PackingFile<Discs>| packing.checked().unwrap_err().to_string();
    assert!(reason(PackingFile { version: 1, ..made.clone() }).contains("belong to version 2"));
    let short = PackingFile { rolling_moments: made.rolling_moments[1..].to_vec(), ..made.clone() };
    assert!(reason(short).contains("one for each row of contacts"));
    let mut broken = made;
    broken.rolling_moments[3] = f64::NAN;
    assert!(reason(broken).contains("rolling moment 3"));
}

/// Hertz-Mindlin spheres that roll and are left alone keep their energy, whatever the moment limit.
#[test]
fn rolling_spheres_create_no_energy() {
    let packing = squeezed(PackingFile::<Spheres>::read(&folder().join("spheres-100.json")).unwrap());
    for limit in [0.1, 0.3, 1e9] {
        let contact = format!(
            "law = \"hertz_mindlin\"\nshear_modulus = 2.9e9\npoisson_ratio = 0.15\nfriction = 0.5\ndensity = 2650.0\n\
             rolling_stiffness = 1.0\nrolling_friction = {limit:e}\n"
        );
        let motion = "[motion]\nlocal_damping = 0.0\nscaled_masses = false\nsafety = 0.1\n\
                      [[stage]]\nname = \"free\"\nsteps = 6000\nrows = 6\n";
        let test = test("tiles = [1, 1, 1]\nperiodic = [\"x\", \"y\", \"z\"]", &contact, motion);
        let (rows, summary) = run(&test, &packing);
        assert!(rows[0].kinetic_energy > 0.01 * rows[0].elastic_energy, "it moves: {:?}", rows[0]);
        Claim::of("B-7", "energy missing over energy turned over, free spheres that roll")
            .error(summary.largest_energy_error)
            .within(5e-4);
    }
}

/// A servo that cannot follow is counted and its largest error told; one that follows is not.
#[test]
fn a_servo_that_drifts_is_counted() {
    let biaxial = |steps: u64| {
        format!(
            "{ISOTROPIC}[[stage]]\nname = \"biaxial\"\nsteps = {steps}\nrows = 5\nstrain = {{ yy = -0.02 }}\nstress = {{ xx = -1e5 }}\n"
        )
    };
    let packing = discs("discs-100.json");
    let (_, slow) = run(&test("tiles = [1, 1]", STONES, &biaxial(40_000)), &packing);
    let (rows, fast) = run(&test("tiles = [1, 1]", STONES, &biaxial(1_000)), &packing);
    let worst = rows[1..].iter().map(|row| (row.wall_stress[0] / -1e5 - 1.0).abs()).fold(0.0, f64::max);
    assert!(worst > 0.02 && fast.servo_misses > 0, "{worst}, {fast:?}");
    assert!((fast.largest_servo_error / worst - 1.0).abs() < 1e-12, "{worst}, {fast:?}");
    assert!(slow.largest_servo_error < fast.largest_servo_error, "{slow:?}");
}
