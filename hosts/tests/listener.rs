//! Who comes in and who does not, and what an agent does when its run is lost.

use bytemuck::Zeroable;
use hosts::agent::{Agent, AgentEnd, AgentOptions};
use hosts::{JoinError, Limits, ListenerOptions, NetworkMacroPort, NetworkWorkerPort, Secret, Target, this_program};
use macro_solver::pool::{Interrupt, JoiningWorkers, SupplyStatus, WorkerSupply};
use protocol::control::{FromWorker, ToWorker};
use protocol::transport::in_process::{InProcessConnector, channel};
use protocol::transport::{
    LoadedJob, LoadedReply, MacroEvent, MacroPort, TransportError, WorkerEvent, WorkerId, WorkerPort,
};
use protocol::wire::{ReplyStatus, TrialJob, TrialReply};
use protocol::{Capabilities, PROTOCOL_VERSION, StateId};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::mpsc::{Receiver, Sender, channel as wire};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(10);

fn listen(program: &str) -> (NetworkMacroPort, Target) {
    listen_within(program, Limits::default())
}

fn listen_within(program: &str, limits: Limits) -> (NetworkMacroPort, Target) {
    let secret = Secret::draw().unwrap();
    let program = program.to_owned();
    let options = ListenerOptions { run: "test".into(), secret: secret.clone(), limits, program };
    let port = NetworkMacroPort::listen("127.0.0.1:0", options).unwrap();
    let target = Target { endpoints: vec![port.address().to_string()], secret };
    (port, target)
}

fn hello(run: &str) -> FromWorker {
    let capabilities = Capabilities { engine: "echo".into(), version: "1".into(), ..Capabilities::default() };
    FromWorker::Hello { protocol: PROTOCOL_VERSION, run: run.into(), pid: 7, capabilities, state_cache: 4 }
}

#[derive(Default)]
struct Heard {
    hellos: Vec<WorkerId>,
    replies: Vec<(WorkerId, u64, Vec<u8>)>,
    lost: Vec<WorkerId>,
    cut_off: Vec<WorkerId>,
    refused: usize,
}

impl Heard {
    fn until(&mut self, port: &mut dyn MacroPort, enough: impl Fn(&Self) -> bool) {
        let begin = Instant::now();
        while !enough(self) {
            assert!(begin.elapsed() < PATIENCE, "waited in vain");
            port.poll(Duration::from_millis(50), &mut |event| match event {
                MacroEvent::Control(worker, FromWorker::Hello { .. }) => self.hellos.push(worker),
                MacroEvent::Control(..) | MacroEvent::Woken => {}
                MacroEvent::Replies(worker, replies) => {
                    self.replies.extend(replies.iter().map(|one| (worker, one.reply.job, one.state.to_vec())));
                }
                MacroEvent::Lost(worker, _) => self.lost.push(worker),
                MacroEvent::CutOff(worker, _) => self.cut_off.push(worker),
                MacroEvent::Refused(_) => self.refused += 1,
            })
            .unwrap();
        }
    }
}

#[test]
fn strangers_are_refused_and_counted_and_nobody_else_notices() {
    let (mut port, target) = listen(this_program());
    let figures = port.figures();
    let mut friend = NetworkWorkerPort::join(&target, Limits::default(), PATIENCE).unwrap();
    friend.send_control(&hello("test")).unwrap();
    let mut heard = Heard::default();
    heard.until(&mut port, |heard| !heard.hellos.is_empty());

    // One that speaks another language.
    let mut web = TcpStream::connect(port.address()).unwrap();
    web.write_all(b"GET / HTTP/1.1\r\n\r\n").unwrap();
    let mut answer = Vec::new();
    let _ = web.read_to_end(&mut answer);
    assert!(answer.len() < 64 && !String::from_utf8_lossy(&answer).contains("grainspan"), "{answer:?}");
    // One with another secret.
    let other = Target { secret: Secret::draw().unwrap(), ..target.clone() };
    let refused = NetworkWorkerPort::join(&other, Limits::default(), Duration::ZERO).err().unwrap();
    assert!(matches!(&refused, JoinError::Untrusted(at, _) if *at == target.endpoints[0]), "{refused}");
    // One that says nothing at all is sent away in the end, and keeps nobody waiting.
    let mute = TcpStream::connect(port.address()).unwrap();
    friend.send_control(&FromWorker::Bye { reason: "still here".into() }).unwrap();
    let begin = Instant::now();
    heard.until(&mut port, |_| figures.now().strangers_refused == 3);
    assert!(begin.elapsed() < Duration::from_secs(8));
    drop(mute);
    let figures = figures.now();
    assert_eq!((figures.agents_joined, figures.agents_refused, figures.agents_lost), (1, 0, 0));
    assert_eq!((heard.hellos.len(), heard.refused, heard.lost.len()), (1, 0, 0));
}

#[test]
fn another_build_is_refused_with_the_remedy() {
    let (port, target) = listen("ffffffffffffffffffffffffffffffff");
    let refused = NetworkWorkerPort::join(&target, Limits::default(), PATIENCE).err().unwrap();
    let text = refused.to_string();
    assert!(text.contains("copy the program of the run"), "{text}");
    assert_eq!(port.figures().now().agents_refused, 1);
}

/// Knowing the secret gives no right to fill the log.
#[test]
fn an_agent_that_keeps_sending_garbage_is_given_up_and_the_others_go_on() {
    let (mut port, target) = listen(this_program());
    let join = || NetworkWorkerPort::join(&target, Limits::default(), PATIENCE).unwrap();
    let (mut friend, mut broken) = (join(), join());
    friend.send_control(&hello("test")).unwrap();
    broken.send_control(&hello("test")).unwrap();
    let mut heard = Heard::default();
    heard.until(&mut port, |heard| heard.hellos.len() == 2);
    for round in 0..1000u32 {
        // It may be cut off by now.
        let _ = broken.send_raw(&vec![round as u8; 8 + (round % 50) as usize]);
    }
    heard.until(&mut port, |heard| heard.cut_off.len() == 1);
    assert_eq!((heard.refused, port.figures().now().agents_faulty), (100, 1));
    let reply = TrialReply::bare(&TrialJob::zeroed(), ReplyStatus::Done);
    friend.send_replies(&[LoadedReply { reply, state: b"abc", error: b"" }]).unwrap();
    heard.until(&mut port, |heard| heard.replies.len() == 1);
}

/// A worker behind an agent: answers a job with its state and one byte more, but only when told to.
fn worker(listener: &InProcessConnector, answers: Receiver<()>) {
    // In the thread of the caller, so that workers are numbered in the order in which they are made.
    let mut port = listener.join();
    port.send_control(&hello("here")).unwrap();
    std::thread::spawn(move || {
        let mut open = true;
        while open {
            let mut jobs: Vec<(TrialJob, Vec<u8>)> = Vec::new();
            port.poll(PATIENCE, &mut |event| match event {
                WorkerEvent::Jobs(slice) => jobs.extend(slice.iter().map(|one| (one.job, one.state.to_vec()))),
                WorkerEvent::Control(ToWorker::Bye) | WorkerEvent::MacroLost(_) => open = false,
                WorkerEvent::Control(_) => {}
            })
            .unwrap();
            for (job, mut state) in jobs {
                if answers.recv().is_err() {
                    return;
                }
                state.push(b'!');
                let reply = TrialReply { state: StateId::of(&state), ..TrialReply::bare(&job, ReplyStatus::Done) };
                // The agent may have ended.
                let _ = port.send_replies(&[LoadedReply { reply, state: &state, error: b"" }]);
            }
        }
    });
}

/// Workers that join from elsewhere; tells when the agent has noticed that one is gone.
struct Noticed(Sender<()>);

impl WorkerSupply for Noticed {
    fn joined(&mut self, _: u32) {}

    fn refused(&mut self, _: u32, _: &str) {}

    fn lost(&mut self, _: u32, _: bool) {
        // The test listens to the first loss only.
        let _ = self.0.send(());
    }

    fn tend(&mut self) -> SupplyStatus {
        JoiningWorkers.tend()
    }

    fn restarts(&self) -> u64 {
        0
    }

    fn finish(&mut self) {}
}

/// An agent with two workers in a thread of its own. Returns where it looks for its run, what makes its workers answer, and its end.
fn agent(
    target: Target,
    state_bytes: u64,
) -> (Arc<Mutex<Target>>, [Sender<()>; 2], std::thread::JoinHandle<(AgentEnd, hosts::agent::AgentFigures)>) {
    agent_with(target, state_bytes, JoiningWorkers)
}

/// The same with a supply.
fn agent_with(
    target: Target,
    state_bytes: u64,
    mut supply: impl WorkerSupply + Send + 'static,
) -> (Arc<Mutex<Target>>, [Sender<()>; 2], std::thread::JoinHandle<(AgentEnd, hosts::agent::AgentFigures)>) {
    let place = Arc::new(Mutex::new(target));
    let ((one, first), (two, second)) = (wire(), wire());
    let looked_up = Arc::clone(&place);
    let thread = std::thread::spawn(move || {
        let (local, listener) = channel();
        worker(&listener, first);
        worker(&listener, second);
        let options = AgentOptions { limits: Limits::default(), state_bytes, timeout: PATIENCE };
        let target = move || Ok(looked_up.lock().unwrap().clone());
        let mut agent = Agent::new(local, &mut supply, target, options, Interrupt::new());
        let end = agent.serve().unwrap();
        (end, agent.figures())
    });
    (place, [one, two], thread)
}

fn job(number: u64, state: &[u8]) -> TrialJob {
    let state = if state.is_empty() { StateId::NONE } else { StateId::of(state) };
    TrialJob { job: number, point: number, state, ..TrialJob::zeroed() }
}

#[test]
fn a_state_travels_to_a_host_once_whichever_of_its_workers_needs_it() {
    let (mut port, target) = listen(this_program());
    let figures = port.figures();
    let (_, answers, thread) = agent(target, 1000);
    let mut heard = Heard::default();
    heard.until(&mut port, |heard| heard.hellos.len() == 2);
    let state = vec![9; 400];
    for (number, worker) in [0, 1, 0].into_iter().enumerate() {
        port.send_jobs(WorkerId(worker), &[LoadedJob { job: job(number as u64, &state), state: &state }]).unwrap();
        answers.iter().for_each(|one| one.send(()).unwrap());
        heard.until(&mut port, |heard| heard.replies.len() == number + 1);
    }
    let expected: Vec<u8> = [&state[..], b"!"].concat();
    assert!(heard.replies.iter().all(|(_, _, came)| *came == expected));
    assert_eq!((figures.now().states_kept, figures.now().bytes_saved), (2, 800));
    // The reply's own state is there too.
    port.send_jobs(WorkerId(1), &[LoadedJob { job: job(3, &expected), state: &expected }]).unwrap();
    heard.until(&mut port, |heard| heard.replies.len() == 4);
    assert_eq!((figures.now().states_kept, heard.replies[3].2.len()), (3, 402));
    // More than the agent keeps: the oldest is forgotten on both sides, and travels again.
    for number in 4..7u8 {
        let other = vec![number; 400];
        port.send_jobs(WorkerId(0), &[LoadedJob { job: job(u64::from(number), &other), state: &other }]).unwrap();
        answers.iter().for_each(|one| one.send(()).unwrap());
        heard.until(&mut port, |heard| heard.replies.len() == usize::from(number) + 1);
    }
    port.send_jobs(WorkerId(1), &[LoadedJob { job: job(7, &state), state: &state }]).unwrap();
    answers.iter().for_each(|one| one.send(()).unwrap());
    heard.until(&mut port, |heard| heard.replies.len() == 8);
    assert_eq!((figures.now().states_kept, heard.replies[7].2.clone()), (3, expected));
    drop(port);
    assert!(matches!(thread.join().unwrap().0, AgentEnd::RunEnded(_)));
}

/// Its states have not reached the agent: the jobs that go out one by one instead must carry them.
#[test]
fn a_batch_that_is_too_long_leaves_no_state_behind() {
    let (mut port, target) = listen_within(this_program(), Limits { message_bytes: 1000, ..Limits::default() });
    let figures = port.figures();
    let (_, answers, thread) = agent(target, 10_000);
    let mut heard = Heard::default();
    heard.until(&mut port, |heard| heard.hellos.len() == 2);
    let states = [vec![1; 400], vec![2; 400]];
    let jobs = [0, 1].map(|place| LoadedJob { job: job(place as u64, &states[place]), state: &states[place] });
    let refused = port.send_jobs(WorkerId(0), &jobs);
    assert!(matches!(refused, Err(TransportError::TooLarge { limit: 1000, .. })), "{refused:?}");
    for (number, one) in jobs.iter().enumerate() {
        port.send_jobs(WorkerId(0), std::slice::from_ref(one)).unwrap();
        answers.iter().for_each(|one| one.send(()).unwrap());
        heard.until(&mut port, |heard| heard.replies.len() == number + 1);
        assert_eq!(heard.replies[number].2, [&states[number][..], b"!"].concat());
    }
    assert_eq!(figures.now().states_kept, 0);
    drop(port);
    assert!(matches!(thread.join().unwrap().0, AgentEnd::RunEnded(_)));
}

/// A state that several jobs of one message start from travels once.
#[test]
fn jobs_of_one_message_share_a_state() {
    let (mut port, target) = listen(this_program());
    let (_, answers, thread) = agent(target, 10_000);
    let mut heard = Heard::default();
    heard.until(&mut port, |heard| heard.hellos.len() == 2);
    let jobs = [0, 1].map(|number| LoadedJob { job: job(number, b"state"), state: b"state" });
    port.send_jobs(WorkerId(0), &jobs).unwrap();
    (0..2).for_each(|_| answers[0].send(()).unwrap());
    heard.until(&mut port, |heard| heard.replies.len() == 2);
    assert!(heard.replies.iter().all(|(_, _, state)| state == b"state!"));
    assert_eq!(port.figures().now().states_kept, 1);
    drop(port);
    assert!(matches!(thread.join().unwrap().0, AgentEnd::RunEnded(_)));
}

/// The macro takes a state that it has sent for kept, and learns only later that the worker which it was sent to had ended.
#[test]
fn a_state_that_was_sent_to_a_worker_that_has_just_ended_is_kept_for_the_others() {
    let (mut port, target) = listen(this_program());
    let (noticed, loss) = wire();
    let (_, [first, second], thread) = agent_with(target, 1000, Noticed(noticed));
    let mut heard = Heard::default();
    heard.until(&mut port, |heard| heard.hellos.len() == 2);
    // The first worker ends with its next job, and the agent notices. The macro has not listened yet.
    drop(first);
    port.send_jobs(WorkerId(0), &[LoadedJob { job: job(0, b""), state: b"" }]).unwrap();
    loss.recv_timeout(PATIENCE).unwrap();
    for (number, worker) in [(1, 0), (2, 1)] {
        port.send_jobs(WorkerId(worker), &[LoadedJob { job: job(number, b"state"), state: b"state" }]).unwrap();
    }
    second.send(()).unwrap();
    heard.until(&mut port, |heard| !heard.replies.is_empty() && !heard.lost.is_empty());
    assert_eq!((&heard.lost[..], heard.replies[0].1), (&[WorkerId(0)][..], 2));
    assert_eq!(heard.replies[0].2, b"state!");
    assert_eq!(port.figures().now().states_kept, 1);
    drop(port);
    assert!(matches!(thread.join().unwrap().0, AgentEnd::RunEnded(_)));
}

/// Kept under its name, it would make the next worker that starts from it look faulty.
#[test]
fn a_state_that_was_damaged_between_worker_and_agent_goes_no_further() {
    let (mut port, target) = listen(this_program());
    let (local, listener) = channel();
    let mut broken = listener.join();
    broken.send_control(&hello("here")).unwrap();
    let thread = std::thread::spawn(move || {
        let options = AgentOptions { limits: Limits::default(), state_bytes: 1000, timeout: PATIENCE };
        let mut supply = JoiningWorkers;
        let mut agent = Agent::new(local, &mut supply, move || Ok(target.clone()), options, Interrupt::new());
        (agent.serve().unwrap(), agent.figures())
    });
    let mut heard = Heard::default();
    heard.until(&mut port, |heard| heard.hellos.len() == 1);
    let reply = TrialReply { state: StateId::of(b"state"), ..TrialReply::bare(&job(0, b""), ReplyStatus::Done) };
    broken.send_replies(&[LoadedReply { reply, state: b"stale", error: b"" }]).unwrap();
    heard.until(&mut port, |heard| !heard.lost.is_empty());
    assert!(heard.replies.is_empty(), "{:?}", heard.replies);
    drop(port);
    let (end, figures) = thread.join().unwrap();
    assert!(matches!(end, AgentEnd::RunEnded(_)));
    assert_eq!((figures.damaged_replies, figures.replies), (1, 0));
}

/// Agents may be started long before their run, and a worker waits half a minute at most for the answer to its hello.
#[test]
fn a_worker_is_welcome_before_the_run_is_found() {
    let (local, listener) = channel();
    let mut port = listener.join();
    port.send_control(&hello("here")).unwrap();
    let interrupt = Interrupt::new();
    let raised = interrupt.clone();
    let thread = std::thread::spawn(move || {
        let options = AgentOptions { limits: Limits::default(), state_bytes: 0, timeout: 2 * PATIENCE };
        let mut supply = JoiningWorkers;
        let nowhere = || Err(JoinError::Unreachable("there is no run yet".into()));
        Agent::new(local, &mut supply, nowhere, options, interrupt).serve().unwrap()
    });
    let (begin, mut is_welcome) = (Instant::now(), false);
    while !is_welcome {
        assert!(begin.elapsed() < PATIENCE, "waited in vain");
        port.poll(Duration::from_millis(50), &mut |event| {
            is_welcome |= matches!(event, WorkerEvent::Control(ToWorker::Welcome { .. }));
        })
        .unwrap();
    }
    raised.raise();
    drop(port);
    assert_eq!(thread.join().unwrap(), AgentEnd::Interrupted);
}

/// The second run numbers its jobs as the first did: an old reply must not be taken for a new one.
#[test]
fn an_agent_joins_the_next_run_and_brings_no_reply_of_the_last() {
    let (mut first, target) = listen(this_program());
    let (place, answers, thread) = agent(target, 1 << 20);
    let mut heard = Heard::default();
    heard.until(&mut first, |heard| heard.hellos.len() == 2);
    first.send_jobs(WorkerId(0), &[LoadedJob { job: job(0, b""), state: b"" }]).unwrap();
    std::thread::sleep(Duration::from_millis(100));

    let (mut second, target) = listen(this_program());
    *place.lock().unwrap() = target;
    // As a process that is killed ends: without a farewell.
    std::mem::forget(cut(first));
    let mut heard = Heard::default();
    heard.until(&mut second, |heard| heard.hellos.len() == 1);
    std::thread::sleep(Duration::from_millis(100));
    second.poll(Duration::ZERO, &mut |event| panic!("{event:?}")).unwrap();
    // One of the two owes a reply to the first run; when it has given it, it joins the second.
    answers.iter().for_each(|one| one.send(()).unwrap());
    heard.until(&mut second, |heard| heard.hellos.len() == 2);
    for worker in heard.hellos.clone() {
        second.send_jobs(worker, &[LoadedJob { job: job(u64::from(worker.0), b"x"), state: b"x" }]).unwrap();
    }
    answers.iter().for_each(|one| one.send(()).unwrap());
    heard.until(&mut second, |heard| heard.replies.len() == 2);
    assert!(heard.replies.iter().all(|(_, _, state)| state == b"x!"), "{:?}", heard.replies);
    drop(second);
    let (end, figures) = thread.join().unwrap();
    assert!(matches!(end, AgentEnd::RunEnded(_)));
    assert_eq!((figures.joined, figures.stale_replies, figures.replies), (2, 1, 2));
}

/// Ends the connections of a port without a farewell.
fn cut(port: NetworkMacroPort) -> NetworkMacroPort {
    port.cut_connections();
    port
}
