//! `[initial_stress]`: what the stress of the packings should be at their places, and how well it has to be met.

use super::conditions::ConditionPlaces;
use super::document::Document;
use super::input_error::InputError;
use super::place::place_text;
use super::problem_error::problem_error;
use super::tables::{InitialStressTable, StressTable};
use macro_solver::problem::{InitialState, InitialStress, Problem};
use macro_solver::solve::{EquilibriumError, equilibrium_stress};

/// Remedy where no stress is given.
const GIVE_STRESS: &str = "give the expected stress with `uniform`, `geostatic` or `equilibrium`";

/// Reads the table; the stress of `equilibrium` takes the whole problem, see [`find_equilibrium`].
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
    let refuse = |key: &str, message: &str, hint: &str| {
        Err(document.error_at_key(&["initial_stress", key], message).hint(hint))
    };
    if table.equilibrium.is_some() {
        if expected.is_some() {
            return refuse(
                "equilibrium",
                "there is another stress at the start",
                "remove it, or `uniform` and `geostatic`",
            );
        }
        if table.preparation.prepare_spacing > 0.0 {
            return refuse(
                "prepare_spacing",
                "with `equilibrium` every Gauss point has a stress, and a cell, of its own",
                "remove this key",
            );
        }
    } else if expected.is_none() && table.limits.largest_deviation.is_some() {
        return refuse("largest_deviation", "there is no stress to deviate from", GIVE_STRESS);
    } else if expected.is_none() && table.preparation.prepare {
        return refuse("prepare", "there is no stress to bring the cells to", GIVE_STRESS);
    }
    Ok(InitialState { expected, limits: table.limits, preparation: table.preparation })
}

/// Finds the stress of `equilibrium` in a problem that has been validated.
///
/// # Errors
/// Loads that friction does not bear, or supports that leave the body free.
pub(super) fn find_equilibrium(
    document: &Document,
    places: &[ConditionPlaces],
    table: &InitialStressTable,
    problem: &mut Problem,
) -> Result<(), InputError> {
    let Some(settings) = &table.equilibrium else { return Ok(()) };
    let found = equilibrium_stress(problem, settings).map_err(|error| match error {
        EquilibriumError::Problem(error) => problem_error(document, places, &error),
        EquilibriumError::NotFound(reason) => document
            .error_at_key(
                &["initial_stress", "equilibrium"],
                format!("no stress in equilibrium with the loads at the start was found: {reason}"),
            )
            .hint(
                "raise friction_angle, give the weight and the pressures on free surfaces with history = \"constant\", and hold the \
                 body by supports",
            ),
    })?;
    if let Some(point) = found.iter().position(|stress| *stress == [[0.0; 3]; 3]) {
        let place = place_text(&problem.mesh, point);
        return Err(document
            .error_at_key(
                &["initial_stress", "equilibrium"],
                format!("the ground would be torn apart at Gauss point {point} at {place}: grains bear no tension"),
            )
            .hint("give free faces a small pressure with history = \"constant\", or raise friction_angle"));
    }
    problem.initial.expected = Some(InitialStress::AtPoints(found));
    Ok(())
}

fn rows(stress: &StressTable) -> [[f64; 3]; 3] {
    [[stress.xx, stress.xy, stress.xz], [stress.xy, stress.yy, stress.yz], [stress.xz, stress.yz, stress.zz]]
}
