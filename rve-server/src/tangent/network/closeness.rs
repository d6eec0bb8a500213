//! How closely the equations of networks are solved.

/// When corrections and iterations end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closeness {
    /// Share of the work of a unit strain's loads on the motions of the grains that may still be missing. This is the error of a
    /// symmetric operator once it has been corrected by what is left of the loads.
    pub(super) missing_work: f64,
    /// Norm of the residual over that of the load at which iterations end whatever is missing.
    pub(super) residual: f64,
    /// The same where slip spoils the symmetry, so that nothing corrects the operator: it is right to about this figure.
    pub(super) residual_with_slip: f64,
    /// Largest residual of solutions with factors, relative to the load and to the force of a contact moved as far as the largest unknown.
    /// Only prestress needs corrections: factors that are symmetric leave its ratio to the stiffness.
    pub(super) residual_of_factors: f64,
}

impl Closeness {
    /// For operators that steer iterations, which hardly notice 1 %.
    pub const STEERING: Self =
        Self { missing_work: 3e-3, residual: 3e-4, residual_with_slip: 1e-3, residual_of_factors: 1e-6 };

    /// For operators that are results themselves, and for the preparation of packings.
    pub const RESULT: Self =
        Self { missing_work: 0.0, residual: 3e-4, residual_with_slip: 1e-6, residual_of_factors: 1e-11 };
}
