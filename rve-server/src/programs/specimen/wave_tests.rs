//! Small vibrations of perfect crystals: dispersion of a chain and the speed of sound in the triangular lattice.

use super::body::Body;
use super::contact::Grain;
use super::dynamics::{Dynamics, Motion};
use super::tests::{MASS, RADIUS, STIFFNESS, law, still};
use crate::contact::{LinearSprings, PlainLinear};
use crate::space::Discs;
use claims::Claim;
use std::f64::consts::TAU;

/// Overlap of the contacts at rest over the diameter.
const PRESS: f64 = 1e-4;

/// Largest displacement over the overlap at rest: no contact ever opens.
const SWING: f64 = 0.05;

/// Springs that never slide, with `k_t / k_n`.
fn springs(ratio: f64) -> PlainLinear {
    let plain = law(1e9);
    PlainLinear { springs: LinearSprings { stiffness_ratio: ratio, ..plain.springs }, ..plain }
}

/// Distance of grains at rest, m.
fn spacing() -> f64 {
    2.0 * RADIUS * (1.0 - PRESS)
}

/// `sqrt(m / k_n)`, s.
fn unit_of_time() -> f64 {
    (MASS / STIFFNESS).sqrt()
}

fn crystal(
    places: &[[f64; 2]],
    periods: [Option<[f64; 2]>; 3],
    ratio: f64,
    step: f64,
    velocity: impl Fn([f64; 2]) -> ([f64; 2], f64),
) -> Dynamics<Discs, PlainLinear> {
    let grains = places
        .iter()
        .map(|&position| {
            let (velocity, spin) = velocity(position);
            Grain { position, velocity, spin: [spin], radius: RADIUS }
        })
        .collect();
    let body = Body::new(springs(ratio), grains, vec![MASS; places.len()], 0.0, periods);
    Dynamics::new(body, Vec::new(), Motion { step: Some(step * unit_of_time()), ..still() })
}

/// Share of a wave in the displacements of one axis: `2/N sum u cos(q . x)`.
fn share(dynamics: &Dynamics<Discs, PlainLinear>, places: &[[f64; 2]], wave: [f64; 2], axis: usize) -> f64 {
    let terms =
        dynamics.body.grains.iter().zip(places).map(|(grain, place)| {
            (grain.position[axis] - place[axis]) * (wave[0] * place[0] + wave[1] * place[1]).cos()
        });
    2.0 * terms.sum::<f64>() / places.len() as f64
}

/// B-5: a chain vibrates with `omega = 2 sqrt(k/m) |sin(q d / 2)|`; in steps of `dt` with `sin(w dt / 2) = omega dt / 2`.
/// Its longest waves run with `d sqrt(k/m)`.
#[test]
fn chain_has_the_dispersion_of_its_steps() {
    let count = 200;
    let places: Vec<[f64; 2]> = (0..count).map(|number| [f64::from(number) * spacing(), 0.0]).collect();
    let periods = [Some([f64::from(count) * spacing(), 0.0]), None, None];
    for step in [0.05, 0.8] {
        for waves in [1, 10, 40, 75, 100] {
            let number = TAU * f64::from(waves) / (f64::from(count) * spacing());
            let speed = SWING * PRESS * spacing() / unit_of_time();
            let wave = [number, 0.0];
            let start = |[x, _]: [f64; 2]| ([speed * (number * x).cos(), 0.0], 0.0);
            let mut chain = crystal(&places, periods, 0.1, step, start);
            let mut history = vec![0.0];
            for _ in 0..400 {
                chain.advance();
                history.push(share(&chain, &places, wave, 0));
            }
            assert_eq!(chain.contacts.contacts, count as u64);
            // a(n + 1) + a(n - 1) = 2 cos(w dt) a(n), in the mean over the run.
            let (mut product, mut square) = (0.0, 0.0);
            for three in history.windows(3) {
                product += (three[0] + three[2]) * three[1];
                square += three[1] * three[1];
            }
            let half_turn = (0.5 * (1.0 - 0.5 * product / square)).sqrt();
            let exact = 2.0 * (0.5 * number * spacing()).sin().abs();
            let quantity = format!("sin(w dt/2) of waves in a chain, steps of {step} sqrt(m/k)");
            Claim::of("B-5", &quantity).value(half_turn, 0.5 * step * exact).within(1e-4);
            if waves == 1 {
                let sound = 2.0 * half_turn.asin() / (step * number * spacing());
                let quantity =
                    format!("speed of the longest wave in a chain over d sqrt(k/m), steps of {step} sqrt(m/k)");
                Claim::of("B-5", &quantity).value(sound, 1.0).within(1e-4);
            }
        }
    }
}

/// Speed of a plane wave, in `d sqrt(k_n / m)`, of twenty grains or so a length, from three half periods.
fn sound(ratio: f64, along: usize, is_shear: bool) -> f64 {
    let rise = 3f64.sqrt();
    let counts = if along == 0 { [20, 2] } else { [2, 12] };
    let sides = [f64::from(counts[0]) * spacing(), f64::from(counts[1]) * rise * spacing()];
    let mut places = Vec::new();
    for row in 0..2 * counts[1] {
        for column in 0..counts[0] {
            let x = (f64::from(column) + 0.5 * f64::from(row % 2)) * spacing();
            places.push([x, 0.5 * f64::from(row) * rise * spacing()]);
        }
    }
    let number = TAU / sides[along];
    let mut wave = [0.0; 2];
    wave[along] = number;
    let axis = if is_shear { 1 - along } else { along };
    let speed = SWING * PRESS * spacing() / unit_of_time();
    let start = |place: [f64; 2]| {
        let phase = number * place[along];
        let mut velocity = [0.0; 2];
        velocity[axis] = speed * phase.cos();
        // Grains turn with the medium, by half the curl.
        let turn = if along == 0 { -0.5 } else { 0.5 };
        (velocity, if is_shear { turn * speed * number * phase.sin() } else { 0.0 })
    };
    let step = 0.05;
    let mut crystal = crystal(&places, [Some([sides[0], 0.0]), Some([0.0, sides[1]]), None], ratio, step, start);
    let (mut before, mut crossings) = (0.0, 0);
    for count in 1..20_000 {
        crystal.advance();
        let now = share(&crystal, &places, wave, axis);
        if now * before < 0.0 {
            crossings += 1;
            if crossings == 3 {
                assert_eq!(crystal.contacts.contacts, 3 * places.len() as u64);
                let time = (f64::from(count) - now / (now - before)) * step;
                return 3.0 * std::f64::consts::PI / time / (number * spacing());
            }
        }
        before = now;
    }
    panic!("the wave did not swing")
}

/// B-6: `c_P = d sqrt(3 (3 k_n + k_t) / 8 m)` and `c_S = d sqrt(3 (k_n + k_t) / 8 m)`, along the rows and across them.
#[test]
fn sound_in_the_triangular_crystal_is_that_of_its_moduli() {
    for ratio in [0.0f64, 0.2, 0.8] {
        for along in [0, 1] {
            let expected = [(0.375 * (3.0 + ratio)).sqrt(), (0.375 * (1.0 + ratio)).sqrt()];
            for (is_shear, expected) in [false, true].into_iter().zip(expected) {
                let found = sound(ratio, along, is_shear);
                let kind = if is_shear { "shear" } else { "pressure" };
                let way = if along == 0 { "along" } else { "across" };
                let quantity = format!("speed of {kind} waves {way} the rows over d sqrt(k_n/m)");
                Claim::of("B-6", &quantity).value(found, expected).within(0.01);
            }
        }
    }
}
