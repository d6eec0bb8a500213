//! The whole chain in one process: scene, solver, pool, grains, output; workers are threads.

use super::drive::{Manner, drive};
use super::folder::OutputFolder;
use crate::cli::exit::Exit;
use crate::scene::Scene;
use macro_solver::observer::Silent;
use macro_solver::output::{RunStatus, Summary};
use macro_solver::pool::{Interrupt, JoiningWorkers, Pool, PoolSettings};
use protocol::transport::in_process::channel;
use rve_server::engine::GrainEngine;
use rve_server::server::{ServeOptions, serve};
use std::fs;
use std::path::Path;
use std::time::Instant;

/// Runs a scene with so many worker threads.
fn run(scene: &Scene, place: &Path, workers: usize) -> Exit {
    let as_run = scene.document.as_run(&[("packing", "packing.json")]).unwrap();
    let folder = OutputFolder::prepare(place, &as_run, &scene.definition.packing.to_json()).unwrap();
    let (port, door) = channel();
    let servants: Vec<_> = (0..workers)
        .map(|_| {
            let door = door.clone();
            std::thread::spawn(move || serve(&mut GrainEngine, &mut door.join(), &ServeOptions::new("test")))
        })
        .collect();
    let definition = scene.definition.to_protocol();
    let made_of = vec![0; scene.problem.point_count()];
    let settings = PoolSettings::new("test");
    let mut pool = Pool::new(port, Box::new(JoiningWorkers), Interrupt::new(), settings, vec![definition], &made_of);
    pool.gather(workers).unwrap();
    let manner = Manner { workers, begun: Instant::now(), quiet: true, beside: &mut Silent };
    let exit = drive(scene, pool, &folder, manner).unwrap();
    servants.into_iter().for_each(|servant| drop(servant.join().unwrap()));
    exit
}

fn small(overrides: &[&str]) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/biaxial-small.toml");
    Scene::load(&path, &overrides.iter().map(|&given| given.to_owned()).collect::<Vec<_>>()).unwrap()
}

#[test]
fn the_output_is_complete_and_does_not_depend_on_the_number_of_workers() {
    let place = tempfile::tempdir().unwrap();
    let scene = small(&["mesh.elements=[1, 2]", "loading.increments=2", "output.gauss_points=true"]);
    let (one, two) = (place.path().join("one"), place.path().join("two"));
    assert_eq!((run(&scene, &one, 1), run(&scene, &two, 2)), (Exit::Done, Exit::Done));
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
    run(&small(&["mesh.elements=[1, 2]", "loading.increments=1"]), &first, 1);
    run(&Scene::load(&first.join("scene.toml"), &[]).unwrap(), &second, 1);
    assert_eq!(fs::read(first.join("history.csv")).unwrap(), fs::read(second.join("history.csv")).unwrap());
}
