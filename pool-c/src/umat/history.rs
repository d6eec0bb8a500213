//! Which call begins an increment, repeats it, or restarts it.

use super::place::Place;
use crate::ffi_boundary::Failure;
use crate::measures::step;
use grain_pool::{RvePool, State};
use protocol::Tensor2;
use std::collections::BTreeMap;

/// Difference of two times, relative to the larger increment, below which they are the same.
const SAME: f64 = 1e-6;

/// What sums of times may differ by where host and library add them up in another order, relative to the times: some spacings of numbers.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Largest component of DFGRD0 minus the identity that a host leaves in a point that has not been deformed.
const DEFORMED: f64 = 1e-9;

/// One call of the host for one point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Call {
    pub(super) place: Place,
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

/// What keeps the grains: states, each with at most one trial.
pub(super) trait Cells {
    /// The name of a state.
    type State: Copy;

    /// A state as packed.
    ///
    /// # Errors
    /// The pool fails.
    fn new_state(&self) -> Result<Self::State, Failure>;

    /// Commits the trial of a state.
    ///
    /// # Errors
    /// There is none; the pool fails.
    fn commit(&self, state: Self::State) -> Result<(), Failure>;
}

impl Cells for RvePool {
    type State = State;

    fn new_state(&self) -> Result<State, Failure> {
        Ok(self.new_states(0, 1)?[0])
    }

    fn commit(&self, state: State) -> Result<(), Failure> {
        Ok(RvePool::commit(self, &[state])?)
    }
}

/// What is known of a point.
#[derive(Clone, Copy, Debug)]
struct Point<S> {
    state: S,
    /// TIME(2) of the first call.
    first: f64,
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
pub(super) struct Points<S>(BTreeMap<Place, Point<S>>);

impl<S: Copy> Points<S> {
    /// No point yet.
    pub(super) const fn new() -> Self {
        Self(BTreeMap::new())
    }

    /// The state of the point of a call, with the last trial committed if the host has gone on.
    ///
    /// # Errors
    /// A new state cannot be made; the host has gone to a time from which the committed state does not start; LAYER or KSPT of an
    /// integration point have changed.
    pub(super) fn enter(&mut self, call: &Call, cells: &impl Cells<State = S>) -> Result<S, Failure> {
        let Call { place, begin, duration, .. } = *call;
        let Some(known) = self.0.get_mut(&place) else {
            self.check_late(call)?;
            check_first(call)?;
            let state = cells.new_state()?;
            self.0.insert(place, Point { state, first: begin, begin, duration });
            return Ok(state);
        };
        if meaning((known.begin, known.duration), (begin, duration), place)? == Meaning::Next {
            cells.commit(known.state)?;
            known.begin = begin;
        }
        known.duration = duration;
        Ok(known.state)
    }

    /// All section points of an integration point begin with the same increment. One that comes later is not of the section: the host
    /// leaves LAYER and KSPT to chance, and every new pair of them would begin as packed.
    fn check_late(&self, call: &Call) -> Result<(), Failure> {
        let Some((other, known)) = self.0.range(call.place.all_of_point()).next() else { return Ok(()) };
        let tolerance = rounding(known.first, call.begin) + SAME * known.duration.abs().max(call.duration.abs());
        if (call.begin - known.first).abs() <= tolerance {
            return Ok(());
        }
        Err(Failure::input(format!(
            "{} is new at time {}, but {other} began at {}; a host that does not fill LAYER and KSPT cannot be served, unless the names of \
             its materials begin with \"@\", as in CalculiX",
            call.place, call.begin, known.first
        )))
    }
}

/// Grains begin as packed. A first call that begins later, from a deformed state, is that of a restart: what they went through is missing.
fn check_first(call: &Call) -> Result<(), Failure> {
    let Call { place, begin, duration, before, .. } = call;
    if !(begin.is_finite() && *duration >= 0.0) {
        return Err(Failure::input(format!("{place}: TIME(2) = {begin} and DTIME = {duration} are no increment")));
    }
    let unit = |i: usize, j: usize| if i == j { 1.0 } else { 0.0 };
    let differences = (0..9).map(|entry| (before[entry / 3][entry % 3] - unit(entry / 3, entry % 3)).abs());
    let farthest = differences.max_by(f64::total_cmp).unwrap_or(0.0);
    if farthest.is_nan() {
        return Err(Failure::input(format!("{place}: DFGRD0 holds a NaN")));
    }
    if *begin > 0.0 && farthest > DEFORMED {
        return Err(Failure::input(format!(
            "{place} is new at time {begin}, where DFGRD0 differs from the identity by {farthest:.1e}; restarts from earlier results are not \
             supported, since the grains of a point begin as packed"
        )));
    }
    Ok(())
}

/// What two equal times may differ by.
fn rounding(one: f64, other: f64) -> f64 {
    ROUNDING * one.abs().max(other.abs())
}

/// Compares begin and duration of the last call of a point with those of the present one.
fn meaning(last: (f64, f64), now: (f64, f64), place: Place) -> Result<Meaning, Failure> {
    let end = last.0 + last.1;
    let (from_begin, from_end) = ((now.0 - last.0).abs(), (now.0 - end).abs());
    let rounding = rounding(end, now.0).max(rounding(last.0, now.0));
    if last.1 != 0.0 && from_begin.max(from_end) <= rounding {
        return Err(Failure::input(format!(
            "{place}: at time {} an increment of {} is no longer than the rounding of times, so that the next increment cannot be told from \
             an iteration",
            now.0, last.1
        )));
    }
    let tolerance = rounding + SAME * last.1.abs().max(now.1.abs());
    // The nearer one: an increment may be shorter than the tolerance that belongs to the next.
    match from_begin.min(from_end) <= tolerance {
        true if from_begin <= from_end => Ok(Meaning::Same),
        true => Ok(Meaning::Next),
        false => Err(Failure::input(format!(
            "{place}: the increment begins at {}, but the grains are at {}; restarts from earlier times are not supported",
            now.0, last.0
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;

    const PLACE: Place = Place { element: 7, point: 1, layer: 1, section_point: 1 };

    /// States by their number; notes what is committed.
    #[derive(Debug, Default)]
    struct Counted(RefCell<(usize, Vec<usize>)>);

    impl Cells for Counted {
        type State = usize;

        fn new_state(&self) -> Result<usize, Failure> {
            let count = &mut self.0.borrow_mut().0;
            *count += 1;
            Ok(*count - 1)
        }

        fn commit(&self, state: usize) -> Result<(), Failure> {
            self.0.borrow_mut().1.push(state);
            Ok(())
        }
    }

    fn call(place: Place, begin: f64) -> Call {
        let unit = std::array::from_fn(|i| std::array::from_fn(|j| if i == j { 1.0 } else { 0.0 }));
        Call { place, begin, duration: 0.1, before: unit, after: unit }
    }

    /// Grains began as packed in a state that the host had strained by 5 %.
    #[test]
    fn a_restart_from_a_deformed_state_is_refused_and_a_new_element_is_not() {
        let (cells, mut points) = (Counted::default(), Points::new());
        let mut restart = call(PLACE, 3.0);
        restart.before[1][1] = 0.95;
        let error = points.enter(&restart, &cells).unwrap_err().text;
        assert!(error.contains("differs from the identity by 5.0e-2"), "{error}");
        let endless = Call { duration: f64::NAN, ..call(PLACE, 0.0) };
        assert!(points.enter(&endless, &cells).unwrap_err().text.contains("no increment"));
        let mut broken = call(PLACE, 0.0);
        broken.before[2][2] = f64::NAN;
        assert!(points.enter(&broken, &cells).unwrap_err().text.contains("DFGRD0"));
        assert_eq!(points.enter(&call(PLACE, 3.0), &cells).unwrap(), 0);
    }

    #[test]
    fn iterations_and_restarted_increments_keep_the_committed_state() {
        assert_eq!(meaning((0.2, 0.1), (0.2, 0.1), PLACE).unwrap(), Meaning::Same);
        assert_eq!(meaning((0.2, 0.1), (0.2, 0.025), PLACE).unwrap(), Meaning::Same);
        assert_eq!(meaning((0.2, 0.0), (0.2, 0.1), PLACE).unwrap(), Meaning::Same);
    }

    #[test]
    fn the_next_increment_commits_the_trial_of_the_last_length() {
        assert_eq!(meaning((0.2, 0.025), (0.225, 0.05), PLACE).unwrap(), Meaning::Next);
        let times = [0.0, 0.1, 0.2, 0.30000000000000004];
        let steps = times.windows(2).map(|pair| meaning((pair[0], 0.1), (pair[1], 0.1), PLACE).unwrap());
        assert!(steps.into_iter().all(|one| one == Meaning::Next));
    }

    /// After a year of seconds numbers are 3.7e-9 apart, more than a millionth of a millisecond.
    #[test]
    fn late_times_are_the_same_up_to_the_spacing_of_numbers() {
        let (late, spacing) = (3.15e7_f64, 3.725290298461914e-9);
        for off in [-2.0, -1.0, 1.0, 2.0] {
            let now = late + off * spacing;
            assert_eq!(meaning((late, 1e-3), (now, 1e-3), PLACE).unwrap(), Meaning::Same, "{off}");
            assert_eq!(meaning((late, 1e-3), (now + 1e-3, 1e-3), PLACE).unwrap(), Meaning::Next, "{off}");
        }
        assert!(meaning((late, 1e-3), (late + 5e-4, 1e-3), PLACE).is_err());
        let error = meaning((late, 1e-8), (late + 1e-8, 1e-8), PLACE).unwrap_err().text;
        assert!(error.contains("no longer than the rounding of times"), "{error}");
    }

    #[test]
    fn an_increment_is_over_however_much_longer_the_next_one_is() {
        assert_eq!(meaning((0.0, 1e-8), (1e-8, 1.0), PLACE).unwrap(), Meaning::Next);
        assert_eq!(meaning((0.0, 1.0), (0.0, 1e-8), PLACE).unwrap(), Meaning::Same);
    }

    #[test]
    fn other_times_are_refused_with_the_point() {
        for now in [0.1, f64::NAN] {
            let error = meaning((0.2, 0.1), (now, 0.1), PLACE).unwrap_err().text;
            assert!(error.contains("element 7 point 1"), "{error}");
        }
    }

    #[test]
    fn layers_of_a_section_have_states_of_their_own() {
        let (cells, mut points) = (Counted::default(), Points::new());
        let layers = [1, 2].map(|layer| Place { layer, ..PLACE });
        let section = [1, 2].map(|section_point| Place { section_point, ..PLACE });
        let places = [layers[0], layers[1], section[1], Place { point: 2, ..PLACE }];
        for _ in 0..2 {
            let states = places.map(|place| points.enter(&call(place, 0.0), &cells).unwrap());
            assert_eq!(states, [0, 1, 2, 3]);
        }
        assert!(places.iter().all(|place| points.enter(&call(*place, 0.1), &cells).is_ok()));
        assert_eq!(cells.0.borrow().1, [0, 1, 2, 3]);
    }

    #[test]
    fn a_layer_that_comes_later_than_the_others_is_refused() {
        let (cells, mut points) = (Counted::default(), Points::new());
        points.enter(&call(PLACE, 0.0), &cells).unwrap();
        points.enter(&call(PLACE, 0.1), &cells).unwrap();
        let error = points.enter(&call(Place { layer: 32_767, ..PLACE }, 0.1), &cells).unwrap_err().text;
        assert!(error.contains("element 7 point 1 layer 32767 section point 1 is new at time 0.1"), "{error}");
        assert_eq!(points.enter(&call(Place { element: 8, ..PLACE }, 0.1), &cells).unwrap(), 1);
    }

    #[test]
    fn the_target_is_relative_to_the_begin_of_the_increment() {
        let before = [[1.1, 0.2, 0.0], [0.0, 0.9, 0.0], [0.0, 0.0, 1.0]];
        let step = [[1.01, 0.0, 0.0], [0.03, 0.98, 0.0], [0.0, 0.0, 1.0]];
        let after = rve_server::space::product(&step, &before);
        let call = Call { place: PLACE, begin: 0.0, duration: 1.0, before, after };
        for (found, wanted) in call.target().0.into_iter().zip([0.01, 0.0, 0.0, 0.03, -0.02, 0.0, 0.0, 0.0, 0.0]) {
            assert!((found - wanted).abs() < 1e-15, "{found} {wanted}");
        }
    }
}
