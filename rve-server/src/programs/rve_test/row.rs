//! One row of an element test.

use super::path::{Matrix, tensor_of};
use super::stress_control::StressControl;
use crate::homogenization::force_anisotropy::ForceAnisotropy;
use crate::homogenization::picture::CellPicture;
use crate::tangent::TangentOutcome;
use protocol::{TrialFlags, TrialResult};

/// The accepted state after one increment; row 0 is the packing as given, before any grain has moved.
#[derive(Clone, Debug, PartialEq)]
pub struct ElementRow {
    /// Number of the increment, from 0, counted through all segments.
    pub increment: u64,
    /// 2 for discs, 3 for spheres.
    pub dimension: u32,
    /// Deformation gradient relative to the packing as given; out of the plane of discs it is the unit tensor.
    pub deformation: [[f64; 3]; 3],
    /// Cauchy stress, Pa, tension positive; zero out of the plane of discs.
    pub stress: [[f64; 3]; 3],
    /// Void volume over grain volume.
    pub void_ratio: f64,
    /// 2 x contacts over grains.
    pub coordination_number: f64,
    /// The same without rattlers and their contacts.
    pub coordination_number_no_rattlers: f64,
    /// Major over minor principal value of the contact fabric, minus 1.
    pub fabric_anisotropy: f64,
    /// Share of contacts at the Coulomb limit.
    pub sliding_fraction: f64,
    /// Value of the equilibrium criterion.
    pub unbalanced_force_ratio: f64,
    /// Largest overlap over the smaller grain diameter of its contact.
    pub max_overlap_ratio: f64,
    /// Energy stored in the contacts over the volume of the cell, J/m3.
    pub elastic_energy: f64,
    /// Energy lost to friction and contact viscosity since the packing as given, over the volume of the cell, J/m3.
    pub frictional_dissipation: f64,
    /// Work done on the cell since the packing as given, over the volume of the cell, J/m3: summed up over the steps of the grains, by the
    /// event-driven solver and of frames by trapezoids over all committed states, those between two rows included.
    pub work: f64,
    /// Energy that numerical damping has taken since the packing as given, over the volume of the cell, J/m3; of periodic cells, not of frames.
    /// It closes the balance: work = change of the stored energy + `frictional_dissipation` + `damping_work`.
    pub damping_work: Option<f64>,
    /// DEM steps spent on this row, those of rejected trials of the stress control included. 0 in row 0.
    pub dem_steps: u64,
    /// Contact fabric `1/C sum n x n`.
    pub fabric: [[f64; 3]; 3],
    /// Anisotropies of contacts and contact forces.
    pub force_anisotropy: Option<ForceAnisotropy>,
    /// Grains and contacts, if they were requested.
    pub picture: Option<CellPicture>,
    /// Displacement fluctuation of each grain of the picture, m, since the increment that was requested; of none before that.
    pub fluctuations: Option<Vec<[f64; 3]>>,
    /// Tangent operator in this row's own state, if one was requested.
    pub tangent: Option<TangentOutcome>,
    /// Trials that this row needed: 1 without stress control, 0 in row 0.
    pub trials: u32,
    /// How the controlled stresses came about; [`StressControl::None`] in row 0 and where strains alone are prescribed.
    pub stress_control: StressControl,
    /// Shortcuts of the accepted trial.
    pub flags: TrialFlags,
}

impl ElementRow {
    pub(crate) fn new(
        increment: u64,
        dimension: u32,
        deformation: Matrix,
        answer: &TrialResult,
        tangent: Option<TangentOutcome>,
    ) -> Self {
        Self {
            increment,
            dimension,
            deformation,
            stress: tensor_of(&answer.stress.0),
            void_ratio: answer.scalars.void_ratio,
            coordination_number: answer.scalars.coordination_number,
            coordination_number_no_rattlers: answer.observed.coordination_number_no_rattlers,
            fabric_anisotropy: answer.observed.fabric_anisotropy,
            sliding_fraction: answer.observed.sliding_fraction,
            unbalanced_force_ratio: answer.scalars.unbalanced_force_ratio,
            max_overlap_ratio: answer.scalars.max_overlap_ratio,
            elastic_energy: answer.observed.elastic_energy,
            frictional_dissipation: answer.observed.frictional_dissipation,
            work: 0.0,
            damping_work: None,
            dem_steps: 0,
            fabric: tensor_of(&answer.observed.fabric.0),
            force_anisotropy: None,
            picture: None,
            fluctuations: None,
            tangent,
            trials: 0,
            stress_control: StressControl::None,
            flags: answer.flags,
        }
    }
}
