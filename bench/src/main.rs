//! `grainspan bench NAME`: measures the cost of Grainspan and writes tables, charts and a description of the machine.
//!
//! A study is one entry of [`STUDIES`]. It measures, and hands tables and charts to its [`Report`], which prints them and
//! writes them as CSV and SVG. Times are medians of several runs; ratios are taken within one round of alternating runs,
//! so that a busy machine slows both sides alike.

mod channel;
mod economy;
mod effort;
mod error_estimate;
mod femxdem;
mod instructions;
mod micro;
mod newton;
mod program;
mod repeat;
mod report;
mod rve;
mod scaling;
mod schedule;
mod self_test;
mod shortcuts;
mod stability;
mod stability_options;
mod table;
mod workers;

use clap::Parser;
use effort::Effort;
use grainspan::exit::{Exit, Failure};
use grainspan::machine::Machine;
use grainspan::stdout::print;
use report::Report;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// As in the program that is measured.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// One study.
struct Study {
    /// Name on the command line and of the folder.
    name: &'static str,
    /// One line for `--list`.
    about: &'static str,
    /// Parts and variants that `--only` may name with this effort.
    parts: fn(&Effort) -> Vec<String>,
    /// Measures; must not depend on the order of studies or leave processes behind.
    run: fn(&Effort, &mut Report) -> anyhow::Result<()>,
    /// Draws the pictures of the tables in a folder again and counts them, for studies that can.
    redraw: Option<fn(&Path) -> anyhow::Result<usize>>,
}

/// All studies, in the order of `--list`.
const STUDIES: &[Study] = &[
    Study {
        name: "self-test",
        about: "the measuring itself: resolution of the clock, cost of a wake-up, steadiness of the machine",
        parts: no_parts,
        run: self_test::run,
        redraw: None,
    },
    Study {
        name: "channel",
        about: "round trip and throughput against payload, cost of a call without grains, wait modes",
        parts: no_parts,
        run: channel::run,
        redraw: None,
    },
    Study {
        name: "schedule",
        about: "time of a batch of unequal jobs over the ideal: static split, in order, longest first; 2 to 4096 workers",
        parts: schedule::parts,
        run: schedule::run,
        redraw: None,
    },
    Study {
        name: "scaling",
        about: "400 discs on 1, 2 and more workers: fixed work, work per worker, the serial part",
        parts: no_parts,
        run: scaling::run,
        redraw: None,
    },
    Study {
        name: "rve",
        about: "stress error of one cell over time and force evaluations, for every setting, Yade and LAMMPS",
        parts: rve::parts,
        run: rve::run,
        redraw: Some(rve::redraw),
    },
    Study {
        name: "error-estimate",
        about: "estimated against true error of the stresses over ten cells, and what it costs to keep to an error",
        parts: error_estimate::parts,
        run: error_estimate::run,
        redraw: None,
    },
    Study {
        name: "femxdem",
        about: "a biaxial test with the open FEM x DEM code (Yade over escript) and with ours: time and error of both",
        parts: no_parts,
        run: femxdem::run,
        redraw: None,
    },
    Study {
        name: "economy",
        about: "what each shortcut of a run saves, alone and together, and its error: specimen, wall, wave, cycles",
        parts: economy::parts,
        run: economy::run,
        redraw: None,
    },
    Study {
        name: "shortcuts",
        about: "random scenes with and without each shortcut: histories the same, or within the tolerances",
        parts: no_parts,
        run: shortcuts::run,
        redraw: None,
    },
    Study {
        name: "instructions",
        about: "nothing asked, nothing paid: instructions of runs that are equal but for one thing",
        parts: instructions::parts,
        run: instructions::run,
        redraw: None,
    },
    Study {
        name: "newton",
        about: "evaluations per step of every strategy and operator: one element over five packings, biaxial test",
        parts: newton::parts,
        run: newton::run,
        redraw: None,
    },
    Study {
        name: "stability",
        about: "random cases outside everyday use: how they end, increments not at rest, work, work by damping",
        parts: stability::parts,
        run: stability::run,
        redraw: None,
    },
];

/// Of a study that measures everything at once.
fn no_parts(_: &Effort) -> Vec<String> {
    Vec::new()
}

/// The name that runs a microbenchmark instead of a study.
const MICRO: &str = "micro";

/// Measures what Grainspan costs on this machine.
#[derive(Debug, Parser)]
#[command(
    name = "grainspan-bench",
    bin_name = "grainspan bench",
    version,
    after_help = "Examples:
  grainspan bench --list
  grainspan bench self-test --out out/bench/self-test
  grainspan bench rve --redraw --out out/bench/rve
  grainspan bench stability --cases 500 --seed 7 --out out/bench/stability
  grainspan bench stability --seed 7 --case 42 --write case-42.toml
  grainspan bench micro lane_cost packings/discs-400.json 64

Measure with a release build on a quiet machine; the report says what it was."
)]
struct Arguments {
    /// Study to run, or `micro` for the cost of one part alone
    #[arg(value_name = "NAME", required_unless_present_any = ["list", "helper"])]
    name: Option<String>,
    /// Only with `micro`: a microbenchmark and its arguments; without them all are listed
    #[arg(value_name = "ARGUMENT", trailing_var_arg = true)]
    arguments: Vec<String>,
    /// List the studies
    #[arg(long)]
    list: bool,
    /// Folder for CSV, SVG and the description of the machine [default: out/bench/NAME]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Take seconds, not minutes: shows that the study works, not what things cost
    #[arg(long)]
    quick: bool,
    /// Take hours: the sizes of the papers, in studies that have a smaller one for every day
    #[arg(long, conflicts_with = "quick")]
    full: bool,
    /// Measure only this part or variant; may be repeated
    #[arg(long, value_name = "PART")]
    only: Vec<String>,
    /// Measure nothing: draw the pictures of the tables in the folder again (rve)
    #[arg(long, conflicts_with_all = ["quick", "full", "only"])]
    redraw: bool,
    /// Be the other side of a study: a role and an address
    #[arg(long, num_args = 2, value_names = ["ROLE", "ADDRESS"], hide = true)]
    helper: Option<Vec<String>>,
    #[command(flatten)]
    stability: stability_options::Options,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    if let Some([role, run]) = arguments.helper.as_deref()
        && role == workers::WORKER
    {
        return workers::work(run);
    }
    match run(&arguments) {
        Ok(exit) => exit.code(),
        Err(failure) => {
            eprintln!("error: {failure}");
            failure.exit.code()
        }
    }
}

/// Runs one study, or lists them all.
///
/// # Errors
/// There is no such study, the folder cannot be written, or the study cannot run here.
fn run(arguments: &Arguments) -> Result<Exit, Failure> {
    if let Some([role, plan]) = arguments.helper.as_deref()
        && role == instructions::ROLE
    {
        let evaluations = instructions::follow(Path::new(plan))
            .map_err(|error| Failure::new(Exit::BadInput, format!("helper: {error:#}")))?;
        print(format!("{evaluations}\n").as_bytes())?;
        return Ok(Exit::Done);
    }
    if let Some([role, address]) = arguments.helper.as_deref() {
        workers::help(role, address)
            .map_err(|error| Failure::new(Exit::WorkersLost, format!("helper: {error:#}")))?;
        return Ok(Exit::Done);
    }
    let Some(name) = arguments.name.as_ref().filter(|_| !arguments.list) else {
        print(list().as_bytes())?;
        return Ok(Exit::Done);
    };
    if name == MICRO {
        let list = micro::run(&arguments.arguments)
            .map_err(|error| Failure::new(Exit::BadInput, format!("bench {MICRO}: {error:#}")))?;
        print(list.as_bytes())?;
        return Ok(Exit::Done);
    }
    if let Some(argument) = arguments.arguments.first() {
        return Err(Failure::new(Exit::BadInput, format!("bench {name}: unexpected argument `{argument}`")));
    }
    let study = STUDIES.iter().find(|study| study.name == name).ok_or_else(|| {
        Failure::new(Exit::BadInput, format!("there is no study `{name}`; `grainspan bench --list` lists them"))
    })?;
    let folder = arguments.out.clone().unwrap_or_else(|| PathBuf::from("out/bench").join(study.name));
    let foreign = match study.name {
        "stability" => None,
        "shortcuts" => arguments.stability.other_than_seed_and_scenes(),
        _ => (!arguments.stability.is_plain()).then_some("`bench stability`"),
    };
    if let Some(owner) = foreign {
        let text = format!("bench {}: one of the options given is for {owner}; see `bench --help`", study.name);
        return Err(Failure::new(Exit::BadInput, text));
    }
    let effort = Effort {
        quick: arguments.quick,
        full: arguments.full,
        only: arguments.only.clone(),
        stability: arguments.stability.clone(),
    };
    let failed = |error: anyhow::Error| match error.downcast::<Failure>() {
        Ok(failure) => failure,
        Err(error) => Failure::new(Exit::BadInput, format!("bench {}: {error:#}", study.name)),
    };
    let refused = |problem| Failure::new(Exit::BadInput, format!("bench {}: {problem}", study.name));
    effort.refuse_unknown(&(study.parts)(&effort)).map_err(refused)?;
    if arguments.redraw {
        let redraw = study.redraw.ok_or_else(|| anyhow::anyhow!("this study cannot draw without measuring"));
        let drawn = redraw.and_then(|redraw| redraw(&folder)).map_err(failed)?;
        print(format!("{drawn} pictures drawn again in {}\n", folder.display()).as_bytes())?;
        return Ok(Exit::Done);
    }
    let mut report = Report::open(&folder, study.name, &Machine::here(), &effort)?;
    (study.run)(&effort, &mut report).map_err(failed)?;
    report.close()?;
    Ok(Exit::Done)
}

fn list() -> String {
    let width = STUDIES.iter().map(|study| study.name.len()).max().unwrap_or(0);
    STUDIES.iter().map(|study| format!("{:<width$}  {}\n", study.name, study.about)).collect()
}
