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
use crate::definition::Criterion;
use crate::model::GrainModel;
use crate::plane::{self, Plane};
use crate::state::{ContactRecord, GrainState};
use assembly::Assembly;
use criterion::ENERGY_HITS;
use kernel::ContactSums;
use motion::Motion;
use protocol::RveError;

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

/// Working memory of the solver; holds the end state of the last solve until the next one.
#[derive(Clone, Debug, Default)]
pub(crate) struct Relaxation {
    pub(crate) assembly: Assembly,
    motion: Motion,
    last_contacts: ContactSums,
}

/// Number of ramp increments for a strain, if the asker leaves the choice to the engine.
pub(crate) fn chosen_ramp_steps(strain: &Plane, strain_per_step: f64) -> u32 {
    let steps = (plane::largest_component(strain) / strain_per_step).ceil();
    (steps.min(f64::from(u32::MAX)) as u32).max(FEWEST_RAMP_STEPS)
}

impl Relaxation {
    /// Evaluates a state as it is: nothing moves.
    pub(crate) fn look(&mut self, model: &GrainModel, state: &GrainState) -> f64 {
        self.begin(model, state);
        self.measure(model).0
    }

    /// Stretches the state by `I + strain` in `ramp_steps` increments and relaxes it.
    ///
    /// # Errors
    /// [`RveError::NotFinite`].
    pub(crate) fn solve(
        &mut self,
        model: &GrainModel,
        state: &GrainState,
        strain: &Plane,
        ramp_steps: u32,
    ) -> Result<Solved, RveError> {
        self.begin(model, state);
        let start = state.cell;
        let mut evaluations = 1;
        let mut before = plane::IDENTITY;
        for step in 1..=ramp_steps {
            let share = f64::from(step) / f64::from(ramp_steps);
            let stretch = plane::add_scaled(&plane::IDENTITY, share, strain);
            // (I + tau' S) = (I + D) (I + tau S) with D = (tau' - tau) S (I + tau S)^-1, formed without cancellation.
            let increment = plane::add_scaled(&[[0.0; 2]; 2], 1.0 / f64::from(ramp_steps), strain);
            let affine = plane::product(&increment, &plane::inverse(&before));
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

    /// The end state of the last solve; `state` is the one it started from.
    pub(crate) fn end_state(&self, state: &GrainState, unbalanced: f64) -> GrainState {
        GrainState {
            cell: self.assembly.cell(),
            positions: self.assembly.grains.iter().map(|grain| grain.position).collect(),
            rotations: self.assembly.rotations.clone(),
            contacts: self
                .assembly
                .contacts()
                .map(|(key, pair)| ContactRecord {
                    origin: key.origin,
                    end: key.end,
                    shift: key.shift,
                    tangential_force: pair.tangential_force,
                })
                .collect(),
            dissipation: self.assembly.dissipation,
            initial_measure: state.initial_measure,
            unbalanced,
        }
    }

    fn begin(&mut self, model: &GrainModel, state: &GrainState) {
        self.assembly.load(model, state);
        self.last_contacts = self.assembly.evaluate(model);
        self.motion.start(model, &self.assembly);
    }

    /// One DEM step: move, renew the pair list if due, evaluate.
    fn advance(&mut self, model: &GrainModel, affine: &Plane, cell: Cell, evaluations: u64) -> Result<(), RveError> {
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
        self.last_contacts = self.assembly.evaluate(model);
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
            let (unbalanced, finite) = self.measure(model);
            if !finite {
                return Err(RveError::NotFinite { force_evaluations: *evaluations });
            }
            hits = if unbalanced <= tolerance { hits + 1 } else { 0 };
            let done = hits >= needed && step >= FEWEST_HOLD_STEPS;
            if done || step >= cap {
                return Ok((unbalanced, done));
            }
            self.advance(model, &[[0.0; 2]; 2], cell, *evaluations)?;
            *evaluations += 1;
            step += 1;
        }
    }

    fn measure(&self, model: &GrainModel) -> (f64, bool) {
        let sums = self.motion.sums(model, &self.assembly);
        let value =
            criterion::unbalanced(model.options.criterion, &model.law, &self.assembly, &self.last_contacts, &sums);
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
    use crate::packing::PackingFile;
    use std::path::Path;

    fn hundred_discs() -> (GrainModel, GrainState) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings/discs-100.json");
        let contact =
            ContactTable { normal_stiffness: None, modulus: Some(1e8), ..ContactTable::linear(1.0, 0.5, 0.5) };
        let packing = PackingFile::read(&path).unwrap();
        let definition = GrainDefinition { packing, contact, options: RveOptions::default() };
        let model = GrainModel::new(&definition).unwrap();
        let state = model.initial_state(&definition);
        (model, state)
    }

    /// Whatever the skin, and so however often the pair list is renewed, the end state has the same bits.
    #[test]
    fn pair_list_cannot_reach_the_result() {
        let (model, state) = hundred_discs();
        let strain = [[0.01, 2e-3], [2e-3, -0.02]];
        let end_with = |skin: f64| {
            let mut relaxation = Relaxation::default();
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
        let (model, state) = hundred_discs();
        let strain = [[1e-3, 0.0], [0.0, -2e-3]];
        let mut fresh = Relaxation::default();
        let solved = fresh.solve(&model, &state, &strain, 200).unwrap();
        let expected = fresh.end_state(&state, solved.unbalanced);
        let mut used = Relaxation::default();
        used.solve(&model, &state, &[[-0.02, 0.0], [0.0, 0.03]], 300).unwrap();
        let solved = used.solve(&model, &state, &strain, 200).unwrap();
        assert!(used.end_state(&state, solved.unbalanced) == expected);
    }
}
