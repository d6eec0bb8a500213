//! The agent of one host: runs the host's own workers and joins them to a run elsewhere.
//!
//! To its workers the agent is a macro process with a shared-memory channel; to the macro process it is a connection with workers
//! behind it. It decides nothing about jobs. A worker is announced to the macro once it has said hello here and owes no reply from an
//! earlier connection; so a reply to a job of an earlier connection can never be taken for one of the present connection.

mod kept_states;
mod member;

use crate::connection::Limits;
use crate::join_file::Target;
use crate::message::{Body, FromAgent, ToAgent, unpacked, with_control};
use crate::worker_port::{JoinError, Link};
use kept_states::KeptStates;
use macro_solver::pool::{Interrupt, SupplyStatus, WorkerSupply};
use member::Members;
use protocol::StateId;
use protocol::control::{FromWorker, ToWorker};
use protocol::transport::frame::{Frame, FrameKind, Outgoing};
use protocol::transport::{LoadedJob, LoadedReply, MacroEvent, MacroPort, TransportError, Waker, WorkerId};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::{Duration, Instant};
use thiserror::Error;

/// Longest wait between two looks at the supply.
const LONGEST_WAIT: Duration = Duration::from_millis(500);

/// How long a worker may take to finish a job of an earlier connection before it is replaced.
const STALE_LIMIT: Duration = Duration::from_secs(60);

/// How long workers may take to leave in the end.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(2);

/// How an agent behaves.
#[derive(Clone, Debug)]
pub struct AgentOptions {
    /// Limits of the connection.
    pub limits: Limits,
    /// Bytes of states that the agent keeps for its workers, beyond what they keep themselves.
    pub state_bytes: u64,
    /// How long the agent looks for its run, at the start and when it has lost it.
    pub timeout: Duration,
}

/// Why an agent has ended in good order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum AgentEnd {
    /// The run has ended.
    RunEnded(String),
    /// A stop was requested here.
    Interrupted,
}

/// Why an agent had to give up.
#[derive(Debug, Error)]
pub enum AgentError {
    /// No run was found, or it refuses this agent.
    #[error(transparent)]
    Join(#[from] JoinError),
    /// No workers could be kept on this host.
    #[error("no workers on this host: {0}")]
    NoWorkers(String),
    /// The channel to the workers of this host is broken.
    #[error(transparent)]
    Channel(#[from] TransportError),
}

/// What an agent has done; for its closing line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AgentFigures {
    /// Replies passed on.
    pub replies: u64,
    /// Times that it joined a run.
    pub joined: u64,
    /// Replies to jobs of an earlier connection, dropped.
    pub stale_replies: u64,
    /// Replies that were damaged between worker and agent; their workers were replaced.
    pub damaged_replies: u64,
    /// Messages of the macro or of workers that were none.
    pub refused: u64,
}

/// Looks for the run on a thread of its own, so that the workers are looked after meanwhile.
struct Search {
    found: Receiver<Result<Link, JoinError>>,
}

/// An agent at work.
pub struct Agent<'a, P: MacroPort> {
    local: P,
    supply: &'a mut dyn WorkerSupply,
    target: Arc<dyn Fn() -> Result<Target, JoinError> + Send + Sync>,
    options: AgentOptions,
    interrupt: Interrupt,
    link: Option<Link>,
    search: Option<Search>,
    members: Members,
    states: KeptStates,
    figures: AgentFigures,
    dismissed: bool,
}

impl<'a, P: MacroPort> Agent<'a, P> {
    /// An agent whose workers come from `supply` and join at `local`. `target` says where the run is, asked before every attempt:
    /// a run that was resumed elsewhere has another address.
    pub fn new(
        local: P,
        supply: &'a mut dyn WorkerSupply,
        target: impl Fn() -> Result<Target, JoinError> + Send + Sync + 'static,
        options: AgentOptions,
        interrupt: Interrupt,
    ) -> Self {
        let states = KeptStates::new(options.state_bytes > 0);
        Self {
            local,
            supply,
            target: Arc::new(target),
            options,
            interrupt,
            link: None,
            search: None,
            members: Members::default(),
            states,
            figures: AgentFigures::default(),
            dismissed: false,
        }
    }

    /// A handle that interrupts waiting; raise the interrupt first.
    pub fn waker(&self) -> Arc<dyn Waker> {
        self.local.waker()
    }

    /// What it has done so far.
    pub fn figures(&self) -> AgentFigures {
        self.figures
    }

    /// Serves until the run ends, a stop is requested, or no run is found for too long.
    ///
    /// # Errors
    /// See [`AgentError`].
    pub fn serve(&mut self) -> Result<AgentEnd, AgentError> {
        let ended = self.serve_to_the_end();
        if let Some(link) = &self.link
            && !matches!(ended, Ok(AgentEnd::RunEnded(_)))
        {
            let reason = match &ended {
                Err(error) => error.to_string(),
                _ => "the agent was asked to stop".to_owned(),
            };
            link.send(with_control(0, &FromAgent::Leave { reason }));
        }
        self.close();
        ended
    }

    fn serve_to_the_end(&mut self) -> Result<AgentEnd, AgentError> {
        loop {
            if self.interrupt.is_raised() {
                return Ok(AgentEnd::Interrupted);
            }
            self.look_for_run()?;
            let wait = match self.supply.tend() {
                _ if self.dismissed => LONGEST_WAIT,
                SupplyStatus::Expected { check_again } => check_again.min(LONGEST_WAIT),
                SupplyStatus::Exhausted(_) if !self.members.is_empty() => LONGEST_WAIT,
                SupplyStatus::Exhausted(reason) => return Err(AgentError::NoWorkers(reason)),
            };
            self.take_from_workers(wait)?;
            if let Some(end) = self.take_from_macro()? {
                return Ok(end);
            }
            for worker in self.members.overdue(Instant::now(), STALE_LIMIT) {
                tracing::warn!(worker = worker.0, "a worker does not finish a job of an earlier connection");
                self.local.kill(worker);
            }
        }
    }

    /// Starts to look for the run when there is no connection, and takes what was found.
    fn look_for_run(&mut self) -> Result<(), AgentError> {
        if self.link.is_some() {
            return Ok(());
        }
        let Some(search) = &self.search else {
            self.search = Some(self.start_search()?);
            return Ok(());
        };
        match search.found.try_recv() {
            Err(TryRecvError::Empty) => Ok(()),
            Err(TryRecvError::Disconnected) => {
                Err(JoinError::Unreachable("the search for the run broke down".to_owned()).into())
            }
            Ok(Err(error)) => Err(error.into()),
            Ok(Ok(link)) => {
                tracing::info!(run = link.run, "joined");
                self.search = None;
                self.figures.joined += 1;
                self.link = Some(link);
                for worker in self.members.announceable() {
                    self.announce(worker);
                }
                Ok(())
            }
        }
    }

    fn start_search(&self) -> Result<Search, JoinError> {
        let (send, found) = channel();
        let (target, options, waker) = (Arc::clone(&self.target), self.options.clone(), self.local.waker());
        let interrupt = self.interrupt.clone();
        let look = move || {
            let go_on = || !interrupt.is_raised();
            let (bytes, limits, timeout) = (options.state_bytes, options.limits, options.timeout);
            let joined = Link::join_within(&*target, bytes, limits, Some(&waker), timeout, &go_on);
            // The agent may have ended meanwhile.
            let _ = send.send(joined);
            waker.wake();
        };
        let started = std::thread::Builder::new().name("search".into()).spawn(look);
        started
            .map_err(|error| JoinError::Unreachable(format!("the search for the run cannot be started: {error}")))?;
        Ok(Search { found })
    }

    /// Tells the macro of a worker.
    fn announce(&mut self, worker: WorkerId) {
        let Some(link) = &self.link else { return };
        let Some((slot, hello)) = self.members.announce(worker, &link.run) else { return };
        let outgoing = Outgoing::control(&hello);
        pass_on(link, &mut self.states, slot, &outgoing);
    }

    fn take_from_workers(&mut self, wait: Duration) -> Result<(), AgentError> {
        // Replies are passed on where they lie; what changes the members is done after.
        let Self { local, link, members, states, figures, .. } = self;
        let (mut greeted, mut lost, mut damaged) = (Vec::new(), Vec::new(), Vec::new());
        local.poll(wait, &mut |event| match event {
            MacroEvent::Control(worker, message) => match message {
                FromWorker::Hello { .. } => greeted.push((worker, message)),
                other => {
                    if matches!(other, FromWorker::Bye { .. }) {
                        members.leaves(worker);
                    }
                    if let (Some(slot), Some(link)) = (members.slot(worker), link.as_ref()) {
                        pass_on(link, states, slot, &Outgoing::control(&other));
                    }
                }
            },
            MacroEvent::Replies(worker, replies) => {
                if replies.iter().any(is_damaged) {
                    figures.damaged_replies += 1;
                    damaged.push(worker);
                } else if members.answered(worker, replies) {
                    figures.replies += replies.len() as u64;
                    if let (Some(slot), Some(link)) = (members.slot(worker), link.as_ref()) {
                        pass_on(link, states, slot, &Outgoing::Replies(replies));
                    }
                } else {
                    figures.stale_replies += replies.len() as u64;
                }
            }
            MacroEvent::Lost(worker, reason) | MacroEvent::CutOff(worker, reason) => lost.push((worker, reason)),
            MacroEvent::Refused(reason) => {
                tracing::warn!(reason, "a message of a worker was refused");
                figures.refused += 1;
            }
            MacroEvent::Woken => {}
        })?;
        for (worker, hello) in greeted {
            if let Some(pid) = self.members.add(worker, hello) {
                self.supply.joined(pid);
                self.welcome(worker);
            }
        }
        for worker in damaged {
            tracing::error!(worker = worker.0, "a reply was damaged between worker and agent");
            self.local.kill(worker);
        }
        for (worker, reason) in lost {
            self.lose(worker, &reason);
        }
        if self.link.is_some() {
            for worker in self.members.announceable() {
                self.announce(worker);
            }
        }
        Ok(())
    }

    /// Answers a hello at once: the run may be found much later than a worker waits for an answer. The run's own answer follows, and a
    /// refusal still ends the worker.
    fn welcome(&mut self, worker: WorkerId) {
        // One that is gone needs no answer.
        let _ = self.local.send_control(worker, &ToWorker::Welcome { worker: worker.0 });
    }

    fn lose(&mut self, worker: WorkerId, reason: &str) {
        let Some(gone) = self.members.remove(worker) else { return };
        if let (Some(slot), Some(link)) = (gone.slot, &self.link) {
            self.states.count_message();
            link.send(with_control(slot, &FromAgent::WorkerLost { reason: reason.to_owned() }));
        }
        if self.dismissed {
            return;
        }
        if gone.leaving {
            self.supply.left(gone.pid, gone.has_answered);
        } else {
            self.supply.lost(gone.pid, gone.has_answered);
        }
    }

    /// Takes what the macro has sent; returns why the agent ends, if it does.
    fn take_from_macro(&mut self) -> Result<Option<AgentEnd>, AgentError> {
        let Some(link) = &self.link else { return Ok(None) };
        let (arrived, buffers) = (link.take(Duration::ZERO), link.buffers.clone());
        for bytes in arrived.messages {
            match Body::parse(&bytes) {
                Ok((slot, Body::Frame(frame))) => self.take_frame(slot, frame, &[]),
                Ok((slot, Body::Jobs { kept, frame })) => self.take_frame(slot, frame, kept),
                Ok((slot, Body::Control(body))) => match unpacked(body) {
                    Ok(ToAgent::Kill) => {
                        if let Some(worker) = self.members.at(slot) {
                            self.local.kill(worker);
                        }
                    }
                    Ok(ToAgent::Forget { states, heard }) => self.states.forget(&states, heard),
                    Ok(ToAgent::Farewell { reason }) => return Ok(Some(AgentEnd::RunEnded(reason))),
                    Err(error) => self.refuse(&error.to_string()),
                },
                Err(error) => self.refuse(&error.to_string()),
            }
            buffers.give(bytes);
        }
        if let Some(reason) = arrived.closed {
            if self.dismissed {
                return Ok(Some(AgentEnd::RunEnded(reason)));
            }
            tracing::warn!(reason, "the run is lost; looking for it again");
            self.link = None;
            self.states = KeptStates::new(self.options.state_bytes > 0);
            self.members.cut_off(Instant::now());
        }
        Ok(None)
    }

    fn refuse(&mut self, reason: &str) {
        tracing::warn!(reason, "a message of the macro was refused");
        self.figures.refused += 1;
    }

    /// A message of the macro for one worker.
    fn take_frame(&mut self, slot: u32, bytes: &[u8], kept: &[u8]) {
        let frame = match Frame::parse(bytes) {
            Ok(frame) => frame,
            Err(error) => return self.refuse(&error.to_string()),
        };
        let Some(worker) = self.members.at(slot) else { return self.keep_states_of(&frame) };
        let sent = match frame.kind {
            FrameKind::Jobs => match frame.jobs() {
                Ok(jobs) => self.hand_out(worker, jobs, kept),
                Err(error) => return self.refuse(&error.to_string()),
            },
            _ => match frame.control::<ToWorker>() {
                Ok(message) => {
                    match &message {
                        ToWorker::Bye => self.dismissed = true,
                        ToWorker::Refused { reason } => {
                            tracing::error!(reason, "the run refused a worker of this host");
                            if let Some(pid) = self.members.pid(worker) {
                                self.supply.refused(pid, reason);
                            }
                        }
                        _ => {}
                    }
                    let sent = self.local.send_control(worker, &message);
                    if matches!(message, ToWorker::Refused { .. }) {
                        // Workers in other languages look out for a refusal only as long as nobody has bid them welcome.
                        let _ = self.local.send_control(worker, &ToWorker::Bye);
                    }
                    sent
                }
                Err(error) => return self.refuse(&error.to_string()),
            },
        };
        match sent {
            // Its end is about to be reported.
            Ok(()) | Err(TransportError::Gone(_)) => {}
            Err(error) => {
                tracing::error!(worker = worker.0, %error, "a message could not be handed to a worker");
                self.local.kill(worker);
            }
        }
    }

    /// A message for a worker that has ended meanwhile: the macro learns of it by itself, but counts on the states that came along.
    fn keep_states_of(&mut self, frame: &Frame<'_>) {
        if frame.kind != FrameKind::Jobs {
            return;
        }
        match frame.jobs() {
            Ok(jobs) => jobs.iter().for_each(|one| self.states.take_job(one)),
            Err(error) => self.refuse(&error.to_string()),
        }
    }

    fn hand_out(&mut self, worker: WorkerId, jobs: Vec<LoadedJob<'_>>, kept: &[u8]) -> Result<(), TransportError> {
        let Self { local, members, states, .. } = self;
        let from_here: Vec<usize> =
            kept.as_chunks::<4>().0.iter().map(|place| u32::from_le_bytes(*place) as usize).collect();
        jobs.iter().for_each(|one| states.take_job(one));
        let mut complete = Vec::with_capacity(jobs.len());
        for (place, one) in jobs.into_iter().enumerate() {
            let state = if from_here.contains(&place) { states.get(one.job.state) } else { Some(one.state) };
            // Cannot be missing while both sides count alike, whatever became of the workers in between.
            let state = state.ok_or_else(|| TransportError::Channel {
                action: "find a state that the macro believes is kept here",
                reason: format!("state {}", one.job.state),
            })?;
            complete.push(LoadedJob { job: one.job, state });
        }
        members.given(worker, &complete);
        local.send_jobs(worker, &complete)
    }

    /// Dismisses the workers of this host.
    fn close(&mut self) {
        self.dismissed = true;
        for worker in self.members.all() {
            // One that is gone needs no farewell.
            let _ = self.local.send_control(worker, &ToWorker::Bye);
        }
        let end = Instant::now() + CLOSE_TIMEOUT;
        while !self.members.is_empty() && Instant::now() < end {
            if self.take_from_workers(Duration::from_millis(50)).is_err() {
                break;
            }
        }
        self.supply.finish();
        // Closes the connection after the last words.
        self.link = None;
    }
}

/// Sends a frame of the worker with this slot to the macro, and keeps the states that it carries.
fn pass_on(link: &Link, states: &mut KeptStates, slot: u32, outgoing: &Outgoing<'_>) {
    states.count_message();
    if let Outgoing::Replies(replies) = outgoing {
        states.take_replies(replies);
    }
    link.send_frame(slot, outgoing);
}

/// Whether a reply was damaged between worker and agent. The agent keeps states under the names that replies give them, and hands them
/// to other workers: a wrong one would make these look faulty.
fn is_damaged(one: &LoadedReply<'_>) -> bool {
    let has_wrong_name = !one.state.is_empty() && StateId::of(one.state) != one.reply.state;
    has_wrong_name || !one.reply.is_sealed(one.error)
}

/// Replies as this module sees them.
type Replies<'a> = &'a [LoadedReply<'a>];
