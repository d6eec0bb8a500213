//! Lanes do what single numbers do, bit for bit, with every set of instructions (S-15).

use super::backend::Backend;
use super::*;
use crate::definition::NormalStiffness;
use crate::law::{LinearSprings, PlainLinear};
use crate::space::{Discs, Spheres};
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

    /// Whether some lane, all or none are near the limit: each gets what the definition gives, to the bit.
    #[test]
    fn cuts_to_a_limit_are_those_of_the_definition_whoever_is_beside(
        shares in proptest::array::uniform8(prop_oneof![
            Just(0.0), Just(1.0), 0.0..0.99f64, 0.994..0.996f64, 0.9989..0.9991f64, 1.0..3.0f64,
            (-4..5i32).prop_map(|steps| 1.0 + f64::from(steps) * f64::EPSILON),
        ]),
        way in proptest::array::uniform3(-1.0..1.0f64), limit in prop_oneof![Just(0.0), 1e-9..1e3f64],
    ) {
        const NEAR: f64 = 0.999;
        let norm = Spheres::length(way).max(1e-3);
        let of_lane = |lane: usize| way.map(|component| component / norm * (shares[lane] * limit));
        let mut all = [Lanes::<8>::default(); 3];
        for lane in 0..8 {
            for (all, own) in all.iter_mut().zip(of_lane(lane)) {
                all.set_lane(lane, own);
            }
        }
        let cut = Spheres::shortened(all, Lanes::splat(limit), NEAR);
        for lane in 0..8 {
            let given = of_lane(lane);
            let length = Spheres::length(given);
            let kept = if limit < length { given.map(|component| component * (limit / length)) } else { given };
            prop_assert_eq!(cut.kept.map(|component| component[lane]), kept);
            prop_assert_eq!(cut.at_limit.lane(lane), limit * NEAR <= length, "{} of {}", length, limit);
            prop_assert_eq!(cut.lost[lane], Tuple::<f64>::dot(kept, given.minus(kept)));
        }
    }
}

const LAW: PlainLinear =
    PlainLinear::plain(LinearSprings { normal: NormalStiffness::Constant(1.0), stiffness_ratio: 0.25 }, 0.5);

/// What three couples of unit discs lose that carried these tangential forces and have moved apart; in a second lane the
/// first couple still touches.
fn opening_loss<R: Real>(forces: [f64; 3], backend: Backend) -> f64 {
    let still = Grain::<Discs, R>::empty();
    let mut grains = vec![still; 6];
    let mut contacts = vec![Contact::<Discs, PlainLinear, R>::none(); 3];
    for (couple, force) in forces.into_iter().enumerate() {
        let mut distance = R::splat(2.5);
        if couple == 0 && R::LANES > 1 {
            distance.set_lane(1, 1.9);
        }
        grains[2 * couple].position = [R::default(), R::splat(10.0 * couple as f64)];
        grains[2 * couple + 1].position = [distance, R::splat(10.0 * couple as f64)];
        contacts[couple].direction = [R::splat(1.0), R::default()];
        contacts[couple].tangential_force = [R::splat(force)];
    }
    let data = StepData {
        law: &LAW,
        grain_constants: &[GrainConstants::default(); 6],
        grains: &mut grains,
        pairs: &[0, 2, 4].map(|origin| ListedPair { origin, end: origin + 1, image: 0 }),
        pair_constants: &[PairConstants::new(&LAW, [1.0, 1.0]); 3],
        contacts: &mut contacts,
        groups: &mut [],
        live: &mut [true; 3],
        limit_counts: &mut [R::default(); 3],
        sampling: R::default(),
        images: &[Tuple::zero()],
        wanted: Wanted::default(),
    };
    let mut groups = Vec::new();
    if R::LANES == 1 {
        pack(&data, &mut groups);
    }
    let sums = backend.evaluate(&mut StepData { groups: &mut groups, ..data });
    sums.opening_loss.lane(0)
}

/// Losses of contacts that open in one step are added in key order, whoever else is near: 2 + e + e is 2, e + e + 2 is not.
#[test]
fn losses_of_openings_have_one_order() {
    let small = 1.25 / f64::from(1 << 27);
    for backend in Backend::ALL {
        assert_eq!(opening_loss::<f64>([1.0, small, small], backend).to_bits(), 2.0f64.to_bits());
        assert_eq!(opening_loss::<Lanes<8>>([1.0, small, small], backend).to_bits(), 2.0f64.to_bits());
    }
}
