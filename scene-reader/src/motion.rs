//! `[dynamics]` and `[relaxation]`: stages that are not solved by Newton's method. Tables at the top hold for all stages; those
//! of a stage change what they name.

use super::document::Document;
use super::input_error::InputError;
use super::materials::Densities;
use super::sets::Sets;
use super::tables::ProcedureKeyword;
use keys::{Given, Located};
use macro_solver::problem::Procedure;
use macro_solver::problem::dynamics::DynamicSettings;
use macro_solver::problem::relaxation::{RelaxationForm, RelaxationSettings};

/// The tables of the scene, or of one stage.
#[derive(Clone, Copy)]
pub(super) struct MotionTables<'a> {
    /// Path to the stage; empty for the scene.
    pub(super) place: &'a [&'a str],
    pub(super) dynamics: &'a Given<DynamicSettings>,
    pub(super) relaxation: &'a Given<RelaxationSettings>,
}

/// How a stage is solved, from the tables at the top and its own; `densities` are those of the packings.
///
/// # Errors
/// A set that does not exist.
pub(super) fn procedure(
    document: &Document,
    sets: &Sets<'_>,
    keyword: ProcedureKeyword,
    tables: &[MotionTables<'_>],
    densities: &Densities,
) -> Result<Procedure, InputError> {
    Ok(match keyword {
        ProcedureKeyword::Implicit => Procedure::Implicit,
        ProcedureKeyword::Relaxation => {
            let mut settings = RelaxationSettings::default();
            for given in tables.iter().map(|tables| tables.relaxation) {
                let form: Option<RelaxationForm> = given.get("form").map_err(|fault| document.fault(&fault))?;
                settings = form.map_or(settings, RelaxationSettings::of_form);
                settings = given.over(&settings).map_err(|fault| document.fault(&fault))?;
            }
            Procedure::Relaxation(settings)
        }
        ProcedureKeyword::Dynamic => {
            let mut settings = DynamicSettings::new(densities.packing);
            settings.element_densities.clone_from(&densities.by_element);
            for tables in tables {
                settings = tables.dynamics.over(&settings).map_err(|fault| document.fault(&fault))?;
                if tables.dynamics.has("density") {
                    // One for the whole body, whatever its packings weigh.
                    settings.element_densities.clear();
                }
                check_sets(document, sets, tables, &settings)?;
            }
            Procedure::Dynamic(Box::new(settings))
        }
    })
}

/// Whether the mesh has the sets that the tables name.
fn check_sets(
    document: &Document,
    sets: &Sets<'_>,
    tables: &MotionTables<'_>,
    settings: &DynamicSettings,
) -> Result<(), InputError> {
    let located = |path: &[&str], name: &str| {
        let span = document.span_of(&[tables.place, path].concat());
        Located::new(span.unwrap_or_default(), name.to_owned())
    };
    for (number, name) in settings.absorbing.iter().enumerate().filter(|_| tables.dynamics.has("absorbing")) {
        sets.side_set(document, &located(&["dynamics", "absorbing", &number.to_string()], name))?;
    }
    let velocities = settings.initial_velocities.iter().enumerate();
    for (number, velocity) in velocities.filter(|_| tables.dynamics.has("initial_velocity")) {
        let path = ["dynamics", "initial_velocity", &number.to_string(), "set"];
        sets.node_set(document, &located(&path, &velocity.nodes))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scene;
    use macro_solver::problem::dynamics::{InitialVelocity, Reporting};
    use std::path::Path;

    fn settings(more: &[&str]) -> Result<DynamicSettings, String> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/shear-column.toml");
        let overrides: Vec<String> = more.iter().map(|&text| text.to_owned()).collect();
        let scene = Scene::load(&path, &overrides).map_err(|error| error.to_string())?;
        match &scene.problem.stages[0].procedure {
            Procedure::Dynamic(settings) => Ok((**settings).clone()),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn velocities_at_the_start_and_reports_are_read() {
        let thrown = "dynamics.initial_velocity=[{ set = 'top', value = { x = 1e-3 } }]";
        let velocity = InitialVelocity { nodes: "top".to_owned(), value: [1e-3, 0.0, 0.0] };
        assert_eq!(settings(&[thrown]).unwrap().initial_velocities, [velocity]);
        let error = settings(&[&thrown.replace("top", "nowhere")]).unwrap_err();
        assert!(error.contains("--set dynamics.initial_velocity=") && error.contains("nowhere"), "{error}");
        let reporting = |key: &str| settings(&[key]).map(|settings| settings.reporting);
        assert_eq!(reporting("dynamics.output_interval=1e-3"), Ok(Reporting::Interval(1e-3)));
        let error = reporting("dynamics.output_steps=0").unwrap_err();
        assert!(error.contains("output_steps"), "{error}");
    }
}
