//! Where a run is, and how it goes on from there with the bits of an undisturbed one.

use super::assembly::Joinable;
use super::error::SpecimenError;
use super::run::Run;
use super::state_stream::StateStream;
use crate::contact::ContactLaw;

/// How a run keeps its state, and what it begins with.
#[derive(Clone, Copy, Debug, Default)]
pub struct Checkpoints<'a> {
    /// Steps between two states that are handed out; none if absent.
    pub every: Option<u64>,
    /// State of an earlier process of the same test and packing, to go on from.
    pub from: Option<&'a [u8]>,
}

/// Where a run is in its stages.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Place {
    /// Number of the stage, from 0.
    pub(super) stage: u64,
    /// Steps done in it; a stage that has not begun has none and no lengths.
    pub(super) done: u64,
    /// Rows of the stage so far.
    pub(super) row: u64,
    /// Lengths of the box when the stage began, m.
    pub(super) lengths: [f64; 3],
    /// Periods of the periodic axes when the stage began, m.
    pub(super) periods: [[f64; 3]; 3],
}

impl<S: Joinable, C: ContactLaw<S>> Run<'_, S, C> {
    /// The state as bytes.
    pub(super) fn state(&mut self) -> Vec<u8> {
        let mut stream = StateStream::saving();
        self.keep(&mut stream);
        stream.into_bytes()
    }

    /// Goes on from a state.
    ///
    /// # Errors
    /// A state of another test or packing.
    pub(super) fn restore(&mut self, state: &[u8]) -> Result<(), SpecimenError> {
        let mut stream = StateStream::loading(state);
        self.keep(&mut stream);
        if stream.fits() && self.place.stage as usize <= self.test.stage.len() {
            Ok(())
        } else {
            Err(SpecimenError::Unfit)
        }
    }

    fn keep(&mut self, stream: &mut StateStream<'_>) {
        stream.count(&mut self.place.stage);
        stream.count(&mut self.place.done);
        stream.count(&mut self.place.row);
        stream.numbers(&mut self.place.lengths);
        self.place.periods.iter_mut().for_each(|period| stream.numbers(period));
        // Constants of contacts follow from the law of the stage.
        if let Some(stage) = self.test.stage.get(self.place.stage as usize) {
            self.use_friction_of(stage);
        }
        self.dynamics.keep(stream);
        stream.grain_sums(&mut self.last);
        let summary = &mut self.summary;
        for count in [
            &mut summary.unbalanced_stages,
            &mut summary.servo_misses,
            &mut summary.energy_misses,
            &mut summary.overlap_misses,
            &mut summary.unbalanced_rows,
            &mut summary.shear_misses,
        ] {
            stream.count(count);
        }
        for number in [
            &mut summary.largest_servo_error,
            &mut summary.largest_energy_error,
            &mut summary.largest_turnover,
            &mut summary.largest_overlap,
            &mut summary.largest_unbalanced,
            &mut summary.largest_shear_difference,
        ] {
            stream.number(number);
        }
    }
}
