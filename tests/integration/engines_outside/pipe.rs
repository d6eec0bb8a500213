//! A worker at the other end of its standard input and output: the messages of a run without shared memory.

use protocol::control::ToWorker;
use protocol::transport::frame::{Frame, FrameKind, HEADER_LENGTH, Outgoing};
use protocol::transport::{LoadedJob, MacroEvent, MacroPort, TransportError, Waker, WorkerId};
use std::io::{ErrorKind, Read, Write};
use std::process::{Child, ChildStdin, ChildStdout};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// The only worker.
const WORKER: WorkerId = WorkerId(0);

/// The run's end of the pipes of one worker process.
pub(crate) struct PipePort {
    input: ChildStdin,
    /// Whole messages; the other side hangs up when the pipe is closed.
    messages: Receiver<Vec<u8>>,
    lost: bool,
}

impl PipePort {
    /// Takes over the pipes of a process that was started with both.
    pub(crate) fn new(child: &mut Child) -> Self {
        let (input, output) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
        let (sender, messages) = channel();
        std::thread::spawn(move || {
            let mut output = output;
            while let Some(message) = next_message(&mut output) {
                if sender.send(message).is_err() {
                    return;
                }
            }
        });
        Self { input, messages, lost: false }
    }

    fn send(&mut self, message: &Outgoing<'_>) -> Result<(), TransportError> {
        match self.input.write_all(&message.to_vec(0)).and_then(|()| self.input.flush()) {
            Err(error) if error.kind() == ErrorKind::BrokenPipe => Err(TransportError::Gone(WORKER)),
            outcome => {
                outcome.unwrap();
                Ok(())
            }
        }
    }

    fn hear(&mut self, message: &[u8], sink: &mut dyn FnMut(MacroEvent<'_>)) {
        let frame = match Frame::parse(message) {
            Ok(frame) => frame,
            Err(error) => return sink(MacroEvent::Refused(error.to_string())),
        };
        match frame.kind {
            FrameKind::Control => match frame.control() {
                Ok(said) => sink(MacroEvent::Control(WORKER, said)),
                Err(error) => sink(MacroEvent::Refused(error.to_string())),
            },
            FrameKind::Replies => match frame.replies() {
                Ok(replies) => sink(MacroEvent::Replies(WORKER, &replies)),
                Err(error) => sink(MacroEvent::Refused(error.to_string())),
            },
            FrameKind::Close => self.lose(sink),
            kind => sink(MacroEvent::Refused(format!("a message of kind {kind:?} over a pipe"))),
        }
    }

    fn lose(&mut self, sink: &mut dyn FnMut(MacroEvent<'_>)) {
        if !std::mem::replace(&mut self.lost, true) {
            sink(MacroEvent::Lost(WORKER, "it has closed its pipe".to_owned()));
        }
    }
}

fn next_message(output: &mut ChildStdout) -> Option<Vec<u8>> {
    let mut message = vec![0; HEADER_LENGTH];
    output.read_exact(&mut message).ok()?;
    let length = u64::from_le_bytes(message[16..24].try_into().unwrap());
    message.resize(usize::try_from(length).unwrap().max(HEADER_LENGTH), 0);
    output.read_exact(&mut message[HEADER_LENGTH..]).ok()?;
    Some(message)
}

impl MacroPort for PipePort {
    fn poll(&mut self, wait: Duration, sink: &mut dyn FnMut(MacroEvent<'_>)) -> Result<usize, TransportError> {
        match self.messages.recv_timeout(wait) {
            Ok(message) => self.hear(&message, sink),
            Err(std::sync::mpsc::RecvTimeoutError::Timeout) => return Ok(0),
            Err(std::sync::mpsc::RecvTimeoutError::Disconnected) => self.lose(sink),
        }
        Ok(1)
    }

    fn send_control(&mut self, _worker: WorkerId, message: &ToWorker) -> Result<(), TransportError> {
        self.send(&Outgoing::control(message))
    }

    fn send_jobs(&mut self, _worker: WorkerId, jobs: &[LoadedJob<'_>]) -> Result<(), TransportError> {
        self.send(&Outgoing::Jobs(jobs))
    }

    fn kill(&mut self, _worker: WorkerId) {}

    fn waker(&self) -> Arc<dyn Waker> {
        Arc::new(NoWaker)
    }
}

struct NoWaker;

impl Waker for NoWaker {
    fn wake(&self) {}
}
