//! The claims of every transport, for threads and shared memory.

#[macro_use]
mod claims;

use claims::{Channel, Heard, PATIENCE, echo};
use protocol::control::ToWorker;
use protocol::transport::in_process::{InProcessConnector, InProcessMacroPort, InProcessWorkerPort, channel};
use protocol::transport::shared_memory::{ChannelLimits, SharedMemoryMacroPort, SharedMemoryWorkerPort, Waiting};
use protocol::transport::{MacroPort, WorkerId};
use std::sync::atomic::{AtomicU32, Ordering};

struct Threads;

impl Channel for Threads {
    type Macro = InProcessMacroPort;
    type Worker = InProcessWorkerPort;
    type Connector = InProcessConnector;
    fn open() -> (Self::Macro, Self::Connector) {
        channel()
    }
    fn join(connector: &Self::Connector) -> Self::Worker {
        connector.join()
    }
    fn send_raw(worker: &mut Self::Worker, bytes: &[u8]) {
        worker.send_raw(bytes).unwrap();
    }
}

/// How the ends wait.
trait How {
    const WAITING: Waiting;
}

struct Blocking;
struct Glancing;
struct Spinning;

impl How for Blocking {
    const WAITING: Waiting = Waiting::Block;
}
impl How for Glancing {
    const WAITING: Waiting = Waiting::Hybrid;
}
impl How for Spinning {
    const WAITING: Waiting = Waiting::Spin;
}

struct SharedMemory<H>(std::marker::PhantomData<H>);

impl<H: How> Channel for SharedMemory<H> {
    type Macro = SharedMemoryMacroPort;
    type Worker = SharedMemoryWorkerPort;
    type Connector = String;
    fn open() -> (Self::Macro, Self::Connector) {
        static OPENED: AtomicU32 = AtomicU32::new(0);
        let name = format!("c{}-{}", std::process::id(), OPENED.fetch_add(1, Ordering::Relaxed));
        let limits = ChannelLimits { message_bytes: 8 << 20, workers: 8, waiting: H::WAITING };
        (SharedMemoryMacroPort::create(&name, limits).unwrap(), name)
    }
    fn join(connector: &Self::Connector) -> Self::Worker {
        SharedMemoryWorkerPort::join(connector, PATIENCE).unwrap()
    }
    fn send_raw(worker: &mut Self::Worker, bytes: &[u8]) {
        worker.send_raw(bytes).unwrap();
    }
}

claims!(
    threads: Threads,
    shared_memory: SharedMemory<Blocking>,
    hybrid: SharedMemory<Glancing>,
    spinning: SharedMemory<Spinning>,
);

/// Names of everything that a run's segments or directory would be called.
fn left_of(name: &str, prefix: &str) -> Vec<String> {
    let entries = std::fs::read_dir("/dev/shm").unwrap().map(|entry| entry.unwrap());
    let mut left: Vec<String> = entries
        .map(|entry| entry.file_name().into_string().unwrap())
        .filter(|file| file.starts_with(prefix))
        .collect();
    let user = format!("/dev/shm/grainspan-{}", rustix::process::getuid().as_raw());
    if std::path::Path::new(&user).join(name).exists() {
        left.push(name.to_owned());
    }
    left
}

#[test]
fn shared_memory_leaves_nothing_behind() {
    let (mut port, name) = SharedMemory::<Blocking>::open();
    let prefix = port.record().prefix.clone();
    let workers = [echo::<SharedMemory<Blocking>>(&name), echo::<SharedMemory<Blocking>>(&name)];
    Heard::default().until(&mut port, |heard| heard.controls.len() == 2);
    assert!(left_of(&name, &prefix).len() > 2, "the test looks in the wrong place");
    port.send_control(WorkerId(0), &ToWorker::Bye).unwrap();
    drop(port);
    for worker in workers {
        worker.join().unwrap();
    }
    assert_eq!(left_of(&name, &prefix), Vec::<String>::new());
}
