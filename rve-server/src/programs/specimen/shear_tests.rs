//! Shear of walls and of periodic sides: closed forms, the periodic cell, energy, threads.

use super::body::Body;
use super::contact::Grain;
use super::dynamics::{Dynamics, Motion};
use super::tests::{MASS, RADIUS, STIFFNESS, law, still};
use super::wall::{Wall, WallDrive};
use super::{SpecimenEvent, SpecimenRow, SpecimenSummary, SpecimenTest, run_specimen};
use crate::contact::PlainLinear;
use crate::definition::{GrainDefinition, PackingFile, RveOptions};
use crate::engine::GrainRve;
use crate::space::{Discs, Spheres};
use claims::Claim;
use protocol::{RveSolver, Tensor2, TrialOptions};
use std::path::Path;

/// `k_t` of [`law`].
const TANGENTIAL: f64 = 0.8 * STIFFNESS;

fn disc(x: f64, y: f64) -> Grain<Discs> {
    Grain { position: [x, y], velocity: [0.0; 2], spin: [0.0], radius: RADIUS }
}

fn plates(height: f64, friction: f64, drive: WallDrive) -> Vec<Wall<Discs, PlainLinear>> {
    let plate = |y: f64, up: f64, drive| Wall::new("plate", [0.0, y], [0.0, up], law(friction), drive, 0.0);
    vec![plate(0.0, 1.0, WallDrive::Velocity(0.0)), plate(height, -1.0, drive)]
}

fn damped(rotations_free: bool) -> Motion {
    Motion { local_damping: 0.7, safety: 0.3, rotations_free, ..still() }
}

/// Moves the upper wall along x by `way` in `steps` steps, and lets everything come to rest.
fn slide(dynamics: &mut Dynamics<Discs, PlainLinear>, way: f64, steps: u32) {
    dynamics.walls[1].glide = [way / f64::from(steps) / dynamics.step, 0.0];
    for step in 0..2 * steps {
        if step == steps {
            dynamics.walls[1].glide = [0.0; 2];
        }
        dynamics.advance();
    }
}

/// Energy that is not accounted for, over all that was turned over.
fn missing_share(dynamics: &Dynamics<Discs, PlainLinear>) -> f64 {
    dynamics.missing_energy() / dynamics.energy_turnover()
}

/// B-11: three discs that do not rotate, the outer ones glued: the middle one goes half the way, both contacts slip by that half and turn
/// by it over their branch, which turns the normal force as well.
#[test]
fn glued_layers_shear_a_grain_between_them_like_two_springs_in_series() {
    let press = 1e-4 * 2.0 * RADIUS;
    let branch = 2.0 * RADIUS - press;
    let grains = (0..3).map(|k| disc(0.0, RADIUS + f64::from(k) * branch)).collect();
    let body = Body::new(law(10.0), grains, vec![MASS; 3], 0.0, [None; 3]);
    let walls = plates(2.0 * RADIUS + 2.0 * branch, 0.0, WallDrive::Velocity(0.0));
    let mut dynamics = Dynamics::new(body, walls, damped(false));
    dynamics.grip([0, 1].into_iter(), 1e-9);
    assert_eq!((dynamics.walls[0].glued.as_slice(), dynamics.walls[1].glued.as_slice()), (&[0][..], &[2][..]));
    let way = 1e-7;
    slide(&mut dynamics, way, 4000);
    let half = 0.5 * way;
    let expected = TANGENTIAL * half - STIFFNESS * press * half / branch;
    let [low, high] = [0, 1].map(|wall: usize| dynamics.walls[wall].force);
    for force in [-high[0], low[0]] {
        let quantity = "shear force of glued layers, two springs in series, N";
        Claim::of("B-11", quantity).value(force, expected).within(1e-4);
    }
    assert!((dynamics.walls[1].normal_force() / (STIFFNESS * press) - 1.0).abs() < 1e-6);
    let moved = dynamics.body.grains[1].position[0];
    Claim::of("B-11", "displacement of a grain between glued layers, m").value(moved, half).within(1e-6);
    assert_eq!(dynamics.body.grains[0].position, [0.0, RADIUS], "the lower layer is held");
    assert!((dynamics.walls[1].slid[0] / way - 1.0).abs() < 1e-9);
    assert!((dynamics.shear_work / (0.5 * expected * way) - 1.0).abs() < 2e-2, "{}", dynamics.shear_work);
    let quantity = "energy missing over the energy turned over, glued layers";
    Claim::of("B-11", quantity).error(missing_share(&dynamics)).within(1e-6);
}

/// B-11: between rough plates without glue a disc that cannot rotate slides under `mu N`, and friction takes what the plate gives. A
/// free one rolls and bears nothing.
#[test]
fn rough_walls_shear_a_grain_by_the_friction_limit_and_roll_a_free_one() {
    let press = 1e-6;
    for rotations_free in [false, true] {
        let body = Body::new(law(0.0), vec![disc(0.0, RADIUS - press)], vec![MASS], 0.0, [None; 3]);
        let walls = plates(2.0 * (RADIUS - press), 0.3, WallDrive::Velocity(0.0));
        let mut dynamics = Dynamics::new(body, walls, damped(rotations_free));
        let (normal, way) = (STIFFNESS * press, 2e-5);
        dynamics.walls[1].glide = [way / 8000.0 / dynamics.step, 0.0];
        (0..8000).for_each(|_| {
            dynamics.advance();
        });
        let shear = -dynamics.walls[1].force[0];
        if rotations_free {
            // The grain is set in motion and swings a little: far below the friction limit of 0.3, not zero.
            let quantity =
                "shear force over the normal force, grain that rolls between rough walls, set in motion at once";
            Claim::of("B-11", quantity).error(shear / normal).within(0.02);
            let rolled = dynamics.body.grains[0].position[0];
            let quantity = "displacement of a grain that rolls between rough walls, m";
            Claim::of("B-11", quantity).value(rolled, 0.5 * way).within(1e-3);
        } else {
            let quantity = "shear force of a grain that slides between rough walls, N";
            Claim::of("B-11", quantity).value(shear, 0.3 * normal).within(1e-3);
            assert!(dynamics.works[0] > 0.8 * dynamics.shear_work && dynamics.shear_work > 0.0);
        }
        let quantity = "energy missing over the energy turned over, rough walls";
        Claim::of("B-11", quantity).error(missing_share(&dynamics)).within(1e-3);
    }
}

/// B-11: the normal stress of a wall is held while it slides, and through its glued layer too.
#[test]
fn a_servo_wall_holds_its_force_while_it_slides() {
    let branch = 2.0 * RADIUS;
    let grains = (0..3).map(|k| disc(0.0, RADIUS + f64::from(k) * branch)).collect();
    let body = Body::new(law(0.5), grains, vec![MASS; 3], 0.0, [None; 3]);
    let drive = WallDrive::Force { target: 50.0, gain: 0.01, largest_speed: 0.01 };
    let mut dynamics = Dynamics::new(body, plates(6.0 * RADIUS, 0.0, drive), damped(false));
    dynamics.grip([0, 1].into_iter(), 1e-9);
    (0..60_000).for_each(|_| {
        dynamics.advance();
    });
    assert!((dynamics.walls[1].normal_force() / 50.0 - 1.0).abs() < 1e-6);
    slide(&mut dynamics, 5e-6, 20_000);
    let quantity = "normal force that a servo holds while its wall slides, N";
    Claim::of("B-11", quantity).value(dynamics.walls[1].normal_force(), 50.0).within(1e-3);
    // The middle one is turned by u / 2 over the branch against both, and gives no more to the side than that.
    assert!(-dynamics.walls[1].force[0] > 0.9 * TANGENTIAL * 2.5e-6);
    let quantity = "energy missing over the energy turned over, wall that a servo moves";
    Claim::of("B-11", quantity).error(missing_share(&dynamics)).within(1e-3);
}

/// One disc that touches its own images: a square lattice.
fn lattice(lean: f64, friction: f64) -> Dynamics<Discs, PlainLinear> {
    let side = 2.0 * RADIUS * (1.0 - 1e-3);
    let body = Body::new(
        law(friction),
        vec![disc(0.3 * RADIUS, 0.2 * RADIUS)],
        vec![MASS],
        0.0,
        [Some([side, 0.0]), Some([lean * side, side]), None],
    );
    Dynamics::new(body, Vec::new(), Motion { rotations_free: false, ..damped(false) })
}

/// Shears the images along x by `angle` in `steps` steps.
fn shear_images(dynamics: &mut Dynamics<Discs, PlainLinear>, angle: f64, steps: u32) {
    let side = dynamics.body.period(1).unwrap()[1];
    dynamics.strain_sides([[0.0; 2], [angle * side / f64::from(steps) / dynamics.step, 0.0], [0.0; 2]]);
    (0..steps).for_each(|_| {
        dynamics.advance();
    });
}

/// `sum f x b` of the frictionless lattice, J: every image that overlaps the disc presses along its branch.
fn sum_over_images(angle: f64) -> [[f64; 2]; 2] {
    let side = 2.0 * RADIUS * (1.0 - 1e-3);
    let mut sum = [[0.0; 2]; 2];
    for (i, j) in [(1, 0), (0, 1), (-1, 1), (1, 1), (-2, 1)] {
        let branch = [(f64::from(i) + angle * f64::from(j)) * side, f64::from(j) * side];
        let length = branch[0].hypot(branch[1]);
        let force = -STIFFNESS * (2.0 * RADIUS - length).max(0.0) / length;
        for (row, first) in sum.iter_mut().zip(branch) {
            row.iter_mut().zip(branch).for_each(|(value, second)| *value += force * first * second);
        }
    }
    sum
}

/// B-9, affine: with one grain in the cell nothing but the images moves, and the stress is known at any angle, across every
/// folding. The work of the sides is what the contacts store.
#[test]
fn a_lattice_sheared_past_itself_has_the_stress_of_its_images() {
    let mut dynamics = lattice(0.0, 0.0);
    let start = dynamics.contacts.elastic_energy;
    let mut angle = 0.0;
    for _ in 0..44 {
        shear_images(&mut dynamics, 0.05, 500);
        angle += 0.05;
        let (found, expected) = (dynamics.body.stress_sum(), sum_over_images(angle - f64::floor(angle)));
        let scale = STIFFNESS * RADIUS * RADIUS;
        for i in 0..2 {
            for j in 0..2 {
                let quantity = "force times branch in a lattice sheared past itself, over k_n R^2";
                Claim::of("B-9", quantity).error((found[i][j] - expected[i][j]) / scale).within(1e-9);
            }
        }
    }
    assert!((dynamics.body.period(1).unwrap()[0] / (2.2 * dynamics.body.period(1).unwrap()[1]) - 1.0).abs() < 1e-9);
    let stored = dynamics.contacts.elastic_energy - start;
    let quantity = "work of the sides against the energy that the contacts store, shear by 2.2";
    Claim::of("B-9", quantity).value(dynamics.shear_work, stored).within(1e-3);
    let quantity = "energy missing over the energy turned over, shear by 2.2";
    Claim::of("B-9", quantity).error(missing_share(&dynamics)).within(1e-4);
}

/// B-9: small shear of the square lattice with friction: `k_t/2` in shear, less the turned normal force where nothing rotates.
#[test]
fn a_lattice_has_the_shear_modulus_of_its_tangential_springs() {
    for rotations_free in [false, true] {
        let mut dynamics = lattice(0.0, 10.0);
        dynamics.motion.rotations_free = rotations_free;
        let side = dynamics.body.period(1).unwrap()[1];
        let angle = 1e-6;
        shear_images(&mut dynamics, angle, 1000);
        let sum = dynamics.body.stress_sum();
        let found = 0.5 * (sum[0][1] + sum[1][0]) / (side * side);
        let turned = STIFFNESS * (2.0 * RADIUS - side) / side * angle;
        let expected = 0.5 * TANGENTIAL * angle - turned;
        let rotations = if rotations_free { "free" } else { "blocked" };
        let quantity = format!("shear modulus of a square lattice with friction, rotations {rotations}, Pa");
        Claim::of("B-9", &quantity).value(found / angle, expected / angle).within(1e-5);
        if rotations_free {
            assert!((dynamics.rotations[0][0] / (-0.5 * angle) - 1.0).abs() < 1e-6, "{:?}", dynamics.rotations);
        }
    }
}

/// Folding renames contacts and forgets nothing: sheared over the fold and back, friction has taken nothing and the forces are what
/// they were, but for the length of a branch that a step takes at its end.
#[test]
fn folded_periods_keep_the_history_of_contacts() {
    // At 0.45 two images above touch, and the cell folds at 0.5.
    let side = 2.0 * RADIUS * (1.0 - 1e-3);
    let height = (4.0 * RADIUS * RADIUS - 0.25 * side * side).sqrt() * (1.0 - 1e-3);
    let body = Body::new(
        law(10.0),
        vec![disc(0.0, 0.0)],
        vec![MASS],
        0.0,
        [Some([side, 0.0]), Some([0.4999 * side, height]), None],
    );
    let mut dynamics = Dynamics::new(body, Vec::new(), damped(false));
    let before = dynamics.body.stress_sum();
    assert_eq!(dynamics.contacts.contacts, 3);
    shear_images(&mut dynamics, 4e-4, 2000);
    let renewals = dynamics.body.renewals;
    // Far enough that the list is made again: it folds only then.
    dynamics.body.grains[0].position = [1e3 * side, 0.0];
    dynamics.body.keep_list_complete();
    assert!(dynamics.body.renewals > renewals);
    let shifts: Vec<_> = dynamics.body.touching().map(|pair| dynamics.body.key(pair).shift).collect();
    assert_eq!(shifts, [[0, 1], [1, 0], [1, 1]], "at first they were [-1, 1], [0, 1] and [1, 0]");
    shear_images(&mut dynamics, -4e-4, 2000);
    let after = dynamics.body.stress_sum();
    assert_eq!((dynamics.contacts.contacts, dynamics.contacts.sliding), (3, 0));
    for i in 0..2 {
        for j in 0..2 {
            assert!((after[i][j] - before[i][j]).abs() < 1e-7 * before[0][0].abs(), "{after:?} against {before:?}");
        }
    }
}

fn packing<S: crate::space::Space>(name: &str) -> PackingFile<S> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings").join(name);
    PackingFile::<S>::read(&file).unwrap()
}

const STONES: &str = "law = \"linear\"\nmodulus = 1e8\nstiffness_ratio = 0.5\nfriction = 0.5\n";

fn test(top: &str, rest: &str) -> SpecimenTest {
    toml::from_str(&format!("packing = \"not read\"\n{top}\n[contact]\n{STONES}\n{rest}")).unwrap()
}

fn run(test: &SpecimenTest, packing: &PackingFile<Discs>) -> (Vec<SpecimenRow>, SpecimenSummary) {
    let mut rows = Vec::new();
    let summary = run_specimen(test, packing, &mut |event| {
        if let SpecimenEvent::Row(row, _) = event {
            rows.push((*row).clone());
        }
    });
    (rows, summary.unwrap())
}

/// B-10: a periodic specimen under shear and compression of its sides has the stress of the periodic cell under the same path.
#[test]
fn periodic_sides_strain_a_packing_as_its_cell_is_strained() {
    let packing = packing::<Discs>("discs-100.json");
    let stage =
        "[[stage]]\nname = \"shear\"\nsteps = 200000\nrows = 5\nshear = { xy = 4e-3 }\nstrain = { yy = -1e-3 }\n";
    let test = test("tiles = [1, 1]\nperiodic = [\"x\", \"y\"]", stage);
    let (rows, summary) = run(&test, &packing);
    assert!(summary.largest_energy_error < 1e-3, "{summary:?}");
    let contact = test.contact_without_damping();
    let options = RveOptions { tolerance: Some(1e-6), strain_per_step: Some(1e-6), ..RveOptions::default() };
    let mut cell = GrainRve::<Discs>::new(&GrainDefinition { packing, contact, options }).unwrap();
    for (number, row) in rows.iter().enumerate() {
        let share = (number + 1) as f64 / 5.0;
        assert!(
            (row.shear[0][0] - 4e-3 * share).abs() < 1e-9 && (row.strain[1] + 1e-3 * share).abs() < 1e-9,
            "{row:?}"
        );
        // The cell takes increments on the state reached: F_n = (I + H) F_(n-1).
        let (before, height) = ((number as f64) / 5.0, 1.0 - 1e-3 * number as f64 / 5.0);
        let target =
            Tensor2::from_plane([[0.0, 4e-3 * (share - before) / height], [0.0, -1e-3 * (share - before) / height]]);
        let answer = cell.trial(&target, &TrialOptions::default()).unwrap();
        cell.commit().unwrap();
        let stress = answer.stress.0;
        let expected = [stress[0], stress[4], 0.5 * (stress[1] + stress[3])];
        let found = [row.contact_stress[0], row.contact_stress[1], row.contact_stress[3]];
        for (found, expected) in found.iter().zip(expected) {
            let quantity = "stress component of a periodic specimen against that of the periodic cell, Pa";
            Claim::of("B-10", quantity).value(*found, expected).within(2e-3);
        }
    }
}

/// A layer between glued walls: sheared at constant normal stress, its energy adds up, the shear stress of both walls is that of
/// the contacts, and friction mobilised is between nothing and the tangent of a steep angle.
#[test]
fn a_layer_between_glued_walls_is_sheared_at_constant_stress() {
    let text = "[[region]]\nfrom = [0.0, 0.4]\nto = [1.0, 0.7]\nnumber = 3\n\
                [[stage]]\nname = \"press\"\nsteps = 30000\nuntil_balance = 1e-3\nrows = 1\nstress = { yy = -1e5 }\n\
                [[stage]]\nname = \"shear\"\nsteps = 100000\nrows = 10\nglue = [\"y\"]\nshear = { xy = 0.1 }\nstress = { yy = -1e5 }\n";
    let test = test(
        "tiles = [1, 2]\nperiodic = [\"x\"]\n",
        &format!("[walls]\nglue_depth = 1e-4\nservo_gain = 0.1\n{text}"),
    );
    let (rows, summary) = run(&test, &packing::<Discs>("discs-100.json"));
    assert_eq!((summary.start.removed, summary.grains), (3, 197));
    assert!(summary.largest_energy_error < 1e-2 && summary.largest_servo_error < 0.05, "{summary:?}");
    let held = rows[1..].iter().map(|row| row.wall_stress[1] / -1e5).sum::<f64>() / (rows.len() - 1) as f64;
    assert!((held - 1.0).abs() < 0.01, "held at {held} of the target");
    let [first, last] = [&rows[1], rows.last().unwrap()];
    assert!((last.shear[0][0] / 0.1 - 1.0).abs() < 0.02, "{last:?}");
    let late =
        rows[6..].iter().map(|row| row.shear[0][1] / -row.wall_stress[1]).sum::<f64>() / (rows.len() - 6) as f64;
    assert!((0.15..0.9).contains(&late), "mobilised friction {late}");
    assert!(last.shear_work > first.shear_work && last.shear_work < last.wall_work.abs() + last.friction_work + 1.0);
    let inside = rows[6..].iter().map(|row| row.contact_stress[3]).sum::<f64>();
    let walls = rows[6..].iter().map(|row| row.shear[0][1]).sum::<f64>();
    assert!((inside / walls - 1.0).abs() < 0.1, "{inside} inside, {walls} at the walls");
}

/// Sheared between walls and across periodic sides, in several threads: the same bits.
#[test]
fn shear_has_the_same_bits_in_any_number_of_threads() {
    let packing = packing::<Discs>("discs-100.json");
    let walled = "[[stage]]\nname = \"shear\"\nsteps = 60\nrows = 2\nglue = [\"y\"]\nshear = { xy = 1e-3 }\nstress = { yy = -1e5 }\n";
    let periodic =
        "[[stage]]\nname = \"shear\"\nsteps = 60\nrows = 2\nshear = { xy = 1e-3 }\nstrain = { xx = 1e-4 }\n";
    for (sides, stages) in [("\"x\"", walled), ("\"x\", \"y\"", periodic)] {
        let test = test(&format!("tiles = [7, 7]\nperiodic = [{sides}]"), stages);
        let rows = [1, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| run(&test, &packing).0)
        });
        assert!(rows[0] == rows[1], "{rows:?}");
        assert!(rows[0][1].shear_work != 0.0);
    }
}

/// What cannot be sheared is refused with the key and the remedy.
#[test]
fn shear_that_cannot_be_is_refused() {
    let stage = |more: &str| format!("[[stage]]\nname = \"s\"\nsteps = 10\n{more}\n");
    let reason = |sides: &str, more: &str, dimension: usize| {
        let tiles = if dimension == 2 { "[1, 1]" } else { "[1, 1, 1]" };
        test(&format!("tiles = {tiles}\nperiodic = [{sides}]"), &stage(more))
            .validate(dimension)
            .unwrap_err()
            .to_string()
    };
    assert!(reason("", "shear = { xy = 0.1 }", 2).contains("glue = [\"y\"]"));
    assert!(reason("\"y\"", "shear = { xy = 0.1 }", 2).contains("walls of x"));
    assert!(reason("\"x\", \"y\"", "shear = { yx = 0.1 }", 2).contains("give shear.xy"));
    assert!(reason("\"x\"", "shear = { xz = 0.1 }\nglue = [\"y\"]", 2).contains("needs a specimen in space"));
    assert!(reason("\"x\"", "glue = [\"x\"]", 2).contains("no axis with walls"));
    assert!(reason("\"x\"", "glue = [\"y\"]\nshear = { xy = 20.0 }", 2).contains("between -10 and 10"));
    assert!(reason("\"x\", \"y\"", "glue = [\"z\"]\nshear = { xy = 0.1 }", 3).contains("rigid"));
    assert!(reason("\"x\"", "stress = { xx = -1.0 }", 2).contains("x is periodic"));
    // Keys of walls that there are not.
    for key in ["friction = 0.3", "servo_gain = 0.2", "largest_strain_per_step = 1e-6"] {
        let refused = reason("\"x\", \"y\"", &format!("[walls]\n{key}"), 2);
        assert!(refused.contains("is not used: all axes are periodic"), "{refused}");
    }
    // Without a wall grains fall for ever; down a slope they may flow along a periodic axis.
    let falling = |sides: &str| {
        test(
            &format!("tiles = [1, 1]\nperiodic = [{sides}]"),
            &format!("[motion]\nscaled_masses = false\ngravity = [1.0, -9.81]\n{}", stage("")),
        )
        .validate(2)
    };
    assert!(falling("\"x\", \"y\"").unwrap_err().to_string().contains("fall for ever"));
    assert_eq!(falling("\"x\"").err().map(|error| error.to_string()), None);
}

/// Spheres: the cell leans along its walls, is straightened, and comes back to its stress.
#[test]
fn a_leaning_packing_of_spheres_is_straightened() {
    let packing = packing::<Spheres>("spheres-100.json");
    let upright = super::assembly::straightened(&packing, [true, false, true]);
    let (old, new) = (&packing.periodicity, &upright.periodicity);
    assert!(new[2][1] == 0.0 && new[2][2] == old[2][2] && new[1] == old[1] && new[2][0] == old[2][0], "{new:?}");
    assert!(super::assembly::tiled(&packing, &[1, 1, 1], [true, false, true]).is_err());
    let many = super::assembly::tiled(&upright, &[1000, 1000, 1000], [true; 3]).unwrap_err().to_string();
    assert!(many.contains("more than 100000000 grains"), "{many}");
    assert_eq!(super::assembly::tiled(&upright, &[1, 1, 1], [true, false, true]).unwrap().grains.len(), 100);
}
