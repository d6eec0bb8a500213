//! `[initial_stress]`: what the stress of the packings should be at their places, and how well it has to be met.

use super::document::Document;
use super::input_error::InputError;
use super::tables::{InitialStressTable, StressTable};
use macro_solver::problem::{InitialState, InitialStress};

/// Reads the table.
///
/// # Errors
/// A deviation from a field that is not given, or a preparation for it.
pub(super) fn initial_state(document: &Document, table: &InitialStressTable) -> Result<InitialState, InputError> {
    let expected = match (&table.uniform, &table.geostatic) {
        // The check of the document excludes both.
        (Some(uniform), _) => Some(InitialStress::Uniform(rows(uniform))),
        (None, Some(ground)) => Some(InitialStress::Geostatic {
            surface: ground.surface,
            unit_weight: ground.unit_weight,
            rest_coefficient: ground.rest_coefficient,
            surcharge: ground.surcharge,
        }),
        (None, None) => None,
    };
    if expected.is_none() && table.limits.largest_deviation.is_some() {
        return Err(document
            .error_at_key(&["initial_stress", "largest_deviation"], "there is no stress to deviate from")
            .hint("give the expected stress with `uniform` or `geostatic`"));
    }
    if expected.is_none() && table.preparation.prepare {
        return Err(document
            .error_at_key(&["initial_stress", "prepare"], "there is no stress to bring the cells to")
            .hint("give the expected stress with `uniform` or `geostatic`"));
    }
    Ok(InitialState { expected, limits: table.limits, preparation: table.preparation })
}

fn rows(stress: &StressTable) -> [[f64; 3]; 3] {
    [[stress.xx, stress.xy, stress.xz], [stress.xy, stress.yy, stress.yz], [stress.xz, stress.yz, stress.zz]]
}
