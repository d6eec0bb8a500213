//! One block of pairs: those that touch are collected and evaluated eight side by side, with the widest instructions that help.

use super::SpecimenSpace;
use super::contact::{ContactSums, Grain, PairLoad, Slot};
use super::contact_forces::{ForceSums, History, PairMotion, contact_forces};
use crate::contact::ContactLaw;
use crate::simd::{Lanes, Real, Tuple, Vectorised, dispatch, put_lane, take_lane};

/// Contacts side by side.
const WIDTH: usize = 8;

/// Numbers of contacts side by side.
type Packed = Lanes<WIDTH>;

/// Groups that are collected before the first of them is worked on: numbers that have just been written one by one cannot be
/// read as a whole for a while.
const AHEAD: usize = 4;

/// A listed pair as the search for contacts sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Listed {
    pub(crate) origin: u32,
    pub(crate) end: u32,
    /// Row of the table of image translations.
    pub(crate) image: u32,
    /// Square of the distance below which the pair touches, m2.
    pub(crate) near_square: f64,
}

/// One block: sources of its forces, and their destination.
pub(super) struct Block<'a, S: SpecimenSpace, C: ContactLaw<S>> {
    /// The law of every contact.
    pub law: &'a C,
    /// All grains.
    pub grains: &'a [Grain<S>],
    /// Shifts of the periodic images.
    pub images: &'a [S::Coordinates<f64>],
    /// Velocities of the images, m/s; empty while the periodic sides stand still.
    pub image_velocities: &'a [S::Coordinates<f64>],
    /// The pairs of this block.
    pub pairs: &'a [Listed],
    /// Histories of the contacts of these pairs.
    pub slots: &'a mut [Slot<S, C>],
    /// Whether these pairs touch, for those who need nothing else of them.
    pub touching: &'a mut [bool],
    /// Loads of these pairs on their grains; nothing for pairs that do not touch.
    pub loads: &'a mut [PairLoad<S>],
    /// Whether contacts have dashpots.
    pub is_viscous: bool,
    /// Length of the motion, s.
    pub step: f64,
}

/// Contacts that are worked on side by side.
#[derive(Clone, Copy)]
struct Group<S: SpecimenSpace, C: ContactLaw<S>> {
    history: History<S, C, Packed>,
    motion: PairMotion<S, Packed>,
}

impl<S: SpecimenSpace, C: ContactLaw<S>> Block<'_, S, C> {
    /// Forces of the touching pairs; pairs that have come apart are let go.
    pub(super) fn evaluate(self) -> ContactSums {
        dispatch(self)
    }

    /// Forces of the collected pairs, which have these places in the block.
    #[inline(always)]
    fn evaluate_groups(&mut self, groups: &[Group<S, C>; AHEAD], places: &[usize], sums: &mut ForceSums<Packed>) {
        let step = Packed::splat(self.step);
        for (group, places) in groups.iter().zip(places.chunks(WIDTH)) {
            let mut history = group.history;
            let approach = group.motion.approach(self.law, &mut history, self.is_viscous);
            let [first, second] = group.motion.radii;
            let forces = contact_forces(self.law, &history, &approach, first.smaller(second), step, self.is_viscous);
            sums.add(&forces.sums, Packed::counting().less(Packed::splat(places.len() as f64)));
            for (lane, &place) in places.iter().enumerate() {
                let slot = &mut self.slots[place];
                slot.keep_lane(&approach, &forces, lane);
                self.loads[place] = PairLoad {
                    force: take_lane(&forces.force, lane),
                    moments: [take_lane(&forces.moments[0], lane), take_lane(&forces.moments[1], lane)],
                };
            }
        }
    }
}

impl<S: SpecimenSpace, C: ContactLaw<S>> Vectorised for Block<'_, S, C> {
    type Output = ContactSums;

    #[inline(always)]
    fn run(mut self) -> ContactSums {
        let mut sums = ContactSums::default();
        let mut force_sums = ForceSums::default();
        let mut groups = [Group { history: History::none(), motion: PairMotion::none() }; AHEAD];
        let mut places = [0; AHEAD * WIDTH];
        let mut collected = 0;
        for (place, pair) in self.pairs.iter().enumerate() {
            let (origin, end) = (&self.grains[pair.origin as usize], &self.grains[pair.end as usize]);
            let branch = end.position.minus(origin.position).plus(self.images[pair.image as usize]);
            let touches = branch.dot(branch) < pair.near_square;
            if !touches {
                if self.touching[place] {
                    self.touching[place] = false;
                    self.slots[place].open(self.law, &mut sums);
                    self.loads[place] = PairLoad::none();
                }
                continue;
            }
            self.touching[place] = true;
            let (group, lane) = (&mut groups[collected / WIDTH], collected % WIDTH);
            self.slots[place].put_into_lane(&mut group.history, &mut group.motion.radii, lane);
            put_lane(&mut group.motion.branch, lane, &branch);
            for (spin, grain) in group.motion.spins.iter_mut().zip([origin, end]) {
                put_lane(spin, lane, &grain.spin.scaled(self.step));
            }
            if self.is_viscous {
                let mut velocity = origin.velocity.minus(end.velocity);
                if let Some(image) = self.image_velocities.get(pair.image as usize) {
                    velocity = velocity.minus(*image);
                }
                put_lane(&mut group.motion.velocity, lane, &velocity);
            }
            places[collected] = place;
            collected += 1;
            sums.contacts += 1;
            if collected == places.len() {
                self.evaluate_groups(&groups, &places, &mut force_sums);
                collected = 0;
            }
        }
        self.evaluate_groups(&groups, &places[..collected], &mut force_sums);
        force_sums.add_to(&mut sums);
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::{ContactTable, LawVisitor};
    use crate::space::{Discs, Spheres};

    /// Grains in a row of rows that overlap, touch and turn at random.
    fn grains<S: SpecimenSpace>(count: usize) -> Vec<Grain<S>> {
        let mut state = 7_u64;
        let mut random = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let mut numbers = || <S::Coordinates<f64>>::zero().as_ref().iter().map(|_| random()).collect::<Vec<f64>>();
        (0..count)
            .map(|grain| {
                let (place, velocity, spin) = (numbers(), numbers(), numbers());
                Grain {
                    position: <S::Coordinates<f64>>::build(|axis| {
                        if axis == 0 { 1.9 * grain as f64 + 0.3 * place[0] } else { 0.3 * place[axis] }
                    }),
                    velocity: <S::Coordinates<f64>>::build(|axis| velocity[axis]),
                    spin: <S::Axial<f64>>::build(|axis| spin[axis]),
                    radius: 1.0 + 0.1 * place[0],
                }
            })
            .collect()
    }

    struct SideBySide;

    impl<S: SpecimenSpace> LawVisitor<S> for SideBySide {
        type Output = ();

        fn visit<C: ContactLaw<S>>(self, law: C) {
            for is_viscous in [false, true] {
                let start = grains::<S>(100);
                let slot = |pair: &Listed| {
                    let ends = [&start[pair.origin as usize], &start[pair.end as usize]];
                    let ratio = if is_viscous { 0.2 } else { 0.0 };
                    Slot::<S, C>::new(&law, ends.map(|grain| grain.radius), [1.0, 2.0], ratio, 0.5)
                };
                let listed = |place: u32| Listed { origin: place, end: place + 1, image: 0, near_square: 0.0 };
                let mut pairs: Vec<Listed> = (0..99).map(listed).collect();
                for pair in &mut pairs {
                    let range = start[pair.origin as usize].radius + start[pair.end as usize].radius;
                    pair.near_square = range * range;
                }
                let images = [<S::Coordinates<f64>>::zero()];
                // All pairs in one block, and every pair in a block of its own.
                let run = |length: usize| {
                    let mut grains = start.clone();
                    let mut slots: Vec<Slot<S, C>> = pairs.iter().map(slot).collect();
                    let mut touching = vec![false; pairs.len()];
                    let mut loads = vec![PairLoad::none(); pairs.len()];
                    let mut sums = ContactSums::default();
                    for _ in 0..4 {
                        let parts = pairs.chunks(length).zip(slots.chunks_mut(length));
                        let parts = parts.zip(touching.chunks_mut(length)).zip(loads.chunks_mut(length));
                        for (((pairs, slots), touching), loads) in parts {
                            let block = Block {
                                law: &law,
                                grains: &grains,
                                images: &images,
                                image_velocities: &[],
                                pairs,
                                slots: &mut *slots,
                                touching: &mut *touching,
                                loads,
                                is_viscous,
                                step: 1e-2,
                            };
                            let found = block.evaluate();
                            // Pictures tell the sliding contacts from their histories.
                            let sliding = slots
                                .iter()
                                .zip(&*touching)
                                .filter(|(slot, touches)| **touches && slot.is_sliding(&law));
                            assert_eq!(sliding.count() as u64, found.sliding);
                            sums.add(&found);
                        }
                        for grain in &mut grains {
                            grain.position = grain.velocity.scaled_plus(1e-2, grain.position);
                        }
                    }
                    (slots, touching, loads, sums)
                };
                let (together, alone) = (run(pairs.len()), run(1));
                let flat = format!("{:?}", (&together.0, &together.1, &together.2));
                assert!(flat == format!("{:?}", (&alone.0, &alone.1, &alone.2)));
                let (together, alone) = (together.3, alone.3);
                assert!(together.contacts > 200 && together.contacts < 390, "{}", together.contacts);
                assert_eq!((together.contacts, together.sliding), (alone.contacts, alone.sliding));
                assert!(together.sliding > 10 && together.dissipation > 0.0, "{together:?}");
                let near = |one: f64, other: f64| assert!((one - other).abs() <= 1e-12 * one.abs(), "{one} {other}");
                near(together.dissipation, alone.dissipation);
                near(together.elastic_energy, alone.elastic_energy);
                near(together.viscous_work, alone.viscous_work);
                assert_eq!(together.viscous_work > 0.0, is_viscous);
                assert_eq!(together.largest_overlap, alone.largest_overlap);
            }
        }
    }

    #[test]
    fn contacts_side_by_side_have_the_bits_of_contacts_one_by_one() {
        let table = |text: &str| -> ContactTable { toml::from_str(text).unwrap() };
        let linear = table("law = \"linear\"\nnormal_stiffness = 1e3\nstiffness_ratio = 0.8\nfriction = 0.02");
        linear.compile::<Discs, _>(SideBySide).unwrap();
        linear.compile::<Spheres, _>(SideBySide).unwrap();
        let hertz = "law = \"hertz_mindlin\"\nshear_modulus = 1e4\npoisson_ratio = 0.2\nfriction = 0.02";
        table(hertz).compile::<Spheres, _>(SideBySide).unwrap();
        let rolling = "cohesion = 0.1\nrolling_stiffness = 0.3\nrolling_friction = 0.1";
        table(&format!("{hertz}\n{rolling}")).compile::<Spheres, _>(SideBySide).unwrap();
    }
}
