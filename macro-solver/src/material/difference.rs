//! Tangents by finite differences, for engines that have none.
//!
//! [`DifferenceTangents`] sits between solver and material. A trial that asks for a tangent becomes several that ask for
//! none: the target itself and the target strained a little further along each strain component; the stress
//! differences are the operator's columns, and the spin part follows exactly from objectivity. Probes are expensive, so
//! they are made at a point's first evaluation after a commit or rollback and then again after every
//! [`DifferencePlan::reuses`] evaluations; in between the operator is kept (and a secant correction, if the solver has
//! one switched on, follows the point). It changes the path to the answer, never the answer: stresses and states are
//! those of the plain trials.

use crate::checkpoint::{Archive, CheckpointError};
use crate::material::{MaterialError, PointMaterial, PointTrial};
use protocol::{Observables, TangentKind, Tensor2, Tensor4, TrialOptions, TrialResult};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How the differences are taken.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct DifferencePlan {
    /// Space dimension, 2 or 3. No key.
    #[schemars(skip)]
    pub dimension: usize,
    /// Strain of a finite-difference perturbation where an engine has no tangents: large against the noise of a relaxed cell, small
    /// against a load step.
    #[serde(rename = "difference_strain")]
    #[schemars(extend("x-unit" = "-", "exclusiveMinimum" = 0), range(max = 0.01))]
    pub strain: f64,
    /// Evaluations of a step that share one operator found by differences.
    #[serde(rename = "difference_reuses")]
    #[schemars(range(min = 1))]
    pub reuses: u32,
}

impl Default for DifferencePlan {
    fn default() -> Self {
        Self::new(2)
    }
}

impl DifferencePlan {
    /// Probes of 1e-4, shared by four evaluations.
    pub fn new(dimension: usize) -> Self {
        Self { dimension, strain: 1e-4, reuses: 4 }
    }
}

/// What the differences cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DifferenceCounts {
    /// Operators made.
    pub operators: u64,
    /// Evaluations spent on them, beyond those that the solver counts.
    pub probes: u64,
    /// Force evaluations of these.
    pub force_evaluations: u64,
}

#[derive(Clone, Debug)]
struct Kept {
    operator: Box<Tensor4>,
    uses: u32,
}

/// A material whose points answer with tangents although its engine has none.
pub struct DifferenceTangents<'a> {
    material: &'a mut dyn PointMaterial,
    plan: DifferencePlan,
    /// For each point whether differences are wanted.
    wanted: Vec<bool>,
    kept: BTreeMap<usize, Kept>,
    counts: DifferenceCounts,
}

impl<'a> DifferenceTangents<'a> {
    /// Differences of `material`'s answers at those points for which `wanted` says so; the others are left alone.
    pub fn new(material: &'a mut dyn PointMaterial, plan: DifferencePlan, wanted: Vec<bool>) -> Self {
        Self { material, plan, wanted, kept: BTreeMap::new(), counts: DifferenceCounts::default() }
    }

    /// What they have cost so far.
    pub fn counts(&self) -> DifferenceCounts {
        self.counts
    }

    /// Whether the operator of this trial comes from here.
    fn is_ours(&self, trial: &PointTrial) -> bool {
        trial.options.tangent != TangentKind::None && self.wanted.get(trial.point).is_some_and(|wanted| *wanted)
    }

    /// Whether this trial needs a new operator.
    fn is_due(&self, trial: &PointTrial) -> bool {
        self.is_ours(trial) && self.kept.get(&trial.point).is_none_or(|kept| kept.uses >= self.plan.reuses)
    }
}

impl PointMaterial for DifferenceTangents<'_> {
    fn evaluate(&mut self, trials: &[PointTrial]) -> Result<Vec<TrialResult>, MaterialError> {
        let mut requests = Vec::new();
        let mut places = Vec::with_capacity(trials.len());
        for trial in trials {
            let probes = if self.is_due(trial) { probes(trial, &self.plan) } else { Vec::new() };
            requests.extend(probes.iter().map(|probe| probe.trial));
            // The plain trial comes last: the latest trial of a point is the one that can be committed.
            let tangent = if self.is_ours(trial) { TangentKind::None } else { trial.options.tangent };
            requests.push(PointTrial { options: TrialOptions { tangent, ..trial.options }, ..*trial });
            places.push(probes);
        }
        let mut found = self.material.evaluate(&requests)?.into_iter();
        let mut answers = Vec::with_capacity(trials.len());
        for (trial, probes) in trials.iter().zip(places) {
            let probed: Vec<TrialResult> = found.by_ref().take(probes.len()).collect();
            let mut answer = found.next().expect("a material answers every trial");
            if self.is_ours(trial) {
                if !probes.is_empty() {
                    self.counts.operators += 1;
                    self.counts.probes += probes.len() as u64;
                    self.counts.force_evaluations += probed.iter().map(|one| one.cost.force_evaluations).sum::<u64>();
                    let operator = Box::new(operator(&answer.stress, &probes, &probed, &self.plan));
                    self.kept.insert(trial.point, Kept { operator, uses: 0 });
                }
                let kept = self.kept.get_mut(&trial.point).expect("an operator that is missing is due");
                kept.uses += 1;
                answer.tangent = Some(kept.operator.clone());
            }
            answers.push(answer);
        }
        Ok(answers)
    }

    fn commit(&mut self) -> Result<(), MaterialError> {
        self.kept.clear();
        self.material.commit()
    }

    fn rollback(&mut self) {
        self.kept.clear();
        self.material.rollback();
    }

    fn mark(&mut self) {
        self.material.mark();
    }

    fn return_to_mark(&mut self) {
        self.kept.clear();
        self.material.return_to_mark();
    }

    fn save(&self, archive: &mut Archive) {
        self.material.save(archive);
    }

    fn restore(&mut self, archive: &Archive) -> Result<(), CheckpointError> {
        self.kept.clear();
        self.material.restore(archive)
    }
}

/// One strained trial.
struct Probe {
    /// Strain component `(i, j)`, `i <= j`.
    component: (usize, usize),
    /// Signed size of the strain.
    size: f64,
    trial: PointTrial,
}

/// The probes of a trial: `I + H' = (I + E)(I + H)` with one symmetric strain `E` each.
fn probes(trial: &PointTrial, plan: &DifferencePlan) -> Vec<Probe> {
    let h = &trial.target;
    let mut probes = Vec::new();
    for i in 0..plan.dimension {
        for j in i..plan.dimension {
            // Straining on in the direction of the step: a network answers differently to unloading.
            let rate = h.get(i, j) + h.get(j, i);
            let onwards = if rate == 0.0 { i != j } else { rate > 0.0 };
            let size = if onwards { plan.strain } else { -plan.strain };
            let mut strain = [[0.0; 3]; 3];
            strain[i][j] += 0.5 * size;
            strain[j][i] += 0.5 * size;
            let mut target = *h;
            for (row, strain_row) in strain.iter().enumerate() {
                for column in 0..3 {
                    let carried: f64 = (0..3).map(|k| strain_row[k] * h.get(k, column)).sum();
                    target.0[3 * row + column] += strain_row[column] + carried;
                }
            }
            let options = TrialOptions {
                tangent: TangentKind::None,
                observables: Observables::NONE,
                ramp_steps: trial.options.ramp_steps,
                friction_reduction: trial.options.friction_reduction,
            };
            probes.push(Probe { component: (i, j), size, trial: PointTrial { target, options, ..*trial } });
        }
    }
    probes
}

/// `C_ijkl` from the stress at the target and at its probes: `dF_kl` is the strain `(kl)` and a spin, and a spin `W`
/// changes the stress by `W s - s W`.
fn operator(stress: &Tensor2, probes: &[Probe], probed: &[TrialResult], plan: &DifferencePlan) -> Tensor4 {
    let mut operator = Tensor4::ZERO;
    for (probe, answer) in probes.iter().zip(probed) {
        let (k, l) = probe.component;
        for i in 0..plan.dimension {
            for j in 0..plan.dimension {
                let strained = (answer.stress.get(i, j) - stress.get(i, j)) / probe.size;
                if k == l {
                    operator.set(i, j, k, l, strained);
                    continue;
                }
                // W_kl = 1/2 = -W_lk belongs to dF_kl = 1.
                let spin = |row: usize, column: usize| match (row, column) {
                    pair if pair == (k, l) => 0.5,
                    pair if pair == (l, k) => -0.5,
                    _ => 0.0,
                };
                let turned: f64 = (0..3).map(|m| spin(i, m) * stress.get(m, j) - stress.get(i, m) * spin(m, j)).sum();
                operator.set(i, j, k, l, strained + turned);
                operator.set(i, j, l, k, strained - turned);
            }
        }
    }
    operator
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::elastic::{ElasticLaw, ElasticMaterial};

    fn material() -> ElasticMaterial {
        ElasticMaterial::new(ElasticLaw::SaintVenant, 5e7, 3e7, 2)
    }

    fn trial(point: usize, target: [[f64; 2]; 2]) -> PointTrial {
        let options = TrialOptions { tangent: TangentKind::TrussLike, ..TrialOptions::default() };
        PointTrial { point, target: Tensor2::from_plane(target), options }
    }

    #[test]
    fn operator_equals_that_of_a_law_with_a_tangent() {
        let trials = [trial(0, [[1e-3, 4e-3], [-2e-3, -5e-3]]), trial(1, [[0.0; 2]; 2])];
        let expected = material().evaluate(&trials).unwrap();
        let mut inner = material();
        let plan = DifferencePlan { strain: 1e-7, ..DifferencePlan::new(2) };
        let mut differences = DifferenceTangents::new(&mut inner, plan, vec![true; 2]);
        let found = differences.evaluate(&trials).unwrap();
        for (found, expected) in found.iter().zip(&expected) {
            assert_eq!(found.stress, expected.stress);
            let (found, expected) =
                (found.tangent.as_ref().unwrap().plane(), expected.tangent.as_ref().unwrap().plane());
            for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
                assert!((found - expected).abs() < 30.0, "{found} {expected}");
            }
        }
    }

    #[test]
    fn an_operator_is_kept_within_a_step_and_the_plain_trial_is_committed() {
        let (mut inner, mut plain) = (material(), material());
        let mut differences = DifferenceTangents::new(&mut inner, DifferencePlan::new(2), vec![true; 2]);
        for size in [1e-3, 1.1e-3, 1.2e-3] {
            differences.evaluate(&[trial(0, [[0.0, 0.0], [0.0, -size]])]).unwrap();
        }
        assert_eq!((differences.counts().operators, differences.counts().probes), (1, 3));
        differences.commit().unwrap();
        let next = trial(0, [[1e-3, 0.0], [0.0, 0.0]]);
        let found = differences.evaluate(&[next]).unwrap();
        assert_eq!(differences.counts().operators, 2);
        plain.evaluate(&[trial(0, [[0.0, 0.0], [0.0, -1.2e-3]])]).unwrap();
        plain.commit().unwrap();
        assert_eq!(found[0].stress, plain.evaluate(&[next]).unwrap()[0].stress);
    }

    #[test]
    fn points_with_a_tangent_of_their_own_and_trials_without_pass_unchanged() {
        let mut inner = material();
        let mut differences = DifferenceTangents::new(&mut inner, DifferencePlan::new(2), vec![true; 2]);
        let plain = PointTrial { options: TrialOptions::default(), ..trial(0, [[0.0, 0.0], [0.0, -1e-3]]) };
        assert_eq!(differences.evaluate(&[plain]).unwrap()[0].tangent, None);
        differences.wanted[0] = false;
        let own = trial(0, [[0.0, 0.0], [0.0, -1e-3]]);
        assert_eq!(differences.evaluate(&[own]).unwrap(), material().evaluate(&[own]).unwrap());
        assert_eq!(differences.counts(), DifferenceCounts::default());
    }
}
