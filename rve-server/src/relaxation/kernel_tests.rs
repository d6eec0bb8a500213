//! One contact and small crystals against closed forms.

use super::assembly::Assembly;
use super::kernel::{ContactSums, GrainSlot, LoadSlot, PairSlot, Touching, evaluate};
use super::motion::largest_own_stiffness;
use crate::definition::{ContactTable, GrainDefinition, NormalStiffness, RveOptions};
use crate::law::{LinearSprings, PlainLinear, RollingSpring, Unloading};
use crate::model::GrainModel;
use crate::packing::PackingFile;
use crate::plane;
use crate::space::Discs;
use proptest::prelude::*;

const STIFFNESS: f64 = 3.0e4;
const RATIO: f64 = 0.6;
const FRICTION: f64 = 0.4;
const LAW: PlainLinear = PlainLinear {
    springs: LinearSprings { normal: NormalStiffness::Constant(STIFFNESS), stiffness_ratio: RATIO },
    friction: FRICTION,
    cohesion: 0.0,
    unloading: Unloading::Rescaled,
    rolling: RollingSpring { stiffness: 0.0, friction: 0.0 },
    viscosity: 0.0,
};

/// Two grains and the contact between them.
#[derive(Clone)]
struct Couple {
    law: PlainLinear,
    grains: [GrainSlot<Discs>; 2],
    pair: PairSlot<Discs, PlainLinear>,
    loads: [LoadSlot<Discs>; 2],
}

impl Couple {
    fn new(law: PlainLinear, radii: [f64; 2], first: [f64; 2], branch: [f64; 2]) -> Self {
        let grain = |position, radius| GrainSlot { position, spin: 0.0, radius };
        let pair = PairSlot::new(&law, 0, 1, 0, radii);
        let second = [first[0] + branch[0], first[1] + branch[1]];
        let grains = [grain(first, radii[0]), grain(second, radii[1])];
        let mut couple = Self { law, grains, pair, loads: [LoadSlot::default(); 2] };
        couple.evaluate();
        couple
    }

    fn evaluate(&mut self) -> ContactSums {
        let mut touching = Touching::default();
        touching.reserve(1);
        let pairs = std::slice::from_mut(&mut self.pair);
        evaluate(&self.law, &self.grains, &[[0.0; 2]], pairs, &mut touching, &mut self.loads)
    }

    /// Moves the end grain and spins both.
    fn move_end(&mut self, displacement: [f64; 2], spins: [f64; 2]) -> ContactSums {
        self.grains[1].position[0] += displacement[0];
        self.grains[1].position[1] += displacement[1];
        (self.grains[0].spin, self.grains[1].spin) = (spins[0], spins[1]);
        self.evaluate()
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
        let along = (couple.loads[0].force[0] * branch[0] + couple.loads[0].force[1] * branch[1]) / length;
        let expected = if gap < 0.0 { -STIFFNESS * (-gap - cohesion) } else { 0.0 };
        prop_assert!((along - expected).abs() <= 1e-12 * STIFFNESS);
        prop_assert_eq!(couple.loads[0].force[0], -couple.loads[1].force[0]);
        prop_assert_eq!(couple.loads[0].force[1], -couple.loads[1].force[1]);
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
        let expected = plane::apply(&plane::rotation(angle), plain.loads[0].force);
        for (force, wanted) in turned.loads[0].force.iter().zip(&expected) {
            prop_assert!((force - wanted).abs() <= 1e-13 * STIFFNESS);
        }
        for grain in 0..2 {
            prop_assert!((turned.loads[grain].moment - plain.loads[grain].moment).abs() <= 1e-13 * STIFFNESS);
        }

        let mut swapped = Couple::new(LAW, [1.5, 1.0], [2.45, 0.0], [-2.45, 0.0]);
        swapped.grains[0].position = [2.45 + press, slide];
        swapped.move_end([0.0, 0.0], [spins[1], spins[0]]);
        prop_assert!((swapped.pair.tangential_force[0] - plain.pair.tangential_force[0]).abs() <= 1e-14 * STIFFNESS);
        prop_assert!((swapped.loads[1].moment - plain.loads[0].moment).abs() <= 1e-14 * STIFFNESS);
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
                let before = couple.pair.tangential_force[0];
                lost += couple.move_end([0.0, 0.0], [0.0, -slip / arm]).dissipation;
                work += 0.5 * (before + couple.pair.tangential_force[0]) * slip;
            }
            (work, lost)
        };
        let step = amplitude / steps as f64;
        run(step, steps);
        let there = run(-step, 2 * steps);
        let back = run(step, 2 * steps);
        let (work, lost) = (there.0 + back.0, there.1 + back.1);
        let scale = FRICTION * normal * amplitude;
        assert!((work - expected).abs() < 1e-10 * scale, "work {work} against {expected}");
        assert!((lost - expected).abs() < 1e-10 * scale, "ledger {lost} against {expected}");
    }
}

/// C-16: a loaded couple turned once round in 720 rigid steps keeps its forces, turned with it.
#[test]
fn full_rigid_turn_leaves_the_contact_as_it_was() {
    let mut couple = Couple::new(LAW, [1.0, 1.5], [0.0, 0.0], [2.45, 0.0]);
    couple.move_end([0.0, 0.01], [0.002, -0.001]);
    let (start, branch) = (couple.clone(), couple.grains[1].position);
    assert!(start.pair.tangential_force[0].abs() > 10.0);
    let steps = 720;
    let turn = std::f64::consts::TAU / f64::from(steps);
    for step in 1..=steps {
        let frame = plane::rotation(turn * f64::from(step));
        couple.grains[1].position = plane::apply(&frame, branch);
        couple.move_end([0.0, 0.0], [turn, turn]);
        if step == steps / 4 {
            let expected = plane::apply(&plane::rotation(std::f64::consts::FRAC_PI_2), start.loads[0].force);
            assert!((couple.loads[0].force[0] - expected[0]).abs() < 1e-10 * STIFFNESS);
            assert!((couple.loads[0].force[1] - expected[1]).abs() < 1e-10 * STIFFNESS);
        }
    }
    let change = couple.pair.tangential_force[0] / start.pair.tangential_force[0] - 1.0;
    assert!(change.abs() < 1e-10, "tangential force changed by {change:e}");
}

/// A contact that opens lets go of its history; when it closes again it starts from zero.
#[test]
fn reopened_contact_has_no_memory() {
    let mut couple = Couple::new(LAW, [1.0, 1.0], [0.0, 0.0], [1.9, 0.0]);
    couple.move_end([0.0, 0.01], [0.0, 0.0]);
    let stored = 0.5 * couple.pair.tangential_force[0].powi(2) / (RATIO * STIFFNESS);
    let lost = couple.move_end([0.2, 0.0], [0.0, 0.0]).dissipation;
    assert!((lost - stored).abs() < 1e-15 * stored);
    assert_eq!(couple.loads, [LoadSlot::default(); 2]);
    couple.move_end([-0.2, 0.0], [0.01, 0.01]);
    assert_eq!(couple.pair.tangential_force[0], 0.0);
}

/// A crystal of 4 x 4 unit discs with a trace of overlap.
fn crystal(rows: [[f64; 2]; 2], stiffness_ratio: f64) -> Assembly<Discs, PlainLinear> {
    let overlap = 1e-5;
    let at = |i: usize, j: usize, axis: usize| (i as f64) * rows[0][axis] + (j as f64) * rows[1][axis];
    let grains = (0..16).map(|k| [at(k / 4, k % 4, 0), at(k / 4, k % 4, 1), 0.5 + 0.5 * overlap]).collect();
    let packing = PackingFile::<Discs> {
        format: PackingFile::FORMAT.into(),
        version: PackingFile::VERSION,
        dimension: 2,
        thickness: 1.0,
        periodicity: rows.map(|row| row.map(|value| 4.0 * value)),
        grains,
        contacts: Vec::new(),
        provenance: serde_json::Value::Null,
    };
    let contact = ContactTable::linear(1.0, stiffness_ratio, 1e9);
    let definition =
        GrainDefinition { packing, contact, options: RveOptions::default() }.validate().expect("a sound crystal");
    let model = GrainModel::new(&definition).expect("a sound crystal");
    let law = definition.contact.parts().law(definition.contact.parts().linear_springs().unwrap());
    let mut assembly = Assembly::new(law);
    assembly.load(&model, &model.initial_state(&definition));
    assembly.evaluate();
    assembly
}

/// How much a small random motion of unit-mass solid discs has grown after 120 undamped steps.
fn growth(mut assembly: Assembly<Discs, PlainLinear>, step: f64) -> f64 {
    let start = 1e-12;
    let mut velocities: Vec<[f64; 3]> = (0..assembly.grains.len())
        .map(|grain| [1.0, 2.0, 3.0].map(|phase| start * (phase + 2.4 * phase * phase * grain as f64).sin()))
        .collect();
    let inertia = 0.5 * 0.25;
    for _ in 0..120 {
        for (load, velocity) in assembly.loads.iter().zip(&mut velocities) {
            velocity[0] += step * load.force[0];
            velocity[1] += step * load.force[1];
            velocity[2] += step * load.moment / inertia;
        }
        for (grain, velocity) in assembly.grains.iter_mut().zip(&velocities) {
            grain.position[0] += step * velocity[0];
            grain.position[1] += step * velocity[1];
            grain.spin = step * velocity[2];
        }
        assembly.evaluate();
    }
    velocities.iter().flatten().fold(0.0, |largest: f64, value| largest.max(value.abs())) / start
}

/// B-4: undamped motion is stable just below the known critical step of each crystal and diverges just above it; the
/// block bound is never above the critical step and equals it on the branches where theory says so.
#[test]
fn critical_steps_of_crystals_are_met_and_bounded() {
    let square = [[1.0, 0.0], [0.0, 1.0]];
    let hexagonal = [[1.0, 0.0], [0.5, 0.75f64.sqrt()]];
    let cases = [
        (square, 0.2, 0.9129),
        (square, 0.5, std::f64::consts::FRAC_1_SQRT_2),
        (square, 1.0, 0.5),
        (hexagonal, 0.0, 0.8165),
        (hexagonal, 0.2, 0.7906),
        (hexagonal, 0.5, 0.5774),
        (hexagonal, 1.0, 0.4082),
    ];
    for (rows, ratio, critical) in cases {
        let assembly = crystal(rows, ratio);
        let below = growth(assembly.clone(), 0.99 * critical);
        let above = growth(assembly.clone(), 1.01 * critical);
        assert!(below < 1e2, "ratio {ratio}: motion grew {below:e} times below the critical step");
        assert!(above > 1e4, "ratio {ratio}: motion grew only {above:e} times above the critical step");

        let shape = vec![1.0; assembly.grains.len()];
        let stiffness = largest_own_stiffness(0.5, &assembly, &shape, &mut Vec::new());
        let bound = 2.0 / (2.0 * stiffness).sqrt();
        assert!(bound <= critical * (1.0 + 1e-3), "ratio {ratio}: bound {bound} above {critical}");
        assert!(bound >= critical * 0.83, "ratio {ratio}: bound {bound} far below {critical}");
    }
}
