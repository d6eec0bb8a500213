//! What a stage leaves to a dynamic one behind it.

use super::integrator::Integrator;
use crate::model::constraints::Constraints;

/// Velocities of a dynamic stage, and who bore the body at its end. By degree of freedom.
#[derive(Clone, Debug, Default)]
pub(crate) struct Carried {
    /// m/s; `None` after a stage without motion.
    pub(super) velocity: Option<Vec<f64>>,
    /// Whether a displacement was prescribed.
    supported: Vec<bool>,
    /// Forces in place of supports that a stage before had, N.
    held: Vec<f64>,
}

impl Carried {
    /// After a stage with these constraints, and this motion if it had one.
    pub(crate) fn after(integrator: Option<Integrator>, constraints: &Constraints) -> Self {
        let (velocity, held) = match integrator {
            Some(Integrator { velocity, held, .. }) => (Some(velocity), held),
            None => (None, Vec::new()),
        };
        let supported = (0..constraints.count()).map(|dof| constraints.is_prescribed(dof)).collect();
        Self { velocity, supported, held }
    }

    /// Force at an absorbing side whose balance at the start of the stage asks for `missing`: a side that lets waves out in place of a
    /// support goes on bearing what the support bore. A side that was free before bears nothing.
    pub(super) fn support(&self, dof: usize, missing: f64) -> f64 {
        match self.supported.get(dof) {
            Some(true) => missing,
            _ => self.held.get(dof).copied().unwrap_or(0.0),
        }
    }
}
