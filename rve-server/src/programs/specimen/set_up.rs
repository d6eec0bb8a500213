//! Parts of the start of a specimen test: its walls, what it takes over from the packing, its motion.

use super::SpecimenSpace;
use super::assembly::{Assembled, History};
use super::contact::Grain;
use super::dynamics::Motion;
use super::test_file::SpecimenTest;
use super::wall::{Wall, WallDrive};
use crate::contact::{ContactLaw, Rotations};
use crate::simd::Tuple;
use crate::space::Components;

/// Walls at rest that touch the outermost grains.
pub(super) struct SurroundingWalls<S: SpecimenSpace, C: ContactLaw<S>> {
    /// Lower and upper wall of one walled axis after the other.
    pub(super) walls: Vec<Wall<S, C>>,
    /// Numbers of the lower and upper wall of every walled axis.
    pub(super) numbers: [Option<[usize; 2]>; 3],
    /// Side lengths of the box between the walls, m; those of the assembled packing along periodic axes.
    pub(super) sides: [f64; 3],
}

impl<S: SpecimenSpace, C: ContactLaw<S>> SurroundingWalls<S, C> {
    /// Those of a test around grains whose contact law is `law`; no axis that is `periodic` has walls.
    pub(super) fn of(test: &SpecimenTest, assembled: &Assembled<S>, periodic: [bool; 3], law: C) -> Self {
        let wall_law = law.with_friction(test.walls.friction);
        let mut around = Self { walls: Vec::new(), numbers: [None; 3], sides: assembled.sides };
        for axis in (0..S::DIMENSION).filter(|axis| !periodic[*axis]) {
            let (low, high) = (surface(&assembled.grains, axis, -1.0), surface(&assembled.grains, axis, 1.0));
            around.sides[axis] = high - low;
            around.numbers[axis] = Some([around.walls.len(), around.walls.len() + 1]);
            for (place, sign, end) in [(low, 1.0, "low"), (high, -1.0, "high")] {
                let unit = <S::Coordinates<f64>>::build(|i| if i == axis { 1.0 } else { 0.0 });
                let name = format!("{} {end}", ["x", "y", "z"][axis]);
                let (point, normal) = (unit.scaled(place), unit.scaled(sign));
                let still = WallDrive::Velocity(0.0);
                around.walls.push(Wall::new(&name, point, normal, wall_law, still, test.contact.damping));
            }
        }
        around
    }
}

/// Coordinate of the outermost point of all grains along an axis, m: the highest for a `sign` of 1, the lowest for -1.
fn surface<S: SpecimenSpace>(grains: &[Grain<S>], axis: usize, sign: f64) -> f64 {
    let far = |grain: &Grain<S>| sign * grain.position.as_ref()[axis] + grain.radius;
    sign * grains.iter().map(far).fold(f64::NEG_INFINITY, f64::max)
}

/// Periods with three components each, m; zero where an axis is not periodic.
pub(super) fn in_three_axes<S: SpecimenSpace>(periods: &[Option<S::Vector>; 3]) -> [[f64; 3]; 3] {
    periods.map(|period| {
        let parts = period.map(|period| period.components().to_vec()).unwrap_or_default();
        std::array::from_fn(|along| parts.get(along).copied().unwrap_or(0.0))
    })
}

/// Drops all histories where contacts have no tangential springs: nothing could ever change them, as in cells. Returns their number.
pub(super) fn drop_springless_histories<S: SpecimenSpace>(
    test: &SpecimenTest,
    histories: &mut Vec<History<S>>,
) -> usize {
    if test.contact.has_tangential_springs() { 0 } else { std::mem::take(histories).len() }
}

/// The motion that a test asks for.
pub(super) fn motion_of(test: &SpecimenTest) -> Motion {
    Motion {
        gravity: std::array::from_fn(|axis| test.motion.gravity.get(axis).copied().unwrap_or(0.0)),
        local_damping: test.motion.local_damping,
        safety: test.motion.safety,
        step: test.motion.step,
        rotations_free: test.contact.rotations == Rotations::Free,
        scaled_masses: test.motion.scaled_masses,
    }
}
