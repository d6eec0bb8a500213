//! Which step a preparation takes next on its way to the target stress: rules on the history of stress error and pressure alone.

use crate::preparation::servo::{LARGEST_STRAIN, StagnationMonitor};

/// Stress error over pressure below which the servo on spheres learns from its steps: the network's own operator knows no
/// sliding, is much too stiff for shear, and would approach the target by a hundredth of the distance per step.
const CLOSE: f64 = 0.5;

/// Steps without a smaller error after which the servo on spheres uses the network operator again.
const MAX_STALLS: u32 = 12;

/// Careful steps in a row before the servo tries plain ones again.
const CAREFUL_STEPS: u32 = 10;

/// Share of the target pressure below which a cell is simply compressed further, by this strain: spheres at once, discs after
/// [`StepsWithoutPressure::count`] of them in a row, and then by twice as much each time, `SLACK_DOUBLINGS` times.
const SLACK_PRESSURE: f64 = 0.005;
const SLACK_STRAIN: f64 = 1e-4;
const SLACK_DOUBLINGS: i32 = 4;

/// How long a cell of discs that has lost its pressure is left to the operator before it is compressed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum StepsWithoutPressure {
    /// Grains that have just been pressed together: every step without pressure relaxes a cell without load, at the price of a thousand others.
    Few,
    /// A cell whose fabric is to be kept, or from which an anisotropy is searched for, which is then found sooner.
    Many,
}

impl StepsWithoutPressure {
    /// Steps without pressure in a row before a cell of discs is compressed.
    fn count(self) -> i32 {
        match self {
            Self::Few => 2,
            Self::Many => 40,
        }
    }
}

/// Steps in a row, of discs and of spheres, that bring the stress no nearer to the target, by [`STUCK_GAIN`], after which a packing far below its
/// pressure is compressed in the same way: where its network hardly resists some shear, as one of cohesive grains that roll, that shear takes
/// up every step. The servo of stiff spheres creeps for some hundreds of steps and comes to its end.
const STUCK_STEPS: [i32; 2] = [200, 1000];
/// See [`STUCK_STEPS`].
const STUCK_GAIN: f64 = 0.99;
/// Share of the pressure below which, down to [`SLACK_PRESSURE`], such steps count.
const STUCK_PRESSURE: f64 = 0.5;

/// Largest strain component of a servo step on spheres while the stress is far from the target: a network of few contacts
/// says that it is soft, and is not after half of the step.
const FAR_STRAIN: f64 = 2e-4;

/// What the servo does next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ServoStep {
    /// Isotropic compression by this strain: what few contacts there are say nothing about where load will be found.
    Compress(f64),
    /// A step that is taken back and shortened until it gains.
    Careful,
    /// The step of the response.
    Plain {
        /// Largest strain component.
        most: f64,
        /// Whether the operator of the network is asked for with it; otherwise the response learns from the step.
        asks_operator: bool,
    },
}

/// What the servo remembers of its steps.
#[derive(Clone, Copy, Debug)]
pub(super) struct StepRules {
    /// Whether the response may learn from steps: that of spheres. Discs keep to the network's own operator in every step, so that committed
    /// packings come out again to the bit.
    learns: bool,
    /// Stress error over pressure at the target.
    tolerance: f64,
    circling: StagnationMonitor,
    /// Careful steps still to be taken.
    careful: u32,
    /// Steps in a row without pressure, and how many are taken before the cell is compressed.
    slack: i32,
    most_slack: i32,
    /// Smallest error since the pressure was last out of the range that [`STUCK_PRESSURE`] names, and steps since.
    nearest: f64,
    stuck: i32,
    /// Smallest error since the operator was last asked for in a stall, and steps since.
    best: f64,
    since_best: u32,
}

impl StepRules {
    /// Before the first step.
    pub(super) fn new(learns: bool, without_pressure: StepsWithoutPressure, tolerance: f64) -> Self {
        Self {
            learns,
            tolerance,
            circling: StagnationMonitor::new(),
            careful: 0,
            slack: 0,
            most_slack: without_pressure.count(),
            nearest: f64::INFINITY,
            stuck: 0,
            best: f64::INFINITY,
            since_best: 0,
        }
    }

    /// The next step, after one that has left this stress error over the target pressure, and this pressure over it.
    pub(super) fn next(&mut self, error: f64, pressure: f64) -> ServoStep {
        let is_slack = pressure < SLACK_PRESSURE;
        (self.nearest, self.stuck) = match is_slack || pressure >= STUCK_PRESSURE {
            true => (f64::INFINITY, 0),
            false if error < STUCK_GAIN * self.nearest => (error, 0),
            false => (self.nearest, self.stuck + 1),
        };
        let beyond = self.stuck - STUCK_STEPS[usize::from(self.learns)];
        if beyond > 0 {
            return ServoStep::Compress(growing_compression(beyond));
        }
        self.slack = if is_slack { self.slack + 1 } else { 0 };
        if !self.learns && self.slack > self.most_slack {
            return ServoStep::Compress(growing_compression(self.slack - self.most_slack));
        }
        if self.slack > 0 {
            self.circling = StagnationMonitor::new();
        } else if !self.learns && self.circling.is_circling(error) {
            (self.circling, self.careful) = (StagnationMonitor::new(), CAREFUL_STEPS);
        }
        if self.careful > 0 && self.slack == 0 && error > self.tolerance {
            self.careful -= 1;
            return ServoStep::Careful;
        }
        if self.learns { self.next_of_learning(error, is_slack) } else { plain(LARGEST_STRAIN, true) }
    }

    fn next_of_learning(&mut self, error: f64, is_slack: bool) -> ServoStep {
        self.since_best = if error < self.best { 0 } else { self.since_best + 1 };
        self.best = self.best.min(error);
        if is_slack {
            return ServoStep::Compress(SLACK_STRAIN);
        }
        let is_stalled = self.since_best >= MAX_STALLS;
        if error < CLOSE && !is_stalled {
            return plain(LARGEST_STRAIN, false);
        }
        if is_stalled {
            (self.best, self.since_best) = (error, 0);
        }
        plain(if error < CLOSE { LARGEST_STRAIN } else { FAR_STRAIN }, true)
    }
}

fn plain(most: f64, asks_operator: bool) -> ServoStep {
    ServoStep::Plain { most, asks_operator }
}

/// Strain of the `number`-th compression in a row, from 1 on.
fn growing_compression(number: i32) -> f64 {
    SLACK_STRAIN * 2f64.powi(number.min(SLACK_DOUBLINGS))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn discs_without_pressure_are_compressed_ever_more_after_some_steps() {
        for without_pressure in [StepsWithoutPressure::Few, StepsWithoutPressure::Many] {
            let mut rules = StepRules::new(false, without_pressure, 1e-6);
            for _ in 0..without_pressure.count() {
                assert_eq!(rules.next(1.0, 0.0), plain(LARGEST_STRAIN, true));
            }
            let strains: Vec<ServoStep> = (0..5).map(|_| rules.next(1.0, 0.0)).collect();
            let expected = [2.0, 4.0, 8.0, 16.0, 16.0].map(|factor| ServoStep::Compress(factor * SLACK_STRAIN));
            assert_eq!(strains, expected);
            assert_eq!(rules.next(0.9, 0.1), plain(LARGEST_STRAIN, true));
        }
        assert_eq!([StepsWithoutPressure::Few, StepsWithoutPressure::Many].map(StepsWithoutPressure::count), [2, 40]);
    }

    #[test]
    fn spheres_without_pressure_are_compressed_at_once() {
        assert_eq!(
            StepRules::new(true, StepsWithoutPressure::Few, 1e-6).next(1.0, 0.0),
            ServoStep::Compress(SLACK_STRAIN)
        );
    }

    #[test]
    fn spheres_learn_near_the_target_and_ask_for_the_operator_where_that_stalls() {
        let mut rules = StepRules::new(true, StepsWithoutPressure::Few, 1e-6);
        assert_eq!(rules.next(0.8, 1.0), plain(FAR_STRAIN, true));
        assert_eq!(rules.next(0.4, 1.0), plain(LARGEST_STRAIN, false));
        for _ in 1..MAX_STALLS {
            assert_eq!(rules.next(0.4, 1.0), plain(LARGEST_STRAIN, false));
        }
        assert_eq!(rules.next(0.4, 1.0), plain(LARGEST_STRAIN, true));
        assert_eq!(rules.next(0.4, 1.0), plain(LARGEST_STRAIN, false));
    }

    #[test]
    fn steps_that_gain_nothing_far_below_the_pressure_end_in_compression() {
        for (learns, longest) in [(false, STUCK_STEPS[0]), (true, STUCK_STEPS[1])] {
            let mut rules = StepRules::new(learns, StepsWithoutPressure::Few, 1e-6);
            for _ in 0..=longest {
                assert!(!matches!(rules.next(0.9, 0.1), ServoStep::Compress(_)));
            }
            assert_eq!(rules.next(0.9, 0.1), ServoStep::Compress(2.0 * SLACK_STRAIN));
        }
    }

    #[test]
    fn discs_that_go_round_in_circles_take_careful_steps() {
        let mut rules = StepRules::new(false, StepsWithoutPressure::Few, 1e-6);
        let steps: Vec<ServoStep> = (0..250).map(|_| rules.next(1e-3, 1.0)).collect();
        let careful = steps.iter().filter(|step| **step == ServoStep::Careful).count();
        assert_eq!(careful, 2 * CAREFUL_STEPS as usize);
        assert_eq!(rules.next(1e-7, 1.0), plain(LARGEST_STRAIN, true), "within the tolerance");
    }
}
