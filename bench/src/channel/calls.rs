//! Cost that the channel adds to one RVE call: calls of RVEs without grains, compared with calls of 400 discs, through the same pool
//! to the same number of worker processes.

use crate::effort::Effort;
use crate::repeat::{interleaved, median, ratio};
use crate::report::Report;
use crate::table::Table;
use crate::workers::{EMPTY_SNAPSHOTS, Role, StudyPool, grain_definition, idle_definition};
use anyhow::Context;
use macro_solver::pool::PoolSettings;
use protocol::transport::shared_memory::Waiting;
use scene_reader::JOBS_A_MESSAGE;
use std::num::NonZeroUsize;

/// Rounds of a comparison of batches.
const ROUNDS: usize = 7;

/// Jobs per message: the least, and what a run sends.
const SLICES: [NonZeroUsize; 2] = [NonZeroUsize::MIN, JOBS_A_MESSAGE];

pub(super) fn run(effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    overhead(effort, report)?;
    waits(effort, report)
}

/// P-5: calls of nothing compared with calls of 400 discs, one worker, with one job in a message and with as many as in a run.
fn overhead(effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    let heads = ["jobs_per_message", "rve", "call_us", "share_percent", "thread_us", "share_of_thread_time_percent"];
    let mut table = Table::new(heads);
    let mut notes = Vec::new();
    for slice in SLICES {
        let open = |role, definition, points| {
            let settings = |settings: &mut PoolSettings| settings.jobs_per_message = slice;
            StudyPool::open_with(role, definition, 1, points, Waiting::Block, settings)
        };
        let mut pools = Vec::new();
        for snapshot in EMPTY_SNAPSHOTS {
            pools.push(open(Some(Role::Idle), idle_definition(snapshot), effort.choose(512, 32))?);
        }
        pools.push(open(None, grain_definition()?, effort.choose(32, 2))?);
        let mut processors = vec![Vec::new(); pools.len()];
        let calls = interleaved(effort.choose(ROUNDS, 1), pools.len(), |index| {
            let before = pools[index].processor_seconds();
            let wall = pools[index].round()?;
            let used = pools[index].processor_seconds() - before;
            processors[index].push(1e6 * used / pools[index].points() as f64);
            anyhow::Ok(wall)
        })?;
        let (grains, grains_processor) = calls.last().zip(processors.last()).context("grains were measured")?;
        let names = EMPTY_SNAPSHOTS.map(|length| format!("no grains, snapshot of {length} B"));
        let names = names.into_iter().chain(["400 discs, strain 1e-4, tangent".to_owned()]);
        for ((name, samples), processor) in names.zip(&calls).zip(&processors) {
            table.row([
                slice.get().into(),
                name.into(),
                median(samples).into(),
                (100.0 * ratio(samples, grains)).into(),
                median(processor).into(),
                (100.0 * ratio(processor, grains_processor)).into(),
            ]);
        }
        let figures = pools.last().context("grains were measured")?.statistics();
        let total = figures.rve_s + figures.tangent_s + figures.transport_s + figures.idle_s;
        notes.push(format!(
            "{slice} a message: of the time of the worker that solved grains, {:.2} % transport (restoring, writing, \
             checking and moving messages, macro's share included), {:.2} % waiting",
            100.0 * figures.transport_s / total,
            100.0 * figures.idle_s / total
        ));
    }
    let heading = "One RVE call, worker process and pool together, one worker, two messages in flight; shares of the \
                   call of 400 discs";
    report.table("calls", heading, &table)?;
    report.note(
        "`thread_us`: processor time of the pool's and of the worker's thread, which other work on the machine does not \
         lengthen; `call_us`: wall time.",
    )?;
    notes.iter().try_for_each(|note| report.note(note))?;
    Ok(())
}

/// Whether another wait mode makes a batch of grains faster, with as many workers as cores.
fn waits(effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get);
    let workers = cores.min(effort.choose(16, 1));
    let points = effort.choose(16, 2) * workers;
    // A spinning pool takes cores even while it idles, so each is opened for its own sample only.
    let calls = interleaved(effort.choose(ROUNDS, 1), Waiting::ALL.len(), |index| -> anyhow::Result<f64> {
        let mut pool = StudyPool::open(None, grain_definition()?, workers, points, Waiting::ALL[index])?;
        pool.round()
    })?;
    let mut table = Table::new(["waiting", "workers", "call_us", "to_block"]);
    for (waiting, samples) in Waiting::ALL.into_iter().zip(&calls) {
        let to_block = ratio(samples, &calls[0]);
        table.row([waiting.keyword().into(), workers.into(), median(samples).into(), to_block.into()]);
    }
    report.table("waits", "Ways to wait, 400 discs, as many workers as cores; wall time per call", &table)?;
    Ok(())
}
