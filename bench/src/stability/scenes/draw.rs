//! What a small scene is: a body, a cell and what is done to it, drawn from the seed and the number of the scene.

use super::super::case::{Range, sampled_contact, sampled_error};
use super::super::packings::Slot;
use super::super::random_stream::{Purpose, RandomStream};
use macro_solver::formulation::Formulation;
use macro_solver::mesh::ElementKind;
use rve_server::contact::ContactTable;
use rve_server::definition::{Accuracy, AnyDefinition, RveOptions};

/// Grains of the largest packing behind a Gauss point.
const LARGEST: usize = 200;

/// Share of the scenes that stand in space.
const IN_SPACE: f64 = 0.3;

/// Share of the scenes that keep to an error, as scenes do that name no accuracy.
const WITH_ERROR: f64 = 0.6;

/// Elements of a scene along x and y.
const PLANE: [[usize; 3]; 4] = [[1, 1, 0], [2, 1, 0], [1, 2, 0], [2, 2, 0]];

/// Elements of a scene along x, y and z.
const SPACE: [[usize; 3]; 4] = [[1, 1, 1], [1, 2, 1], [2, 1, 1], [1, 1, 2]];

/// What is done to a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Loading {
    /// Between smooth platens.
    Compression,
    /// Between rough platens, one of which moves sideways.
    Shear,
    /// As in the shipped scene `single-hexahedron-shear`: under a rigid head that may rise and sink.
    Head,
}

/// One small scene.
#[derive(Clone, Debug)]
pub(super) struct Scene {
    /// Its number; with the seed of the campaign it is all that is needed to make it again.
    pub(super) number: u64,
    /// What is expected of it.
    pub(super) range: Range,
    /// Its packing among the slots of the campaign.
    pub(super) slot: usize,
    /// Pressure of the packing and on the sides, Pa.
    pub(super) pressure: f64,
    pub(super) kind: ElementKind,
    /// Elements along x, y and z; none along z in the plane.
    pub(super) elements: [usize; 3],
    pub(super) formulation: Formulation,
    pub(super) loading: Loading,
    /// Strain, or angle of shear, over the whole path.
    pub(super) strain: f64,
    pub(super) steps: usize,
    /// Height over width, slant of the sides, narrowing towards the top.
    pub(super) shape: [f64; 3],
    contact: ContactTable,
    /// How accurately the cell is solved.
    pub(super) options: RveOptions,
}

impl Scene {
    /// Draws the scene of a number.
    pub(super) fn sampled(seed: u64, number: u64, slots: &[Slot]) -> Self {
        let stream = &mut RandomStream::new(seed, Purpose::Scene(number));
        let range = if stream.chance(0.5) { Range::Everyday } else { Range::Hard };
        let is_everyday = range == Range::Everyday;
        let dimension = if stream.chance(IN_SPACE) { 3 } else { 2 };
        let may =
            |slot: &Slot| slot.dimension == dimension && slot.number <= LARGEST && (slot.is_everyday || !is_everyday);
        let places: Vec<usize> = (0..slots.len()).filter(|place| may(&slots[*place])).collect();
        let slot = stream.pick(&places);
        let (loading, kind, elements) = match dimension {
            2 => {
                let loading = stream.pick(&[Loading::Compression, Loading::Shear]);
                let kinds =
                    [ElementKind::Q4, ElementKind::Q8, ElementKind::T3, ElementKind::T6, ElementKind::Q4Single];
                (loading, stream.pick(&kinds), stream.pick(&PLANE))
            }
            _ => {
                let loading = stream.pick(&[Loading::Compression, Loading::Shear, Loading::Head]);
                let kinds = [ElementKind::H8, ElementKind::H8Single, ElementKind::H20, ElementKind::T4];
                match loading {
                    Loading::Head => (loading, ElementKind::H8Single, [1, 1, 1]),
                    _ => (loading, stream.pick(&kinds), stream.pick(&SPACE)),
                }
            }
        };
        let shape = match range {
            _ if loading == Loading::Head => [1.0, 0.0, 0.0],
            Range::Everyday => [stream.between(0.5, 2.0), 0.0, 0.0],
            Range::Hard => [stream.decades(0.1, 10.0), stream.between(-1.0, 1.0), stream.between(0.0, 0.6)],
        };
        let strain = match (loading, is_everyday) {
            (Loading::Compression, true) => 0.01,
            (Loading::Compression, false) => stream.between(0.01, 0.05),
            (Loading::Shear, true) => 0.02,
            (Loading::Shear, false) => stream.between(0.05, 0.3),
            (Loading::Head, true) => 0.01,
            (Loading::Head, false) => stream.between(0.01, 0.05),
        };
        let contact = sampled_contact(range, &slots[slot], stream);
        let options = match stream.chance(WITH_ERROR) {
            true => RveOptions { error: Some(sampled_error(stream)), ..RveOptions::default() },
            false => RveOptions { accuracy: Accuracy::Draft, ..RveOptions::default() },
        };
        let formulation = match range {
            // Cells of spheres turn with their point.
            Range::Everyday if dimension == 3 => Formulation::Corotational,
            Range::Everyday => Formulation::UpdatedLagrangian,
            Range::Hard => stream.pick(&[
                Formulation::TotalLagrangian,
                Formulation::UpdatedLagrangian,
                Formulation::Corotational,
            ]),
        };
        let steps = if is_everyday { 10 } else { 8 + stream.below(8) };
        let pressure = slots[slot].pressure;
        Self {
            number,
            range,
            slot,
            pressure,
            kind,
            elements,
            formulation,
            loading,
            strain,
            steps,
            shape,
            contact,
            options,
        }
    }

    /// The cell with these options.
    ///
    /// # Errors
    /// A packing that cannot be made.
    pub(super) fn definition(&self, slot: &Slot, options: &RveOptions) -> anyhow::Result<AnyDefinition> {
        Ok(AnyDefinition::new(slot.packing()?, self.contact.clone(), options.clone()).validate()?)
    }
}
