//! What a body keeps across an interruption.

use super::super::SpecimenSpace;
use super::super::contact::{Load, PairLoad, Slot};
use super::super::keeper::Keeper;
use super::Body;
use crate::cell::PairKey;
use crate::contact::ContactLaw;
use crate::space::Components;

impl<S: SpecimenSpace, C: ContactLaw<S>> Body<S, C> {
    /// Saves or loads the state. A body that loads has the law that the saved one had.
    pub(crate) fn keep(&mut self, keeper: &mut Keeper<'_>) {
        for period in [&mut self.periods.carried, &mut self.listed_periods].into_iter().flatten().flatten() {
            keeper.numbers(period.components_mut());
        }
        for vector in self.periods.rates.iter_mut().chain(&mut self.side_forces) {
            keeper.numbers(vector.components_mut());
        }
        self.periods.folds.iter_mut().flatten().for_each(|fold| keeper.integer(fold));
        keeper.fixed(&mut self.grains, |keeper, grain| {
            keeper.numbers(grain.position.as_mut());
            keeper.numbers(grain.velocity.as_mut());
            keeper.numbers(grain.spin.as_mut());
        });
        keeper.fixed(&mut self.loads, |keeper, load: &mut Load<S>| {
            keeper.numbers(load.force.as_mut());
            keeper.numbers(load.moment.as_mut());
        });
        keeper.fixed(&mut self.masses, |keeper, mass| keeper.number(mass));
        keeper.fixed(&mut self.listed_at, |keeper, place| keeper.numbers(place.as_mut()));
        let blank = PairKey::canonical(0, 0, S::Shift::default());
        keeper.list(&mut self.keys, &blank, |keeper, key| {
            keeper.index(&mut key.origin);
            keeper.index(&mut key.end);
            (0..S::DIMENSION).for_each(|axis| keeper.integer(&mut key.shift[axis]));
        });
        if keeper.is_loading() {
            let count = self.grains.len();
            if self.keys.iter().any(|key| key.origin as usize >= count || key.end as usize >= count) {
                keeper.refuse();
                return;
            }
            self.blank_pairs();
        }
        keeper.fixed(&mut self.slots, |keeper, slot: &mut Slot<S, C>| keeper.slot(slot));
        keeper.fixed(&mut self.pair_loads, |keeper, load: &mut PairLoad<S>| {
            keeper.numbers(load.force.as_mut());
            load.moments.iter_mut().for_each(|moment| keeper.numbers(moment.as_mut()));
        });
        keeper.count(&mut self.renewals);
        if keeper.is_loading() {
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
