//! The energy ledger of a run: what was put in, stored and lost, J per metre of thickness.

use macro_solver::observer::{FieldsView, Observer, PointFields, StepReport, StopRequest};
use std::collections::BTreeMap;

/// Adds up external work by the trapezium rule and remembers stored and dissipated energy of the body.
#[derive(Debug, Default)]
pub(super) struct EnergyLedger {
    external_work: f64,
    last: Option<Last>,
    initial_elastic: f64,
    elastic: f64,
    dissipation: f64,
}

#[derive(Debug)]
struct Last {
    displacements: Vec<[f64; 2]>,
    forces: Vec<[f64; 2]>,
}

impl EnergyLedger {
    /// All entries by name. The difference of work and the rest is what the damping of the grain solver took, plus the
    /// error of the trapezium rule.
    pub(super) fn entries(&self) -> BTreeMap<String, f64> {
        BTreeMap::from([
            ("external_work".to_owned(), self.external_work),
            ("elastic_initial".to_owned(), self.initial_elastic),
            ("elastic".to_owned(), self.elastic),
            ("frictional_dissipation".to_owned(), self.dissipation),
        ])
    }
}

impl Observer for EnergyLedger {
    fn accepted(&mut self, _report: &StepReport, view: &FieldsView<'_>) -> Result<(), StopRequest> {
        let total = |density: fn(&PointFields) -> f64| -> f64 {
            view.points.iter().map(|point| point.area * density(point)).sum()
        };
        self.elastic = total(|point| point.observed.elastic_energy);
        self.dissipation = total(|point| point.observed.frictional_dissipation);
        let forces: Vec<[f64; 2]> =
            view.reactions.iter().zip(view.loads).map(|(r, l)| [r[0] + l[0], r[1] + l[1]]).collect();
        match &self.last {
            None => self.initial_elastic = self.elastic,
            Some(last) => {
                for (node, force) in forces.iter().enumerate() {
                    let (before, path) =
                        (last.forces[node], moved(last.displacements[node], view.displacements[node]));
                    self.external_work += 0.5 * ((force[0] + before[0]) * path[0] + (force[1] + before[1]) * path[1]);
                }
            }
        }
        self.last = Some(Last { displacements: view.displacements.to_vec(), forces });
        Ok(())
    }
}

fn moved(from: [f64; 2], to: [f64; 2]) -> [f64; 2] {
    [to[0] - from[0], to[1] - from[1]]
}
