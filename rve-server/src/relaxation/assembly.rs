//! The working set of one trial: kernel slots, the pair list and the bound that tells when the list must be renewed.

use super::kernel::{self, ContactSums, GrainSlot, LoadSlot, PairSlot, Touching};
use crate::cell::Cell;
use crate::lanes::{Kinematics, Tuple};
use crate::law::ContactLaw;
use crate::model::GrainModel;
use crate::pairs::{PairFinder, PairKey};
use crate::space::{Axial, Components, Space, Tensor, add_scaled, inverse, norm, product, transpose};
use crate::state::GrainState;
use std::cmp::Ordering;

/// Skin of the pair list in mean radii: at a strain of 1e-6 per step a list lives for thousands of steps, and a thicker
/// skin would only make the kernel look at more empty pairs.
const SKIN: f64 = 0.05;

/// Grains, contacts and loads in kernel form. Reused from trial to trial.
#[derive(Clone, Debug)]
pub(crate) struct Assembly<S: Space, L: ContactLaw<S::Kinematics>> {
    pub(crate) law: L,
    pub(crate) cell: Option<Cell<S>>,
    pub(crate) grains: Vec<GrainSlot<S>>,
    pub(crate) loads: Vec<LoadSlot<S>>,
    pub(crate) rotations: Vec<S::Spin>,
    pub(crate) pairs: Vec<PairSlot<S, L>>,
    pub(crate) keys: Vec<PairKey<S>>,
    pub(crate) images: Vec<S::Vector>,
    pub(crate) dissipation: f64,
    /// Another skin than usual, in mean radii; no result depends on it.
    pub(crate) skin_in_radii: Option<f64>,
    shifts: Vec<S::Shift>,
    touching: Touching<S>,
    finder: PairFinder<S>,
    old_pairs: Vec<PairSlot<S, L>>,
    old_keys: Vec<PairKey<S>>,
    listed_cell: S::Tensor,
    wandered: f64,
    skin: f64,
}

impl<S: Space, L: ContactLaw<S::Kinematics>> Assembly<S, L> {
    /// Empty working memory for a law.
    pub(crate) fn new(law: L) -> Self {
        Self {
            law,
            cell: None,
            grains: Vec::new(),
            loads: Vec::new(),
            rotations: Vec::new(),
            pairs: Vec::new(),
            keys: Vec::new(),
            images: Vec::new(),
            dissipation: 0.0,
            skin_in_radii: None,
            shifts: Vec::new(),
            touching: Touching::default(),
            finder: PairFinder::default(),
            old_pairs: Vec::new(),
            old_keys: Vec::new(),
            listed_cell: S::Tensor::IDENTITY,
            wandered: 0.0,
            skin: 0.0,
        }
    }

    /// Takes a state over; loads are not valid until the first evaluation.
    pub(crate) fn load(&mut self, model: &GrainModel, state: &GrainState<S>) {
        self.cell = Some(state.cell);
        self.skin = self.skin_in_radii.unwrap_or(SKIN) * model.mean_radius();
        self.dissipation = state.dissipation;
        self.grains.clear();
        self.grains.extend(state.positions.iter().zip(&model.radii).map(|(position, radius)| GrainSlot {
            position: *position,
            spin: S::Spin::ZERO,
            radius: *radius,
        }));
        self.loads.clear();
        self.loads.resize(self.grains.len(), LoadSlot::default());
        self.rotations.clone_from(&state.rotations);
        self.pairs.clear();
        self.keys.clear();
        self.list_pairs(model);
        self.adopt_contacts(state);
    }

    /// The periodic cell.
    pub(crate) fn cell(&self) -> Cell<S> {
        self.cell.expect("a state has been loaded")
    }

    /// Sets the cell and with it all image translations.
    pub(crate) fn set_cell(&mut self, cell: Cell<S>) {
        self.cell = Some(cell);
        for (image, shift) in self.images.iter_mut().zip(&self.shifts) {
            *image = cell.translation(*shift);
        }
    }

    /// Notes that no grain has moved by more than `distance` against the affine motion.
    pub(crate) fn wander(&mut self, distance: f64) {
        self.wandered += distance;
    }

    /// Renews the pair list if an unlisted pair could touch by now.
    pub(crate) fn keep_list_complete(&mut self, model: &GrainModel) {
        // An unlisted pair was at least the skin away from touching. Its branch vector has since been stretched by the
        // cell's deformation, at most by |D|, and by both grains' own motion.
        let since = product(&transpose(&self.cell().rows), &inverse(&transpose(&self.listed_cell)));
        let stretch = norm(&add_scaled(&since, -1.0, &S::Tensor::IDENTITY));
        let range = 2.0 * model.largest_radius() + self.skin;
        if 2.0 * self.wandered * (1.0 + 2.0 * stretch) + stretch * range >= self.skin {
            self.list_pairs(model);
        }
    }

    /// All contact forces for the present positions.
    pub(crate) fn evaluate(&mut self) -> ContactSums {
        let sums = kernel::evaluate(
            &self.law,
            &self.grains,
            &self.images,
            &mut self.pairs,
            &mut self.touching,
            &mut self.loads,
        );
        self.dissipation += sums.dissipation;
        sums
    }

    /// All contact forces for the present positions with all grains at rest: nothing viscous acts.
    pub(crate) fn evaluate_at_rest(&mut self) -> ContactSums {
        for grain in &mut self.grains {
            grain.spin = S::Spin::ZERO;
        }
        self.evaluate()
    }

    /// Touching pairs with their keys, in key order.
    pub(crate) fn contacts(&self) -> impl Iterator<Item = (&PairKey<S>, &PairSlot<S, L>)> {
        self.keys.iter().zip(&self.pairs).filter(|(_, pair)| pair.touches())
    }

    /// Branch vector of a listed pair, m.
    pub(crate) fn branch(&self, pair: &PairSlot<S, L>) -> S::Vector {
        let (o, e) = (self.grains[pair.origin as usize].position, self.grains[pair.end as usize].position);
        e.minus(o).plus(self.images[pair.image as usize])
    }

    /// Overlap of a touching pair, m.
    pub(crate) fn overlap(&self, pair: &PairSlot<S, L>) -> f64 {
        let range = self.grains[pair.origin as usize].radius + self.grains[pair.end as usize].radius;
        range - self.branch(pair).norm()
    }

    /// Normal force of a touching pair, N.
    pub(crate) fn normal_force(&self, pair: &PairSlot<S, L>) -> f64 {
        self.law.normal_force(&pair.constants, self.overlap(pair))
    }

    /// Energy stored in a touching pair, J.
    pub(crate) fn energy(&self, pair: &PairSlot<S, L>) -> f64 {
        let force = S::Kinematics::length(pair.tangential_force);
        self.law.energy(&pair.constants, self.overlap(pair), force, &pair.memory)
    }

    fn list_pairs(&mut self, model: &GrainModel) {
        std::mem::swap(&mut self.keys, &mut self.old_keys);
        std::mem::swap(&mut self.pairs, &mut self.old_pairs);
        let cell = self.cell();
        let positions = self.grains.iter().map(|grain| grain.position);
        self.finder.find(&cell, positions, &model.radii, self.skin, &mut self.keys);
        self.listed_cell = cell.rows;
        self.wandered = 0.0;

        self.shifts.clear();
        self.shifts.extend(self.keys.iter().map(|key| key.shift));
        self.shifts.sort_unstable();
        self.shifts.dedup();
        self.images.clear();
        self.images.extend(self.shifts.iter().map(|shift| cell.translation(*shift)));

        self.pairs.clear();
        let mut old = self.old_keys.iter().zip(&self.old_pairs).peekable();
        for key in &self.keys {
            while old.next_if(|(old_key, _)| *old_key < key).is_some() {}
            let image = self.shifts.binary_search(&key.shift).expect("every shift was collected") as u32;
            let slot = match old.next_if(|(old_key, _)| *old_key == key) {
                Some((_, slot)) => PairSlot { image, ..*slot },
                None => {
                    let radii = [model.radii[key.origin as usize], model.radii[key.end as usize]];
                    PairSlot::new(&self.law, key.origin, key.end, image, radii)
                }
            };
            self.pairs.push(slot);
        }
        self.touching.reserve(self.pairs.len());
    }

    /// Gives recorded contacts their force and direction back.
    fn adopt_contacts(&mut self, state: &GrainState<S>) {
        let mut next = 0;
        for (place, contact) in state.contacts.iter().enumerate() {
            let key = contact.key();
            while next < self.keys.len() && self.keys[next].cmp(&key) == Ordering::Less {
                next += 1;
            }
            if next == self.keys.len() {
                break;
            }
            if self.keys[next] != key {
                continue;
            }
            let branch = self.branch(&self.pairs[next]);
            // The same operations as in the kernel, so that the first evaluation sees a turn of exactly zero.
            let direction = branch.times(1.0 / branch.dot(branch).sqrt());
            let overlap = self.overlap(&self.pairs[next]);
            let moment: Axial<S> =
                state.rolling_moments.get(place).map_or_else(Tuple::zero, |moment| S::axial(*moment));
            let pair = &mut self.pairs[next];
            pair.touching = 1;
            pair.direction = direction;
            pair.tangential_force = S::to_axial(contact.tangential_force, direction);
            pair.memory = self.law.resumed(overlap, moment);
        }
    }
}
