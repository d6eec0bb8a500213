//! `[dynamics]`, `[relaxation]` and `[nonlocal]`: stages that are not solved by Newton's method, and averages over
//! neighbours. Tables at the top hold for all stages; those of a stage change what they name.

use super::document::Document;
use super::input_error::InputError;
use super::materials::Densities;
use super::schema::{Components, ProcedureKeyword};
use super::sets::Sets;
use macro_solver::dynamics::{
    DynamicSettings, InitialVelocity, MassScaling, RelaxationForm, RelaxationSettings, Reporting, StepRule,
};
use macro_solver::element::mass::Lumping;
use macro_solver::problem::Procedure;
use serde::Deserialize;
use toml::Spanned;

/// `[dynamics]`.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct DynamicsTable {
    density: Option<f64>,
    lumping: Option<LumpingKeyword>,
    safety: Option<f64>,
    time_step: Option<Spanned<f64>>,
    mass_factor: Option<f64>,
    mass_scaled_step: Option<Spanned<f64>>,
    mass_damping: Option<f64>,
    stiffness_damping: Option<f64>,
    linear_viscosity: Option<f64>,
    quadratic_viscosity: Option<f64>,
    absorbing: Option<Vec<Spanned<String>>>,
    initial_velocity: Option<Vec<InitialVelocityTable>>,
    output_steps: Option<u64>,
    output_interval: Option<Spanned<f64>>,
    energy_tolerance: Option<f64>,
    longest_excess: Option<u64>,
    tangent_every: Option<u64>,
}

/// `[[dynamics.initial_velocity]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct InitialVelocityTable {
    set: Spanned<String>,
    value: Components,
}

/// How elements give their mass to their nodes.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
enum LumpingKeyword {
    Hrz,
    RowSum,
}

/// `[relaxation]`.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct RelaxationTable {
    form: Option<FormKeyword>,
    damping_ratio: Option<f64>,
    safety: Option<f64>,
    kinetic_tolerance: Option<f64>,
    hits: Option<usize>,
    max_iterations: Option<usize>,
}

/// Equations of dynamic relaxation.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
enum FormKeyword {
    Corrected,
    AsPrinted,
}

/// The tables of the scene, or of one stage.
#[derive(Clone, Copy)]
pub(super) struct MotionTables<'a> {
    pub(super) dynamics: &'a DynamicsTable,
    pub(super) relaxation: &'a RelaxationTable,
}

/// How a stage is solved, from the tables at the top and its own; `densities` are those of the packings.
///
/// # Errors
/// Keys that exclude each other, or a set that does not exist.
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
            tables.iter().for_each(|tables| change_relaxation(&mut settings, tables.relaxation));
            Procedure::Relaxation(settings)
        }
        ProcedureKeyword::Dynamic => {
            let mut settings = DynamicSettings::new(densities.packing);
            settings.element_densities.clone_from(&densities.by_element);
            for tables in tables {
                change_dynamics(document, sets, &mut settings, tables.dynamics)?;
            }
            Procedure::Dynamic(Box::new(settings))
        }
    })
}

fn change_relaxation(settings: &mut RelaxationSettings, table: &RelaxationTable) {
    if let Some(form) = table.form {
        *settings = match form {
            FormKeyword::Corrected => RelaxationSettings::default(),
            FormKeyword::AsPrinted => RelaxationSettings::as_printed(),
        };
        settings.form = match form {
            FormKeyword::Corrected => RelaxationForm::Corrected,
            FormKeyword::AsPrinted => RelaxationForm::AsPrinted,
        };
    }
    replace(&mut settings.damping_ratio, table.damping_ratio);
    replace(&mut settings.safety, table.safety);
    replace(&mut settings.kinetic_tolerance, table.kinetic_tolerance);
    replace(&mut settings.hits, table.hits);
    replace(&mut settings.max_iterations, table.max_iterations);
}

fn change_dynamics(
    document: &Document,
    sets: &Sets<'_>,
    settings: &mut DynamicSettings,
    table: &DynamicsTable,
) -> Result<(), InputError> {
    let exclude = |first: bool, second: &Option<Spanned<f64>>, keys: &str| match second {
        Some(second) if first => {
            Err(document.error_at(second.span(), format!("{keys} exclude each other")).hint("leave one of them out"))
        }
        _ => Ok(()),
    };
    exclude(table.safety.is_some(), &table.time_step, "`safety` and `time_step`")?;
    exclude(table.mass_factor.is_some(), &table.mass_scaled_step, "`mass_factor` and `mass_scaled_step`")?;
    exclude(table.output_steps.is_some(), &table.output_interval, "`output_steps` and `output_interval`")?;
    if let Some(density) = table.density {
        // One for the whole body, whatever its packings weigh.
        settings.density = density;
        settings.element_densities.clear();
    }
    replace(
        &mut settings.lumping,
        table.lumping.map(|keyword| match keyword {
            LumpingKeyword::Hrz => Lumping::Hrz,
            LumpingKeyword::RowSum => Lumping::RowSum,
        }),
    );
    let given = |value: &Option<Spanned<f64>>| value.as_ref().map(|value| *value.get_ref());
    replace(&mut settings.step, table.safety.map(|safety| StepRule::Stable { safety }));
    replace(&mut settings.step, given(&table.time_step).map(|step| StepRule::Fixed { step }));
    replace(&mut settings.mass_scaling, table.mass_factor.map(|factor| MassScaling::Uniform { factor }));
    replace(&mut settings.mass_scaling, given(&table.mass_scaled_step).map(|step| MassScaling::ToStep { step }));
    replace(&mut settings.damping.mass, table.mass_damping);
    replace(&mut settings.damping.stiffness, table.stiffness_damping);
    replace(&mut settings.viscosity.linear, table.linear_viscosity);
    replace(&mut settings.viscosity.quadratic, table.quadratic_viscosity);
    replace(&mut settings.reporting, table.output_steps.map(Reporting::Steps));
    replace(&mut settings.reporting, given(&table.output_interval).map(Reporting::Interval));
    replace(&mut settings.energy_tolerance, table.energy_tolerance);
    replace(&mut settings.longest_excess, table.longest_excess);
    replace(&mut settings.tangent_every, table.tangent_every);
    if let Some(absorbing) = &table.absorbing {
        settings.absorbing = absorbing.iter().map(|set| sets.side_set(document, set)).collect::<Result<_, _>>()?;
    }
    if let Some(velocities) = &table.initial_velocity {
        let read = |velocity: &InitialVelocityTable| {
            let value = velocity.value.by_axis().map(|(_, component)| component.unwrap_or(0.0));
            Ok(InitialVelocity { nodes: sets.node_set(document, &velocity.set)?, value })
        };
        settings.initial_velocities = velocities.iter().map(read).collect::<Result<_, InputError>>()?;
    }
    Ok(())
}

fn replace<T>(target: &mut T, given: Option<T>) {
    if let Some(given) = given {
        *target = given;
    }
}
