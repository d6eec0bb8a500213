//! Probes: one number per accepted step, a column of `history.csv` each.

use crate::formulation::tensor::matrix;
use crate::mesh::Mesh;
use crate::observer::{FieldsView, PointFields};
use crate::problem::Axis;
use protocol::Tensor2;

/// A named quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct Probe {
    /// Column name.
    pub name: String,
    /// What is measured.
    pub quantity: Quantity,
}

/// What a probe measures. Averages over the body are weighted with the current volume. Tension positive throughout,
/// except the quantities that say compression.
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
    },
    /// Change of the mean distance of two node sets along an axis over its initial value; elongation positive.
    Strain {
        /// Node set with the smaller coordinate.
        from: String,
        /// Node set with the larger coordinate.
        to: String,
        /// Direction.
        axis: Axis,
    },
    /// The same, **compression positive**.
    Compression {
        /// Node set with the smaller coordinate.
        from: String,
        /// Node set with the larger coordinate.
        to: String,
        /// Direction.
        axis: Axis,
    },
    /// Current over initial volume of the body, minus 1; dilation positive.
    VolumeChange,
    /// Mean Cauchy stress component, Pa.
    MeanStress {
        /// Row, 0 = x, 1 = y, 2 = z.
        row: usize,
        /// Column, 0 = x, 1 = y, 2 = z.
        column: usize,
    },
    /// Mean `sigma_yy` over mean `sigma_xx`, dimensionless.
    StressRatio,
    /// `p`: minus the mean of the principal values of the mean stress, the two of the plane or all three, Pa,
    /// **compression positive**.
    MeanPressure,
    /// `q`: mean `sigma_xx` minus mean `sigma_yy`, Pa, positive in vertical **compression**.
    Deviator,
    /// Mean void ratio.
    VoidRatio,
    /// Mean coordination number.
    CoordinationNumber,
    /// Stored contact energy of the body, J, in the plane per metre of thickness; needs the observable `energy`.
    ElasticEnergy,
    /// Work lost to friction since the start, J, in the plane per metre of thickness; needs the observable `energy`.
    FrictionalDissipation,
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
    /// Value after an accepted step. A set that the mesh does not have gives NaN; scenes are checked before.
    pub fn value(&self, view: &FieldsView<'_>) -> f64 {
        match self {
            Self::Reaction { set, axis } => {
                nodes(view.mesh, set).iter().map(|&node| view.reactions[node][axis.index()]).sum()
            }
            Self::Displacement { set, axis } => mean_over(view.mesh, set, view.displacements, *axis),
            Self::Strain { from, to, axis } => elongation(view, from, to, *axis),
            // Subtracted, not negated: an undeformed body has 0, not -0, in its history.
            Self::Compression { from, to, axis } => 0.0 - elongation(view, from, to, *axis),
            Self::VolumeChange => {
                let initial: f64 =
                    view.points.iter().map(|point| point.volume / determinant(&point.deformation)).sum();
                body_volume(view) / initial - 1.0
            }
            Self::MeanStress { row, column } => mean(view, |point| point.stress.get(*row, *column)),
            Self::StressRatio => {
                mean(view, |point| point.stress.get(1, 1)) / mean(view, |point| point.stress.get(0, 0))
            }
            Self::MeanPressure => {
                let axes = view.mesh.dimension.count();
                let trace = |point: &PointFields| (0..axes).map(|axis| point.stress.get(axis, axis)).sum::<f64>();
                -mean(view, trace) / axes as f64
            }
            Self::Deviator => mean(view, |point| point.stress.get(0, 0) - point.stress.get(1, 1)),
            Self::VoidRatio => mean(view, |point| point.scalars.void_ratio),
            Self::CoordinationNumber => mean(view, |point| point.scalars.coordination_number),
            Self::ElasticEnergy => body_sum(view, |point| point.observed.elastic_energy),
            Self::FrictionalDissipation => body_sum(view, |point| point.observed.frictional_dissipation),
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

    /// Whether the points have to be asked for their energies.
    pub fn needs_energy(&self) -> bool {
        matches!(self, Self::ElasticEnergy | Self::FrictionalDissipation)
    }
}

fn nodes<'a>(mesh: &'a Mesh, set: &str) -> &'a [usize] {
    mesh.node_sets.get(set).map_or(&[], Vec::as_slice)
}

fn mean_over(mesh: &Mesh, set: &str, values: &[[f64; 3]], axis: Axis) -> f64 {
    let nodes = nodes(mesh, set);
    nodes.iter().map(|&node| values[node][axis.index()]).sum::<f64>() / nodes.len() as f64
}

/// Change of the mean distance of two node sets over its initial value.
fn elongation(view: &FieldsView<'_>, from: &str, to: &str, axis: Axis) -> f64 {
    let distance =
        |values: &[[f64; 3]]| mean_over(view.mesh, to, values, axis) - mean_over(view.mesh, from, values, axis);
    distance(view.displacements) / distance(&view.mesh.nodes)
}

fn body_volume(view: &FieldsView<'_>) -> f64 {
    view.points.iter().map(|point| point.volume).sum()
}

fn body_sum(view: &FieldsView<'_>, density: impl Fn(&PointFields) -> f64) -> f64 {
    view.points.iter().map(|point| point.volume * density(point)).sum()
}

fn mean(view: &FieldsView<'_>, value: impl Fn(&PointFields) -> f64) -> f64 {
    body_sum(view, value) / body_volume(view)
}

fn determinant(deformation: &Tensor2) -> f64 {
    matrix(deformation).determinant()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::ElementKind;
    use crate::mesh::block::Block;
    use crate::observer::Statistics;
    use protocol::{Cost, Observed, Scalars, TrialFlags};

    /// Two elements of unequal size would hide a missing weight, so the two halves get different volumes.
    fn point(volume: f64, stress: [[f64; 2]; 2], jacobian: f64) -> PointFields {
        PointFields {
            element: 0,
            local: 0,
            initial_position: [0.0; 3],
            position: [0.0; 3],
            volume,
            deformation: Tensor2([jacobian, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
            step_gradient: Tensor2::ZERO,
            stress: Tensor2::from_plane(stress),
            scalars: Scalars { void_ratio: volume, ..Scalars::default() },
            observed: Observed { elastic_energy: 3.0, ..Observed::default() },
            flags: TrialFlags::default(),
            step_evaluations: 0,
            evaluations: 0,
            cost: Cost::default(),
            step_cost: Cost::default(),
        }
    }

    #[test]
    fn averages_are_weighted_with_the_volume_and_signs_are_as_promised() {
        let mesh = Block::plane([1.0, 2.0], [1, 1], ElementKind::Q4).mesh().unwrap();
        let points = [point(3.0, [[-1.0, 0.0], [0.0, -4.0]], 1.5), point(1.0, [[-5.0, 0.0], [0.0, -8.0]], 0.5)];
        let displacements: Vec<[f64; 3]> = mesh.nodes.iter().map(|&[x, y, _]| [0.1 * x, -0.25 * y, 0.0]).collect();
        let reactions = vec![[0.0, 7.0, 0.0]; mesh.nodes.len()];
        let loads = vec![[0.0; 3]; mesh.nodes.len()];
        let view = FieldsView {
            mesh: &mesh,
            displacements: &displacements,
            reactions: &reactions,
            loads: &loads,
            hourglass_energy: 0.25,
            dynamics: None,
            points: &points,
            statistics: &Statistics::default(),
        };
        let value = |quantity: Quantity| quantity.value(&view);
        let top = || "top".to_owned();
        assert_eq!(value(Quantity::MeanStress { row: 1, column: 1 }), -5.0);
        assert_eq!(value(Quantity::StressRatio), 2.5);
        assert_eq!(value(Quantity::MeanPressure), 3.5);
        assert_eq!(value(Quantity::Deviator), 3.0);
        assert_eq!(value(Quantity::VoidRatio), 2.5);
        assert_eq!(value(Quantity::VolumeChange), 0.0);
        assert_eq!(value(Quantity::ElasticEnergy), 12.0);
        assert_eq!(value(Quantity::HourglassEnergy), 0.25);
        assert_eq!(value(Quantity::Reaction { set: top(), axis: Axis::Y }), 14.0);
        assert_eq!(value(Quantity::Displacement { set: top(), axis: Axis::Y }), -0.5);
        assert_eq!(value(Quantity::Strain { from: "bottom".to_owned(), to: top(), axis: Axis::Y }), -0.25);
        assert_eq!(value(Quantity::Compression { from: "bottom".to_owned(), to: top(), axis: Axis::Y }), 0.25);
    }
}
