//! `[[stage]]` tables become the stages of the problem. Tables at the top of the scene hold for all stages; without any
//! `[[stage]]` they are the one stage that there is.

use super::conditions::{ConditionPlaces, ConditionTables, Conditions};
use super::document::Document;
use super::input_error::InputError;
use super::materials::Densities;
use super::motion::{MotionTables, procedure};
use super::sets::Sets;
use super::solving::{loading, refuse_equations, solver};
use super::tables::{NonlocalTable, ProcedureKeyword, SceneFile, SolverTable, StageTable};
use keys::{Key, Located, Table};
use macro_solver::nonlocal::NonlocalSettings;
use macro_solver::output::StageOutput;
use macro_solver::problem::{Amplitude, LoadingSettings, NamedStrategy, Procedure, Stabilisation, Stage, Tolerances};

/// Name of the only stage of a scene without `[[stage]]`.
const ONLY: &str = "loading";

/// What stages need to know of the materials.
pub(super) struct Given<'a> {
    pub(super) densities: &'a Densities,
    /// 2 for discs, 3 for spheres.
    pub(super) cell_dimension: usize,
    /// Error of the stresses that the tolerances of implicit stages follow: the one that the run keeps to, or that of drafts.
    pub(super) error: Option<f64>,
}

/// The stages of a scene.
pub(super) struct Stages {
    /// What the solver solves.
    pub(super) stages: Vec<Stage>,
    /// What is written of each.
    pub(super) outputs: Vec<StageOutput>,
    /// Where the conditions of each are written.
    pub(super) places: Vec<ConditionPlaces>,
}

/// Reads the stages of a scene.
///
/// # Errors
/// The first key that is wrong, with its place.
pub(super) fn stages(
    document: &Document,
    sets: &Sets<'_>,
    file: &SceneFile,
    given: &Given<'_>,
) -> Result<Stages, InputError> {
    let top = MotionTables { place: &[], dynamics: &file.dynamics, relaxation: &file.relaxation };
    let solved = |keyword: Option<ProcedureKeyword>, tables: &[MotionTables<'_>]| {
        procedure(document, sets, keyword.unwrap_or(file.procedure), tables, given.densities)
    };
    let mut conditions = Conditions::default();
    conditions.add(document, sets, &ConditionTables::from(file))?;
    let base = |procedure, own| base(document, file, given, procedure, own);
    let mut stages: Vec<Stage> = Vec::new();
    let (mut outputs, mut places) = (Vec::new(), Vec::new());
    for table in &file.stage {
        let number = stages.len().to_string();
        let name = name(document, &table.get_ref().name, &stages)?;
        let table = table.get_ref();
        if let Some(before) = stages.last() {
            refuse_to_follow(document, before, &number)?;
            conditions.settle(before.duration);
        }
        conditions.remove(document, &table.remove)?;
        conditions.add(document, sets, &ConditionTables::from(table))?;
        let base = base(table.procedure.unwrap_or(file.procedure), Some(&table.solver))?;
        let mut stage = Stage { name: name.clone(), conditions: conditions.applied(), ..base };
        let place = ["stage", number.as_str()];
        change(document, &mut stage, &place, table)?;
        let own = MotionTables { place: &place, dynamics: &table.dynamics, relaxation: &table.relaxation };
        stage.procedure = solved(table.procedure, &[top, own])?;
        stage.nonlocal = nonlocal(document, &[(&[], &file.nonlocal), (&place, &table.nonlocal)])?;
        stabilise_soon(&mut stage);
        refuse_unused(document, &place, &[&stage.procedure])?;
        stages.push(stage);
        places.push(conditions.places());
        let fields_every = table.output.fields_every.unwrap_or(file.output.fields_every);
        outputs.push(StageOutput { name, fields_every });
    }
    if stages.is_empty() {
        let base = base(file.procedure, None)?;
        let mut stage = Stage { conditions: conditions.applied(), procedure: solved(None, &[top])?, ..base };
        stage.nonlocal = nonlocal(document, &[(&[], &file.nonlocal)])?;
        stabilise_soon(&mut stage);
        stages.push(stage);
        places.push(conditions.places());
        outputs.push(StageOutput { name: ONLY.to_owned(), fields_every: file.output.fields_every });
    }
    refuse_unused(document, &[], &stages.iter().map(|stage| &stage.procedure).collect::<Vec<_>>())?;
    let is_thrown = |stage: &Stage| matches!(&stage.procedure, Procedure::Dynamic(motion) if !motion.initial_velocities.is_empty());
    if stages.iter().all(|stage| stage.conditions.is_empty() && !is_thrown(stage)) {
        return Err(document
            .error("the scene has neither supports nor loads")
            .hint("add at least one [[boundary]] with set and displacement"));
    }
    Ok(Stages { stages, outputs, places })
}

/// Refuses a stage after one whose load factor is an unknown: what its loads have reached is not known when the scene is read.
fn refuse_to_follow(document: &Document, before: &Stage, number: &str) -> Result<(), InputError> {
    if !before.finds_load_factor() || before.conditions.iter().all(|applied| applied.history == Amplitude::Constant) {
        return Ok(());
    }
    let problem = format!(
        "no stage can follow '{}': its loads end at the factor that `loading.control` finds, which is not known before",
        before.name
    );
    let hint = "make it the last stage, or drive it by displacements without `loading.control`";
    Err(document.error_at_key(&["stage", number, "name"], problem).hint(hint))
}

/// Refuses keys of `[loading]` and `[solver]`, and the tables `[dynamics]` and `[relaxation]`, at `place` that are not used, because none of
/// the stages for which they hold has a procedure that does.
fn refuse_unused(document: &Document, place: &[&str], procedures: &[&Procedure]) -> Result<(), InputError> {
    let keywords: Vec<&str> = procedures.iter().map(|procedure| procedure.keyword()).collect();
    for (table, procedure) in [("dynamics", "dynamic"), ("relaxation", "relaxation")] {
        let path = [place, &[table]].concat();
        if document.is_written(&path) && !keywords.contains(&procedure) {
            let problem = format!("this table is not used in a stage with procedure = \"{}\"", keywords[0]);
            let hint = format!("leave it out, or give the stage procedure = \"{procedure}\"");
            return Err(document.error_at_key(&path, problem).hint(hint));
        }
    }
    for (table, keys) in [("loading", Table::of::<LoadingSettings>()), ("solver", Table::of::<SolverTable>())] {
        let is_used = |key: &Key| {
            key.procedures.is_empty() || key.procedures.iter().any(|procedure| keywords.contains(&procedure.as_str()))
        };
        for key in keys.keys.iter().filter(|key| !is_used(key)) {
            let path = [place, &[table, &key.name]].concat();
            if document.is_written(&path) {
                let problem = format!(
                    "this key is not used in a stage with procedure = \"{}\", only in {} stages",
                    keywords[0],
                    key.procedures.join(" and ")
                );
                return Err(document.error_at_key(&path, problem).hint("leave it out"));
            }
        }
    }
    Ok(())
}

/// What the tables at the top say about every stage with a procedure; `own` is the table `[solver]` of the stage itself.
fn base(
    document: &Document,
    file: &SceneFile,
    given: &Given<'_>,
    procedure: ProcedureKeyword,
    own: Option<&keys::Given<SolverTable>>,
) -> Result<Stage, InputError> {
    let mut stage = Stage::new(ONLY, Vec::new());
    // Tolerances of other criteria mean something else.
    if procedure != ProcedureKeyword::Dynamic
        && !file.solver.has("criteria")
        && !own.is_some_and(|solver| solver.has("criteria"))
        && let Some(error) = given.error
    {
        stage.tolerances = Tolerances::within(error);
    }
    // A tangent operator or a path control that is named belongs to Newton's method.
    if !file.solver.has("tangent") && !file.loading.has("control") {
        stage.strategy = NamedStrategy::default_of(given.cell_dimension).preset();
    }
    loading(document, &mut stage, &[], &file.loading)?;
    solver(document, &mut stage, &file.solver)?;
    Ok(stage)
}

/// Averages of a stage from the tables `nonlocal` at their places: each one that is written switches averages on or says that there are
/// none, and changes the keys that it names.
fn nonlocal(
    document: &Document,
    tables: &[(&[&str], &keys::Given<NonlocalTable>)],
) -> Result<Option<NonlocalSettings>, InputError> {
    let mut averages = NonlocalTable::default();
    for (place, given) in tables {
        averages.enabled |= document.is_written(&[*place, &["nonlocal"]].concat());
        averages = given.over(&averages).map_err(|fault| document.fault(&fault))?;
    }
    Ok(averages.enabled.then_some(averages.settings))
}

/// Where its tables do not say so, iterates are committed where the out-of-balance force hardly falls any more, and steps that fail are stabilised at once if
/// supports drive the stage.
fn stabilise_soon(stage: &mut Stage) {
    if stage.is_driven_by_supports()
        && let Some(settings) = &mut stage.control.stabilisation
    {
        let default = Stabilisation::under_moving_supports(&stage.strategy);
        settings.after = settings.after.or(default.after);
        settings.commit_iterates_after = settings.commit_iterates_after.or(default.commit_iterates_after);
    }
}

fn change(document: &Document, stage: &mut Stage, place: &[&str], table: &StageTable) -> Result<(), InputError> {
    refuse_equations(document, place, &table.solver)?;
    loading(document, stage, place, &table.loading)?;
    solver(document, stage, &table.solver)
}

fn name(document: &Document, given: &Located<String>, before: &[Stage]) -> Result<String, InputError> {
    let name = given.get_ref();
    if name.is_empty() || before.iter().any(|stage| stage.name == *name) {
        return Err(document
            .error_at(given.span(), format!("'{name}' cannot name a stage"))
            .hint("give every stage a name of its own"));
    }
    Ok(name.clone())
}

#[cfg(test)]
mod tests;
