//! Real grains on more and more workers (P-5): wall time with fixed work and with fixed work per worker, and the serial
//! part, once from Amdahl's law and once from processor time, which a busy machine does not blur.

use crate::effort::Effort;
use crate::repeat::{interleaved, median, ratio};
use crate::report::Report;
use crate::table::Table;
use crate::workers::{StudyPool, grain_definition, processor_seconds};
use charts::{Chart, Scale};
use macro_solver::pool::PoolSettings;
use protocol::transport::shared_memory::Waiting;
use scene_reader::JOBS_A_MESSAGE;

/// Points of the fixed work; a fourth of it is the work of one worker in the other series.
const POINTS: usize = 256;

/// Measures both series.
///
/// # Errors
/// Workers cannot be started or are lost, or the report cannot be written.
pub(super) fn run(effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get);
    let counts: Vec<usize> = [1, 2, 4, 8, 16].into_iter().filter(|count| *count <= 2 * cores).collect();
    let counts = effort.choose(counts, vec![1, 2]);
    let points = effort.choose(POINTS, 8);
    let strong = series(effort, &counts, |_| points)?;
    let weak = series(effort, &counts, |workers| workers * points / 4)?;

    let heads = ["series", "workers", "points", "wall_ms", "speed_up", "efficiency", "macro_us", "worker_us"];
    let mut table = Table::new(heads);
    let mut chart = Chart::new("scaling", ("workers", Scale::Linear), ("efficiency", Scale::Linear));
    for (name, found) in [("fixed work", &strong), ("work per worker", &weak)] {
        for one in found.iter() {
            let growth = one.points as f64 / found[0].points as f64;
            let speed_up = growth * ratio(&found[0].wall, &one.wall);
            table.row([
                name.into(),
                one.workers.into(),
                one.points.into(),
                (1e3 * median(&one.wall)).into(),
                speed_up.into(),
                (speed_up / one.workers as f64).into(),
                one.macro_microseconds.into(),
                one.worker_microseconds.into(),
            ]);
        }
        let efficiency = |one: &Measured| {
            one.points as f64 / found[0].points as f64 * ratio(&found[0].wall, &one.wall) / one.workers as f64
        };
        chart.curve(name, found.iter().map(|one| [one.workers as f64, efficiency(one)]));
    }
    report.table("scaling", "400 discs, one increment of 1e-4 per call", &table)?;
    report.chart("scaling", &chart)?;
    if counts.iter().any(|count| *count > cores) {
        report.note(&format!("More workers than the {cores} cores can only show that nothing is lost."))?;
    }
    let speed_ups: Vec<[f64; 2]> = strong
        .iter()
        .filter(|one| one.workers <= cores)
        .map(|one| [one.workers as f64, ratio(&strong[0].wall, &one.wall)])
        .collect();
    let fitted = amdahl(&speed_ups);
    let serial = strong[0].macro_microseconds / (strong[0].macro_microseconds + strong[0].worker_microseconds);
    report.note(&format!(
        "serial part: {:.2} % by Amdahl's law from wall times up to {cores} workers; {:.3} % by processor time, which \
         allows an efficiency of {:.1} % at 8 and {:.1} % at 64 workers",
        100.0 * fitted,
        100.0 * serial,
        100.0 / (1.0 + 7.0 * serial),
        100.0 / (1.0 + 63.0 * serial),
    ))?;
    report
        .note("`macro_us`, `worker_us`: processor time per call of the pool's thread and of the workers together.")?;
    Ok(())
}

/// One number of workers.
struct Measured {
    workers: usize,
    points: usize,
    /// Wall time of a batch, one per round, s.
    wall: Vec<f64>,
    macro_microseconds: f64,
    worker_microseconds: f64,
}

fn series(effort: &Effort, counts: &[usize], points: impl Fn(usize) -> usize) -> anyhow::Result<Vec<Measured>> {
    let definition = grain_definition()?;
    let as_in_a_run = |settings: &mut PoolSettings| settings.jobs_per_message = JOBS_A_MESSAGE;
    let open = |workers: &usize| {
        StudyPool::open_with(None, definition.clone(), *workers, points(*workers), Waiting::Block, as_in_a_run)
    };
    let mut pools = counts.iter().map(open).collect::<anyhow::Result<Vec<_>>>()?;
    // The first batch builds cells and touches memory for the first time.
    pools.iter_mut().try_for_each(|pool| pool.round().map(|_| ()))?;
    let mut processor = vec![[0.0; 2]; pools.len()];
    let rounds = effort.choose(5, 1);
    let wall = interleaved(rounds, pools.len(), |index| -> anyhow::Result<f64> {
        let pool = &mut pools[index];
        let before = [processor_seconds("thread-self"), pool.worker_seconds()];
        let time = pool.round()?;
        let after = [processor_seconds("thread-self"), pool.worker_seconds()];
        (0..2).for_each(|who| processor[index][who] += after[who] - before[who]);
        Ok(time * points(counts[index]) as f64 * 1e-6)
    })?;
    let measured = counts.iter().zip(wall).zip(processor).map(|((workers, wall), processor)| {
        let calls = (rounds * points(*workers)) as f64;
        let [macro_microseconds, worker_microseconds] = processor.map(|seconds| 1e6 * seconds / calls);
        Measured { workers: *workers, points: points(*workers), wall, macro_microseconds, worker_microseconds }
    });
    Ok(measured.collect())
}

/// Serial part `s` of `1/S = s + (1 - s)/W` by least squares over points `[W, S]`; NaN when only one worker was measured.
fn amdahl(speed_ups: &[[f64; 2]]) -> f64 {
    // 1/S - 1/W = s (1 - 1/W)
    let (mut over, mut under) = (0.0, 0.0);
    for [workers, speed_up] in speed_ups {
        let rest = 1.0 - 1.0 / workers;
        over += rest * (1.0 / speed_up - 1.0 / workers);
        under += rest * rest;
    }
    over / under
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_serial_part_is_recovered() {
        let law = |workers: f64| [workers, 1.0 / (0.05 + 0.95 / workers)];
        assert!((amdahl(&[law(1.0), law(2.0), law(8.0)]) - 0.05).abs() < 1e-12);
        assert!(amdahl(&[law(1.0)]).is_nan());
    }
}
