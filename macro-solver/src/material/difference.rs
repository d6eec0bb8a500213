//! Tangents by finite differences, for engines that have none.
//!
//! [`DifferenceTangents`] sits between solver and material. A trial that asks for a tangent becomes several that ask for
//! none: the target itself and the target strained a little further along each strain component; the stress
//! differences are the operator's columns, and the spin part follows exactly from objectivity. Probes are expensive, so
//! they are made at a point's first evaluation after a commit or rollback and then again after every
//! [`DifferencePlan::reuses`] evaluations; in between the operator is kept (and a secant correction, if the solver has
//! one switched on, follows the point). Where a probe is refused, the operator that the point had before serves: the
//! plain trial need not be refused as well. It changes the path to the answer, never the answer: stresses and states are
//! those of the plain trials.

use crate::checkpoint::{Archive, CheckpointError};
use crate::material::{MaterialError, PointId, PointMaterial, PointTrial};
use protocol::{Observables, TangentKind, Tensor2, Tensor4, TrialOptions, TrialResult};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

const SECTION: &str = "difference tangents";

/// Counts changes of [`Record`].
const VERSION: u32 = 1;

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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DifferenceCounts {
    /// Operators made.
    pub operators: u64,
    /// Evaluations spent on them, beyond those that the solver counts.
    pub probes: u64,
    /// Force evaluations of these.
    pub force_evaluations: u64,
    /// Operators that were not made because a probe was refused: the point went on with the one before.
    pub refused: u64,
}

/// The latest operator of a point.
#[derive(Clone, Debug)]
struct Kept {
    operator: Box<Tensor4>,
    /// Evaluations that it has served; `None` for one from before the last commit or rollback.
    uses: Option<u32>,
}

/// What a checkpoint keeps.
#[derive(Serialize, Deserialize)]
struct Record {
    counts: DifferenceCounts,
    /// Points and the components of their operators.
    operators: Vec<(u64, Vec<f64>)>,
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
        let is_worn = |kept: &Kept| kept.uses.is_none_or(|uses| uses >= self.plan.reuses);
        self.is_ours(trial) && self.kept.get(&trial.point).is_none_or(is_worn)
    }

    /// Asks for the trials, each behind its probes.
    fn ask(&mut self, trials: &[PointTrial], probes: &[Vec<Probe>]) -> Result<Vec<TrialResult>, MaterialError> {
        let mut requests = Vec::new();
        for (trial, probes) in trials.iter().zip(probes) {
            requests.extend(probes.iter().map(|probe| probe.trial));
            // The plain trial comes last: the latest trial of a point is the one that can be committed.
            let tangent = if self.is_ours(trial) { TangentKind::None } else { trial.options.tangent };
            requests.push(PointTrial { options: TrialOptions { tangent, ..trial.options }, ..*trial });
        }
        self.material.evaluate(&requests)
    }

    /// Takes the probes of the point whose target was refused out of a request, if they may have been what was refused and the point has an
    /// operator of its own, which then serves as a new one would; whether it did.
    fn give_up(&mut self, error: &MaterialError, trials: &[PointTrial], probes: &mut [Vec<Probe>]) -> bool {
        let MaterialError::Point { point, .. } = error else { return false };
        let refused = trials.iter().position(|trial| trial.point == *point);
        let Some(place) = refused.filter(|place| !probes[*place].is_empty() && error.is_curable_by_smaller_step())
        else {
            return false;
        };
        let Some(kept) = self.kept.get_mut(point) else { return false };
        kept.uses = Some(0);
        probes[place].clear();
        true
    }

    /// Operators of earlier states are not those of the coming ones; they serve where no other can be found.
    fn age(&mut self) {
        self.kept.values_mut().for_each(|kept| kept.uses = None);
    }
}

impl PointMaterial for DifferenceTangents<'_> {
    fn evaluate(&mut self, trials: &[PointTrial]) -> Result<Vec<TrialResult>, MaterialError> {
        let of_trial = |trial| if self.is_due(trial) { probes(trial, &self.plan) } else { Vec::new() };
        let mut places: Vec<Vec<Probe>> = trials.iter().map(of_trial).collect();
        let mut given_up = 0;
        let mut found = loop {
            match self.ask(trials, &places) {
                Ok(found) => break found,
                Err(error) if self.give_up(&error, trials, &mut places) => given_up += 1,
                Err(error) => return Err(error),
            }
        }
        .into_iter();
        self.counts.refused += given_up;
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
                    self.kept.insert(trial.point, Kept { operator, uses: Some(0) });
                }
                let kept = self.kept.get_mut(&trial.point).expect("an operator that is missing is due");
                kept.uses = kept.uses.map(|uses| uses + 1);
                answer.tangent = Some(kept.operator.clone());
            }
            answers.push(answer);
        }
        Ok(answers)
    }

    fn commit(&mut self) -> Result<(), MaterialError> {
        self.age();
        self.material.commit()
    }

    fn rollback(&mut self) {
        self.age();
        self.material.rollback();
    }

    fn mark(&mut self) {
        self.material.mark();
    }

    fn return_to_mark(&mut self) {
        self.age();
        self.material.return_to_mark();
    }

    fn copy_state(&mut self, from: PointId, to: PointId) {
        self.kept.remove(&to);
        self.material.copy_state(from, to);
    }

    fn save(&self, archive: &mut Archive) {
        // Nothing of it where every engine has tangents.
        if self.wanted.contains(&true) {
            let operators = self.kept.iter().map(|(point, kept)| (*point as u64, kept.operator.0.to_vec())).collect();
            archive.put(SECTION, VERSION, &Record { counts: self.counts, operators });
        }
        self.material.save(archive);
    }

    fn restore(&mut self, archive: &Archive) -> Result<(), CheckpointError> {
        self.kept.clear();
        if self.wanted.contains(&true) {
            let record: Record = archive.get(SECTION, VERSION)?;
            for (point, components) in record.operators {
                let unfit = || CheckpointError::unfit(SECTION, "an operator is that of no point of this run");
                let point =
                    usize::try_from(point).ok().filter(|point| *point < self.wanted.len()).ok_or_else(unfit)?;
                let components = components.try_into().map_err(|_: Vec<f64>| unfit())?;
                self.kept.insert(point, Kept { operator: Box::new(Tensor4(components)), uses: None });
            }
            self.counts = record.counts;
        }
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
    use crate::material::altered::{Altered, Timid};
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

    fn compressed(size: f64) -> PointTrial {
        trial(0, [[0.0, 0.0], [0.0, -size]])
    }

    /// A target close to what the engine takes at most was refused for its probes, which lie beyond.
    #[test]
    fn a_refused_probe_leaves_the_trial_with_the_operator_before() {
        let mut inner = Altered { material: material(), alteration: Timid::new(1.05e-3) };
        let mut differences = DifferenceTangents::new(&mut inner, DifferencePlan::new(2), vec![true; 2]);
        let first = differences.evaluate(&[compressed(1e-3)]);
        assert!(matches!(first, Err(MaterialError::Point { point: 0, .. })), "there is no operator yet");
        let before = differences.evaluate(&[compressed(5e-4)]).unwrap()[0].tangent.clone();
        let both = [compressed(1e-3), trial(1, [[1e-5, 0.0], [0.0, 0.0]])];
        differences.rollback();
        assert_eq!(differences.evaluate(&both).unwrap()[0].tangent, before);
        assert_eq!(
            (differences.counts().refused, differences.counts().operators),
            (1, 2),
            "the other point has none yet"
        );
        differences.commit().unwrap();
        assert_eq!(differences.evaluate(&both).unwrap()[0].tangent, before);
        assert_eq!(
            (differences.counts().refused, differences.counts().operators),
            (2, 3),
            "the other point makes a new one"
        );
        assert!(differences.evaluate(&[compressed(1.1e-3)]).is_err(), "the trial itself");
    }

    #[test]
    fn counts_and_operators_are_those_of_the_run_after_it_has_been_resumed() {
        let mut inner = material();
        let mut differences = DifferenceTangents::new(&mut inner, DifferencePlan::new(2), vec![true; 2]);
        let tangent = differences.evaluate(&[compressed(1e-3)]).unwrap()[0].tangent.clone();
        differences.commit().unwrap();
        let (counts, mut archive) = (differences.counts(), Archive::new());
        assert_eq!((counts.operators, counts.probes), (1, 3));
        differences.save(&mut archive);
        let mut later = Altered { material: material(), alteration: Timid::new(1.05e-3) };
        let mut resumed = DifferenceTangents::new(&mut later, DifferencePlan::new(2), vec![true; 2]);
        resumed.restore(&archive).unwrap();
        assert_eq!(resumed.counts(), counts);
        assert_eq!(resumed.evaluate(&[compressed(1e-3)]).unwrap()[0].tangent, tangent);
        assert_eq!(resumed.counts().refused, 1);
        let mut fewer = DifferenceTangents::new(&mut later, DifferencePlan::new(2), Vec::new());
        fewer.restore(&archive).unwrap();
        assert_eq!(fewer.counts(), DifferenceCounts::default());
    }
}
