//! Discs in a plane.

use super::plane::{self, Plane};
use super::{PolarParts, Space};

/// Discs in a plane. Rotations, moments and tangential forces are single numbers, counter-clockwise positive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Discs;

impl Space for Discs {
    const DIMENSION: usize = 2;
    const GRAINS: &'static str = "discs";
    const INERTIA_FACTOR: f64 = 0.5;
    type Kernel = Self;
    /// A tangential force is the same number whichever way the contact points.
    type Carrier = ();
    type Vector = [f64; 2];
    type Shift = [i32; 2];
    type Tensor = Plane;
    type Spin = f64;
    type Tangential = f64;
    type Grain = [f64; 3];
    /// Angle, rad.
    type Turn = f64;

    fn grain([x, y]: [f64; 2], radius: f64) -> [f64; 3] {
        [x, y, radius]
    }

    fn grain_measure(radius: f64) -> f64 {
        std::f64::consts::PI * radius * radius
    }

    fn shift(component: impl FnMut(usize) -> i32) -> [i32; 2] {
        std::array::from_fn(component)
    }

    fn cofactors([[a, b], [c, d]]: &Plane) -> Plane {
        [[*d, -c], [-b, *a]]
    }

    fn contact_force([x, y]: [f64; 2], normal: f64, tangential: f64) -> [f64; 2] {
        [normal * x - tangential * y, normal * y + tangential * x]
    }

    fn seen_from(tangential: f64, _is_swapped: bool) -> f64 {
        tangential
    }

    fn contact_moment(_direction: [f64; 2], tangential: f64) -> f64 {
        tangential
    }

    fn axial(spin: f64) -> [f64; 1] {
        [spin]
    }

    fn spin([axial]: [f64; 1]) -> f64 {
        axial
    }

    fn to_axial(tangential: f64, _direction: [f64; 2]) -> [f64; 1] {
        [tangential]
    }

    fn from_axial([axial]: [f64; 1], _direction: [f64; 2]) -> f64 {
        axial
    }

    fn slip(before: [f64; 2], direction: [f64; 2], length: f64, arms: [f64; 2], spins: [f64; 2]) -> ([f64; 1], ()) {
        // The branch's own turn is measured as an angle, not as a chord: a rigidly rotating pair then slips by exactly
        // nothing. arcsin by its series; the next term is below rounding for turns under 0.02 rad.
        let sine = before[0] * direction[1] - before[1] * direction[0];
        let sine_square = sine * sine;
        let turn = sine * (1.0 + sine_square * (1.0 / 6.0 + sine_square * 0.075));
        ([length * turn - (arms[0] * spins[0] + arms[1] * spins[1])], ())
    }

    fn carry(_carrier: &(), axial: [f64; 1]) -> [f64; 1] {
        axial
    }

    fn polar(h: &Plane) -> PolarParts<Self> {
        let plane::Polar { angle, strain } = plane::polar(h);
        PolarParts { turn: angle, strain }
    }

    fn rotation_matrix(angle: f64) -> Plane {
        plane::rotation(angle)
    }

    fn rotation_vector(angle: f64) -> f64 {
        angle
    }

    fn turned_tangential(tangential: f64, _matrix: &Plane) -> f64 {
        tangential
    }

    fn turned_spin(spin: f64, _matrix: &Plane) -> f64 {
        spin
    }

    fn spin_in_space(spin: f64) -> [f64; 3] {
        [0.0, 0.0, spin]
    }
}

#[cfg(test)]
mod tests {
    use super::super::tensor::apply;
    use super::*;

    #[test]
    fn contact_force_is_turned_from_normal_and_tangent() {
        let turn = plane::rotation(0.3);
        let force = Discs::contact_force(apply(&turn, [1.0, 0.0]), -2.0, 0.5);
        let expected = apply(&turn, [-2.0, 0.5]);
        assert!((force[0] - expected[0]).abs() < 1e-15 && (force[1] - expected[1]).abs() < 1e-15);
    }
}
