//! The energy ledger of a case: work done on the cell against what is stored and what friction and damping took. All of it is summed up
//! along the steps of the grains, so that it closes however coarse the increments are.

use super::outcome::Increment;

/// Energy that may be missing or left over, over the largest of the energies.
pub(super) const LIMIT: f64 = 0.05;

/// Whether a ledger that is open this far is wrong.
pub(super) fn is_open(open: f64) -> bool {
    open.abs() > LIMIT
}

/// Energy stored and lost beyond the work done on the cell, over the largest of the three; NaN for a path of no energy.
pub(super) fn open(increments: &[Increment]) -> f64 {
    let (Some(first), Some(last)) = (increments.first(), increments.last()) else { return f64::NAN };
    // Cohesion stores energy below zero.
    let largest = |scale: f64, one: &Increment| scale.max(one.work.abs()).max(one.stored.abs());
    let scale = increments.iter().fold(last.lost + last.damped, largest);
    let spent = |one: &Increment| one.stored + one.lost + one.damped;
    if scale > 0.0 { (spent(last) - spent(first) - (last.work - first.work)) / scale } else { f64::NAN }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_neither_stored_nor_lost_is_open() {
        let state = |work: f64, stored: f64, lost: f64, damped: f64| Increment {
            work,
            stored,
            lost,
            damped,
            ..Increment::default()
        };
        let last = |stored: f64, lost: f64, damped: f64| {
            open(&[state(0.0, 1.0, 0.0, 0.0), state(2.0, 2.0, 0.5, 0.5), state(5.0, stored, lost, damped)])
        };
        assert!(last(4.0, 1.5, 0.5).abs() < 1e-14);
        // Two of five are missing, and one too many.
        assert!((last(2.0, 1.0, 1.0) + 0.4).abs() < 1e-14);
        assert!((last(4.0, 1.0, 2.0) - 0.2).abs() < 1e-14);
        assert!(open(&[]).is_nan() && open(&[Increment::default()]).is_nan());
    }
}
