//! States as values: what a host hands in as an internal state variable, and what it gets back.
//!
//! A host of MGIS calls with the state at the begin of a step and receives another one; it keeps, copies and drops both as it likes. Here
//! a state is a number: 0 is the cell as packed, and every integration makes a new one, which is known by the state it came from and its
//! deformation. Grains are kept for the states that hosts begin steps from. When a host begins a step from a number for the first time,
//! the trial behind it is committed; if it is not the last trial of its point, it is repeated first, which gives the same bits.

use crate::ffi_boundary::Failure;
use crate::material::Material;
use grain_pool::State;
use protocol::{Tensor2, TrialOptions};
use std::collections::BTreeMap;

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

/// A point of the pool: its grains are those of the state `committed`, its trial leads to `tried`.
#[derive(Clone, Copy, Debug)]
struct Held {
    state: State,
    tried: Option<u64>,
}

/// All states that this process knows.
#[derive(Debug)]
pub(super) struct States {
    /// Point from which trials of the cell as packed are made; it is never committed.
    origin: Option<State>,
    /// Points by the number of their committed state.
    held: BTreeMap<u64, Held>,
    made: BTreeMap<u64, Made>,
    last: u64,
}

impl States {
    /// No state but the cell as packed.
    pub(super) const fn new() -> Self {
        Self { origin: None, held: BTreeMap::new(), made: BTreeMap::new(), last: AS_PACKED }
    }

    /// The point whose committed state has this number.
    ///
    /// # Errors
    /// The number is unknown, or its point has gone on to a later state; the pool fails.
    pub(super) fn enter(&mut self, number: u64, material: &Material) -> Result<State, Failure> {
        if number == AS_PACKED {
            return match self.origin {
                Some(state) => Ok(state),
                None => Ok(*self.origin.insert(material.new_state()?)),
            };
        }
        if let Some(held) = self.held.get(&number) {
            return Ok(held.state);
        }
        let unknown = || {
            Failure::input(format!(
                "state {number} of a cell is not known: it is older than the step before the present one, or comes from another process; \
                 restarts from results are not supported"
            ))
        };
        let made = *self.made.get(&number).ok_or_else(unknown)?;
        let held = match made.from {
            AS_PACKED => Held { state: material.new_state()?, tried: None },
            from => *self.held.get(&from).ok_or_else(unknown)?,
        };
        if held.tried != Some(number) {
            material.trial(held.state, made.target, made.options)?;
        }
        material.pool.commit(&[held.state])?;
        // What else began from the same state cannot be reached any more. Other points may begin from the cell as packed.
        if made.from != AS_PACKED {
            self.held.remove(&made.from);
            self.made.retain(|_, other| other.from != made.from);
        }
        self.held.insert(number, Held { state: held.state, tried: None });
        Ok(held.state)
    }

    /// The number of the state that this trial leads to.
    pub(super) fn made(&mut self, from: u64, target: Tensor2, options: TrialOptions) -> u64 {
        self.last += 1;
        self.made.insert(self.last, Made { from, target, options });
        if let Some(held) = self.held.get_mut(&from) {
            held.tried = Some(self.last);
        }
        self.last
    }
}
