//! Progress on standard error: a bar with the time left on a terminal, a line per step elsewhere.

use crate::stderr::tell;
use indicatif::{ProgressBar, ProgressStyle};
use macro_solver::observer::{CutBack, FieldsView, IterationReport, Observer, Stabilised, StepReport, StopRequest};
use macro_solver::problem::Problem;
use std::io::IsTerminal;
use std::time::{Duration, Instant};

/// Positions of the bar over the whole path.
const RESOLUTION: f64 = 1000.0;

/// Where there is no terminal: after as long without a line, iterations have one too.
const BETWEEN_LINES: Duration = Duration::from_secs(10);

/// Displays the progress of a run.
#[derive(Debug)]
pub(super) struct ProgressDisplay {
    view: View,
    begun: Instant,
    /// When the last line of a step or an iteration was written.
    last_line: Instant,
    /// Share of the path at the first step seen: a continued run does not begin at 0.
    first: Option<f64>,
    /// Names of the stages, if there are several.
    stages: Vec<String>,
}

#[derive(Debug)]
enum View {
    Bar(ProgressBar),
    Lines,
    Nothing,
}

impl ProgressDisplay {
    /// A bar if standard error is a terminal, lines if not, nothing if `quiet`.
    pub(super) fn new(quiet: bool) -> Self {
        let view = if quiet {
            View::Nothing
        } else if std::io::stderr().is_terminal() {
            View::Bar(bar())
        } else {
            View::Lines
        };
        let now = Instant::now();
        Self { view, begun: now, last_line: now, first: None, stages: Vec::new() }
    }

    fn print(&self, line: &str) {
        match &self.view {
            View::Bar(bar) => bar.println(line),
            View::Lines => tell(line),
            View::Nothing => {}
        }
    }
}

fn bar() -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:30} {percent:>3} %  {elapsed} / left {eta}  {msg}")
        .expect("the template is a constant");
    let bar = ProgressBar::new(RESOLUTION as u64).with_style(style);
    bar.enable_steady_tick(Duration::from_millis(500));
    bar
}

impl Observer for ProgressDisplay {
    fn started(&mut self, problem: &Problem) -> Result<(), StopRequest> {
        if problem.stages.len() > 1 {
            self.stages = problem.stages.iter().map(|stage| format!("{}  ", stage.name)).collect();
        }
        Ok(())
    }

    fn iterated(&mut self, report: &IterationReport) {
        let text =
            || format!("step {} iteration {}: residual {:.1e}", report.step, report.iteration, report.force_ratio);
        match &self.view {
            View::Bar(bar) => bar.set_message(text()),
            View::Lines if self.last_line.elapsed() > BETWEEN_LINES => {
                self.last_line = Instant::now();
                tell(text());
            }
            View::Lines | View::Nothing => {}
        }
    }

    fn accepted(&mut self, report: &StepReport, _fields: &FieldsView<'_>) -> Result<(), StopRequest> {
        let first = *self.first.get_or_insert(report.share);
        match &self.view {
            View::Bar(bar) => bar.set_position((report.share * RESOLUTION) as u64),
            View::Lines => {
                self.last_line = Instant::now();
                let elapsed = self.begun.elapsed().as_secs_f64();
                let covered = report.share - first;
                let left = if covered > 0.0 { elapsed / covered * (1.0 - report.share) } else { f64::NAN };
                let left = if left.is_nan() { String::new() } else { format!(", about {left:.0} s left") };
                let stage = self.stages.get(report.stage).map_or("", String::as_str);
                tell(format_args!(
                    "step {:>3}  {stage}load {:.4}  {:>2} iterations  {:>5} evaluations  residual {:.1e}  {elapsed:.1} s{left}",
                    report.step, report.load, report.iterations, report.evaluations, report.force_ratio
                ));
            }
            View::Nothing => {}
        }
        Ok(())
    }

    fn cut_back(&mut self, event: &CutBack) {
        self.print(&format!(
            "step {:>3}  cut back from {:.2e} to {:.2e} of the path after {} iterations, {} evaluations: {}",
            event.step, event.from, event.to, event.cost.iterations, event.cost.evaluations, event.reason
        ));
    }

    fn stabilised(&mut self, event: &Stabilised) {
        self.print(&format!(
            "step {:>3}  stabilised: equilibrium after {} increments (largest residual {:.1e}): {}",
            event.step, event.increments, event.largest_imbalance, event.reason
        ));
    }

    fn finished(&mut self, _run: &macro_solver::observer::Run) {
        if let View::Bar(bar) = &self.view {
            bar.finish_and_clear();
        }
    }
}
