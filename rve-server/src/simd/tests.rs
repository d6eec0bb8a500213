//! Lanes do what single numbers do, bit for bit.

use super::*;
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
}
