//! What several hosts cost: the main scene on two workers of one host, and on two hosts with an agent of one worker each.
//!
//! Both sides run in turn, the order changing from pair to pair, and the medians over all pairs are compared. Every pair must have the
//! same bytes. Wall times mean something on a quiet machine only, and what else the machine does changes the time that a trial takes. What
//! the macro process and the agents take on a processor besides the workers, which do the same work on both sides, is the firmest figure.

use crate::case::summary_of;
use crate::compare;
use crate::network::{Cable, HUB};
use rustix::process::{Pid, WaitId, WaitIdOptions, waitid};
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
    /// Processor time of macro process and agents alone, s.
    besides: f64,
    /// Processor time of the machine that was not idle, s.
    machine: f64,
    /// Share of the workers' time outside grain solver and tangents.
    outside: f64,
}

impl Cost {
    fn values(&self) -> [f64; 6] {
        [self.run, self.wall, self.processors, self.besides, self.machine, 100.0 * self.outside]
    }
}

/// Compares both sides `pairs` times; `changes` are `--set` arguments for both.
///
/// # Errors
/// A run fails, or the bytes differ.
pub fn measure(pairs: u64, changes: &[String]) -> Result<(), String> {
    let cable = Cable::make()?;
    let (mut one, mut two) = (Vec::new(), Vec::new());
    println!("pair  side         run_s   wall_s  processors_s  besides_workers_s  machine_s  outside_%");
    for pair in 0..pairs {
        let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
        let places = [folder.path().join("one"), folder.path().join("two")];
        for side in if pair % 2 == 0 { [0, 1] } else { [1, 0] } {
            let cost = timed(&places[side], || match side {
                0 => on_one_host(&places[0], changes),
                _ => on_two_agents(&cable, &places[1], changes),
            })?;
            let [run, wall, processors, besides, machine, outside] = cost.values();
            let name = ["one host", "two agents"][side];
            println!(
                "{pair:>4}  {name:<10} {run:>7.2}  {wall:>7.2}  {processors:>12.2}  {besides:>17.2}  {machine:>9.2}  {outside:>9.2}"
            );
            if side == 0 { one.push(cost) } else { two.push(cost) }
        }
        compare::same(&places[1], &places[0])?;
        if pair + 1 == pairs {
            println!("{}", traffic(&places[1]));
        }
    }
    let names = ["run, s", "wall, s", "processors, s", "besides workers, s", "machine, s", "outside the solver, %"];
    println!("medians of {pairs} pairs: one host, two agents, median of the ratios of the pairs less 1 in %");
    for (place, name) in names.iter().enumerate() {
        let of = |costs: &[Cost]| costs.iter().map(|cost| cost.values()[place]).collect::<Vec<f64>>();
        let (one, two) = (of(&one), of(&two));
        let ratios = one.iter().zip(&two).map(|(one, two)| 100.0 * (two / one - 1.0)).collect();
        println!("{name:<22} {:>8.2} {:>8.2} {:>+7.2}", median(one), median(two), median(ratios));
    }
    let more = one.iter().zip(&two).map(|(one, two)| 100.0 * (two.besides - one.besides) / one.processors);
    println!(
        "what two agents take besides the workers, of all processor time of one host: {:+.2} %",
        median(more.collect())
    );
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

/// Returns the processor time besides the workers, s.
fn on_one_host(out: &Path, changes: &[String]) -> Result<f64, String> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_grainspan"));
    command.args(arguments(out, changes)).args(["--workers", "2"]).current_dir(env!("CARGO_MANIFEST_DIR"));
    succeed("one host", command.stdin(Stdio::null()).stdout(Stdio::null()).spawn())
}

/// Likewise.
fn on_two_agents(cable: &Cable, out: &Path, changes: &[String]) -> Result<f64, String> {
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
    let agents = agents.map(|agent| succeed("an agent", agent));
    let [one, two] = agents;
    Ok(ended? + one? + two?)
}

/// Waits for the end; returns the processor time of the process itself, s.
fn succeed(name: &str, child: std::io::Result<Child>) -> Result<f64, String> {
    let mut child = child.map_err(|error| format!("{name}: {error}"))?;
    let pid = i32::try_from(child.id()).ok().and_then(Pid::from_raw).ok_or("no process number")?;
    // The kernel knows the times of an ended process until it is waited for.
    let ended = waitid(WaitId::Pid(pid), WaitIdOptions::EXITED | WaitIdOptions::NOWAIT);
    ended.map_err(|error| format!("{name}: {error}"))?;
    let seconds = seconds_of(&format!("/proc/{}/stat", child.id()), 11)?;
    let status = child.wait().map_err(|error| format!("{name}: {error}"))?;
    if status.success() { Ok(seconds) } else { Err(format!("{name} ended with {status}")) }
}

fn timed(out: &Path, work: impl FnOnce() -> Result<f64, String>) -> Result<Cost, String> {
    let children = || seconds_of("/proc/self/stat", 13);
    let before = (children()?, busy_seconds()?);
    let begun = Instant::now();
    let besides = work()?;
    let wall = begun.elapsed().as_secs_f64();
    let after = (children()?, busy_seconds()?);
    let summary = summary_of(out)?;
    let time = |name: &str| summary["time"][name].as_f64().unwrap_or(f64::NAN);
    let (inside, outside) = (time("rve_s") + time("tangent_s"), time("transport_s") + time("idle_s"));
    Ok(Cost {
        run: time("wall_s"),
        wall,
        processors: after.0 - before.0,
        besides,
        machine: after.1 - before.1,
        outside: outside / (inside + outside),
    })
}

/// What the run says of its connections.
fn traffic(out: &Path) -> String {
    let Ok(summary) = summary_of(out) else { return String::new() };
    format!("trials {}, hosts {}", summary["rve_evaluations"], summary["hosts"])
}

/// Processor time in user and kernel mode from a file of a process, s: two fields after so many behind its name, 11 for the process itself
/// and 13 for its descendants that have ended.
fn seconds_of(file: &str, skip: usize) -> Result<f64, String> {
    let text = fs::read_to_string(file).map_err(|error| format!("{file}: {error}"))?;
    // The name, in parentheses, may hold blanks.
    let rest = text.rsplit_once(')').map_or("", |(_, rest)| rest);
    let ticks: Vec<f64> = rest.split_whitespace().skip(skip).take(2).filter_map(|word| word.parse().ok()).collect();
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
