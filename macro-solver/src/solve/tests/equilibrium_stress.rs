//! The stress of a body before its grains: closed forms of level ground and of a long slope.

use super::*;
use crate::element::hourglass::HourglassControl;
use crate::mesh::point_places;
use crate::problem::dynamics::DynamicSettings;
use crate::problem::{
    Amplitude, Applied, EquilibriumSettings, InitialStress, MultiPointConstraint, PressureKind, Procedure,
};
use crate::solve::{EquilibriumError, equilibrium_stress};

const WEIGHT: f64 = 2.0e4;

/// A layer of 3 x 2 m between smooth walls, `weight` per volume, under a pressure on its top.
fn layer(weight: [f64; 3], supports: &[(&str, Axis)], top: f64) -> Problem {
    let mut problem = Problem::new(block(ElementKind::Q8, 3, 2), Vec::new());
    let weight = Condition::BodyForce { elements: "all".into(), value: weight };
    let pressure = Condition::Pressure { sides: "top".into(), value: top, kind: PressureKind::Dead };
    let supports = supports.iter().map(|(set, axis)| Condition::fixed(*set, *axis).into());
    let loads = [Applied::new(weight, Amplitude::Constant), Applied::new(pressure, Amplitude::Constant)];
    problem.stages[0].conditions = supports.chain(loads).collect();
    problem
}

#[test]
fn level_ground_has_its_earth_pressure_at_rest() {
    let problem = layer([0.0, -WEIGHT, 0.0], &[("bottom", Axis::Y), ("left", Axis::X), ("right", Axis::X)], 1e4);
    let settings = EquilibriumSettings { rest_coefficient: 0.4, friction_angle: 30.0 };
    let found = equilibrium_stress(&problem, &settings).unwrap();
    let rest = InitialStress::Geostatic { surface: 2.0, unit_weight: WEIGHT, rest_coefficient: 0.4, surcharge: 1e4 };
    for (point, place) in point_places(&problem.mesh).into_iter().enumerate() {
        let wanted = rest.at(point, place);
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            assert!((found[point][i][j] - wanted[(i, j)]).abs() < 1e-6 * 5e4, "{point} {i}{j}: {found:?}");
        }
    }
    // K0 of 0.2 takes a friction angle of 41.8 degrees; 30 degrees leave 1/3 of the vertical pressure.
    let weak = EquilibriumSettings { rest_coefficient: 0.2, friction_angle: 30.0 };
    for stress in equilibrium_stress(&problem, &weak).unwrap() {
        assert!((stress[0][0] / stress[1][1] - 1.0 / 3.0).abs() < 1e-6, "{stress:?}");
    }
}

/// Dashpots against hourglass modes are for motions; the equilibrium before them was refused.
#[test]
fn a_body_whose_hourglass_modes_are_damped_has_an_equilibrium() {
    let mut problem = layer([0.0, -WEIGHT, 0.0], &[("bottom", Axis::Y), ("left", Axis::X), ("right", Axis::X)], 1e4);
    problem.mesh = block(ElementKind::Q4Single, 3, 2);
    problem.stages[0].procedure = Procedure::Dynamic(Box::new(DynamicSettings::new(2e3)));
    problem.hourglass = HourglassControl::Viscous { coefficient: 0.05 };
    problem.validate().unwrap();
    let settings = EquilibriumSettings { rest_coefficient: 0.4, friction_angle: 30.0 };
    let rest = InitialStress::Geostatic { surface: 2.0, unit_weight: WEIGHT, rest_coefficient: 0.4, surcharge: 1e4 };
    let found = equilibrium_stress(&problem, &settings).unwrap();
    for (point, place) in point_places(&problem.mesh).into_iter().enumerate() {
        assert!((found[point][1][1] - rest.at(point, place)[(1, 1)]).abs() < 1e-5 * 5e4, "{point}: {found:?}");
    }
}

/// Loads in MPa are those in Pa by a power of two or ten: the same stress, in its unit.
#[test]
fn the_stress_does_not_depend_on_the_unit_of_the_loads() {
    let settings = EquilibriumSettings { rest_coefficient: 0.4, friction_angle: 25.0 };
    let found = |unit: f64| {
        let supports = [("bottom", Axis::X), ("bottom", Axis::Y), ("left", Axis::X)];
        equilibrium_stress(&layer([0.0, -WEIGHT * unit, 0.0], &supports, 1e4 * unit), &settings)
    };
    let supported = |unit: f64| {
        let supports = [("bottom", Axis::Y), ("left", Axis::X), ("right", Axis::X)];
        equilibrium_stress(&layer([0.0, -WEIGHT * unit, 0.0], &supports, 1e4 * unit), &settings).unwrap()
    };
    let wanted = supported(1.0);
    for unit in [(-20.0f64).exp2(), (-60.0f64).exp2(), 30f64.exp2()] {
        for (one, other) in supported(unit).iter().flatten().flatten().zip(wanted.iter().flatten().flatten()) {
            assert_eq!(*one, unit * other, "{unit:e}");
        }
        assert_eq!(found(unit).is_ok(), found(1.0).is_ok(), "{unit:e}: a wall is missing");
    }
    for (one, other) in supported(1e-6).iter().flatten().flatten().zip(wanted.iter().flatten().flatten()) {
        assert!((one - 1e-6 * other).abs() < 1e-6 * 5e4 * 1e-6, "{one} {other}");
    }
}

/// Weight at an angle `b` to the normal of a layer whose sides move alike: shear is `tan b` times the normal stress. Plastic flow without change
/// of volume has the principal stresses at 45 degrees to the surface, where the shear is at most `sin(phi)` times the normal stress; so there
/// is an equilibrium up to `tan b = sin(phi)` (Davis 1968), and none above.
#[test]
fn a_long_slope_stands_up_to_the_limit_of_simple_shear() {
    for slope in [10.0f64, 20.0, 30.0] {
        let (sine, cosine) = slope.to_radians().sin_cos();
        let mut problem =
            layer([WEIGHT * sine, -WEIGHT * cosine, 0.0], &[("bottom", Axis::X), ("bottom", Axis::Y)], 0.0);
        let periodic = MultiPointConstraint::Periodic {
            from: "left".into(),
            to: "right".into(),
            jump: [Some(0.0), Some(0.0), None],
        };
        problem.stages[0].conditions.push(Condition::MultiPointConstraint(periodic).into());
        let at = |friction_angle: f64| {
            equilibrium_stress(&problem, &EquilibriumSettings { rest_coefficient: 0.5, friction_angle })
        };
        let limit = slope.to_radians().tan().asin().to_degrees();
        for stress in at(limit + 1.0).unwrap_or_else(|error| panic!("{slope}: {error}")) {
            let ratio = stress[0][1] / -stress[1][1];
            assert!((ratio / slope.to_radians().tan() - 1.0).abs() < 1e-5, "{slope}: {ratio}");
        }
        assert!(matches!(at(limit - 1.0), Err(EquilibriumError::NotFound(_))), "{slope}");
    }
}
