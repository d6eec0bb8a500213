//! The workers of this host and those of others behind one port.

use crate::macro_port::NetworkMacroPort;
use protocol::control::{FromWorker, ToWorker};
use protocol::transport::{LoadedJob, MacroEvent, MacroPort, TransportError, Waker, WorkerId};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

/// Where a worker is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Side {
    Here,
    Elsewhere,
}

/// The numbers of both sides as one.
#[derive(Debug, Default)]
struct Numbers {
    joined: u32,
    /// Whether process numbers of other hosts pass unchanged.
    transparent: bool,
    known: BTreeMap<(Side, WorkerId), WorkerId>,
    /// The other way round.
    origin: BTreeMap<WorkerId, (Side, WorkerId)>,
}

impl Numbers {
    fn of(&mut self, side: Side, worker: WorkerId) -> WorkerId {
        *self.known.entry((side, worker)).or_insert_with(|| {
            let number = WorkerId(self.joined);
            self.joined += 1;
            self.origin.insert(number, (side, worker));
            number
        })
    }

    fn remove(&mut self, side: Side, worker: WorkerId) -> WorkerId {
        let number = self.of(side, worker);
        self.known.remove(&(side, worker));
        self.origin.remove(&number);
        number
    }

    /// The event with the number that the pool knows.
    fn translate<'a>(&mut self, side: Side, event: MacroEvent<'a>) -> MacroEvent<'a> {
        match event {
            MacroEvent::Control(worker, FromWorker::Hello { protocol, run, capabilities, state_cache, .. })
                if side == Side::Elsewhere && !self.transparent =>
            {
                // Process numbers of another host mean nothing here, and must not be taken for one of ours.
                let hello = FromWorker::Hello { protocol, run, pid: 0, capabilities, state_cache };
                MacroEvent::Control(self.of(side, worker), hello)
            }
            MacroEvent::Control(worker, message) => MacroEvent::Control(self.of(side, worker), message),
            MacroEvent::Replies(worker, replies) => MacroEvent::Replies(self.of(side, worker), replies),
            MacroEvent::Lost(worker, reason) => MacroEvent::Lost(self.remove(side, worker), reason),
            MacroEvent::CutOff(worker, reason) => MacroEvent::CutOff(self.remove(side, worker), reason),
            other @ (MacroEvent::Refused(_) | MacroEvent::Woken) => other,
        }
    }
}

/// A port to the workers of this host, and to those of other hosts if the run listens for them. A run that does not costs one
/// comparison per message.
pub struct JoinedPort<P: MacroPort> {
    here: P,
    elsewhere: Option<NetworkMacroPort>,
    numbers: Numbers,
}

impl<P: MacroPort> JoinedPort<P> {
    /// Joins both.
    pub fn new(here: P, elsewhere: Option<NetworkMacroPort>) -> Self {
        if let Some(elsewhere) = &elsewhere {
            elsewhere.set_waker(here.waker());
        }
        Self { here, elsewhere, numbers: Numbers::default() }
    }

    /// The same with the process numbers of other hosts as they came: for the tests of all transports, whose hosts are threads.
    #[doc(hidden)]
    #[must_use]
    pub fn transparent(mut self) -> Self {
        self.numbers.transparent = true;
        self
    }

    fn route(
        &mut self,
        worker: WorkerId,
        send: impl FnOnce(&mut dyn MacroPort, WorkerId) -> Result<(), TransportError>,
    ) -> Result<(), TransportError> {
        let Some(elsewhere) = &mut self.elsewhere else { return send(&mut self.here, worker) };
        match self.numbers.origin.get(&worker) {
            None => Err(TransportError::Gone(worker)),
            Some((Side::Here, own)) => send(&mut self.here, *own),
            Some((Side::Elsewhere, own)) => send(elsewhere, *own),
        }
        .map_err(|error| if matches!(error, TransportError::Gone(_)) { TransportError::Gone(worker) } else { error })
    }
}

impl<P: MacroPort> MacroPort for JoinedPort<P> {
    fn poll(&mut self, wait: Duration, sink: &mut dyn FnMut(MacroEvent<'_>)) -> Result<usize, TransportError> {
        let Some(elsewhere) = &mut self.elsewhere else { return self.here.poll(wait, sink) };
        let numbers = &mut self.numbers;
        let mut events =
            elsewhere.poll(Duration::ZERO, &mut |event| sink(numbers.translate(Side::Elsewhere, event)))?;
        // What arrives from other hosts during the wait ends it: it rings here.
        let wait = if events > 0 { Duration::ZERO } else { wait };
        events += self.here.poll(wait, &mut |event| sink(numbers.translate(Side::Here, event)))?;
        events += elsewhere.poll(Duration::ZERO, &mut |event| sink(numbers.translate(Side::Elsewhere, event)))?;
        Ok(events)
    }

    fn send_control(&mut self, worker: WorkerId, message: &ToWorker) -> Result<(), TransportError> {
        self.route(worker, |port, own| port.send_control(own, message))
    }

    fn send_jobs(&mut self, worker: WorkerId, jobs: &[LoadedJob<'_>]) -> Result<(), TransportError> {
        self.route(worker, |port, own| port.send_jobs(own, jobs))
    }

    fn kill(&mut self, worker: WorkerId) {
        // One that is gone needs no end.
        let _ = self.route(worker, |port, own| {
            port.kill(own);
            Ok(())
        });
    }

    fn waker(&self) -> Arc<dyn Waker> {
        self.here.waker()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_both_sides_are_one_row_and_never_used_again() {
        let mut numbers = Numbers::default();
        let (here, there) = ((Side::Here, WorkerId(0)), (Side::Elsewhere, WorkerId(0)));
        assert_eq!([numbers.of(here.0, here.1), numbers.of(there.0, there.1)], [WorkerId(0), WorkerId(1)]);
        assert_eq!(numbers.of(here.0, here.1), WorkerId(0));
        assert_eq!(numbers.remove(here.0, here.1), WorkerId(0));
        assert_eq!((numbers.of(here.0, here.1), numbers.origin.len()), (WorkerId(2), 2));
    }
}
