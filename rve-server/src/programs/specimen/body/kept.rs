//! What a body keeps across an interruption.

use super::super::SpecimenSpace;
use super::super::contact::{Load, PairLoad, Slot};
use super::super::state_stream::StateStream;
use super::Body;
use crate::cell::PairKey;
use crate::contact::ContactLaw;
use crate::space::Components;

impl<S: SpecimenSpace, C: ContactLaw<S>> Body<S, C> {
    /// Saves or loads the state. A body that loads has the law that the saved one had.
    pub(crate) fn keep(&mut self, stream: &mut StateStream<'_>) {
        for period in [&mut self.periods.carried, &mut self.listed_periods].into_iter().flatten().flatten() {
            stream.numbers(period.components_mut());
        }
        for vector in self.periods.rates.iter_mut().chain(&mut self.side_forces) {
            stream.numbers(vector.components_mut());
        }
        self.periods.folds.iter_mut().flatten().for_each(|fold| stream.integer(fold));
        stream.fixed(&mut self.grains, |stream, grain| {
            stream.numbers(grain.position.as_mut());
            stream.numbers(grain.velocity.as_mut());
            stream.numbers(grain.spin.as_mut());
        });
        stream.fixed(&mut self.loads, |stream, load: &mut Load<S>| {
            stream.numbers(load.force.as_mut());
            stream.numbers(load.moment.as_mut());
        });
        stream.fixed(&mut self.masses, |stream, mass| stream.number(mass));
        stream.fixed(&mut self.listed_at, |stream, place| stream.numbers(place.as_mut()));
        let blank = PairKey::canonical(0, 0, S::Shift::default());
        stream.list(&mut self.keys, &blank, |stream, key| {
            stream.index(&mut key.origin);
            stream.index(&mut key.end);
            (0..S::DIMENSION).for_each(|axis| stream.integer(&mut key.shift[axis]));
        });
        if stream.is_loading() {
            let count = self.grains.len();
            if self.keys.iter().any(|key| key.origin as usize >= count || key.end as usize >= count) {
                stream.refuse();
                return;
            }
            self.blank_pairs();
        }
        stream.fixed(&mut self.slots, |stream, slot: &mut Slot<S, C>| stream.slot(slot));
        stream.fixed(&mut self.pair_loads, |stream, load: &mut PairLoad<S>| {
            stream.numbers(load.force.as_mut());
            load.moments.iter_mut().for_each(|moment| stream.numbers(moment.as_mut()));
        });
        stream.count(&mut self.renewals);
        if stream.is_loading() {
            self.list_touching();
            self.place_images();
        }
    }

    /// Everything that follows from the keys, with contacts that do not touch.
    fn blank_pairs(&mut self) {
        self.list_shifts();
        self.slots = self.keys.iter().map(|key| self.fresh_slot(key)).collect();
        self.pairs = self.keys.iter().map(|key| self.listed(key)).collect();
        self.pair_loads.clear();
        self.pair_loads.resize(self.pairs.len(), PairLoad::none());
        self.list_members();
    }
}
