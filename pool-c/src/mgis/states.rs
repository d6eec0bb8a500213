//! States as values: what a host hands in as an internal state variable, and what it gets back.
//!
//! A host of MGIS calls with the state at the begin of a step and receives another one; it keeps, copies and drops both as it likes. Here
//! a state is a number: 0 is the cell as packed, and every integration makes a new one, which is known by the state it came from and its
//! deformation. Grains are kept for the states that hosts begin steps from. When a host begins a step from a number for the first time,
//! the trial behind it is committed; if it is not the last trial of its point, it is repeated first, which gives the same bits. An
//! operator without an integration and a refused iteration are trials too: they take the place of the one before in the pool.

use crate::ffi_boundary::Failure;
use crate::material::Material;
use grain_pool::State;
use protocol::{Tensor2, TrialOptions};
use std::collections::BTreeMap;

/// What keeps the grains: points with a committed state and at most one trial each.
pub(super) trait Cells {
    /// A point.
    type Point: Copy;

    /// A point in the state as packed.
    ///
    /// # Errors
    /// The pool fails.
    fn new_point(&self) -> Result<Self::Point, Failure>;

    /// Makes a trial of a point. It takes the place of an earlier one; a refused one leaves none.
    ///
    /// # Errors
    /// A refusal; the pool fails.
    fn repeat(&self, point: Self::Point, target: Tensor2, options: TrialOptions) -> Result<(), Failure>;

    /// Commits the trial of a point.
    ///
    /// # Errors
    /// There is none; the pool fails.
    fn commit(&self, point: Self::Point) -> Result<(), Failure>;
}

impl Cells for Material {
    type Point = State;

    fn new_point(&self) -> Result<State, Failure> {
        self.new_state()
    }

    fn repeat(&self, point: State, target: Tensor2, options: TrialOptions) -> Result<(), Failure> {
        self.trial(point, target, options).map(drop)
    }

    fn commit(&self, point: State) -> Result<(), Failure> {
        Ok(self.pool.commit(&[point])?)
    }
}

/// The cell as packed.
pub(super) const AS_PACKED: u64 = 0;

/// How a state was made.
#[derive(Clone, Copy, Debug)]
struct Made {
    /// The state it came from.
    from: u64,
    target: Tensor2,
    options: TrialOptions,
}

/// A point of the pool: its grains are those of the committed state.
#[derive(Clone, Debug)]
struct Held<P> {
    point: P,
    /// The states that were made from the committed one.
    further: Vec<u64>,
    /// The state that the point's trial leads to. None where there is no trial, or the trial may be any other: the pool is asked for one
    /// between [`States::enter`] and [`States::made`], and it is not known how that ends.
    tried: Option<u64>,
}

/// All states that this process knows.
#[derive(Debug)]
pub(super) struct States<P> {
    /// Point from which trials of the cell as packed are made; it is never committed.
    origin: Option<P>,
    /// Points by the number of their committed state.
    held: BTreeMap<u64, Held<P>>,
    /// States that may be begun from, by their number. Those made from the cell as packed stay: their origin belongs to all points, so
    /// that nobody can tell which of them another point has yet to begin from.
    made: BTreeMap<u64, Made>,
    last: u64,
}

impl<P: Copy> States<P> {
    /// No state but the cell as packed.
    pub(super) const fn new() -> Self {
        Self { origin: None, held: BTreeMap::new(), made: BTreeMap::new(), last: AS_PACKED }
    }

    /// The point whose committed state has this number, for a trial of it; [`States::made`] records what that leads to.
    ///
    /// # Errors
    /// The number is unknown, or its point has gone on to a later state; the pool fails.
    pub(super) fn enter(&mut self, number: u64, cells: &impl Cells<Point = P>) -> Result<P, Failure> {
        if number == AS_PACKED {
            return match self.origin {
                Some(point) => Ok(point),
                None => Ok(*self.origin.insert(cells.new_point()?)),
            };
        }
        if let Some(held) = self.held.get_mut(&number) {
            held.tried = None;
            return Ok(held.point);
        }
        let unknown = || {
            Failure::input(format!(
                "state {number} of a cell is not known: it is older than the step before the present one, or comes from another process; \
                 restarts from results are not supported"
            ))
        };
        let made = *self.made.get(&number).ok_or_else(unknown)?;
        let (point, tried) = match made.from {
            AS_PACKED => (cells.new_point()?, None),
            from => {
                let held = self.held.get_mut(&from).ok_or_else(unknown)?;
                (held.point, held.tried.take())
            }
        };
        if tried != Some(number) {
            cells.repeat(point, made.target, made.options)?;
        }
        cells.commit(point)?;
        // What else began from the same state cannot be reached any more.
        if let Some(origin) = self.held.remove(&made.from) {
            for other in &origin.further {
                self.made.remove(other);
            }
        }
        self.held.insert(number, Held { point, further: Vec::new(), tried: None });
        Ok(point)
    }

    /// The number of the state that this trial leads to.
    pub(super) fn made(&mut self, from: u64, target: Tensor2, options: TrialOptions) -> u64 {
        self.last += 1;
        match self.held.get_mut(&from) {
            Some(held) => {
                held.tried = Some(self.last);
                held.further.push(self.last);
            }
            None if from == AS_PACKED => {}
            // Another thread has gone on from the same state meanwhile.
            None => return self.last,
        }
        self.made.insert(self.last, Made { from, target, options });
        self.last
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;

    /// A point that adds up the vertical strains that were committed.
    #[derive(Clone, Copy, Debug, Default)]
    struct Sum {
        committed: f64,
        trial: Option<f64>,
    }

    /// Cells that refuse strains above one, and count trials.
    #[derive(Debug, Default)]
    struct Sums(RefCell<(Vec<Sum>, usize)>);

    impl Cells for Sums {
        type Point = usize;

        fn new_point(&self) -> Result<usize, Failure> {
            let points = &mut self.0.borrow_mut().0;
            points.push(Sum::default());
            Ok(points.len() - 1)
        }

        fn repeat(&self, point: usize, target: Tensor2, _: TrialOptions) -> Result<(), Failure> {
            let (points, trials) = &mut *self.0.borrow_mut();
            *trials += 1;
            let strain = target.get(1, 1);
            points[point].trial = (strain.abs() <= 1.0).then_some(points[point].committed + strain);
            points[point].trial.map(drop).ok_or_else(|| Failure::input("refused"))
        }

        fn commit(&self, point: usize) -> Result<(), Failure> {
            let points = &mut self.0.borrow_mut().0;
            let trial = points[point].trial.take().ok_or_else(|| Failure::input("nothing to commit"))?;
            points[point].committed = trial;
            Ok(())
        }
    }

    impl Sums {
        fn trials(&self) -> usize {
            self.0.borrow().1
        }

        /// A call of a host, as [`super::super::integrate`] makes it: the number of the state made, 0 without an integration.
        fn call(
            &self,
            states: &mut States<usize>,
            from: u64,
            strain: f64,
            is_integrated: bool,
        ) -> Result<u64, Failure> {
            let mut target = Tensor2::ZERO;
            target.0[4] = if is_integrated { strain } else { 0.0 };
            let options = TrialOptions::default();
            let point = states.enter(from, self)?;
            self.repeat(point, target, options)?;
            Ok(if is_integrated { states.made(from, target, options) } else { AS_PACKED })
        }

        /// The strain of the committed state with this number.
        fn strain(&self, states: &mut States<usize>, number: u64) -> f64 {
            let point = states.enter(number, self).unwrap();
            self.0.borrow().0[point].committed
        }
    }

    #[test]
    fn an_operator_without_an_integration_leaves_the_state_that_an_iteration_led_to() {
        let (cells, mut states) = (Sums::default(), States::new());
        let first = cells.call(&mut states, AS_PACKED, 0.25, true).unwrap();
        let second = cells.call(&mut states, first, 0.5, true).unwrap();
        cells.call(&mut states, first, 0.0, false).unwrap();
        let third = cells.call(&mut states, second, 0.125, true).unwrap();
        assert_eq!(cells.strain(&mut states, third), 0.875);
    }

    #[test]
    fn a_refused_iteration_leaves_the_state_that_an_earlier_one_led_to() {
        let (cells, mut states) = (Sums::default(), States::new());
        let first = cells.call(&mut states, AS_PACKED, 0.25, true).unwrap();
        let second = cells.call(&mut states, first, 0.5, true).unwrap();
        assert!(cells.call(&mut states, first, 3.0, true).is_err());
        let third = cells.call(&mut states, second, 0.125, true).unwrap();
        assert_eq!(cells.strain(&mut states, third), 0.875);
    }

    /// Iterations of all points but of their first steps are forgotten with the states that they began from.
    #[test]
    fn what_cannot_be_reached_any_more_is_forgotten() {
        let (cells, mut states) = (Sums::default(), States::new());
        let first: Vec<u64> = (0..3).map(|_| cells.call(&mut states, AS_PACKED, 0.25, true).unwrap()).collect();
        let mut present = first.clone();
        for _ in 0..4 {
            for state in &mut present {
                let from = *state;
                for _ in 0..5 {
                    *state = cells.call(&mut states, from, 0.01, true).unwrap();
                }
            }
        }
        // Of each point: the state of its first step, and the iterations of the present one.
        assert_eq!((states.held.len(), states.made.len()), (3, 3 + 3 * 5));
        // A trial whose origin another thread has left meanwhile.
        let late = states.made(first[0], Tensor2::ZERO, TrialOptions::default());
        assert!(states.enter(late, &cells).is_err());
        assert_eq!(states.made.len(), 3 + 3 * 5);
    }

    /// The first step of a point is solved once more, later ones are not.
    #[test]
    fn the_last_iteration_is_not_solved_again() {
        let (cells, mut states) = (Sums::default(), States::new());
        let first = cells.call(&mut states, AS_PACKED, 0.25, true).unwrap();
        cells.call(&mut states, first, 0.5, true).unwrap();
        let second = cells.call(&mut states, first, 0.25, true).unwrap();
        let third = cells.call(&mut states, second, 0.125, true).unwrap();
        assert_eq!(cells.trials(), 5);
        assert_eq!(cells.strain(&mut states, third), 0.625);
        assert!(states.enter(second, &cells).is_err(), "an older state is gone");
    }
}
