//! The run's side of a conversation with one worker, over either transport.

use super::pipe::PipePort;
use bytemuck::Zeroable;
use protocol::control::{FromWorker, ToWorker};
use protocol::transport::shared_memory::{ChannelLimits, SharedMemoryMacroPort, SharedMemoryWorkerPort};
use protocol::transport::{LoadedJob, MacroEvent, MacroPort, WorkerId, in_process};
use protocol::wire::{TrialJob, TrialReply};
use protocol::{Capabilities, ContentId, Definition, RveError, StateId, Tensor2};
use rve_server::engine::GrainEngine;
use rve_server::server::{ServeOptions, serve};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(60);

/// Who is talked to.
pub(crate) enum Partner {
    /// The built-in engine in a thread of this process.
    ThreadInProcess,
    /// The built-in engine in a thread, over shared memory.
    ThreadInSharedMemory,
    /// A worker process over shared memory; the role's arguments are added.
    Process(fn() -> Command),
    /// A worker process over its standard input and output.
    Pipe(fn() -> Command),
}

/// One answer.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Said {
    pub(crate) reply: TrialReply,
    pub(crate) state: Vec<u8>,
    pub(crate) error: Option<RveError>,
}

/// A conversation with one worker at a time.
pub(crate) struct Conversation {
    port: Box<dyn MacroPort>,
    run: String,
    partner: Partner,
    connector: Option<in_process::InProcessConnector>,
    worker: Option<WorkerId>,
    child: Option<Child>,
    pub(crate) capabilities: Capabilities,
    said: Vec<Said>,
    refused: Vec<(ContentId, String)>,
    farewell: Option<String>,
    lost: bool,
    jobs: u64,
}

impl Conversation {
    /// Starts the partner and waits for its hello.
    pub(crate) fn begin(partner: Partner) -> Self {
        static BEGUN: AtomicU32 = AtomicU32::new(0);
        let run = format!("k{}-{}", std::process::id(), BEGUN.fetch_add(1, Ordering::Relaxed));
        let (port, connector): (Box<dyn MacroPort>, _) = match partner {
            Partner::ThreadInProcess => {
                let (port, connector) = in_process::channel();
                (Box::new(port), Some(connector))
            }
            // Replaced when the first worker is started.
            Partner::Pipe(_) => (Box::new(in_process::channel().0), None),
            _ => (Box::new(SharedMemoryMacroPort::create(&run, ChannelLimits::default()).unwrap()), None),
        };
        let mut conversation = Self {
            port,
            run,
            partner,
            connector,
            worker: None,
            child: None,
            capabilities: Capabilities::default(),
            said: Vec::new(),
            refused: Vec::new(),
            farewell: None,
            lost: false,
            jobs: 0,
        };
        conversation.start();
        conversation
    }

    fn start(&mut self) {
        let run = self.run.clone();
        match &self.partner {
            Partner::ThreadInProcess => {
                let mut port = self.connector.as_ref().unwrap().join();
                std::thread::spawn(move || serve(&mut GrainEngine, &mut port, &ServeOptions::new(run)));
            }
            Partner::ThreadInSharedMemory => {
                std::thread::spawn(move || {
                    let mut port = SharedMemoryWorkerPort::join(&run, PATIENCE).unwrap();
                    serve(&mut GrainEngine, &mut port, &ServeOptions::new(run))
                });
            }
            Partner::Process(command) => {
                let mut command = command();
                command.args(["--run", &run]).stdin(Stdio::null()).stdout(Stdio::null());
                self.child = Some(command.spawn().unwrap());
            }
            Partner::Pipe(command) => {
                let mut command = command();
                command.args(["--pipe", "--run", &run]).stdin(Stdio::piped()).stdout(Stdio::piped());
                let child = self.child.insert(command.spawn().unwrap());
                self.port = Box::new(PipePort::new(child));
            }
        }
        (self.worker, self.lost) = (None, false);
        self.listen_until("a hello", |conversation| conversation.worker.is_some());
        let worker = self.worker.unwrap();
        self.port.send_control(worker, &ToWorker::Welcome { worker: worker.0 }).unwrap();
    }

    /// Dismisses the worker and starts a fresh one.
    pub(crate) fn replace_worker(&mut self) {
        self.port.send_control(self.worker.unwrap(), &ToWorker::Bye).unwrap();
        self.listen_until("the end of the worker", |conversation| conversation.lost);
        self.reap();
        self.start();
    }

    /// Asks the worker to finish; returns its farewell.
    pub(crate) fn drain(mut self) -> String {
        self.port.send_control(self.worker.unwrap(), &ToWorker::Drain).unwrap();
        self.listen_until("the end of the worker", |conversation| conversation.lost);
        self.reap();
        self.farewell.take().expect("a worker that leaves says why")
    }

    fn reap(&mut self) {
        if let Some(mut child) = self.child.take() {
            let status = child.wait().unwrap();
            assert!(status.success(), "a worker that leaves in good order ended with {status}");
        }
    }

    pub(crate) fn define(&mut self, definition: &Definition) {
        let message = ToWorker::Define { definition: definition.clone() };
        self.port.send_control(self.worker.unwrap(), &message).unwrap();
    }

    /// Waits for the refusal of a definition.
    pub(crate) fn refusal_of(&mut self, definition: &Definition) -> String {
        self.listen_until("a refusal", |conversation| !conversation.refused.is_empty());
        let (id, reason) = self.refused.remove(0);
        assert_eq!(id, definition.id());
        reason
    }

    /// A job for a definition's point.
    pub(crate) fn job(&mut self, definition: &Definition, state: StateId, target: [[f64; 2]; 2]) -> TrialJob {
        self.jobs += 1;
        let target = Tensor2::from_plane(target);
        TrialJob { job: self.jobs, point: 7, definition: definition.id(), state, target, ..TrialJob::zeroed() }
    }

    /// Sends a slice and returns its answers in order.
    pub(crate) fn ask(&mut self, jobs: &[(TrialJob, &[u8])]) -> Vec<Said> {
        let loaded: Vec<LoadedJob<'_>> = jobs.iter().map(|(job, state)| LoadedJob { job: *job, state }).collect();
        self.port.send_jobs(self.worker.unwrap(), &loaded).unwrap();
        self.listen_until("answers", |conversation| conversation.said.len() >= jobs.len());
        std::mem::take(&mut self.said)
    }

    /// Sends one job.
    pub(crate) fn ask_one(&mut self, job: TrialJob, state: &[u8]) -> Said {
        self.ask(&[(job, state)]).remove(0)
    }

    fn listen_until(&mut self, what: &str, enough: impl Fn(&Self) -> bool) {
        let begun = Instant::now();
        while !enough(self) {
            assert!(begun.elapsed() < PATIENCE, "waited in vain for {what}");
            assert!(!self.lost || what.starts_with("the end"), "the worker was lost while waiting for {what}");
            let mut heard = Vec::new();
            let Self { port, said, .. } = self;
            port.poll(Duration::from_secs(1), &mut |event| match event {
                MacroEvent::Control(worker, message) => heard.push((worker, Some(message))),
                MacroEvent::Lost(worker, _) | MacroEvent::CutOff(worker, _) => heard.push((worker, None)),
                MacroEvent::Replies(_, replies) => said.extend(replies.iter().map(|one| Said {
                    reply: one.reply,
                    state: one.state.to_vec(),
                    error: (!one.error.is_empty()).then(|| rmp_serde::from_slice(one.error).unwrap()),
                })),
                MacroEvent::Refused(reason) => panic!("a message was refused: {reason}"),
                MacroEvent::Woken => {}
            })
            .unwrap();
            for (worker, message) in heard {
                match message {
                    None if Some(worker) == self.worker => self.lost = true,
                    None => {}
                    Some(FromWorker::Hello { capabilities, run, .. }) => {
                        assert_eq!((run == self.run, self.worker), (true, None));
                        (self.capabilities, self.worker) = (capabilities, Some(worker));
                    }
                    Some(FromWorker::DefinitionRefused { definition, reason }) => {
                        self.refused.push((definition, reason));
                    }
                    Some(FromWorker::Bye { reason }) => self.farewell = Some(reason),
                }
            }
        }
    }
}

impl Drop for Conversation {
    fn drop(&mut self) {
        if let Some(mut child) = self.child.take() {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}
