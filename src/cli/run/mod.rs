//! `grainspan run SCENE.toml`: the whole simulation. Everything is checked before a folder is made or a process started.

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
mod levers;
mod observers;
mod plot;
mod preparation;
mod progress;
mod resume;
mod summary;
#[cfg(test)]
mod tests;

use crate::engines::EngineAssignment;
use crate::exit::{Exit, Failure};
use folder::OutputFolder;
use protocol::transport::shared_memory::Waiting;
use resume::{RunDescription, Start};
use scene_reader::{CellPreparation, Scene};
use std::path::PathBuf;

/// Arguments of `grainspan run`.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:
  grainspan run scenes/biaxial-small.toml
  grainspan run scenes/biaxial.toml --workers 2 --out out/fine --set rve.accuracy=tight
  grainspan run scenes/biaxial.toml --set loading.increments=40 --set boundary.2.displacement.y=-1e-3

  grainspan run scenes/biaxial.toml --resume

Ctrl-C ends a run in good order: everything up to the last accepted step is written, and --resume continues it.")]
pub(crate) struct Arguments {
    /// Scene file
    #[arg(value_name = "SCENE.toml")]
    scene: PathBuf,
    /// Worker processes of each engine on this host [default: one per core; with --attach: 1]; 0 with --listen
    #[arg(long, value_name = "N", value_parser = worker_count)]
    workers: Option<usize>,
    /// Start no workers: wait for N that join the run of this name with `grainspan rve-server --run RUN`
    #[arg(long, value_name = "RUN")]
    attach: Option<String>,
    /// Let agents of other hosts join at this endpoint (`grainspan agent`); port 0 takes a free one. The file `join` in the
    /// output folder tells agents how
    #[arg(long, value_name = "ADDRESS:PORT", conflicts_with = "attach")]
    listen: Option<String>,
    /// Address of this host in the file `join`; several for several networks [default: that of --listen, or this host's name]
    #[arg(long, value_name = "ADDRESS[:PORT]", requires = "listen")]
    advertise: Vec<String>,
    /// Secret that agents must know too, in a file that only you may read [default: drawn for this run]
    #[arg(long, value_name = "FILE", requires = "listen")]
    secret: Option<PathBuf>,
    /// Time without any sign of life of another host after which its work goes to others
    #[arg(long, value_name = "SECONDS", requires = "listen", default_value_t = 10.0, value_parser = crate::cli::seconds)]
    silence: f64,
    /// Engine that solves the points in place of the scene's own choice; see docs/guide/external-engines.md
    #[arg(long, value_name = "NAME")]
    engine: Option<String>,
    /// How macro and workers wait for messages: `hybrid` and `spin` trade CPU time for latency
    /// [default: pool.wait of the scene, else `block`]
    #[arg(long, value_enum)]
    wait: Option<Wait>,
    /// Output folder [default: out/NAME OF THE SCENE]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Continue the run in the output folder from its last checkpoint; from the start if there is none yet
    #[arg(long)]
    resume: bool,
    /// One of the sizes that the file names in `[sizes]` [default: the file as it stands]
    #[arg(long, value_name = "NAME")]
    size: Option<String>,
    /// Override a key of the scene; entries of [[lists]] are numbered from 0
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    overrides: Vec<String>,
    /// Print nothing but errors
    #[arg(long)]
    quiet: bool,
}

/// [`Waiting`] as the command line names it.
#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum Wait {
    /// Block until the kernel reports a message
    Block,
    /// Poll for 50 us, then block, if a core is free
    Hybrid,
    /// Poll all the time
    Spin,
}

impl From<Wait> for Waiting {
    fn from(wait: Wait) -> Self {
        match wait {
            Wait::Block => Self::Block,
            Wait::Hybrid => Self::Hybrid,
            Wait::Spin => Self::Spin,
        }
    }
}

fn worker_count(text: &str) -> Result<usize, String> {
    text.parse().map_err(|_| "not a number of workers".to_owned())
}

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
    preparation::prepare_cells(&mut scene, arguments.quiet)?;
    let as_run = scene.document.as_run(&scene.materials.renamed())?;
    let description = RunDescription::new(&as_run, &scene.materials.identity());
    let start = if arguments.resume { resume::start(&path, &description)? } else { Start::Beginning };
    let (folder, continued) = match start {
        Start::Complete => {
            print_unless_quiet(arguments, &format!("the run in {} is complete: nothing to continue", path.display()));
            return Ok(Exit::Done);
        }
        Start::From(continued) => {
            let folder = OutputFolder::reopen(&path)?;
            let (step, load) = (continued.description.step, continued.description.load);
            print_unless_quiet(arguments, &format!("continuing after step {step} at load {load:.4}"));
            continued.remarks.iter().for_each(|remark| eprintln!("warning: {remark}"));
            (folder, Some(*continued))
        }
        Start::Beginning => {
            if arguments.resume {
                print_unless_quiet(
                    arguments,
                    &format!("no checkpoint in {}: starting from the beginning", path.display()),
                );
            }
            (OutputFolder::prepare(&path, &as_run, &scene.materials.files)?, None)
        }
    };
    event_log::open(&folder.path().join("run.jsonl"))?;
    if !arguments.quiet {
        assignment.remarks().for_each(|remark| eprintln!("note: {remark}"));
    }
    assignment.remarks().for_each(|remark| tracing::info!(remark, "engine"));
    if let Some(CellPreparation { cells, in_smaller_steps, .. }) = scene.prepared {
        tracing::info!(event = "cells_prepared", cells, in_smaller_steps);
    }
    for remark in &scene.remarks {
        tracing::warn!(remark, "scene");
        print_unless_quiet(arguments, &format!("warning: {remark}"));
    }
    launch::run(&scene, &assignment, &folder, arguments, &description, continued)
}

fn print_unless_quiet(arguments: &Arguments, line: &str) {
    if !arguments.quiet {
        eprintln!("{line}");
    }
}
