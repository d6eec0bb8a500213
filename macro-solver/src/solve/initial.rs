//! The check of the stress that the points start with, before any load step.

use super::driver::Solver;
use super::residual_norms::ResidualNorms;
use crate::problem::{ForceMeasure, InitialLimits};
use thiserror::Error;

/// A limit of the problem that the initial stress exceeds.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub(super) enum InitialStateDefect {
    /// Another stress than expected.
    #[error(
        "the points start with a stress that differs by {deviation:.2e} of the largest expected component from what \
         initial_stress expects; take packings prepared at the stress of their place, or allow more"
    )]
    Deviation {
        /// Largest deviation over the largest component expected or, where all are to be zero, found.
        deviation: f64,
    },
    /// Out of balance.
    #[error(
        "the initial stress is out of balance by {imbalance:.2e} of the loads and reactions; let the loads of the first \
         step be those that the packings were prepared under, or allow more and {otherwise}"
    )]
    Imbalance {
        /// Out-of-balance force over loads and reactions.
        imbalance: f64,
        /// What becomes of an imbalance that is allowed.
        otherwise: &'static str,
    },
}

/// Relative displacement whose elastic force keeps round-off from looking like imbalance.
const NEGLIGIBLE: f64 = 1e-9;

impl Solver<'_> {
    /// Records how far the initial stress is from balance and from what is expected, before step 0.
    ///
    /// # Errors
    /// A limit of the problem is exceeded.
    pub(super) fn check_initial_state(&mut self, start: &ResidualNorms) -> Result<(), InitialStateDefect> {
        self.check_start(start, "let step 0 equilibrate it")
    }

    /// The same before a motion, when all points have been evaluated.
    ///
    /// # Errors
    /// A limit of the problem is exceeded.
    pub(super) fn check_start_of_motion(&mut self) -> Result<(), InitialStateDefect> {
        // Forces alone: meshes of motions may be too large for a stiffness.
        self.balance = self.forces_at(&self.body.zero(), self.load);
        let mut start = self.residual_norms(0);
        start.scale = start.scale.max(self.negligible_force());
        self.check_start(
            &start,
            "let it set the body in motion, or begin with an implicit stage, which equilibrates it",
        )
    }

    /// Elastic force of an element of mean size, one side of which is moved by [`NEGLIGIBLE`] of the extent of the body, N, in the plane
    /// per metre.
    fn negligible_force(&self) -> f64 {
        let (mesh, formulation) = (self.body.mesh(), self.problem.formulation);
        let volume: f64 = self.body.settled_geometry().iter().map(|geometry| geometry.volume).sum();
        let axes = mesh.dimension.count() as i32;
        let side = (volume / mesh.elements.len() as f64).powf(1.0 / f64::from(axes));
        let moduli = self.points.all().iter().map(|point| point.total(formulation).moduli.amax());
        NEGLIGIBLE * moduli.fold(0.0, f64::max) * side.powi(axes - 2) * self.body.extent()
    }

    fn check_start(&mut self, start: &ResidualNorms, otherwise: &'static str) -> Result<(), InitialStateDefect> {
        self.statistics.initial_imbalance = start.ratio(ForceMeasure::Largest);
        self.statistics.initial_deviation = self.initial_deviation();
        let InitialLimits { largest_deviation, largest_imbalance } = self.problem.initial.limits;
        let (imbalance, deviation) = (self.statistics.initial_imbalance, self.statistics.initial_deviation);
        if largest_deviation.is_some_and(|limit| deviation > limit) {
            return Err(InitialStateDefect::Deviation { deviation });
        }
        if largest_imbalance.is_some_and(|limit| imbalance > limit) {
            return Err(InitialStateDefect::Imbalance { imbalance, otherwise });
        }
        Ok(())
    }

    /// Largest deviation of the initial stress from what is expected, over the largest component expected or, where all are to be zero, found; 0 if
    /// nothing is expected.
    fn initial_deviation(&self) -> f64 {
        let Some(expected) = &self.problem.initial.expected else { return 0.0 };
        let axes = self.body.mesh().dimension.count();
        let (mut deviation, mut largest, mut found) = (0.0f64, 0.0f64, 0.0f64);
        for (number, point) in self.points.all().iter().enumerate() {
            let wanted = expected.at(number, self.body.place(number, &self.body.mesh().nodes));
            let stress = &point.response.stress;
            // Cells of spheres have a stress across a plane mesh too; those of discs have none.
            let across = (axes < 3 && stress[(2, 2)] != 0.0 && wanted[(2, 2)] != 0.0).then_some((2, 2));
            for place in (0..axes).flat_map(|i| (0..axes).map(move |j| (i, j))).chain(across) {
                largest = largest.max(wanted[place].abs());
                found = found.max(stress[place].abs());
                deviation = deviation.max((stress[place] - wanted[place]).abs());
            }
        }
        let scale = if largest > 0.0 { largest } else { found };
        if scale > 0.0 { deviation / scale } else { 0.0 }
    }
}
