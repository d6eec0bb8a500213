//! Engines without grains: one whose trials cost nothing, one whose trials take as long as their target says.

use protocol::{
    Capabilities, Cost, Definition, Observed, RveEngine, RveError, RveSolver, Scalars, Tensor2, TrialFlags,
    TrialOptions, TrialResult,
};
use std::thread::sleep;
use std::time::Duration;

/// Lengths of the snapshots of RVEs without grains, bytes: next to nothing, and as long as that of 400 discs.
pub(crate) const EMPTY_SNAPSHOTS: [usize; 2] = [64, 28_000];

/// An RVE that costs nothing and whose snapshot has this length.
pub(crate) fn idle_definition(snapshot: usize) -> Definition {
    Definition { bytes: (snapshot as u64).to_le_bytes().to_vec() }
}

/// An RVE for [`PausingEngine`].
pub(crate) fn pausing_definition() -> Definition {
    Definition { bytes: b"pauses".to_vec() }
}

fn capabilities(engine: &str) -> Capabilities {
    Capabilities {
        engine: engine.to_owned(),
        version: "1".to_owned(),
        dimensions: vec![2],
        deterministic: true,
        ..Capabilities::default()
    }
}

/// What is left of an RVE without grains: the bits of the sum of its targets, cut or filled up to the length of its snapshot.
#[derive(Clone, Debug)]
struct Hollow {
    length: usize,
    committed: Tensor2,
    trial: Option<Tensor2>,
    pauses: bool,
}

impl Hollow {
    fn write(&self, state: &Tensor2, out: &mut Vec<u8>) {
        out.clear();
        out.extend(state.0.iter().flat_map(|component| component.to_le_bytes()));
        out.resize(self.length, 0);
    }
}

impl RveSolver for Hollow {
    fn trial(&mut self, target: &Tensor2, options: &TrialOptions) -> Result<TrialResult, RveError> {
        let mut cost = Cost { ramp_steps: u64::from(options.ramp_steps), ..Cost::default() };
        if self.pauses {
            let pause = Duration::from_secs_f64(target.0[0].clamp(0.0, 60.0));
            sleep(pause);
            cost.solve_nanoseconds = pause.as_nanos() as u64;
            // The part of the target that says whether the forecast may learn what this cost.
            cost.force_evaluations = if target.0[4] > 0.0 { pause.as_micros() as u64 } else { 0 };
        }
        self.trial = Some(Tensor2(std::array::from_fn(|entry| self.committed.0[entry] + target.0[entry])));
        Ok(TrialResult {
            stress: *target,
            tangent: None,
            scalars: Scalars::default(),
            observed: Observed::default(),
            cost,
            flags: TrialFlags::default(),
        })
    }

    fn commit(&mut self) -> Result<(), RveError> {
        self.committed = self.trial.take().ok_or(RveError::NothingToCommit)?;
        Ok(())
    }

    fn rollback(&mut self) {
        self.trial = None;
    }

    fn snapshot(&self, out: &mut Vec<u8>) {
        self.write(&self.committed, out);
    }

    fn snapshot_trial(&self, out: &mut Vec<u8>) -> Result<(), RveError> {
        let trial = self.trial.ok_or(RveError::NothingToCommit)?;
        self.write(&trial, out);
        Ok(())
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), RveError> {
        if bytes.len() != self.length {
            return Err(RveError::Snapshot(format!("a snapshot of {} bytes", bytes.len())));
        }
        self.committed = Tensor2::ZERO;
        for (component, bytes) in self.committed.0.iter_mut().zip(bytes.chunks_exact(8)) {
            *component = f64::from_le_bytes(bytes.try_into().expect("chunks of eight"));
        }
        self.trial = None;
        Ok(())
    }
}

/// Answers at once.
#[derive(Debug)]
pub(super) struct IdleEngine;

impl RveEngine for IdleEngine {
    fn capabilities(&self) -> Capabilities {
        capabilities("idle")
    }

    fn create(&mut self, definition: &Definition) -> Result<Box<dyn RveSolver>, RveError> {
        let length = <[u8; 8]>::try_from(definition.bytes.as_slice()).ok().map(u64::from_le_bytes);
        let length = length.and_then(|length| usize::try_from(length).ok()).filter(|length| *length <= 8 << 20);
        let length = length.ok_or_else(|| RveError::Definition("no length of a snapshot".to_owned()))?;
        Ok(Box::new(Hollow { length, committed: Tensor2::ZERO, trial: None, pauses: false }))
    }
}

/// Sleeps for as many seconds as the first component of the target says. Sleeping workers show what the order of jobs
/// does even where there are fewer cores than workers.
#[derive(Debug)]
pub(super) struct PausingEngine;

impl RveEngine for PausingEngine {
    fn capabilities(&self) -> Capabilities {
        capabilities("pausing")
    }

    fn create(&mut self, _definition: &Definition) -> Result<Box<dyn RveSolver>, RveError> {
        Ok(Box::new(Hollow { length: 72, committed: Tensor2::ZERO, trial: None, pauses: true }))
    }
}
