//! What an explicit dynamic stage needs beside its conditions and its duration.

use crate::element::mass::Lumping;
use crate::problem::{Problem, ProblemError};

/// How large the time step is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StepRule {
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

impl Default for StepRule {
    fn default() -> Self {
        Self::Stable { safety: 0.9 }
    }
}

/// Mass added for a larger step. It changes inertia, so only slow motions stay right.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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

/// Damping in proportion to mass and stiffness, `C = a M + b K`, with the isotropic part of the stiffness at the start of
/// the stage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RayleighDamping {
    /// `a`, 1/s: the damping ratio `a / (2 omega)`, strong for slow motions.
    pub mass: f64,
    /// `b`, s: the damping ratio `b omega / 2`, strong for fast ones. Lowers the stable step.
    pub stiffness: f64,
}

/// Viscous pressure against changes of volume, which spreads a shock over some elements and calms the fastest modes:
/// `rho l (b1 c_p + b2^2 l |D|) D` with the rate of volume change `D` and the root `l` of a point's volume; the second
/// term acts in compression only (von Neumann and Richtmyer 1950, Landshoff 1955).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BulkViscosity {
    /// `b1`, dimensionless; 0.06 is usual. Lowers the stable step.
    pub linear: f64,
    /// `b2`, dimensionless; 1.2 is usual for shocks. Not part of the bound of the stable step.
    pub quadratic: f64,
}

/// A velocity that a node set starts with; of several, the last holds.
#[derive(Clone, Debug, PartialEq)]
pub struct InitialVelocity {
    /// Node set.
    pub nodes: String,
    /// Velocity, m/s.
    pub value: [f64; 3],
}

/// When the state is told to the observers, beside the first and the last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reporting {
    /// After every so many steps.
    Steps(u64),
    /// After the first step at or behind every multiple of this time, s.
    Interval(f64),
}

/// An explicit dynamic stage.
#[derive(Clone, Debug, PartialEq)]
pub struct DynamicSettings {
    /// Mass per initial volume of the body, voids included, kg/m3.
    pub density: f64,
    /// The same of every element where they differ, kg/m3; empty: `density` everywhere.
    pub element_densities: Vec<f64>,
    /// How elements give their mass to their nodes.
    pub lumping: Lumping,
    /// Time step.
    pub step: StepRule,
    /// Added mass.
    pub mass_scaling: MassScaling,
    /// Rayleigh damping.
    pub damping: RayleighDamping,
    /// Bulk viscosity.
    pub viscosity: BulkViscosity,
    /// Velocities at the start. Elsewhere those at the end of the stage before, if it was dynamic, or none.
    pub initial_velocities: Vec<InitialVelocity>,
    /// Side sets that let waves out (Lysmer and Kuhlemeyer 1969).
    pub absorbing: Vec<String>,
    /// When the state is reported.
    pub reporting: Reporting,
    /// Residual of the energy balance over the largest energy so far below which a run is never stopped.
    pub energy_tolerance: f64,
    /// Instants in a row with a larger residual at which a run is stopped; 0: only a growing energy stops it.
    pub longest_excess: u64,
    /// The stable step is found again from new elastic tangents after every so many steps; 0: only at the start.
    pub tangent_every: u64,
}

impl DynamicSettings {
    /// A body with the mass density `density`, kg/m3: HRZ masses, 0.9 of the stable step, nothing damped, a report after
    /// every step.
    pub fn new(density: f64) -> Self {
        Self {
            density,
            element_densities: Vec::new(),
            lumping: Lumping::default(),
            step: StepRule::default(),
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
        self.check_numbers()?;
        let (given, elements) = (self.element_densities.len(), problem.mesh.elements.len());
        if given != 0 && given != elements {
            let requirement = "as many as there are elements, or none";
            return Err(ProblemError::Number { what: "element densities", requirement, value: given as f64 });
        }
        for velocity in &self.initial_velocities {
            problem.nodes(&velocity.nodes)?;
        }
        for sides in &self.absorbing {
            problem.sides(sides)?;
        }
        Ok(())
    }

    fn check_numbers(&self) -> Result<(), ProblemError> {
        let at_least_zero = |what, value: f64| (what, value, "at least 0", value >= 0.0);
        let positive = |what, value: f64| (what, value, "above 0", value > 0.0);
        let mut checks = vec![
            positive("density", self.density),
            positive("density", self.element_densities.iter().copied().fold(self.density, f64::min)),
            at_least_zero("mass damping", self.damping.mass),
            at_least_zero("stiffness damping", self.damping.stiffness),
            at_least_zero("linear viscosity", self.viscosity.linear),
            at_least_zero("quadratic viscosity", self.viscosity.quadratic),
            positive("energy tolerance", self.energy_tolerance),
        ];
        checks.push(match self.step {
            StepRule::Stable { safety } => ("safety", safety, "above 0 and at most 1", safety > 0.0 && safety <= 1.0),
            StepRule::Fixed { step } => positive("time step", step),
        });
        match self.mass_scaling {
            MassScaling::None => {}
            MassScaling::Uniform { factor } => checks.push(("mass factor", factor, "at least 1", factor >= 1.0)),
            MassScaling::ToStep { step } => checks.push(positive("mass-scaled step", step)),
        }
        match self.reporting {
            Reporting::Steps(steps) => checks.push(("output steps", steps as f64, "at least 1", steps >= 1)),
            Reporting::Interval(time) => checks.push(positive("output interval", time)),
        }
        for velocity in &self.initial_velocities {
            checks.extend(velocity.value.map(|value| ("initial velocity", value, "a finite number", true)));
        }
        match checks.into_iter().find(|(_, value, _, sound)| !(*sound && value.is_finite())) {
            Some((what, value, requirement, _)) => Err(ProblemError::Number { what, requirement, value }),
            None => Ok(()),
        }
    }
}
