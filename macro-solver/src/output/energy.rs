//! Energy balance of a run: external work, stored and dissipated energy, J; in the plane per metre of thickness.

use crate::checkpoint::{Archive, CheckpointError};
use crate::observer::{FieldsView, Observer, PointFields, StepReport, StopRequest};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Integrates the external work of reactions and loads by the trapezium rule, over accepted steps or, in dynamic stages, over their time
/// steps, and records the stored and dissipated energy of the body.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct EnergyLedger {
    external_work: f64,
    last: Option<Last>,
    /// The dynamic stage of the last accepted state, with the external work that its own ledger had added up.
    motion: Option<(usize, f64)>,
    initial_elastic: f64,
    initial_hourglass: f64,
    initial_fluid: f64,
    /// Dissipated by friction, by numerical damping of the grains and by viscous stabilisation before the first accepted state: the work
    /// of step 0, which brings cells that do not match the loads to balance, is not known.
    dissipated_before: [f64; 3],
    elastic: f64,
    dissipation: f64,
    /// Taken by numerical damping of the grains.
    damping: f64,
    hourglass: f64,
    /// Of pore fluid that cannot drain.
    fluid: f64,
    /// Dissipated by viscous stabilisation.
    stabilisation: f64,
    /// Largest residual over the largest energy of each dynamic stage, as its last report has both: at its beginning, where there is hardly
    /// any energy, the ratio says nothing.
    residuals: BTreeMap<usize, f64>,
    /// Figures of dynamic stages, by name.
    dynamics: BTreeMap<String, f64>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Last {
    displacements: Vec<[f64; 3]>,
    forces: Vec<[f64; 3]>,
}

impl EnergyLedger {
    /// Figures of dynamic stages, by name; empty without any.
    pub fn dynamics(&self) -> BTreeMap<String, f64> {
        self.dynamics.clone()
    }

    /// All entries by name. Work and balance count from the end of step 0. The rest of the work, `residual`, is the error of the
    /// trapezium rule over the steps; `relative_residual` is its size over the largest entry. A run with dynamic stages has neither: its
    /// balance is among their figures. Without the energies of the grains, which the observable `energy` asks for (`grains_observed`), only
    /// the work outside them is known, and there is no balance. So it is where the engine of a point does not deliver one of them: the
    /// others are entries still.
    pub fn entries(&self, grains_observed: bool) -> BTreeMap<String, f64> {
        let mut entries = BTreeMap::from([
            ("external_work".to_owned(), self.external_work),
            ("hourglass".to_owned(), self.hourglass),
            ("stabilisation".to_owned(), self.stabilisation),
        ]);
        if self.fluid != 0.0 || self.initial_fluid != 0.0 {
            entries.insert("pore_fluid".to_owned(), self.fluid);
            entries.insert("pore_fluid_initial".to_owned(), self.initial_fluid);
        }
        if self.initial_hourglass != 0.0 {
            entries.insert("hourglass_initial".to_owned(), self.initial_hourglass);
        }
        if !grains_observed {
            return entries;
        }
        let of_grains = [
            (["elastic", "elastic_initial"], [self.elastic, self.initial_elastic]),
            (
                ["frictional_dissipation", "frictional_dissipation_initial"],
                [self.dissipation, self.dissipated_before[0]],
            ),
            (["damping_work", "damping_work_initial"], [self.damping, self.dissipated_before[1]]),
        ];
        // NaN where the engine of a point does not deliver it.
        let is_known = |energies: &[f64; 2]| energies.iter().all(|energy| energy.is_finite());
        for (names, energies) in of_grains.iter().filter(|(_, energies)| is_known(energies)) {
            entries.extend(names.iter().map(|name| (*name).to_owned()).zip(*energies));
        }
        let is_reported = [self.initial_elastic, self.elastic, self.dissipation].iter().any(|energy| *energy != 0.0);
        if self.dynamics.is_empty() && is_reported && of_grains.iter().all(|(_, energies)| is_known(energies)) {
            let change = self.elastic - self.initial_elastic;
            let [friction, damping, viscous] = self.dissipated_before;
            let consumed = [
                change,
                self.dissipation - friction,
                self.damping - damping,
                self.hourglass - self.initial_hourglass,
                self.fluid - self.initial_fluid,
                self.stabilisation - viscous,
            ];
            let residual = self.external_work - consumed.iter().sum::<f64>();
            // In a body that turns as a whole the work is next to nothing compared with what is stored all the time.
            let scale = self.external_work.abs().max(LEAST_WORK * self.initial_elastic.abs());
            let largest = consumed.iter().fold(scale, |most, value| most.max(value.abs()));
            entries.insert("residual".to_owned(), residual);
            let relative = if largest > 0.0 { residual.abs() / largest } else { 0.0 };
            entries.insert("relative_residual".to_owned(), relative);
        }
        entries
    }
}

/// Share of the elastic energy at the start, below which work is rounding to the energy balance.
const LEAST_WORK: f64 = 1e-3;

const SECTION: &str = "energy";

/// Counts changes of [`EnergyLedger`].
const VERSION: u32 = 7;

impl Observer for EnergyLedger {
    fn save(&self, archive: &mut Archive) {
        archive.put(SECTION, VERSION, self);
    }

    fn restore(&mut self, archive: &Archive) -> Result<(), CheckpointError> {
        *self = archive.get(SECTION, VERSION)?;
        Ok(())
    }

    fn accepted(&mut self, report: &StepReport, view: &FieldsView<'_>) -> Result<(), StopRequest> {
        let total = |density: fn(&PointFields) -> f64| -> f64 {
            view.points.iter().map(|point| point.volume * density(point)).sum()
        };
        self.elastic = total(|point| point.observed.elastic_energy);
        self.dissipation = total(|point| point.observed.frictional_dissipation);
        self.damping = total(|point| point.observed.damping_work);
        (self.hourglass, self.fluid) = (view.hourglass_energy, view.fluid_energy);
        self.stabilisation = view.statistics.stabilisation_work;
        if let Some(motion) = &view.dynamics {
            let largest = |name: &str, now: f64| now.max(self.dynamics.get(name).copied().unwrap_or(0.0));
            self.residuals.insert(report.stage, motion.energy.largest_relative_residual());
            let residual = self.residuals.values().fold(0.0, |most: f64, residual| most.max(*residual));
            let steps = largest("steps_off_energy_balance", motion.energy.longest_excess as f64);
            self.dynamics = BTreeMap::from([
                ("time_step".to_owned(), motion.time_step),
                ("stable_step".to_owned(), motion.stable_step),
                ("mass".to_owned(), motion.mass),
                ("added_mass".to_owned(), motion.added_mass),
                ("kinetic_energy".to_owned(), motion.energy.kinetic),
                ("energy_residual".to_owned(), residual),
                ("steps_off_energy_balance".to_owned(), steps),
            ]);
        }
        let forces: Vec<[f64; 3]> =
            view.reactions.iter().zip(view.loads).map(|(r, l)| std::array::from_fn(|i| r[i] + l[i])).collect();
        match &self.last {
            None => {
                self.initial_elastic = self.elastic;
                (self.initial_hourglass, self.initial_fluid) = (self.hourglass, self.fluid);
                self.dissipated_before = [self.dissipation, self.damping, self.stabilisation];
            }
            // A motion swings many times between two reports; its own ledger has every time step.
            Some(_) if let Some(motion) = &view.dynamics => {
                let before = self.motion.filter(|(stage, _)| *stage == report.stage).map_or(0.0, |(_, work)| work);
                self.external_work += motion.energy.external - before;
            }
            Some(last) => {
                for (node, force) in forces.iter().enumerate() {
                    let before = last.forces[node];
                    let path = path_between(last.displacements[node], view.displacements[node]);
                    self.external_work += (0..3).map(|i| 0.5 * (force[i] + before[i]) * path[i]).sum::<f64>();
                }
            }
        }
        self.motion = view.dynamics.as_ref().map(|motion| (report.stage, motion.energy.external));
        self.last = Some(Last { displacements: view.displacements.to_vec(), forces });
        Ok(())
    }
}

/// Displacement from one position to another, m.
fn path_between(from: [f64; 3], to: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| to[i] - from[i])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::ElementKind;
    use crate::mesh::block::Block;
    use crate::observer::{DynamicsView, EnergyBalance, Statistics};
    use crate::output::probe::tests::{point, report};
    use protocol::OptionalResult;

    /// Friction while step 0 brings cells to balance has no work to be compared with; it opened the balance.
    #[test]
    fn the_balance_counts_from_the_end_of_step_0() {
        let mesh = Block::plane([1.0, 1.0], [1, 1], ElementKind::Q4).mesh().unwrap();
        let mut ledger = EnergyLedger::default();
        let mut accept = |step: usize, [dissipation, damping, elastic, fluid, viscous]: [f64; 5], moved: f64| {
            let mut fields = point(1.0, [[0.0; 2]; 2], 1.0);
            (fields.observed.frictional_dissipation, fields.observed.elastic_energy) = (dissipation, elastic);
            fields.observed.damping_work = damping;
            let still = vec![[0.0; 3]; mesh.nodes.len()];
            let (mut displacements, mut loads) = (still.clone(), still.clone());
            (displacements[0][0], loads[0][0]) = (moved, 2.0);
            let view = FieldsView {
                mesh: &mesh,
                displacements: &displacements,
                reactions: &still,
                loads: &loads,
                hourglass_energy: 0.0,
                fluid_energy: fluid,
                dynamics: None,
                points: &[fields],
                statistics: &Statistics { stabilisation_work: viscous, ..Statistics::default() },
            };
            ledger.accepted(&report(step, 0, step as f64), &view).unwrap();
        };
        accept(0, [7.0, 1.0, 3.0, 0.5, 2.0], 0.0);
        accept(1, [7.5, 1.125, 3.25, 0.5625, 2.0625], 0.5);
        let entries = ledger.entries(true);
        assert_eq!(entries["external_work"], 1.0);
        assert_eq!((entries["frictional_dissipation"], entries["frictional_dissipation_initial"]), (7.5, 7.0));
        assert_eq!((entries["damping_work"], entries["damping_work_initial"]), (1.125, 1.0));
        assert_eq!(entries["pore_fluid"], 0.5625);
        assert_eq!((entries["residual"], entries["relative_residual"]), (0.0, 0.0));
    }

    /// The elastic energy of such a body is known, the work of friction and damping is not: it was written as zero, and the balance made up
    /// with it. A summary cannot hold NaN either.
    #[test]
    fn energies_that_an_engine_does_not_deliver_are_no_entries_and_leave_no_balance() {
        let lacking = [OptionalResult::FrictionalDissipation, OptionalResult::DampingWork];
        let mesh = Block::plane([1.0, 1.0], [1, 1], ElementKind::Q4).mesh().unwrap();
        let still = vec![[0.0; 3]; mesh.nodes.len()];
        let fields = point(1.0, [[0.0; 2]; 2], 1.0);
        let unknown = PointFields { observed: fields.observed.without(&lacking), ..fields.clone() };
        let mut ledger = EnergyLedger::default();
        let view = FieldsView {
            mesh: &mesh,
            displacements: &still,
            reactions: &still,
            loads: &still,
            hourglass_energy: 0.0,
            fluid_energy: 0.0,
            dynamics: None,
            points: &[fields, unknown],
            statistics: &Statistics::default(),
        };
        ledger.accepted(&report(0, 0, 0.0), &view).unwrap();
        let entries = ledger.entries(true);
        let names: Vec<&str> = entries.keys().map(String::as_str).collect();
        assert_eq!(names, ["elastic", "elastic_initial", "external_work", "hourglass", "stabilisation"]);
        assert_eq!(entries["elastic"], 6.0);
    }

    /// Hands the report of a body that stands still to a ledger, with the energies of its motion if there is one.
    fn accept_motion(
        ledger: &mut EnergyLedger,
        step: usize,
        stage: usize,
        energy: Option<EnergyBalance>,
        hourglass_energy: f64,
    ) {
        let mesh = Block::plane([1.0, 1.0], [1, 1], ElementKind::Q4).mesh().unwrap();
        let still = vec![[0.0; 3]; mesh.nodes.len()];
        let view = FieldsView {
            mesh: &mesh,
            displacements: &still,
            reactions: &still,
            loads: &still,
            hourglass_energy,
            fluid_energy: 0.0,
            dynamics: energy.map(|energy| DynamicsView {
                velocities: &still,
                accelerations: &still,
                energy,
                time_step: 1.0,
                stable_step: 2.0,
                added_mass: 0.0,
                mass: 1.0,
            }),
            points: &[point(1.0, [[0.0; 2]; 2], 1.0)],
            statistics: &Statistics::default(),
        };
        let report = StepReport { stage, ..report(step, 0, step as f64) };
        ledger.accepted(&report, &view).unwrap();
    }

    /// A motion begins with hardly any energy, of which any residual is a large share: with reports that are close together it was taken for
    /// the error of the whole motion.
    #[test]
    fn the_residual_of_a_motion_is_over_its_largest_energy_whenever_it_is_reported() {
        let residual = |reports: &[(usize, f64, f64)]| {
            let mut ledger = EnergyLedger::default();
            for (step, &(stage, largest_residual, largest)) in reports.iter().enumerate() {
                let energy = EnergyBalance { largest_residual, largest, ..EnergyBalance::default() };
                accept_motion(&mut ledger, step, stage, Some(energy), 0.0);
            }
            ledger.dynamics()["energy_residual"]
        };
        assert_eq!(residual(&[(0, 1e-3, 1e-3), (0, 1e-3, 1.0), (0, 2e-3, 2.0)]), 1e-3);
        assert_eq!(residual(&[(0, 2e-3, 2.0)]), 1e-3);
        // An earlier stage keeps what it ended with.
        assert_eq!(residual(&[(0, 0.5, 1.0), (1, 1e-3, 2.0)]), 0.5);
    }

    /// Between two reports a motion may swing many times; the ledger of the motion counts, from the beginning of each stage.
    #[test]
    fn the_work_of_a_motion_is_that_of_its_time_steps() {
        let mut ledger = EnergyLedger::default();
        let mut accept = |step: usize, stage: usize, work: Option<f64>, hourglass: f64| {
            let energy = work.map(|external| EnergyBalance { external, ..EnergyBalance::default() });
            accept_motion(&mut ledger, step, stage, energy, hourglass);
            ledger.entries(true)
        };
        let start = accept(0, 0, None, 0.25);
        assert_eq!(
            (start["external_work"], start["residual"]),
            (0.0, 0.0),
            "step 0 has filled the hourglass control"
        );
        accept(1, 0, Some(3.0), 0.25);
        accept(2, 0, Some(2.0), 0.25);
        assert_eq!(accept(3, 1, Some(0.5), 0.25)["external_work"], 2.5);
    }
}
