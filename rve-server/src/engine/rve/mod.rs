//! One cell of grains with a committed state and at most one trial state.

mod operators;
mod side_by_side;
mod zero_increment;

use super::listed_forces::ListedForces;
use super::snapshot::{ENGINE_NAME, opened};
use crate::cell::{ContactNetwork, GrainState, reduced};
use crate::contact::ContactTable;
use crate::definition::{GrainDefinition, GrainModel, RveOptions, SolverName};
use crate::homogenization::fabric::LARGEST_OVERLAP_RATIO;
use crate::homogenization::observation::{in_space, note_condition, observe, of_space, scalars};
use crate::homogenization::picture::CellPicture;
use crate::solver::{AnsweredBy, End, GrainSolver, PathEnergies, SolveJob, Solved, SolverFor, chosen_ramp_steps};
use crate::space::{Components, Discs, PolarParts, Space, Tensor, add_scaled, norm, rotated};
use crate::tangent::network::NetworkResponses;
use crate::tangent::{Closeness, Orderings};
use protocol::{
    ContentId, Cost, Definition, DefinitionId, Observables, RveError, RveSolver, Tensor2, TrialFlags, TrialOptions,
    TrialRequest, TrialResult, nanoseconds_since, snapshot,
};
use std::time::Instant;

/// One cell of grains with a committed and at most one trial state.
#[derive(Debug)]
pub struct GrainRve<S: SolverFor = Discs> {
    id: DefinitionId,
    model: GrainModel,
    contact: ContactTable,
    committed: GrainState<S>,
    trial: Option<Trial<S>>,
    solver: Box<dyn GrainSolver<S>>,
    orderings: Orderings,
    closeness: Closeness,
    listed_forces: ListedForces,
    /// Friction of the definition; `model` and `contact` have that of the latest trial.
    full_friction: f64,
    friction_reduction: f64,
    uses_lanes: bool,
    /// Whether work and damping are summed up along every trial.
    counts_energies: bool,
    /// Tangential over normal stiffness that operators assume where the law has no tangential springs; 0: none.
    springs_of_operators: f64,
}

#[derive(Clone, Debug)]
struct Trial<S: Space> {
    state: GrainState<S>,
    network: ContactNetwork<S>,
    /// Its target and ramp.
    gradient: S::Tensor,
    ramp_steps: u32,
    /// Its stress, Pa.
    stress: S::Tensor,
    /// Work and damping in it, if they are counted.
    energies: Option<PathEnergies>,
}

/// A cell at rest as an answer describes it.
struct View<S: Space> {
    network: ContactNetwork<S>,
    state: GrainState<S>,
    /// Cauchy stress, Pa.
    stress: S::Tensor,
    /// Deformation gradient since the committed state.
    f: S::Tensor,
}

impl<S: Space> View<S> {
    /// A cell that has not moved.
    fn still(network: ContactNetwork<S>, state: GrainState<S>) -> Self {
        Self { stress: network.stress(), f: S::Tensor::IDENTITY, network, state }
    }
}

/// The stretch of a target, as the solver gets it.
#[derive(Clone, Copy, Debug)]
struct Stretch<S: Space> {
    gradient: S::Tensor,
    polar: PolarParts<S>,
    ramp_steps: u32,
}

impl<S: SolverFor> Clone for GrainRve<S> {
    /// The same cell; working memory is not copied, it cannot reach a result.
    fn clone(&self) -> Self {
        Self {
            id: self.id,
            model: self.model.clone(),
            contact: self.contact.clone(),
            committed: self.committed.clone(),
            trial: self.trial.clone(),
            solver: self.solver.new_instance(),
            orderings: Orderings::default(),
            closeness: self.closeness,
            listed_forces: self.listed_forces,
            full_friction: self.full_friction,
            friction_reduction: self.friction_reduction,
            uses_lanes: self.uses_lanes,
            counts_energies: self.counts_energies,
            springs_of_operators: self.springs_of_operators,
        }
    }
}

impl<S: SolverFor> GrainRve<S> {
    /// Builds the cell that a definition's bytes describe.
    ///
    /// # Errors
    /// [`RveError::Definition`].
    pub fn from_protocol(definition: &Definition) -> Result<Self, RveError> {
        let parsed = GrainDefinition::<S>::from_protocol(definition).map_err(refused)?;
        Self::build(&parsed, definition.id())
    }

    /// Builds the cell that a definition describes.
    ///
    /// # Errors
    /// [`RveError::Definition`].
    pub fn new(definition: &GrainDefinition<S>) -> Result<Self, RveError> {
        Self::from_protocol(&definition.to_protocol())
    }

    pub(super) fn build(definition: &GrainDefinition<S>, id: DefinitionId) -> Result<Self, RveError> {
        let model = GrainModel::new(definition)?;
        let mut solver = solver_for(definition.options.solver, &definition.contact)?;
        // Trials begin with cells as square as their tiling allows, and so does the search for pairs, whose work grows with the skew.
        let given = reduced(model.initial_state(definition));
        // One evaluation finds the contacts and cuts listed forces to the Coulomb limit; nothing moves.
        let end = solver
            .evaluate_state(&model, &given)
            .map_err(|error| RveError::Definition(format!("the packing as given cannot be evaluated: {error}")))?;
        if !end.solved.unbalanced.is_finite() {
            return Err(RveError::Definition("the packing gives contact forces that are not finite".into()));
        }
        let overlap = solver.network(&model, &end).max_overlap_ratio();
        if overlap > LARGEST_OVERLAP_RATIO {
            return Err(RveError::Definition(format!(
                "grains of the packing overlap by {overlap:.2} of a diameter: these are no grains in contact; check its radii and places"
            )));
        }
        let committed = GrainState { dissipation: 0.0, ..end.state };
        let mut listed_forces = ListedForces::compare(&given, &committed);
        if !model.has_tangential_springs {
            let forces = definition.packing.contacts.iter().filter(|listed| listed.tangential_force.norm() > 0.0);
            listed_forces.springless = forces.count();
            let moments = definition.packing.histories().filter_map(|(_, moment)| moment);
            listed_forces.moments_springless = moments.filter(|moment| moment.norm() > 0.0).count();
        }
        let contact = definition.contact.clone();
        Ok(Self {
            id,
            model,
            contact,
            committed,
            trial: None,
            solver,
            orderings: Orderings::default(),
            closeness: Closeness::STEERING,
            listed_forces,
            full_friction: definition.contact.friction,
            friction_reduction: 0.0,
            uses_lanes: true,
            counts_energies: false,
            springs_of_operators: 0.0,
        })
    }

    /// Takes up the friction that is a share below that of the definition. A cell with less friction is solved for by relaxation, whatever
    /// the solver of the definition: stored responses belong to the other friction.
    ///
    /// # Errors
    /// A share that is not one.
    fn reduce_friction(&mut self, reduction: f64) -> Result<(), RveError> {
        if reduction == self.friction_reduction {
            return Ok(());
        }
        if !(0.0..=1.0).contains(&reduction) {
            return Err(RveError::Unsupported(format!(
                "friction reduced by {reduction}, which is no share between 0 and 1,"
            )));
        }
        let friction = self.full_friction * (1.0 - reduction);
        let contact = ContactTable { friction, ..self.contact.clone() };
        let name = if reduction == 0.0 { self.model.options.solver } else { SolverName::Relaxation };
        self.solver = solver_for(name, &contact)?;
        self.solver.use_lanes(self.uses_lanes);
        self.solver.count_energies(self.counts_energies);
        (self.contact, self.model.friction, self.friction_reduction) = (contact, friction, reduction);
        Ok(())
    }

    /// Tangential forces of the packing that were not taken over.
    pub fn listed_forces(&self) -> ListedForces {
        self.listed_forces
    }

    /// The committed state.
    pub fn committed(&self) -> &GrainState<S> {
        &self.committed
    }

    /// The unchanging part of the cell.
    pub fn model(&self) -> &GrainModel {
        &self.model
    }

    /// Changes the solver options between trials. For preparations that tighten as they go: a cell that answers jobs
    /// keeps the options of its definition.
    pub(crate) fn set_options(&mut self, options: RveOptions) {
        self.model.options = options;
    }

    /// The contact network of the trial state, with the contacts that slid during its ramp marked.
    pub fn network(&self) -> Option<&ContactNetwork<S>> {
        self.trial.as_ref().map(|trial| &trial.network)
    }

    /// The contact network of the committed state; no contact is marked as having slid.
    ///
    /// # Errors
    /// [`RveError::NotFinite`] for a state from elsewhere whose forces are not finite.
    pub fn committed_network(&mut self) -> Result<ContactNetwork<S>, RveError> {
        self.network_with_friction(0.0)
    }

    /// The contact network of the committed state under a friction that is reduced by a share of what the definition has.
    fn network_with_friction(&mut self, reduction: f64) -> Result<ContactNetwork<S>, RveError> {
        self.reduce_friction(reduction)?;
        let end = self.solver.evaluate_state(&self.model, &self.committed)?;
        Ok(self.solver.network(&self.model, &end))
    }

    /// Grains and contacts of the committed state; contacts slide at the friction that `friction_reduction`
    /// ([`TrialOptions::friction_reduction`]) leaves.
    ///
    /// # Errors
    /// As [`committed_network`](Self::committed_network).
    pub fn picture(&mut self, friction_reduction: f64) -> Result<CellPicture, RveError> {
        let network = self.network_with_friction(friction_reduction)?;
        Ok(CellPicture::new(&network, &self.committed))
    }

    /// Everything that can be said about the committed state without moving a grain. For a fresh cell this is the
    /// packing as given: forces from its geometry and its listed contacts.
    ///
    /// # Errors
    /// As [`committed_network`](Self::committed_network).
    pub fn observe(&mut self, observables: Observables) -> Result<TrialResult, RveError> {
        self.reduce_friction(0.0)?;
        let end = self.solver.evaluate_state(&self.model, &self.committed)?;
        let cost = Cost { force_evaluations: 1, ..Cost::default() };
        let elastic_energy = self.elastic_energy(&end.state, observables);
        let view = View::still(self.solver.network(&self.model, &end), self.committed.clone());
        Ok(self.answer(&view, elastic_energy, observables, cost, TrialFlags::default()))
    }

    /// Whether several trials are solved side by side; no result depends on it.
    pub fn use_lanes(&mut self, uses_lanes: bool) {
        self.uses_lanes = uses_lanes;
        self.solver.use_lanes(uses_lanes);
    }

    /// From now on sums up work and damping along every trial. No other result depends on it.
    pub fn count_energies(&mut self) {
        self.counts_energies = true;
        self.solver.count_energies(true);
    }

    /// Work and damping of the present trial, if they are [counted](Self::count_energies) and the solver had steps to count.
    pub fn trial_energies(&self) -> Option<PathEnergies> {
        self.trial.as_ref()?.energies
    }

    fn solve(&mut self, gradient: &S::Tensor, options: &TrialOptions) -> Result<TrialResult, RveError> {
        let started = Instant::now();
        let stretch = self.stretch(gradient, options)?;
        let job = SolveJob {
            state: &self.committed,
            strain: stretch.polar.strain,
            ramp_steps: stretch.ramp_steps,
            counts_work: options.observables.contains(Observables::ENERGY),
        };
        let end = self.solver.solve_one(&self.model, job)?;
        Ok(self.conclude(end, &stretch, options, nanoseconds_since(started)))
    }

    /// The stretch of a target, as the solver gets it.
    fn stretch(&self, gradient: &S::Tensor, options: &TrialOptions) -> Result<Stretch<S>, RveError> {
        let polar = S::polar(gradient);
        // Only the stretch is solved for; a rotation costs nothing and needs no limit.
        let (norm, limit) = (norm(&polar.strain), self.model.options.largest_target());
        if norm > limit {
            return Err(RveError::TargetTooLarge { norm, limit });
        }
        let ramp_steps = match options.ramp_steps {
            0 => chosen_ramp_steps(&polar.strain, self.model.options.strain_per_step()),
            given => given,
        };
        Ok(Stretch { gradient: *gradient, polar, ramp_steps })
    }

    /// Makes the end of a solve from the committed state the trial state, and answers.
    fn conclude(
        &mut self,
        end: End<S>,
        stretch: &Stretch<S>,
        options: &TrialOptions,
        nanoseconds: u64,
    ) -> TrialResult {
        let solved = end.solved;
        let network = self.solver.network(&self.model, &end);
        let stress = network.stress();
        let elastic_energy = self.elastic_energy(&end.state, options.observables);
        // The whole end state is turned by R at once: rotating the stress with it makes objectivity exact.
        let turn = stretch.polar.turn;
        let mut state = end.state.turned(turn);
        if let (Some(work), Some(stored)) = (solved.work, elastic_energy) {
            // What is neither stored nor lost to friction: no kinetic energy outlives a trial.
            let before = self.solver.elastic_energy(&self.model, &self.committed);
            state.damping += work - (stored - before) - (state.dissipation - self.committed.dissipation);
        }
        let network = network.turned_to(&state);
        let stress = rotated(&stress, &S::rotation_matrix(turn));
        let mut flags = TrialFlags::default();
        if !solved.equilibrated {
            flags.insert(TrialFlags::NOT_EQUILIBRATED);
        }
        if solved.changed_damping {
            flags.insert(TrialFlags::DAMPING_CHANGED);
        }
        flags.insert(match solved.answered_by {
            AnsweredBy::Relaxation => TrialFlags::default(),
            AnsweredBy::Elastic => TrialFlags::ELASTIC_INCREMENT,
            AnsweredBy::Events => TrialFlags::EVENT_INCREMENT,
            AnsweredBy::HandedOver => TrialFlags::HANDED_OVER,
        });
        let cost = Cost {
            force_evaluations: solved.force_evaluations,
            ramp_steps: u64::from(solved.ramp_steps),
            solve_nanoseconds: nanoseconds,
            tangent_nanoseconds: 0,
        };
        let f = add_scaled(&S::Tensor::IDENTITY, 1.0, &stretch.gradient);
        let view = View { network, state, stress, f };
        let mut answer = self.answer(&view, elastic_energy, options.observables, cost, flags);
        let View { network, state, stress, .. } = view;
        // The network keeps the names of the contacts that the answer was computed with.
        let state = reduced(state);
        let Solved { ramp_steps, energies, .. } = solved;
        self.trial = Some(Trial { state, network, gradient: stretch.gradient, ramp_steps, stress, energies });
        self.add_tangent(&mut answer, options.tangent);
        answer
    }

    /// The definition that its snapshots belong to.
    pub fn definition_id(&self) -> DefinitionId {
        self.id
    }

    /// Energy stored in the contacts of a state as the solver left it, J, if it is wanted.
    fn elastic_energy(&self, state: &GrainState<S>, wanted: Observables) -> Option<f64> {
        wanted.contains(Observables::ENERGY).then(|| self.solver.elastic_energy(&self.model, state))
    }

    /// Everything but the tangent.
    fn answer(
        &self,
        view: &View<S>,
        elastic_energy: Option<f64>,
        wanted: Observables,
        cost: Cost,
        mut flags: TrialFlags,
    ) -> TrialResult {
        let View { network, state, stress, f } = view;
        let scalars = scalars(network, state);
        note_condition(state, scalars.max_overlap_ratio, &mut flags);
        TrialResult {
            stress: in_space(stress),
            tangent: None,
            scalars,
            observed: observe(elastic_energy, network, state, stress, f, wanted),
            cost,
            flags,
        }
    }
}

impl<S: SolverFor> RveSolver for GrainRve<S> {
    fn trial(&mut self, target: &Tensor2, options: &TrialOptions) -> Result<TrialResult, RveError> {
        self.trial = None;
        let gradient = checked_target(target)?;
        self.reduce_friction(options.friction_reduction)?;
        if self.stays(&gradient, options) { self.stay(options) } else { self.solve(&gradient, options) }
    }

    fn model_identity(&self) -> Option<ContentId> {
        // Everything in a definition but the places and histories of its grains, which are part of the state.
        let contact = ContactTable { friction: self.full_friction, ..self.contact.clone() };
        let GrainModel { thickness, radii, options, .. } = &self.model;
        let parts = rmp_serde::to_vec_named(&(S::DIMENSION, thickness, radii, contact, options));
        Some(ContentId::of(&parts.expect("writing MessagePack to memory cannot fail")))
    }

    fn solve_batch(&mut self, requests: &[TrialRequest<'_>]) -> Vec<Result<(TrialResult, Vec<u8>), RveError>> {
        self.answer_side_by_side(requests)
    }

    fn commit(&mut self) -> Result<(), RveError> {
        let trial = self.trial.take().ok_or(RveError::NothingToCommit)?;
        self.committed = trial.state;
        Ok(())
    }

    fn rollback(&mut self) {
        self.trial = None;
    }

    fn snapshot(&self, out: &mut Vec<u8>) {
        snapshot::seal(ENGINE_NAME, &self.committed.to_bytes(self.id), out);
    }

    fn snapshot_trial(&self, out: &mut Vec<u8>) -> Result<(), RveError> {
        let trial = self.trial.as_ref().ok_or(RveError::NothingToCommit)?;
        snapshot::seal(ENGINE_NAME, &trial.state.to_bytes(self.id), out);
        Ok(())
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), RveError> {
        self.committed = opened(bytes, self.id, self.model.radii.len())?;
        self.trial = None;
        Ok(())
    }
}

/// A solver with the linear responses that it may use.
fn solver_for<S: SolverFor>(name: SolverName, contact: &ContactTable) -> Result<Box<dyn GrainSolver<S>>, RveError> {
    let mut solver = S::solver(name, contact).map_err(refused)?;
    solver.use_responses(Box::new(NetworkResponses::default()));
    Ok(solver)
}

/// The displacement gradient of an acceptable target.
fn checked_target<T: Tensor>(target: &Tensor2) -> Result<T, RveError> {
    protocol::target::check(target, T::DIMENSION)?;
    Ok(of_space(target))
}

pub(super) fn refused(error: impl ToString) -> RveError {
    RveError::Definition(error.to_string())
}
