//! A few grains laid out by hand for the kernel, for tests of contacts and crystals.

use super::stiffness::{PairsOfGrains, StiffContacts, StiffGrains, largest_own_stiffness};
use crate::cell::{Cell, PairFinder};
use crate::contact::ContactLaw;
use crate::simd::Tuple;
use crate::solver::kernel::backend::Backend;
use crate::solver::kernel::{
    Contact, Grain, GrainConstants, ListedPair, PairConstants, PairGroup, Steering, StepData, StepSums, Wanted, pack,
    unpack,
};
use crate::space::{Components, Space};

/// Grains of unit mass that are homogeneous discs or spheres, with all their pairs.
#[derive(Clone)]
pub(super) struct Sample<S: Space, L: ContactLaw<S::Kernel>> {
    law: L,
    radii: Vec<f64>,
    constants: Vec<GrainConstants>,
    pub(super) grains: Vec<Grain<S::Kernel, f64>>,
    pairs: Vec<ListedPair>,
    pair_constants: Vec<PairConstants<S::Kernel, L>>,
    pub(super) contacts: Vec<Contact<S::Kernel, L, f64>>,
    live: Vec<bool>,
    limit_counts: Vec<f64>,
    groups: Vec<PairGroup<S::Kernel, L>>,
    images: Vec<S::Vector>,
}

impl<S: Space, L: ContactLaw<S::Kernel>> Sample<S, L> {
    /// Grains in a cell; pairs closer than `skin` are listed.
    pub(super) fn new(law: L, cell: Cell<S>, positions: Vec<S::Vector>, radii: Vec<f64>, skin: f64) -> Self {
        let mut keys = Vec::new();
        PairFinder::default().find(&cell, positions.iter().copied(), &radii, skin, &mut keys);
        let pair_constants = keys
            .iter()
            .map(|key| PairConstants::new(&law, [radii[key.origin as usize], radii[key.end as usize]]))
            .collect();
        let mut sample = Self {
            law,
            constants: radii
                .iter()
                .map(|radius| {
                    let rotation = S::INERTIA_FACTOR * radius * radius;
                    GrainConstants {
                        mass: 1.0,
                        inverse_mass: 1.0,
                        rotation,
                        inverse_rotation: 1.0 / rotation,
                        inverse_radius: 1.0 / radius,
                    }
                })
                .collect(),
            radii,
            grains: positions.into_iter().map(Grain::at_rest).collect(),
            pairs: (0..keys.len() as u32)
                .map(|place| ListedPair {
                    origin: keys[place as usize].origin,
                    end: keys[place as usize].end,
                    image: place,
                })
                .collect(),
            images: keys.iter().map(|key| cell.translation(key.shift)).collect(),
            pair_constants,
            contacts: vec![Contact::none(); keys.len()],
            live: vec![false; keys.len()],
            limit_counts: vec![0.0; keys.len()],
            groups: Vec::new(),
        };
        sample.evaluate();
        sample
    }

    fn data(&mut self) -> StepData<'_, S::Kernel, L, f64> {
        StepData {
            law: &self.law,
            grain_constants: &self.constants,
            grains: &mut self.grains,
            pairs: &self.pairs,
            pair_constants: &self.pair_constants,
            contacts: &mut self.contacts,
            groups: &mut self.groups,
            live: &mut self.live,
            limit_counts: &mut self.limit_counts,
            sampling: 0.0,
            images: &self.images,
            wanted: Wanted::default(),
        }
    }

    /// All contact forces for the present positions and spins.
    pub(super) fn evaluate(&mut self) -> StepSums<f64> {
        for grain in &mut self.grains {
            grain.force = Grain::<S::Kernel, f64>::empty().force;
            grain.moment = Tuple::zero();
        }
        self.load_contacts()
    }

    fn load_contacts(&mut self) -> StepSums<f64> {
        let backend = Backend::best();
        if !backend.has_lanes() {
            return backend.evaluate(&mut self.data());
        }
        let mut groups = std::mem::take(&mut self.groups);
        pack(&self.data(), &mut groups);
        self.groups = groups;
        let sums = backend.evaluate(&mut self.data());
        unpack(&self.groups, &mut self.contacts, &mut self.live, &mut self.limit_counts);
        sums
    }

    /// How much a small random motion has grown after 120 undamped steps.
    pub(super) fn growth(mut self, step: f64) -> f64 {
        let start = 1e-12;
        let random = |grain: usize, place: usize| {
            let phase = 1.0 + place as f64;
            start * step * (phase + 2.4 * phase * phase * grain as f64).sin()
        };
        for (number, grain) in self.grains.iter_mut().enumerate() {
            grain.velocity = S::Vector::from_fn(|axis| random(number, axis));
            grain.spin = Tuple::build(|place| random(number, S::DIMENSION + place));
        }
        let still = Grain::<S::Kernel, f64>::empty().position;
        let steering = Steering { affine: [still; 3], keep: 1.0, push: step * step, local: 0.0 };
        for _ in 0..120 {
            Backend::best().advance(&mut self.data(), &steering);
            self.load_contacts();
        }
        let fastest = self.grains.iter().fold(0.0, |fastest: f64, grain| {
            let spins = grain.spin.as_ref().iter();
            grain.velocity.components().iter().chain(spins).fold(fastest, |fastest, value| fastest.max(value.abs()))
        });
        fastest / (start * step)
    }

    /// The stable step that the block bound promises.
    pub(super) fn promised_step(&self) -> f64 {
        let mut pairs = PairsOfGrains::default();
        pairs.follow(self.grains.len(), &self.pairs);
        let grains = StiffGrains {
            law: &self.law,
            inertia: S::INERTIA_FACTOR,
            radii: &self.radii,
            constants: &self.constants,
            pairs: &pairs,
            pair_constants: &self.pair_constants,
        };
        let stiffness = largest_own_stiffness(grains, self);
        2.0 / (2.0 * stiffness).sqrt()
    }
}

impl<S: Space, L: ContactLaw<S::Kernel>> StiffContacts<S> for Sample<S, L> {
    type Number = f64;

    fn direction(&self, pair: usize) -> S::Vector {
        self.contacts[pair].direction
    }

    fn overlap(&self, _: usize) -> f64 {
        1e-5
    }
}
