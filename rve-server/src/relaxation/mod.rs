//! The quasi-static solver: stretches the cell in small increments while the grains relax, then holds until the grains
//! are in equilibrium.
//!
//! The deformation is applied as the pure stretch `I + tau (U - I)`; the caller turns the result by the rotation. A solve
//! depends on the state, the stretch, the ramp count and the options only, to the last bit.

pub(crate) mod assembly;
pub(crate) mod criterion;
pub(crate) mod kernel;
#[cfg(test)]
mod kernel_tests;
pub(crate) mod motion;
pub(crate) mod stiffness;

use crate::cell::Cell;
use crate::definition::{ContactTable, Criterion, DefinitionError, Rotations};
use crate::lanes::Kinematics;
use crate::law::{AT_LIMIT, ContactLaw, ExtendedHertzMindlin, ExtendedLinear, PlainHertzMindlin, PlainLinear};
use crate::model::GrainModel;
use crate::network::{ContactNetwork, NetworkContact};
use crate::space::{Space, Tensor, add_scaled, inverse, largest_component, product, scaled};
use crate::state::{ContactRecord, GrainState};
use assembly::Assembly;
use criterion::ENERGY_HITS;
use kernel::ContactSums;
use motion::Motion;
use protocol::RveError;
use std::fmt::Debug;

/// Fewest ramp increments that the engine chooses by itself.
const FEWEST_RAMP_STEPS: u32 = 5;

/// Fewest relaxation steps after the ramp: the moment at which the ramp ends says little about equilibrium.
const FEWEST_HOLD_STEPS: u32 = 10;

/// Steps between two looks at the stiffness bound; a look costs about two force evaluations.
const STIFFNESS_INTERVAL: u32 = 64;

/// How a solve ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Solved {
    pub(crate) force_evaluations: u64,
    pub(crate) ramp_steps: u32,
    pub(crate) unbalanced: f64,
    pub(crate) equilibrated: bool,
}

/// What the contacts of a state amount to, beyond the network that is linearised.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ContactMeasures {
    /// Share of contacts at the Coulomb limit.
    pub sliding_fraction: f64,
    /// Energy stored in all contacts, J.
    pub elastic_energy: f64,
}

/// The solver of one cell, whatever its contact law: one choice per trial, none per contact.
pub(crate) trait QuasiStatic<S: Space>: Debug + Send + Sync {
    /// Evaluates a state as it is: nothing moves. Returns the value of the equilibrium criterion.
    fn look(&mut self, model: &GrainModel, state: &GrainState<S>) -> f64;

    /// Stretches the state by `I + strain` in `ramp_steps` increments and relaxes it.
    ///
    /// # Errors
    /// [`RveError::NotFinite`].
    fn solve(
        &mut self,
        model: &GrainModel,
        state: &GrainState<S>,
        strain: &S::Tensor,
        ramp_steps: u32,
    ) -> Result<Solved, RveError>;

    /// The end state of the last solve or look; `state` is the one it started from.
    fn end_state(&self, state: &GrainState<S>, unbalanced: f64) -> GrainState<S>;

    /// The contacts of the last solve or look, frozen; positions, cell and tangential forces are those of `state`, which
    /// is the end state, perhaps turned as a whole.
    fn network(&self, model: &GrainModel, state: &GrainState<S>) -> ContactNetwork<S>;

    /// Measures of the contacts of the last solve or look.
    fn measures(&self) -> ContactMeasures;

    /// A solver for the same law without any working memory.
    fn another(&self) -> Box<dyn QuasiStatic<S>>;
}

/// The solver for a contact law. This is where laws are compiled: one kernel per kind of springs, with and without the
/// parts that most scenes do without.
///
/// # Errors
/// A table that is not valid.
pub(crate) fn for_contact<S: Space>(contact: &ContactTable) -> Result<Box<dyn QuasiStatic<S>>, DefinitionError> {
    let parts = contact.parts();
    let is_extended = parts.is_extended();
    Ok(match parts.hertz_springs() {
        Some(springs) if is_extended => Box::new(Relaxation::<S, ExtendedHertzMindlin>::new(parts.law(springs))),
        Some(springs) => Box::new(Relaxation::<S, PlainHertzMindlin>::new(parts.law(springs))),
        None if is_extended => Box::new(Relaxation::<S, ExtendedLinear>::new(parts.law(parts.linear_springs()?))),
        None => Box::new(Relaxation::<S, PlainLinear>::new(parts.law(parts.linear_springs()?))),
    })
}

/// Working memory of the solver; holds the end state of the last solve until the next one.
#[derive(Clone, Debug)]
pub(crate) struct Relaxation<S: Space, L: ContactLaw<S::Kinematics>> {
    pub(crate) assembly: Assembly<S, L>,
    motion: Motion<S>,
    last_contacts: ContactSums,
}

fn is_at_limit<S: Space, L: ContactLaw<S::Kinematics>>(
    assembly: &Assembly<S, L>,
    pair: &kernel::PairSlot<S, L>,
) -> bool {
    let limit = assembly.law.friction_limit(&pair.constants, assembly.overlap(pair));
    S::Kinematics::length(pair.tangential_force) >= AT_LIMIT * limit
}

/// Number of ramp increments for a strain, if the asker leaves the choice to the engine.
pub(crate) fn chosen_ramp_steps<T: Tensor>(strain: &T, strain_per_step: f64) -> u32 {
    let steps = (largest_component(strain) / strain_per_step).ceil();
    (steps.min(f64::from(u32::MAX)) as u32).max(FEWEST_RAMP_STEPS)
}

impl<S: Space, L: ContactLaw<S::Kinematics>> QuasiStatic<S> for Relaxation<S, L> {
    fn look(&mut self, model: &GrainModel, state: &GrainState<S>) -> f64 {
        self.begin(model, state);
        self.measure(model).0
    }

    fn solve(
        &mut self,
        model: &GrainModel,
        state: &GrainState<S>,
        strain: &S::Tensor,
        ramp_steps: u32,
    ) -> Result<Solved, RveError> {
        self.begin(model, state);
        let start = state.cell;
        let mut evaluations = 1;
        let mut before = S::Tensor::IDENTITY;
        for step in 1..=ramp_steps {
            let share = f64::from(step) / f64::from(ramp_steps);
            let stretch = add_scaled(&S::Tensor::IDENTITY, share, strain);
            // (I + tau' S) = (I + D) (I + tau S) with D = (tau' - tau) S (I + tau S)^-1, formed without cancellation.
            let increment = scaled(strain, 1.0 / f64::from(ramp_steps));
            let affine = product(&increment, &inverse(&before));
            before = stretch;
            if step == ramp_steps / 2 + 1 {
                self.clear_limit_counts();
            }
            self.advance(model, &affine, start.deformed(&stretch), evaluations)?;
            evaluations += 1;
        }
        let samples = ramp_steps - ramp_steps / 2;
        let (unbalanced, equilibrated) = self.hold(model, samples, &mut evaluations)?;
        Ok(Solved { force_evaluations: evaluations, ramp_steps, unbalanced, equilibrated })
    }

    fn end_state(&self, state: &GrainState<S>, unbalanced: f64) -> GrainState<S> {
        let assembly = &self.assembly;
        let moments = assembly.contacts().filter(|_| L::ROLLS);
        GrainState {
            cell: assembly.cell(),
            positions: assembly.grains.iter().map(|grain| grain.position).collect(),
            rotations: assembly.rotations.clone(),
            contacts: assembly
                .contacts()
                .map(|(key, pair)| ContactRecord {
                    origin: key.origin,
                    end: key.end,
                    shift: key.shift,
                    tangential_force: S::from_axial(pair.tangential_force, pair.direction),
                })
                .collect(),
            rolling_moments: moments.map(|(_, pair)| S::spin(assembly.law.rolling_moment(&pair.memory))).collect(),
            operators: state.operators.clone(),
            dissipation: assembly.dissipation,
            initial_measure: state.initial_measure,
            unbalanced,
        }
    }

    fn network(&self, model: &GrainModel, state: &GrainState<S>) -> ContactNetwork<S> {
        let assembly = &self.assembly;
        let frozen =
            |((key, pair), record): ((&crate::pairs::PairKey<S>, &kernel::PairSlot<S, L>), &ContactRecord<S>)| {
                let overlap = assembly.overlap(pair);
                let [normal_stiffness, tangential_stiffness, _] = assembly.law.stiffness(&pair.constants, overlap);
                NetworkContact {
                    origin: key.origin,
                    end: key.end,
                    shift: key.shift,
                    normal_stiffness,
                    tangential_stiffness,
                    normal_force: assembly.law.normal_force(&pair.constants, overlap),
                    tangential_force: record.tangential_force,
                    slid: pair.slid,
                    at_limit: is_at_limit::<S, L>(assembly, pair),
                }
            };
        ContactNetwork {
            cell: state.cell.rows,
            thickness: model.thickness,
            positions: state.positions.clone(),
            radii: model.radii.clone(),
            rotations_free: model.rotations == Rotations::Free,
            friction: model.friction,
            contacts: assembly.contacts().zip(&state.contacts).map(frozen).collect(),
        }
    }

    fn measures(&self) -> ContactMeasures {
        let assembly = &self.assembly;
        let sliding = assembly.contacts().filter(|(_, pair)| is_at_limit(assembly, pair)).count();
        ContactMeasures {
            sliding_fraction: sliding as f64 / assembly.contacts().count().max(1) as f64,
            elastic_energy: criterion::elastic_energy(assembly),
        }
    }

    fn another(&self) -> Box<dyn QuasiStatic<S>> {
        Box::new(Self::new(self.assembly.law))
    }
}

impl<S: Space, L: ContactLaw<S::Kinematics>> Relaxation<S, L> {
    /// Empty working memory for a law.
    pub(crate) fn new(law: L) -> Self {
        Self { assembly: Assembly::new(law), motion: Motion::default(), last_contacts: ContactSums::default() }
    }

    fn begin(&mut self, model: &GrainModel, state: &GrainState<S>) {
        self.assembly.load(model, state);
        self.last_contacts = self.assembly.evaluate();
        self.motion.start(model, &self.assembly);
    }

    /// One DEM step: move, renew the pair list if due, evaluate.
    fn advance(
        &mut self,
        model: &GrainModel,
        affine: &S::Tensor,
        cell: Cell<S>,
        evaluations: u64,
    ) -> Result<(), RveError> {
        if evaluations.is_multiple_of(u64::from(STIFFNESS_INTERVAL)) {
            self.motion.raise_mass(model, &self.assembly);
        }
        let sums = self.motion.sums(model, &self.assembly);
        let moved = self.motion.step(model, &mut self.assembly, &sums, affine);
        if !moved.is_finite() {
            return Err(RveError::NotFinite { force_evaluations: evaluations });
        }
        self.assembly.wander(moved);
        self.assembly.set_cell(cell);
        self.assembly.keep_list_complete(model);
        self.last_contacts = self.assembly.evaluate();
        if !self.last_contacts.normal_force.is_finite() {
            return Err(RveError::NotFinite { force_evaluations: evaluations + 1 });
        }
        Ok(())
    }

    /// Relaxes at constant cell until the criterion is met or the step cap is reached.
    fn hold(
        &mut self,
        model: &GrainModel,
        ramp_samples: u32,
        evaluations: &mut u64,
    ) -> Result<(f64, bool), RveError> {
        self.note_sliding(ramp_samples);
        let needed = if model.options.criterion == Criterion::Energy { ENERGY_HITS } else { 1 };
        let (tolerance, cap) = (model.options.tolerance(), model.options.max_steps());
        let cell = self.assembly.cell();
        let mut hits = 0;
        let mut step = 0;
        loop {
            let (mut unbalanced, mut finite) = self.measure(model);
            if unbalanced <= tolerance && model.is_viscous {
                // Viscous forces that hold the grains back could pass for equilibrium: look again without motion.
                self.last_contacts = self.assembly.evaluate_at_rest();
                *evaluations += 1;
                (unbalanced, finite) = self.measure(model);
            }
            if !finite {
                return Err(RveError::NotFinite { force_evaluations: *evaluations });
            }
            hits = if unbalanced <= tolerance { hits + 1 } else { 0 };
            let done = hits >= needed && step >= FEWEST_HOLD_STEPS;
            if done || step >= cap {
                return Ok((unbalanced, done));
            }
            self.advance(model, &S::Tensor::ZERO, cell, *evaluations)?;
            *evaluations += 1;
            step += 1;
        }
    }

    fn measure(&self, model: &GrainModel) -> (f64, bool) {
        let sums = self.motion.sums(model, &self.assembly);
        let value = criterion::unbalanced(model.options.criterion, &self.assembly, &self.last_contacts, &sums);
        (value, value.is_finite() && self.last_contacts.normal_force.is_finite())
    }

    fn clear_limit_counts(&mut self) {
        for pair in &mut self.assembly.pairs {
            pair.limit_count = 0;
        }
    }

    /// Remembers in the slots which contacts slid; the pair list may be renewed during the hold.
    fn note_sliding(&mut self, samples: u32) {
        for pair in &mut self.assembly.pairs {
            pair.slid = 2 * pair.limit_count > samples;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::definition::{ContactTable, GrainDefinition, RveOptions};
    use crate::law::PlainLinear;
    use crate::packing::PackingFile;
    use crate::space::Discs;
    use std::path::Path;

    fn hundred_discs() -> (GrainModel, GrainState, PlainLinear) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings/discs-100.json");
        let contact =
            ContactTable { normal_stiffness: None, modulus: Some(1e8), ..ContactTable::linear(1.0, 0.5, 0.5) };
        let packing = PackingFile::read(&path).unwrap();
        let definition = GrainDefinition { packing, contact, options: RveOptions::default() };
        let model = GrainModel::new(&definition).unwrap();
        let state = model.initial_state(&definition);
        let law = definition.contact.parts().law(definition.contact.parts().linear_springs().unwrap());
        (model, state, law)
    }

    /// Whatever the skin, and so however often the pair list is renewed, the end state has the same bits.
    #[test]
    fn pair_list_cannot_reach_the_result() {
        let (model, state, law) = hundred_discs();
        let strain = [[0.01, 2e-3], [2e-3, -0.02]];
        let end_with = |skin: f64| {
            let mut relaxation = Relaxation::<Discs, _>::new(law);
            relaxation.assembly.skin_in_radii = Some(skin);
            let solved = relaxation.solve(&model, &state, &strain, 2_000).unwrap();
            (
                relaxation.end_state(&state, solved.unbalanced),
                solved.force_evaluations,
                relaxation.assembly.pairs.len(),
            )
        };
        let (usual, steps, pairs) = end_with(SKIN_IN_USE);
        for skin in [0.002, 0.02, 0.5] {
            let (other, other_steps, other_pairs) = end_with(skin);
            assert_ne!(other_pairs, pairs, "skin {skin} lists other pairs");
            assert_eq!(other_steps, steps);
            assert!(other == usual, "skin {skin} changed the state");
        }
    }

    const SKIN_IN_USE: f64 = 0.05;

    /// A solver that has done other work before answers with the same bits as a new one.
    #[test]
    fn used_working_memory_leaves_no_trace() {
        let (model, state, law) = hundred_discs();
        let strain = [[1e-3, 0.0], [0.0, -2e-3]];
        let mut fresh = Relaxation::<Discs, _>::new(law);
        let solved = fresh.solve(&model, &state, &strain, 200).unwrap();
        let expected = fresh.end_state(&state, solved.unbalanced);
        let mut used = Relaxation::<Discs, _>::new(law);
        used.solve(&model, &state, &[[-0.02, 0.0], [0.0, 0.03]], 300).unwrap();
        let solved = used.solve(&model, &state, &strain, 200).unwrap();
        assert!(used.end_state(&state, solved.unbalanced) == expected);
    }
}
