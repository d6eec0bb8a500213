//! The worker pool: a material law whose points are solved by other processes.
//!
//! The **macro owns the truth**: committed and trial states of every point live here as opaque snapshots, workers only
//! cache them. A trial is a pure function of (committed state, target, options), so any worker may solve any point, a job
//! may be issued twice without harm, and results depend neither on the number of workers nor on the order of arrival.
//! Commit and rollback are local because every answer carries its trial state.
//!
//! [`Pool`] moves messages; `coordinator` decides (no input or output, so tests can play every fault); `batch` holds the
//! jobs of an evaluation, `queue` orders them, `workers` holds the workers, `reply_validation` checks what comes in.

mod batch;
mod checkpoint;
mod coordinator;
mod cost_model;
mod interrupt;
mod points;
mod queue;
mod recycling;
mod reply_validation;
mod report;
mod settings;
mod statistics;
mod supply;
#[cfg(test)]
mod tests;
mod workers;

pub use interrupt::Interrupt;
pub use points::PointState;
pub use report::{Reporter, WorkerReport};
pub use settings::{HangPolicy, PoolSettings, Recycling};
pub use statistics::{DefinitionStatistics, PoolStatistics, SolvedTrials, WorkerStatistics};
pub use supply::{JoiningWorkers, SupplyStatus, WorkerSupply};

use crate::checkpoint::{Archive, CheckpointError, FailureCase};
use crate::material::{MaterialError, PointId, PointMaterial, PointTrial};
use batch::Batch;
use coordinator::{Action, Coordinator};
use points::PointTable;
use protocol::control::ToWorker;
use protocol::process::resident_mebibytes;
use protocol::transport::{MacroPort, TransportError, Waker};
use protocol::{Definition, DefinitionId, TrialResult};
use std::sync::Arc;
use std::time::{Duration, Instant};
use workers::process_stats::process_stat;

/// Time between two checks of the processes of busy workers.
const CHECK_INTERVAL: Duration = Duration::from_millis(500);

/// The same while a worker is stopped, so that its end comes in time.
const CLOSE_CHECK_INTERVAL: Duration = Duration::from_millis(50);

/// Longest time between two checks of supply and deadlines.
const LONGEST_WAIT: Duration = Duration::from_secs(1);

/// Time that workers have to leave before they are ended.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(2);

/// A pool of workers behind one port.
pub struct Pool<P: MacroPort> {
    coordinator: Coordinator,
    next_job: u64,
    /// Begin of a wait without any worker; time between evaluations does not count.
    unserved_since: Option<Instant>,
    clock: Instant,
    /// When the busy workers were last checked at, and whether one of them was stopped.
    checked: Instant,
    any_stopped: bool,
    reporter: Option<Reporter>,
    /// See [`Pool::refused_trial`].
    refused_trial: Option<usize>,
    interrupt: Interrupt,
    closed: bool,
    // Dropped in this order: processes end before the channels they use are removed.
    supply: Box<dyn WorkerSupply>,
    port: P,
}

impl<P: MacroPort> Pool<P> {
    /// A pool whose point `p` starts in the initial state of `definitions[made_of[p]]`.
    ///
    /// # Panics
    /// When `made_of` names a definition that was not given.
    pub fn new(
        port: P,
        supply: Box<dyn WorkerSupply>,
        interrupt: Interrupt,
        settings: PoolSettings,
        definitions: Vec<Definition>,
        made_of: &[usize],
    ) -> Self {
        let groups = settings.groups(definitions.len());
        let coordinator = Coordinator::new(settings, PointTable::new(definitions, groups, made_of));
        let now = Instant::now();
        Self {
            coordinator,
            next_job: 0,
            unserved_since: Some(now),
            clock: now,
            checked: now,
            any_stopped: false,
            reporter: None,
            refused_trial: None,
            interrupt,
            closed: false,
            supply,
            port,
        }
    }

    /// A handle that interrupts waiting; raise the [`Interrupt`] first.
    pub fn waker(&self) -> Arc<dyn Waker> {
        self.port.waker()
    }

    /// Waits until `count` workers serve, or no more can come, or the timeout of the settings is over, so that a worker that
    /// cannot take part is refused before the run begins.
    ///
    /// # Errors
    /// [`MaterialError::WorkersLost`] when none will come, [`MaterialError::Interrupted`].
    pub fn gather(&mut self, count: usize) -> Result<(), MaterialError> {
        let begin = Instant::now();
        self.unserved_since = None;
        while self.coordinator.workers.active() < count || !self.coordinator.is_served() {
            let more_may_come = matches!(self.supply.tend(), SupplyStatus::Expected { .. })
                && begin.elapsed() < self.coordinator.settings.worker_timeout;
            if !more_may_come && self.coordinator.is_served() {
                break;
            }
            self.listen()?;
        }
        Ok(())
    }

    /// Number of workers that serve now.
    pub fn workers(&self) -> usize {
        self.coordinator.workers.active()
    }

    /// Process ids of the workers that serve now.
    pub fn worker_processes(&self) -> Vec<u32> {
        let workers = &self.coordinator.workers;
        workers.iter().filter(|(worker, _)| workers.is_active(*worker)).map(|(_, known)| known.pid).collect()
    }

    /// What the pool did so far.
    pub fn statistics(&self) -> PoolStatistics {
        let mut statistics = self.coordinator.statistics.clone();
        // On top of those of the earlier processes of a resumed run.
        statistics.worker_restarts += self.supply.restarts();
        statistics
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.coordinator.points.records.len()
    }

    /// Adds `count` points that start in the initial state of the definition with this index, and returns the number of the first;
    /// for callers whose points are not known when the pool opens.
    ///
    /// # Panics
    /// When there is no such definition.
    pub fn add_points(&mut self, definition: usize, count: usize) -> PointId {
        self.coordinator.points.add(definition, count)
    }

    /// From now on this interrupt ends evaluations early. An evaluation that it has ended leaves all committed states as they
    /// were; the pool serves on.
    pub fn follow_interrupt(&mut self, interrupt: Interrupt) {
        self.interrupt = interrupt;
    }

    /// Definition and committed state of a point, for grain output and checkpoints. No bytes mean the initial state of
    /// the definition.
    pub fn committed_snapshot(&self, point: PointId) -> (DefinitionId, &PointState) {
        let record = &self.coordinator.points.records[point];
        (self.coordinator.points.definitions[record.definition].0, &record.committed)
    }

    /// Replaces the committed state of a point by another snapshot of the same definition and drops its trial; for callers that
    /// keep snapshots themselves. A run restores all points at once from an [`Archive`].
    pub fn restore_point(&mut self, point: PointId, state: PointState) {
        let record = &mut self.coordinator.points.records[point];
        record.committed = state;
        record.trial = None;
    }

    /// Whether a point has a trial since its last commit or rollback.
    pub fn has_trial(&self, point: PointId) -> bool {
        self.coordinator.points.records[point].trial.is_some()
    }

    /// As [`PointMaterial::commit`], for one point.
    pub fn commit_point(&mut self, point: PointId) {
        self.coordinator.points.records[point].commit();
    }

    /// As [`PointMaterial::rollback`], for one point.
    pub fn rollback_point(&mut self, point: PointId) {
        self.coordinator.points.records[point].trial = None;
    }

    /// Dismisses every worker and returns when they are gone; those that do not leave are ended. Called by `Drop`
    /// if not before; further evaluations fail.
    pub fn close(&mut self) {
        if self.closed {
            return;
        }
        self.closed = true;
        for (worker, _) in self.coordinator.workers.iter() {
            // A worker that is gone needs no farewell.
            let _ = self.port.send_control(worker, &ToWorker::Bye);
        }
        self.wait_for_departure();
        let overdue: Vec<_> = self.coordinator.workers.iter().map(|(worker, _)| worker).collect();
        for worker in &overdue {
            self.port.kill(*worker);
        }
        if !overdue.is_empty() {
            self.wait_for_departure();
        }
        self.supply.finish();
    }

    fn wait_for_departure(&mut self) {
        // Departures after the end of the run are no losses: they must not touch the statistics.
        let end = Instant::now() + CLOSE_TIMEOUT;
        while !self.coordinator.workers.is_empty() {
            let left = end.saturating_duration_since(Instant::now());
            let workers = &mut self.coordinator.workers;
            let heard = self.port.poll(left.min(Duration::from_millis(50)), &mut |event| {
                use protocol::transport::MacroEvent::{CutOff, Lost};
                if let Lost(worker, _) | CutOff(worker, _) = event {
                    workers.remove(worker);
                }
            });
            if heard.is_err() || left.is_zero() {
                return;
            }
        }
    }

    /// Sends what can be sent, then waits for something to happen and deals with it.
    fn listen(&mut self) -> Result<(), MaterialError> {
        if self.interrupt.is_raised() {
            return Err(MaterialError::Interrupted);
        }
        if self.closed {
            return Err(MaterialError::WorkersLost("the pool is closed".into()));
        }
        self.account_time();
        self.dispatch()?;
        let wait = self.tend()?;
        let coordinator = &mut self.coordinator;
        let mut handling = Duration::ZERO;
        let heard = self.port.poll(wait, &mut |event| {
            let arrival = Instant::now();
            coordinator.handle(event, arrival);
            handling += arrival.elapsed();
        });
        heard.map_err(channel)?;
        self.coordinator.statistics.macro_transport_s += handling.as_secs_f64();
        self.check_workers();
        self.coordinator.terminate_hung(Instant::now());
        self.act();
        match self.coordinator.fatal.take() {
            Some(fatal) => Err(fatal),
            None => Ok(()),
        }
    }

    /// At intervals: checks the processes of busy workers and makes the report, if one was requested.
    fn check_workers(&mut self) {
        let now = Instant::now();
        let pause = if self.any_stopped { CLOSE_CHECK_INTERVAL } else { CHECK_INTERVAL };
        if now.duration_since(self.checked) < pause {
            return;
        }
        self.checked = now;
        self.any_stopped = self.coordinator.workers.check(now, process_stat);
        self.coordinator.retire_after_growth(resident_mebibytes);
        if let Some(reporter) = &mut self.reporter {
            reporter(&report::of(&self.coordinator, now));
        }
    }

    /// Reports to `reporter` about once a second, while the pool waits for answers, what every worker does.
    pub fn report_to(&mut self, reporter: impl FnMut(&[WorkerReport]) + 'static) {
        self.reporter = Some(Box::new(reporter));
    }

    /// Place of the trial that the [`MaterialError::Point`] of the latest evaluation is about; its point may have had several.
    pub fn refused_trial(&self) -> Option<usize> {
        self.refused_trial
    }

    /// The trial that has ended too many workers, with all that is needed to repeat it.
    pub fn quarantined(&self) -> Option<&FailureCase> {
        self.coordinator.quarantined.as_ref()
    }

    fn dispatch(&mut self) -> Result<(), MaterialError> {
        while let Some(message) = self.coordinator.next_message(Instant::now()) {
            let begin = Instant::now();
            let mut sent = Ok(());
            for &definition in &message.define {
                let definition = self.coordinator.points.definitions[definition].1.clone();
                sent = sent.and_then(|()| self.port.send_control(message.worker, &ToWorker::Define { definition }));
            }
            let sent = sent.and_then(|()| self.port.send_jobs(message.worker, &self.coordinator.loaded(&message)));
            self.coordinator.statistics.macro_transport_s += begin.elapsed().as_secs_f64();
            match sent {
                Ok(()) => {}
                Err(error @ TransportError::TooLarge { .. }) => return Err(channel(error)),
                Err(error) => self.coordinator.undeliverable(message.worker, &error.to_string()),
            }
        }
        self.act();
        Ok(())
    }

    fn act(&mut self) {
        for action in std::mem::take(&mut self.coordinator.actions) {
            match action {
                Action::Send(worker, message) => {
                    if let Err(error) = self.port.send_control(worker, &message) {
                        self.coordinator.undeliverable(worker, &error.to_string());
                    }
                }
                Action::Kill(worker) => self.port.kill(worker),
                Action::Joined(pid) => self.supply.joined(pid),
                Action::Refused(pid, reason) => self.supply.refused(pid, &reason),
                Action::Gone(pid, had_answered) => self.supply.lost(pid, had_answered),
                Action::Left(pid, had_answered) => self.supply.left(pid, had_answered),
            }
        }
    }

    /// Looks after the supply and returns how long to wait for events.
    fn tend(&mut self) -> Result<Duration, MaterialError> {
        let now = Instant::now();
        let outlook = self.supply.tend();
        let mut wait = LONGEST_WAIT;
        if let Some(deadline) = self.coordinator.workers.next_deadline() {
            wait = wait.min(deadline.saturating_duration_since(now));
        }
        if let Some(awake) = self.coordinator.batch.next_release() {
            wait = wait.min(awake.saturating_duration_since(now));
        }
        if self.coordinator.is_served() {
            self.unserved_since = None;
        } else {
            let since = *self.unserved_since.get_or_insert(now);
            let worker_timeout = self.coordinator.settings.worker_timeout;
            let left = worker_timeout.saturating_sub(now.duration_since(since));
            let trouble =
                self.coordinator.last_trouble.as_deref().map_or(String::new(), |text| format!("; last: {text}"));
            if let SupplyStatus::Exhausted(reason) = &outlook {
                return Err(MaterialError::WorkersLost(format!("no workers are left: {reason}{trouble}")));
            }
            if left.is_zero() {
                let text = format!(
                    "no worker has joined run `{}` for {} s{trouble}",
                    self.coordinator.settings.run,
                    worker_timeout.as_secs_f64()
                );
                return Err(MaterialError::WorkersLost(text));
            }
            wait = wait.min(left);
        }
        if self.any_stopped {
            wait = wait.min(CLOSE_CHECK_INTERVAL);
        }
        if let SupplyStatus::Expected { check_again } = outlook {
            wait = wait.min(check_again);
        }
        Ok(wait)
    }

    /// Books the time since the last call as worker time.
    fn account_time(&mut self) {
        let now = Instant::now();
        let passed = now.duration_since(self.clock).as_secs_f64();
        self.clock = now;
        // Busy time is booked against it when the evaluation ends.
        self.coordinator.statistics.idle_s += passed * self.coordinator.workers.active() as f64;
    }

    fn solve(&mut self, trials: &[PointTrial]) -> Result<Batch, MaterialError> {
        let coordinator = &mut self.coordinator;
        let workers = &coordinator.workers;
        let affinity = |state: &PointState| state.holder.filter(|worker| workers.is_active(*worker));
        coordinator.batch =
            Batch::build(trials, &coordinator.points, self.next_job, coordinator.settings.deduplicate, affinity);
        self.next_job += coordinator.batch.jobs.len() as u64;
        while !self.coordinator.batch.is_finished() {
            self.listen()?;
        }
        let finished = std::mem::replace(&mut self.coordinator.batch, Batch::nothing(self.next_job));
        self.coordinator.statistics.duplicates_skipped += (trials.len() - finished.jobs.len()) as u64;
        self.coordinator.statistics.duplicate_force_evaluations += finished.shared_force_evaluations();
        Ok(finished)
    }

    /// Answers in the order of the trials, whose states are kept; or the reason of the lowest failing point.
    fn collect(&mut self, trials: &[PointTrial], batch: Batch) -> Result<Vec<TrialResult>, MaterialError> {
        if let Some((place, reason)) = batch.lowest_failure(trials) {
            self.refused_trial = Some(place);
            return Err(MaterialError::Point { point: trials[place].point, reason });
        }
        let mut answers = Vec::with_capacity(trials.len());
        for (trial, (mut answer, state)) in trials.iter().zip(batch.into_answers()) {
            let record = &mut self.coordinator.points.records[trial.point];
            record.cost_model.learn(trial, &answer.cost);
            record.trial = Some(state);
            // Messages hold zeros in the place of what does not exist; from here on it is no number.
            if let Some(lacking) = self.coordinator.settings.lacking.get(record.definition) {
                answer.observed = answer.observed.without(lacking);
            }
            answers.push(answer);
        }
        Ok(answers)
    }
}

impl<P: MacroPort> PointMaterial for Pool<P> {
    fn evaluate(&mut self, trials: &[PointTrial]) -> Result<Vec<TrialResult>, MaterialError> {
        // After a failure no trial of these points may be mistaken for an answer to this call.
        for trial in trials {
            self.coordinator.points.records[trial.point].trial = None;
        }
        self.refused_trial = None;
        self.clock = Instant::now();
        self.unserved_since = None;
        let begin = self.clock;
        let busy = busy_seconds(&self.coordinator.statistics);
        let outcome = self.solve(trials);
        self.account_time();
        let statistics = &mut self.coordinator.statistics;
        statistics.idle_s = (statistics.idle_s - (busy_seconds(statistics) - busy)).max(0.0);
        statistics.wall_s += begin.elapsed().as_secs_f64();
        let answers = self.collect(trials, outcome?)?;
        self.coordinator.statistics.evaluations += answers.len() as u64;
        Ok(answers)
    }

    fn commit(&mut self) -> Result<(), MaterialError> {
        self.coordinator.points.commit();
        Ok(())
    }

    fn rollback(&mut self) {
        self.coordinator.points.rollback();
    }

    fn mark(&mut self) {
        self.coordinator.points.mark();
    }

    fn return_to_mark(&mut self) {
        self.coordinator.points.return_to_mark();
    }

    fn copy_state(&mut self, from: PointId, to: PointId) {
        self.coordinator.points.copy(from, to);
    }

    fn save(&self, archive: &mut Archive) {
        checkpoint::save(&self.coordinator, self.statistics(), archive);
    }

    fn restore(&mut self, archive: &Archive) -> Result<(), CheckpointError> {
        checkpoint::restore(&mut self.coordinator, archive)
    }
}

impl<P: MacroPort> Drop for Pool<P> {
    fn drop(&mut self) {
        self.close();
    }
}

fn busy_seconds(statistics: &PoolStatistics) -> f64 {
    statistics.workers.iter().map(|worker| worker.busy_s).sum()
}

fn channel(error: TransportError) -> MaterialError {
    MaterialError::Channel(error.to_string())
}
