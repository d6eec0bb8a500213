//! Lanes do what single numbers do, bit for bit, with every set of instructions.

use super::*;
use crate::space::Spheres;
use proptest::prelude::*;

proptest! {
    /// Every operation, lane by lane, on random and on awkward numbers.
    #[test]
    fn lanes_compute_what_single_numbers_compute(
        a in proptest::array::uniform8(any::<f64>()), b in proptest::array::uniform8(any::<f64>()),
        c in proptest::array::uniform8(-1e3..1e3f64),
    ) {
        let (x, y, z) = (Lanes(a), Lanes(b), Lanes(c));
        let mask = x.less(y);
        for lane in 0..8 {
            let (p, q, r) = (a[lane], b[lane], c[lane]);
            let found = [
                x + y, x - y, x * y, x / y, -x, x.mul_add(y, z), z.abs().sqrt(), x.larger(y), x.smaller(y),
                z.held_within(Lanes::splat(1.5)), Lanes::select(mask, x, z), Lanes::select(x.at_most(y) & !mask, x, z),
            ];
            let expected = [
                p + q, p - q, p * q, p / q, -p, p.mul_add(q, r), r.abs().sqrt(), if p < q { q } else { p },
                if q < p { q } else { p }, r.clamp(-1.5, 1.5), if p < q { p } else { r }, if p == q { p } else { r },
            ];
            for (found, expected) in found.iter().zip(expected) {
                prop_assert!(found[lane].to_bits() == expected.to_bits() || (found[lane].is_nan() && expected.is_nan()));
            }
        }
        prop_assert_eq!(mask.any(), a.iter().zip(&b).any(|(p, q)| p < q));
    }

    /// In space: a force carried along a turning normal keeps its length, stays across the normal, and a rigid turn of
    /// everything turns it likewise.
    #[test]
    fn forces_are_carried_along_rigidly(
        axis in proptest::array::uniform3(-1.0..1.0f64), angle in -0.02..0.02f64, start in proptest::array::uniform3(-1.0..1.0f64),
    ) {
        let size = axis.dot(axis).sqrt();
        prop_assume!(size > 0.1 && start.dot(start) > 0.1);
        let axis = axis.scaled(1.0 / size);
        let before = start.scaled(1.0 / start.dot(start).sqrt());
        let turn = |v: [f64; 3]| {
            let across = Spheres::cross(axis, v);
            Spheres::cross(axis, across).scaled_plus(2.0 * (0.5 * angle).sin().powi(2), across.scaled_plus(angle.sin(), v))
        };
        let force = Spheres::across([0.3, -0.7, 0.2], before);
        let after = turn(before);
        let sine = Spheres::cross(before, after);
        let carried = Spheres::carried(force, sine, sine.dot(sine), after, axis.scaled(angle));
        prop_assert!(carried.dot(after).abs() < 1e-15);
        let expected = turn(force);
        let miss = carried.minus(expected);
        // The two rotations, along the normal's way and then about the normal, differ from the one in space by half of
        // their commutator: second order in the angle.
        prop_assert!(miss.dot(miss).sqrt() < angle * angle + 1e-15, "{miss:?}");
        prop_assert!((Spheres::length(carried) - Spheres::length(force)).abs() < 1e-14);
    }
}
