//! What an explicit dynamic stage needs beside its conditions and its duration.

use crate::element::mass::{Lumping, lumped_masses};
use crate::mesh::Dimension;
use crate::problem::Problem;
use crate::problem::error::ProblemError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How large the time step is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "StepKeys", into = "StepKeys")]
pub enum TimeStepRule {
    /// A share of the critical step of the fastest element.
    Stable {
        /// Share, above 0 and at most 1.
        safety: f64,
    },
    /// As given. Not limited: what is too large for the mesh is stopped by the energy monitor.
    Fixed {
        /// Step, s.
        step: f64,
    },
}

impl Default for TimeStepRule {
    fn default() -> Self {
        Self::Stable { safety: 0.9 }
    }
}

/// The keys of `[dynamics]` about the time step.
#[derive(Clone, Copy, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
struct StepKeys {
    /// Share of the critical step of the fastest element.
    #[schemars(extend("x-unit" = "-", "x-default" = "0.9", "exclusiveMinimum" = 0, "x-instead-of" = "time_step"), range(max = 1.0))]
    safety: Option<f64>,
    /// A fixed step, shortened so that a whole number of them fills the stage. It is not limited; above the stable step of the elements a run is warned of, and stopped by the energy monitor once its
    /// balance is off in four instants in a row, or by a tenth of the largest energy.
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0, "x-instead-of" = "safety"))]
    time_step: Option<f64>,
}

impl From<StepKeys> for TimeStepRule {
    fn from(keys: StepKeys) -> Self {
        match keys {
            StepKeys { time_step: Some(step), .. } => Self::Fixed { step },
            StepKeys { safety: Some(safety), .. } => Self::Stable { safety },
            _ => Self::default(),
        }
    }
}

impl From<TimeStepRule> for StepKeys {
    fn from(rule: TimeStepRule) -> Self {
        match rule {
            TimeStepRule::Stable { safety } => Self { safety: Some(safety), time_step: None },
            TimeStepRule::Fixed { step } => Self { safety: None, time_step: Some(step) },
        }
    }
}

/// Mass added for a larger step. It changes inertia, so only slow motions stay right.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "MassKeys", into = "MassKeys")]
pub enum MassScaling {
    /// None.
    #[default]
    None,
    /// All masses times a factor.
    Uniform {
        /// Factor, at least 1.
        factor: f64,
    },
    /// Elements that need it get as much mass as makes `step` stable for them.
    ToStep {
        /// Wanted step, s.
        step: f64,
    },
}

/// The keys of `[dynamics]` about added mass.
#[derive(Clone, Copy, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
struct MassKeys {
    /// Factor on all masses. It allows larger steps and changes inertia: only slow motions stay right.
    #[schemars(extend("x-unit" = "-", "x-default" = "none", "x-instead-of" = "mass_scaled_step"), range(min = 1.0))]
    mass_factor: Option<f64>,
    /// Elements get as much mass as makes this time step stable for them.
    #[schemars(extend("x-unit" = "s", "x-default" = "none", "exclusiveMinimum" = 0, "x-instead-of" = "mass_factor"))]
    mass_scaled_step: Option<f64>,
}

impl From<MassKeys> for MassScaling {
    fn from(keys: MassKeys) -> Self {
        match keys {
            MassKeys { mass_scaled_step: Some(step), .. } => Self::ToStep { step },
            MassKeys { mass_factor: Some(factor), .. } => Self::Uniform { factor },
            _ => Self::None,
        }
    }
}

impl From<MassScaling> for MassKeys {
    fn from(scaling: MassScaling) -> Self {
        match scaling {
            MassScaling::None => Self::default(),
            MassScaling::Uniform { factor } => Self { mass_factor: Some(factor), mass_scaled_step: None },
            MassScaling::ToStep { step } => Self { mass_factor: None, mass_scaled_step: Some(step) },
        }
    }
}

/// Damping in proportion to mass and stiffness, `C = a M + b K`, with the isotropic part of the stiffness at the start of
/// the stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct RayleighDamping {
    /// `a` of the Rayleigh damping `C = a M + b K`: the damping ratio `a / (2 omega)`, strong for slow motions.
    #[serde(rename = "mass_damping")]
    #[schemars(extend("x-unit" = "1/s"), range(min = 0.0))]
    pub mass: f64,
    /// `b` of the Rayleigh damping `C = a M + b K`: the damping ratio `b omega / 2`, strong for fast motions. Lowers the stable step.
    #[serde(rename = "stiffness_damping")]
    #[schemars(extend("x-unit" = "s"), range(min = 0.0))]
    pub stiffness: f64,
}

/// Viscous pressure against changes of volume, which spreads a shock over some elements and calms the fastest modes:
/// `rho l (b1 c_p + b2^2 l |D|) D` with the rate of volume change `D` and the length `l` of an element, the root of its
/// volume; the second term acts in compression only (von Neumann and Richtmyer 1950, Landshoff 1955).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct BulkViscosity {
    /// Linear bulk viscosity `b1`; 0.06 is usual. Lowers the stable step.
    #[serde(rename = "linear_viscosity")]
    #[schemars(extend("x-unit" = "-"), range(min = 0.0))]
    pub linear: f64,
    /// Quadratic bulk viscosity `b2`; 1.2 is usual for shocks. Not part of the bound of the stable step.
    #[serde(rename = "quadratic_viscosity")]
    #[schemars(extend("x-unit" = "-"), range(min = 0.0))]
    pub quadratic: f64,
}

/// A velocity that a node set starts with; of several, the last holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "InitialVelocityKeys", into = "InitialVelocityKeys")]
pub struct InitialVelocity {
    /// Node set.
    pub nodes: String,
    /// Velocity, m/s.
    pub value: [f64; 3],
}

/// An entry of `initial_velocity` of `[dynamics]`.
#[derive(Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct InitialVelocityKeys {
    /// Node set.
    set: String,
    /// Velocity; a component that is left out is 0.
    #[schemars(extend("x-unit" = "m/s"))]
    value: VelocityKeys,
}

/// Components of a velocity.
#[derive(Clone, Copy, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(extend("x-folded" = true))]
struct VelocityKeys {
    /// Along x.
    x: f64,
    /// Along y.
    y: f64,
    /// Along z.
    z: f64,
}

impl From<InitialVelocityKeys> for InitialVelocity {
    fn from(keys: InitialVelocityKeys) -> Self {
        Self { nodes: keys.set, value: [keys.value.x, keys.value.y, keys.value.z] }
    }
}

impl From<InitialVelocity> for InitialVelocityKeys {
    fn from(velocity: InitialVelocity) -> Self {
        let [x, y, z] = velocity.value;
        Self { set: velocity.nodes, value: VelocityKeys { x, y, z } }
    }
}

/// When the state is told to the observers, beside the first and the last.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "ReportingKeys", into = "ReportingKeys")]
pub enum Reporting {
    /// Every n steps.
    Steps(u64),
    /// After the first step at or behind every multiple of this time, s.
    Interval(f64),
}

/// The keys of `[dynamics]` about reports.
#[derive(Clone, Copy, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
struct ReportingKeys {
    /// A report, which is a step of the run, after every n-th time step.
    #[schemars(extend("x-default" = "1", "x-instead-of" = "output_interval"), range(min = 1))]
    output_steps: Option<u64>,
    /// A report after the first time step at or beyond every multiple of this time.
    #[schemars(extend("x-unit" = "s", "exclusiveMinimum" = 0, "x-instead-of" = "output_steps"))]
    output_interval: Option<f64>,
}

impl From<ReportingKeys> for Reporting {
    fn from(keys: ReportingKeys) -> Self {
        match keys {
            ReportingKeys { output_interval: Some(interval), .. } => Self::Interval(interval),
            ReportingKeys { output_steps, .. } => Self::Steps(output_steps.unwrap_or(1)),
        }
    }
}

impl From<Reporting> for ReportingKeys {
    fn from(reporting: Reporting) -> Self {
        match reporting {
            Reporting::Steps(steps) => Self { output_steps: Some(steps), output_interval: None },
            Reporting::Interval(interval) => Self { output_steps: None, output_interval: Some(interval) },
        }
    }
}

/// An explicit dynamic stage: the keys of `[dynamics]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct DynamicSettings {
    /// Mass per initial volume of the whole body, voids included. By default every element weighs what its cells do.
    #[schemars(extend("x-unit" = "kg/m3", "x-default" = "of the packings", "exclusiveMinimum" = 0))]
    pub density: f64,
    /// The same of every element where they differ, kg/m3; empty: `density` everywhere. No key.
    #[schemars(skip)]
    pub element_densities: Vec<f64>,
    /// How elements give their mass to their nodes.
    pub lumping: Lumping,
    /// Time step.
    #[serde(flatten)]
    #[schemars(with = "StepKeys")]
    pub step: TimeStepRule,
    /// Added mass.
    #[serde(flatten)]
    #[schemars(with = "MassKeys")]
    pub mass_scaling: MassScaling,
    /// Rayleigh damping.
    #[serde(flatten)]
    pub damping: RayleighDamping,
    /// Bulk viscosity.
    #[serde(flatten)]
    pub viscosity: BulkViscosity,
    /// Velocities of node sets at the start of the stage; of several, the last holds. Elsewhere those at the end of the stage before,
    /// if it was dynamic, or none.
    #[serde(rename = "initial_velocity")]
    #[schemars(with = "Vec<InitialVelocityKeys>")]
    pub initial_velocities: Vec<InitialVelocity>,
    /// Side sets that let waves out (Lysmer and Kuhlemeyer 1969). Where a stage before had a support or a link that this one does not
    /// have, the side goes on bearing what that bore.
    pub absorbing: Vec<String>,
    /// When the state is reported.
    #[serde(flatten)]
    #[schemars(with = "ReportingKeys")]
    pub reporting: Reporting,
    /// Residual of the energy balance over the largest energy so far below which a run is never stopped.
    #[schemars(extend("x-unit" = "-", "exclusiveMinimum" = 0))]
    pub energy_tolerance: f64,
    /// Instants in a row with a larger residual at which a run is stopped; 0: only a growing energy stops it.
    pub longest_excess: u64,
    /// The stable step is found again from new elastic tangents every n steps; 0: only at the start.
    pub tangent_every: u64,
}

impl Default for DynamicSettings {
    /// Without a density, which has to be given.
    fn default() -> Self {
        Self::new(0.0)
    }
}

impl DynamicSettings {
    /// A body with the mass density `density`, kg/m3: HRZ masses, 0.9 of the stable step, nothing damped, a report after
    /// every step.
    pub fn new(density: f64) -> Self {
        Self {
            density,
            element_densities: Vec::new(),
            lumping: Lumping::default(),
            step: TimeStepRule::default(),
            mass_scaling: MassScaling::default(),
            damping: RayleighDamping::default(),
            viscosity: BulkViscosity::default(),
            initial_velocities: Vec::new(),
            absorbing: Vec::new(),
            reporting: Reporting::Steps(1),
            energy_tolerance: 1e-2,
            longest_excess: 200,
            tangent_every: 0,
        }
    }

    /// Mass density of an element, kg/m3.
    pub fn density_of(&self, element: usize) -> f64 {
        self.element_densities.get(element).copied().unwrap_or(self.density)
    }

    /// Checks every number and every set named.
    ///
    /// # Errors
    /// The first defect found.
    pub fn validate(&self, problem: &Problem) -> Result<(), ProblemError> {
        if self.element_densities.iter().any(|density| !(*density > 0.0 && density.is_finite())) {
            let least = self.element_densities.iter().copied().fold(f64::INFINITY, f64::min);
            return Err(ProblemError::Number { what: "element density", requirement: "above 0", value: least });
        }
        let (given, elements) = (self.element_densities.len(), problem.mesh.elements.len());
        if given != 0 && given != elements {
            let requirement = "as many as there are elements, or none";
            return Err(ProblemError::Number { what: "element densities", requirement, value: given as f64 });
        }
        for velocity in &self.initial_velocities {
            problem.nodes(&velocity.nodes)?;
            if problem.mesh.dimension == Dimension::Plane && velocity.value[2] != 0.0 {
                return Err(ProblemError::NoThirdAxis);
            }
        }
        for sides in &self.absorbing {
            problem.sides(sides)?;
        }
        let mesh = &problem.mesh;
        for (element, kind) in mesh.kinds.iter().enumerate() {
            lumped_masses(*kind, &mesh.element_positions(element), self.density_of(element), self.lumping)?;
        }
        Ok(())
    }
}
