//! The measurement itself: what can be distinguished from noise on this machine.

use crate::effort::Effort;
use crate::repeat::{interleaved, median, quantile, ratio};
use crate::report::Report;
use crate::table::Table;
use charts::{Chart, Scale};
use std::convert::Infallible;
use std::hint::black_box;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

/// Additions of one burst of work: about a millisecond.
const BURST: u64 = 1_000_000;

/// Between two wake-ups.
const ASLEEP: Duration = Duration::from_micros(200);

/// Measures the clock, the wake-up of a thread, and how steady a fixed burst of arithmetic is.
///
/// # Errors
/// The report cannot be written.
pub(super) fn run(effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    let rounds = effort.choose(200, 20);
    let clock: Vec<f64> = (0..10 * rounds).map(|_| microseconds(|| ())).collect();
    let wakes = wake_ups(effort.choose(2_000, 100));
    let bursts = interleaved::<Infallible>(rounds, 2, |_| Ok(microseconds(|| _ = black_box(burst()))));
    let Ok(bursts) = bursts;
    let mut table = Table::new(["quantity", "median_us", "p10_us", "p90_us", "samples"]);
    for (name, samples) in
        [("two looks at the clock", &clock), ("waking a thread, there and back", &wakes), ("burst", &bursts[0])]
    {
        let [low, high] = [0.1, 0.9].map(|share| quantile(samples, share));
        table.row([name.into(), median(samples).into(), low.into(), high.into(), samples.len().into()]);
    }
    report.table("self-test", "Resolution of measurements on this machine", &table)?;
    let equal = ratio(&bursts[1], &bursts[0]);
    report.note(&format!("two equal bursts, ratio within rounds: {equal:.3} (1 on a steady machine)"))?;
    let mut chart = Chart::new("steadiness", ("round", Scale::Linear), ("burst, us", Scale::Linear));
    for (name, samples) in [("first", &bursts[0]), ("second", &bursts[1])] {
        chart.curve(name, samples.iter().enumerate().map(|(round, time)| [round as f64, *time]));
    }
    report.chart("steadiness", &chart)?;
    let mut chart = Chart::new("wake-ups", ("time, us", Scale::Logarithmic), ("share below", Scale::Linear));
    let shares = (1..100).map(|percent| f64::from(percent) / 100.0);
    chart.curve("there and back", shares.map(|share| [quantile(&wakes, share), share]));
    report.chart("wake-ups", &chart)?;
    Ok(())
}

fn microseconds(work: impl FnOnce()) -> f64 {
    let begin = Instant::now();
    work();
    begin.elapsed().as_secs_f64() * 1e6
}

fn burst() -> f64 {
    (0..BURST).fold(0.0, |sum, term| black_box(sum) + term as f64)
}

/// Times of a word to another thread and back, both waiting in the kernel, us.
fn wake_ups(count: usize) -> Vec<f64> {
    let (request, requests) = channel::<()>();
    let (answer, answered) = channel::<()>();
    let partner = std::thread::spawn(move || while requests.recv().is_ok() && answer.send(()).is_ok() {});
    let once = || {
        // Long enough for the partner to fall asleep.
        std::thread::sleep(ASLEEP);
        microseconds(|| {
            let _ = request.send(()).map(|()| answered.recv());
        })
    };
    let times = std::iter::repeat_with(once).take(count).collect();
    drop(request);
    let _ = partner.join();
    times
}
