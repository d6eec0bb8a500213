//! What the shared-memory channel costs between two processes: round trips with one message under way, and throughput
//! with two, for snapshots of 64 B to 200 kB in both directions. Both sides block while they wait.
//!
//! `cargo run --release -p grainspan-protocol --example channel_cost`

use bytemuck::Zeroable;
use protocol::control::{FromWorker, ToWorker};
use protocol::transport::shared_memory::{ChannelLimits, SharedMemoryMacroPort, SharedMemoryWorkerPort};
use protocol::transport::{LoadedJob, LoadedReply, MacroEvent, MacroPort, WorkerEvent, WorkerId, WorkerPort};
use protocol::wire::{ReplyStatus, TrialJob, TrialReply};
use protocol::{Capabilities, PROTOCOL_VERSION};
use std::error::Error;
use std::io::Write;
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(10);
const ROUNDS: usize = 5_000;

fn main() -> Result<(), Box<dyn Error>> {
    match std::env::args().nth(1) {
        Some(run) => serve(&run),
        None => measure(),
    }
}

/// The worker: returns every snapshot that it gets.
fn serve(run: &str) -> Result<(), Box<dyn Error>> {
    let mut port = SharedMemoryWorkerPort::join(run, PATIENCE)?;
    let capabilities =
        Capabilities { engine: "echo".into(), version: "1".into(), dimensions: vec![], ..Capabilities::default() };
    port.send_control(&FromWorker::Hello {
        protocol: PROTOCOL_VERSION,
        run: run.to_owned(),
        pid: std::process::id(),
        capabilities,
        state_cache: 0,
    })?;
    let mut done = false;
    let mut queue: Vec<(TrialJob, Vec<u8>)> = Vec::new();
    while !done {
        port.poll(PATIENCE, &mut |event| match event {
            WorkerEvent::Jobs(jobs) => queue.extend(jobs.iter().map(|one| (one.job, one.state.to_vec()))),
            WorkerEvent::Control(ToWorker::Bye) | WorkerEvent::MacroLost(_) => done = true,
            WorkerEvent::Control(_) => {}
        })?;
        for (job, state) in queue.drain(..) {
            let reply = TrialReply::bare(&job, ReplyStatus::Done);
            port.send_replies(&[LoadedReply { reply, state: &state, error: b"" }])?;
        }
    }
    Ok(())
}

fn measure() -> Result<(), Box<dyn Error>> {
    let run = format!("cost{}", std::process::id());
    let mut port = SharedMemoryMacroPort::create(&run, ChannelLimits::default())?;
    let begin = Instant::now();
    let mut worker = std::process::Command::new(std::env::current_exe()?).arg(&run).spawn()?;
    let mut joined = false;
    while !joined {
        port.poll(PATIENCE, &mut |event| joined |= matches!(event, MacroEvent::Control(..)))?;
    }
    let mut out = std::io::stdout().lock();
    writeln!(out, "a worker's process joined after {:.1} ms", begin.elapsed().as_secs_f64() * 1e3)?;
    writeln!(out, "{:>10} {:>12} {:>12} {:>16}", "bytes", "p50, us", "p99, us", "messages/s")?;
    for size in [64, 1_000, 8_000, 50_000, 200_000] {
        let state = vec![7; size];
        let mut times: Vec<Duration> = Vec::with_capacity(ROUNDS);
        for _ in 0..ROUNDS {
            let begin = Instant::now();
            send(&mut port, &state)?;
            receive(&mut port, 1)?;
            times.push(begin.elapsed());
        }
        times.sort();
        let begin = Instant::now();
        send(&mut port, &state)?;
        let mut sent = 1;
        let mut received = 0;
        while received < ROUNDS {
            while sent < ROUNDS && sent - received < 2 {
                send(&mut port, &state)?;
                sent += 1;
            }
            received += receive(&mut port, 1)?;
        }
        let rate = ROUNDS as f64 / begin.elapsed().as_secs_f64();
        let microseconds = |at: usize| times[at].as_secs_f64() * 1e6;
        writeln!(
            out,
            "{size:>10} {:>12.1} {:>12.1} {rate:>16.0}",
            microseconds(ROUNDS / 2),
            microseconds(ROUNDS * 99 / 100)
        )?;
    }
    let begin = Instant::now();
    port.kill(WorkerId(0));
    let mut lost = false;
    while !lost {
        port.poll(PATIENCE, &mut |event| lost |= matches!(event, MacroEvent::Lost(..)))?;
    }
    writeln!(out, "a killed worker was noticed after {:.2} ms", begin.elapsed().as_secs_f64() * 1e3)?;
    worker.wait()?;
    Ok(())
}

fn send(port: &mut SharedMemoryMacroPort, state: &[u8]) -> Result<(), Box<dyn Error>> {
    Ok(port.send_jobs(WorkerId(0), &[LoadedJob { job: TrialJob::zeroed(), state }])?)
}

/// Waits for at least `count` replies and returns how many came.
fn receive(port: &mut SharedMemoryMacroPort, count: usize) -> Result<usize, Box<dyn Error>> {
    let mut received = 0;
    while received < count {
        port.poll(PATIENCE, &mut |event| {
            if let MacroEvent::Replies(_, replies) = event {
                received += replies.len();
            }
        })?;
    }
    Ok(received)
}
