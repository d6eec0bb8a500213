//! The state of a run as bytes and back: one walk over the state both saves and loads it, so that the two cannot differ.
//!
//! Everything that can influence a later bit is kept, the list of pairs included: sums over contacts run in blocks of that list. What
//! follows from the test and the packing is not.

use super::SpecimenSpace;
use super::contact::{ContactSums, Slot};
use super::dynamics::GrainSums;
use crate::contact::ContactLaw;

/// Walks over a state, either writing it down or putting back what was written.
pub(crate) struct StateStream<'a> {
    saved: Vec<u8>,
    /// What is left to be put back; `None` while saving.
    rest: Option<&'a [u8]>,
    /// Whether what was written does not fit.
    is_unfit: bool,
}

impl<'a> StateStream<'a> {
    /// One that writes down.
    pub(crate) fn saving() -> Self {
        StateStream { saved: Vec::new(), rest: None, is_unfit: false }
    }

    /// One that puts back.
    pub(crate) fn loading(state: &'a [u8]) -> Self {
        StateStream { saved: Vec::new(), rest: Some(state), is_unfit: false }
    }

    /// What was written down.
    pub(crate) fn into_bytes(self) -> Vec<u8> {
        self.saved
    }

    /// Whether everything was put back and nothing is left.
    pub(crate) fn fits(&self) -> bool {
        !self.is_unfit && self.rest.is_none_or(<[u8]>::is_empty)
    }

    pub(crate) fn is_loading(&self) -> bool {
        self.rest.is_some()
    }

    fn word(&mut self, value: u64) -> u64 {
        match &mut self.rest {
            None => {
                self.saved.extend(value.to_le_bytes());
                value
            }
            Some(rest) => match rest.split_first_chunk() {
                Some((word, after)) => {
                    *rest = after;
                    u64::from_le_bytes(*word)
                }
                None => {
                    self.is_unfit = true;
                    value
                }
            },
        }
    }

    pub(crate) fn number(&mut self, value: &mut f64) {
        *value = f64::from_bits(self.word(value.to_bits()));
    }

    pub(crate) fn numbers(&mut self, values: &mut [f64]) {
        values.iter_mut().for_each(|value| self.number(value));
    }

    pub(crate) fn count(&mut self, value: &mut u64) {
        *value = self.word(*value);
    }

    pub(crate) fn index(&mut self, value: &mut u32) {
        let word = self.word(u64::from(*value));
        *value = u32::try_from(word).unwrap_or_else(|_| {
            self.is_unfit = true;
            *value
        });
    }

    pub(crate) fn integer(&mut self, value: &mut i32) {
        let word = self.word(i64::from(*value) as u64) as i64;
        *value = i32::try_from(word).unwrap_or_else(|_| {
            self.is_unfit = true;
            *value
        });
    }

    pub(crate) fn flag(&mut self, value: &mut bool) {
        *value = self.word(u64::from(*value)) != 0;
    }

    /// A list of any length; `blank` is what an item is before it is put back.
    pub(crate) fn list<T: Clone>(&mut self, list: &mut Vec<T>, blank: &T, mut item: impl FnMut(&mut Self, &mut T)) {
        let mut length = list.len() as u64;
        self.count(&mut length);
        if let Some(rest) = self.rest {
            // Every item takes a word at least: a length that is no length must not ask for all memory.
            if length > rest.len() as u64 / 8 {
                self.is_unfit = true;
                return;
            }
            list.clear();
            list.resize(length as usize, blank.clone());
        }
        list.iter_mut().for_each(|value| item(self, value));
    }

    /// A list whose length follows from the test.
    pub(crate) fn fixed<T>(&mut self, list: &mut [T], mut item: impl FnMut(&mut Self, &mut T)) {
        let own = list.len() as u64;
        let mut length = own;
        self.count(&mut length);
        if length != own {
            self.is_unfit = true;
            return;
        }
        list.iter_mut().for_each(|value| item(self, value));
    }

    /// What cannot be right although it could be read.
    pub(crate) fn refuse(&mut self) {
        self.is_unfit = true;
    }

    pub(super) fn sums(&mut self, sums: &mut ContactSums) {
        self.count(&mut sums.contacts);
        self.number(&mut sums.normal_force);
        self.number(&mut sums.dissipation);
        self.number(&mut sums.viscous_work);
        self.number(&mut sums.elastic_energy);
        self.count(&mut sums.sliding);
        self.number(&mut sums.largest_overlap);
    }

    pub(super) fn grain_sums(&mut self, sums: &mut GrainSums) {
        self.number(&mut sums.kinetic_energy);
        self.number(&mut sums.largest_force);
        self.number(&mut sums.free_weight);
        self.number(&mut sums.gravity_work);
        self.number(&mut sums.damping_work);
    }

    /// History of a contact. Radii and constants follow from the law.
    pub(super) fn slot<S: SpecimenSpace, C: ContactLaw<S>>(&mut self, slot: &mut Slot<S, C>) {
        self.number(&mut slot.viscosity);
        self.number(&mut slot.viscous_force);
        self.flag(&mut slot.touches);
        self.numbers(slot.direction.as_mut());
        self.numbers(slot.tangential_force.as_mut());
        self.numbers(slot.memory.as_mut());
        self.number(&mut slot.overlap);
        self.number(&mut slot.normal_force);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn walk(stream: &mut StateStream<'_>, number: &mut f64, list: &mut Vec<i32>) {
        stream.number(number);
        stream.list(list, &0, |stream, value| stream.integer(value));
    }

    #[test]
    fn what_is_saved_comes_back_bit_by_bit_and_what_is_cut_short_is_refused() {
        let mut saving = StateStream::saving();
        walk(&mut saving, &mut f64::from_bits(0x7ff8_0000_0000_0001), &mut vec![3, -7]);
        let bytes = saving.into_bytes();
        let (mut number, mut list) = (0.0, vec![1, 2, 3, 4]);
        let mut loading = StateStream::loading(&bytes);
        walk(&mut loading, &mut number, &mut list);
        assert!(loading.fits());
        assert_eq!((number.to_bits(), list), (0x7ff8_0000_0000_0001, vec![3, -7]));
        for length in [bytes.len() - 8, 8, 0] {
            let mut loading = StateStream::loading(&bytes[..length]);
            walk(&mut loading, &mut 0.0, &mut Vec::new());
            assert!(!loading.fits(), "{length}");
        }
        let longer: Vec<u8> = bytes.iter().copied().chain([0; 8]).collect();
        let mut loading = StateStream::loading(&longer);
        walk(&mut loading, &mut 0.0, &mut Vec::new());
        assert!(!loading.fits());
    }
}
