//! From the keys of a scene file to what the solver and the workers need. Everything is checked here, before any
//! folder is made or any process started.

use super::accuracy::{choose, error_control, error_estimate, error_of_stresses};
use super::document::{Document, Kind};
use super::engines::EnginePlan;
use super::initial::{find_equilibrium, initial_state};
use super::input_copy::InputCopy;
use super::input_error::InputError;
use super::materials::{Materials, materials};
use super::mesh::mesh;
use super::packing::read_packing;
use super::preparation::CellPreparation;
use super::probes::{ProbeContext, chosen_fields, probes, profiles};
use super::problem_error::problem_error;
use super::recording::{observables, plot, points};
use super::remarks::remarks_on;
use super::sets::Sets;
use super::solving::equations;
use super::stages::{Given, Stages, stages as read_stages};
use super::supervision::PoolPlan;
use super::tables::{PoolRunKeys, SceneFile};
use crate::FRAME_ENGINE;
use keys::Located;
use macro_solver::checkpoint::CheckpointPolicy;
use macro_solver::material::error_estimate::ErrorEstimateSettings;
use macro_solver::mesh::Mesh;
use macro_solver::output::RecordPlan;
use macro_solver::problem::{Problem, Stage, Tolerances};
use protocol::ContentId;
use rve_server::contact::Rotations;
use rve_server::definition::{AnyDefinition, RveOptions, SolverName};
use std::path::{Path, PathBuf};

/// A scene, checked and ready to run.
#[derive(Debug)]
pub struct Scene {
    /// Its name: names the output folder.
    pub name: String,
    /// The file it came from.
    pub document: Document,
    /// What the solver solves.
    pub problem: Problem,
    /// Identity of the mesh that a file gives; `None` of a generated one, which the keys describe.
    pub mesh_identity: Option<ContentId>,
    /// The file that gives the mesh; `None` of a generated one.
    mesh_file: Option<InputCopy>,
    /// What the Gauss points are made of.
    pub materials: Materials,
    /// Where the packing was read.
    pub packing_path: PathBuf,
    /// Who solves the points.
    pub engines: EnginePlan,
    /// What is recorded.
    pub record: RecordPlan,
    /// Gauss points whose grains are written.
    pub grains: Vec<usize>,
    /// Stage, from 0, from whose start the fluctuations of these grains are counted; without one from the start of the run.
    pub grains_from: Option<usize>,
    /// Whether the last states of all Gauss points are written for the page.
    pub cells: bool,
    /// The cells that have been brought to the stress of their points.
    pub prepared: Option<CellPreparation>,
    /// Whether the run keeps to an error that the scene does not name itself.
    pub keeps_default_error: bool,
    /// What the stages are held to where it does not.
    tolerances_without_error: Vec<Tolerances>,
    /// Gauss points whose error is estimated.
    pub error_estimate: ErrorEstimateSettings,
    /// Columns of the plot, x and y; `None` = no plot.
    pub plot: Option<(String, String)>,
    /// When the state of the run is written.
    pub checkpoint: CheckpointPolicy,
    /// How the workers are led.
    pub pool: PoolPlan,
    /// Remarks on keys that are allowed but probably not intended, one line each.
    pub remarks: Vec<String>,
}

impl Scene {
    /// The packing of the scene itself with its law and options; regions may differ in packing and law.
    pub fn definition(&self) -> &AnyDefinition {
        &self.materials.definitions[0]
    }

    /// Reads and checks a scene file with its overrides and its packing.
    ///
    /// # Errors
    /// The first thing that is wrong, with its place and remedy.
    pub fn load(path: &Path, overrides: &[String]) -> Result<Self, InputError> {
        Self::load_in_size(path, None, overrides)
    }

    /// As [`Scene::load`], in one of the sizes that the file names.
    ///
    /// # Errors
    /// As [`Scene::load`]; the file has no such size.
    pub fn load_in_size(path: &Path, size: Option<&str>, overrides: &[String]) -> Result<Self, InputError> {
        let document = Document::read_in_size(path, size, overrides)?;
        document.expect(Kind::Scene)?;
        let mut file: SceneFile = document.deserialize()?;
        let keeps_default_error = choose(&document, &mut file)?;
        file.rve.relax_zero_increments |= !file.economy.zero_increments;
        let name = name(&document, file.name.as_ref())?;
        let Body { mesh, mesh_file, mesh_identity, materials, packing_path } = body(&document, &mut file)?;
        let sets = Sets { mesh: &mesh };
        let context = ProbeContext { document: &document, sets: &sets, file: &file, materials: &materials };
        let probes = probes(&context)?;
        let profiles = profiles(&context)?;
        let fields = chosen_fields(&context)?;
        let grains_from = file.output.grains_from.as_ref().map(|name| context.stage(name)).transpose()?;
        let pore_fluid = file.pore_fluid.as_ref().map(|table| context.pore_fluid(table)).transpose()?;
        let observables = observables(&document, &file.output, &probes, &profiles)?;
        let plot = plot(&document, &file.output, &probes, file.stage.len())?;
        let (stages, tolerances_without_error) = stages(&document, &sets, &file, &materials, keeps_default_error)?;
        let Stages { stages, outputs, places } = stages;
        let mut problem = problem(&document, &file, mesh, stages, &materials)?;
        (problem.pore_fluid, problem.observables) = (pore_fluid, observables);
        let error_estimate = error_estimate(&document, &file)?;
        problem.validate().map_err(|error| problem_error(&document, &places, &error))?;
        find_equilibrium(&document, &places, &file.initial_stress, &mut problem)?;
        let grains = points(&document, &file.output.grains, problem.point_count())?;
        let record = RecordPlan {
            probes,
            profiles,
            points: points(&document, &file.output.points, problem.point_count())?,
            fields,
            stages: outputs,
            gauss_points: file.output.gauss_points,
            observables,
            pore_fluid: problem.pore_fluid.is_some(),
            accuracy: false,
            units_in_headers: file.output.units.then_some(problem.mesh.dimension),
        };
        let checkpoint =
            file.checkpoint.over(&CheckpointPolicy::default()).map_err(|fault| document.fault(&fault))?;
        let (engines, pool) = workers(&document, &file, &problem)?;
        let remarks = [document.warnings().to_vec(), remarks_on(&problem), narrow_cells(&materials)].concat();
        let mut scene = Self {
            name,
            document,
            problem,
            mesh_identity,
            mesh_file,
            materials,
            packing_path,
            engines,
            record,
            grains,
            grains_from,
            cells: file.output.cells,
            prepared: None,
            keeps_default_error,
            tolerances_without_error,
            error_estimate,
            plot,
            checkpoint,
            pool,
            remarks,
        };
        scene.check_preparation()?;
        scene.remarks.extend(scene.frames_out_of_balance());
        Ok(scene)
    }

    /// The files that the scene names, as they go along with a run: packings, and the mesh unless it is generated.
    pub fn files(&self) -> Vec<&InputCopy> {
        self.materials.files.iter().chain(&self.mesh_file).collect()
    }

    /// The scene as run, which names [`Scene::files`] where they lie in the output folder.
    ///
    /// # Errors
    /// As [`Document::as_run`].
    pub fn as_run(&self) -> Result<String, InputError> {
        let names: Vec<(&str, &str)> =
            self.files().into_iter().map(|file| (file.key.as_str(), file.name.as_str())).collect();
        self.document.as_run(&names)
    }

    /// For runs that cannot estimate the error: an error that the scene does not name itself gives way to the accuracy
    /// `default`.
    pub fn give_up_default_error(&mut self) {
        if !std::mem::take(&mut self.keeps_default_error) {
            return;
        }
        for definition in &mut self.materials.definitions {
            *definition = definition.with_options(|options| RveOptions { error: None, ..options.clone() });
        }
        self.problem.strain_per_step = self.definition().options().strain_per_step();
        self.problem.error_control = None;
        for (stage, tolerances) in self.problem.stages.iter_mut().zip(&self.tolerances_without_error) {
            stage.tolerances = *tolerances;
        }
    }
}

/// The mesh with the sets of its regions, and what it is made of.
struct Body {
    mesh: Mesh,
    /// The file that gives the mesh; `None` of a generated one.
    mesh_file: Option<InputCopy>,
    /// Identity of the mesh as that file gives it.
    mesh_identity: Option<ContentId>,
    materials: Materials,
    packing_path: PathBuf,
}

fn body(document: &Document, file: &mut SceneFile) -> Result<Body, InputError> {
    let (mut mesh, mesh_file) = mesh(document, &file.mesh)?;
    let mesh_identity = mesh_file.is_some().then(|| mesh.identity());
    if file.rve.solver == SolverName::EventDriven {
        file.rve.side_by_side.get_or_insert(mesh.point_count() >= POINTS_SIDE_BY_SIDE);
    }
    let (definition, packing_path) = definition(document, file, mesh.dimension.count())?;
    let materials = materials(document, file, &Sets { mesh: &mesh }, definition)?;
    for (name, elements) in materials.elements_of_regions(file, &mesh) {
        mesh.element_sets.entry(name).or_insert(elements);
    }
    Ok(Body { mesh, mesh_file, mesh_identity, materials, packing_path })
}

/// The stages, and what they are held to if the run cannot keep to the error that it would keep to by default: tolerances follow that error.
fn stages(
    document: &Document,
    sets: &Sets<'_>,
    file: &SceneFile,
    materials: &Materials,
    keeps_default_error: bool,
) -> Result<(Stages, Vec<Tolerances>), InputError> {
    let densities = materials.densities(sets.mesh);
    let given = Given {
        densities: &densities,
        cell_dimension: materials.cell_dimension(),
        error: error_of_stresses(document, file),
    };
    let mut stages = read_stages(document, sets, file, &given)?;
    for stage in &mut stages.stages {
        stage.strategy.keep_unchanged &= file.economy.unchanged_targets;
    }
    let without_error = if keeps_default_error {
        read_stages(document, sets, file, &Given { error: None, ..given })?.stages
    } else {
        Vec::new()
    };
    Ok((stages, without_error.into_iter().map(|stage| stage.tolerances).collect()))
}

/// The problem, but for what is observed.
fn problem(
    document: &Document,
    file: &SceneFile,
    mesh: Mesh,
    stages: Vec<Stage>,
    materials: &Materials,
) -> Result<Problem, InputError> {
    let options = materials.definitions[0].options();
    let mut problem = Problem::new(mesh, Vec::new());
    problem.stages = stages;
    equations(document, &mut problem, &file.solver)?;
    problem.initial = initial_state(document, &file.initial_stress)?;
    problem.keeps_still_points = !file.rve.relax_zero_increments;
    problem.symmetric_stresses =
        materials.definitions.iter().all(|definition| definition.contact().rotations == Rotations::Free);
    problem.strain_per_step = options.strain_per_step();
    problem.error_control = error_control(options);
    Ok(problem)
}

/// Who solves the points, and how these workers are led.
fn workers(document: &Document, file: &SceneFile, problem: &Problem) -> Result<(EnginePlan, PoolPlan), InputError> {
    let mut keys: PoolRunKeys = file.pool.over(&PoolRunKeys::default()).map_err(|fault| document.fault(&fault))?;
    if file.rve.frame.is_some() && !file.pool.has("engine") {
        FRAME_ENGINE.clone_into(&mut keys.engine);
    }
    let engines = EnginePlan::read(document, &file.pool, &keys, problem)?;
    Ok((engines, PoolPlan::new(&file.pool, &keys, file.economy.duplicate_trials)))
}

/// Gauss points from which on cells are mostly solved side by side: as many as a processor has lanes.
const POINTS_SIDE_BY_SIDE: usize = 8;

/// What is to be known about the shapes of the cells, each once.
fn narrow_cells(materials: &Materials) -> Vec<String> {
    let mut told: Vec<String> = materials.definitions.iter().filter_map(AnyDefinition::narrow_cell).collect();
    told.dedup();
    told
}

/// Most characters of the name of a run, which becomes a part of names of files and of shared memory.
const LONGEST_NAME: usize = 100;

fn name(document: &Document, given: Option<&Located<String>>) -> Result<String, InputError> {
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
    if given.get_ref().len() > LONGEST_NAME {
        return Err(document
            .error_at(given.span(), format!("a name of {} characters is too long for files", given.get_ref().len()))
            .hint(format!("use at most {LONGEST_NAME} characters")));
    }
    Ok(given.get_ref().clone())
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
