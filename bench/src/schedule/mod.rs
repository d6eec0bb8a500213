//! How well the pool spreads jobs of unequal cost: time of a batch over the ideal, `max(longest job, mean load)`.
//!
//! *Static* gives each worker an equal number of neighbouring points. *In order* is the pool without any forecast.
//! *Longest first* is the pool as it runs: it expects of a point what it cost the last time, exactly right or after costs
//! have drifted. The simulated workers talk to the pool of a real run through a channel with a clock of its own.

mod costs;
mod virtual_port;

use super::repeat::median;
use super::report::Report;
use super::table::Table;
use super::workers::{Role, StudyPool, pausing_definition, processor_seconds};
use crate::effort::Effort;
use anyhow::anyhow;
use charts::{Chart, Scale};
use costs::{Dice, Tail, drifted, ideal, static_split};
use macro_solver::material::{PointMaterial, PointTrial};
use macro_solver::pool::{Interrupt, JoiningWorkers, Pool, PoolSettings};
use protocol::process::resident_mebibytes;
use protocol::transport::shared_memory::Waiting;
use protocol::{Definition, Tensor2, TrialOptions};
use scene_reader::JOBS_A_MESSAGE;
use std::num::NonZeroUsize;
use std::sync::{Arc, Barrier};
use std::time::Duration;
use virtual_port::{MessageTimes, Play, VirtualPort};

/// What can be named on the command line.
const PARTS: [&str; 3] = ["simulated", "between_hosts", "asleep"];

/// Mean cost of a job, s: an increment of 400 discs.
const MEAN: f64 = 0.01;

/// Points per worker.
const POINTS: usize = 8;

/// How far costs drift from one increment to the next: log-normal deviation.
const DRIFT: f64 = 0.5;

/// The macro's time per message and the latency of a message with blocking waits, as measured by `bench channel`.
const TIMES: MessageTimes =
    MessageTimes { handling: 4e-6, trial: 0.0, network: 0.0, network_threads: 0, latency: 10e-6 };

/// The same for workers on other hosts with states of 30 kB, as measured by `hosts/examples/supply.rs`; see `docs/lab-book/hosts.md`.
const BETWEEN_HOSTS: MessageTimes =
    MessageTimes { handling: 6e-6, trial: 19e-6, network: 44e-6, network_threads: 4, latency: 300e-6 };

/// Points per worker of a run over many hosts.
const MANY_POINTS: usize = 100;

/// What `--only` may name.
pub(super) fn parts(_: &Effort) -> Vec<String> {
    PARTS.map(str::to_owned).to_vec()
}

/// Simulates, then lets processes sleep.
///
/// # Errors
/// The pool refuses, workers cannot be started, or the report cannot be written.
pub(super) fn run(effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    let wanted = |part| effort.includes(part, &PARTS);
    if wanted("simulated") {
        simulated(effort, report)?;
    }
    if wanted("between_hosts") {
        between_hosts(effort, report)?;
    }
    if wanted("asleep") {
        asleep(effort, report)?;
    }
    Ok(())
}

/// Makespans over the ideal.
#[derive(Clone, Copy, Debug, Default)]
struct Excess {
    fixed: f64,
    in_order: f64,
    longest_first: f64,
    drifted: f64,
    /// Processor time that the pool itself took per job, us; of this machine, not of the simulated one.
    decision: f64,
}

fn simulated(effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    let workers: &[usize] = effort.choose(&[2, 4, 8, 16, 64, 256, 1024, 4096], &[2, 16, 64]);
    let heads = ["costs", "workers", "static", "in_order", "longest_first", "after_drift", "decision_us"];
    let mut table = Table::new(heads);
    let mut chart =
        Chart::new("time over ideal", ("workers", Scale::Logarithmic), ("time over ideal", Scale::Linear));
    for tail in Tail::ALL {
        let mut found = Vec::new();
        for &workers in workers {
            // Few workers need more batches for a steady mean.
            let seeds = effort.choose((256 / workers).clamp(1, 16), 1);
            let seen =
                (0..seeds as u64).map(|seed| batch(tail, workers, seed)).collect::<anyhow::Result<Vec<_>>>()?;
            let middle = |part: fn(&Excess) -> f64| median(&seen.iter().map(part).collect::<Vec<_>>());
            let excess = Excess {
                fixed: middle(|one| one.fixed),
                in_order: middle(|one| one.in_order),
                longest_first: middle(|one| one.longest_first),
                drifted: middle(|one| one.drifted),
                decision: middle(|one| one.decision),
            };
            table.row([
                tail.name().into(),
                workers.into(),
                excess.fixed.into(),
                excess.in_order.into(),
                excess.longest_first.into(),
                excess.drifted.into(),
                excess.decision.into(),
            ]);
            found.push((workers as f64, excess));
        }
        if tail == Tail::LogNormal {
            let mut curve = |name: &str, part: fn(&Excess) -> f64| {
                chart.curve(name, found.iter().map(|(workers, excess)| [*workers, part(excess)]));
            };
            curve("static split", |one| one.fixed);
            curve("in order", |one| one.in_order);
            curve("longest first", |one| one.longest_first);
            curve("longest first, costs drifted", |one| one.drifted);
        }
    }
    let heading = format!("Simulated workers, {POINTS} points each, mean cost {} ms: time over ideal", MEAN * 1e3);
    report.table("simulated", &heading, &table)?;
    report.note(&format!(
        "The macro takes {:.0} us per message and the latency of a message is {:.0} us. `decision_us`: processor time that \
         deciding took here per job, the simulation included.",
        TIMES.handling * 1e6,
        TIMES.latency * 1e6
    ))?;
    report.chart("simulated", &chart)?;
    Ok(())
}

/// All schedules of one batch.
fn batch(tail: Tail, workers: usize, seed: u64) -> anyhow::Result<Excess> {
    let mut dice = Dice::new(seed);
    let costs = tail.draw(workers * POINTS, MEAN, &mut dice);
    let later = drifted(&costs, DRIFT, &mut dice);
    let best = ideal(&costs, workers);
    let [(in_order, _)] = play(workers, &costs, [&costs], false, TIMES, NonZeroUsize::MIN)?;
    let [(longest_first, decision), (after_drift, _)] =
        play(workers, &costs, [&costs, &later], true, TIMES, NonZeroUsize::MIN)?;
    Ok(Excess {
        fixed: static_split(&costs, workers) / best,
        in_order: in_order / best,
        longest_first: longest_first / best,
        drifted: after_drift / ideal(&later, workers),
        decision,
    })
}

/// Thousands of workers on other hosts, a hundred trials each: what the one macro process can supply.
fn between_hosts(effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    let heads = [
        "mean_ms",
        "workers",
        "jobs_per_message",
        "demand",
        "longest_first",
        "after_drift",
        "decision_us",
        "resident_mib",
    ];
    let mut table = Table::new(heads);
    // Mean cost, s, and workers.
    let studies: &[(f64, usize)] = effort.choose(
        &[(0.01, 100), (0.01, 1_000), (0.1, 1_000), (0.1, 10_000), (0.4, 10_000), (1.0, 10_000)],
        &[(0.1, 20)],
    );
    for &(mean, workers) in studies {
        for jobs_per_message in [NonZeroUsize::MIN, JOBS_A_MESSAGE] {
            let mut dice = Dice::new(workers as u64);
            let costs = Tail::LogNormal.draw(workers * MANY_POINTS, mean, &mut dice);
            let later = drifted(&costs, DRIFT, &mut dice);
            let [(longest_first, decision), (after_drift, _)] =
                play(workers, &costs, [&costs, &later], true, BETWEEN_HOSTS, jobs_per_message)?;
            // Of this process: points, jobs and queues of the largest batch so far.
            let resident = resident_mebibytes(std::process::id()).unwrap_or(0);
            table.row([
                (mean * 1e3).into(),
                workers.into(),
                jobs_per_message.get().into(),
                (workers as f64 / mean / BETWEEN_HOSTS.supply(1.0)).into(),
                (longest_first / ideal(&costs, workers)).into(),
                (after_drift / ideal(&later, workers)).into(),
                decision.into(),
                resident.into(),
            ]);
        }
    }
    let heading =
        format!("Simulated workers on other hosts, {MANY_POINTS} points each, log-normal costs: time over ideal");
    report.table("between_hosts", &heading, &table)?;
    report.note(&format!(
        "The macro takes {:.0} us for a message and {:.0} us for a trial in it, {} network threads {:.0} us for a trial; the latency is \
         {:.0} us. So it supplies {:.0} trials per second in messages of one. `demand`: trials per second that all workers together \
         would solve, over that.",
        BETWEEN_HOSTS.handling * 1e6,
        BETWEEN_HOSTS.trial * 1e6,
        BETWEEN_HOSTS.network_threads,
        BETWEEN_HOSTS.network * 1e6,
        BETWEEN_HOSTS.latency * 1e6,
        BETWEEN_HOSTS.supply(1.0)
    ))?;
    Ok(())
}

/// Has the pool learn from one batch and do others with what it has learnt. Returns the virtual time of each, s, and the
/// processor time of this machine that it took per job, us.
fn play<const N: usize>(
    workers: usize,
    first: &[f64],
    then: [&[f64]; N],
    tells_cost: bool,
    times: MessageTimes,
    jobs_per_message: NonZeroUsize,
) -> anyhow::Result<[(f64, f64); N]> {
    let scene = Play::new(workers, times);
    let port = VirtualPort::new(std::rc::Rc::clone(&scene), "play");
    let definition = Definition { bytes: b"virtual".to_vec() };
    let made_of = vec![0; first.len()];
    let settings = PoolSettings { jobs_per_message, ..PoolSettings::new("play") };
    let mut pool = Pool::new(port, Box::new(JoiningWorkers), Interrupt::new(), settings, vec![definition], &made_of);
    pool.gather(workers)?;
    let trials: Vec<_> =
        (0..first.len()).map(|point| trial(point, 1e-4 * (1.0 + 1e-6 * point as f64), true)).collect();
    scene.borrow_mut().tells_cost = tells_cost;
    scene.borrow_mut().costs = first.to_vec();
    pool.evaluate(&trials)?;
    pool.commit()?;
    let mut found = [(0.0, 0.0); N];
    for (costs, found) in then.iter().zip(&mut found) {
        scene.borrow_mut().costs = costs.to_vec();
        let (since, begin) = (scene.borrow().now(), processor_seconds("thread-self"));
        pool.evaluate(&trials)?;
        let decision = (processor_seconds("thread-self") - begin) * 1e6 / first.len() as f64;
        *found = (scene.borrow().now() - since, decision);
        pool.commit()?;
    }
    Ok(found)
}

/// A trial unlike all others; one ramp step, so that the pool expects the last cost of the point.
fn trial(point: usize, first: f64, tells_cost: bool) -> PointTrial {
    let target = Tensor2::from_plane([[first, 0.0], [0.0, if tells_cost { 1e-9 } else { 0.0 }]]);
    PointTrial { point, target, options: TrialOptions { ramp_steps: 1, ..TrialOptions::default() } }
}

/// Worker processes that sleep for the cost of a job, through the channel of a run.
fn asleep(effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    let rounds = effort.choose(5, 1);
    let mut table = Table::new(["costs", "workers", "static", "in_order", "longest_first"]);
    for tail in effort.choose(&Tail::ALL[..], &Tail::ALL[1..2]) {
        for &workers in effort.choose(&[2, 4, 8][..], &[2][..]) {
            let mut seen = [const { Vec::new() }; 3];
            for seed in 0..rounds {
                let costs = tail.draw(workers * POINTS, MEAN, &mut Dice::new(seed));
                let best = ideal(&costs, workers);
                let times = [
                    split_asleep(&costs, workers)?,
                    pool_asleep(&costs, workers, false)?,
                    pool_asleep(&costs, workers, true)?,
                ];
                seen.iter_mut().zip(times).for_each(|(samples, time)| samples.push(time.as_secs_f64() / best));
            }
            let [fixed, in_order, longest] = seen.map(|samples| median(&samples));
            table.row([tail.name().into(), workers.into(), fixed.into(), in_order.into(), longest.into()]);
        }
    }
    let heading = "Worker processes that sleep for the cost of a job (so cores do not matter): time over ideal";
    report.table("asleep", heading, &table).map_err(anyhow::Error::from)
}

/// A cost that no other point has, so that equal costs do not make equal trials, of which the pool computes one.
fn apart(point: usize, cost: f64) -> f64 {
    cost * (1.0 + 1e-9 * point as f64)
}

/// Makes the pool learn in one batch, then returns the time of the next.
fn pool_asleep(costs: &[f64], workers: usize, tells_cost: bool) -> anyhow::Result<Duration> {
    let mut pool = StudyPool::open(Some(Role::Pausing), pausing_definition(), workers, costs.len(), Waiting::Block)?;
    let trials: Vec<_> =
        costs.iter().enumerate().map(|(point, cost)| trial(point, apart(point, *cost), tells_cost)).collect();
    pool.ask(&trials)?;
    pool.commit()?;
    pool.ask(&trials)
}

/// One pool of one worker per part of the points, all at the same time.
fn split_asleep(costs: &[f64], workers: usize) -> anyhow::Result<Duration> {
    let barrier = Arc::new(Barrier::new(workers));
    let bound = |worker: usize| worker * costs.len() / workers;
    let parts = (0..workers).map(|worker| costs[bound(worker)..bound(worker + 1)].to_vec());
    let threads: Vec<_> = parts
        .map(|part| {
            let barrier = Arc::clone(&barrier);
            std::thread::spawn(move || -> anyhow::Result<Duration> {
                let opened =
                    StudyPool::open(Some(Role::Pausing), pausing_definition(), 1, part.len(), Waiting::Block);
                // All must come here, whatever has gone wrong with one.
                barrier.wait();
                let trials: Vec<_> =
                    part.iter().enumerate().map(|(point, cost)| trial(point, apart(point, *cost), true)).collect();
                opened?.ask(&trials)
            })
        })
        .collect();
    let mut longest = Duration::ZERO;
    for thread in threads {
        longest = longest.max(thread.join().map_err(|_| anyhow!("a thread of the study has panicked"))??);
    }
    Ok(longest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pool_spreads_even_jobs_evenly_and_longest_first_comes_close_to_the_ideal() {
        let even = batch(Tail::Even, 8, 0).unwrap();
        assert!((0.999..1.02).contains(&even.longest_first), "{even:?}");
        let uneven: Vec<_> = (0..8).map(|seed| batch(Tail::LogNormal, 8, seed).unwrap()).collect();
        let mean = |part: fn(&Excess) -> f64| uneven.iter().map(part).sum::<f64>() / uneven.len() as f64;
        assert!(mean(|one| one.longest_first) < mean(|one| one.in_order), "{uneven:?}");
        assert!(mean(|one| one.in_order) < mean(|one| one.fixed), "{uneven:?}");
    }
}
