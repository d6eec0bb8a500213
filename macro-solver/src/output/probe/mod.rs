//! Probes: one number per accepted step, a column of `history.csv` each.

mod band;
mod error_band;
mod field;
mod measure;
mod profile;
mod reference;
mod stress_measure;

#[cfg(test)]
pub(super) mod tests;

pub(super) use error_band::LargestLevels;

pub use band::{BandProbe, BandProperty, LayerBand};
pub use field::{FieldProbe, Part, Statistic};
pub use measure::Measure;
pub use profile::Profile;
pub use reference::{ReferenceState, References};
pub use stress_measure::{Axes, Rank, StressMeasure};

use crate::material::error_estimate::ErrorEstimate;
use crate::mesh::{Dimension, Mesh};
use crate::observer::FieldsView;
use crate::output::units::{energy, force};
use crate::problem::Axis;
use protocol::Observables;
use reference::{Origin, Start};

/// A named quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct Probe {
    /// Column name.
    pub name: String,
    /// What is measured.
    pub quantity: Quantity,
}

/// What a probe measures. Tension positive throughout, except the quantities that say compression.
#[derive(Clone, Debug, PartialEq)]
pub enum Quantity {
    /// Sum of the support forces on a node set, N, in the plane per metre of thickness; the force that the support exerts on the
    /// body, positive along the axis.
    Reaction {
        /// Node set.
        set: String,
        /// Component.
        axis: Axis,
    },
    /// Mean displacement of a node set, m.
    Displacement {
        /// Node set.
        set: String,
        /// Component.
        axis: Axis,
        /// Stage, from 0, from whose start displacements are counted; without one from the start of the run.
        reference: Option<usize>,
    },
    /// Change of the mean distance of two node sets along an axis over its reference value; elongation positive.
    Strain {
        /// Node set with the smaller coordinate.
        from: String,
        /// Node set with the larger coordinate.
        to: String,
        /// Direction.
        axis: Axis,
        /// Stage, from 0, from whose start the change is counted; without one from the start of the run.
        reference: Option<usize>,
    },
    /// The same, **compression positive**.
    Compression {
        /// Node set with the smaller coordinate.
        from: String,
        /// Node set with the larger coordinate.
        to: String,
        /// Direction.
        axis: Axis,
        /// Stage, from 0, from whose start the change is counted; without one from the start of the run.
        reference: Option<usize>,
    },
    /// A measure at the Gauss points, over the body or a part of it.
    Field(FieldProbe),
    /// Width or inclination of a shear band.
    Band(BandProbe),
    /// Energy of the hourglass control of elements with one point, J, in the plane per metre of thickness.
    HourglassEnergy,
    /// Mean velocity of a node set, m/s; 0 in a quasi-static stage.
    Velocity {
        /// Node set.
        set: String,
        /// Component.
        axis: Axis,
    },
    /// Mean acceleration of a node set, m/s2; 0 in a quasi-static stage.
    Acceleration {
        /// Node set.
        set: String,
        /// Component.
        axis: Axis,
    },
    /// Kinetic energy of the body, J, in the plane per metre of thickness; 0 in a quasi-static stage.
    KineticEnergy,
    /// Residual of the energy balance over the largest energy so far, dimensionless; 0 in a quasi-static stage.
    EnergyResidual,
}

impl Quantity {
    /// Value after an accepted step. A set that the mesh does not have gives NaN; scenes are checked before. A value that is counted
    /// from the start of a stage is 0 until that stage has begun.
    pub fn value(&self, view: &FieldsView<'_>, references: &References) -> f64 {
        match self {
            Self::Reaction { set, axis } => {
                nodes(view.mesh, set).iter().map(|&node| view.reactions[node][axis.index()]).sum()
            }
            Self::Displacement { set, axis, reference } => {
                let now = mean_over(view.mesh, set, view.displacements, *axis);
                match references.origin(*reference).start {
                    Start::Run => now,
                    Start::Stage(state) => now - mean_over(view.mesh, set, &state.displacements, *axis),
                    Start::NotBegun => 0.0,
                }
            }
            Self::Strain { from, to, axis, reference } => {
                elongation(view, from, to, *axis, references.origin(*reference))
            }
            // Subtracted, not negated: an undeformed body has 0, not -0, in its history.
            Self::Compression { from, to, axis, reference } => {
                0.0 - elongation(view, from, to, *axis, references.origin(*reference))
            }
            Self::Field(probe) => probe.value(view, references),
            Self::Band(probe) => probe.value(view, references),
            Self::HourglassEnergy => view.hourglass_energy,
            Self::Velocity { set, axis } => {
                view.dynamics.map_or(0.0, |motion| mean_over(view.mesh, set, motion.velocities, *axis))
            }
            Self::Acceleration { set, axis } => {
                view.dynamics.map_or(0.0, |motion| mean_over(view.mesh, set, motion.accelerations, *axis))
            }
            Self::KineticEnergy => view.dynamics.map_or(0.0, |motion| motion.energy.kinetic),
            Self::EnergyResidual => view.dynamics.map_or(0.0, |motion| motion.energy.relative_residual()),
        }
    }

    /// Error of the value by the estimated error of the stresses, in its unit; `None` for what is not a mean of stresses. `level` is what
    /// the estimate is relative to, Pa: the largest [`Quantity::level`] so far.
    fn error(&self, view: &FieldsView<'_>, estimate: &ErrorEstimate, level: f64) -> Option<f64> {
        self.of_stresses().and_then(|probe| probe.error(view, estimate, level))
    }

    /// [Level](crate::material::stress_level::stress_level) of the mean stress that the value is a function of, Pa; 0 without one.
    fn level(&self, view: &FieldsView<'_>) -> f64 {
        self.of_stresses().map_or(0.0, |probe| probe.level(view))
    }

    /// Unit of the value; `-` if it has none. Forces and energies of plane bodies are per metre of thickness.
    pub fn unit(&self, dimension: Dimension) -> &'static str {
        match self {
            Self::Reaction { .. } => force(dimension),
            Self::Displacement { .. } => "m",
            Self::Strain { .. } | Self::Compression { .. } | Self::EnergyResidual => "-",
            Self::Field(probe) => probe.unit(dimension),
            Self::Band(probe) => probe.property.unit(),
            Self::HourglassEnergy | Self::KineticEnergy => energy(dimension),
            Self::Velocity { .. } => "m/s",
            Self::Acceleration { .. } => "m/s2",
        }
    }

    /// Whether the value has an error by that of the stresses.
    pub(crate) fn has_error(&self) -> bool {
        self.of_stresses().is_some()
    }

    /// The probe, if its value is a mean of stresses or a function of one.
    fn of_stresses(&self) -> Option<&FieldProbe> {
        match self {
            Self::Field(probe) => Some(probe).filter(|probe| probe.has_error()),
            Self::Reaction { .. }
            | Self::Displacement { .. }
            | Self::Strain { .. }
            | Self::Compression { .. }
            | Self::Band(_)
            | Self::HourglassEnergy
            | Self::Velocity { .. }
            | Self::Acceleration { .. }
            | Self::KineticEnergy
            | Self::EnergyResidual => None,
        }
    }

    /// What is measured at Gauss points for it, if anything is.
    fn measure(&self) -> Option<&Measure> {
        match self {
            Self::Field(probe) => Some(&probe.measure),
            Self::Band(probe) => Some(&probe.measure),
            Self::Reaction { .. }
            | Self::Displacement { .. }
            | Self::Strain { .. }
            | Self::Compression { .. }
            | Self::HourglassEnergy
            | Self::Velocity { .. }
            | Self::Acceleration { .. }
            | Self::KineticEnergy
            | Self::EnergyResidual => None,
        }
    }

    /// Optional results that the points have to be asked for.
    pub fn needs(&self) -> Observables {
        self.measure().map_or(Observables::NONE, Measure::needs)
    }

    /// Whether the quantity compares the state with that at the end of the step before.
    pub(super) fn compares_steps(&self) -> bool {
        self.measure().is_some_and(Measure::compares_steps)
    }

    /// Stage, from 0, from whose start the quantity is counted.
    pub fn reference(&self) -> Option<usize> {
        match self {
            Self::Displacement { reference, .. }
            | Self::Strain { reference, .. }
            | Self::Compression { reference, .. } => *reference,
            Self::Field(probe) => probe.reference,
            Self::Band(probe) => probe.reference,
            Self::Reaction { .. }
            | Self::HourglassEnergy
            | Self::Velocity { .. }
            | Self::Acceleration { .. }
            | Self::KineticEnergy
            | Self::EnergyResidual => None,
        }
    }
}

fn nodes<'a>(mesh: &'a Mesh, set: &str) -> &'a [usize] {
    mesh.node_sets.get(set).map_or(&[], Vec::as_slice)
}

fn mean_over(mesh: &Mesh, set: &str, values: &[[f64; 3]], axis: Axis) -> f64 {
    let nodes = nodes(mesh, set);
    nodes.iter().map(|&node| values[node][axis.index()]).sum::<f64>() / nodes.len() as f64
}

/// Change of the mean distance of two node sets over its reference value.
fn elongation(view: &FieldsView<'_>, from: &str, to: &str, axis: Axis, origin: Origin<'_>) -> f64 {
    let distance =
        |values: &[[f64; 3]]| mean_over(view.mesh, to, values, axis) - mean_over(view.mesh, from, values, axis);
    match origin.start {
        Start::Run => distance(view.displacements) / distance(&view.mesh.nodes),
        Start::Stage(state) => {
            let at = |set: &str| state.mean_position(view.mesh, nodes(view.mesh, set), axis.index());
            (distance(view.displacements) - distance(&state.displacements)) / (at(to) - at(from))
        }
        Start::NotBegun => 0.0,
    }
}
