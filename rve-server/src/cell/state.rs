//! Everything that a committed or trial state of one cell consists of, and its bytes.
//!
//! A state is complete: two solvers with equal states give equal answers. The pair list is a cache and therefore not
//! part of it, and positions are never wrapped back into the cell because the cell shift is part of a contact's key.

use super::event_memory::{EventMemory, StoredResponse};
use super::neighbours::PairKey;
use super::operator_memory::OperatorMemory;
use super::periodic::Cell;
use crate::space::{Components, Discs, Space, Tensor};
use bytemuck::Pod;
use protocol::{ContentId, DefinitionId};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use thiserror::Error;

/// A touching pair and its tangential force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactRecord<S: Space = Discs> {
    /// Origin grain.
    pub origin: u32,
    /// End grain.
    pub end: u32,
    /// Cell shifts of the end grain along the periodicity vectors.
    pub shift: S::Shift,
    /// Tangential force on the origin grain, N: along t in the plane, a vector normal to the branch in space.
    pub tangential_force: S::Tangential,
}

impl<S: Space> ContactRecord<S> {
    /// Bytes of one record: both grains, the shifts, the force, without padding.
    const SIZE: usize = 8 + size_of::<S::Shift>() + size_of::<S::Tangential>();

    /// Key of the pair.
    pub fn key(&self) -> PairKey<S> {
        PairKey { origin: self.origin, end: self.end, shift: self.shift }
    }

    fn write(&self, bytes: &mut Vec<u8>) {
        bytes.extend_from_slice(bytemuck::bytes_of(&[self.origin, self.end]));
        bytes.extend_from_slice(bytemuck::bytes_of(&self.shift));
        bytes.extend_from_slice(bytemuck::bytes_of(&self.tangential_force));
    }

    /// Reads a record of [`SIZE`](Self::SIZE) bytes.
    fn read(bytes: &[u8]) -> Self {
        let (grains, rest) = bytes.split_at(8);
        let (shift, force) = rest.split_at(size_of::<S::Shift>());
        let [origin, end]: [u32; 2] = bytemuck::pod_read_unaligned(grains);
        Self {
            origin,
            end,
            shift: bytemuck::pod_read_unaligned(shift),
            tangential_force: bytemuck::pod_read_unaligned(force),
        }
    }
}

/// State of one cell.
#[derive(Clone, Debug, PartialEq)]
pub struct GrainState<S: Space = Discs> {
    /// Periodic cell.
    pub cell: Cell<S>,
    /// Grain centres, m; not wrapped.
    pub positions: Vec<S::Vector>,
    /// Spin of each grain added up since the initial state, rad; counter-clockwise in the plane. In space this is the
    /// time integral of the rotation velocity, a vector that no number of turns makes ambiguous.
    pub rotations: Vec<S::Spin>,
    /// Touching pairs, sorted by key.
    pub contacts: Vec<ContactRecord<S>>,
    /// Moment that each contact transmits onto its origin grain by rolling resistance, N m; empty for laws without.
    pub rolling_moments: Vec<S::Spin>,
    /// Averages and calibrations of tangent operators.
    pub operators: OperatorMemory,
    /// Stored energy lost since the initial state, to friction above all, J.
    pub dissipation: f64,
    /// Work that numerical damping has taken since the initial state, in trials that were asked for energies, J.
    pub damping: f64,
    /// Area (m2) or volume (m3) of the cell in the initial state.
    pub initial_measure: f64,
    /// Value of the equilibrium criterion when the state was reached.
    pub unbalanced: f64,
    /// Largest sum of the normal contact forces that the cell has carried at rest, N: what little load is measured by.
    pub largest_load: f64,
    /// Whether the contacts carry load. Grains that merely graze each other, without being in equilibrium, do not.
    pub bears_load: bool,
    /// Memory of the event-driven solver; states of other solvers have none.
    pub events: Option<Box<EventMemory<S>>>,
}

/// [`EventMemory`] as bytes.
#[derive(Serialize, Deserialize)]
struct EventPayload<'a, T> {
    balance: i32,
    pause: u32,
    last_pause: u32,
    frame: T,
    reach: f64,
    #[serde(with = "serde_bytes")]
    pairs: &'a [u8],
    /// Empty without a response.
    #[serde(with = "serde_bytes")]
    columns: &'a [u8],
}

#[derive(Serialize, Deserialize)]
struct Payload<'a, T> {
    definition: ContentId,
    cell: T,
    dissipation: f64,
    damping: f64,
    initial_measure: f64,
    unbalanced: f64,
    largest_load: f64,
    bears_load: bool,
    operators: OperatorMemory,
    #[serde(with = "serde_bytes")]
    positions: &'a [u8],
    #[serde(with = "serde_bytes")]
    rotations: &'a [u8],
    #[serde(with = "serde_bytes")]
    contacts: &'a [u8],
    #[serde(with = "serde_bytes")]
    rolling_moments: &'a [u8],
    /// Left out where there is none, so that states of other solvers keep the bytes that they always had.
    #[serde(borrow, default, skip_serializing_if = "Option::is_none")]
    events: Option<EventPayload<'a, T>>,
}

/// Bytes that a state has next to its lists, most often: operators may need more.
const USUAL_REST: usize = 1024;

/// Why bytes are no state of a cell.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum StateError {
    /// They are not MessagePack of the expected shape.
    #[error("not a state of a cell of {grains}: {reason}")]
    Encoding {
        /// The kind of grains.
        grains: &'static str,
        /// The decoder's reason.
        reason: String,
    },
    /// They belong to another RVE.
    #[error("state of definition {found}, but this RVE is {expected}")]
    Definition {
        /// Definition that the state names.
        found: DefinitionId,
        /// Definition of the RVE.
        expected: DefinitionId,
    },
    /// They hold another number of grains.
    #[error("state of {found} grains, but this RVE has {expected}")]
    GrainCount {
        /// Grains of the state.
        found: usize,
        /// Grains of the RVE.
        expected: usize,
    },
    /// A list is cut off within a record.
    #[error("{length} bytes do not hold a whole number of records")]
    Records {
        /// Length of the list.
        length: usize,
    },
    /// Contacts name unknown grains, are out of order, or lack some rolling moments.
    #[error("state with a contact list that is not sound")]
    Contacts,
    /// A place, rotation, force or measure is not finite, or the cell has no measure.
    #[error("state with numbers that are not sound")]
    NotFinite,
    /// An averaged or calibrated operator is not finite.
    #[error("state with an operator that is not sound")]
    Operators,
    /// A stored response names unknown grains, is not finite or of another size.
    #[error("state with a stored response that is not sound")]
    Response,
}

impl<S: Space> GrainState<S> {
    /// Whether all lengths, angles and forces are finite and the cell has a measure.
    fn is_sound(&self) -> bool {
        let measure = self.cell.measure();
        measure.is_finite()
            && measure > 0.0
            && self.positions.iter().all(|place| place.is_finite())
            && self.rotations.iter().all(|rotation| rotation.is_finite())
            && self.contacts.iter().all(|contact| contact.tangential_force.is_finite())
            && self.rolling_moments.iter().all(|moment| moment.is_finite())
            && [self.dissipation, self.damping, self.initial_measure, self.largest_load]
                .iter()
                .all(|one| one.is_finite())
    }

    /// The bytes of the state, naming the definition it belongs to.
    pub fn to_bytes(&self, definition: DefinitionId) -> Vec<u8> {
        let mut contacts = Vec::with_capacity(self.contacts.len() * ContactRecord::<S>::SIZE);
        for contact in &self.contacts {
            contact.write(&mut contacts);
        }
        let response = self.events.as_ref().and_then(|events| events.response.as_ref());
        let mut pairs = Vec::new();
        for pair in response.iter().flat_map(|response| response.pairs.iter()) {
            pairs.extend_from_slice(bytemuck::bytes_of(&[pair.origin, pair.end]));
            pairs.extend_from_slice(bytemuck::bytes_of(&pair.shift));
        }
        let payload = Payload {
            definition,
            cell: self.cell.rows,
            dissipation: self.dissipation,
            damping: self.damping,
            initial_measure: self.initial_measure,
            unbalanced: self.unbalanced,
            largest_load: self.largest_load,
            bears_load: self.bears_load,
            operators: self.operators.clone(),
            positions: bytemuck::cast_slice(&self.positions),
            rotations: bytemuck::cast_slice(&self.rotations),
            contacts: &contacts,
            rolling_moments: bytemuck::cast_slice(&self.rolling_moments),
            events: self.events.as_ref().map(|events| EventPayload {
                balance: events.balance,
                pause: events.pause,
                last_pause: events.last_pause,
                frame: response.map_or(S::Tensor::IDENTITY, |response| response.frame),
                reach: response.map_or(0.0, |response| response.reach),
                pairs: &pairs,
                columns: response.map_or(&[], |response| bytemuck::cast_slice(&response.columns)),
            }),
        };
        let lists = [payload.positions, payload.rotations, payload.contacts, payload.rolling_moments];
        let of_events = payload.events.as_ref().map_or(0, |events| events.pairs.len() + events.columns.len());
        let length = lists.iter().map(|list| list.len()).sum::<usize>() + of_events;
        let mut bytes = Vec::with_capacity(length + USUAL_REST);
        rmp_serde::encode::write(&mut bytes, &payload).expect("writing MessagePack to memory cannot fail");
        bytes
    }

    /// Reads a state of `grain_count` grains back.
    ///
    /// # Errors
    /// Bytes that are not a state, or a state of another definition.
    pub fn from_bytes(bytes: &[u8], definition: DefinitionId, grain_count: usize) -> Result<Self, StateError> {
        let payload: Payload<'_, S::Tensor> = rmp_serde::from_slice(bytes)
            .map_err(|error| StateError::Encoding { grains: S::GRAINS, reason: error.to_string() })?;
        if payload.definition != definition {
            return Err(StateError::Definition { found: payload.definition, expected: definition });
        }
        whole_records(payload.contacts, ContactRecord::<S>::SIZE)?;
        let state = Self {
            cell: Cell { rows: payload.cell },
            positions: copied(payload.positions)?,
            rotations: copied(payload.rotations)?,
            contacts: payload.contacts.chunks_exact(ContactRecord::<S>::SIZE).map(ContactRecord::read).collect(),
            rolling_moments: copied(payload.rolling_moments)?,
            operators: payload.operators,
            dissipation: payload.dissipation,
            damping: payload.damping,
            initial_measure: payload.initial_measure,
            unbalanced: payload.unbalanced,
            largest_load: payload.largest_load,
            bears_load: payload.bears_load,
            events: payload.events.map(event_memory::<S>).transpose()?.map(Box::new),
        };
        if state.positions.len() != grain_count || state.rotations.len() != grain_count {
            return Err(StateError::GrainCount { found: state.positions.len(), expected: grain_count });
        }
        let known = |contact: &ContactRecord<S>| (contact.origin.max(contact.end) as usize) < grain_count;
        let moments = [0, state.contacts.len()].contains(&state.rolling_moments.len());
        let ascending = state.contacts.windows(2).all(|pair| pair[0].key() < pair[1].key());
        if !moments || !state.contacts.iter().all(known) || !ascending {
            return Err(StateError::Contacts);
        }
        if !state.is_sound() {
            return Err(StateError::NotFinite);
        }
        if !state.operators.is_sound() {
            return Err(StateError::Operators);
        }
        let response = state.events.as_ref().and_then(|events| events.response.as_ref());
        if response.is_some_and(|response| !response.is_sound(grain_count)) {
            return Err(StateError::Response);
        }
        Ok(state)
    }

    /// Mean over the grains of the spin added up since the initial state, rad.
    pub fn mean_rotation(&self) -> S::Spin {
        let mut sum = S::Spin::ZERO;
        for rotation in &self.rotations {
            sum = sum.plus(*rotation);
        }
        let count = self.rotations.len() as f64;
        S::Spin::from_fn(|axis| sum.components()[axis] / count)
    }

    /// The state turned as a whole.
    #[must_use]
    pub fn turned(mut self, turn: S::Turn) -> Self {
        if turn == S::Turn::default() {
            return self;
        }
        let (matrix, vector) = (S::rotation_matrix(turn), S::rotation_vector(turn));
        self.cell = self.cell.deformed(&matrix);
        for position in &mut self.positions {
            *position = crate::space::apply(&matrix, *position);
        }
        for rotation in &mut self.rotations {
            *rotation = rotation.plus(vector);
        }
        for contact in &mut self.contacts {
            contact.tangential_force = S::turned_tangential(contact.tangential_force, &matrix);
        }
        for moment in &mut self.rolling_moments {
            *moment = S::turned_spin(*moment, &matrix);
        }
        if let Some(events) = &mut self.events {
            events.turn(&matrix);
        }
        self
    }
}

/// Reads the memory of the event-driven solver back.
fn event_memory<S: Space>(payload: EventPayload<'_, S::Tensor>) -> Result<EventMemory<S>, StateError> {
    let size = 8 + size_of::<S::Shift>();
    whole_records(payload.pairs, size)?;
    let pair = |bytes: &[u8]| {
        let (grains, shift) = bytes.split_at(8);
        let [origin, end]: [u32; 2] = bytemuck::pod_read_unaligned(grains);
        PairKey { origin, end, shift: bytemuck::pod_read_unaligned(shift) }
    };
    let columns: Vec<f64> = copied(payload.columns)?;
    let response = (!columns.is_empty()).then(|| StoredResponse {
        pairs: Arc::new(payload.pairs.chunks_exact(size).map(pair).collect()),
        columns: Arc::new(columns),
        frame: payload.frame,
        reach: payload.reach,
    });
    Ok(EventMemory { balance: payload.balance, pause: payload.pause, last_pause: payload.last_pause, response })
}

/// Refuses bytes that do not hold a whole number of records.
fn whole_records(bytes: &[u8], size: usize) -> Result<(), StateError> {
    if bytes.len().is_multiple_of(size) {
        return Ok(());
    }
    Err(StateError::Records { length: bytes.len() })
}

/// Copies unaligned bytes into values.
fn copied<T: Pod>(bytes: &[u8]) -> Result<Vec<T>, StateError> {
    whole_records(bytes, size_of::<T>())?;
    let mut values = vec![T::zeroed(); bytes.len() / size_of::<T>()];
    bytemuck::cast_slice_mut(&mut values).copy_from_slice(bytes);
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::Spheres;

    fn state() -> GrainState {
        GrainState {
            cell: Cell { rows: [[1.0, 0.1], [-0.3, 2.0]] },
            positions: vec![[0.1, 0.2], [f64::MIN_POSITIVE, -1.0 / 3.0]],
            rotations: vec![0.0, -1e-17],
            contacts: vec![ContactRecord { origin: 0, end: 1, shift: [-1, 2], tangential_force: 0.1 + 0.2 }],
            rolling_moments: vec![],
            operators: OperatorMemory::default(),
            dissipation: 1e-30,
            damping: -3e-31,
            initial_measure: 2.03,
            unbalanced: 1e-4,
            largest_load: 3.5,
            bears_load: true,
            events: None,
        }
    }

    #[test]
    fn bytes_restore_every_bit() {
        let id = ContentId::of(b"definition");
        let bytes = state().to_bytes(id);
        let restored = GrainState::<Discs>::from_bytes(&bytes, id, 2).unwrap();
        assert_eq!(restored.to_bytes(id), bytes);
        assert_eq!(restored, state());
    }

    #[test]
    fn memory_of_the_event_driven_solver_is_restored_and_states_without_keep_their_bytes() {
        let id = ContentId::of(b"definition");
        let plain = state().to_bytes(id).len();
        let response = StoredResponse {
            pairs: Arc::new(vec![PairKey { origin: 0, end: 1, shift: [-1, 2] }]),
            columns: Arc::new((0..18).map(|place| f64::from(place) / 7.0).collect()),
            frame: [[0.0, -1.0], [1.0, 0.0]],
            reach: 1e-3,
        };
        let memory = EventMemory { balance: -7, pause: 3, last_pause: 8, response: Some(response) };
        let with = GrainState { events: Some(Box::new(memory.clone())), ..state() };
        let bytes = with.to_bytes(id);
        assert!(bytes.len() > plain);
        assert_eq!(GrainState::from_bytes(&bytes, id, 2).unwrap(), with);
        let mut damaged = memory;
        if let Some(response) = &mut damaged.response {
            response.columns = Arc::new(vec![0.0; 17]);
        }
        let bytes = GrainState { events: Some(Box::new(damaged)), ..state() }.to_bytes(id);
        assert_eq!(GrainState::<Discs>::from_bytes(&bytes, id, 2).unwrap_err(), StateError::Response);
    }

    #[test]
    fn foreign_or_damaged_states_are_refused() {
        let id = ContentId::of(b"definition");
        let bytes = state().to_bytes(id);
        let other = ContentId::of(b"other");
        let refused = |bytes: &[u8], id, grains| GrainState::<Discs>::from_bytes(bytes, id, grains).unwrap_err();
        assert_eq!(refused(&bytes, other, 2), StateError::Definition { found: id, expected: other });
        assert_eq!(refused(&bytes, id, 3), StateError::GrainCount { found: 2, expected: 3 });
        assert!(GrainState::<Discs>::from_bytes(&bytes[1..], id, 2).is_err());
        let mut unsound = state();
        unsound.contacts[0].end = 5;
        assert_eq!(refused(&unsound.to_bytes(id), id, 2), StateError::Contacts);
        let mut unsound = state();
        unsound.contacts.push(unsound.contacts[0]);
        assert_eq!(refused(&unsound.to_bytes(id), id, 2), StateError::Contacts, "a pair that is there twice");
        let mut unsound = state();
        unsound.positions[1][0] = f64::NAN;
        assert_eq!(refused(&unsound.to_bytes(id), id, 2), StateError::NotFinite);
        let mut unsound = state();
        unsound.cell.rows.swap(0, 1);
        assert_eq!(refused(&unsound.to_bytes(id), id, 2), StateError::NotFinite, "an inverted cell");
    }

    #[test]
    fn state_of_spheres_is_restored_and_turned() {
        let state = GrainState::<Spheres> {
            cell: Cell { rows: [[1.0, 0.1, 0.0], [-0.3, 2.0, 0.0], [0.0, 0.2, 1.5]] },
            positions: vec![[0.1, 0.2, 0.3]],
            rotations: vec![[0.0, -1e-17, 0.4]],
            contacts: vec![ContactRecord {
                origin: 0,
                end: 0,
                shift: [0, 1, -1],
                tangential_force: [0.1, 0.2, -0.3],
            }],
            rolling_moments: vec![],
            operators: OperatorMemory::default(),
            dissipation: 0.0,
            damping: 0.0,
            initial_measure: 3.0,
            unbalanced: 0.0,
            largest_load: 0.0,
            bears_load: false,
            events: None,
        };
        let id = ContentId::of(b"definition");
        let restored = GrainState::<Spheres>::from_bytes(&state.to_bytes(id), id, 1).unwrap();
        assert_eq!(restored, state);
        assert!(GrainState::<Discs>::from_bytes(&state.to_bytes(id), id, 1).is_err());

        let quarter = Spheres::polar(&[[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0; 3]]).turn;
        let turned = state.turned(quarter);
        let near = |a: [f64; 3], b: [f64; 3]| a.minus(b).norm() < 1e-15;
        assert!(near(turned.positions[0], [-0.2, 0.1, 0.3]) && near(turned.cell.rows[0], [-0.1, 1.0, 0.0]));
        assert!(near(turned.contacts[0].tangential_force, [-0.2, 0.1, -0.3]));
        assert!(near(turned.rotations[0], [0.0, -1e-17, 0.4 + std::f64::consts::FRAC_PI_2]));
    }
}
