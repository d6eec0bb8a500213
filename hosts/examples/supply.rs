//! What one macro process can supply to workers on other hosts: its processor time per trial, by thread, with workers that answer at
//! once. Times are of processors, not of the clock: other programs on the machine disturb them little.
//!
//! `cargo run --release -p grainspan-hosts --features network --example supply -- [CONNECTIONS] [KB_OF_STATE] [TRIALS] [JOBS_A_MESSAGE]`

#![expect(clippy::print_stdout, reason = "a program for people")]

use hosts::{JoinedPort, Limits, ListenerOptions, NetworkMacroPort, NetworkWorkerPort, Secret, Target, this_program};
use macro_solver::material::{PointMaterial, PointTrial};
use macro_solver::pool::{Interrupt, JoiningWorkers, Pool, PoolSettings};
use protocol::control::{FromWorker, ToWorker};
use protocol::transport::in_process::channel;
use protocol::transport::{LoadedReply, TransportError, WorkerEvent, WorkerPort};
use protocol::wire::{ReplyStatus, TrialJob, TrialReply};
use protocol::{Capabilities, Cost, Definition, PROTOCOL_VERSION, StateId, Tensor2, TrialOptions};
use std::error::Error;
use std::fs;
use std::num::NonZeroUsize;
use std::time::{Duration, Instant};

/// Evaluations, of which the first is not counted.
const ROUNDS: usize = 5;

fn main() -> Result<(), Box<dyn Error>> {
    let numbers = std::env::args().skip(1).map(|text| text.parse()).collect::<Result<Vec<usize>, _>>()?;
    let number = |place: usize, default| numbers.get(place).copied().unwrap_or(default);
    let (connections, state_kilobytes) = (number(0, 8).max(1), number(1, 30));
    let (trials, jobs_per_message) = (number(2, 4000).max(1), number(3, 1));
    let secret = Secret::draw()?;
    let options = ListenerOptions {
        run: "supply".into(),
        secret: secret.clone(),
        limits: Limits::default(),
        program: this_program().into(),
    };
    let network = NetworkMacroPort::listen("127.0.0.1:0", options)?;
    let target = Target { endpoints: vec![network.address().to_string()], secret };
    let workers: Vec<_> = (0..connections)
        .map(|_| {
            let target = target.clone();
            std::thread::Builder::new()
                .name("worker".into())
                .spawn(move || answer(&target, state_kilobytes * 1000).map_err(|error| error.to_string()))
        })
        .collect::<Result<_, _>>()?;
    let mut settings = PoolSettings::new("supply");
    settings.jobs_per_message = NonZeroUsize::new(jobs_per_message).unwrap_or(NonZeroUsize::MIN);
    let definition = Definition { bytes: b"nothing".to_vec() };
    let made_of = vec![0; trials];
    // As in a run: behind the port that joins other hosts to the workers of this one.
    let port = JoinedPort::new(channel().0, Some(network));
    let mut pool = Pool::new(port, Box::new(JoiningWorkers), Interrupt::new(), settings, vec![definition], &made_of);
    while pool.workers() < connections {
        pool.gather(connections)?;
    }
    let mut before = (Instant::now(), Used::now()?);
    for round in 0..ROUNDS {
        if round == 1 {
            before = (Instant::now(), Used::now()?);
        }
        let first = 1e-4 * (1.0 + round as f64);
        let trial = |point: usize| PointTrial {
            point,
            target: Tensor2::from_plane([[first * (1.0 + 1e-9 * point as f64), 0.0], [0.0, 0.0]]),
            options: TrialOptions { ramp_steps: 1, ..TrialOptions::default() },
        };
        pool.evaluate(&(0..trials).map(trial).collect::<Vec<_>>())?;
        pool.commit()?;
    }
    let (wall, after) = (before.0.elapsed().as_secs_f64(), Used::now()?);
    let counted = ((ROUNDS - 1) * trials) as f64;
    println!("connections {connections}, states of {state_kilobytes} kB, {jobs_per_message} jobs a message at most");
    println!("pool           {:6.1} us of processor time per trial", (after.pool - before.1.pool) * 1e6 / counted);
    println!("network        {:6.1}", (after.network - before.1.network) * 1e6 / counted);
    println!("workers' ends  {:6.1}", (after.workers - before.1.workers) * 1e6 / counted);
    println!("wall           {:6.1} us per trial, all of this on one machine", wall * 1e6 / counted);
    drop(pool);
    for worker in workers {
        worker.join().map_err(|_| "a worker has panicked")??;
    }
    Ok(())
}

/// A worker that answers at once with a state of `length` bytes that differs from all others.
fn answer(target: &Target, length: usize) -> Result<(), TransportError> {
    let port = NetworkWorkerPort::join(target, Limits::default(), Duration::from_secs(20));
    let mut port = port.map_err(|error| TransportError::Channel { action: "join", reason: error.to_string() })?;
    let capabilities = Capabilities {
        engine: "nothing".into(),
        version: "1".into(),
        dimensions: vec![2],
        deterministic: true,
        ..Capabilities::default()
    };
    let run = port.run().to_owned();
    let state_cache = u32::MAX;
    port.send_control(&FromWorker::Hello { protocol: PROTOCOL_VERSION, run, pid: 0, capabilities, state_cache })?;
    let (mut left, mut messages, mut states) = (false, Vec::<Vec<TrialJob>>::new(), Vec::<Vec<u8>>::new());
    while !left {
        port.poll(Duration::from_secs(60), &mut |event| match event {
            WorkerEvent::Jobs(loaded) => messages.push(loaded.iter().map(|one| one.job).collect()),
            WorkerEvent::Control(ToWorker::Bye) | WorkerEvent::MacroLost(_) => left = true,
            WorkerEvent::Control(_) => {}
        })?;
        // One message of replies for one of jobs, as workers do.
        for jobs in messages.drain(..) {
            let mut replies = Vec::with_capacity(jobs.len());
            states.resize(states.len().max(jobs.len()), vec![7; length.max(16)]);
            for (job, state) in jobs.iter().zip(&mut states) {
                state[..8].copy_from_slice(&job.job.to_le_bytes());
                let mut reply = TrialReply::bare(job, ReplyStatus::Done);
                reply.state = StateId::of(state);
                reply.state_length = state.len() as u64;
                reply.cost = Cost { force_evaluations: 100, ..Cost::default() };
                replies.push(LoadedReply { reply: reply.seal(b""), state, error: b"" });
            }
            port.send_replies(&replies)?;
        }
    }
    Ok(())
}

/// Processor time of the threads of this process by their task, s.
#[derive(Clone, Copy, Debug, Default)]
struct Used {
    pool: f64,
    network: f64,
    workers: f64,
}

impl Used {
    fn now() -> Result<Self, Box<dyn Error>> {
        let mut used = Self::default();
        for task in fs::read_dir("/proc/self/task")? {
            let task = task?;
            let seconds = fs::read_to_string(task.path().join("schedstat"))?;
            let nanoseconds: f64 = seconds.split(' ').next().unwrap_or_default().parse()?;
            let place = match fs::read_to_string(task.path().join("comm"))?.trim() {
                _ if task.file_name() == std::process::id().to_string().as_str() => &mut used.pool,
                "hosts" => &mut used.network,
                _ => &mut used.workers,
            };
            *place += nanoseconds * 1e-9;
        }
        Ok(used)
    }
}
