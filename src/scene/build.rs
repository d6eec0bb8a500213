//! From the keys of a scene file to what the solver and the workers need. Everything is checked here, before any
//! folder is made or any process started.

use super::document::Document;
use super::engines::EnginePlan;
use super::input_error::InputError;
use super::mesh::mesh;

use super::probes::probes;
use super::schema::{
    BodyForceTable, BoundaryTable, EquationKeyword, FormulationKeyword, LoadingTable, ObservableKeyword, OutputTable,
    PlatenKind, PredictorKeyword, PressureKeyword, PressureTable, SceneFile, SolverTable, TractionTable,
};
use super::sets::Sets;
use super::supervision::{PoolKeys, checkpoint_policy};
use macro_solver::checkpoint::CheckpointPolicy;
use macro_solver::element::hourglass::HourglassControl;
use macro_solver::formulation::Formulation;
use macro_solver::output::{Probe, RecordPlan};
use macro_solver::problem::{
    Condition, EquationSolver, Platen, Predictor, PressureKind, Problem, ProblemError, SecantGates, StepControl,
    Strategy, Tolerances,
};
use protocol::{Observables, TangentKind};
use rve_server::definition::AnyDefinition;
use rve_server::packing::Packing;
use std::path::{Path, PathBuf};
use toml::Spanned;

/// A scene, checked and ready to run.
#[derive(Debug)]
pub(crate) struct Scene {
    /// Its name: names the output folder.
    pub(crate) name: String,
    /// The file it came from.
    pub(crate) document: Document,
    /// What the solver solves.
    pub(crate) problem: Problem,
    /// What every Gauss point is made of.
    pub(crate) definition: AnyDefinition,
    /// Where the packing was read.
    pub(crate) packing_path: PathBuf,
    /// Who solves the points.
    pub(crate) engines: EnginePlan,
    /// What is recorded.
    pub(crate) record: RecordPlan,
    /// Gauss points whose grains are written.
    pub(crate) grains: Vec<usize>,
    /// Columns of the plot, x and y; `None` = no plot.
    pub(crate) plot: Option<(String, String)>,
    /// When the state of the run is written.
    pub(crate) checkpoint: CheckpointPolicy,
    /// How the workers are led.
    pub(crate) pool: PoolKeys,
}

impl Scene {
    /// Reads and checks a scene file with its overrides and its packing.
    ///
    /// # Errors
    /// The first thing that is wrong, with its place and remedy.
    pub(crate) fn load(path: &Path, overrides: &[String]) -> Result<Self, InputError> {
        let document = Document::read(path, overrides)?;
        let file: SceneFile = document.deserialize()?;
        let name = name(&document, file.name.as_ref())?;
        let mesh = mesh(&document, &file.mesh)?;
        let mesh_dimension = mesh.dimension.count();
        let sets = Sets { mesh: &mesh };
        let mut conditions = Vec::new();
        for boundary in &file.boundary {
            conditions.extend(boundary_conditions(&document, &sets, boundary.get_ref())?);
        }
        for pressure in &file.pressure {
            conditions.push(pressure_condition(&document, &sets, pressure.get_ref())?);
        }
        for traction in &file.traction {
            conditions.push(traction_condition(&document, &sets, traction.get_ref())?);
        }
        for body_force in &file.body_force {
            conditions.push(body_force_condition(&document, &sets, body_force.get_ref())?);
        }
        if conditions.is_empty() {
            return Err(document
                .error("the scene holds and loads nothing")
                .hint("add at least one [[boundary]] with set and displacement"));
        }
        let probes = probes(&document, &sets, &file.probe)?;
        let observables = observables(&document, &file.output, &probes)?;
        let duration = duration(&document, &file.loading)?;
        let plot = plot(&document, &file.output, &probes)?;
        let (definition, packing_path) = definition(&document, &file, mesh_dimension)?;
        let mut problem = Problem::new(mesh, conditions);
        problem.control = step_control(&file.loading);
        problem.tolerances = tolerances(&file.solver);
        problem.strategy = strategy(&document, &file.solver)?;
        problem.formulation = formulation(file.solver.formulation);
        problem.equations = match file.solver.equations {
            EquationKeyword::Direct => EquationSolver::Direct,
            EquationKeyword::Iterative => EquationSolver::Iterative,
        };
        if let Some(coefficient) = &file.solver.hourglass_coefficient {
            problem.hourglass = HourglassControl::Stiffness { coefficient: *coefficient.get_ref() };
        }
        problem.observables = observables;
        problem.strain_per_step = definition.options().strain_per_step();
        problem.validate().map_err(|error| problem_error(&document, &error))?;
        let grains = grains(&document, &file.output, problem.point_count())?;
        let record = RecordPlan {
            probes,
            duration,
            fields_every: file.output.fields_every,
            gauss_points: file.output.gauss_points,
            observables,
        };
        let checkpoint = checkpoint_policy(&document, &file.checkpoint)?;
        let engines = EnginePlan::read(&document, &file.pool, &problem)?;
        let pool = PoolKeys::read(&document, &file.pool)?;
        Ok(Self {
            name,
            document,
            problem,
            definition,
            packing_path,
            engines,
            record,
            grains,
            plot,
            checkpoint,
            pool,
        })
    }
}

/// A defect that the solver's own check found, at the key that caused it.
fn problem_error(document: &Document, error: &ProblemError) -> InputError {
    let ProblemError::Number { what, .. } = error else {
        return document.error(error).hint("docs/scene.md says how [[boundary]] and [mesh] work together");
    };
    let key: &[&str] = match *what {
        "increments" => &["loading", "increments"],
        "min" => &["loading", "smallest_increment"],
        "growth" => &["loading", "growth"],
        "cut" => &["loading", "cut"],
        "max_iterations" => &["loading", "max_iterations"],
        "force tolerance" => &["solver", "force_tolerance"],
        "displacement tolerance" => &["solver", "displacement_tolerance"],
        "capped_change" => &["solver", "capped_change"],
        "hourglass_coefficient" => &["solver", "hourglass_coefficient"],
        "tangent_floor" => &["solver", "tangent_floor"],
        "secant min_change" => &["solver", "secant", "min_change"],
        "secant max_ratio" => &["solver", "secant", "max_ratio"],
        "secant floor" => &["solver", "secant", "floor"],
        "strain_per_step" => &["rve", "strain_per_step"],
        _ => &[],
    };
    document.error_at_key(key, error).hint("the keys, their units and defaults are in docs/scene.md")
}

fn name(document: &Document, given: Option<&Spanned<String>>) -> Result<String, InputError> {
    let Some(given) = given else {
        let stem = document.path().file_stem().map(|stem| stem.to_string_lossy().into_owned());
        return Ok(stem.unwrap_or_else(|| "scene".to_owned()));
    };
    let sound = |letter: char| letter.is_ascii_alphanumeric() || letter == '-' || letter == '_';
    if given.get_ref().is_empty() || !given.get_ref().chars().all(sound) {
        return Err(document
            .error_at(given.span(), format!("'{}' cannot name a folder", given.get_ref()))
            .hint("use letters, digits, '-' and '_' only"));
    }
    Ok(given.get_ref().clone())
}

fn boundary_conditions(
    document: &Document,
    sets: &Sets<'_>,
    boundary: &BoundaryTable,
) -> Result<Vec<Condition>, InputError> {
    let nodes = sets.node_set(document, &boundary.set)?;
    let components = *boundary.displacement.get_ref();
    let Some(platen) = boundary.platen else {
        let conditions: Vec<Condition> = components
            .by_axis()
            .into_iter()
            .filter_map(|(axis, value)| Some(Condition::Displacement { nodes: nodes.clone(), axis, value: value? }))
            .collect();
        if conditions.is_empty() {
            return Err(document
                .error_at(boundary.displacement.span(), "no component is prescribed")
                .hint("write for example displacement = { y = 0.0 }"));
        }
        return Ok(conditions);
    };
    let given: Vec<_> = components.by_axis().into_iter().filter_map(|(axis, value)| Some((axis, value?))).collect();
    let [(axis, displacement)] = given[..] else {
        return Err(document
            .error_at(boundary.displacement.span(), "a platen moves along its normal only")
            .hint("write for example displacement = { y = ... } only; platen = \"rough\" also holds the others"));
    };
    let contact = match platen {
        PlatenKind::Smooth => Platen::Smooth,
        PlatenKind::Rough => Platen::Rough,
    };
    Ok(vec![Condition::Platen { nodes, contact, axis, displacement }])
}

fn pressure_condition(
    document: &Document,
    sets: &Sets<'_>,
    pressure: &PressureTable,
) -> Result<Condition, InputError> {
    let kind = match pressure.kind {
        PressureKeyword::Follower => PressureKind::Follower,
        PressureKeyword::Dead => PressureKind::Dead,
    };
    Ok(Condition::Pressure { sides: sets.side_set(document, &pressure.set)?, value: pressure.value, kind })
}

fn traction_condition(
    document: &Document,
    sets: &Sets<'_>,
    traction: &TractionTable,
) -> Result<Condition, InputError> {
    let value = traction.value.by_axis().map(|(_, component)| component.unwrap_or(0.0));
    Ok(Condition::Traction { sides: sets.side_set(document, &traction.set)?, value })
}

fn body_force_condition(
    document: &Document,
    sets: &Sets<'_>,
    body_force: &BodyForceTable,
) -> Result<Condition, InputError> {
    let value = body_force.value.by_axis().map(|(_, component)| component.unwrap_or(0.0));
    Ok(Condition::BodyForce { elements: sets.element_set(document, &body_force.set)?, value })
}

fn formulation(keyword: FormulationKeyword) -> Formulation {
    match keyword {
        FormulationKeyword::SmallStrain => Formulation::SmallStrain,
        FormulationKeyword::TotalLagrangian => Formulation::TotalLagrangian,
        FormulationKeyword::Updated => Formulation::Updated,
        FormulationKeyword::Corotational => Formulation::Corotational,
    }
}

fn step_control(table: &LoadingTable) -> StepControl {
    let mut control = StepControl::default();
    replace(&mut control.increments, &table.increments);
    replace(&mut control.min, &table.smallest_increment);
    replace(&mut control.growth, &table.growth);
    replace(&mut control.cut, &table.cut);
    replace(&mut control.target_iterations, &table.easy_iterations);
    replace(&mut control.max_iterations, &table.max_iterations);
    control
}

fn tolerances(table: &SolverTable) -> Tolerances {
    let mut tolerances = Tolerances::default();
    replace(&mut tolerances.force, &table.force_tolerance);
    replace(&mut tolerances.displacement, &table.displacement_tolerance);
    tolerances
}

fn replace<T: Copy>(target: &mut T, given: &Option<Spanned<T>>) {
    if let Some(given) = given {
        *target = *given.get_ref();
    }
}

fn strategy(document: &Document, table: &SolverTable) -> Result<Strategy, InputError> {
    let mut strategy = Strategy::default();
    if let Some(tangent) = &table.tangent {
        if *tangent.get_ref() == TangentKind::None {
            return Err(document
                .error_at(tangent.span(), "the solver cannot work without a tangent operator")
                .hint("use \"truss_like_slip\", \"truss_like\" or another operator of docs/scene.md"));
        }
        strategy.tangent = *tangent.get_ref();
    }
    match table.predictor {
        Some(PredictorKeyword::Linear) => strategy.predictor = Predictor::Linear,
        Some(PredictorKeyword::Tangent) => strategy.predictor = Predictor::Tangent,
        None => {}
    }
    if let Some(secant) = table.secant {
        let gates = SecantGates::default();
        strategy.secant = secant.enabled.then_some(SecantGates {
            min_change: secant.min_change.unwrap_or(gates.min_change),
            max_ratio: secant.max_ratio.unwrap_or(gates.max_ratio),
            floor: secant.floor.unwrap_or(gates.floor),
        });
    }
    if let Some(floor) = &table.tangent_floor {
        strategy.tangent_floor = (*floor.get_ref() != 0.0).then_some(*floor.get_ref());
    }
    replace(&mut strategy.capped_change, &table.capped_change);
    strategy.keep_unchanged = table.keep_unchanged.unwrap_or(strategy.keep_unchanged);
    Ok(strategy)
}

fn duration(document: &Document, table: &LoadingTable) -> Result<f64, InputError> {
    match &table.duration {
        Some(given) if *given.get_ref() <= 0.0 => Err(document
            .error_at(given.span(), format!("a duration of {} s is not possible", given.get_ref()))
            .hint("give a positive time in s; it only scales the time column")),
        Some(given) => Ok(*given.get_ref()),
        None => Ok(1.0),
    }
}

fn observables(document: &Document, table: &OutputTable, probes: &[Probe]) -> Result<Observables, InputError> {
    let observables = table.observables.iter().fold(Observables::NONE, |all, keyword| {
        all.union(match keyword {
            ObservableKeyword::Rotation => Observables::ROTATION,
            ObservableKeyword::CoordinationNoRattlers => Observables::COORDINATION_NO_RATTLERS,
            ObservableKeyword::Fabric => Observables::FABRIC,
            ObservableKeyword::SlidingFraction => Observables::SLIDING_FRACTION,
            ObservableKeyword::Energy => Observables::ENERGY,
        })
    });
    match probes.iter().find(|probe| probe.quantity.needs_energy()) {
        Some(probe) if !observables.contains(Observables::ENERGY) => Err(document
            .error(format!("the probe '{}' needs energies, which output.observables leaves out", probe.name))
            .hint("add \"energy\" to output.observables")),
        _ => Ok(observables),
    }
}

fn grains(document: &Document, table: &OutputTable, points: usize) -> Result<Vec<usize>, InputError> {
    let mut grains = Vec::new();
    for point in &table.grains {
        if *point.get_ref() >= points {
            return Err(document
                .error_at(point.span(), format!("there is no Gauss point {}", point.get_ref()))
                .hint(format!("the mesh has the points 0 to {}", points - 1)));
        }
        grains.push(*point.get_ref());
    }
    grains.sort_unstable();
    grains.dedup();
    Ok(grains)
}

/// Axes of the plot: as asked, else the first strain-like probe against the first stress-like one.
fn plot(document: &Document, table: &OutputTable, probes: &[Probe]) -> Result<Option<(String, String)>, InputError> {
    let column = |given: &Option<Spanned<String>>, otherwise: usize, fallback: &str| match given {
        None => Ok(probes.get(otherwise).map_or(fallback.to_owned(), |probe| probe.name.clone())),
        Some(name) if ["time", "load"].contains(&name.get_ref().as_str()) => Ok(name.get_ref().clone()),
        Some(name) if probes.iter().any(|probe| probe.name == *name.get_ref()) => Ok(name.get_ref().clone()),
        Some(name) => Err(document
            .error_at(name.span(), format!("there is no column '{}' to plot", name.get_ref()))
            .hint("name a probe, \"time\" or \"load\"")),
    };
    let (x, y) = match probes.len() {
        1 => (column(&table.plot_x, 1, "load")?, column(&table.plot_y, 0, "load")?),
        _ => (column(&table.plot_x, 0, "load")?, column(&table.plot_y, 1, "load")?),
    };
    Ok((table.plot && !probes.is_empty()).then_some((x, y)))
}

fn definition(
    document: &Document,
    file: &SceneFile,
    mesh_dimension: usize,
) -> Result<(AnyDefinition, PathBuf), InputError> {
    let packing = read_packing(document, &file.packing)?;
    if mesh_dimension == 3 && packing.dimension() == 2 {
        return Err(document
            .error_at_key(&["packing"], "the mesh has three dimensions, but the packing holds discs")
            .hint("take a packing of spheres; spheres also serve plane meshes, as plane strain"));
    }
    let definition = AnyDefinition::new(packing, file.contact.clone(), file.rve.clone());
    let definition = definition.validate().map_err(|error| document.table_error(error))?;
    Ok((definition, document.resolve(&file.packing)))
}

/// Reads the packing that a document names in its key `packing`, and refuses it with the line of that key.
///
/// # Errors
/// The packing's own error.
pub(crate) fn read_packing(document: &Document, written: &Path) -> Result<Packing, InputError> {
    let path = document.resolve(written);
    Packing::read(&path).map_err(|error| {
        let hint = if path.exists() {
            "correct the packing file, or make a new one with `grainspan pack`"
        } else {
            "make one with `grainspan pack`, or correct the path; it is relative to this file's folder"
        };
        document.error_at_key(&["packing"], error).hint(hint)
    })
}
