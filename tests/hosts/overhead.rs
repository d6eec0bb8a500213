//! What several hosts cost: the main scene on two workers of one host, and on two hosts with an agent of one worker each.
//!
//! Both sides run in turn, the order changing from pair to pair, and the medians over all pairs are compared. Every pair must have the
//! same bytes. Wall times mean something on a quiet machine only; the processor time of all processes is less sensitive.

use crate::case::summary_of;
use crate::compare;
use crate::network::{Cable, HUB};
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// The scene, and its increments unless others are asked for.
const SCENE: &str = "scenes/biaxial.toml";

/// In which the kernel tells programs about time, on every x86-64.
const TICKS_PER_SECOND: f64 = 100.0;

/// One side of a pair, measured.
#[derive(Clone, Copy, Debug)]
struct Cost {
    /// From the first step to the last, as the run says, s.
    run: f64,
    /// From the start of the first process to the end of the last, s.
    wall: f64,
    /// Processor time of all processes, s.
    processors: f64,
    /// Processor time of the machine that was not idle, s.
    machine: f64,
    /// Share of the workers' time outside grain solver and tangents.
    outside: f64,
}

impl Cost {
    fn values(&self) -> [f64; 5] {
        [self.run, self.wall, self.processors, self.machine, 100.0 * self.outside]
    }
}

/// Compares both sides `pairs` times; `changes` are `--set` arguments for both.
///
/// # Errors
/// A run fails, or the bytes differ.
pub fn measure(pairs: u64, changes: &[String]) -> Result<(), String> {
    let cable = Cable::make()?;
    let (mut one, mut two) = (Vec::new(), Vec::new());
    println!("pair  side         run_s   wall_s  processors_s  machine_s  outside_%");
    for pair in 0..pairs {
        let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
        let places = [folder.path().join("one"), folder.path().join("two")];
        for side in if pair % 2 == 0 { [0, 1] } else { [1, 0] } {
            let costs = [&mut one, &mut two];
            let cost = timed(&places[side], || match side {
                0 => on_one_host(&places[0], changes),
                _ => on_two_agents(&cable, &places[1], changes),
            })?;
            let [run, wall, processors, machine, outside] = cost.values();
            let name = ["one host", "two agents"][side];
            println!(
                "{pair:>4}  {name:<10} {run:>7.2}  {wall:>7.2}  {processors:>12.2}  {machine:>9.2}  {outside:>9.2}"
            );
            costs.into_iter().nth(side).map(|costs| costs.push(cost));
        }
        compare::same(&places[1], &places[0])?;
        if pair + 1 == pairs {
            println!("{}", traffic(&places[1]));
        }
    }
    let names = ["run, s", "wall, s", "processors, s", "machine, s", "outside the solver, %"];
    println!("medians of {pairs} pairs: one host, two agents, median of the ratios of the pairs less 1 in %");
    for (place, name) in names.iter().enumerate() {
        let of = |costs: &[Cost]| costs.iter().map(|cost| cost.values()[place]).collect::<Vec<f64>>();
        let (one, two) = (of(&one), of(&two));
        let ratios = one.iter().zip(&two).map(|(one, two)| 100.0 * (two / one - 1.0)).collect();
        println!("{name:<22} {:>8.2} {:>8.2} {:>+7.2}", median(one), median(two), median(ratios));
    }
    Ok(())
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let half = values.len() / 2;
    match values.len() {
        0 => f64::NAN,
        count if count % 2 == 1 => values[half],
        _ => 0.5 * (values[half - 1] + values[half]),
    }
}

fn arguments(out: &Path, changes: &[String]) -> Vec<String> {
    let mut words = vec!["run".to_owned(), SCENE.to_owned(), "--quiet".to_owned()];
    words.extend(["--out".to_owned(), out.display().to_string()]);
    for change in changes {
        words.extend(["--set".to_owned(), change.clone()]);
    }
    words
}

fn on_one_host(out: &Path, changes: &[String]) -> Result<(), String> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_grainspan"));
    command.args(arguments(out, changes)).args(["--workers", "2"]).current_dir(env!("CARGO_MANIFEST_DIR"));
    succeed("one host", command.stdin(Stdio::null()).stdout(Stdio::null()).spawn())
}

fn on_two_agents(cable: &Cable, out: &Path, changes: &[String]) -> Result<(), String> {
    let mut words = arguments(out, changes);
    words.extend(["--workers", "0", "--listen", "0.0.0.0:0"].map(str::to_owned));
    for address in HUB {
        words.extend(["--advertise".to_owned(), address.to_owned()]);
    }
    let run = cable.program(0, &words).spawn();
    let join = out.join("join");
    let end = Instant::now() + Duration::from_secs(60);
    while !join.exists() && Instant::now() < end {
        std::thread::sleep(Duration::from_millis(2));
    }
    let words = ["agent", "--join", &join.display().to_string(), "--workers", "1"].map(str::to_owned);
    let agents = [1, 2].map(|host| cable.program(host, &words).stderr(Stdio::null()).spawn());
    let ended = succeed("the macro process", run);
    agents.into_iter().try_for_each(|agent| succeed("an agent", agent))?;
    ended
}

fn succeed(name: &str, child: std::io::Result<Child>) -> Result<(), String> {
    let status = child.and_then(|mut child| child.wait()).map_err(|error| format!("{name}: {error}"))?;
    if status.success() { Ok(()) } else { Err(format!("{name} ended with {status}")) }
}

fn timed(out: &Path, work: impl FnOnce() -> Result<(), String>) -> Result<Cost, String> {
    let before = (children_seconds()?, busy_seconds()?);
    let begun = Instant::now();
    work()?;
    let wall = begun.elapsed().as_secs_f64();
    let after = (children_seconds()?, busy_seconds()?);
    let summary = summary_of(out)?;
    let time = |name: &str| summary["time"][name].as_f64().unwrap_or(f64::NAN);
    let (inside, outside) = (time("rve_s") + time("tangent_s"), time("transport_s") + time("idle_s"));
    Ok(Cost {
        run: time("wall_s"),
        wall,
        processors: after.0 - before.0,
        machine: after.1 - before.1,
        outside: outside / (inside + outside),
    })
}

/// What the run says of its connections.
fn traffic(out: &Path) -> String {
    let Ok(summary) = summary_of(out) else { return String::new() };
    format!("trials {}, hosts {}", summary["rve_evaluations"], summary["hosts"])
}

/// Processor time of all ended and awaited descendants, s.
fn children_seconds() -> Result<f64, String> {
    let text = fs::read_to_string("/proc/self/stat").map_err(|error| error.to_string())?;
    // The name, in parentheses, may hold blanks.
    let rest = text.rsplit_once(')').map_or("", |(_, rest)| rest);
    let ticks: Vec<f64> = rest.split_whitespace().skip(13).take(2).filter_map(|word| word.parse().ok()).collect();
    Ok(ticks.iter().sum::<f64>() / TICKS_PER_SECOND)
}

/// Time that the processors of this machine were not idle, s.
fn busy_seconds() -> Result<f64, String> {
    let text = fs::read_to_string("/proc/stat").map_err(|error| error.to_string())?;
    let line = text.lines().next().unwrap_or_default();
    let ticks: Vec<f64> = line.split_whitespace().skip(1).filter_map(|word| word.parse().ok()).collect();
    // user, nice, system, [idle, waiting], interrupts, soft interrupts, [stolen]
    let busy = [0, 1, 2, 5, 6].iter().filter_map(|&place| ticks.get(place));
    Ok(busy.sum::<f64>() / TICKS_PER_SECOND)
}
