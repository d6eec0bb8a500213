//! The worker processes of all engines of one run.

use super::worker_processes::WorkerProcesses;
use macro_solver::pool::{SupplyStatus, WorkerSupply};

/// One group of processes per engine.
#[derive(Debug)]
pub struct WorkerGroups(
    /// The groups.
    pub Vec<WorkerProcesses>,
);

impl WorkerSupply for WorkerGroups {
    fn joined(&mut self, pid: u32) {
        self.0.iter_mut().for_each(|one| one.joined(pid));
    }

    fn refused(&mut self, pid: u32, reason: &str) {
        self.0.iter_mut().for_each(|one| one.refused(pid, reason));
    }

    fn lost(&mut self, pid: u32, had_completed_job: bool) {
        self.0.iter_mut().for_each(|one| one.lost(pid, had_completed_job));
    }

    fn left(&mut self, pid: u32, had_completed_job: bool) {
        self.0.iter_mut().for_each(|one| one.left(pid, had_completed_job));
    }

    fn tend(&mut self) -> SupplyStatus {
        let outlooks: Vec<(bool, SupplyStatus)> = self
            .0
            .iter_mut()
            .map(|one| (one.tend(), one.is_deserted()))
            .map(|(outlook, deserted)| (deserted, outlook))
            .collect();
        let mut soonest = None;
        for (deserted, outlook) in outlooks {
            match outlook {
                // The points of an engine that has no worker and gets none cannot be solved, whatever the others do.
                SupplyStatus::Exhausted(reason) if deserted => return SupplyStatus::Exhausted(reason),
                SupplyStatus::Exhausted(reason) if self.0.len() == 1 => return SupplyStatus::Exhausted(reason),
                SupplyStatus::Exhausted(_) => {}
                SupplyStatus::Expected { check_again } => {
                    soonest = Some(soonest.map_or(check_again, |other: std::time::Duration| other.min(check_again)));
                }
            }
        }
        match soonest {
            Some(check_again) => SupplyStatus::Expected { check_again },
            None => SupplyStatus::Exhausted("no engine gets another worker".to_owned()),
        }
    }

    fn restarts(&self) -> u64 {
        self.0.iter().map(WorkerProcesses::restarts).sum()
    }

    fn finish(&mut self) {
        self.0.iter_mut().for_each(WorkerProcesses::finish);
    }
}
