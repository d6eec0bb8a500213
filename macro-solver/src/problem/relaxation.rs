//! Settings of dynamic relaxation.

/// Which equations are followed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RelaxationForm {
    /// With the errata put right.
    #[default]
    Corrected,
    /// As printed in [Liu2018], for the comparison that shows why not. A step beyond the element bound is not followed: the
    /// attempt fails with that reason.
    AsPrinted,
}

/// How an equilibrium is relaxed to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelaxationSettings {
    /// Equations.
    pub form: RelaxationForm,
    /// Damping ratio `xi` of the moving mode, dimensionless.
    pub damping_ratio: f64,
    /// Share of the critical step, above 0 and at most 1; in the printed form `gamma`.
    pub safety: f64,
    /// Kinetic energy over its largest value in the attempt at which it is at rest.
    pub kinetic_tolerance: f64,
    /// Iterations in a row in which all criteria must hold.
    pub hits: usize,
    /// An attempt with more iterations has failed.
    pub max_iterations: usize,
}

impl Default for RelaxationSettings {
    fn default() -> Self {
        Self {
            form: RelaxationForm::Corrected,
            damping_ratio: 1.0,
            safety: 0.9,
            kinetic_tolerance: 1e-3,
            hits: 3,
            max_iterations: 20_000,
        }
    }
}

impl RelaxationSettings {
    /// As printed in [Liu2018] section 4.1: `xi = 1`, `gamma = 0.5`, one hit of the kinetic criterion.
    pub fn as_printed() -> Self {
        Self { form: RelaxationForm::AsPrinted, safety: 0.5, hits: 1, ..Self::default() }
    }

    /// What is wrong with its numbers: the quantity, what it must be, and what it is.
    pub fn defect(&self) -> Option<(&'static str, &'static str, f64)> {
        let positive = |value: f64| value > 0.0 && value.is_finite();
        [
            ("damping ratio", "above 0", self.damping_ratio, positive(self.damping_ratio)),
            ("relaxation safety", "above 0 and at most 1", self.safety, self.safety > 0.0 && self.safety <= 1.0),
            ("kinetic tolerance", "above 0", self.kinetic_tolerance, positive(self.kinetic_tolerance)),
            ("hits", "at least 1", self.hits as f64, self.hits >= 1),
            ("relaxation max_iterations", "at least 1", self.max_iterations as f64, self.max_iterations >= 1),
        ]
        .into_iter()
        .find(|(_, _, _, sound)| !sound)
        .map(|(what, requirement, value, _)| (what, requirement, value))
    }
}
