//! The whole chain in one process: scene, solver, pool, grains, output; workers are threads.

use super::execute::{RunContext, execute};
use super::folder::OutputFolder;
use super::resume::{Contents, RunDescription};
use crate::engines::EngineAssignment;
use crate::exit::{Exit, Failure};
use macro_solver::observer::{FieldsView, Observer, Silent, StepReport, StopRequest};
use macro_solver::output::{RunStatus, Summary};
use macro_solver::pool::{Interrupt, JoiningWorkers, Pool, PoolSettings};
use protocol::transport::in_process::channel;
use rve_server::engine::GrainEngine;
use rve_server::server::{ServeOptions, serve};
use scene_reader::Scene;
use std::fs;
use std::path::Path;
use std::time::Instant;

/// Runs a scene with a number of worker threads.
fn run(scene: &Scene, place: &Path, workers: usize, observer: &mut dyn Observer) -> Result<Exit, Failure> {
    let as_run = scene.as_run().unwrap();
    let folder = OutputFolder::prepare(place, &as_run, &scene.files()).unwrap();
    let (port, connector) = channel();
    let threads: Vec<_> = (0..workers)
        .map(|_| {
            let connector = connector.clone();
            std::thread::spawn(move || serve(&mut GrainEngine, &mut connector.join(), &ServeOptions::new("test")))
        })
        .collect();
    let assignment = EngineAssignment::assemble(scene, None).unwrap();
    let served = assignment.pool_definitions(&scene.materials);
    let settings = PoolSettings { engines: served.engines, ..PoolSettings::new("test") };
    let (supply, interrupt) = (Box::new(JoiningWorkers), Interrupt::new());
    let mut pool = Pool::new(port, supply, interrupt, settings, served.definitions, &served.made_of);
    pool.gather(workers).unwrap();
    let description = RunDescription::new(&as_run, Contents::default());
    let context = RunContext {
        assignment: &assignment,
        replicas: macro_solver::material::error_estimate::SamplePlan::default(),
        workers,
        begun: Instant::now(),
        quiet: true,
        description: &description,
        continued: None,
        interrupt: Interrupt::new(),
        observer,
        hosts: &std::collections::BTreeMap::new,
    };
    let exit = execute(scene, pool, &folder, context);
    threads.into_iter().for_each(|thread| drop(thread.join().unwrap()));
    exit
}

fn small(overrides: &[&str]) -> Scene {
    scene("scenes/biaxial-small.toml", overrides)
}

fn scene(file: &str, overrides: &[&str]) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
    Scene::load(&path, &overrides.iter().map(|&given| given.to_owned()).collect::<Vec<_>>()).unwrap()
}

#[test]
fn the_output_is_complete_and_does_not_depend_on_the_number_of_workers() {
    let place = tempfile::tempdir().unwrap();
    let scene = small(&["mesh.elements=[1, 2]", "loading.increments=2", "output.gauss_points=true"]);
    let (one, two) = (place.path().join("one"), place.path().join("two"));
    for (path, workers) in [(&one, 1), (&two, 2)] {
        assert_eq!(run(&scene, path, workers, &mut Silent).unwrap(), Exit::Done);
    }
    for file in [
        "history.csv",
        "fields.pvd",
        "gauss_points.pvd",
        "fields/step-0002.vtu",
        "fields/gauss-points-0002.vtp",
        "grains/point-0000-step-0002.vtp",
        "grains/point-0000.pvd",
        "scene.toml",
        "packing.json",
        "history.svg",
    ] {
        assert_eq!(fs::read(one.join(file)).unwrap(), fs::read(two.join(file)).unwrap(), "{file}");
    }
    let summary: Summary = serde_json::from_slice(&fs::read(one.join("summary.json")).unwrap()).unwrap();
    assert_eq!((summary.status, summary.steps, summary.gauss_points), (RunStatus::Done, 2, 8));
    assert!(summary.rve_evaluations >= 16 && summary.energy["external_work"] > 0.0);
}

#[test]
fn the_scene_in_the_output_folder_repeats_the_run() {
    let place = tempfile::tempdir().unwrap();
    let (first, second) = (place.path().join("first"), place.path().join("second"));
    run(&small(&["mesh.elements=[1, 2]", "loading.increments=1"]), &first, 1, &mut Silent).unwrap();
    run(&Scene::load(&first.join("scene.toml"), &[]).unwrap(), &second, 1, &mut Silent).unwrap();
    assert_eq!(fs::read(first.join("history.csv")).unwrap(), fs::read(second.join("history.csv")).unwrap());
}

/// Cells that differ: the same bytes for any number of workers, and again from the folder that the run has left.
#[test]
fn a_run_of_different_cells_does_not_depend_on_workers_and_can_be_repeated() {
    let place = tempfile::tempdir().unwrap();
    let overrides = ["loading.increments=2", "region.0.packings=['../packings/discs-100.json']", "output.grains=[8]"];
    let scene = scene("scenes/biaxial-weak-element.toml", &overrides);
    let [one, two, again] = ["one", "two", "again"].map(|name| place.path().join(name));
    run(&scene, &one, 1, &mut Silent).unwrap();
    run(&scene, &two, 2, &mut Silent).unwrap();
    run(&Scene::load(&one.join("scene.toml"), &[]).unwrap(), &again, 1, &mut Silent).unwrap();
    let history = fs::read_to_string(one.join("history.csv")).unwrap();
    for other in [&two, &again] {
        assert_eq!(fs::read_to_string(other.join("history.csv")).unwrap(), history);
    }
    let grains = fs::read(one.join("grains/point-0008-step-0002.vtp")).unwrap();
    assert_eq!(fs::read(two.join("grains/point-0008-step-0002.vtp")).unwrap(), grains);
    assert!(one.join("packings/0-0.json").exists());
}

/// Puts a file in the place of the folder of fields once step 1 is accepted.
struct Saboteur<'a>(&'a Path);

impl Observer for Saboteur<'_> {
    fn accepted(&mut self, report: &StepReport, _fields: &FieldsView<'_>) -> Result<(), StopRequest> {
        if report.step == 1 {
            fs::remove_dir_all(self.0.join("fields")).unwrap();
            fs::write(self.0.join("fields"), "in the way").unwrap();
        }
        Ok(())
    }
}

#[test]
fn an_output_that_cannot_be_written_ends_the_run_and_leaves_whole_rows() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("out");
    let scene = small(&["mesh.elements=[1, 1]", "loading.increments=3"]);
    let failure = run(&scene, &path, 1, &mut Saboteur(&path)).unwrap_err();
    assert_eq!(failure.exit, Exit::BadInput);
    assert!(failure.message.contains("step-0002.vtu") && failure.message.contains("hint:"), "{}", failure.message);
    let history = fs::read_to_string(path.join("history.csv")).unwrap();
    assert_eq!(history.lines().count(), 3, "header, step 0, step 1");
    assert!(history.ends_with('\n'));
    let summary: Summary = serde_json::from_slice(&fs::read(path.join("summary.json")).unwrap()).unwrap();
    assert_eq!(summary.status, RunStatus::OutputFailed);
}

/// One element of the extent of the small scene, as Gmsh writes it, with its groups.
const ONE_ELEMENT: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat
$PhysicalNames
5
0 1 \"bottom_left\"
1 2 \"bottom\"
1 3 \"right\"
1 4 \"top\"
1 5 \"left\"
$EndPhysicalNames
$Nodes
4
1 0 0 0
2 0.05 0 0
3 0.05 0.1 0
4 0 0.1 0
$EndNodes
$Elements
6
1 15 2 1 1 1
2 1 2 2 1 1 2
3 1 2 3 2 2 3
4 1 2 4 3 3 4
5 1 2 5 4 4 1
6 3 2 0 1 1 2 3 4
$EndElements
";

/// The page found no body: the scene in the output folder named the mesh relative to the folder that the scene came from.
#[test]
fn a_mesh_file_goes_along_with_the_run() {
    let place = tempfile::tempdir().unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let [inputs, out, again] = ["inputs", "out", "again"].map(|name| place.path().join(name));
    fs::create_dir(&inputs).unwrap();
    fs::write(inputs.join("body.msh"), ONE_ELEMENT).unwrap();
    fs::copy(root.join("scenes/biaxial-small.toml"), inputs.join("scene.toml")).unwrap();
    let packing = format!("packing='{}'", root.join("packings/discs-100.json").display());
    let overrides = [packing, "mesh={ file = 'body.msh' }".into(), "loading.increments=1".into()];
    run(&Scene::load(&inputs.join("scene.toml"), &overrides).unwrap(), &out, 1, &mut Silent).unwrap();
    fs::remove_dir_all(&inputs).unwrap();
    assert_eq!(fs::read_to_string(out.join("mesh.msh")).unwrap(), ONE_ELEMENT);
    run(&Scene::load(&out.join("scene.toml"), &[]).unwrap(), &again, 1, &mut Silent).unwrap();
    assert_eq!(fs::read(out.join("history.csv")).unwrap(), fs::read(again.join("history.csv")).unwrap());
}

/// Another mesh file under the same name, and other engines, were taken for the same run.
#[test]
fn what_decides_a_run_outside_its_scene_is_known() {
    let contents = |scene: &Scene| Contents::new(scene, &EngineAssignment::assemble(scene, None).unwrap());
    let generated = small(&["mesh.elements=[1, 2]"]);
    let of_generated = contents(&generated);
    assert_eq!((of_generated.mesh.as_str(), of_generated.engines.as_str()), ("", "grains (0 to 7)"));
    let place = tempfile::tempdir().unwrap();
    let file = place.path().join("body.msh");
    let of_file = |text: &str| {
        fs::write(&file, text).unwrap();
        contents(&small(&[&format!("mesh={{ file = '{}' }}", file.display())])).mesh
    };
    let before = of_file(ONE_ELEMENT);
    assert_eq!(of_file(&ONE_ELEMENT.replace("$Nodes", "$Comments\nthe same\n$EndComments\n$Nodes")), before);
    assert_ne!(of_file(&ONE_ELEMENT.replace("3 0.05 0.1 0", "3 0.05 0.1001 0")), before);
}
