//! The grain engine behind the protocol: definitions in, trials out.

use crate::definition::{GrainDefinition, Rotations, RveOptions};
pub use crate::grains::{Grains, grains_of_snapshot};
use crate::homogenization::observation::{note_condition, observe, scalars};
use crate::model::GrainModel;
use crate::network::{ContactNetwork, NetworkContact};
use crate::plane::{self, Plane};
use crate::relaxation::{self, Relaxation};
use crate::state::GrainState;
use crate::tangent;
use protocol::{
    Ask, Capabilities, Cost, Definition, DefinitionId, Observables, RveEngine, RveError, RveSolver, SnapshotKind,
    TangentKind, Tensor2, TrialAnswer, TrialFlags, snapshot,
};
use std::time::Instant;

/// Name of this engine in snapshots and capabilities.
pub const ENGINE_NAME: &str = "grainspan-discs";

/// Builds cells of discs.
#[derive(Clone, Copy, Debug, Default)]
pub struct GrainEngine;

impl RveEngine for GrainEngine {
    fn capabilities(&self) -> Capabilities {
        Capabilities {
            engine: ENGINE_NAME.into(),
            version: env!("CARGO_PKG_VERSION").into(),
            dimensions: vec![2],
            tangents: TangentKind::ALL.into_iter().filter(|kind| tangent::is_served(*kind)).collect(),
            laws: vec!["linear".into()],
            snapshot: SnapshotKind::State,
            deterministic: true,
        }
    }

    fn create(&mut self, definition: &Definition) -> Result<Box<dyn RveSolver>, RveError> {
        Ok(Box::new(GrainRve::from_protocol(definition)?))
    }
}

/// One cell of discs with a committed and at most one trial state.
#[derive(Clone, Debug)]
pub struct GrainRve {
    id: DefinitionId,
    model: GrainModel,
    committed: GrainState,
    trial: Option<Trial>,
    relaxation: Relaxation,
}

#[derive(Clone, Debug)]
struct Trial {
    state: GrainState,
    network: ContactNetwork,
}

impl GrainRve {
    /// Builds the cell that a definition's bytes describe.
    ///
    /// # Errors
    /// [`RveError::Definition`].
    pub fn from_protocol(definition: &Definition) -> Result<Self, RveError> {
        let parsed =
            GrainDefinition::from_protocol(definition).map_err(|error| RveError::Definition(error.to_string()))?;
        Self::build(&parsed, definition.id())
    }

    /// Builds the cell that a definition describes.
    ///
    /// # Errors
    /// [`RveError::Definition`].
    pub fn new(definition: &GrainDefinition) -> Result<Self, RveError> {
        Self::from_protocol(&definition.to_protocol())
    }

    fn build(definition: &GrainDefinition, id: DefinitionId) -> Result<Self, RveError> {
        let model = GrainModel::new(definition)?;
        let mut relaxation = Relaxation::default();
        let given = model.initial_state(definition);
        // One evaluation finds the contacts and cuts listed forces to the Coulomb limit; nothing moves.
        let unbalanced = relaxation.look(&model, &given);
        if !unbalanced.is_finite() {
            return Err(RveError::Definition("the packing gives contact forces that are not finite".into()));
        }
        let committed = GrainState { dissipation: 0.0, ..relaxation.end_state(&given, unbalanced) };
        Ok(Self { id, model, committed, trial: None, relaxation })
    }

    /// The committed state.
    pub fn committed(&self) -> &GrainState {
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
    pub fn network(&self) -> Option<&ContactNetwork> {
        self.trial.as_ref().map(|trial| &trial.network)
    }

    /// The contact network of the committed state; no contact is marked as having slid.
    pub fn committed_network(&mut self) -> ContactNetwork {
        self.relaxation.look(&self.model, &self.committed);
        frozen(&self.model, &self.relaxation, &self.committed)
    }

    /// Everything that can be said about the committed state without moving a grain. For a fresh cell this is the
    /// packing as given: forces from its geometry and its listed contacts.
    pub fn look(&mut self, observables: Observables) -> TrialAnswer {
        let network = self.committed_network();
        let stress = network.stress();
        let ask = Ask { observables, ..Ask::default() };
        let mut flags = TrialFlags::default();
        let cost = Cost { force_evaluations: 1, ..Cost::default() };
        note_condition(&network, &mut flags);
        self.answer(&network, &self.committed, &stress, &plane::IDENTITY, &ask, cost, flags)
    }

    fn solve(&mut self, h: &Plane, ask: &Ask) -> Result<TrialAnswer, RveError> {
        let started = Instant::now();
        let polar = plane::polar(h);
        // Only the stretch is solved for; a rotation costs nothing and needs no limit.
        let (norm, limit) = (plane::norm(&polar.strain), self.model.options.largest_target());
        if norm > limit {
            return Err(RveError::TargetTooLarge { norm, limit });
        }
        let ramp_steps = match ask.ramp_steps {
            0 => relaxation::chosen_ramp_steps(&polar.strain, self.model.options.strain_per_step()),
            given => given,
        };
        let solved = self.relaxation.solve(&self.model, &self.committed, &polar.strain, ramp_steps)?;
        let straight = self.relaxation.end_state(&self.committed, solved.unbalanced);
        let stress = frozen(&self.model, &self.relaxation, &straight).stress();
        // The whole end state is turned by R at once: rotating the stress with it makes objectivity exact.
        let state = turned(straight, polar.angle);
        let network = frozen(&self.model, &self.relaxation, &state);
        let stress = plane::rotated(&stress, &plane::rotation(polar.angle));
        let mut flags = TrialFlags::default();
        if !solved.equilibrated {
            flags.insert(TrialFlags::NOT_EQUILIBRATED);
        }
        note_condition(&network, &mut flags);
        let cost = Cost {
            force_evaluations: solved.force_evaluations,
            ramp_steps: u64::from(solved.ramp_steps),
            solve_nanoseconds: nanoseconds_since(started),
            tangent_nanoseconds: 0,
        };
        let f = plane::add_scaled(&plane::IDENTITY, 1.0, h);
        let answer = self.answer(&network, &state, &stress, &f, ask, cost, flags);
        self.trial = Some(Trial { state, network });
        Ok(answer)
    }

    /// A target of exactly zero: the committed state is the answer.
    fn stay(&mut self, ask: &Ask) -> TrialAnswer {
        let started = Instant::now();
        let network = self.committed_network();
        let stress = network.stress();
        let mut flags = TrialFlags::SKIPPED_NULL_TARGET;
        note_condition(&network, &mut flags);
        let cost = Cost { force_evaluations: 1, solve_nanoseconds: nanoseconds_since(started), ..Cost::default() };
        let answer = self.answer(&network, &self.committed, &stress, &plane::IDENTITY, ask, cost, flags);
        self.trial = Some(Trial { state: self.committed.clone(), network });
        answer
    }

    #[expect(clippy::too_many_arguments, reason = "the parts of one answer, put together in one place")]
    fn answer(
        &self,
        network: &ContactNetwork,
        state: &GrainState,
        stress: &Plane,
        f: &Plane,
        ask: &Ask,
        mut cost: Cost,
        mut flags: TrialFlags,
    ) -> TrialAnswer {
        let tangent = (ask.tangent != TangentKind::None).then(|| {
            let started = Instant::now();
            let outcome = tangent::evaluate(network, ask.tangent);
            if outcome.fallback {
                flags.insert(TrialFlags::TANGENT_FALLBACK);
            }
            if outcome.regularised {
                flags.insert(TrialFlags::TANGENT_REGULARISED);
            }
            cost.tangent_nanoseconds = nanoseconds_since(started);
            Box::new(outcome.operator)
        });
        TrialAnswer {
            stress: Tensor2::from_plane(*stress),
            tangent,
            scalars: scalars(network, state),
            observed: observe(self.model.law.cohesion, network, state, stress, f, ask.observables),
            cost,
            flags,
        }
    }
}

impl RveSolver for GrainRve {
    fn trial(&mut self, target: &Tensor2, ask: &Ask) -> Result<TrialAnswer, RveError> {
        self.trial = None;
        if !tangent::is_served(ask.tangent) {
            return Err(RveError::Unsupported(format!("tangent = \"{}\"", ask.tangent.keyword())));
        }
        let h = checked_target(target)?;
        if h == [[0.0; 2]; 2] { Ok(self.stay(ask)) } else { self.solve(&h, ask) }
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

pub(crate) fn opened(bytes: &[u8], id: DefinitionId, grain_count: usize) -> Result<GrainState, RveError> {
    let refuse = |reason: String| RveError::Snapshot(reason);
    let payload = snapshot::open(ENGINE_NAME, bytes).map_err(|error| refuse(error.to_string()))?;
    GrainState::from_bytes(payload, id, grain_count).map_err(refuse)
}

/// The plane displacement gradient of an acceptable target.
fn checked_target(target: &Tensor2) -> Result<Plane, RveError> {
    if !target.is_finite() {
        return Err(RveError::TargetNotFinite);
    }
    let h = target.plane();
    if *target != Tensor2::from_plane(h) {
        return Err(RveError::Unsupported("deformation out of the plane".into()));
    }
    let determinant = plane::determinant(&plane::add_scaled(&plane::IDENTITY, 1.0, &h));
    if determinant <= 0.0 {
        return Err(RveError::TargetInverted { determinant });
    }
    Ok(h)
}

/// Freezes the solver's present contacts; positions and cell are those of `state`.
fn frozen(model: &GrainModel, relaxation: &Relaxation, state: &GrainState) -> ContactNetwork {
    let contacts = relaxation
        .assembly
        .contacts()
        .map(|(key, pair)| NetworkContact {
            origin: key.origin,
            end: key.end,
            shift: key.shift,
            normal_stiffness: pair.normal_stiffness,
            tangential_stiffness: model.law.stiffness_ratio * pair.normal_stiffness,
            normal_force: relaxation.assembly.normal_force(&model.law, pair),
            tangential_force: pair.tangential_force,
            slid: pair.slid,
        })
        .collect();
    ContactNetwork {
        cell: state.cell.rows,
        thickness: model.thickness,
        positions: state.positions.clone(),
        radii: model.radii.clone(),
        rotations_free: model.rotations == Rotations::Free,
        friction: model.law.friction,
        contacts,
    }
}

/// A state turned as a whole.
fn turned(mut state: GrainState, angle: f64) -> GrainState {
    if angle == 0.0 {
        return state;
    }
    let rotation = plane::rotation(angle);
    state.cell = state.cell.deformed(&rotation);
    for position in &mut state.positions {
        *position = plane::apply(&rotation, *position);
    }
    for grain_angle in &mut state.rotations {
        *grain_angle += angle;
    }
    state
}

fn nanoseconds_since(started: Instant) -> u64 {
    u64::try_from(started.elapsed().as_nanos()).unwrap_or(u64::MAX)
}
