//! Whether the layers that walls grip leave grains between them.

use super::SpecimenSpace;
use super::axes::AXES;
use super::contact::Grain;
use super::error::SpecimenError;
use super::test_file::SpecimenTest;
use super::wall::Wall;
use crate::contact::ContactLaw;
use crate::error::DefinitionError;

/// Refuses layers so thick that no grain is left between them.
pub(super) fn refuse_glue_of_all<S: SpecimenSpace, C: ContactLaw<S>>(
    test: &SpecimenTest,
    walls: &[Wall<S, C>],
    numbers: &[Option<[usize; 2]>; 3],
    grains: &[Grain<S>],
    sides: [f64; 3],
) -> Result<(), SpecimenError> {
    let depth = test.walls.glue_depth;
    let axes: Vec<usize> =
        (0..S::DIMENSION).filter(|axis| test.stage.iter().any(|stage| stage.glued_axes().contains(axis))).collect();
    let gripping: Vec<&Wall<S, C>> =
        axes.iter().filter_map(|axis| numbers[*axis]).flatten().map(|wall| &walls[wall]).collect();
    let is_free = |grain: &Grain<S>| gripping.iter().all(|wall| wall.gap(grain) >= depth);
    if depth == 0.0 || gripping.is_empty() || grains.iter().any(is_free) {
        return Ok(());
    }
    let extents: Vec<String> =
        axes.iter().map(|axis| format!("{:.3e} m along {}", sides[*axis], AXES[*axis])).collect();
    Err(SpecimenError::Test(DefinitionError(format!(
        "walls.glue_depth = {depth} m glues every grain: the specimen measures {}; about half a mean grain diameter is usual",
        extents.join(", ")
    ))))
}
