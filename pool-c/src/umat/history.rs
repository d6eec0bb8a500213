//! Which call begins an increment, repeats it, or restarts it.

use crate::ffi_boundary::Failure;
use crate::measures::step;
use grain_pool::{RvePool, State};
use protocol::Tensor2;
use std::collections::BTreeMap;
use std::ffi::c_int;

/// Difference of two times, relative to the larger increment, below which they are the same.
const SAME: f64 = 1e-6;

/// One call of the host for one point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Call {
    /// NOEL and NPT.
    pub(super) point: (c_int, c_int),
    /// TIME(2): total time at the begin of the increment.
    pub(super) begin: f64,
    /// DTIME.
    pub(super) duration: f64,
    /// DFGRD0.
    pub(super) before: [[f64; 3]; 3],
    /// DFGRD1.
    pub(super) after: [[f64; 3]; 3],
}

impl Call {
    /// Displacement gradient from the begin of the increment.
    pub(super) fn target(&self) -> Tensor2 {
        Tensor2::from_rows(&step(&self.before, &self.after))
    }
}

/// What is known of a point.
#[derive(Clone, Copy, Debug)]
struct Point {
    state: State,
    begin: f64,
    duration: f64,
}

/// What a call means for the committed state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Meaning {
    /// Another iteration, or the same increment with another length.
    Same,
    /// The last trial was accepted.
    Next,
}

/// The points of the host.
#[derive(Debug)]
pub(super) struct Points(BTreeMap<(c_int, c_int), Point>);

impl Points {
    /// No point yet.
    pub(super) const fn new() -> Self {
        Self(BTreeMap::new())
    }

    /// The state of the point of a call, with the last trial committed if the host has gone on.
    ///
    /// # Errors
    /// A new state cannot be made; the host has gone to a time from which the committed state does not start.
    pub(super) fn enter(&mut self, call: &Call, pool: &RvePool) -> Result<State, Failure> {
        let Some(known) = self.0.get_mut(&call.point) else {
            let state = pool.new_states(0, 1)?[0];
            self.0.insert(call.point, Point { state, begin: call.begin, duration: call.duration });
            return Ok(state);
        };
        if meaning((known.begin, known.duration), (call.begin, call.duration), call.point)? == Meaning::Next {
            pool.commit(&[known.state])?;
            known.begin = call.begin;
        }
        known.duration = call.duration;
        Ok(known.state)
    }
}

/// Compares begin and duration of the last call of a point with those of the present one.
fn meaning(last: (f64, f64), now: (f64, f64), point: (c_int, c_int)) -> Result<Meaning, Failure> {
    let tolerance = SAME * last.1.abs().max(now.1.abs()).max(f64::MIN_POSITIVE);
    if (now.0 - last.0).abs() <= tolerance {
        return Ok(Meaning::Same);
    }
    if (now.0 - (last.0 + last.1)).abs() <= tolerance {
        return Ok(Meaning::Next);
    }
    Err(Failure::input(format!(
        "element {} point {}: the increment begins at {}, but the grains are at {}; restarts from earlier times are not supported",
        point.0, point.1, now.0, last.0
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    const POINT: (c_int, c_int) = (7, 1);

    #[test]
    fn iterations_and_restarted_increments_keep_the_committed_state() {
        assert_eq!(meaning((0.2, 0.1), (0.2, 0.1), POINT).unwrap(), Meaning::Same);
        assert_eq!(meaning((0.2, 0.1), (0.2, 0.025), POINT).unwrap(), Meaning::Same);
    }

    #[test]
    fn the_next_increment_commits_the_trial_of_the_last_length() {
        assert_eq!(meaning((0.2, 0.025), (0.225, 0.05), POINT).unwrap(), Meaning::Next);
        let times = [0.0, 0.1, 0.2, 0.30000000000000004];
        let steps = times.windows(2).map(|pair| meaning((pair[0], 0.1), (pair[1], 0.1), POINT).unwrap());
        assert!(steps.into_iter().all(|one| one == Meaning::Next));
    }

    #[test]
    fn other_times_are_refused_with_the_point() {
        let error = meaning((0.2, 0.1), (0.1, 0.1), POINT).unwrap_err().text;
        assert!(error.contains("element 7 point 1"), "{error}");
    }

    #[test]
    fn the_target_is_relative_to_the_begin_of_the_increment() {
        let before = [[1.1, 0.2, 0.0], [0.0, 0.9, 0.0], [0.0, 0.0, 1.0]];
        let step = [[1.01, 0.0, 0.0], [0.03, 0.98, 0.0], [0.0, 0.0, 1.0]];
        let after = rve_server::space::product(&step, &before);
        let call = Call { point: POINT, begin: 0.0, duration: 1.0, before, after };
        for (found, wanted) in call.target().0.into_iter().zip([0.01, 0.0, 0.0, 0.03, -0.02, 0.0, 0.0, 0.0, 0.0]) {
            assert!((found - wanted).abs() < 1e-15, "{found} {wanted}");
        }
    }
}
