//! A step under way that is stabilised or goes on from a committed iterate: its viscosity, its increments so far, and what is reported
//! about them.

use crate::element::integrals::add_stiffness;
use crate::formulation::Formulation;
use crate::formulation::tensor::isotropic_moduli;
use crate::model::assembly::block::{Block, BlockDofs};
use crate::model::body::{Body, degrees_of_freedom};
use crate::observer::Stabilised;
use nalgebra::Matrix3;

/// Viscosity after an increment that went too far is at least this share of the first.
const LEAST_VISCOSITY: f64 = 0.1;

/// Share of the out-of-balance force that an increment may leave without a larger step factor for the next one.
const SLOW: f64 = 0.5;

/// Largest factor on an increment.
const LARGEST_STEP_FACTOR: f64 = 32.0;

/// Increments without viscosity after a committed iterate, after which viscosity is added.
const MOST_PLAIN: usize = 10;

/// Factor on the viscosity after a rejected increment.
const BACKTRACK_FACTOR: f64 = 4.0;

/// The path of a stabilised step.
pub(super) struct StabilisedPath {
    /// Viscosity of the first increment, as a factor on the first stiffness.
    first_viscosity: f64,
    /// Viscosity of the next increment.
    pub(super) viscosity: f64,
    /// Factor on the next increment.
    pub(super) step_factor: f64,
    /// `C`: stiffness of every element with its first moduli; empty until it is needed.
    viscous_blocks: Vec<Block>,
    /// Whether any increment had viscosity.
    pub(super) is_viscous: bool,
    /// Iterations before the path.
    pub(super) iterations: usize,
    /// Rejected increments in a row.
    pub(super) backtracks: usize,
    /// Rejected increments since the out-of-balance force last fell markedly.
    pub(super) rejections: usize,
    /// Increments at fixed loads in a row without a gain after which it is given up; `None`: never.
    pub(super) most_without_gain: Option<usize>,
    /// Share of the stage's path that supports and loads have reached.
    pub(super) stage_fraction: f64,
    /// Change of the displacements so far, m, by degree of freedom.
    pub(super) increment: Vec<f64>,
    /// Displacement gradients of the points over the path so far.
    pub(super) gradients: Vec<Matrix3<f64>>,
    /// Report about the path so far.
    pub(super) event: Stabilised,
}

impl StabilisedPath {
    /// A path from the committed state of `body`, at the share `stage_fraction` of the stage.
    pub(super) fn new(
        body: &Body,
        points: usize,
        first_viscosity: f64,
        stage_fraction: f64,
        event: Stabilised,
    ) -> Self {
        Self {
            first_viscosity,
            viscosity: first_viscosity,
            step_factor: 1.0,
            viscous_blocks: Vec::new(),
            is_viscous: false,
            iterations: 0,
            backtracks: 0,
            rejections: 0,
            most_without_gain: None,
            stage_fraction,
            increment: body.zero(),
            gradients: vec![Matrix3::zeros(); points],
            event,
        }
    }

    /// `C`, with the first moduli of every point.
    pub(super) fn viscous_blocks(&mut self, body: &Body, moduli: impl Fn(usize) -> [f64; 2]) -> &[Block] {
        if self.viscous_blocks.is_empty() {
            self.viscous_blocks = first_stiffness(body, moduli);
        }
        &self.viscous_blocks
    }

    /// Makes the next increment as viscous as the first of a stabilised step, if none had viscosity and there were [`MOST_PLAIN`] of them.
    pub(super) fn limit_plain_increments(&mut self) {
        // A rejected increment has brought more already.
        if !self.is_viscous && self.viscosity == 0.0 && self.event.increments >= MOST_PLAIN {
            self.viscosity = self.first_viscosity;
        }
    }

    /// Makes the next increment smaller after one that was rejected.
    pub(super) fn backtrack(&mut self) {
        self.backtracks += 1;
        self.rejections += 1;
        self.viscosity = (BACKTRACK_FACTOR * self.viscosity).max(self.first_viscosity);
        self.step_factor = 1.0;
    }

    /// Largest change of a displacement gradient that supports and loads may bring, for a cap of `cap`: a motion that went too
    /// far is made smaller too.
    pub(super) fn loading_cap(&self, cap: f64) -> f64 {
        cap / BACKTRACK_FACTOR.powi(i32::try_from(self.backtracks).unwrap_or(i32::MAX))
    }

    /// Chooses viscosity and step factor after an increment that left the share `left` of the out-of-balance force, or reversed
    /// it; `loads_moved` if supports and loads moved in it.
    ///
    /// Away from a state that is not stable the force grows by itself, and a tangent that is too stiff makes increments too
    /// short: neither requires more viscosity, and with some, increments are made longer. What rejected increments have added to the
    /// first one is taken back then, or the body would stand still.
    pub(super) fn adapt(&mut self, left: f64, reversed: bool, loads_moved: bool) {
        self.backtracks = 0;
        if left < SLOW {
            self.rejections = 0;
        }
        // Without viscosity it is Newton's method, which may converge from the other side.
        if reversed && (self.viscosity > 0.0 || left >= 1.0) {
            self.viscosity = (2.0 * self.viscosity).max(LEAST_VISCOSITY * self.first_viscosity);
        } else if left < 1.0 {
            self.viscosity *= (0.5 * left).max(0.2);
        } else if self.viscosity > self.first_viscosity {
            self.viscosity = (self.viscosity / BACKTRACK_FACTOR).max(self.first_viscosity);
        }
        let is_slow = !reversed && !loads_moved && left > SLOW && self.viscosity > 0.0;
        self.step_factor = if is_slow { (2.0 * self.step_factor).min(LARGEST_STEP_FACTOR) } else { 1.0 };
    }

    /// Norm of the displacement gradient of the path so far, averaged over the points.
    pub(super) fn mean_gradient(&self) -> f64 {
        self.gradients.iter().sum::<Matrix3<f64>>().norm() / self.gradients.len() as f64
    }

    /// Adds a committed increment.
    pub(super) fn add(&mut self, increment: &[f64], gradients: &[Matrix3<f64>], formulation: Formulation) {
        for (value, change) in self.increment.iter_mut().zip(increment) {
            *value += change;
        }
        for (total, gradient) in self.gradients.iter_mut().zip(gradients) {
            *total = formulation.joined(total, gradient);
        }
    }
}

/// Stiffness of every element with the moduli of its points, on the committed geometry.
fn first_stiffness(body: &Body, moduli: impl Fn(usize) -> [f64; 2]) -> Vec<Block> {
    let (dimension, geometry) = (body.mesh().dimension.count(), body.settled_geometry());
    let of_element = |(element, nodes): (usize, &Vec<usize>)| {
        let mut block = Block::zero(BlockDofs::square(degrees_of_freedom(dimension, nodes)));
        for point in body.points_of(element) {
            let [lambda, shear] = moduli(point);
            let moduli = isotropic_moduli(lambda, shear);
            add_stiffness(dimension, &geometry[point], nodes.len(), &moduli, &mut block.matrix);
        }
        block
    };
    body.mesh().elements.iter().enumerate().map(of_element).collect()
}

#[cfg(test)]
mod tests {
    use super::super::limits::MOST_WITHOUT_GAIN;
    use super::*;
    use crate::observer::AttemptCost;

    fn path() -> StabilisedPath {
        let event = Stabilised {
            step: 1,
            load: 1.0,
            increments: 0,
            evaluations: 0,
            failed: AttemptCost::default(),
            largest_imbalance: 0.0,
            work: 0.0,
            reason: String::new(),
        };
        StabilisedPath {
            first_viscosity: 0.1,
            viscosity: 0.1,
            step_factor: 1.0,
            viscous_blocks: Vec::new(),
            is_viscous: false,
            iterations: 0,
            backtracks: 0,
            rejections: 0,
            most_without_gain: Some(MOST_WITHOUT_GAIN),
            stage_fraction: 0.0,
            increment: Vec::new(),
            gradients: Vec::new(),
            event,
        }
    }

    /// An increment that ends just before a jump of the material brings nothing: what was rejected there still counts.
    #[test]
    fn rejected_increments_count_until_the_force_has_fallen_by_half() {
        let mut path = path();
        path.backtrack();
        path.adapt(0.98, false, false);
        path.backtrack();
        assert_eq!((path.backtracks, path.rejections), (1, 2));
        path.adapt(0.3, false, false);
        assert_eq!((path.backtracks, path.rejections), (0, 0));
    }

    /// After a committed iterate it is Newton's method: it may go past the balance as long as it comes closer, is not made longer, and gets
    /// viscosity where it goes astray or takes too long.
    #[test]
    fn increments_after_a_committed_iterate_get_viscosity_where_they_need_it() {
        let plain = || StabilisedPath { viscosity: 0.0, ..path() };
        let mut closer = plain();
        closer.adapt(0.7, true, false);
        closer.adapt(0.9, false, false);
        assert_eq!((closer.viscosity, closer.step_factor), (0.0, 1.0));
        let mut astray = plain();
        astray.adapt(1.2, true, false);
        assert!(astray.viscosity > 0.0);
        let mut long = plain();
        long.event.increments = MOST_PLAIN - 1;
        long.limit_plain_increments();
        assert_eq!(long.viscosity, 0.0);
        long.event.increments += 1;
        long.limit_plain_increments();
        assert_eq!(long.viscosity, 0.1);
        // It is rejected: the next one needs more, not the same once more.
        long.backtrack();
        long.limit_plain_increments();
        assert_eq!(long.viscosity, 0.4);
    }

    #[test]
    fn viscosity_that_rejected_increments_have_added_does_not_stay() {
        let mut path = path();
        for _ in 0..8 {
            path.backtrack();
        }
        assert!(path.viscosity > 1e3);
        // The force stays as it is, as it does where the body stands still.
        let increments = (0..100).take_while(|_| {
            path.adapt(1.0, false, false);
            path.viscosity > 0.1
        });
        assert!(increments.count() < 10);
        assert_eq!(path.viscosity, 0.1);
    }
}
