//! `grainspan check SCENE.toml`: validates everything a run would need and runs nothing.

use super::estimate::Estimate;
use super::start_state::{self, LoadComparison, PackingState};
use crate::engines::EngineAssignment;
use crate::exit::{Exit, Failure};
use crate::side_by_side::cores;
use crate::stdout::print;
use macro_solver::mesh::{ElementKind, Mesh};
use macro_solver::problem::{Problem, Procedure, Stage};
use protocol::TangentKind;
use scene_reader::Scene;
use std::fmt::Write;
use std::path::{Component, Path, PathBuf};

/// Arguments of `grainspan check`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example:\n  grainspan check scenes/biaxial.toml --set mesh.element=q4")]
pub(crate) struct Arguments {
    /// Scene file
    #[arg(value_name = "SCENE.toml")]
    scene: PathBuf,
    /// One of the sizes that the file names in `[sizes]` [default: the file as it stands]
    #[arg(long, value_name = "NAME")]
    size: Option<String>,
    /// Override a key of the scene; entries of [[lists]] are numbered from 0
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    overrides: Vec<String>,
    /// Check the scene for this engine in place of the scene's own choice
    #[arg(long, value_name = "NAME")]
    engine: Option<String>,
}

/// Checks the scene and prints an overview.
///
/// # Errors
/// The first thing that a run would refuse.
pub(crate) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    let scene = Scene::load_in_size(&arguments.scene, arguments.size.as_deref(), &arguments.overrides)?;
    let (scene, assignment) = EngineAssignment::of(scene, arguments.engine.as_deref())?;
    let packings = PackingState::of_all(&scene)?;
    print(overview(&scene, &assignment, &packings).as_bytes())?;
    Ok(Exit::Done)
}

/// Overview of a run of the scene, whose packings are in these states.
fn overview(scene: &Scene, assignment: &EngineAssignment, packings: &[PackingState]) -> String {
    let packing = &packings[0];
    let problem = &scene.problem;
    let options = scene.definition().options();
    let points = problem.point_count();
    let error = options.error.map_or(String::new(), |error| format!("error {error:e}: to begin with "));
    let quasi_static = problem.stages.iter().filter(|stage| !matches!(stage.procedure, Procedure::Dynamic(_)));
    let steps: usize = quasi_static.map(|stage| stage.control.increments).sum();
    let prescribed: Vec<String> =
        problem.stages.iter().map(|stage| prescribed_count(problem, stage).to_string()).collect();
    // Between the first steps and those after the peak, measured on biaxial tests.
    let range = [2, 6].map(|per_step: usize| per_step.saturating_mul(steps).saturating_mul(points));
    let evaluations = if problem.stages.iter().all(|stage| stage.procedure == Procedure::Implicit) {
        format!("about {} to {}", range[0], range[1])
    } else {
        format!("one per time step or iteration of motion or relaxation and point ({points} points)")
    };
    let lines = [
        ("scene", format!("{} ({})", scene.name, normalised(scene.document.path()).display())),
        (
            "mesh",
            format!(
                "{} elements ({}), {} nodes, {} m large",
                problem.mesh.elements.len(),
                problem.mesh.kinds_present().into_iter().map(ElementKind::keyword).collect::<Vec<_>>().join(", "),
                problem.mesh.nodes.len(),
                size_of(&problem.mesh)
            ),
        ),
        (
            "degrees of freedom",
            format!("{} of which {} are prescribed", problem.mesh.degrees_of_freedom(), prescribed.join(", then ")),
        ),
        ("Gauss points", points.to_string()),
        ("packing", packing_line(scene)),
        ("packing stress", packing.stress_text()),
        ("packing state", packing.state_text()),
        (
            "grain solver",
            format!(
                "{}, {error}strain per step {:e}, tolerance {:e} ({})",
                options.damping.keyword(),
                options.strain_per_step(),
                options.tolerance(),
                options.criterion.keyword()
            ),
        ),
        ("formulation", problem.formulation.keyword().to_owned()),
        ("engines", assignment.overview()),
        ("tangent", problem.tangents().into_iter().map(TangentKind::keyword).collect::<Vec<_>>().join(", ")),
        ("stages", problem.stages.iter().map(stage_line).collect::<Vec<_>>().join(", ")),
        ("steps", if steps > 0 { format!("{steps} without cut-backs") } else { "those of the motion".to_owned() }),
        ("evaluations", evaluations),
        ("cost", Estimate::of(scene, range).text(cores().get())),
        (
            "history columns",
            scene.record.probes.iter().map(|probe| probe.name.as_str()).collect::<Vec<_>>().join(", "),
        ),
    ];
    let mut text = String::new();
    for (label, value) in lines {
        writeln!(text, "{label:<20} {value}").expect("writing to a String cannot fail");
    }
    let mut notes = remarks_on_the_packings(scene, packings);
    let loads = start_state::compare_loads(scene, packings);
    // Of a packing without load the remarks say enough.
    let differ = matches!(loads, LoadComparison::Differ(_)) && !packing.carries_no_load();
    match loads {
        LoadComparison::Differ(text) if differ => {
            notes.push(format!("LOADS AND PACKING DO NOT MATCH: {text}. Remedy: {}", start_state::remedy(scene)));
        }
        LoadComparison::NotCompared(reason) => {
            notes.push(format!("the initial loads are not compared with the stress of the packing: {reason}"));
        }
        LoadComparison::Nearly(text) => notes.push(text),
        LoadComparison::Differ(_) | LoadComparison::Match => {}
    }
    notes.extend(scene.remarks.iter().cloned());
    let elsewhere = scene.grains.iter().filter(|&&point| !assignment.is_built_in(point)).count();
    if elsewhere > 0 {
        notes.push(format!(
            "output.grains: {elsewhere} of {} points are solved by another engine than `grains` and are not drawn",
            scene.grains.len()
        ));
    }
    for note in notes {
        writeln!(text, "{:<20} {note}", "note").expect("writing to a String cannot fail");
    }
    if let Some(preparation) = scene.preparation() {
        let [lowest, highest] = preparation.vertical_pressure;
        let cells = preparation.cells;
        let line = format!(
            "{cells} cells are brought to vertical pressures of {lowest:.3e} to {highest:.3e} Pa when the run starts"
        );
        writeln!(text, "{:<20} {line}", "initial stress").expect("writing to a String cannot fail");
    }
    for remark in &scene.materials.remarks {
        writeln!(text, "{:<20} {remark}", "region").expect("writing to a String cannot fail");
    }
    for remark in assignment.remarks() {
        writeln!(text, "{:<20} {remark}", "note").expect("writing to a String cannot fail");
    }
    text.push_str(match differ {
        false => "Scene OK.\n",
        true => "The scene can be run, but its loads and its packing do not match; see the note above.\n",
    });
    text
}

/// What is to be known about the packing of the scene and those of its regions under their contact laws.
fn remarks_on_the_packings(scene: &Scene, packings: &[PackingState]) -> Vec<String> {
    // Regions of cells that are brought to their initial stress say nothing new.
    let packings = if scene.preparation().is_none() { packings } else { &packings[..1] };
    start_state::remarks(packings, |packing| [packing.remarks_on_the_law(), packing.remarks()].concat())
}

/// Extent of the body along the axes, m.
fn size_of(mesh: &Mesh) -> String {
    let extent = |axis: usize| {
        let along = mesh.nodes.iter().map(|node| node[axis]);
        along.clone().fold(f64::NEG_INFINITY, f64::max) - along.fold(f64::INFINITY, f64::min)
    };
    let sides: Vec<String> = (0..mesh.dimension.count()).map(|axis| format!("{:.3e}", extent(axis))).collect();
    sides.join(" x ")
}

fn prescribed_count(problem: &Problem, stage: &Stage) -> usize {
    problem.prescribed_displacements(stage).map_or(0, |values| values.iter().filter(|value| value.is_some()).count())
}

fn stage_line(stage: &Stage) -> String {
    match &stage.procedure {
        Procedure::Dynamic(settings) => {
            let densities = &settings.element_densities;
            let least = densities.iter().copied().fold(f64::INFINITY, f64::min);
            let density = match densities.iter().copied().fold(f64::NEG_INFINITY, f64::max) {
                most if most > least => format!("{least:.1} to {most:.1}"),
                most if most == least => format!("{most:.1}"),
                _ => format!("{:.1}", settings.density),
            };
            format!("{} (dynamic, {} s, {density} kg/m3)", stage.name, stage.duration)
        }
        procedure @ (Procedure::Implicit | Procedure::Relaxation(_)) => {
            let (steps, duration) = (stage.control.increments, stage.duration);
            format!("{} ({}, {steps} steps, {duration} s)", stage.name, procedure.keyword())
        }
    }
}

/// The path without `.`, and without `..` where that does not depend on the file system.
fn normalised(path: &Path) -> PathBuf {
    let mut whole = PathBuf::new();
    for component in path.components() {
        match (component, whole.components().next_back()) {
            (Component::CurDir, _) => {}
            // A symbolic link would lead elsewhere: what `..` leaves must be a folder proper.
            (Component::ParentDir, Some(Component::Normal(_))) if !whole.is_symlink() => {
                whole.pop();
            }
            _ => whole.push(component),
        }
    }
    if whole.as_os_str().is_empty() { PathBuf::from(".") } else { whole }
}

fn packing_line(scene: &Scene) -> String {
    let grains = match scene.definition().dimension() {
        2 => "discs",
        _ => "spheres",
    };
    format!("{} {grains} in {}", scene.definition().number(), normalised(&scene.packing_path).display())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_normalised() {
        let texts = ["scenes/../packings/a.json", "./a", "../a/b/../../c", "/a/./b/../c", "a/.."];
        let paths = texts.map(|text| normalised(Path::new(text)).display().to_string());
        assert_eq!(paths, ["packings/a.json", "a", "../c", "/a/c", "."]);
    }
}
