//! The working set of one trial: kernel slots, the pair list and the bound that tells when the list must be renewed.

use super::kernel::{self, ContactSums, GrainSlot, LinearLaw, LoadSlot, PairSlot, Touching};
use crate::cell::Cell;
use crate::model::GrainModel;
use crate::pairs::{PairFinder, PairKey};
use crate::plane::{self, Plane};
use crate::state::{ContactRecord, GrainState};
use std::cmp::Ordering;

/// Skin of the pair list in mean radii: at a strain of 1e-6 per step a list lives for thousands of steps, and a thicker
/// skin would only make the kernel look at more empty pairs.
const SKIN: f64 = 0.05;

/// Grains, contacts and loads in kernel form. Reused from trial to trial.
#[derive(Clone, Debug, Default)]
pub(crate) struct Assembly {
    pub(crate) cell: Option<Cell>,
    pub(crate) grains: Vec<GrainSlot>,
    pub(crate) loads: Vec<LoadSlot>,
    pub(crate) rotations: Vec<f64>,
    pub(crate) pairs: Vec<PairSlot>,
    pub(crate) keys: Vec<PairKey>,
    pub(crate) images: Vec<[f64; 2]>,
    pub(crate) dissipation: f64,
    /// Another skin than usual, in mean radii; no result depends on it.
    pub(crate) skin_in_radii: Option<f64>,
    shifts: Vec<[i32; 2]>,
    touching: Touching,
    finder: PairFinder,
    old_pairs: Vec<PairSlot>,
    old_keys: Vec<PairKey>,
    listed_cell: Plane,
    wandered: f64,
    skin: f64,
}

impl Assembly {
    /// Takes a state over; loads are not valid until the first evaluation.
    pub(crate) fn load(&mut self, model: &GrainModel, state: &GrainState) {
        self.cell = Some(state.cell);
        self.skin = self.skin_in_radii.unwrap_or(SKIN) * model.mean_radius();
        self.dissipation = state.dissipation;
        self.grains.clear();
        self.grains.extend(state.positions.iter().zip(&model.radii).map(|(position, radius)| GrainSlot {
            position: *position,
            spin: 0.0,
            radius: *radius,
        }));
        self.loads.clear();
        self.loads.resize(self.grains.len(), LoadSlot::default());
        self.rotations.clone_from(&state.rotations);
        self.pairs.clear();
        self.keys.clear();
        self.list_pairs(model);
        self.adopt_contacts(&state.contacts);
    }

    /// The periodic cell.
    pub(crate) fn cell(&self) -> Cell {
        self.cell.expect("a state has been loaded")
    }

    /// Sets the cell and with it all image translations.
    pub(crate) fn set_cell(&mut self, cell: Cell) {
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
        let since = plane::product(
            &plane::transpose(&self.cell().rows),
            &plane::inverse(&plane::transpose(&self.listed_cell)),
        );
        let stretch = plane::norm(&plane::add_scaled(&since, -1.0, &plane::IDENTITY));
        let range = 2.0 * model.largest_radius() + self.skin;
        if 2.0 * self.wandered * (1.0 + 2.0 * stretch) + stretch * range >= self.skin {
            self.list_pairs(model);
        }
    }

    /// All contact forces for the present positions.
    pub(crate) fn evaluate(&mut self, model: &GrainModel) -> ContactSums {
        let sums = kernel::evaluate(
            &model.law,
            &self.grains,
            &self.images,
            &mut self.pairs,
            &mut self.touching,
            &mut self.loads,
        );
        self.dissipation += sums.dissipation;
        sums
    }

    /// Touching pairs with their keys, in key order.
    pub(crate) fn contacts(&self) -> impl Iterator<Item = (&PairKey, &PairSlot)> {
        self.keys.iter().zip(&self.pairs).filter(|(_, pair)| pair.touches())
    }

    /// Branch vector of a listed pair, m.
    pub(crate) fn branch(&self, pair: &PairSlot) -> [f64; 2] {
        let (o, e) = (self.grains[pair.origin as usize].position, self.grains[pair.end as usize].position);
        let image = self.images[pair.image as usize];
        [(e[0] - o[0]) + image[0], (e[1] - o[1]) + image[1]]
    }

    /// Length of the branch vector and overlap of a touching pair, m.
    pub(crate) fn length_and_overlap(&self, pair: &PairSlot) -> (f64, f64) {
        let branch = self.branch(pair);
        let length = (branch[0] * branch[0] + branch[1] * branch[1]).sqrt();
        let range = self.grains[pair.origin as usize].radius + self.grains[pair.end as usize].radius;
        (length, range - length)
    }

    /// Normal force of a touching pair, N.
    pub(crate) fn normal_force(&self, law: &LinearLaw, pair: &PairSlot) -> f64 {
        let (_, overlap) = self.length_and_overlap(pair);
        -pair.normal_stiffness * (overlap - law.cohesion)
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
                None => fresh_slot(model, key, image),
            };
            self.pairs.push(slot);
        }
        self.touching.reserve(self.pairs.len());
    }

    /// Gives recorded contacts their force and direction back.
    fn adopt_contacts(&mut self, contacts: &[ContactRecord]) {
        let mut next = 0;
        for contact in contacts {
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
            let scale = 1.0 / (branch[0] * branch[0] + branch[1] * branch[1]).sqrt();
            self.pairs[next].touching = 1;
            self.pairs[next].direction = [branch[0] * scale, branch[1] * scale];
            self.pairs[next].tangential_force = contact.tangential_force;
        }
    }
}

/// A listed pair that does not touch yet.
fn fresh_slot(model: &GrainModel, key: &PairKey, image: u32) -> PairSlot {
    let normal_stiffness = model.normal.of(model.radii[key.origin as usize], model.radii[key.end as usize]);
    let tangential = model.law.stiffness_ratio * normal_stiffness;
    PairSlot {
        origin: key.origin,
        end: key.end,
        image,
        touching: 0,
        limit_count: 0,
        slid: false,
        normal_stiffness,
        tangential_compliance: if tangential > 0.0 { 1.0 / tangential } else { 0.0 },
        direction: [0.0, 0.0],
        tangential_force: 0.0,
    }
}
