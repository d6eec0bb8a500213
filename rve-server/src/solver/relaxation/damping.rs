//! How motion is turned into rest: factors of the old velocity and of the forces for the next step.
//!
//! Only the *peculiar* velocity is integrated and damped, the velocity against the affine motion of the cell: damping the
//! whole velocity would resist the imposed strain and depend on the frame.

use crate::definition::{Damping, RveOptions};
use crate::solver::kernel::StepSums;

/// FIRE mixes this share of the force direction into the velocity at first.
const MIXING: f64 = 0.1;

/// Each step with positive power after the first few multiplies the mixing by this.
const MIXING_DECAY: f64 = 0.99;

/// Steps with positive power before the mixing decays.
const DOWNHILL_STEPS: u32 = 5;

/// Stops in a row that are taken for single ones.
const FREE_STOPS: u32 = 4;

/// Largest `omega^2` of a stable descent, with 2 % to spare.
const LARGEST_DESCENT: f64 = 1.96;

/// Most damping that the adaptive rule applies, in pseudo-time: critical for the stiffest mode.
const MOST_ADAPTIVE: f64 = 1.5;

/// Viscous coefficient after the last change of damping.
const PERSISTENT: f64 = 0.2;

/// Mean overlap over mean radius below which a cell is near unjamming. Discs of a modulus of 1e4 times the pressure, the stiffest in
/// everyday use, overlap by some 4e-4, so that an estimate good to a factor of ten will do.
const NEAR_UNJAMMING: f64 = 1e-5;

/// Changes of damping in a trial, at most.
pub(crate) const CHANGES: u32 = 3;

/// Memory of a damping rule. Starts afresh in every trial.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Damper {
    /// Share of the full step that a descent without motion may take.
    descent: f64,
    mixing: f64,
    positive_steps: u32,
    /// Steps in a row that stopped all motion.
    stops: u32,
    /// Changes of damping in this trial.
    changes: u32,
    /// Whether kinetic damping comes before adaptive damping.
    swings_first: bool,
    /// Whether the next kick begins from standstill.
    begins: bool,
}

/// Factors of one step: `v <- keep v + push F / m` with relative masses `m`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Kick {
    pub(crate) keep: f64,
    pub(crate) push: f64,
}

/// Share of the full step that keeps a descent stable whose `omega_max` is below `2 safety`. While the power of the forces
/// is negative FIRE and kinetic damping stop all motion in every step, which makes them a descent: that converges for `omega^2 < 2` only, half
/// the limit of free motion. Crystals of discs with `k_t` near `k_n` meet the bound on their rotation branch exactly.
pub(crate) fn descent_share(safety: f64) -> f64 {
    (LARGEST_DESCENT / (4.0 * safety * safety)).min(1.0)
}

impl Damper {
    /// The memory of a run whose `omega_max` is below `2 safety`.
    pub(crate) fn new(safety: f64) -> Self {
        Self {
            descent: descent_share(safety),
            mixing: MIXING,
            positive_steps: 0,
            stops: 0,
            changes: 0,
            swings_first: false,
            begins: false,
        }
    }

    /// Factors for the next step from the sums of the last evaluation; `old_power` is the work of the forces before the
    /// last step on its motion.
    pub(crate) fn kick(&mut self, options: &RveOptions, mass: f64, sums: &StepSums<f64>, old_power: f64) -> Kick {
        if mass <= 0.0 {
            // No contact, no force: the grains follow the cell.
            return Kick { keep: 0.0, push: 0.0 };
        }
        let push = 1.0 / mass;
        if std::mem::take(&mut self.begins) {
            return Kick { keep: 0.0, push: self.descent * push };
        }
        let damping = match self.changes {
            0 => options.damping,
            1 | 2 if (self.changes == 1) != self.swings_first => Damping::Adaptive,
            1 | 2 if options.damping == Damping::Kinetic => Damping::Fire,
            1 | 2 => Damping::Kinetic,
            // A quarter of the largest stable pseudo-time step squared.
            CHANGES.. => return damped(PERSISTENT, 0.25 * push),
        };
        match damping {
            Damping::Fire => self.fire(mass, sums),
            Damping::Local => Kick { keep: 1.0, push },
            Damping::Viscous => damped(options.viscous_coefficient(), push),
            Damping::Kinetic => self.kinetic(push, sums),
            Damping::Adaptive => {
                // Rayleigh quotient of the stiffness in the direction of motion: omega^2 of the mode that moves now.
                let quotient = (old_power - sums.power) / (mass * sums.motion_square);
                let omega = if quotient > 0.0 { quotient.sqrt() } else { 0.0 };
                damped((2.0 * omega).min(MOST_ADAPTIVE), push)
            }
        }
    }

    /// Changes the damping, because the relaxation stagnates: to adaptive damping, which ends limit cycles soonest and moves the grains
    /// least; then to kinetic damping (or from it to FIRE), which lets soft modes swing through; then to viscous damping and half of the
    /// step. Near unjamming soft modes are all that is left, and kinetic damping comes first. `overlap` is the mean overlap of
    /// the contacts over the mean radius; that at the first change counts.
    pub(crate) fn change(&mut self, overlap: f64) {
        if self.changes == 0 {
            self.swings_first = overlap < NEAR_UNJAMMING;
        }
        self.changes += 1;
        self.begins = true;
    }

    /// How often [`change`](Self::change) was called.
    pub(crate) fn changes(&self) -> u32 {
        self.changes
    }

    /// FIRE: velocities are mixed with the force direction while they run downhill, and reset when they do not.
    fn fire(&mut self, mass: f64, sums: &StepSums<f64>) -> Kick {
        let push = 1.0 / mass;
        if sums.power <= 0.0 {
            self.mixing = MIXING;
            self.positive_steps = 0;
            return self.stop(push, sums.power);
        }
        self.stops = 0;
        self.positive_steps += 1;
        if self.positive_steps > DOWNHILL_STEPS {
            self.mixing *= MIXING_DECAY;
        }
        // |v| / |F| in mass-weighted norms: sqrt(sum m v^2) / sqrt(sum F^2 / m), times the mass.
        let ratio = mass * (sums.motion_square / sums.scaled_force_square).sqrt();
        Kick { keep: 1.0 - self.mixing, push: push * (1.0 + self.mixing * ratio) }
    }

    /// Kinetic damping: all motion stops whenever the kinetic energy has passed a peak, which is where the power of the
    /// forces changes its sign.
    fn kinetic(&mut self, push: f64, sums: &StepSums<f64>) -> Kick {
        if sums.power < 0.0 {
            return self.stop(push, sums.power);
        }
        self.stops = 0;
        Kick { keep: 1.0, push }
    }

    /// Stops all motion. One stop among steps of free motion may go on with the full push; a row of them is a descent, and
    /// has to be a stable one.
    fn stop(&mut self, push: f64, power: f64) -> Kick {
        // Grains that nothing drives have no power and are no descent.
        self.stops = if power < 0.0 { self.stops + 1 } else { 0 };
        let share = if self.stops > FREE_STOPS { self.descent } else { 1.0 };
        Kick { keep: 0.0, push: share * push }
    }
}

/// Mass-proportional viscous damping, centred in the step.
fn damped(coefficient: f64, push: f64) -> Kick {
    let denominator = 1.0 + 0.5 * coefficient;
    Kick { keep: (1.0 - 0.5 * coefficient) / denominator, push: push / denominator }
}

/// Factor on the mass that keeps the step stable with a damping rule: local damping shortens the stable step.
pub(crate) fn mass_factor(options: &RveOptions) -> f64 {
    match options.damping {
        Damping::Local => 1.0 + options.local_coefficient(),
        Damping::Fire | Damping::Viscous | Damping::Kinetic | Damping::Adaptive => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums of a step whose grains move with this power of the forces on them.
    fn moving(power: f64) -> StepSums<f64> {
        StepSums { power, motion_square: 1.0, scaled_force_square: 1.0, ..StepSums::default() }
    }

    /// The kicks after `changes` changes of the damping in a cell of this overlap, the first of them from standstill: downhill, then uphill.
    fn kicks(options: &RveOptions, overlap: f64, changes: u32) -> [Kick; 3] {
        let mut damper = Damper::new(0.8);
        for _ in 0..changes {
            damper.change(overlap);
        }
        [moving(1.0), moving(1.0), moving(-1.0)].map(|sums| damper.kick(options, 2.0, &sums, 1.5))
    }

    #[test]
    fn stagnation_changes_the_damping_and_swings_first_near_unjamming() {
        let options = |damping| RveOptions { damping, ..RveOptions::default() };
        let still = Kick { keep: 0.0, push: 0.5 * descent_share(0.8) };
        // The quotient of stiffness in the direction of motion is (1.5 - power) / 2.
        let adaptive = [still, damped(2.0 * 0.25_f64.sqrt(), 0.5), damped(MOST_ADAPTIVE, 0.5)];
        let kinetic = [still, Kick { keep: 1.0, push: 0.5 }, Kick { keep: 0.0, push: 0.5 }];
        let viscous = damped(PERSISTENT, 0.125);
        for damping in [Damping::Fire, Damping::Viscous, Damping::Adaptive, Damping::Local] {
            let options = options(damping);
            for (overlap, order) in [(1e-4, [adaptive, kinetic]), (1e-6, [kinetic, adaptive])] {
                assert_eq!([1, 2].map(|changes| kicks(&options, overlap, changes)), order, "{damping:?} {overlap:e}");
                assert_eq!(kicks(&options, overlap, CHANGES), [still, viscous, viscous], "{damping:?}");
            }
        }
        // Kinetic damping gives way to FIRE, which mixes the force into the velocity.
        let [first, downhill, uphill] = kicks(&options(Damping::Kinetic), 1e-4, 2);
        assert_eq!((first, uphill), (still, kinetic[2]));
        assert!(downhill.keep < 1.0 && downhill.push > 0.5, "{downhill:?}");
    }

    #[test]
    fn the_order_of_the_first_change_is_kept() {
        let options = RveOptions::default();
        let mut damper = Damper::new(0.8);
        damper.change(1e-6);
        damper.change(1e-4);
        damper.kick(&options, 2.0, &moving(1.0), 1.5);
        assert_eq!(damper.kick(&options, 2.0, &moving(1.0), 1.5), damped(2.0 * 0.25_f64.sqrt(), 0.5));
    }
}
