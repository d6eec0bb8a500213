//! One contact and small crystals against closed forms.

use super::sample::Sample;
use crate::cell::Cell;
use crate::contact::{LinearSprings, NormalStiffness, PlainLinear};
use crate::solver::kernel::StepSums;
use crate::space::{Components, Discs, Space, Spheres, plane, scaled};
use claims::Claim;
use proptest::prelude::*;

const STIFFNESS: f64 = 3.0e4;
const RATIO: f64 = 0.6;
const FRICTION: f64 = 0.4;
const LAW: PlainLinear = PlainLinear::plain(
    LinearSprings { normal: NormalStiffness::Constant(STIFFNESS), stiffness_ratio: RATIO },
    FRICTION,
);

/// Two grains and the contact between them.
#[derive(Clone)]
struct Couple(Sample<Discs, PlainLinear>);

impl Couple {
    fn new(law: PlainLinear, radii: [f64; 2], first: [f64; 2], branch: [f64; 2]) -> Self {
        let second = [first[0] + branch[0], first[1] + branch[1]];
        let cell = Cell { rows: [[100.0, 0.0], [0.0, 100.0]] };
        Self(Sample::new(law, cell, vec![first, second], radii.to_vec(), 1.0))
    }

    fn force(&self, grain: usize) -> [f64; 2] {
        self.0.grains[grain].force
    }

    fn moment(&self, grain: usize) -> f64 {
        self.0.grains[grain].moment[0]
    }

    fn tangential_force(&self) -> f64 {
        self.0.contacts[0].tangential_force[0]
    }

    /// Moves the end grain and spins both.
    fn move_end(&mut self, displacement: [f64; 2], spins: [f64; 2]) -> StepSums<f64> {
        self.0.grains[1].position[0] += displacement[0];
        self.0.grains[1].position[1] += displacement[1];
        (self.0.grains[0].spin, self.0.grains[1].spin) = ([spins[0]], [spins[1]]);
        self.0.evaluate()
    }
}

proptest! {
    /// C-1 for the linear law: force over overlap, with and without cohesion; nothing without overlap.
    #[test]
    fn normal_force_is_linear_in_the_overlap(gap in -0.2..0.1f64, cohesion in 0.0..0.1f64, angle in 0.0..6.0f64) {
        let law = PlainLinear { cohesion, ..LAW };
        let length = 2.5 + gap;
        let branch = [length * angle.cos(), length * angle.sin()];
        let couple = Couple::new(law, [1.0, 1.5], [0.3, -0.7], branch);
        let along = (couple.force(0)[0] * branch[0] + couple.force(0)[1] * branch[1]) / length;
        let expected = if gap < 0.0 { -STIFFNESS * (-gap - cohesion) } else { 0.0 };
        let quantity = "force of linear springs with and without cohesion, over the stiffness";
        Claim::of("C-1", quantity).error((along - expected) / STIFFNESS).within(1e-12);
        prop_assert_eq!(couple.force(0)[0], -couple.force(1)[0]);
        prop_assert_eq!(couple.force(0)[1], -couple.force(1)[1]);
    }

    /// C-17: moving and turning a loaded couple as a whole, or naming its grains the other way round, changes nothing.
    #[test]
    fn frame_and_order_of_a_couple_do_not_matter(
        angle in 0.0..6.2f64, slide in -0.02..0.02f64, press in -0.01..0.01f64, spins in proptest::array::uniform2(-0.01..0.01f64),
    ) {
        let history = |origin: [f64; 2], turn: f64| {
            let frame = plane::rotation(turn);
            let mut couple = Couple::new(LAW, [1.0, 1.5], origin, plane::apply(&frame, [2.45, 0.0]));
            couple.move_end(plane::apply(&frame, [press, slide]), spins);
            couple
        };
        let plain = history([0.0, 0.0], 0.0);
        let turned = history([0.4, -0.2], angle);
        let expected = plane::apply(&plane::rotation(angle), plain.force(0));
        for (force, wanted) in turned.force(0).iter().zip(&expected) {
            let quantity = "change of the force by moving and turning a pair of discs, over the stiffness";
            Claim::of("C-17", quantity).error((force - wanted) / STIFFNESS).within(1e-14);
        }
        for grain in 0..2 {
            let change = turned.moment(grain) - plain.moment(grain);
            let quantity = "change of the moment by moving and turning a pair of discs, over the stiffness";
            Claim::of("C-17", quantity).error(change / STIFFNESS).within(1e-14);
        }

        let mut swapped = Couple::new(LAW, [1.5, 1.0], [2.45, 0.0], [-2.45, 0.0]);
        swapped.0.grains[0].position = [2.45 + press, slide];
        swapped.move_end([0.0, 0.0], [spins[1], spins[0]]);
        let changes =
            [swapped.tangential_force() - plain.tangential_force(), swapped.moment(1) - plain.moment(0)];
        for change in changes {
            let quantity = "change of force and moment by exchanging the discs of a pair, over the stiffness";
            Claim::of("C-17", quantity).error(change / STIFFNESS).within(1e-14);
        }
    }
}

/// C-12: at constant normal force, a cycle below the Coulomb limit stores and returns; above it loses
/// `4 mu N (s - mu N / k_t)`, and the kernel's own ledger says the same.
#[test]
fn tangential_cycle_loses_what_friction_takes() {
    let (arm, overlap) = (1.0 - 0.025, 0.05);
    let (normal, tangential) = (STIFFNESS * overlap, RATIO * STIFFNESS);
    let limit_slip = FRICTION * normal / tangential;
    for (amplitude, expected) in
        [(0.75 * limit_slip, 0.0), (2.5 * limit_slip, 4.0 * FRICTION * normal * (2.5 - 1.0) * limit_slip)]
    {
        let mut couple = Couple::new(LAW, [1.0, 1.0], [0.0, 0.0], [2.0 - overlap, 0.0]);
        let steps = 40;
        let mut run = |slip: f64, count: usize| {
            let (mut work, mut lost) = (0.0, 0.0);
            for _ in 0..count {
                let before = couple.tangential_force();
                lost += couple.move_end([0.0, 0.0], [0.0, -slip / arm]).dissipation;
                work += 0.5 * (before + couple.tangential_force()) * slip;
            }
            (work, lost)
        };
        let step = amplitude / steps as f64;
        run(step, steps);
        let there = run(-step, 2 * steps);
        let back = run(step, 2 * steps);
        let (work, lost) = (there.0 + back.0, there.1 + back.1);
        let scale = FRICTION * normal * amplitude;
        let regime = if expected > 0.0 { "above" } else { "below" };
        let quantity = format!("work of a tangential cycle {regime} the Coulomb limit over mu N s, discs");
        Claim::of("C-12", &quantity).value(work / scale, expected / scale).within_absolute(1e-10);
        let quantity = "loss in a tangential cycle by the ledger over mu N s, discs";
        Claim::of("C-12", quantity).value(lost / scale, expected / scale).within_absolute(1e-10);
    }
}

/// C-16: a loaded couple turned once round in 720 rigid steps keeps its forces, turned with it.
#[test]
fn full_rigid_turn_leaves_the_contact_as_it_was() {
    let mut couple = Couple::new(LAW, [1.0, 1.5], [0.0, 0.0], [2.45, 0.0]);
    couple.move_end([0.0, 0.01], [0.002, -0.001]);
    let (start, branch) = (couple.clone(), couple.0.grains[1].position);
    assert!(start.tangential_force().abs() > 10.0);
    let steps = 720;
    let turn = std::f64::consts::TAU / f64::from(steps);
    for step in 1..=steps {
        let frame = plane::rotation(turn * f64::from(step));
        couple.0.grains[1].position = plane::apply(&frame, branch);
        couple.move_end([0.0, 0.0], [turn, turn]);
        if step == steps / 4 {
            let expected = plane::apply(&plane::rotation(std::f64::consts::FRAC_PI_2), start.force(0));
            for (found, wanted) in couple.force(0).iter().zip(&expected) {
                let quantity = "force after a quarter turn of a pair of discs, over the stiffness";
                Claim::of("C-16", quantity).error((found - wanted) / STIFFNESS).within(1e-10);
            }
        }
    }
    let quantity = "tangential force after a full turn of a pair of discs, N";
    Claim::of("C-16", quantity).value(couple.tangential_force(), start.tangential_force()).within(1e-10);
}

/// A contact that opens lets go of its history; when it closes again it starts from zero.
#[test]
fn reopened_contact_has_no_memory() {
    let mut couple = Couple::new(LAW, [1.0, 1.0], [0.0, 0.0], [1.9, 0.0]);
    couple.move_end([0.0, 0.01], [0.0, 0.0]);
    let stored = 0.5 * couple.tangential_force().powi(2) / (RATIO * STIFFNESS);
    let lost = couple.move_end([0.2, 0.0], [0.0, 0.0]).opening_loss;
    assert!((lost - stored).abs() < 1e-15 * stored);
    assert_eq!((couple.force(0), couple.force(1)), ([0.0; 2], [0.0; 2]));
    assert_eq!((couple.moment(0), couple.moment(1)), (0.0, 0.0));
    couple.move_end([-0.2, 0.0], [0.01, 0.01]);
    assert_eq!(couple.tangential_force(), 0.0);
}

/// A crystal of unit grains with a trace of overlap, four cells along each axis; `basis` holds the places in a cell in
/// units of its edges.
fn crystal<S: Space>(rows: S::Tensor, basis: &[S::Vector], stiffness_ratio: f64) -> Sample<S, PlainLinear> {
    let mut positions = Vec::new();
    for number in 0..4usize.pow(S::DIMENSION as u32) {
        for place in basis {
            positions.push(S::Vector::from_fn(|axis| {
                (0..S::DIMENSION)
                    .map(|row| {
                        ((number / 4usize.pow(row as u32)) % 4) as f64 * rows[row][axis]
                            + place[row] * rows[row][axis]
                    })
                    .sum()
            }));
        }
    }
    let radii = vec![0.5 + 0.5e-5; positions.len()];
    let springs = LinearSprings { normal: NormalStiffness::Constant(1.0), stiffness_ratio };
    let law = PlainLinear { springs, friction: 1e9, ..LAW };
    Sample::new(law, Cell { rows: scaled(&rows, 4.0) }, positions, radii, 1e-3)
}

/// Undamped motion is stable just below the known critical step and diverges just above it; the block bound is never
/// above the critical step, and not far below.
fn check_critical_step<S: Space>(rows: S::Tensor, basis: &[S::Vector], ratio: f64, critical: f64) {
    let sample = crystal::<S>(rows, basis, ratio);
    let below = sample.clone().growth(0.99 * critical);
    let above = sample.clone().growth(1.01 * critical);
    let grains = if S::DIMENSION == 2 { "discs" } else { "spheres" };
    let quantity = format!("growth of the motion in steps of 0.99 times the critical one, crystals of {grains}");
    Claim::of("B-4", &quantity).number(below).at_most(1e2);
    let quantity = format!("growth of the motion in steps of 1.01 times the critical one, crystals of {grains}");
    Claim::of("B-4", &quantity).number(above).at_least(1e4);
    let bound = sample.promised_step();
    let quantity = format!("bound of the step over the critical step, crystals of {grains}");
    Claim::of("B-4", &quantity).number(bound / critical).between(0.82, 1.0 + 1e-3);
}

/// B-4 in the plane.
#[test]
fn critical_steps_of_plane_crystals_are_met_and_bounded() {
    let square = [[1.0, 0.0], [0.0, 1.0]];
    let hexagonal = [[1.0, 0.0], [0.5, 0.75f64.sqrt()]];
    // Rows of grains so far apart that they do not touch: chains.
    let chain = [[1.0, 0.0], [0.0, 3.0]];
    for (rows, ratio, critical) in [
        (chain, 0.0, 1.0),
        (square, 0.0, 1.0),
        (square, 0.2, 0.9129),
        (square, 0.5, std::f64::consts::FRAC_1_SQRT_2),
        (square, 1.0, 0.5),
        (hexagonal, 0.0, 0.8165),
        (hexagonal, 0.2, 0.7906),
        (hexagonal, 0.5, 0.5774),
        (hexagonal, 1.0, 0.4082),
    ] {
        check_critical_step::<Discs>(rows, &[[0.0; 2]], ratio, critical);
    }
}

/// B-4 in space: simple cubic and face-centred cubic.
#[test]
fn critical_steps_of_space_crystals_are_met_and_bounded() {
    let cube = |edge: f64| [[edge, 0.0, 0.0], [0.0, edge, 0.0], [0.0, 0.0, edge]];
    let simple = [[0.0; 3]];
    let centred = [[0.0; 3], [0.5, 0.5, 0.0], [0.5, 0.0, 0.5], [0.0, 0.5, 0.5]];
    for (ratio, critical) in [(0.0, 1.0), (0.2, 0.8452), (0.5, 0.6325), (1.0, 0.4472)] {
        check_critical_step::<Spheres>(cube(1.0), &simple, ratio, critical);
    }
    for (ratio, critical) in [(0.0, 0.5_f64.sqrt()), (0.2, 0.6455), (0.5, 0.4472), (1.0, 0.3162)] {
        check_critical_step::<Spheres>(cube(2f64.sqrt()), &centred, ratio, critical);
    }
}
