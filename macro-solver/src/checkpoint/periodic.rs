//! When checkpoints are written, and what they cost.

use super::archive::Archive;
use super::file::CheckpointFile;
use super::{CheckpointStore, Progress};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};

/// A checkpoint that is due by time waits until this many times its own cost has passed, so that at most about 5 % of a
/// run goes into writing.
const LEAST_PAUSE: u32 = 20;

/// A state that takes longer to collect is not collected after every step, but as seldom as checkpoints that are due by time.
const COSTLY: Duration = Duration::from_millis(2);

/// When checkpoints are written, in addition to the one at the end of a run that did not reach its end.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct CheckpointPolicy {
    /// Whether checkpoints are written; false: also not at the end of a run that stops early. That one is the state after the last step, or
    /// where a state takes more than 2 ms to collect, one of at most 20 times as long before.
    pub enabled: bool,
    /// A checkpoint after every n accepted steps.
    #[schemars(range(min = 1), extend("x-default" = "none"))]
    pub steps: Option<u64>,
    /// A checkpoint after the first step that ends this long after the last checkpoint, and not before 20 times the cost of the last
    /// one has passed.
    #[serde(rename = "seconds", with = "keys::forms::seconds")]
    #[schemars(with = "f64", extend("x-unit" = "s"), range(min = 0.0, max = 2_678_400.0))]
    pub pause: Duration,
}

impl Default for CheckpointPolicy {
    fn default() -> Self {
        Self { enabled: true, steps: None, pause: Duration::from_secs(30) }
    }
}

/// What checkpoints cost. Sizes and counts of writes depend on the machine's speed; none of them reaches a result.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CheckpointFigures {
    /// Checkpoints written.
    pub written: u64,
    /// Checkpoints that could not be written.
    pub failed: u64,
    /// Why the last of these could not.
    pub last_failure: Option<String>,
    /// Size of the last one, bytes.
    pub bytes: u64,
    /// Time spent collecting and writing, s.
    pub seconds: f64,
    /// Processes that have continued this run.
    pub resumed: u64,
}

/// Collects the state after steps and writes it when it is due.
pub struct PeriodicCheckpoints<'a> {
    file: CheckpointFile,
    policy: CheckpointPolicy,
    earlier: Option<Archive>,
    /// Adds the description of the run to every archive, with the figures so far.
    description: Box<dyn Fn(&mut Archive, Progress, &CheckpointFigures) + 'a>,
    /// State that was collected last, if it is not on the disk.
    pending: Option<Archive>,
    /// Whether that, or the one on the disk, is the state after the last accepted step.
    is_latest: bool,
    /// When it was collected, and how long that took.
    collected: Instant,
    collecting: Duration,
    steps: u64,
    last: Instant,
    last_cost: Duration,
    figures: CheckpointFigures,
}

impl<'a> PeriodicCheckpoints<'a> {
    /// A store that continues from `earlier`. `figures` are those of the processes before.
    pub fn new(
        file: CheckpointFile,
        policy: CheckpointPolicy,
        earlier: Option<Archive>,
        figures: CheckpointFigures,
        description: impl Fn(&mut Archive, Progress, &CheckpointFigures) + 'a,
    ) -> Self {
        Self {
            file,
            policy,
            earlier,
            description: Box::new(description),
            pending: None,
            is_latest: true,
            collected: Instant::now(),
            collecting: Duration::ZERO,
            steps: 0,
            last: Instant::now(),
            last_cost: Duration::ZERO,
            figures,
        }
    }

    /// Writes the state that was collected last unless it is on the disk: on request, and at the end of a run that is not complete.
    /// A state that cannot be written is kept for the next time; then the reason is returned.
    pub fn flush(&mut self) -> Result<(), String> {
        let Some(archive) = self.pending.take() else { return Ok(()) };
        let begun = Instant::now();
        let is_written = self.write(&archive);
        self.count_cost(begun);
        if is_written {
            return Ok(());
        }
        self.pending = Some(archive);
        Err(self.figures.last_failure.clone().unwrap_or_default())
    }

    /// Collects the state after the last accepted step, `progress`, unless [`save_step`](CheckpointStore::save_step) has done so.
    pub fn collect_latest(&mut self, progress: Progress, fill: &mut dyn FnMut(&mut Archive)) {
        if self.is_latest || !self.policy.enabled {
            return;
        }
        let begun = Instant::now();
        self.pending = Some(self.collect(progress, fill));
        self.is_latest = true;
        self.figures.seconds += begun.elapsed().as_secs_f64();
    }

    fn collect(&mut self, progress: Progress, fill: &mut dyn FnMut(&mut Archive)) -> Archive {
        let begun = Instant::now();
        let mut archive = Archive::new();
        fill(&mut archive);
        (self.description)(&mut archive, progress, &self.figures);
        (self.collected, self.collecting) = (Instant::now(), begun.elapsed());
        archive
    }

    /// What it cost.
    pub fn figures(&self) -> &CheckpointFigures {
        &self.figures
    }

    fn is_due(&self) -> bool {
        let by_steps = self.policy.steps.is_some_and(|steps| self.steps >= steps);
        by_steps || self.last.elapsed() >= self.policy.pause.max(self.last_cost * LEAST_PAUSE)
    }

    /// Whether the checkpoint has been written. One that cannot be is no reason to end a run: the one before it is still there.
    fn write(&mut self, archive: &Archive) -> bool {
        match self.file.write(archive) {
            Ok(bytes) => {
                self.figures.written += 1;
                self.figures.bytes = bytes;
                true
            }
            Err(error) => {
                self.figures.failed += 1;
                self.figures.last_failure = Some(error.to_string());
                tracing::warn!(%error, "the checkpoint could not be written; the run goes on");
                false
            }
        }
    }

    fn count_cost(&mut self, begun: Instant) {
        self.last_cost = begun.elapsed();
        self.figures.seconds += self.last_cost.as_secs_f64();
    }
}

impl CheckpointStore for PeriodicCheckpoints<'_> {
    fn earlier(&mut self) -> Option<Archive> {
        self.earlier.take()
    }

    fn save_step(&mut self, progress: Progress, fill: &mut dyn FnMut(&mut Archive)) {
        if !self.policy.enabled {
            return;
        }
        let begun = Instant::now();
        self.steps += 1;
        let due = self.is_due();
        // Long curves and large bodies would take more time than the steps.
        let is_costly = self.collecting > COSTLY && self.collected.elapsed() < self.collecting * LEAST_PAUSE;
        self.is_latest = due || !is_costly;
        if !self.is_latest {
            return;
        }
        let archive = self.collect(progress, fill);
        if !due {
            self.figures.seconds += begun.elapsed().as_secs_f64();
            self.pending = Some(archive);
            return;
        }
        self.steps = 0;
        // One that the system would not take is tried again when the run ends.
        self.pending = if self.write(&archive) { None } else { Some(archive) };
        self.count_cost(begun);
        self.last = Instant::now();
    }
}
