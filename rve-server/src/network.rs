//! The contact network of one cell: all that a tangent operator needs to know about the grains.
//!
//! The relaxation solver freezes its state into a [`ContactNetwork`]; the operators in `tangent` linearise that frozen
//! network. The seam keeps operators testable on lattices with closed-form moduli, without any grain dynamics.
//!
//! Conventions of one contact, used everywhere in this crate: origin grain O, end grain E, branch vector
//! `b = x_E + shift_1 Y1 + shift_2 Y2 - x_O`, length `l`, normal `e = b / l`, tangent `t = e` rotated by +90 degrees.
//! The contact force `f = f_n e + f_t t` is exerted **by E on O**, so `f_n < 0` in compression and the Love-Weber stress
//! `sum f x b / (A thickness)` is tension positive.

/// One contact that carries force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NetworkContact {
    /// Origin grain O.
    pub origin: u32,
    /// End grain E; equal to `origin` for a grain that touches its own image.
    pub end: u32,
    /// Cell shifts of the end grain along Y1 and Y2.
    pub shift: [i32; 2],
    /// Normal stiffness k_n, N/m.
    pub normal_stiffness: f64,
    /// Tangential stiffness k_t, N/m.
    pub tangential_stiffness: f64,
    /// Normal force f_n, N; negative in compression.
    pub normal_force: f64,
    /// Tangential force f_t along t, N.
    pub tangential_force: f64,
    /// Whether the contact was at the Coulomb limit during the ramp of the evaluation that led here.
    pub slid: bool,
}

/// A frozen periodic assembly of discs.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactNetwork {
    /// Periodicity vectors Y1, Y2, each a row, m.
    pub cell: [[f64; 2]; 2],
    /// Out-of-plane thickness, m.
    pub thickness: f64,
    /// Grain centres, m.
    pub positions: Vec<[f64; 2]>,
    /// Grain radii, m.
    pub radii: Vec<f64>,
    /// Whether grains may rotate.
    pub rotations_free: bool,
    /// Coulomb coefficient, the same for all contacts.
    pub friction: f64,
    /// Contacts in sorted pair order (origin, end, shift).
    pub contacts: Vec<NetworkContact>,
}
