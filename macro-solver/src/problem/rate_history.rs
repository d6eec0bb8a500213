//! Prescribed velocities and accelerations: histories that are integrated over time exactly, piece by piece.

use super::amplitude::{Amplitude, Moment, interpolated};
use super::smooth_step::quintic;
use std::f64::consts::TAU;

/// What is prescribed in place of a displacement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rate {
    /// m/s.
    Velocity,
    /// m/s2, from rest.
    Acceleration,
}

/// A history whose value is a velocity or an acceleration. The factor is its integral over the time since the stage began, s, or
/// the second one, s2.
#[derive(Clone, Debug, PartialEq)]
pub struct RateHistory {
    rate: Rate,
    history: Amplitude,
    /// Of a table: its knots with what has been integrated up to them.
    knots: Vec<Knot>,
}

/// A knot of a table within a stage.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Knot {
    /// s since the stage began.
    time: f64,
    /// Factor, its integral and its second integral up to this time.
    values: [f64; 3],
}

impl Knot {
    /// What a straight line from here to `factor` at `time` adds up to.
    fn to(&self, time: f64, factor: f64) -> Self {
        let (h, [from, once, twice]) = (time - self.time, self.values);
        let values = [factor, once + 0.5 * h * (from + factor), twice + h * (once + h * (2.0 * from + factor) / 6.0)];
        Self { time, values }
    }
}

impl RateHistory {
    /// The integral of a history.
    pub fn new(rate: Rate, history: Amplitude) -> Self {
        let mut knots = Vec::new();
        if let Amplitude::Table(points) = &history {
            knots.push(Knot { time: 0.0, values: [interpolated(points, 0.0), 0.0, 0.0] });
            for [time, factor] in points.iter().filter(|[time, _]| *time > 0.0) {
                let next = knots[knots.len() - 1].to(*time, *factor);
                knots.push(next);
            }
        }
        Self { rate, history, knots }
    }

    /// What is wrong with it, if anything.
    pub(super) fn defect(&self) -> Option<&'static str> {
        match &self.history {
            Amplitude::Rate(_) => Some("a velocity or an acceleration has a history that is none itself"),
            history => history.defect(),
        }
    }

    /// Velocity at the beginning of the stage for the value 1, m/s.
    pub(super) fn at_start(&self) -> f64 {
        match self.rate {
            Rate::Velocity => self.history.factor(Moment { load: 0.0, time: 0.0 }),
            Rate::Acceleration => 0.0,
        }
    }

    /// The integral up to a moment, s for a velocity, s2 for an acceleration.
    pub(super) fn factor(&self, moment: Moment) -> f64 {
        let order = match self.rate {
            Rate::Velocity => 1,
            Rate::Acceleration => 2,
        };
        let Moment { load, time } = moment;
        // Integrals over the share of the stage become ones over time with the length of the stage.
        let over_time = |integral: f64| if load == 0.0 { 0.0 } else { integral * (time / load).powi(order) };
        let constant = [time, 0.5 * time * time][order as usize - 1];
        let n = order as usize;
        match &self.history {
            Amplitude::Constant => constant,
            Amplitude::Ramp { from, to } => {
                let slope = [0.5, 1.0 / 6.0][n - 1] * load * time.powi(order);
                from * constant + (to - from) * slope
            }
            Amplitude::Smooth { from, to } => from * constant + (to - from) * over_time(quintic(load, n)),
            Amplitude::SmoothRamp { from, to, shape } => {
                from * constant + (to - from) * over_time(shape.integral(load, n))
            }
            Amplitude::Table(points) => {
                let before = self.knots.partition_point(|knot| knot.time <= time).max(1) - 1;
                self.knots.get(before).map_or(0.0, |knot| knot.to(time, interpolated(points, time)).values[n])
            }
            Amplitude::Sine { frequency, phase } => {
                let omega = TAU * frequency;
                let now = omega * time + phase;
                match self.rate {
                    Rate::Velocity => (phase.cos() - now.cos()) / omega,
                    Rate::Acceleration => (phase.cos() * time - (now.sin() - phase.sin()) / omega) / omega,
                }
            }
            // Refused as a defect.
            Amplitude::Rate(_) => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::smooth_step::SmoothRamp;
    use super::*;

    const DURATION: f64 = 3.0;

    fn at(history: &Amplitude, time: f64) -> f64 {
        history.factor(Moment { load: time / DURATION, time })
    }

    fn integrated(rate: Rate, history: &Amplitude) -> Amplitude {
        Amplitude::Rate(Box::new(RateHistory::new(rate, history.clone())))
    }

    /// Simpson's rule on pieces that meet every knot is exact to its order.
    #[test]
    fn integrals_agree_with_a_quadrature() {
        let histories = [
            Amplitude::Constant,
            Amplitude::Ramp { from: -1.0, to: 2.0 },
            Amplitude::Smooth { from: 0.5, to: -1.0 },
            Amplitude::SmoothRamp { from: 0.2, to: 1.0, shape: SmoothRamp { start: 0.2, stop: 0.3 } },
            Amplitude::Table(vec![[-0.3, 3.0], [0.3, 1.0], [0.9, -2.0], [1.5, 4.0]]),
            Amplitude::Sine { frequency: 0.7, phase: 0.4 },
        ];
        let pieces = 3000;
        let h = DURATION / f64::from(pieces);
        for history in &histories {
            let (velocity, acceleration) =
                (integrated(Rate::Velocity, history), integrated(Rate::Acceleration, history));
            let (mut once, mut twice) = (0.0, 0.0);
            for piece in 0..pieces {
                let time = f64::from(piece) * h;
                assert!((at(&velocity, time) - once).abs() < 1e-9, "{history:?} at {time}");
                assert!((at(&acceleration, time) - twice).abs() < 1e-9, "{history:?} at {time}");
                let simpson = |f: &dyn Fn(f64) -> f64| h / 6.0 * (f(time) + 4.0 * f(time + 0.5 * h) + f(time + h));
                let before = once;
                once += simpson(&|time| at(history, time));
                let mean = |time: f64| at(&velocity, time) - at(&velocity, h * f64::from(piece)) + before;
                twice += simpson(&mean);
            }
            assert_eq!(velocity.rate_at_start(), Some(at(history, 0.0)));
            assert_eq!(acceleration.rate_at_start(), Some(0.0));
        }
    }

    /// A table of two straight lines, by hand: velocities 0, 2, 2 m/s at 0, 1, 3 s.
    #[test]
    fn a_table_is_integrated_exactly() {
        let table = Amplitude::Table(vec![[0.0, 0.0], [1.0, 2.0]]);
        let velocity = integrated(Rate::Velocity, &table);
        assert_eq!([0.5, 1.0, 3.0].map(|time| at(&velocity, time)), [0.25, 1.0, 5.0]);
        let acceleration = integrated(Rate::Acceleration, &table);
        assert!((at(&acceleration, 3.0) - (1.0 / 3.0 + 2.0 + 4.0)).abs() < 1e-14);
    }

    #[test]
    fn a_rate_of_a_rate_and_a_defect_inside_are_told() {
        let inner = integrated(Rate::Velocity, &Amplitude::Constant);
        assert!(integrated(Rate::Velocity, &inner).defect().unwrap().contains("none itself"));
        let empty = integrated(Rate::Acceleration, &Amplitude::Table(Vec::new()));
        assert!(empty.defect().unwrap().contains("at least one"));
        assert!(inner.defect().is_none());
    }
}
