//! When a step counts as converged: what is measured, against what, and which measures have to hold together.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the out-of-balance force is compared with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ForceMeasure {
    /// The norm of the reactions or of the applied loads, whichever is larger.
    #[default]
    Largest,
    /// The norm of the reactions alone: FNORM/RNORM of [Argilaga2018], whose limit is 1e-2.
    Reactions,
}

/// What the correction that the accepted state would still get is compared with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DisplacementMeasure {
    /// The norm of the displacements of a full step, `1 / increments` of the stage, at the rate of this step. Errors do
    /// not add up over steps, since every step restores the whole balance; so a step that was cut back is not held to a
    /// smaller absolute error.
    #[default]
    FullStep,
    /// The norm of the displacements of this step: UNORM/DNORM of [Argilaga2018], whose limit is 5e-3. The footnote there
    /// that defines the two norms exchanges their names; the ratio can only fall to a limit if the correction of one
    /// iteration stands above the increment of the whole step.
    Step,
}

/// The criteria that have to hold, all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "Vec<Criterion>", into = "Vec<Criterion>")]
pub struct Criteria {
    /// Out-of-balance force.
    pub force: Option<ForceMeasure>,
    /// Next correction of the displacements. It comes from the tangent at the state and costs no evaluation.
    pub displacement: Option<DisplacementMeasure>,
    /// Work of the out-of-balance force along the next correction over the work of the internal forces along the step.
    pub energy: bool,
}

/// A criterion, by its word.
#[derive(Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Criterion {
    /// Out-of-balance force over reactions or loads, whichever are larger, below `force_tolerance`.
    Force,
    /// Out-of-balance force over reactions (FNORM/RNORM of [Argilaga2018]) below `force_tolerance`.
    ForceOverReactions,
    /// Next correction over the displacement of a full step below `displacement_tolerance`.
    Displacement,
    /// Next correction over the displacement of this step (UNORM/DNORM of [Argilaga2018]) below `displacement_tolerance`.
    CorrectionOverStep,
    /// Work of the out-of-balance force below `energy_tolerance`.
    Energy,
}

impl From<Vec<Criterion>> for Criteria {
    fn from(words: Vec<Criterion>) -> Self {
        let mut criteria = Self { force: None, displacement: None, energy: false };
        for word in words {
            match word {
                Criterion::Force => criteria.force = Some(ForceMeasure::Largest),
                Criterion::ForceOverReactions => criteria.force = Some(ForceMeasure::Reactions),
                Criterion::Displacement => criteria.displacement = Some(DisplacementMeasure::FullStep),
                Criterion::CorrectionOverStep => criteria.displacement = Some(DisplacementMeasure::Step),
                Criterion::Energy => criteria.energy = true,
            }
        }
        criteria
    }
}

impl From<Criteria> for Vec<Criterion> {
    fn from(criteria: Criteria) -> Self {
        let force = criteria.force.map(|measure| match measure {
            ForceMeasure::Largest => Criterion::Force,
            ForceMeasure::Reactions => Criterion::ForceOverReactions,
        });
        let displacement = criteria.displacement.map(|measure| match measure {
            DisplacementMeasure::FullStep => Criterion::Displacement,
            DisplacementMeasure::Step => Criterion::CorrectionOverStep,
        });
        let energy = criteria.energy.then_some(Criterion::Energy);
        [force, displacement, energy].into_iter().flatten().collect()
    }
}

impl Default for Criteria {
    fn default() -> Self {
        Self {
            force: Some(ForceMeasure::default()),
            displacement: Some(DisplacementMeasure::default()),
            energy: false,
        }
    }
}

impl Criteria {
    /// FNORM/RNORM of [Argilaga2018] alone.
    pub const FORCE_OVER_REACTIONS: Self =
        Self { force: Some(ForceMeasure::Reactions), displacement: None, energy: false };

    /// UNORM/DNORM of [Argilaga2018] alone.
    pub const CORRECTION_OVER_STEP: Self =
        Self { force: None, displacement: Some(DisplacementMeasure::Step), energy: false };

    /// Whether any criterion is left.
    pub fn is_empty(&self) -> bool {
        self.force.is_none() && self.displacement.is_none() && !self.energy
    }
}

/// The measures of one iterate, each to be held below its tolerance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConvergenceMeasures {
    /// Out-of-balance over the force that [`Criteria::force`] names.
    pub force: f64,
    /// Next correction over what [`Criteria::displacement`] names.
    pub displacement: f64,
    /// See [`Criteria::energy`].
    pub energy: f64,
}

/// Tolerance of forces over the error of the stresses that a run keeps to.
const FORCE_OVER_ERROR: f64 = 2.0;

/// Tolerance of displacements over the error of the stresses that a run keeps to.
const DISPLACEMENT_OVER_ERROR: f64 = 10.0;

/// Tolerances and which of them count: keys of `[solver]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Tolerances {
    /// Largest out-of-balance force over reactions and loads.
    #[serde(rename = "force_tolerance")]
    #[schemars(extend(
        "x-unit" = "-",
        "exclusiveMinimum" = 0,
        "x-procedures" = "implicit relaxation",
        "x-default" = "0.001; with `rve.error` twice that error, at most 0.01; with `rve.accuracy = \"draft\"` 0.01"
    ))]
    pub force: f64,
    /// Largest correction that the accepted state would still get, over the displacement of a full step.
    #[serde(rename = "displacement_tolerance")]
    #[schemars(extend(
        "x-unit" = "-",
        "exclusiveMinimum" = 0,
        "x-procedures" = "implicit",
        "x-default" = "0.01; stages that keep to `rve.error`: ten times that error, at most 0.05; with `rve.accuracy = \"draft\"` 0.05"
    ))]
    pub displacement: f64,
    /// Out-of-balance force up to which a step is accepted whose iterations no longer make progress, as where cells snap and no state
    /// within `force_tolerance` lies next to the last one; the next step restores the whole balance. Counted as
    /// `fallbacks.stagnated_steps`. With 0, and in implicit stages `stagnated_displacement_tolerance` 0 too, none is accepted.
    #[serde(rename = "stagnated_force_tolerance")]
    #[schemars(extend("x-unit" = "-", "x-procedures" = "implicit relaxation"), range(min = 0.0))]
    pub stagnated_force: f64,
    /// Correction up to which such a step is accepted, measured as for `displacement_tolerance`. With 0 the correction is held to
    /// `displacement_tolerance`. Otherwise a step whose forces are in balance is also accepted if its corrections have become noise: they no
    /// longer fall, and change their direction, as in steps so small that the tolerance of the cells moves the body by as much. Counted as
    /// `fallbacks.steps_with_noisy_corrections`.
    #[serde(rename = "stagnated_displacement_tolerance")]
    #[schemars(extend("x-unit" = "-", "x-procedures" = "implicit"), range(min = 0.0))]
    pub stagnated_displacement: f64,
    /// Largest work of the out-of-balance force along the next correction, over the work of the internal forces along the step.
    #[serde(rename = "energy_tolerance")]
    #[schemars(extend("x-unit" = "-", "exclusiveMinimum" = 0, "x-procedures" = "implicit"))]
    pub energy: f64,
    /// Criteria of convergence that have to hold, all of them.
    #[schemars(with = "Vec<Criterion>", length(min = 1), extend("x-procedures" = "implicit"))]
    pub criteria: Criteria,
}

impl Default for Tolerances {
    fn default() -> Self {
        Self {
            force: 1e-3,
            displacement: 1e-2,
            stagnated_force: 1e-2,
            stagnated_displacement: 5e-2,
            energy: 1e-6,
            criteria: Criteria::default(),
        }
    }
}

impl Tolerances {
    /// Force and displacement, both to hold; nothing less is accepted.
    pub const fn both(force: f64, displacement: f64) -> Self {
        let criteria = Criteria {
            force: Some(ForceMeasure::Largest),
            displacement: Some(DisplacementMeasure::FullStep),
            energy: false,
        };
        Self { force, displacement, stagnated_force: 0.0, stagnated_displacement: 0.0, energy: 1e-6, criteria }
    }

    /// What steps are held to whose stresses may be off by `error`, relative to the pressure. Tighter tolerances cost evaluations and do
    /// not lower the error of the stresses: measured in `docs/lab-book/error-estimate.md`. Never weaker than [`Self::stagnated`].
    pub fn within(error: f64) -> Self {
        let default = Self::default();
        Self {
            force: (FORCE_OVER_ERROR * error).min(default.stagnated_force),
            displacement: (DISPLACEMENT_OVER_ERROR * error).min(default.stagnated_displacement),
            ..default
        }
    }

    /// Whether a step that stagnates may be accepted above the tolerances of any step.
    pub fn accept_stagnated(&self) -> bool {
        let (force, motion) = (self.criteria.force.is_some(), self.criteria.displacement.is_some());
        (force && self.stagnated_force > self.force) || (motion && self.stagnated_displacement > self.displacement)
    }

    /// Whether a step whose forces are in balance may be accepted where its corrections are noise.
    pub fn accept_noise(&self) -> bool {
        let Criteria { force, displacement, energy } = self.criteria;
        force.is_some() && displacement.is_some() && !energy && self.stagnated_displacement > 0.0
    }

    /// What a step is held to whose iterations make no more progress; never less than what any step is held to.
    pub fn stagnated(&self) -> Self {
        Self {
            force: self.force.max(self.stagnated_force),
            displacement: self.displacement.max(self.stagnated_displacement),
            ..*self
        }
    }

    /// The measures that count over their tolerances: force, then the larger of displacement and energy; 0 where none
    /// counts.
    pub fn excess(&self, measured: &ConvergenceMeasures) -> [f64; 2] {
        let counted = |counts: bool, value: f64, tolerance: f64| if counts { value / tolerance } else { 0.0 };
        let displacement = counted(self.criteria.displacement.is_some(), measured.displacement, self.displacement);
        let energy = counted(self.criteria.energy, measured.energy, self.energy);
        // Not f64::max, which would drop a NaN.
        let motion = if energy > displacement || energy.is_nan() { energy } else { displacement };
        [counted(self.criteria.force.is_some(), measured.force, self.force), motion]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_criteria_that_count_are_held_against_an_iterate() {
        let measured = ConvergenceMeasures { force: 4e-3, displacement: 2e-3, energy: 3e-6 };
        let with = |criteria| Tolerances { criteria, ..Tolerances::both(1e-3, 1e-2) };
        let excess = |criteria| with(criteria).excess(&measured).map(|value| (value * 1e6).round() / 1e6);
        assert_eq!(excess(Criteria::default()), [4.0, 0.2]);
        assert_eq!(excess(Criteria { energy: true, ..Criteria::default() }), [4.0, 3.0]);
        assert_eq!(excess(Criteria::CORRECTION_OVER_STEP), [0.0, 0.2]);
        assert_eq!(excess(Criteria::FORCE_OVER_REACTIONS), [4.0, 0.0]);
        let lost = ConvergenceMeasures { energy: f64::NAN, ..measured };
        assert!(with(Criteria { energy: true, ..Criteria::default() }).excess(&lost)[1].is_nan());
        assert!(Criteria { force: None, displacement: None, energy: false }.is_empty());
    }

    #[test]
    fn a_stagnated_step_is_held_to_the_weaker_of_both_tolerances() {
        let usual = Tolerances::default();
        assert_eq!((usual.stagnated().force, usual.stagnated().displacement), (1e-2, 5e-2));
        let weak = Tolerances { force: 3e-2, ..usual };
        assert_eq!(weak.stagnated().force, 3e-2);
        let strict = Tolerances { stagnated_force: 0.0, stagnated_displacement: 0.0, ..usual };
        assert_eq!(
            strict.stagnated().excess(&ConvergenceMeasures { force: 2e-3, displacement: 1e-2, energy: 0.0 }),
            [2.0, 1.0]
        );
    }
}
