//! Accuracy by error: the strain per ramp step follows the estimated error of the stresses, as long as that is what was asked for.
//!
//! An error that has been made stays, whatever the next steps cost: where two solutions of a cell have parted, their difference does not
//! fall with the strain per step. So an estimate above the error that was asked for changes nothing; the strain per step goes back to the
//! last one that kept to it, and stays there until the estimate does so again. Measured in docs/lab-book/error-estimate.md.

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
    /// Smallest strain per ramp step.
    pub smallest: f64,
    /// Largest strain per ramp step.
    pub largest: f64,
}

impl ErrorControl {
    /// Strain per ramp step of the next load step, after one that took `now` and has an estimated error of `estimated`. `kept` is that
    /// of the last step whose estimate was not above [`ErrorControl::error`], if there was one. The error falls about in proportion to
    /// the strain.
    pub fn next_strain_per_step(&self, now: f64, kept: Option<f64>, estimated: f64) -> f64 {
        if let Some(kept) = kept.filter(|_| !self.is_within_error(estimated)) {
            return kept;
        }
        let [down, up] = LARGEST_CHANGES;
        // An estimate that is no number says nothing good.
        let wanted = match estimated {
            _ if estimated.is_nan() => down,
            _ if estimated > 0.0 => AIMED_AT * self.error / estimated,
            _ => up,
        };
        if (DEAD_BAND.recip()..=DEAD_BAND).contains(&wanted) {
            return now;
        }
        (now * wanted.clamp(down, up)).clamp(self.smallest, self.largest)
    }

    /// Whether an estimated error is not above the one that was asked for.
    pub fn is_within_error(&self, estimated: f64) -> bool {
        estimated <= self.error
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONTROL: ErrorControl = ErrorControl { error: 5e-3, smallest: 1e-6, largest: 2e-5 };

    #[test]
    fn an_estimate_that_is_no_number_makes_steps_smaller() {
        assert!(CONTROL.next_strain_per_step(1e-5, None, f64::NAN) < 1e-5);
        assert_eq!(CONTROL.next_strain_per_step(1e-5, Some(4e-6), f64::NAN), 4e-6);
    }

    #[test]
    fn an_error_in_proportion_to_the_step_is_brought_to_what_is_aimed_at() {
        let mut strain = 1e-6;
        for _ in 0..30 {
            strain = CONTROL.next_strain_per_step(strain, None, 900.0 * strain);
        }
        let error = 900.0 * strain;
        assert!(error > 0.35 * CONTROL.error && error < CONTROL.error, "{error}");
    }

    #[test]
    fn the_strain_per_step_stays_within_its_bounds_and_still_where_it_is_right() {
        assert_eq!(CONTROL.next_strain_per_step(2e-5, Some(1e-5), 0.0), 2e-5);
        assert_eq!(CONTROL.next_strain_per_step(1e-6, None, 1.0), 1e-6);
        assert_eq!(CONTROL.next_strain_per_step(4e-6, Some(1e-5), 2.4e-3), 4e-6);
    }

    #[test]
    fn what_has_been_missed_is_not_paid_for() {
        // Solutions part at the fourth step: their difference no longer depends on the strain per step.
        let (mut strain, mut kept) = (5e-6, None);
        let mut course = Vec::new();
        for estimated in [1e-3, 2e-3, 4e-3, 3e-2, 5e-2, 4e-2, 1e-3] {
            let next = CONTROL.next_strain_per_step(strain, kept, estimated);
            if CONTROL.is_within_error(estimated) {
                kept = Some(strain);
            }
            course.push(strain);
            strain = next;
        }
        assert!(course[3] < course[2], "4e-3 is above what is aimed at: {course:?}");
        assert_eq!(course[4..], [course[2]; 3], "the strain of the last step that kept to the error: {course:?}");
        assert!(strain > course[6], "and it is controlled again: {course:?}");
    }

    #[test]
    fn a_run_that_begins_too_coarsely_is_refined() {
        let refined = CONTROL.next_strain_per_step(5e-6, None, 2e-2);
        assert!((refined - 2.5e-6).abs() < 1e-12);
    }
}
