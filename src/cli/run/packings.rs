//! Packings that the contact law of a scene does not leave in the equilibrium in which they were written.

use crate::cli::start_state::PackingState;
use scene_reader::Scene;

/// What the contact law does not take over of the packings of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct PackingCounts {
    /// Packings whose grains are far from rest under the law.
    pub(super) far_from_rest: u64,
    /// Tangential forces and rolling moments that were dropped or cut, over all packings.
    pub(super) forces_changed: u64,
}

/// Looks at the packings of a scene under its contact law and logs what it finds. Cells that the run has brought to their initial stress
/// are at rest.
pub(super) fn packings_under_the_law(scene: &Scene) -> PackingCounts {
    let mut counts = PackingCounts::default();
    if scene.prepared.is_some() {
        return counts;
    }
    for (number, definition) in scene.materials.definitions.iter().enumerate() {
        // A packing that cannot be a cell is refused where the workers are told of it.
        let Ok(packing) = PackingState::of(definition) else { continue };
        counts.far_from_rest += u64::from(packing.is_far_from_rest);
        counts.forces_changed += packing.listed_forces.changed() as u64;
        for remark in packing.remarks_on_the_law() {
            tracing::warn!(event = "packing_under_another_law", packing = number, reason = remark);
        }
    }
    counts
}
