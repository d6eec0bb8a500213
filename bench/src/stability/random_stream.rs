//! Random numbers of a campaign: one stream per case, so that a case depends on nothing but its number.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Purpose of a stream of random numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// The case of this number.
    Case(u64),
    /// The packing of this number.
    Packing(u64),
    /// Whether the case of this number is checked if it is not cheap.
    Check(u64),
    /// The small scene of this number.
    Scene(u64),
    /// The scene of this number that is run with and without shortcuts.
    Shortcuts(u64),
}

/// A stream of random numbers.
pub(crate) struct RandomStream(ChaCha8Rng);

impl RandomStream {
    /// The stream of a campaign's seed for one purpose.
    pub(crate) fn new(seed: u64, purpose: Purpose) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        // The lowest bits tell the purposes apart: no two share a stream.
        random.set_stream(match purpose {
            Purpose::Case(number) => 4 * number,
            Purpose::Packing(number) => 4 * number + 1,
            Purpose::Check(number) => 4 * number + 2,
            Purpose::Scene(number) => 4 * number + 3,
            // From the other end: campaigns keep their cases.
            Purpose::Shortcuts(number) => u64::MAX - number,
        });
        Self(random)
    }

    /// A number in [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * 2f64.powi(-53)
    }

    /// A number between two others.
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// A positive number between two others, evenly in its logarithm.
    pub(crate) fn decades(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    /// Whether something of this probability happens.
    pub(crate) fn chance(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }

    /// A whole number below `count`.
    pub(crate) fn below(&mut self, count: usize) -> usize {
        ((self.unit() * count as f64) as usize).min(count.saturating_sub(1))
    }

    /// One of several things.
    pub(crate) fn pick<T: Copy>(&mut self, things: &[T]) -> T {
        things[self.below(things.len())]
    }

    /// One of several things with their weights.
    pub(crate) fn weighed<T: Copy>(&mut self, things: &[(f64, T)]) -> T {
        let mut place = self.unit() * things.iter().map(|(weight, _)| weight).sum::<f64>();
        for (weight, thing) in things {
            if place < *weight {
                return *thing;
            }
            place -= weight;
        }
        things[things.len() - 1].1
    }

    /// 1 or -1.
    pub(crate) fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    /// A seed for another generator; small enough for every integer of TOML and JSON.
    pub(crate) fn seed(&mut self) -> u64 {
        self.0.next_u64() >> 32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_are_repeatable_and_differ_by_seed_number_and_purpose() {
        let first = |seed, purpose| RandomStream::new(seed, purpose).unit();
        let streams = [
            first(1, Purpose::Case(0)),
            first(2, Purpose::Case(0)),
            first(1, Purpose::Case(1)),
            first(1, Purpose::Packing(0)),
            first(1, Purpose::Check(0)),
            first(1, Purpose::Scene(0)),
            first(1, Purpose::Shortcuts(0)),
        ];
        for (place, one) in streams.iter().enumerate() {
            assert!(streams[..place].iter().all(|other| other != one), "{place}");
        }
        assert_eq!(first(1, Purpose::Case(7)), first(1, Purpose::Case(7)));
    }

    #[test]
    fn numbers_stay_in_their_ranges() {
        let mut stream = RandomStream::new(1, Purpose::Case(0));
        for _ in 0..1000 {
            assert!((0.2..1.0).contains(&stream.between(0.2, 1.0)));
            let value = stream.decades(1e-8, 1e-2);
            assert!((1e-8 * (1.0 - 1e-12)..1e-2).contains(&value), "{value:e}");
            assert!(stream.below(3) < 3);
            assert_ne!(stream.weighed(&[(1.0, 1), (0.0, 2)]), 2);
            assert!(stream.seed() <= u64::from(u32::MAX));
        }
    }
}
