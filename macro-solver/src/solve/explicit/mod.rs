//! Explicit dynamics: central differences with lumped masses.
//!
//! One evaluation of every point per time step, each committed at once; there are no iterations and no global matrix.
//! Displacements and forces belong to instants, velocities to the middles between them. With the corotational formulation
//! this is the algorithm of [Liu2015] section 2.3.3: strain increments on the midpoint geometry, turned into and out of
//! the frame of the polar decomposition, forces on the geometry at the end of the step.
//!
//! The step is bounded by the fastest element ([`crate::problem::dynamics::TimeStepRule`]), and every step is checked by an energy balance,
//! so an unstable run ends with a reason instead of a field of numbers.

mod constrained_velocities;
mod dashpots;
mod energy;
mod handover;
mod instants;
mod integrator;
mod masses;
mod record;
mod stage;
mod stage_context;
#[cfg(test)]
mod tests;

pub(crate) use handover::Handover;
pub(crate) use integrator::Integrator;
pub(crate) use record::IntegratorRecord;
