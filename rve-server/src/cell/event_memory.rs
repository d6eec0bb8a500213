//! What the event-driven solver knows about a state beyond its grains: how they answer a small strain, and whether asking
//! that pays.
//!
//! It belongs to the state, is committed and rolled back with it and travels in its snapshot, so that a trial remains a
//! function of the committed state and the target alone.

use super::neighbours::PairKey;
use crate::space::{Discs, Space, Tensor, product};
use std::sync::Arc;

/// How grains answer a small strain as long as no contact changes its mode.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredResponse<S: Space = Discs> {
    /// Pairs that touch or could soon, sorted by key.
    pub pairs: Arc<Vec<PairKey<S>>>,
    /// Per grain and unknown (displacements, then spins times radius) the motion besides the affine one per unit of each
    /// independent strain, m, in the frame in which it was computed.
    pub columns: Arc<Vec<f64>>,
    /// Rotation from that frame to the present one.
    pub frame: S::Tensor,
    /// By how much any two grains may still approach before a pair that is not listed could touch, m.
    pub reach: f64,
}

impl<S: Space> StoredResponse<S> {
    /// Unknowns of one grain, which is also the number of independent strains.
    pub const UNKNOWNS: usize = S::DIMENSION * (S::DIMENSION + 1) / 2;

    /// Whether it fits a cell of this many grains.
    pub(crate) fn is_sound(&self, grain_count: usize) -> bool {
        let known = |pair: &PairKey<S>| (pair.origin.max(pair.end) as usize) < grain_count;
        self.columns.len() == grain_count * Self::UNKNOWNS * Self::UNKNOWNS
            && self.columns.iter().copied().chain(self.frame.components()).chain([self.reach]).all(f64::is_finite)
            && self.pairs.iter().all(known)
            && self.pairs.is_sorted()
    }
}

/// Memory of the event-driven solver.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EventMemory<S: Space = Discs> {
    /// Contact-force evaluations saved so far less those spent in vain, bounded.
    pub balance: i32,
    /// Trials that relaxation will answer before the solver tries again.
    pub pause: u32,
    /// How many they were when the last pause began; 0 once linear responses have paid again.
    pub last_pause: u32,
    /// The response at this state, if one is known.
    pub response: Option<StoredResponse<S>>,
}

impl<S: Space> EventMemory<S> {
    /// The memory of a state that is turned as a whole.
    pub(crate) fn turn(&mut self, matrix: &S::Tensor) {
        if let Some(response) = &mut self.response {
            response.frame = product(matrix, &response.frame);
        }
    }

    /// The cell is described by other vectors: names of pairs have changed.
    pub(crate) fn forget_response(&mut self) {
        self.response = None;
    }
}
