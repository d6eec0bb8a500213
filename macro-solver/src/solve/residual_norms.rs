//! Norms of the out-of-balance force, and of the forces that it is measured by.

use super::driver::Solver;
use super::vectors::norm;
use crate::model::assembly::balance::Balance;
use crate::model::constraints::Constraints;
use crate::problem::{ForceMeasure, Tolerances};

/// Relative displacement whose force is the least that reactions are taken for: it keeps round-off from looking like imbalance where they vanish.
const NO_DISPLACEMENT: f64 = 1e-9;

/// Share of the largest reactions or loads of the run below which the out-of-balance force is measured by that share: a body that
/// is unloaded to zero has nothing left to compare with.
const LEAST_FORCES: f64 = 1e-2;

/// Share of the largest reactions and loads, along any axis or of the run so far, that those along an axis count at least: an axis along which
/// hardly anything acts, and a body that is unloaded to zero, have nothing to compare with.
const LEAST_ALONG_AXIS: f64 = 0.2;

/// Norms of the out-of-balance force of an evaluated iterate and of the forces that it is measured by.
pub(super) struct ResidualNorms {
    /// Points evaluated.
    pub(super) evaluations: u64,
    /// Norm of the out-of-balance force at free degrees of freedom, N, in the plane per metre.
    pub(super) residual: f64,
    /// Norm of the reactions or of the loads, whichever is larger, and at least [`LEAST_FORCES`] of what they were, N, in the plane per metre.
    pub(super) scale: f64,
    /// Norm of the reactions, at least as much, N, in the plane per metre.
    pub(super) reactions: f64,
}

impl ResidualNorms {
    /// Of the balance of a body of this extent, m, after so many evaluations; `largest_forces` are those of the run so far, N.
    pub(super) fn of(
        balance: &Balance,
        constraints: &Constraints,
        extent: f64,
        largest_forces: f64,
        evaluations: u64,
    ) -> Self {
        let residual = balance.residual();
        let of_supports: Vec<f64> =
            (0..residual.len()).filter(|&dof| constraints.unknown(dof).is_none()).map(|dof| residual[dof]).collect();
        let reactions = norm(&of_supports).max(NO_DISPLACEMENT * balance.largest_diagonal() * extent);
        let least = LEAST_FORCES * largest_forces;
        Self {
            evaluations,
            residual: norm(&constraints.restrict(&residual)),
            scale: reactions.max(norm(&balance.external)).max(least),
            reactions: reactions.max(least),
        }
    }

    /// Out-of-balance over the forces that the criteria of a stage name. A stage whose criteria leave the forces out reports the ratio
    /// too, and iterations that grow are recognised by it: it is then that of the default measure.
    pub(super) fn force_ratio(&self, tolerances: &Tolerances) -> f64 {
        self.ratio(tolerances.criteria.force.unwrap_or_default())
    }

    /// Out-of-balance over the forces that a measure names.
    pub(super) fn ratio(&self, measure: ForceMeasure) -> f64 {
        let scale = match measure {
            ForceMeasure::Largest => self.scale,
            ForceMeasure::Reactions => self.reactions,
        };
        if self.residual == 0.0 { 0.0 } else { self.residual / scale }
    }
}

impl Solver<'_> {
    /// Largest sum of the out-of-balance forces of the committed state along an axis, over reactions and loads along it. A part of the body
    /// that is out of balance as a whole has a small norm and a large sum. Forces at followers count where their masters move.
    pub(super) fn force_sum(&self) -> f64 {
        let (balance, axes) = (&self.committed_balance, self.body.mesh().dimension.count());
        let residual = balance.residual();
        let (mut sums, mut reactions, mut loads) = (vec![0.0; axes], vec![0.0; axes], vec![0.0; axes]);
        for (dof, force) in self.constraints.free().iter().zip(self.constraints.restrict(&residual)) {
            sums[dof % axes] += force;
        }
        for (dof, (force, load)) in residual.iter().zip(&balance.external).enumerate() {
            loads[dof % axes] += load.abs();
            if self.constraints.is_given(dof) {
                reactions[dof % axes] += force.abs();
            }
        }
        let scales: Vec<f64> = reactions.iter().zip(&loads).map(|(reaction, load)| reaction.max(*load)).collect();
        let least = LEAST_ALONG_AXIS * scales.iter().copied().fold(self.statistics.largest_forces, f64::max);
        let ratio = |(sum, scale): (&f64, &f64)| match scale.max(least) {
            0.0 => 0.0,
            scale => sum.abs() / scale,
        };
        sums.iter().zip(&scales).map(ratio).fold(0.0, f64::max)
    }
}
