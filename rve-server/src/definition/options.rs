//! The table `[rve]`: how accurately a cell is solved.

use super::frame::{CellFrame, FrameConstraint, LARGEST_FRAME_TARGET};
use super::operator_options::OperatorOptions;
use crate::error::{DefinitionError, in_declared_ranges};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Named accuracy: a strain per ramp step and a tolerance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Accuracy {
    /// 5e-6 strain per step, force tolerance 1e-2: for trying things out.
    Draft,
    /// 1e-6 strain per step, force tolerance 1e-3, in scenes with dynamic stages 1e-5: a looser one damps small waves.
    #[default]
    Default,
    /// 1e-7 strain per step, force tolerance 1e-7: for verification.
    Tight,
}

/// Equilibrium criteria by keyword. They are not equivalent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Criterion {
    /// Largest unbalanced force, or moment over radius, of any grain over the mean normal contact force
    /// [Argilaga2018].
    #[default]
    MaxForce,
    /// Root mean square unbalanced force of the grains over that of the contact forces, [Liu2015] eq. 57.
    RmsForce,
    /// Kinetic over elastic energy [Liu2018], met in ten consecutive steps. Erratum: a single hit also accepts every
    /// turning point of the motion.
    Energy,
}

protocol::keywords! {
    pub Criterion {
        MaxForce => "max_force",
        RmsForce => "rms_force",
        Energy => "energy",
    }
}

/// Dampings by keyword.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Damping {
    /// Fast inertial relaxation engine: velocities are steered towards the forces and reset when they oppose them.
    #[default]
    Fire,
    /// Non-viscous local damping of the peculiar velocity.
    Local,
    /// Mass-proportional viscous damping of the peculiar velocity.
    Viscous,
    /// All motion stops whenever the kinetic energy has passed a peak.
    Kinetic,
    /// Viscous damping, critical for the mode that moves at the moment.
    Adaptive,
}

protocol::keywords! {
    pub Damping {
        Fire => "fire",
        Local => "local",
        Viscous => "viscous",
        Kinetic => "kinetic",
        Adaptive => "adaptive",
    }
}

/// Treatment of a trial whose grains are not in equilibrium after [`RveOptions::max_steps`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AtStepCap {
    /// An answer with the best stress there is, flagged and counted.
    #[default]
    Accept,
    /// An error that says how far the trial got; the macro solver takes a smaller step.
    Refuse,
}

/// Grain solvers by keyword.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SolverName {
    /// Ramp in small strain increments, damped explicit motion to equilibrium.
    #[default]
    Relaxation,
    /// Small increments of discs by the linear response of the grains, checked with the exact contact forces; all others
    /// by relaxation.
    EventDriven,
}

impl SolverName {
    /// Keys that are not used stay out of definitions.
    fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// The table `[rve]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RveOptions {
    /// Grain solver.
    #[serde(skip_serializing_if = "SolverName::is_default")]
    pub solver: SolverName,
    /// Named accuracy; `strain_per_step` and `tolerance` override its two values.
    pub accuracy: Accuracy,
    /// Largest strain component applied in one ramp step.
    #[schemars(extend("x-unit" = "-", "x-default" = "by `accuracy`"), range(min = 1e-10))]
    pub strain_per_step: Option<f64>,
    /// Error of the stress over the pressure that a run keeps to. It chooses the tolerance, and the strain per ramp step from load
    /// step to load step by the estimated error, between 0.4 and twice the value it starts with, and at most 2e-5. Takes the place of
    /// `accuracy`, `strain_per_step` and `tolerance`. A scene of implicit stages that names none of the four keeps to 5e-3, unless its
    /// solver is `event_driven`. Element tests estimate no error: there it stands for the strain per step and the tolerance that such a run
    /// starts with.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "-"), range(min = 1e-7, max = 0.1))]
    pub error: Option<f64>,
    /// Equilibrium criterion.
    pub criterion: Criterion,
    /// Value that the criterion must reach.
    #[schemars(extend("x-unit" = "-", "x-default" = "by `accuracy`", "exclusiveMinimum" = 0))]
    pub tolerance: Option<f64>,
    /// Damping.
    pub damping: Damping,
    /// Coefficient of local damping.
    #[schemars(extend("x-unit" = "-", "x-default" = "0.7", "exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub local_damping: Option<f64>,
    /// Coefficient of viscous damping per pseudo-time step. The stiffest mode is damped critically
    /// near 1.6.
    #[schemars(extend("x-unit" = "-", "x-default" = "0.1", "exclusiveMinimum" = 0, "exclusiveMaximum" = 2))]
    pub viscous_damping: Option<f64>,
    /// Most relaxation steps after the ramp. A trial that stagnates with every damping ends
    /// sooner, after some thousand steps.
    #[schemars(extend("x-default" = "20000"), range(min = 1))]
    pub max_steps: Option<u32>,
    /// Treatment of a trial that needs more.
    pub at_step_cap: AtStepCap,
    /// Most force evaluations of a trial, ramp and relaxation together; unlimited if absent. A trial that needs more is
    /// refused in any case, because it may not even have reached its strain.
    #[schemars(extend("x-default" = "unlimited"), range(min = 1))]
    pub max_evaluations: Option<u64>,
    /// Largest |H| of one trial.
    #[schemars(extend("x-unit" = "-", "x-default" = "0.2", "exclusiveMinimum" = 0))]
    pub largest_target: Option<f64>,
    /// Whether an increment of exactly zero is relaxed like any other; usually the committed state is the reply. `zero_increments =
    /// false` in `[economy]` sets it.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub relax_zero_increments: bool,
    /// Largest strain component of a trial that `solver = "event_driven"` answers itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-unit" = "-", "x-default" = "1e-5", "exclusiveMinimum" = 0))]
    pub largest_event_increment: Option<f64>,
    /// Whether `solver = "event_driven"` compares its cost with that of relaxation of several cells at a time, in the lanes of the processor,
    /// which takes a quarter of the time. It then hands more trials over: those in which contacts change their modes often. Lanes themselves are
    /// switched by `pool.lanes`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-default" = "true in scenes with eight Gauss points or more"))]
    pub side_by_side: Option<bool>,
    /// Frame of boundary grains [Liu2018] in place of a periodic cell, cut out of the packing of discs; for scenes, whose engine then is
    /// `boundary-frame`. Tangents are found by finite differences.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<CellFrame>,
    /// Perturbations and averages of tangent operators.
    #[serde(serialize_with = "OperatorOptions::with_old_names")]
    pub operator: OperatorOptions,
}

/// Largest strain per ramp step that an error may choose. Above, errors no longer grow with it, so that half of it shows little of them
/// (docs/lab-book/error-estimate.md), and little is saved.
const LARGEST_BY_ERROR: f64 = 2e-5;

impl RveOptions {
    /// Checks every key.
    ///
    /// # Errors
    /// The first offending key with the remedy.
    pub fn validate(&self) -> Result<(), DefinitionError> {
        in_declared_ranges(self, "rve")?;
        let is_chosen =
            self.accuracy != Accuracy::Default || self.strain_per_step.is_some() || self.tolerance.is_some();
        if self.error.is_some() && is_chosen {
            return Err(DefinitionError(
                "rve.error chooses strain per step and tolerance; leave out accuracy, strain_per_step and tolerance"
                    .into(),
            ));
        }
        if self.largest_event_increment.is_some() && self.solver != SolverName::EventDriven {
            return Err(DefinitionError("rve.largest_event_increment needs solver = \"event_driven\"".into()));
        }
        if self.side_by_side.is_some() && self.solver != SolverName::EventDriven {
            return Err(DefinitionError("rve.side_by_side needs solver = \"event_driven\"".into()));
        }
        if self.local_damping.is_some() && self.damping != Damping::Local {
            return Err(DefinitionError("rve.local_damping needs damping = \"local\"".into()));
        }
        if self.viscous_damping.is_some() && self.damping != Damping::Viscous {
            return Err(DefinitionError("rve.viscous_damping needs damping = \"viscous\"".into()));
        }
        if self.frame.is_some() {
            self.check_frame()?;
        }
        self.operator.validate()
    }

    /// Checks that a frame of boundary grains can be solved with these options.
    ///
    /// # Errors
    /// A key, a damping or a criterion that frames do not have.
    pub(crate) fn check_frame(&self) -> Result<(), DefinitionError> {
        let unknown = [
            ("solver", self.solver != SolverName::default()),
            ("at_step_cap", self.at_step_cap != AtStepCap::default()),
            ("max_evaluations", self.max_evaluations.is_some()),
            ("largest_target", self.largest_target.is_some()),
        ];
        if let Some((key, _)) = unknown.into_iter().find(|(_, is_given)| *is_given) {
            return Err(DefinitionError(format!(
                "rve.{key} does not hold for a frame of boundary grains, whose trials end at max_steps, flagged, and take targets up \
                 to {LARGEST_FRAME_TARGET}; leave it out"
            )));
        }
        if self.frame.as_ref().is_some_and(|frame| frame.constraint == FrameConstraint::Platens) {
            return Err(DefinitionError(
                "rve.frame.constraint = \"platens\" is for the table [frame] of RVE tests: a Gauss point has no sides between platens; use \"periodic\", \
                 \"traction\" or \"linear\""
                    .into(),
            ));
        }
        self.frame.as_ref().map_or(Ok(()), CellFrame::refuse_unused)?;
        match (self.damping, self.criterion) {
            (Damping::Fire, Criterion::MaxForce) | (Damping::Local, Criterion::Energy) => Ok(()),
            (damping, criterion) => Err(DefinitionError(format!(
                "rve: a frame of boundary grains has no damping = \"{}\" with criterion = \"{}\"; use \"fire\" with \"max_force\" or \
                 \"local\" with \"energy\"",
                damping.keyword(),
                criterion.keyword()
            ))),
        }
    }

    /// Strain per ramp step in force; with `error` the one that a run starts with.
    pub fn strain_per_step(&self) -> f64 {
        self.strain_per_step.unwrap_or(match (self.error, self.accuracy) {
            (Some(error), _) => (1e-3 * error).min(LARGEST_BY_ERROR),
            (None, Accuracy::Draft) => 5e-6,
            (None, Accuracy::Default) => 1e-6,
            (None, Accuracy::Tight) => 1e-7,
        })
    }

    /// Tolerance in force. The energy criterion is quadratic in the forces, so its named values are the squares.
    pub fn tolerance(&self) -> f64 {
        let force = match (self.error, self.accuracy) {
            // Out-of-balance forces of single grains weigh less in the stress: measured, a fifth at most.
            (Some(error), _) => (2.0 * error).min(1e-2),
            (None, Accuracy::Draft) => 1e-2,
            (None, Accuracy::Default) => 1e-3,
            (None, Accuracy::Tight) => 1e-7,
        };
        self.tolerance.unwrap_or(if self.criterion == Criterion::Energy { force * force } else { force })
    }

    /// The same options with half the tolerance; all values that `accuracy` or `error` stand for are written out.
    #[must_use]
    pub fn with_half_tolerance(&self) -> Self {
        Self {
            accuracy: Accuracy::Default,
            error: None,
            strain_per_step: Some(self.strain_per_step()),
            tolerance: Some(0.5 * self.tolerance()),
            ..self.clone()
        }
    }

    /// Smallest and largest strain per ramp step that `error` may choose. Beyond, the response to an increment is so rough that Newton's
    /// method takes twice the evaluations (docs/lab-book/error-estimate.md).
    pub fn strain_per_step_bounds(&self) -> [f64; 2] {
        let start = self.strain_per_step();
        [0.4 * start, (2.0 * start).min(LARGEST_BY_ERROR.max(start))]
    }

    /// Coefficient of local damping in force.
    pub fn local_coefficient(&self) -> f64 {
        self.local_damping.unwrap_or(0.7)
    }

    /// Coefficient of local damping that acts: 0 with any other rule.
    pub(crate) fn local_share(&self) -> f64 {
        if self.damping == Damping::Local { self.local_coefficient() } else { 0.0 }
    }

    /// Coefficient of viscous damping in force.
    pub fn viscous_coefficient(&self) -> f64 {
        self.viscous_damping.unwrap_or(0.1)
    }

    /// Whether the damping rule uses the work of the forces before a step.
    pub(crate) fn needs_old_power(&self) -> bool {
        self.damping == Damping::Adaptive
    }

    /// Step cap in force.
    pub fn max_steps(&self) -> u32 {
        self.max_steps.unwrap_or(20_000)
    }

    /// Largest strain component of an event-driven trial in force.
    pub fn largest_event_increment(&self) -> f64 {
        self.largest_event_increment.unwrap_or(1e-5)
    }

    /// Limit of |H| in force.
    pub fn largest_target(&self) -> f64 {
        self.largest_target.unwrap_or(0.2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(text: &str) -> Result<(), String> {
        let table: RveOptions = toml::from_str(text).map_err(|error| error.message().to_owned())?;
        table.validate().map_err(|error| error.to_string())
    }

    #[test]
    fn option_defects_name_their_key() {
        options("accuracy = \"draft\"\ncriterion = \"rms_force\"\ndamping = \"local\"\nlocal_damping = 0.5").unwrap();
        assert!(options("tolerance = 0").unwrap_err().contains("rve.tolerance"));
        assert!(options("strain_per_step = -1").unwrap_err().contains("rve.strain_per_step"));
        assert!(options("local_damping = 0.5").unwrap_err().contains("damping = \"local\""));
        assert!(options("damping = \"local\"\nlocal_damping = 1.5").unwrap_err().contains("above 0 and below 1"));
        options("frame = { constraint = \"traction\" }").unwrap();
        let servo = options("frame = { control = { servo = { gain = 2.5 } } }").unwrap_err();
        assert!(servo.contains("rve.frame.control.servo.gain"), "{servo}");
        let unused = options("frame = { most_corrections = 5 }").unwrap_err();
        assert!(unused.contains("rve.frame.most_corrections has no effect"), "{unused}");
        let unused =
            options("frame = { constraint = \"linear\", control = { servo = { gain = 1.0 } } }").unwrap_err();
        assert!(unused.contains("has no effect without constraint"), "{unused}");
        assert!(options("frame = { servo_tolerance = 0 }").unwrap_err().contains("rve.frame.servo_tolerance"));
        assert!(options("accuracy = \"best\"").unwrap_err().contains("draft"));
        assert!(options("max_steps = 0").unwrap_err().contains("rve.max_steps must be at least 1"));
        assert!(options("error = 0.2").unwrap_err().contains("rve.error must be at least 1e-7 and at most 0.1"));
    }

    /// The declared default of every numeric key is what the code uses where the key is left out.
    #[test]
    fn declared_defaults_are_those_in_force() {
        let table = RveOptions::default();
        let operator = &table.operator;
        let in_force = [
            ("local_damping", table.local_coefficient()),
            ("viscous_damping", table.viscous_coefficient()),
            ("max_steps", f64::from(table.max_steps())),
            ("largest_target", table.largest_target()),
            ("largest_event_increment", table.largest_event_increment()),
            ("operator.perturbation", operator.perturbation()),
            ("operator.quasi_static_perturbation", operator.quasi_static_perturbation()),
            ("operator.quasi_static_tolerance", operator.quasi_static_tolerance()),
            ("operator.average_steps", f64::from(operator.average_steps())),
        ];
        let numbers = |keys: &keys::Table, before: &str| {
            let numeric = keys.keys.iter().filter_map(|key| Some((key, key.default.parse::<f64>().ok()?)));
            numeric.map(|(key, value)| (format!("{before}{}", key.name), value)).collect::<Vec<_>>()
        };
        let mut declared = numbers(&keys::Table::of::<RveOptions>(), "");
        declared.extend(numbers(&keys::Table::of::<super::super::OperatorOptions>(), "operator."));
        assert_eq!(declared.len(), in_force.len(), "{declared:?}");
        for (key, value) in declared {
            let used = in_force.iter().find(|(name, _)| *name == key);
            assert_eq!(used.map(|(_, used)| *used), Some(value), "{key}");
        }
    }

    /// Frames took these keys without effect, and `check` knew nothing of dampings that they do not have.
    #[test]
    fn keys_that_frames_do_not_have_are_refused_with_one() {
        for key in
            ["solver = 'event_driven'", "at_step_cap = 'refuse'", "max_evaluations = 20", "largest_target = 1e-7"]
        {
            let name = key.split(' ').next().unwrap();
            assert!(options(key).is_ok(), "{key}");
            let error = options(&format!("frame = {{}}\n{key}")).unwrap_err();
            assert!(error.contains(&format!("rve.{name} does not hold")), "{error}");
        }
        assert!(
            options("frame = {}\ndamping = 'viscous'")
                .unwrap_err()
                .contains("frame of boundary grains has no damping")
        );
        assert!(options("frame = {}\ndamping = 'local'\ncriterion = 'energy'\nmax_steps = 100").is_ok());
    }
}
