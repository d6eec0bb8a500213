//! Rayleigh damping and bulk viscosity: decay rates, and a ledger that closes.

use super::*;
use crate::problem::dynamics::{BulkViscosity, InitialVelocity, RayleighDamping};
use claims::Claim;
use std::f64::consts::PI;

/// Amplitude of the lowest longitudinal mode of a bar with held ends after `periods` periods, over that at the start, and the ledger.
fn decay(damping: RayleighDamping, viscosity: BulkViscosity, periods: f64) -> (f64, EnergyBalance) {
    let (count, side, density, lambda, shear) = (20, 0.5, 3.0, 12.0, 0.0);
    let mut mesh = strip(ElementKind::Q4, count, side);
    let wave = PI / (count as f64 * side);
    let mut settings = DynamicSettings { damping, viscosity, ..settings(density) };
    for node in 0..mesh.nodes.len() {
        let name = format!("node {node}");
        let value = [1e-3 * (wave * mesh.nodes[node][0]).sin(), 0.0, 0.0];
        settings.initial_velocities.push(InitialVelocity { nodes: name.clone(), value });
        mesh.node_sets.insert(name, vec![node]);
    }
    let middle = mesh.nodes.iter().position(|node| (node[0] - 5.0).abs() < 1e-9).unwrap();
    let ends = vec![held("left", Axis::X), held("right", Axis::X), held("all", Axis::Y)];
    // The period is 2 L / c = 10 s.
    let problem = problem(mesh, ends, 10.0 * periods, settings);
    let film = completed(&problem, &mut elastic(&problem, lambda, shear));
    let swing = |from: f64, to: f64| {
        let inside = film.instants.iter().filter(|instant| instant.time >= from && instant.time <= to);
        inside.map(|instant| instant.displacements[middle][0].abs()).fold(0.0, f64::max)
    };
    (swing(10.0 * periods - 5.0, 10.0 * periods) / swing(0.0, 5.0), film.last().energy)
}

/// `exp(-xi w t)` with `xi w = a / 2` and `b w^2 / 2`, between swings that are 5 periods less a half apart.
#[test]
fn rayleigh_damping_has_its_two_rates() {
    let frequency = 2.0 * PI / 10.0;
    let time = 45.0;
    for (mass, stiffness) in [(0.02, 0.0), (0.0, 0.05), (0.01, 0.03)] {
        let rate = 0.5 * mass + 0.5 * stiffness * frequency * frequency;
        let (ratio, energy) = decay(RayleighDamping { mass, stiffness }, BulkViscosity::default(), 5.0);
        assert!((ratio.ln() / -(rate * time) - 1.0).abs() < 0.02, "{mass} {stiffness}: {ratio}");
        assert!(energy.damping > 0.0, "{energy:?}");
        let quantity = "residual of the energy balance, vibrating bar with Rayleigh damping";
        Claim::of("H-13", quantity).error(energy.largest_relative_residual()).within(1e-2);
    }
}

/// Linear bulk viscosity is a modulus `b1 rho l c` against rates of volume: `xi w = b1 l k^2 c / 2`.
#[test]
fn bulk_viscosity_has_its_rate_and_leaves_shear_alone() {
    let viscosity = BulkViscosity { linear: 0.3, quadratic: 0.0 };
    let (ratio, energy) = decay(RayleighDamping::default(), viscosity, 5.0);
    // Elements, not points: those of the bar are twice as long as their points are apart.
    let (wave, length): (f64, f64) = (PI / 10.0, 0.5);
    let rate = 0.5 * 0.3 * length * 2.0 * wave * wave;
    assert!((ratio.ln() / -(rate * 45.0) - 1.0).abs() < 0.02, "{ratio}");
    let quantity = "residual of the energy balance, vibrating bar with bulk viscosity";
    Claim::of("H-13", quantity).error(energy.largest_relative_residual()).within(1e-2);
    let shock = BulkViscosity { linear: 0.0, quadratic: 1.2 };
    assert!(decay(RayleighDamping::default(), shock, 2.0).0 > 0.99, "small rates are hardly damped");
}
