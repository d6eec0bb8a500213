//! A frame as an RVE: trials, commits and snapshots like those of a periodic cell.

use super::contacts::listed_contacts;
use super::geometry::FrameGeometry;
use super::options::FrameOptions;
use super::relaxation::{FrameRelaxation, Relaxed};
use crate::cell::{Cell, ContactNetwork, GrainState};
use crate::contact::{ContactTable, LawName, PlainLinear, Rotations};
use crate::definition::{EngineFeature, FrameConstraint, GrainDefinition, LARGEST_FRAME_TARGET, PackingFile};
use crate::engine::ENGINE_VERSION;
use crate::error::DefinitionError;
use crate::homogenization::fabric::{LARGE_OVERLAP_RATIO, anisotropy};
use crate::homogenization::picture::CellPicture;
use crate::homogenization::stress::first_piola;
use crate::programs::specimen::{Body, ContactSums, Grain};
use crate::simd::Tuple;
use crate::solver::{chosen_ramp_steps, holds_together_far_from_rest};
use crate::space::plane::{self, Plane};
use crate::space::{Discs, Space};
use protocol::{
    Capabilities, Cost, Definition, DefinitionId, Observables, Observed, OptionalResult, RveEngine, RveError,
    RveSolver, Scalars, SnapshotKind, TangentKind, Tensor2, TrialFlags, TrialOptions, TrialResult, nanoseconds_since,
    snapshot,
};
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Name of this engine in snapshots and capabilities.
pub const FRAME_ENGINE_NAME: &str = "grainspan-frame";

/// Parts of definitions that it follows. Rolling moments come to nothing without rolling resistance, as they do in periodic cells.
const FOLLOWED: [EngineFeature; 4] = [
    EngineFeature::RollingMoments,
    EngineFeature::BlockedRotations,
    EngineFeature::Criterion,
    EngineFeature::Damping,
];

/// All that is needed to build a frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameDefinition {
    /// Periodic packing that the frame is cut out of.
    pub packing: PackingFile<Discs>,
    /// Contact law.
    pub contact: ContactTable,
    /// How it is solved.
    pub frame: FrameOptions,
}

impl FrameDefinition {
    /// Reads a definition: that of a frame, or that of a periodic cell as scenes make it, whose packing is then cut into a
    /// periodic frame.
    ///
    /// # Errors
    /// [`RveError::Definition`].
    pub fn from_protocol(definition: &Definition) -> Result<Self, RveError> {
        if let Ok(frame) = rmp_serde::from_slice(&definition.bytes) {
            return Ok(frame);
        }
        let refuse = |error: DefinitionError| RveError::Definition(error.to_string());
        let GrainDefinition { packing, contact, options } =
            GrainDefinition::from_protocol(definition).map_err(refuse)?;
        Ok(Self { packing, contact, frame: FrameOptions::of_cell(&options).map_err(refuse)? })
    }

    /// The bytes that travel to workers; the packing's provenance is left out.
    pub fn to_protocol(&self) -> Definition {
        let packing = PackingFile { provenance: serde_json::Value::Null, ..self.packing.clone() };
        let bare = Self { packing, ..self.clone() };
        Definition { bytes: rmp_serde::to_vec_named(&bare).expect("writing MessagePack to memory cannot fail") }
    }
}

/// Builds frames.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrameEngine;

impl RveEngine for FrameEngine {
    fn capabilities(&self) -> Capabilities {
        Capabilities {
            engine: FRAME_ENGINE_NAME.into(),
            version: ENGINE_VERSION.into(),
            dimensions: vec![2],
            tangents: Vec::new(),
            laws: vec![LawName::Linear.keyword().into()],
            snapshot: SnapshotKind::State,
            deterministic: true,
            side_by_side: 1,
            reduces_friction: false,
            // The work of its damping is not known.
            observables: OptionalResult::ALL
                .into_iter()
                .filter(|result| *result != OptionalResult::DampingWork)
                .map(|result| result.keyword().into())
                .collect(),
            features: FOLLOWED.map(|feature| feature.keyword().into()).to_vec(),
        }
    }

    fn create(&mut self, definition: &Definition) -> Result<Box<dyn RveSolver>, RveError> {
        Ok(Box::new(FrameRve::new(&FrameDefinition::from_protocol(definition)?)?))
    }
}

/// A frame of discs with a committed and at most one trial state.
#[derive(Clone, Debug)]
pub struct FrameRve {
    id: DefinitionId,
    geometry: FrameGeometry,
    options: FrameOptions,
    law: PlainLinear,
    thickness: f64,
    turning: Rotations,
    reference: Cell<Discs>,
    committed: GrainState<Discs>,
    trial: Option<Trial>,
}

#[derive(Clone, Debug)]
struct Trial {
    state: GrainState<Discs>,
    network: ContactNetwork<Discs>,
    boundary_residual: f64,
}

impl FrameRve {
    /// Cuts the frame out of the packing. Its grains stay where they are until the first trial, which lets them come to rest even if its
    /// target is zero.
    ///
    /// # Errors
    /// [`RveError::Definition`] if a table is not sound or no frame can be cut.
    pub fn new(definition: &FrameDefinition) -> Result<Self, RveError> {
        let refuse = |reason: String| RveError::Definition(reason);
        let contact = &definition.contact;
        contact.validate().and_then(|()| contact.validate_for(2)).map_err(|error| refuse(error.to_string()))?;
        definition.frame.validate().map_err(|error| refuse(error.to_string()))?;
        let packing = definition.packing.clone().checked().map_err(|error| refuse(error.to_string()))?;
        let geometry =
            FrameGeometry::tiled(&packing, definition.frame.tiles).map_err(|error| refuse(error.to_string()))?;
        if contact.is_extended() {
            return Err(refuse(
                "contact: a frame serves springs and friction, no damping and no rolling resistance".into(),
            ));
        }
        let law = contact.plain_linear().map_err(|error| refuse(error.to_string()))?;
        let mut contacts = listed_contacts(&packing, &geometry);
        if !contact.has_tangential_springs() {
            // Nothing would let go of these forces; they would drive grains round for ever.
            contacts.iter_mut().for_each(|contact| contact.tangential_force = 0.0);
        }
        let copies = definition.frame.tiles.map(f64::from);
        let reference = Cell { rows: [0, 1].map(|row| packing.periodicity[row].map(|part| part * copies[row])) };
        let committed = GrainState {
            cell: reference,
            positions: geometry.positions.clone(),
            rotations: vec![0.0; geometry.places.len()],
            contacts,
            rolling_moments: Vec::new(),
            operators: Default::default(),
            dissipation: 0.0,
            damping: 0.0,
            initial_measure: reference.measure(),
            unbalanced: 0.0,
            largest_load: 0.0,
            bears_load: true,
            events: None,
        };
        let mut frame = Self {
            id: definition.to_protocol().id(),
            geometry,
            options: definition.frame.clone(),
            law,
            thickness: packing.thickness,
            turning: contact.rotations,
            reference,
            committed,
            trial: None,
        };
        // One evaluation finds the contacts and cuts listed forces to the Coulomb limit; nothing moves. The frame is seldom at rest:
        // contacts along its sides count whole on both of them.
        let start = frame.committed.clone();
        let relaxation = frame.relaxation(&start);
        let as_cut = relaxation.end_state(&start, relaxation.unbalanced());
        frame.committed = GrainState { dissipation: 0.0, ..as_cut };
        Ok(frame)
    }

    /// The frame that was cut out.
    pub fn geometry(&self) -> &FrameGeometry {
        &self.geometry
    }

    /// The committed state; positions and contacts are numbered as in the geometry.
    pub fn committed(&self) -> &GrainState<Discs> {
        &self.committed
    }

    /// The contact network of the latest trial; cell vectors are those of the frame, no contact crosses it.
    pub fn network(&self) -> Option<&ContactNetwork<Discs>> {
        self.trial.as_ref().map(|trial| &trial.network)
    }

    /// The contact network of the committed state.
    pub fn committed_network(&self) -> ContactNetwork<Discs> {
        self.relaxation(&self.committed).network(&self.committed, self.thickness, self.law.friction)
    }

    /// Grains and contacts of the committed state, whose network is given.
    pub fn picture(&self, network: &ContactNetwork<Discs>) -> CellPicture {
        let whole = CellPicture::new(network, &self.committed);
        CellPicture { outline: whole.centres[..self.geometry.boundary].to_vec(), ..whole }
    }

    /// How far opposite boundary loads of the latest trial are from cancelling, in mean contact forces.
    pub fn boundary_residual(&self) -> Option<f64> {
        self.trial.as_ref().map(|trial| trial.boundary_residual)
    }

    /// Everything about the committed state, without moving a grain.
    pub fn observe(&mut self, observables: Observables) -> TrialResult {
        let state = self.committed.clone();
        self.answer_for(&state, &plane::IDENTITY, observables, Cost { force_evaluations: 1, ..Cost::default() }).0
    }

    fn relaxation<'a>(&'a self, state: &GrainState<Discs>) -> FrameRelaxation<'a, PlainLinear> {
        let grains = state.positions.iter().zip(&self.geometry.radii).map(|(position, radius)| Grain {
            position: *position,
            velocity: Tuple::zero(),
            spin: Tuple::zero(),
            radius: *radius,
        });
        let masses = vec![1.0; state.positions.len()];
        let mut body = Body::new(self.law, grains.collect(), masses, 0.0, [None; 3]);
        if self.options.shared_sides {
            body.share_sides(self.geometry.sides.clone(), 0.5);
        }
        body.adopt(
            state.contacts.iter().map(|contact| (contact.key(), move |_| [[contact.tangential_force], [0.0]])),
        );
        let (geometry, options) = (&self.geometry, &self.options);
        let constraint = options.constraint;
        FrameRelaxation::new(geometry, options, constraint, self.turning, body, state)
    }

    /// Whether the committed state is the answer to an increment of zero. As it was cut out of a packing it is not: strained trials relax,
    /// and a stress from before that does not belong to theirs. Finite differences of the two would be far from any stiffness.
    fn is_at_rest(&self) -> bool {
        self.committed.unbalanced <= self.options.largest_unbalanced_at_rest()
    }

    /// Whether the state that an answer describes holds together and is far from equilibrium, as frames are that were cut with sides which count
    /// whole.
    pub(crate) fn is_far_from_rest(&self, answer: &TrialResult) -> bool {
        holds_together_far_from_rest(answer, self.options.largest_unbalanced_at_rest())
    }

    fn solve(&mut self, h: &Plane, options: &TrialOptions) -> Result<TrialResult, RveError> {
        let started = Instant::now();
        // Platens do not turn: what is given between them is followed as it is.
        let plane::Polar { strain, angle } = match self.options.constraint {
            FrameConstraint::Platens => plane::Polar { strain: *h, angle: 0.0 },
            _ => plane::polar(h),
        };
        let norm = plane::norm(&strain);
        if norm > LARGEST_FRAME_TARGET {
            return Err(RveError::TargetTooLarge { norm, limit: LARGEST_FRAME_TARGET });
        }
        let ramp_steps = match options.ramp_steps {
            0 => chosen_ramp_steps(&strain, self.options.strain_per_step()),
            given => given,
        };
        let start = self.committed.clone();
        let mut relaxation = self.relaxation(&start);
        let relaxed = relaxation.solve(&strain, ramp_steps);
        let stretch = plane::add_scaled(&plane::IDENTITY, 1.0, &strain);
        let mut state = relaxation.end_state(&start, relaxed.unbalanced);
        state.cell = start.cell.deformed(&stretch);
        state.dissipation += relaxed.dissipation;
        if !state.positions.iter().flatten().all(|value| value.is_finite()) {
            return Err(RveError::NotFinite { force_evaluations: relaxed.force_evaluations });
        }
        turn(&mut state, angle);
        Ok(self.finish(state, h, options, &relaxed, started))
    }

    fn finish(
        &mut self,
        state: GrainState<Discs>,
        h: &Plane,
        options: &TrialOptions,
        relaxed: &Relaxed,
        started: Instant,
    ) -> TrialResult {
        let cost = Cost {
            force_evaluations: relaxed.force_evaluations,
            ramp_steps: u64::from(relaxed.ramp_steps),
            solve_nanoseconds: nanoseconds_since(started),
            tangent_nanoseconds: 0,
        };
        let f = plane::add_scaled(&plane::IDENTITY, 1.0, h);
        let (mut answer, network) = self.answer_for(&state, &f, options.observables, cost);
        if !relaxed.equilibrated {
            answer.flags.insert(TrialFlags::NOT_EQUILIBRATED);
        }
        self.trial = Some(Trial { state, network, boundary_residual: relaxed.boundary_residual });
        answer
    }

    /// Stress, scalars and whatever else was requested, of one state.
    fn answer_for(
        &self,
        state: &GrainState<Discs>,
        f: &Plane,
        observables: Observables,
        cost: Cost,
    ) -> (TrialResult, ContactNetwork<Discs>) {
        let mut relaxation = self.relaxation(state);
        let sums = relaxation.contacts();
        let network = relaxation.network(state, self.thickness, self.law.friction);
        let nominal = relaxation.boundary_first_piola(self.thickness);
        // F of the committed state relative to the frame as cut: Y = F Y0 for both cell vectors.
        let total = plane::product(
            &plane::transpose(&state.cell.rows),
            &plane::inverse(&plane::transpose(&self.reference.rows)),
        );
        let scaled = plane::product(&nominal, &plane::transpose(&total));
        let stress = match self.options.constraint {
            // Grains slide along platens, away from `F X`: their forces turn the body about where they are, not where they were. The
            // normal components agree.
            FrameConstraint::Platens => network.stress(),
            _ => plane::add_scaled(&[[0.0; 2]; 2], 1.0 / plane::determinant(&total), &scaled),
        };
        let mut flags = TrialFlags::default();
        if network.contacts.is_empty() {
            flags.insert(TrialFlags::NO_LOAD_BEARING_CONTACTS);
        }
        if network.max_overlap_ratio() > LARGE_OVERLAP_RATIO {
            flags.insert(TrialFlags::LARGE_OVERLAP);
        }
        let answer = TrialResult {
            stress: Tensor2::from_plane(stress),
            tangent: None,
            scalars: Scalars {
                void_ratio: self.void_ratio(state),
                coordination_number: network.coordination_number(),
                unbalanced_force_ratio: state.unbalanced,
                max_overlap_ratio: network.max_overlap_ratio(),
                volume_ratio: state.cell.measure() / state.initial_measure,
            },
            observed: self.observed(state, &network, sums, &stress, f, observables),
            cost,
            flags,
        };
        (answer, network)
    }

    /// Void area over grain area of one period of all copies: grains on the boundary count once.
    fn void_ratio(&self, state: &GrainState<Discs>) -> f64 {
        let solid: f64 =
            self.geometry.distinct_places().map(|place| Discs::grain_measure(self.geometry.radii[place])).sum();
        (state.cell.measure() - solid) / solid
    }

    fn observed(
        &self,
        state: &GrainState<Discs>,
        network: &ContactNetwork<Discs>,
        sums: ContactSums,
        stress: &Plane,
        f: &Plane,
        wanted: Observables,
    ) -> Observed {
        let mut observed = Observed::default();
        let volume = state.cell.measure() * self.thickness;
        if wanted.contains(Observables::FIRST_PIOLA) {
            observed.first_piola = Tensor2::from_plane(first_piola(stress, f));
        }
        if wanted.contains(Observables::COORDINATION_NO_RATTLERS) {
            observed.coordination_number_no_rattlers = network.coordination_number_no_rattlers();
        }
        if wanted.contains(Observables::FABRIC) {
            let fabric = network.fabric();
            observed.fabric = Tensor2::from_plane(fabric);
            observed.fabric_anisotropy = anisotropy(&fabric);
        }
        if wanted.contains(Observables::SLIDING_FRACTION) {
            observed.sliding_fraction = sums.sliding as f64 / sums.contacts.max(1) as f64;
        }
        if wanted.contains(Observables::ENERGY) {
            observed.elastic_energy = sums.elastic_energy / volume;
            observed.frictional_dissipation = state.dissipation / volume;
        }
        if wanted.contains(Observables::ROTATION) {
            let sum: f64 = self.geometry.distinct_places().map(|place| state.rotations[place]).sum();
            let mean = sum / self.geometry.distinct as f64;
            observed.mean_rotation = [0.0, 0.0, mean];
        }
        observed
    }
}

/// Turns a state as a whole.
fn turn(state: &mut GrainState<Discs>, angle: f64) {
    if angle == 0.0 {
        return;
    }
    let rotation = plane::rotation(angle);
    state.cell = state.cell.deformed(&rotation);
    for position in &mut state.positions {
        *position = plane::apply(&rotation, *position);
    }
    for grain_angle in &mut state.rotations {
        *grain_angle += angle;
    }
}

impl RveSolver for FrameRve {
    fn trial(&mut self, target: &Tensor2, options: &TrialOptions) -> Result<TrialResult, RveError> {
        self.trial = None;
        protocol::target::check(target, 2)?;
        if options.tangent != TangentKind::None {
            return Err(RveError::Unsupported("tangent operators of a frame; ask for none".into()));
        }
        RveError::refuse_reduced_friction(options)?;
        let h = target.plane();
        if h != [[0.0; 2]; 2] {
            return self.solve(&h, options);
        }
        if !self.is_at_rest() {
            return self.solve(&h, &TrialOptions { ramp_steps: 1, ..*options });
        }
        let state = self.committed.clone();
        let cost = Cost { force_evaluations: 1, ..Cost::default() };
        let (mut answer, network) = self.answer_for(&state, &plane::IDENTITY, options.observables, cost);
        answer.flags.insert(TrialFlags::SKIPPED_NULL_TARGET);
        self.trial = Some(Trial { state, network, boundary_residual: 0.0 });
        Ok(answer)
    }

    fn commit(&mut self) -> Result<(), RveError> {
        self.committed = self.trial.take().ok_or(RveError::NothingToCommit)?.state;
        Ok(())
    }

    fn rollback(&mut self) {
        self.trial = None;
    }

    fn snapshot(&self, out: &mut Vec<u8>) {
        snapshot::seal(FRAME_ENGINE_NAME, &self.committed.to_bytes(self.id), out);
    }

    fn snapshot_trial(&self, out: &mut Vec<u8>) -> Result<(), RveError> {
        let trial = self.trial.as_ref().ok_or(RveError::NothingToCommit)?;
        snapshot::seal(FRAME_ENGINE_NAME, &trial.state.to_bytes(self.id), out);
        Ok(())
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), RveError> {
        let refuse = |reason: String| RveError::Snapshot(reason);
        let payload = snapshot::open(FRAME_ENGINE_NAME, bytes).map_err(|error| refuse(error.to_string()))?;
        self.committed = GrainState::from_bytes(payload, self.id, self.geometry.places.len())
            .map_err(|error| refuse(error.to_string()))?;
        self.trial = None;
        Ok(())
    }
}
