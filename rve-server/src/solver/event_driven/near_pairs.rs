//! Near pairs in lanes: what does not change from trial to trial as long as the list does not.

use crate::cell::{Cell, PairKey};
use crate::contact::{ContactLaw, PlainLinear};
use crate::definition::GrainModel;
use crate::simd::{Lanes, Real};
use crate::solver::kernel::ListedPair;
use crate::space::Discs;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Pairs side by side.
pub(super) const WIDTH: usize = 8;

/// A number of each of them.
pub(super) type Packed = Lanes<WIDTH>;

/// Constants of pairs side by side; zero in lanes without a pair.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct GroupConstants {
    /// Radii of origin and end grain, m.
    pub(super) radii: [Packed; 2],
    /// Constants of the law.
    pub(super) law: [Packed; 7],
}

/// A list of near pairs.
#[derive(Debug)]
pub(super) struct NearPairs {
    /// Their names, sorted.
    pub(super) keys: Arc<Vec<PairKey<Discs>>>,
    /// Their grains and images, in the same order.
    pub(super) listed: Vec<ListedPair>,
    /// Their constants, in the same order.
    pub(super) groups: Vec<GroupConstants>,
    /// 1 / radius of all grains, 1/m.
    pub(super) inverse_radii: Vec<f64>,
    /// Mean radius, m.
    pub(super) mean_radius: f64,
    /// Largest radius, m.
    pub(super) largest_radius: f64,
    shifts: Vec<[i32; 2]>,
}

/// Lists that states in use refer to. Nothing but speed depends on what is kept.
#[derive(Debug, Default)]
pub(super) struct NearPairsMemory {
    /// By the address of the keys, which cannot be given to another list as long as this one is kept.
    known: BTreeMap<usize, Arc<NearPairs>>,
}

impl NearPairs {
    /// With the constants of its pairs.
    fn of(keys: &Arc<Vec<PairKey<Discs>>>, model: &GrainModel, law: &PlainLinear) -> Self {
        let mut shifts: Vec<[i32; 2]> = keys.iter().map(|key| key.shift).collect();
        shifts.sort_unstable();
        shifts.dedup();
        let image = |shift: &[i32; 2]| shifts.partition_point(|known| known < shift) as u32;
        let listed = |key: &PairKey<Discs>| ListedPair { origin: key.origin, end: key.end, image: image(&key.shift) };
        let mut groups = vec![GroupConstants::default(); keys.len().div_ceil(WIDTH)];
        for (place, key) in keys.iter().enumerate() {
            let (group, lane) = (&mut groups[place / WIDTH], place % WIDTH);
            let radii = [key.origin, key.end].map(|grain| model.radii[grain as usize]);
            for (value, radius) in group.radii.iter_mut().zip(radii) {
                value.set_lane(lane, radius);
            }
            for (value, constant) in group.law.iter_mut().zip(ContactLaw::<Discs>::constants(law, radii)) {
                value.set_lane(lane, constant);
            }
        }
        Self {
            keys: Arc::clone(keys),
            listed: keys.iter().map(listed).collect(),
            groups,
            inverse_radii: model.radii.iter().map(|radius| 1.0 / radius).collect(),
            mean_radius: model.mean_radius(),
            largest_radius: model.largest_radius(),
            shifts,
        }
    }

    /// Translations of the images in a cell, m.
    pub(super) fn images(&self, cell: &Cell<Discs>) -> Vec<[f64; 2]> {
        self.shifts.iter().map(|shift| cell.translation(*shift)).collect()
    }

    /// One pair's radii, m, and constants of the law.
    pub(super) fn constants(&self, pair: usize) -> ([f64; 2], [f64; 7]) {
        let (group, lane) = (&self.groups[pair / WIDTH], pair % WIDTH);
        (group.radii.map(|value| value.lane(lane)), group.law.map(|value| value.lane(lane)))
    }
}

impl NearPairsMemory {
    /// The list with these names.
    pub(super) fn of(
        &mut self,
        keys: &Arc<Vec<PairKey<Discs>>>,
        model: &GrainModel,
        law: &PlainLinear,
    ) -> Arc<NearPairs> {
        let address = Arc::as_ptr(keys).addr();
        if let Some(known) = self.known.get(&address) {
            return Arc::clone(known);
        }
        // What only this memory holds belongs to states that are gone.
        self.known.retain(|_, near| Arc::strong_count(&near.keys) > 1);
        let near = Arc::new(NearPairs::of(keys, model, law));
        self.known.insert(address, Arc::clone(&near));
        near
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::ContactTable;
    use crate::definition::{GrainDefinition, PackingFile, RveOptions};
    use std::path::Path;

    #[test]
    fn lists_are_kept_as_long_as_states_have_them() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings/discs-100.json");
        let contact = ContactTable::linear(1.0e5, 0.5, 0.5);
        let packing: PackingFile = PackingFile::read(&file).unwrap();
        let definition = GrainDefinition { packing, contact, options: RveOptions::default() };
        let model = GrainModel::new(&definition).unwrap();
        let law = definition.contact.plain_linear().unwrap();
        let list = |end: u32| Arc::new(vec![PairKey { origin: 0, end, shift: [0, 1] }]);
        let mut memory = NearPairsMemory::default();
        let (kept, gone) = (list(1), list(2));
        let first = memory.of(&kept, &model, &law);
        assert!(Arc::ptr_eq(&first, &memory.of(&kept, &model, &law)), "made once");
        drop((memory.of(&gone, &model, &law), gone));
        let third = list(3);
        assert_eq!(memory.of(&third, &model, &law).listed[0].end, 3);
        assert_eq!(memory.known.len(), 2, "the list of a state that is gone has been let go");
    }
}
