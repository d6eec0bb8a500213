//! Ways from 0 to 1 without jumps of velocity and acceleration, and their integrals.

/// The `n`-th integral from 0 to `x` of the smooth step `10 x^3 - 15 x^4 + 6 x^5` (0 before 0, 1 after 1), for `n` up to 2. Its first and
/// second derivatives vanish at 0 and at 1.
pub(super) fn quintic(x: f64, n: usize) -> f64 {
    let inside = x.clamp(0.0, 1.0);
    let integrals = [
        inside.powi(3) * (10.0 + inside * (-15.0 + 6.0 * inside)),
        inside.powi(4) * (2.5 + inside * (inside - 3.0)),
        inside.powi(5) * (0.5 + inside * (inside / 7.0 - 0.5)),
    ];
    beyond(integrals, x - inside)[n.min(2)]
}

/// A way from 0 to 1 at a constant rate. Over the first part of the stage the rate grows from 0 by `3 s^2 - 2 s^3` of the share `s` of that
/// part, over the last one it falls to 0 likewise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmoothRamp {
    /// Share of the stage over which the rate is reached, 0 to 1.
    pub start: f64,
    /// Share of the stage over which it is left.
    pub stop: f64,
}

/// `n`-th integrals from 0 to 1 of `3 s^2 - 2 s^3`, for n of 1 to 3.
const WHOLE: [f64; 3] = [0.5, 0.15, 1.0 / 30.0];

impl SmoothRamp {
    /// What is wrong with it, if anything.
    pub(super) fn defect(&self) -> Option<&'static str> {
        let (start, stop) = (self.start, self.stop);
        let sound = start >= 0.0 && stop >= 0.0 && start + stop <= 1.0;
        (!sound)
            .then_some("start and stop of a smooth ramp are shares of the stage, at least 0 and together at most 1")
    }

    /// The `n`-th integral from 0 to the share `x` of the stage, for `n` up to 2; 0 before the stage, 1 after it.
    pub(super) fn integral(&self, x: f64, n: usize) -> f64 {
        let inside = x.clamp(0.0, 1.0);
        beyond(self.integrals(inside), x - inside)[n.min(2)]
    }

    fn integrals(&self, x: f64) -> [f64; 3] {
        let (a, b) = (self.start, self.stop);
        // Constant rate in the middle: what is lost at both ends is made good for.
        let rate = 1.0 / (1.0 - 0.5 * (a + b));
        if x < a {
            let [one, two, three] = of_rising_rate(x / a);
            return [rate * a * one, rate * a * a * two, rate * a.powi(3) * three];
        }
        let middle = |y: f64| {
            [
                rate * (WHOLE[0] * a + y),
                rate * (WHOLE[1] * a * a + y * (WHOLE[0] * a + 0.5 * y)),
                rate * (WHOLE[2] * a.powi(3) + y * (WHOLE[1] * a * a + y * (0.25 * a + y / 6.0))),
            ]
        };
        if x <= 1.0 - b {
            return middle(x - a);
        }
        // Seen from the end, the rest of the way is a rising one.
        let (begin, w) = (middle(1.0 - b - a), x - (1.0 - b));
        let [one, two, three] = of_rising_rate((1.0 - x) / b);
        [
            1.0 - rate * b * one,
            begin[1] + w - rate * b * b * (WHOLE[1] - two),
            begin[2] + w * (begin[1] + 0.5 * w) - rate * b * b * (WHOLE[1] * w - b * (WHOLE[2] - three)),
        ]
    }
}

/// First to third integral from 0 to `s` of `3 s^2 - 2 s^3`.
fn of_rising_rate(s: f64) -> [f64; 3] {
    [s.powi(3) * (1.0 - 0.5 * s), s.powi(4) * (0.25 - 0.1 * s), s.powi(5) * (0.05 - s / 60.0)]
}

/// Values and integrals at `more` after the end of a way, where it stays at 1; as they are for none.
fn beyond([value, one, two]: [f64; 3], more: f64) -> [f64; 3] {
    let more = more.max(0.0);
    [value, one + more, two + more * (one + 0.5 * more)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ends, and that every integral has the one before as its derivative; the rate of the way itself never jumps.
    #[test]
    fn ways_lead_from_0_to_1_and_integrals_fit() {
        let shapes = [(0.05, 0.0), (0.0, 0.3), (0.5, 0.5), (0.2, 0.3), (0.0, 0.0), (1.0, 0.0)];
        let ramps = shapes.map(|(start, stop)| SmoothRamp { start, stop });
        let mut ways: Vec<Box<dyn Fn(f64, usize) -> f64>> = vec![Box::new(quintic)];
        ways.extend(ramps.map(|ramp| Box::new(move |x, n| ramp.integral(x, n)) as Box<dyn Fn(f64, usize) -> f64>));
        let width = 1e-5;
        for (number, way) in ways.iter().enumerate() {
            assert_eq!([way(0.0, 0), way(1.0, 0), way(-0.1, 0), way(1.1, 0)], [0.0, 1.0, 0.0, 1.0], "{number}");
            for k in 1..120 {
                let x = f64::from(k) / 100.0;
                for n in [1, 2] {
                    let slope = (way(x + width, n) - way(x - width, n)) / (2.0 * width);
                    assert!((slope - way(x, n - 1)).abs() < 2e-5, "{number}: integral {n} at {x}: {slope}");
                }
                assert!(way(x, 0) >= way(x - 0.01, 0), "{number} turns back at {x}");
            }
        }
    }

    /// Rates by differences: 0 at the ends, the constant one in the middle, 1 / (1 - 0.05 / 2) for a start of 0.05.
    #[test]
    fn rates_are_reached_and_left_smoothly() {
        let rate = |way: &dyn Fn(f64) -> f64, x: f64| (way(x + 1e-6) - way(x - 1e-6)) / 2e-6;
        let step = |x: f64| quintic(x, 0);
        assert!(rate(&step, 0.0) < 1e-9 && rate(&step, 1.0) < 1e-9 && (rate(&step, 0.5) - 1.875).abs() < 1e-8);
        let early = SmoothRamp { start: 0.05, stop: 0.0 };
        let way = |x: f64| early.integral(x, 0);
        let constant = 1.0 / 0.975;
        assert!((rate(&way, 0.06) - constant).abs() < 1e-8 && (rate(&way, 0.99) - constant).abs() < 1e-8);
        // Half of the rate at half of the start.
        assert!((rate(&way, 0.025) - 0.5 * constant).abs() < 1e-8 && rate(&way, 0.0) < 1e-6);
    }

    #[test]
    fn shares_that_do_not_fit_are_told() {
        for (start, stop) in [(-0.1, 0.0), (0.6, 0.5), (f64::NAN, 0.0), (0.0, f64::INFINITY)] {
            assert!(SmoothRamp { start, stop }.defect().unwrap().contains("together at most 1"));
        }
        assert!(SmoothRamp { start: 0.5, stop: 0.5 }.defect().is_none());
    }
}
