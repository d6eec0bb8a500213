//! How a condition goes over a stage: the factor on its value.

use super::rate_history::RateHistory;
use super::smooth_step::{SmoothRamp, quintic};
use std::f64::consts::{PI, TAU};

/// A moment within a stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Share of the stage that has passed, 0 to 1; the load factor where that is an unknown.
    pub load: f64,
    /// Time since the stage began, s.
    pub time: f64,
}

/// The factor on a condition's value over a stage.
#[derive(Clone, Debug, PartialEq)]
pub enum Amplitude {
    /// 1 throughout.
    Constant,
    /// From one factor to another, linear in the share of the stage.
    Ramp {
        /// At load 0.
        from: f64,
        /// At load 1.
        to: f64,
    },
    /// From one factor to another by `10 x^3 - 15 x^4 + 6 x^5` of the share `x` of the stage: at rest and without
    /// acceleration at both ends.
    Smooth {
        /// At load 0.
        from: f64,
        /// At load 1.
        to: f64,
    },
    /// From one factor to another at a constant rate, which is reached and left smoothly.
    SmoothRamp {
        /// At load 0.
        from: f64,
        /// At load 1.
        to: f64,
        /// Where the rate is reached and left.
        shape: SmoothRamp,
    },
    /// Straight lines between points `(s since the stage began, factor)`; before the first and after the last point the
    /// factor of that point.
    Table(Vec<[f64; 2]>),
    /// `sin(2 pi f t + phase)`.
    Sine {
        /// f, Hz.
        frequency: f64,
        /// At the beginning of the stage, rad.
        phase: f64,
    },
    /// The integral of another history over time: what is prescribed is a velocity or an acceleration.
    Rate(Box<RateHistory>),
}

impl Amplitude {
    /// From 0 to 1.
    pub const RAMP: Self = Self::Ramp { from: 0.0, to: 1.0 };
    /// From 0 to 1, at rest at both ends.
    pub const SMOOTH: Self = Self::Smooth { from: 0.0, to: 1.0 };

    /// The factor at a moment.
    pub fn factor(&self, moment: Moment) -> f64 {
        match self {
            Self::Constant => 1.0,
            Self::Ramp { from, to } => from + (to - from) * moment.load,
            Self::Smooth { from, to } => from + (to - from) * quintic(moment.load, 0),
            Self::SmoothRamp { from, to, shape } => from + (to - from) * shape.integral(moment.load, 0),
            Self::Table(points) => interpolated(points, moment.time),
            Self::Sine { frequency, phase } => (TAU * frequency * moment.time + phase).sin(),
            Self::Rate(rate) => rate.factor(moment),
        }
    }

    /// The factor at a moment that may lie after the stage, as the velocity of a support in its last instant needs it: histories that would
    /// stop with the stage, at a rate that is not zero, go on as they came over as long a time before.
    pub(crate) fn continued(&self, moment: Moment) -> f64 {
        // Rounding puts the last instant itself a little after the end.
        if moment.load <= 1.0 + 1e-9 {
            return self.factor(moment);
        }
        let end = Moment { load: 1.0, time: moment.time / moment.load };
        let stops = match self {
            Self::SmoothRamp { shape, .. } => shape.stop == 0.0,
            Self::Table(points) => points.last().is_some_and(|[last, _]| *last <= end.time * (1.0 + 1e-9)),
            Self::Constant | Self::Ramp { .. } | Self::Smooth { .. } | Self::Sine { .. } | Self::Rate(_) => false,
        };
        if !stops {
            return self.factor(moment);
        }
        let mirrored = Moment { load: 2.0 - moment.load, time: 2.0 * end.time - moment.time };
        2.0 * self.factor(end) - self.factor(mirrored)
    }

    /// Change of the factor per second at the beginning of a stage, of histories made to begin with a certain one; `None` for the others,
    /// whose supports begin with the mean velocity of the first step.
    pub fn rate_at_start(&self) -> Option<f64> {
        match self {
            Self::Smooth { .. } => Some(0.0),
            Self::SmoothRamp { shape, .. } => (shape.start > 0.0).then_some(0.0),
            Self::Rate(rate) => Some(rate.at_start()),
            Self::Constant | Self::Ramp { .. } | Self::Table(_) | Self::Sine { .. } => None,
        }
    }

    /// Whether it may begin without any change, so that a load factor that is an unknown would change nothing.
    pub(crate) fn may_begin_at_rest(&self) -> bool {
        matches!(self, Self::Smooth { .. } | Self::SmoothRamp { .. } | Self::Rate(_))
    }

    /// Whether it grows from 0 in proportion to the share of the stage.
    pub(crate) fn is_proportional(&self) -> bool {
        matches!(self, Self::Ramp { from, .. } if *from == 0.0)
    }

    /// The way from `from` to nothing of what is replaced by a load with this history; `None` where that replaces it at once.
    pub fn fading(&self, from: f64) -> Option<Self> {
        let grows = |start: f64, end: f64| (start, end) == (0.0, 1.0);
        match self {
            Self::Ramp { from: start, to } if grows(*start, *to) => Some(Self::Ramp { from, to: 0.0 }),
            Self::Smooth { from: start, to } if grows(*start, *to) => Some(Self::Smooth { from, to: 0.0 }),
            Self::SmoothRamp { from: start, to, shape } if grows(*start, *to) => {
                Some(Self::SmoothRamp { from, to: 0.0, shape: *shape })
            }
            Self::Constant
            | Self::Ramp { .. }
            | Self::Smooth { .. }
            | Self::SmoothRamp { .. }
            | Self::Table(_)
            | Self::Sine { .. }
            | Self::Rate(_) => None,
        }
    }

    /// Shares of a stage of this duration, s, at which it turns from a rise to a fall or back at once, the first `most` in ascending order: extremes of
    /// a sine, peaks of a table. A plateau as long as a step has a step that ends on it anyway. Those of prescribed velocities and accelerations are left out.
    pub fn turns(&self, duration: f64, most: usize) -> Vec<f64> {
        let within = |share: &f64| 0.0 < *share && *share < 1.0;
        match self {
            Self::Table(points) => {
                let slope = |from: &[f64; 2], to: &[f64; 2]| (to[1] - from[1]) / (to[0] - from[0]);
                let turns = points.windows(3).filter(|three| {
                    let [before, after] = [slope(&three[0], &three[1]), slope(&three[1], &three[2])];
                    before * after < 0.0
                });
                turns.map(|three| three[1][0] / duration).filter(within).take(most).collect()
            }
            Self::Sine { frequency, phase } => {
                let first = (phase / PI - 0.5).floor();
                let extreme =
                    |number: usize| ((first + number as f64 + 0.5) * PI - phase) / (TAU * frequency * duration);
                (0..).map(extreme).take_while(|share| *share < 1.0).filter(within).take(most).collect()
            }
            Self::Constant | Self::Ramp { .. } | Self::Smooth { .. } | Self::SmoothRamp { .. } | Self::Rate(_) => {
                Vec::new()
            }
        }
    }

    /// Whether it stays between 0 and 1, as the way from one friction to another has to.
    pub(crate) fn stays_between_0_and_1(&self) -> bool {
        let lies = |factor: &f64| (0.0..=1.0).contains(factor);
        match self {
            Self::Constant => true,
            Self::Ramp { from, to } | Self::Smooth { from, to } | Self::SmoothRamp { from, to, .. } => {
                lies(from) && lies(to)
            }
            Self::Table(points) => points.iter().all(|[_, factor]| lies(factor)),
            Self::Sine { .. } | Self::Rate(_) => false,
        }
    }

    /// What is wrong with it, if anything.
    pub fn defect(&self) -> Option<&'static str> {
        match self {
            Self::Constant => None,
            Self::Ramp { from, to } | Self::Smooth { from, to } => {
                (!(from.is_finite() && to.is_finite())).then_some("ramps are finite")
            }
            Self::SmoothRamp { from, to, shape } => {
                shape.defect().or((!(from.is_finite() && to.is_finite())).then_some("ramps are finite"))
            }
            Self::Table(points) if points.is_empty() => Some("a table has at least one point"),
            Self::Table(points) if points.iter().flatten().any(|number| !number.is_finite()) => {
                Some("the numbers of a table are finite")
            }
            Self::Table(points) => {
                points.windows(2).any(|pair| pair[1][0] <= pair[0][0]).then_some("the times of a table increase")
            }
            Self::Sine { frequency, phase } => (!(*frequency > 0.0 && frequency.is_finite() && phase.is_finite()))
                .then_some("the frequency of a sine is above 0 Hz and its phase is finite"),
            Self::Rate(rate) => rate.defect(),
        }
    }
}

pub(super) fn interpolated(points: &[[f64; 2]], time: f64) -> f64 {
    let after = points.partition_point(|point| point[0] <= time);
    match (after.checked_sub(1).map(|before| points[before]), points.get(after)) {
        (Some([from, low]), Some([to, high])) => low + (high - low) * ((time - from) / (to - from)),
        (Some([_, factor]), None) | (None, Some(&[_, factor])) => factor,
        (None, None) => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn factor(amplitude: &Amplitude, load: f64, duration: f64) -> f64 {
        amplitude.factor(Moment { load, time: load * duration })
    }

    #[test]
    fn factors_follow_load_or_time() {
        assert_eq!(factor(&Amplitude::Constant, 0.3, 2.0), 1.0);
        for load in [0.0, 0.1, 1.0 / 3.0, 1.0] {
            assert_eq!(factor(&Amplitude::RAMP, load, 7.0), load, "bit for bit");
        }
        assert_eq!(factor(&Amplitude::Ramp { from: 1.0, to: 0.0 }, 0.25, 1.0), 0.75);
        let table = Amplitude::Table(vec![[1.0, 2.0], [3.0, -2.0]]);
        let at = |time: f64| factor(&table, time / 4.0, 4.0);
        assert_eq!([at(0.0), at(1.0), at(1.5), at(2.0), at(3.0), at(4.0)], [2.0, 2.0, 1.0, 0.0, -2.0, -2.0]);
        let sine = Amplitude::Sine { frequency: 0.5, phase: 0.0 };
        assert!((factor(&sine, 0.125, 2.0) - 0.5f64.sqrt()).abs() < 1e-15 && factor(&sine, 0.0, 2.0) == 0.0);
    }

    #[test]
    fn tables_turn_between_a_rise_and_a_fall_and_sines_at_their_extremes() {
        let table = |points: &[[f64; 2]]| Amplitude::Table(points.to_vec()).turns(2.0, 9);
        assert_eq!(table(&[[0.0, 0.0], [0.5, 1.0], [1.0, 2.0], [1.5, 0.0], [3.0, 1.0]]), [0.5, 0.75]);
        assert_eq!(table(&[[0.0, 0.0], [0.5, 1.0], [1.0, 1.0], [1.5, 0.0]]), Vec::<f64>::new(), "a plateau");
        assert_eq!(table(&[[0.0, 1.0], [1.0, 2.0]]), Vec::<f64>::new());
        let sine = Amplitude::Sine { frequency: 1.0, phase: 0.0 }.turns(2.0, 9);
        assert!(sine.iter().zip([0.125, 0.375, 0.625, 0.875]).all(|(found, share)| (found - share).abs() < 1e-12));
        assert_eq!((sine.len(), Amplitude::RAMP.turns(1.0, 9).len()), (4, 0));
        let shifted = Amplitude::Sine { frequency: 0.25, phase: -0.5 * PI }.turns(2.0, 9);
        assert_eq!(shifted, Vec::<f64>::new(), "from one extreme to the next");
        assert_eq!(Amplitude::Sine { frequency: 1e9, phase: 1.0 }.turns(1e3, 3).len(), 3);
    }

    /// After the stage: what stops with it at a rate goes on at that rate, everything else as it is.
    #[test]
    fn histories_that_stop_with_the_stage_go_on_as_they_came() {
        let after = |amplitude: &Amplitude| amplitude.continued(Moment { load: 1.1, time: 2.2 });
        let ending = Amplitude::Table(vec![[0.0, 0.0], [1.0, 3.0], [2.0, 2.0]]);
        assert!((after(&ending) - 1.8).abs() < 1e-15, "{}", after(&ending));
        assert_eq!(after(&Amplitude::Table(vec![[0.0, 0.0], [1.0, 3.0]])), 3.0);
        let longer = Amplitude::Table(vec![[0.0, 0.0], [2.0, 2.0], [4.0, 0.0]]);
        assert!((after(&longer) - 1.8).abs() < 1e-15, "{}", after(&longer));
        let ramp = |stop| Amplitude::SmoothRamp { from: 1.0, to: 3.0, shape: SmoothRamp { start: 0.5, stop } };
        let rate = 2.0 / 0.75;
        assert!((after(&ramp(0.0)) - (3.0 + 0.1 * rate)).abs() < 1e-14, "{}", after(&ramp(0.0)));
        assert_eq!([after(&ramp(0.5)), after(&Amplitude::SMOOTH)], [3.0, 1.0]);
        let at_the_end = Moment { load: 1.0 + 1e-15, time: 2.0 };
        assert_eq!([ramp(0.0).continued(at_the_end), ending.continued(at_the_end)], [3.0, 2.0]);
    }

    #[test]
    fn defects_are_told() {
        assert!(Amplitude::RAMP.defect().is_none() && Amplitude::Constant.defect().is_none());
        assert!(Amplitude::Table(Vec::new()).defect().unwrap().contains("at least one"));
        assert!(Amplitude::Table(vec![[1.0, 0.0], [1.0, 1.0]]).defect().unwrap().contains("increase"));
        assert!(Amplitude::Table(vec![[0.0, f64::NAN]]).defect().unwrap().contains("finite"));
        assert!(Amplitude::Sine { frequency: 0.0, phase: 0.0 }.defect().unwrap().contains("above 0"));
    }
}
