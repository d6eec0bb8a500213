//! The worker pool: a material law whose points are solved by other processes.
//!
//! The **macro owns the truth**: committed and trial states of every point live here as opaque snapshots, workers only
//! cache them. A trial is a pure function of (committed state, target, ask), so any worker may answer any point, a job
//! may be asked twice without harm, and results depend neither on the number of workers nor on the order of arrival.
//! Commit and rollback are local because every answer brings its trial state along.
//!
//! [`Pool`] moves messages; `desk` decides (no input or output, so every fault can be played through in tests);
//! `queue` orders jobs, `dispatch` gives them out, `roster` knows the workers, `border` checks what comes in.

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
pub use recycling::Recycling;
pub use report::{Reporter, WorkerReport};
pub use settings::{HangPolicy, PoolSettings};
pub use statistics::{PoolStatistics, WorkerStatistics};
pub use supply::{JoiningWorkers, Outlook, WorkerSupply};

use crate::checkpoint::{Archive, CheckpointError, Reproducer};
use crate::material::{MaterialError, PointId, PointMaterial, PointTrial};
use batch::{Batch, Outcome};
use coordinator::{Action, Desk};
use points::PointTable;
use protocol::control::ToWorker;
use protocol::transport::{LoadedJob, MacroPort, TransportError, Waker};
use protocol::{Definition, DefinitionId, TrialAnswer};
use recycling::resident_mebibytes;
use std::sync::Arc;
use std::time::{Duration, Instant};
use workers::process_stats::Vitals;

/// Time between two looks at the processes of busy workers.
const LOOK: Duration = Duration::from_millis(500);

/// The same while a worker is stopped, so that its end comes in time.
const LOOK_CLOSELY: Duration = Duration::from_millis(50);

/// Longest time between two looks at supply and deadlines.
const LONGEST_WAIT: Duration = Duration::from_secs(1);

/// How long workers may take to leave before they are ended.
const FAREWELL: Duration = Duration::from_secs(2);

/// A pool of workers behind one port.
pub struct Pool<P: MacroPort> {
    desk: Desk,
    next_job: u64,
    /// Since when a wait goes on without any worker; nobody waits between evaluations, so that time does not count.
    deserted_since: Option<Instant>,
    clock: Instant,
    /// When the busy workers were last looked at, and whether one of them was stopped.
    looked: Instant,
    any_stopped: bool,
    reporter: Option<Reporter>,
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
        let desk = Desk::new(settings, PointTable::new(definitions, groups, made_of));
        let now = Instant::now();
        Self {
            desk,
            next_job: 0,
            deserted_since: Some(now),
            clock: now,
            looked: now,
            any_stopped: false,
            reporter: None,
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

    /// Waits until `count` workers serve, or as many as will ever come or have come when the patience of the settings
    /// is over, so that a worker that cannot take part is refused before the run begins.
    ///
    /// # Errors
    /// [`MaterialError::WorkersLost`] when none will come, [`MaterialError::Interrupted`].
    pub fn gather(&mut self, count: usize) -> Result<(), MaterialError> {
        let begin = Instant::now();
        self.deserted_since = None;
        while self.desk.roster.active() < count || !self.desk.is_served() {
            let more_may_come = matches!(self.supply.tend(), Outlook::Expected { .. })
                && begin.elapsed() < self.desk.settings.patience;
            if !more_may_come && self.desk.is_served() {
                break;
            }
            self.listen()?;
        }
        Ok(())
    }

    /// Number of workers that serve now.
    pub fn workers(&self) -> usize {
        self.desk.roster.active()
    }

    /// What the pool did so far.
    pub fn statistics(&self) -> PoolStatistics {
        let mut statistics = self.desk.statistics.clone();
        statistics.worker_restarts = self.supply.restarts();
        statistics
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.desk.points.records.len()
    }

    /// Definition and committed state of a point, for grain output and checkpoints. No bytes mean the initial state of
    /// the definition.
    pub fn committed_snapshot(&self, point: PointId) -> (DefinitionId, &PointState) {
        let record = &self.desk.points.records[point];
        (self.desk.points.definitions[record.definition].0, &record.committed)
    }

    /// Replaces the committed state of a point (from a checkpoint) and forgets its trial.
    pub fn restore_point(&mut self, point: PointId, state: PointState) {
        let record = &mut self.desk.points.records[point];
        record.committed = state;
        record.trial = None;
    }

    /// Sends every worker away and returns when they are gone; those that do not leave are ended. Called by `Drop`
    /// if not before; further evaluations fail.
    pub fn close(&mut self) {
        if self.closed {
            return;
        }
        self.closed = true;
        for (worker, _) in self.desk.roster.iter() {
            // A worker that is gone needs no farewell.
            let _ = self.port.send_control(worker, &ToWorker::Bye);
        }
        self.wait_for_departure();
        let overdue: Vec<_> = self.desk.roster.iter().map(|(worker, _)| worker).collect();
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
        let end = Instant::now() + FAREWELL;
        while !self.desk.roster.is_empty() {
            let left = end.saturating_duration_since(Instant::now());
            let roster = &mut self.desk.roster;
            let heard = self.port.poll(left.min(Duration::from_millis(50)), &mut |event| {
                if let protocol::transport::MacroEvent::Lost(worker, _) = event {
                    roster.remove(worker);
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
        let desk = &mut self.desk;
        let mut handling = Duration::ZERO;
        let heard = self.port.poll(wait, &mut |event| {
            let arrival = Instant::now();
            desk.hear(event, arrival);
            handling += arrival.elapsed();
        });
        heard.map_err(channel)?;
        self.desk.statistics.transport_s += handling.as_secs_f64();
        self.look_at_workers();
        self.desk.end_hung(Instant::now());
        self.act();
        match self.desk.fatal.take() {
            Some(fatal) => Err(fatal),
            None => Ok(()),
        }
    }

    /// Now and then: what the kernel says about busy workers, and the report to whoever asked for one.
    fn look_at_workers(&mut self) {
        let now = Instant::now();
        let pause = if self.any_stopped { LOOK_CLOSELY } else { LOOK };
        if now.duration_since(self.looked) < pause {
            return;
        }
        self.looked = now;
        self.any_stopped = self.desk.roster.look(now, Vitals::of);
        self.desk.retire_the_large(resident_mebibytes);
        if let Some(reporter) = &mut self.reporter {
            reporter(&report::of(&self.desk, now));
        }
    }

    /// Lets `reporter` know about once a second, while the pool waits for answers, what every worker does.
    pub fn report_to(&mut self, reporter: impl FnMut(&[WorkerReport]) + 'static) {
        self.reporter = Some(Box::new(reporter));
    }

    /// The question that has ended too many workers, complete in itself.
    pub fn quarantined(&self) -> Option<&Reproducer> {
        self.desk.quarantined.as_ref()
    }

    fn dispatch(&mut self) -> Result<(), MaterialError> {
        while let Some(shipment) = self.desk.next_shipment(Instant::now()) {
            let begin = Instant::now();
            let loaded: Vec<_> = shipment.jobs.iter().map(|(job, state)| LoadedJob { job: *job, state }).collect();
            let mut sent = Ok(());
            for definition in shipment.define {
                let definition = self.desk.points.definitions[definition].1.clone();
                sent = sent.and_then(|()| self.port.send_control(shipment.worker, &ToWorker::Define { definition }));
            }
            let sent = sent.and_then(|()| self.port.send_jobs(shipment.worker, &loaded));
            self.desk.statistics.transport_s += begin.elapsed().as_secs_f64();
            match sent {
                Ok(()) => {}
                Err(error @ TransportError::TooLarge { .. }) => return Err(channel(error)),
                Err(error) => self.desk.undeliverable(shipment.worker, &error.to_string()),
            }
        }
        self.act();
        Ok(())
    }

    fn act(&mut self) {
        for action in std::mem::take(&mut self.desk.actions) {
            match action {
                Action::Send(worker, message) => {
                    if let Err(error) = self.port.send_control(worker, &message) {
                        self.desk.undeliverable(worker, &error.to_string());
                    }
                }
                Action::Kill(worker) => self.port.kill(worker),
                Action::Joined(pid) => self.supply.joined(pid),
                Action::Refused(pid, reason) => self.supply.refused(pid, &reason),
                Action::Gone(pid, had_answered) => self.supply.lost(pid, had_answered),
                Action::Left(pid) => self.supply.left(pid),
            }
        }
    }

    /// Looks after the supply and returns how long to wait for events.
    fn tend(&mut self) -> Result<Duration, MaterialError> {
        let now = Instant::now();
        let outlook = self.supply.tend();
        let mut wait = LONGEST_WAIT;
        if let Some(deadline) = self.desk.roster.next_deadline() {
            wait = wait.min(deadline.saturating_duration_since(now));
        }
        if let Some(awake) = self.desk.batch.next_awake() {
            wait = wait.min(awake.saturating_duration_since(now));
        }
        if self.desk.is_served() {
            self.deserted_since = None;
        } else {
            let since = *self.deserted_since.get_or_insert(now);
            let patience = self.desk.settings.patience;
            let left = patience.saturating_sub(now.duration_since(since));
            let trouble = self.desk.last_trouble.as_deref().map_or(String::new(), |text| format!("; last: {text}"));
            if let Outlook::Exhausted(reason) = &outlook {
                return Err(MaterialError::WorkersLost(format!("no workers are left: {reason}{trouble}")));
            }
            if left.is_zero() {
                let text = format!("no worker has joined run `{}` for {patience:?}{trouble}", self.desk.settings.run);
                return Err(MaterialError::WorkersLost(text));
            }
            wait = wait.min(left);
        }
        if self.any_stopped {
            wait = wait.min(LOOK_CLOSELY);
        }
        if let Outlook::Expected { check_again } = outlook {
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
        self.desk.statistics.idle_s += passed * self.desk.roster.active() as f64;
    }

    fn solve(&mut self, trials: &[PointTrial]) -> Result<Batch, MaterialError> {
        let desk = &mut self.desk;
        let roster = &desk.roster;
        let home = |state: &PointState| state.holder.filter(|worker| roster.is_active(*worker));
        desk.batch = Batch::build(trials, &desk.points, self.next_job, desk.settings.deduplicate, home);
        self.next_job += desk.batch.jobs.len() as u64;
        while !self.desk.batch.is_finished() {
            self.listen()?;
        }
        let finished = std::mem::replace(&mut self.desk.batch, Batch::nothing(self.next_job));
        self.desk.statistics.duplicates_skipped += (trials.len() - finished.jobs.len()) as u64;
        Ok(finished)
    }

    /// Hands out answers and trial states, or the reason of the lowest failing point.
    fn collect(&mut self, trials: &[PointTrial], batch: &Batch) -> Result<Vec<TrialAnswer>, MaterialError> {
        let failure = |outcome: &Option<Outcome>| match outcome {
            Some(Outcome::Failed(reason)) => Some(reason.clone()),
            _ => None,
        };
        let lowest = (trials.iter().zip(&batch.job_of_trial))
            .filter_map(|(trial, job)| Some((trial.point, failure(&batch.jobs[*job].outcome)?)))
            .min_by_key(|(point, _)| *point);
        if let Some((point, reason)) = lowest {
            return Err(MaterialError::Point { point, reason });
        }
        let mut answers = Vec::with_capacity(trials.len());
        for (trial, job) in trials.iter().zip(&batch.job_of_trial) {
            let Some(Outcome::Done(answer, state)) = &batch.jobs[*job].outcome else {
                unreachable!("jobs are abandoned only after a failure, and failures were reported above");
            };
            let record = &mut self.desk.points.records[trial.point];
            record.forecast.learn(trial, &answer.cost);
            record.trial = Some(state.clone());
            answers.push((**answer).clone());
        }
        Ok(answers)
    }
}

impl<P: MacroPort> PointMaterial for Pool<P> {
    fn evaluate(&mut self, trials: &[PointTrial]) -> Result<Vec<TrialAnswer>, MaterialError> {
        // After a failure no trial of these points may be mistaken for an answer to this call.
        for trial in trials {
            self.desk.points.records[trial.point].trial = None;
        }
        self.clock = Instant::now();
        self.deserted_since = None;
        let begin = self.clock;
        let busy = busy_seconds(&self.desk.statistics);
        let outcome = self.solve(trials);
        self.account_time();
        let statistics = &mut self.desk.statistics;
        statistics.idle_s = (statistics.idle_s - (busy_seconds(statistics) - busy)).max(0.0);
        statistics.wall_s += begin.elapsed().as_secs_f64();
        let answers = self.collect(trials, &outcome?)?;
        self.desk.statistics.evaluations += answers.len() as u64;
        Ok(answers)
    }

    fn commit(&mut self) -> Result<(), MaterialError> {
        self.desk.points.commit();
        Ok(())
    }

    fn rollback(&mut self) {
        self.desk.points.rollback();
    }

    fn save(&self, archive: &mut Archive) {
        checkpoint::save(&self.desk, archive);
    }

    fn restore(&mut self, archive: &Archive) -> Result<(), CheckpointError> {
        checkpoint::restore(&mut self.desk, archive)
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
