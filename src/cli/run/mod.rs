//! `grainspan run SCENE.toml`: the whole simulation. Everything is checked before a folder is made or a process started.

mod arguments;
mod cells;
mod closing_lines;
mod control;
pub(crate) mod counters;
mod event_log;
mod execute;
mod failure;
mod folder;
mod grains;
mod hosts;
mod launch;
mod observers;
mod packings;
mod plot;
mod preparation;
mod progress;
mod resume;
mod shortcuts;
mod summary;
#[cfg(test)]
mod tests;
mod warnings;

pub(crate) use arguments::Arguments;

use crate::engines::EngineAssignment;
use crate::exit::{Exit, Failure};
use crate::stderr::tell;
use folder::OutputFolder;
use resume::{Contents, RunDescription, Start};
use scene_reader::{CellPreparation, Scene};
use std::path::PathBuf;

/// Runs the scene.
///
/// # Errors
/// Bad input, an output folder that cannot be written, workers that cannot be started.
pub(crate) fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    let scene = Scene::load_in_size(&arguments.scene, arguments.size.as_deref(), &arguments.overrides)?;
    let (mut scene, assignment) = EngineAssignment::of(scene, arguments.engine.as_deref())?;
    let path = arguments.out.clone().unwrap_or_else(|| PathBuf::from("out").join(&scene.name));
    if arguments.workers == Some(0) && arguments.listen.is_none() {
        let problem = "--workers 0: a run needs at least one worker; leave --workers out for one per core, or let agents of other \
                       hosts join with --listen";
        return Err(Failure::new(Exit::BadInput, problem));
    }
    launch::refuse_too_many(&scene, &assignment, arguments)?;
    hosts::check(arguments)?;
    if arguments.resume {
        folder::refuse_live(&path)?;
    } else {
        folder::refuse_foreign(&path)?;
    }
    let watch = launch::Watch::start()?;
    let as_run = scene.as_run()?;
    let description = RunDescription::new(&as_run, Contents::new(&scene, &assignment));
    // Before cells are prepared, which takes minutes: there may be nothing to do.
    let start = if arguments.resume { resume::start(&path, &description, &scene.files())? } else { Start::Beginning };
    let continued = match start {
        Start::Complete => {
            print_unless_quiet(arguments, &format!("the run in {} is complete: nothing to continue", path.display()));
            return Ok(Exit::Done);
        }
        Start::From(continued) => Some(*continued),
        Start::Beginning => None,
    };
    preparation::prepare_cells(&mut scene, arguments.workers, arguments.quiet, &watch.interrupt)?;
    watch.go_on()?;
    let contents = Contents::new(&scene, &assignment);
    if let Some(continued) = &continued {
        continued.expect_definition(&path, &contents)?;
    }
    let description = RunDescription { contents, ..description };
    // What the channels refuse must not cost an earlier run its results.
    let channels = launch::open(&scene, &assignment, arguments)?;
    let folder = match &continued {
        Some(_) => OutputFolder::reopen(&path)?,
        None => OutputFolder::prepare(&path, &as_run, &scene.files())?,
    };
    if let Some(continued) = &continued {
        let (step, load) = (continued.description.step, continued.description.load);
        print_unless_quiet(arguments, &format!("continuing after step {step} at load {load:.4}"));
        continued.remarks.iter().for_each(|remark| tell(format_args!("warning: {remark}")));
    } else if arguments.resume {
        print_unless_quiet(arguments, &format!("no checkpoint in {}: starting from the beginning", path.display()));
    }
    let description = description.of(continued.as_ref());
    event_log::open(&folder.path().join("run.jsonl"))?;
    if !arguments.quiet {
        assignment.remarks().for_each(|remark| tell(format_args!("note: {remark}")));
    }
    assignment.remarks().for_each(|remark| tracing::info!(remark, "engine"));
    if let Some(CellPreparation { cells, in_smaller_steps, next_to_stress, seconds, .. }) = scene.prepared {
        tracing::info!(event = "cells_prepared", cells, in_smaller_steps, next_to_stress, seconds);
    }
    for remark in &scene.remarks {
        tracing::warn!(remark, "scene");
        print_unless_quiet(arguments, &format!("warning: {remark}"));
    }
    launch::run(&scene, &assignment, &folder, arguments, (watch, channels), &description, continued)
}

fn print_unless_quiet(arguments: &Arguments, line: &str) {
    if !arguments.quiet {
        tell(line);
    }
}
