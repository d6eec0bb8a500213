//! Accuracy by error: the strain per ramp step follows the estimated error of the stresses.

/// Part of the error that is aimed at: the error grows along the path, and what a coarse step has done stays.
const AIMED_AT: f64 = 0.5;

/// Changes of the strain per step that are too small to be made.
const DEAD_BAND: f64 = 1.25;

/// Largest changes from one load step to the next, down and up.
const LARGEST_CHANGES: [f64; 2] = [0.5, 1.25];

/// The key `rve.error`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorControl {
    /// Error of the stresses over the pressure that a run keeps to.
    pub error: f64,
    /// Smallest strain per ramp step. Cells that part company for good are not brought back by any.
    pub smallest: f64,
    /// Largest strain per ramp step.
    pub largest: f64,
}

impl ErrorControl {
    /// Strain per ramp step of the next load step, after one that took `now` and has an estimated error of `estimated`. The error
    /// falls about in proportion to it.
    pub fn next_strain_per_step(&self, now: f64, estimated: f64) -> f64 {
        let [down, up] = LARGEST_CHANGES;
        let wanted = if estimated > 0.0 { AIMED_AT * self.error / estimated } else { up };
        if (DEAD_BAND.recip()..=DEAD_BAND).contains(&wanted) {
            return now;
        }
        (now * wanted.clamp(down, up)).clamp(self.smallest, self.largest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONTROL: ErrorControl = ErrorControl { error: 5e-3, smallest: 1e-6, largest: 2e-5 };

    #[test]
    fn an_error_in_proportion_to_the_step_is_brought_to_what_is_aimed_at() {
        let mut strain = 1e-6;
        for _ in 0..30 {
            strain = CONTROL.next_strain_per_step(strain, 900.0 * strain);
        }
        let error = 900.0 * strain;
        assert!(error > 0.35 * CONTROL.error && error < CONTROL.error, "{error}");
    }

    #[test]
    fn the_strain_per_step_stays_within_its_bounds_and_still_where_it_is_right() {
        assert_eq!(CONTROL.next_strain_per_step(2e-5, 0.0), 2e-5);
        assert_eq!(CONTROL.next_strain_per_step(1e-6, 1.0), 1e-6);
        assert_eq!(CONTROL.next_strain_per_step(4e-6, 2.4e-3), 4e-6);
    }
}
