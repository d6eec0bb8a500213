//! The state of the body that an observer sees after an accepted step.

use super::{EnergyBalance, Statistics};
use crate::mesh::Mesh;
use protocol::{Cost, Observed, Scalars, Tensor2, TrialFlags};

/// State of one Gauss point after an accepted step.
#[derive(Clone, Debug, PartialEq)]
pub struct PointFields {
    /// Element, from 0.
    pub element: usize,
    /// Gauss point of the element, from 0.
    pub local: usize,
    /// Initial position, m.
    pub initial_position: [f64; 3],
    /// Current position, m.
    pub position: [f64; 3],
    /// Current volume of the point (weight times Jacobian), m3; in the plane per metre of thickness.
    pub volume: f64,
    /// Total deformation gradient since the start of the run.
    pub deformation: Tensor2,
    /// Displacement gradient of this step, relative to the configuration at its start (the initial one for small
    /// strain).
    pub step_gradient: Tensor2,
    /// Cauchy stress of the grains (the effective stress where pores hold fluid), Pa, tension positive.
    pub stress: Tensor2,
    /// Excess pressure of pore fluid that cannot drain, Pa, compression positive; the total stress is `stress` minus this on the
    /// diagonal. `None` where pores drain.
    pub pore_pressure: Option<f64>,
    /// Cheap scalars of the accepted answer.
    pub scalars: Scalars,
    /// Optional results of the accepted answer; only what [`Problem::observables`] asked for is meaningful.
    pub observed: Observed,
    /// Shortcuts of the accepted answer.
    pub flags: TrialFlags,
    /// Evaluations of this point in this step, failed attempts included.
    pub step_evaluations: u64,
    /// Evaluations of this point since the start.
    pub evaluations: u64,
    /// Cost of this point's evaluations since the start.
    pub cost: Cost,
    /// Cost of this point's evaluations in this step, failed attempts included.
    pub step_cost: Cost,
}

/// The whole body after an accepted step.
#[derive(Clone, Copy, Debug)]
pub struct FieldsView<'a> {
    /// The mesh as given, with initial positions.
    pub mesh: &'a Mesh,
    /// Displacements since the start, m.
    pub displacements: &'a [[f64; 3]],
    /// Force that supports exert on each node, N, in the plane per metre of thickness; zero at free components.
    pub reactions: &'a [[f64; 3]],
    /// Force of the loads on each node, N, in the plane per metre of thickness.
    pub loads: &'a [[f64; 3]],
    /// Energy of the hourglass control of elements with one point, J, in the plane per metre of thickness.
    pub hourglass_energy: f64,
    /// Energy of pore fluid that cannot drain, J, in the plane per metre of thickness.
    pub fluid_energy: f64,
    /// Motion and energies; `None` in a quasi-static stage.
    pub dynamics: Option<DynamicsView<'a>>,
    /// Gauss points, by [`crate::material::PointId`].
    pub points: &'a [PointFields],
    /// Counts and times so far.
    pub statistics: &'a Statistics,
}

/// Motion of the body at a reported instant.
#[derive(Clone, Copy, Debug)]
pub struct DynamicsView<'a> {
    /// Velocities, m/s.
    pub velocities: &'a [[f64; 3]],
    /// Accelerations, m/s2.
    pub accelerations: &'a [[f64; 3]],
    /// Energies since the stage began.
    pub energy: EnergyBalance,
    /// Time step, s.
    pub time_step: f64,
    /// Bound of the stable time step by the elastic tangents of the elements, s.
    pub stable_step: f64,
    /// Mass added by mass scaling, kg, in the plane per metre of thickness.
    pub added_mass: f64,
    /// Mass of the body, added mass included, kg, in the plane per metre of thickness.
    pub mass: f64,
}
