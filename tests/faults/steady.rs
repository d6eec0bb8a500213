//! Check P-7: what a steady loss of workers costs. The same run undisturbed and with one worker killed at equal intervals,
//! by turns; same bytes, and the wall and processor time of one over the other.

use super::case::wait;
use super::children::children_of;
use super::compare::same;
use super::macros::{Macro, strike};
use claims::Claim;
use rustix::process::Signal;
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

/// A run of half a minute or more on two cores: the small scene at default accuracy, far beyond its usual strain.
const SETS: [&str; 3] = ["rve.accuracy=default", "loading.increments=40", "boundary.2.displacement.y=-1.5e-3"];

/// What one run took.
struct Took {
    wall: f64,
    processor: f64,
    kills: u32,
}

/// Compares `rounds` pairs of runs, one worker of two killed every `every` seconds.
pub fn compare(rounds: u64, every: u64) -> Result<(), String> {
    let place = tempfile::tempdir().map_err(|error| error.to_string())?;
    let (mut walls, mut processors, mut kills) = (Vec::new(), Vec::new(), 0);
    let mut differing = 0_u32;
    for round in 0..rounds {
        let undisturbed = place.path().join(format!("undisturbed-{round}"));
        let disturbed = place.path().join(format!("disturbed-{round}"));
        let quiet = run(&undisturbed, None)?;
        let killed = run(&disturbed, Some(Duration::from_secs(every)))?;
        let compared = same(&disturbed, &undisturbed);
        differing += u32::from(compared.is_err());
        let bytes = compared.map_or_else(|reason| reason, |()| "same bytes".to_owned());
        kills += killed.kills;
        walls.push(killed.wall / quiet.wall);
        processors.push(killed.processor / quiet.processor);
        println!(
            "undisturbed {:.1} s wall, {:.1} s of processors; {} kills: {:.1} s, {:.1} s; {bytes}",
            quiet.wall, quiet.processor, killed.kills, killed.wall, killed.processor
        );
    }
    let (wall, processor) = (median(walls), median(processors));
    println!(
        "one worker of two killed every {every} s, {kills} kills: wall x {wall:.3}, processors x {processor:.3}"
    );
    if kills == 0 {
        return Err("no run was long enough for a kill".to_owned());
    }
    Claim::of("P-7", "pairs of runs, one losing workers steadily, that differ in a byte")
        .value(f64::from(differing), 0.0)
        .within_absolute(0.0);
    if every == 60 {
        // Wall times scatter with the load of the machine: recorded, whatever they are.
        Claim::of("P-7", "wall time with one worker of two killed per minute over that of an undisturbed run")
            .number(wall)
            .missed_up_to(f64::INFINITY)
            .at_most(1.1);
    }
    Ok(())
}

fn run(out: &Path, every: Option<Duration>) -> Result<Took, String> {
    let mut words: Vec<String> =
        ["run", "scenes/biaxial-small.toml", "--workers", "2", "--out"].map(str::to_owned).into();
    words.push(out.display().to_string());
    for set in SETS {
        words.extend(["--set".to_owned(), set.to_owned()]);
    }
    let (begun, processor) = (Instant::now(), processor_seconds_of_the_dead());
    let (mut next, mut kills) = (every.map(|every| begun + every), 0);
    let mut run = Macro::start(&words, &out.with_extension("stderr")).patient();
    wait(&mut run, |pid| {
        if let (Some(time), Some(every)) = (next, every)
            && Instant::now() >= time
            && let Some(victim) = children_of(pid).first()
        {
            strike(*victim, Signal::KILL);
            kills += 1;
            next = Some(time + every);
        }
    })?;
    let wall = begun.elapsed().as_secs_f64();
    Ok(Took { wall, processor: processor_seconds_of_the_dead() - processor, kills })
}

/// Processor time of all descendants that have ended and were waited for, s.
fn processor_seconds_of_the_dead() -> f64 {
    let statistics = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = statistics.rsplit_once(')').map_or("", |(_, rest)| rest).split_whitespace().collect();
    let ticks = |place: usize| fields.get(place).and_then(|text| text.parse::<f64>().ok()).unwrap_or(0.0);
    // Clock ticks of a hundredth of a second, in user and in kernel mode.
    (ticks(13) + ticks(14)) / 100.0
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    // The mean of the two in the middle of an even number.
    let middle = |place: usize| values[place.min(values.len() - 1)];
    0.5 * (middle((values.len() - 1) / 2) + middle(values.len() / 2))
}
