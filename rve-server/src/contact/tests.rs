//! Formulas of the laws against closed forms.

use super::linear::NormalStiffness;
use super::*;
use crate::space::Spheres;
use claims::Claim;

fn hertz(unloading: TangentialUnloading) -> PlainHertzMindlin {
    PlainHertzMindlin {
        springs: HertzSprings { shear_modulus: 29.0e9, poisson_ratio: 0.15 },
        friction: 1e9,
        cohesion: 0.0,
        unloading,
        rolling: RollingSpring::default(),
        viscosity: 0.0,
    }
}

fn constants<L: ContactLaw<Spheres>>(law: &L, radii: [f64; 2]) -> L::Constants<f64> {
    law.constants(radii)
}

/// C-1: force, slope and energy of two spheres; the ratio of the stiffnesses is that of Mindlin.
#[test]
fn hertz_force_slope_and_energy_are_the_closed_forms() {
    let law = hertz(TangentialUnloading::Rescaled);
    let (first, second, overlap): (f64, f64, f64) = (0.4e-3, 0.9e-3, 3e-7);
    let constants = constants(&law, [first, second]);
    let (shear, nu) = (29.0e9, 0.15);
    let young = 2.0 * shear * (1.0 + nu);
    let effective_modulus = 0.5 * young / (1.0 - nu * nu);
    let effective_radius: f64 = 1.0 / (1.0 / first + 1.0 / second);
    let force = 4.0 / 3.0 * effective_modulus * effective_radius.sqrt() * overlap.powf(1.5);
    let slope = 2.0 * effective_modulus * (effective_radius * overlap).sqrt();
    let tangential = 8.0 * shear / (2.0 * (2.0 - nu)) * (effective_radius * overlap).sqrt();
    let found = ContactLaw::<Spheres>::normal_force(&law, &constants, overlap);
    Claim::of("C-1", "Hertz force of two spheres, N").value(found, -force).within(1e-12);
    let [k_n, k_t, _] = ContactLaw::<Spheres>::stiffness(&law, &constants, overlap);
    Claim::of("C-1", "normal stiffness of two spheres, N/m").value(k_n, slope).within(1e-12);
    Claim::of("C-1", "tangential stiffness of two spheres, N/m").value(k_t, tangential).within(1e-12);
    let ratio = 2.0 * (1.0 - nu) / (2.0 - nu);
    Claim::of("C-1", "tangential stiffness over the normal one").value(k_t / k_n, ratio).within(1e-12);
    // [Liu2015] eq. 54 with its effective radius, twice the usual one, and a factor square root of 2.
    let printed = 2f64.sqrt() * shear * (2.0 * effective_radius).sqrt() / (1.0 - nu) * overlap.sqrt();
    Claim::of("C-1", "normal stiffness as [Liu2015] prints it, N/m").value(k_n, printed).within(1e-12);
    let energy = ContactLaw::<Spheres>::energy(&law, &constants, overlap, 0.0, &[overlap]);
    Claim::of("C-1", "energy of two spheres, J").value(energy, 0.4 * force * overlap).within(1e-12);
}

/// A contact of two spheres at rest against turning, moved along prescribed overlaps and slips.
struct Cycle<L: ContactLaw<Spheres>> {
    law: L,
    constants: L::Constants<f64>,
    memory: L::Memory<f64>,
    force: [f64; 3],
    overlap: f64,
    work: f64,
    dissipation: f64,
}

impl<L: ContactLaw<Spheres>> Cycle<L> {
    fn new(law: L, radii: [f64; 2], overlap: f64) -> Self {
        let constants = law.constants(radii);
        let memory = law.resumed(overlap, [0.0; 3]);
        Self { law, constants, memory, force: [0.0; 3], overlap, work: 0.0, dissipation: 0.0 }
    }

    fn step(&mut self, overlap: f64, slip: f64) {
        let before = (self.law.normal_force(&self.constants, self.overlap), self.force);
        let motion = ContactMotion::<Spheres, f64> {
            overlap,
            touched: true,
            carried: self.force,
            slip: [0.0, slip, 0.0],
            rolling: [0.0; 3],
        };
        let response = self.law.respond(&self.constants, &motion, &mut self.memory);
        self.force = response.tangential_force;
        self.dissipation += response.dissipation;
        self.work -= 0.5 * (before.0 + response.normal_force) * (overlap - self.overlap);
        self.work += 0.5 * (before.1[1] + self.force[1]) * slip;
        self.overlap = overlap;
    }

    fn go(&mut self, overlap: f64, slip: f64, steps: u32) {
        let start = self.overlap;
        for step in 1..=steps {
            let share = f64::from(step) / f64::from(steps);
            self.step(start + share * (overlap - start), slip / f64::from(steps));
        }
    }

    fn normal_force(&self, overlap: f64) -> f64 {
        self.law.normal_force(&self.constants, overlap)
    }

    fn tangential_stiffness(&self, overlap: f64) -> f64 {
        self.law.stiffness(&self.constants, overlap)[1]
    }
}

/// C-9: press, slip, release, slip back. The incremental law gains `1/2 (k_1 - k_0) s^2` and keeps a force; with rescaling
/// the same energy is lost, the force returns to zero, and the ledger knows.
#[test]
fn slip_cycle_across_two_overlaps_gains_or_loses_what_the_law_says() {
    let (low, high, slip) = (1e-7, 4e-7, 2e-8);
    for unloading in [TangentialUnloading::Incremental, TangentialUnloading::Rescaled] {
        let mut cycle = Cycle::new(hertz(unloading), [1e-3, 1e-3], low);
        let stiffness = [cycle.tangential_stiffness(low), cycle.tangential_stiffness(high)];
        let expected = 0.5 * (stiffness[1] - stiffness[0]) * slip * slip;
        // Loading and unloading do equal and opposite normal work only with the trapezoid on equal steps.
        cycle.go(high, 0.0, 50);
        cycle.go(high, slip, 50);
        cycle.go(low, 0.0, 50);
        cycle.go(low, -slip, 50);
        let work = cycle.work;
        match unloading {
            TangentialUnloading::Incremental => {
                let kept = (stiffness[1] - stiffness[0]) * slip;
                let quantity = "tangential force that is left, incremental law, N";
                Claim::of("C-9", quantity).value(cycle.force[1], kept).within(1e-10);
                Claim::of("C-9", "energy that a cycle gains, incremental law, J")
                    .value(-work, expected)
                    .within(1e-10);
            }
            TangentialUnloading::Rescaled => {
                let quantity = "tangential force that is left over the largest, rescaled law";
                Claim::of("C-9", quantity).error(cycle.force[1] / (stiffness[1] * slip)).within(1e-10);
                Claim::of("C-9", "energy that a cycle loses, rescaled law, J").value(work, expected).within(1e-10);
                let quantity = "energy lost by the ledger, rescaled law, J";
                Claim::of("C-9", quantity).value(cycle.dissipation, expected).within(1e-10);
            }
        }
    }
}

/// C-12 in space: at constant normal force a cycle below the Coulomb limit stores and returns; above it loses
/// `4 mu N (s - mu N / k_t)`, Mindlin's loop for a law without partial slip.
#[test]
fn tangential_cycle_of_spheres_loses_what_friction_takes() {
    let law = PlainHertzMindlin { friction: 0.3, ..hertz(TangentialUnloading::Rescaled) };
    let overlap = 2e-7;
    let reference = Cycle::new(law, [1e-3, 2e-3], overlap);
    let limit = 0.3 * -reference.normal_force(overlap);
    let limit_slip = limit / reference.tangential_stiffness(overlap);
    for (amplitude, expected) in [(0.75 * limit_slip, 0.0), (2.5 * limit_slip, 4.0 * limit * 1.5 * limit_slip)] {
        let mut cycle = Cycle::new(law, [1e-3, 2e-3], overlap);
        cycle.go(overlap, amplitude, 40);
        (cycle.work, cycle.dissipation) = (0.0, 0.0);
        cycle.go(overlap, -2.0 * amplitude, 80);
        cycle.go(overlap, 2.0 * amplitude, 80);
        let scale = limit * amplitude;
        let regime = if expected > 0.0 { "above" } else { "below" };
        let quantity = format!("work of a tangential cycle {regime} the Coulomb limit over mu N s, spheres");
        Claim::of("C-12", &quantity).value(cycle.work / scale, expected / scale).within_absolute(1e-10);
        let quantity = "loss in a tangential cycle by the ledger over mu N s, spheres";
        Claim::of("C-12", quantity).value(cycle.dissipation / scale, expected / scale).within_absolute(1e-10);
    }
}

/// Cohesion: free of force at the cohesive overlap, pulls just before it opens, and the friction limit counts the pull.
#[test]
fn cohesive_contacts_pull_until_they_open() {
    let springs = LinearSprings { normal: NormalStiffness::Constant(5.0), stiffness_ratio: 0.5 };
    let linear = PlainLinear {
        springs,
        friction: 0.5,
        cohesion: 0.02,
        unloading: TangentialUnloading::Rescaled,
        rolling: RollingSpring::default(),
        viscosity: 0.0,
    };
    let linear_constants = constants(&linear, [1.0, 1.0]);
    let force = |overlap| ContactLaw::<Spheres>::normal_force(&linear, &linear_constants, overlap);
    assert!(force(0.02).abs() < 1e-17 && (force(1e-12) - 0.1).abs() < 1e-11 && (force(0.05) + 0.15).abs() < 1e-15);
    let limit = ContactLaw::<Spheres>::friction_limit(&linear, &linear_constants, 0.03);
    assert!((limit - 0.5 * (0.1 - force(0.03))).abs() < 1e-15);
    let sticky = PlainHertzMindlin { cohesion: 2e-7, ..hertz(TangentialUnloading::Rescaled) };
    let sticky_constants = constants(&sticky, [1e-3, 1e-3]);
    let at = |overlap| ContactLaw::<Spheres>::normal_force(&sticky, &sticky_constants, overlap);
    assert!(at(2e-7).abs() < 1e-12 && at(1e-9) > 0.0 && at(3e-7) < 0.0);
}

/// Rolling: elastic up to the largest moment, constant beyond, and the ledger takes the difference.
#[test]
fn rolling_spring_is_elastic_and_then_plastic() {
    let law = ExtendedHertzMindlin {
        springs: HertzSprings { shear_modulus: 29.0e9, poisson_ratio: 0.15 },
        friction: 0.5,
        cohesion: 0.0,
        unloading: TangentialUnloading::Rescaled,
        rolling: RollingSpring { stiffness: 1.5, friction: 0.2 },
        viscosity: 0.0,
    };
    let radii = [1e-3, 2e-3];
    let overlap = 2e-7;
    let constants = constants(&law, radii);
    let force = -ContactLaw::<Spheres>::normal_force(&law, &constants, overlap);
    let [_, k_t, k_r] = ContactLaw::<Spheres>::stiffness(&law, &constants, overlap);
    assert!((k_r / (1.5 * k_t * radii[0] * radii[1]) - 1.0).abs() < 1e-14);
    let largest = 0.2 * radii[0] * force;
    let mut memory = ContactLaw::<Spheres>::resumed(&law, overlap, [0.0; 3]);
    let mut roll = |angle: f64| {
        let motion = ContactMotion::<Spheres, f64> {
            overlap,
            touched: true,
            carried: [0.0; 3],
            slip: [0.0; 3],
            rolling: [angle, 0.0, 0.0],
        };
        let response = law.respond(&constants, &motion, &mut memory);
        (response.couple.unwrap()[0], response.dissipation)
    };
    let yield_angle = largest / k_r;
    let (moment, lost) = roll(0.5 * yield_angle);
    assert!((moment / largest + 0.5).abs() < 1e-13 && lost.abs() < 1e-15 * largest);
    let (moment, lost) = roll(1.5 * yield_angle);
    assert!((moment / largest + 1.0).abs() < 1e-13);
    assert!((lost / (largest * yield_angle) - 1.0).abs() < 1e-12);
    let (moment, _) = roll(-0.5 * yield_angle);
    assert!((moment / largest + 0.5).abs() < 1e-12);
}

/// Spring and dashpot across a contact together stay within the friction limit: where it slides the dashpot adds nothing, without
/// friction there is none, and where it sticks the force is `k_t (1 + b)` times the slip.
#[test]
fn tangential_viscosity_stays_within_the_friction_limit() {
    let springs = LinearSprings { normal: NormalStiffness::Constant(5.0), stiffness_ratio: 0.4 };
    for friction in [0.0, 0.5] {
        let law = ExtendedLinear { viscosity: 0.8, ..ExtendedLinear::plain(springs, friction) };
        let constants = constants(&law, [1.0, 1.0]);
        let (overlap, limit) = (0.01, friction * 5.0 * 0.01);
        let respond = |carried: f64, slip: f64| {
            let motion = ContactMotion::<Spheres, f64> {
                overlap,
                touched: true,
                carried: [carried, 0.0, 0.0],
                slip: [slip, 0.0, 0.0],
                rolling: [0.0; 3],
            };
            let mut memory = ContactLaw::<Spheres>::resumed(&law, overlap, [0.0; 3]);
            let response = law.respond(&constants, &motion, &mut memory);
            (response.tangential_force[0], response.viscous.unwrap().tangential_force[0])
        };
        for slip in [1e-2, -1e-2, 0.9 * limit / 2.0] {
            let (spring, dashpot) = respond(0.7 * limit, slip);
            assert!((spring + dashpot).abs() <= limit * (1.0 + 1e-14), "friction {friction}: {spring} {dashpot}");
        }
        let (spring, dashpot) = respond(limit, 1e-2);
        assert!((spring - limit).abs() <= 1e-15 && dashpot.abs() <= 1e-15);
        // A contact that sticks, and one that turns back from its limit.
        let small = 0.1 * limit;
        for (carried, slip) in [(0.2 * limit, small), (limit, -small)] {
            let (spring, dashpot) = respond(carried, slip);
            assert!((spring - carried - 2.0 * slip).abs() < 1e-15 && (dashpot - 1.6 * slip).abs() < 1e-15);
        }
    }
}
