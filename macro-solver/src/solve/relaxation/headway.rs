//! Motions that make no headway: where cells snap, no state in balance lies near, and the motion goes to and fro for ever.

/// Iterations in which the out-of-balance force has to halve. The lowest mode of a body a thousand elements long halves in some 300.
pub(super) const ALLOWED: usize = 2000;

/// What has been reached on the way.
#[derive(Clone, Debug)]
pub(super) struct Headway {
    /// Smallest out-of-balance force over loads and reactions so far.
    pub(super) best: f64,
    /// Displacements since the last equilibrium at which it was found, m.
    pub(super) iterate: Vec<f64>,
    /// The out-of-balance force that has to be halved, and the iteration of which it is.
    halved: (f64, usize),
}

impl Headway {
    /// Before the first iterate.
    pub(super) fn new() -> Self {
        Self { best: f64::INFINITY, iterate: Vec::new(), halved: (f64::INFINITY, 0) }
    }

    /// Takes an iterate with its out-of-balance force.
    pub(super) fn note(&mut self, iteration: usize, force_ratio: f64, iterate: &[f64]) {
        if force_ratio < self.best {
            self.best = force_ratio;
            self.iterate = iterate.to_vec();
        }
        if force_ratio <= 0.5 * self.halved.0 {
            self.halved = (force_ratio, iteration);
        }
    }

    /// Whether the out-of-balance force has not halved for too long.
    pub(super) fn has_ended(&self, iteration: usize) -> bool {
        iteration >= self.halved.1 + ALLOWED
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_force_that_falls_however_slowly_makes_headway_and_one_that_goes_to_and_fro_does_not() {
        let ended = |force: &dyn Fn(usize) -> f64| {
            let mut headway = Headway::new();
            (1..20_000).find(|&iteration| {
                headway.note(iteration, force(iteration), &[iteration as f64]);
                headway.has_ended(iteration)
            })
        };
        assert_eq!(ended(&|iteration| 0.9995f64.powi(iteration as i32)), None);
        assert_eq!(
            ended(&|iteration| if iteration < 100 { 1.0 / iteration as f64 } else { 0.01 }),
            Some(64 + ALLOWED)
        );
        let mut headway = Headway::new();
        for (iteration, force) in [(1, 0.5), (2, 0.1), (3, 0.2)] {
            headway.note(iteration, force, &[iteration as f64]);
        }
        assert_eq!((headway.best, headway.iterate), (0.1, vec![2.0]));
    }
}
