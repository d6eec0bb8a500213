//! Why a worker of the Python package ends before it has answered: told on its standard error.

use super::claims::discs;
use super::foreign;
use bytemuck::Zeroable;
use protocol::control::{FromWorker, ToWorker};
use protocol::transport::shared_memory::{ChannelLimits, SharedMemoryMacroPort};
use protocol::transport::{LoadedJob, MacroEvent, MacroPort};
use protocol::wire::TrialJob;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// How a worker has ended: exit code and standard error.
fn ending_of(command: &mut Command) -> (Option<i32>, String) {
    let ended = command.stdin(Stdio::null()).output().unwrap();
    (ended.status.code(), String::from_utf8_lossy(&ended.stderr).into_owned())
}

/// `conda run` and `bash -c` stand between the run and its worker: it ended without a word, and the run said only that it had.
#[test]
fn a_worker_behind_a_wrapper_says_what_is_wrong() {
    if !foreign::is_there("reference") {
        return;
    }
    let own = std::process::id();
    let worker = format!(
        "{} -m grainspan_worker.engines.reference --run nobody --parent {own}; exit $?",
        foreign::python().display()
    );
    let mut wrapped = Command::new("/bin/sh");
    let (code, said) = ending_of(wrapped.args(["-c", &worker]).env("PYTHONPATH", foreign::package()));
    assert_eq!(code, Some(3), "{said}");
    assert!(said.contains(&format!("is not PID {own}")) && said.contains("`exec` the interpreter"), "{said}");
}

/// A worker of the reference engine for which shared memory has `first` bytes when it joins and `later` bytes afterwards.
fn short_of_memory(run: &str, first: u64, later: u64) -> Command {
    let script = format!(
        "import os, types\n\
         rooms = [{first}]\n\
         def statvfs(path):\n    \
             free = rooms.pop() if rooms else {later}\n    \
             return types.SimpleNamespace(f_blocks=1, f_bavail=free, f_frsize=1)\n\
         os.statvfs = statvfs\n\
         from grainspan_worker import main\n\
         from grainspan_worker.engines.reference import ReferenceRve\n\
         main(ReferenceRve)\n"
    );
    let mut command = Command::new(foreign::python());
    command.args(["-c", &script, "--run", run]).env("PYTHONPATH", foreign::package());
    command
}

/// A write into a full file system ends a process by a signal, without a word.
#[test]
fn a_worker_that_finds_shared_memory_full_says_so() {
    if !foreign::is_there("reference") {
        return;
    }
    let run = format!("full{}", std::process::id());
    let mut port = SharedMemoryMacroPort::create(&run, ChannelLimits::default()).unwrap();
    let (code, said) = ending_of(&mut short_of_memory(&run, 300 << 10, 0));
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("shared memory is full: 300 kB are free in /dev/shm and 384 kB are needed"), "{said}");
    // Room to join and for the hello, none for a state: the first reply is longer than 4 kB.
    let mut child = short_of_memory(&run, 1 << 30, (128 + 4) << 10).stderr(Stdio::piped()).spawn().unwrap();
    talk(&mut port, &mut child);
    let ended = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(3), "{said}");
    assert!(said.contains("the run is lost: shared memory is full: 132 kB are free"), "{said}");
}

/// Gives a worker a trial as soon as it has said hello, and listens until it has ended.
fn talk(port: &mut SharedMemoryMacroPort, child: &mut Child) {
    let made_of = discs();
    let begun = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if begun.elapsed() > Duration::from_secs(60) {
            let _ = child.kill();
            panic!("the worker has not ended within 60 s");
        }
        let mut greeted = None;
        port.poll(Duration::from_millis(20), &mut |event| match event {
            MacroEvent::Control(worker, FromWorker::Hello { .. }) => greeted = Some(worker),
            MacroEvent::Replies(..) => panic!("a reply for which there was no memory"),
            _ => {}
        })
        .unwrap();
        if let Some(worker) = greeted {
            let define = ToWorker::Define { definition: made_of.clone() };
            port.send_control(worker, &ToWorker::Welcome { worker: worker.0 }).unwrap();
            port.send_control(worker, &define).unwrap();
            let job = TrialJob { job: 1, definition: made_of.id(), ..TrialJob::zeroed() };
            port.send_jobs(worker, &[LoadedJob { job, state: b"" }]).unwrap();
        }
    }
}
