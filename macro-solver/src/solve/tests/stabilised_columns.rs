//! Viscous stabilisation where nothing snaps: a history-dependent column ends where Newton's method brings it, however many rows it
//! has, and no increment on the way strains a point by more than the cap. And what the drag decides where something snaps.

use super::stabilisation::{Watch, pulled, weak_at_the_bottom};
use super::*;
use crate::formulation::Formulation;
use crate::formulation::tensor::{column, isotropic_moduli, matrix, tensor, wire_operator};
use crate::material::PointId;
use crate::observer::Outcome;
use crate::problem::{Platen, Stabilisation};
use nalgebra::Matrix3;
use protocol::{Cost, Observed, Scalars, TangentKind, TrialFlags};

const LAMBDA: f64 = 2.0e7;
const SHEAR: f64 = 1.0e7;

/// Yield stress and its growth with the plastic strain, as norms of deviators, Pa.
const YIELD: f64 = 4.0e3;
const HARDENING: f64 = 4.0e6;

/// Cap on the change of a displacement gradient in one increment.
const CAP: f64 = 1e-4;

#[derive(Clone, Copy)]
struct State {
    stress: Matrix3<f64>,
    plastic: f64,
    /// Plastic work, J/m3.
    lost: f64,
}

/// Mises plasticity with linear hardening in rate form: the work that it loses tells every detour. Remembers the largest
/// component of any target that was committed.
struct Plastic {
    committed: Vec<State>,
    marked: Vec<State>,
    trials: Vec<Option<(State, f64)>>,
    largest: f64,
}

impl Plastic {
    fn new(points: usize) -> Self {
        let start = State { stress: Matrix3::zeros(), plastic: 0.0, lost: 0.0 };
        Self { committed: vec![start; points], marked: Vec::new(), trials: vec![None; points], largest: 0.0 }
    }

    fn answer(&mut self, trial: &PointTrial) -> TrialResult {
        let from = self.committed[trial.point];
        let gradient = matrix(&trial.target);
        let strain = 0.5 * (gradient + gradient.transpose());
        let elastic = isotropic_moduli(LAMBDA, SHEAR);
        let stress = from.stress + Matrix3::identity() * (LAMBDA * strain.trace()) + strain * (2.0 * SHEAR);
        let deviator = stress - Matrix3::identity() * (stress.trace() / 3.0);
        let excess = deviator.norm() - YIELD - HARDENING * from.plastic;
        let (mut state, mut moduli) = (State { stress, ..from }, elastic);
        if excess > 0.0 {
            let direction = deviator / deviator.norm();
            let slip = excess / (2.0 * SHEAR + HARDENING);
            state.stress -= direction * (2.0 * SHEAR * slip);
            state.plastic += slip;
            state.lost += slip * (YIELD + HARDENING * (from.plastic + 0.5 * slip));
            let along = column(&direction);
            moduli -= along * along.transpose() * ((2.0 * SHEAR).powi(2) / (2.0 * SHEAR + HARDENING));
        }
        self.trials[trial.point] = Some((state, gradient.amax()));
        TrialResult {
            stress: tensor(&state.stress),
            tangent: (trial.options.tangent != TangentKind::None).then(|| Box::new(wire_operator(&moduli))),
            scalars: Scalars::default(),
            observed: Observed::default(),
            cost: Cost::default(),
            flags: TrialFlags::default(),
        }
    }
}

impl PointMaterial for Plastic {
    fn evaluate(&mut self, trials: &[PointTrial]) -> Result<Vec<TrialResult>, MaterialError> {
        Ok(trials.iter().map(|trial| self.answer(trial)).collect())
    }

    fn commit(&mut self) -> Result<(), MaterialError> {
        for (committed, trial) in self.committed.iter_mut().zip(&mut self.trials) {
            if let Some((state, size)) = trial.take() {
                *committed = state;
                self.largest = self.largest.max(size);
            }
        }
        Ok(())
    }

    fn rollback(&mut self) {
        self.trials.fill(None);
    }

    fn mark(&mut self) {
        self.marked.clone_from(&self.committed);
    }

    fn return_to_mark(&mut self) {
        self.committed.clone_from(&self.marked);
        self.rollback();
    }

    fn copy_state(&mut self, from: PointId, to: PointId) {
        (self.committed[to], self.trials[to]) = (self.committed[from], None);
    }
}

/// A column of unit cells between smooth platens under a lateral pressure, shortened in one step by `strain`.
fn column_of(kind: ElementKind, rows: usize, strain: f64) -> Problem {
    let platen = |nodes: &str, displacement| Condition::Platen {
        nodes: nodes.into(),
        contact: Platen::Smooth,
        axis: Axis::Y,
        displacement,
    };
    let conditions =
        vec![Condition::fixed("bottom_left", Axis::X), platen("bottom", 0.0), platen("top", -strain * rows as f64)];
    let mut problem = Problem::new(block(kind, 1, rows), conditions);
    problem.formulation = Formulation::SmallStrain;
    let stage = &mut problem.stages[0];
    (stage.control.increments, stage.control.max_iterations) = (1, 50);
    stage.tolerances = Tolerances::both(1e-8, 1e-8);
    stage.strategy.capped_change = CAP;
    problem
}

#[test]
fn stabilisation_without_a_snap_ends_where_newton_does_for_any_number_of_rows() {
    for (kind, strain) in [(ElementKind::Q4, 3e-4), (ElementKind::Q4, 1.03e-3), (ElementKind::Q8, 6e-4)] {
        for rows in [2, 4, 8, 16] {
            let mut problem = column_of(kind, rows, strain);
            let solved = |problem: &Problem| {
                let mut material = Plastic::new(problem.point_count());
                let (run, record) = run(problem, &mut material);
                assert!(matches!(run.outcome, Outcome::Completed), "{kind:?} {rows}: {:?}", run.outcome);
                (run, record, material)
            };
            // What the steps' own increments would be, one cap each.
            problem.stages[0].control.increments = (strain / CAP).ceil() as usize;
            let (_, newton, plastic) = solved(&problem);
            problem.stages[0].control.increments = 1;
            problem.stages[0].control.max_iterations = 1;
            problem.stages[0].control.stabilisation =
                Some(Stabilisation { after: Some(1), ..Stabilisation::default() });
            let (run, stabilised, yielded) = solved(&problem);
            let what = format!("{kind:?}, {rows} rows, {strain}");
            assert_eq!(run.statistics.stabilised_steps, 1, "{what}");
            let [wanted, found] = [&newton, &stabilised].map(|record| record.points[0].stress.plane()[1][1]);
            assert!((found / wanted - 1.0).abs() < 1e-3, "{what}: {found} instead of {wanted}");
            assert!(yielded.largest <= CAP * (1.0 + 1e-6), "{what}: strained by {} at once", yielded.largest);
            for (number, (stabilised, newton)) in yielded.committed.iter().zip(&plastic.committed).enumerate() {
                let (found, wanted) = (stabilised.lost, newton.lost);
                assert!(
                    wanted > 0.0 && (found / wanted - 1.0).abs() < 1e-2,
                    "{what}, point {number}: {found} {wanted}"
                );
            }
        }
    }
}

/// Supports that lie still leave nothing to the cap: the column comes to the same state under a load alone.
#[test]
fn stabilisation_under_a_growing_load_stays_near_equilibrium() {
    let mut problem = column_of(ElementKind::Q4, 8, 0.0);
    let pushed = Condition::Traction { sides: "top".into(), value: [0.0, -1.2e4, 0.0] };
    problem.stages[0].conditions.pop();
    problem.stages[0].conditions.push(pushed.into());
    problem.stages[0].control.max_iterations = 1;
    problem.stages[0].control.stabilisation = Some(Stabilisation { after: Some(1), ..Stabilisation::default() });
    let mut material = Plastic::new(problem.point_count());
    let (run, record) = run(&problem, &mut material);
    assert!(matches!(run.outcome, Outcome::Completed), "{:?}", run.outcome);
    assert!(record.points.iter().all(|point| (point.stress.plane()[1][1] / -1.2e4 - 1.0).abs() < 1e-6));
    assert!(material.largest <= CAP * (1.0 + 1e-6), "{}", material.largest);
    assert!(material.committed.iter().all(|state| state.lost > 0.0));
}

/// On a softening column with one far branch all drags end on it, with the same work.
#[test]
fn the_drag_changes_the_way_and_not_the_far_branch() {
    let ends = [0.03, 0.1, 0.3].map(|viscosity| {
        let mut problem = pulled(1e-2);
        problem.stages[0].control.stabilisation = Some(Stabilisation { viscosity, ..Stabilisation::default() });
        let (mut material, mut watch) = (weak_at_the_bottom(), Watch::default());
        let run = solve(&problem, &mut material, &mut watch);
        assert!(matches!(run.outcome, Outcome::Completed), "{viscosity}: {:?}", run.outcome);
        assert_eq!(watch.stabilised.len(), 1, "{viscosity}");
        (material.largest_strain(0), run.statistics.stabilisation_work)
    });
    for end in &ends {
        assert!((end.0 / ends[1].0 - 1.0).abs() < 1e-6 && (end.1 / ends[1].1 - 1.0).abs() < 0.1, "{ends:?}");
    }
}
