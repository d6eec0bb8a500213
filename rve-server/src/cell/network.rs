//! The contact network of one cell: all that a tangent operator needs to know about the grains.
//!
//! The relaxation solver freezes its state into a [`ContactNetwork`]; the operators in `tangent` linearise that frozen
//! network. The seam keeps operators testable on lattices with closed-form moduli, without any grain dynamics.
//!
//! Conventions of one contact, used everywhere in this crate: origin grain O, end grain E, branch vector
//! `b = x_E + sum_k shift_k Yk - x_O`, length `l`, normal `e = b / l`; in the plane the tangent is `t = e` rotated by
//! +90 degrees. The contact force `f = f_n e + f_t` is exerted **by E on O**, so `f_n < 0` in compression and the
//! Love-Weber stress `sum f x b / volume` is tension positive. `f_t` is one number along `t` in the plane and a vector
//! normal to `e` in space.

use super::state::GrainState;
use crate::space::{Discs, Space};

/// One contact that carries force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NetworkContact<S: Space = Discs> {
    /// Origin grain O.
    pub origin: u32,
    /// End grain E; equal to `origin` for a grain that touches its own image.
    pub end: u32,
    /// Cell shifts of the end grain along the periodicity vectors.
    pub shift: S::Shift,
    /// Normal stiffness k_n, N/m: the slope of the normal force at the present overlap.
    pub normal_stiffness: f64,
    /// Tangential stiffness k_t, N/m.
    pub tangential_stiffness: f64,
    /// Stiffness against rolling of the grains on each other, N m; 0 where the rolling moment is at its limit, because such
    /// a contact rolls on at no cost.
    pub rolling_stiffness: f64,
    /// Normal force f_n, N; negative in compression.
    pub normal_force: f64,
    /// Tangential force f_t, N.
    pub tangential_force: S::Tangential,
    /// Whether the contact was at the Coulomb limit during the ramp of the evaluation that led here.
    pub slid: bool,
    /// Whether the contact is at the Coulomb limit in this state.
    pub at_limit: bool,
}

/// A frozen periodic assembly of grains.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactNetwork<S: Space = Discs> {
    /// Periodicity vectors, each a row, m.
    pub cell: S::Tensor,
    /// Out-of-plane thickness of a plane cell, m; 1 in space.
    pub thickness: f64,
    /// Grain centres, m.
    pub positions: Vec<S::Vector>,
    /// Grain radii, m.
    pub radii: Vec<f64>,
    /// Whether grains may rotate.
    pub rotations_free: bool,
    /// Coulomb coefficient, the same for all contacts.
    pub friction: f64,
    /// Contacts in sorted pair order (origin, end, shift).
    pub contacts: Vec<NetworkContact<S>>,
}

impl<S: Space> ContactNetwork<S> {
    /// The same network in a state that differs by a rotation of the whole only.
    #[must_use]
    pub(crate) fn turned_to(mut self, state: &GrainState<S>) -> Self {
        self.cell = state.cell.rows;
        self.positions.clone_from(&state.positions);
        for (contact, record) in self.contacts.iter_mut().zip(&state.contacts) {
            contact.tangential_force = record.tangential_force;
        }
        self
    }

    /// Share of the contacts at the Coulomb limit; 0 without contacts.
    pub(crate) fn sliding_fraction(&self) -> f64 {
        let sliding = self.contacts.iter().filter(|contact| contact.at_limit).count();
        sliding as f64 / self.contacts.len().max(1) as f64
    }
}
