//! The seam to the sparse equations: what the solver asks of a frozen network. The equations themselves belong to the tangent
//! operators, which build on the solvers and not the other way round.

use std::fmt::Debug;

/// Two discs that touch, or could soon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiscPair {
    /// Origin grain.
    pub origin: usize,
    /// End grain.
    pub end: usize,
    /// Whether they touch; others only have a place in the matrix.
    pub touches: bool,
    /// Branch vector, m.
    pub branch: [f64; 2],
    /// Its length, m.
    pub length: f64,
    /// Normal and tangential stiffness, N/m.
    pub stiffness: [f64; 2],
    /// Normal force, N; negative in compression.
    pub normal_force: f64,
    /// Tangential force along the tangent, N.
    pub tangential_force: f64,
    /// Whether the contact slides: its tangential force follows the Coulomb limit.
    pub slides: bool,
}

/// Motion of each grain besides the affine one, m: per unknown (two displacements, spin times radius) those of the strains 11, 22
/// and 12 (with 1/2 at both places), and of the forces out of balance.
pub type DiscMotions = Vec<[[f64; 4]; 3]>;

/// Linear responses of plane networks. What it keeps from call to call is working memory.
pub trait LinearResponses: Debug + Send + Sync {
    /// The motions of all grains with these pairs, sorted by origin and end grain. `loads` are the forces out of balance on each
    /// grain and its moment over its radius, N. `None` where the equations have no finite solution.
    fn motions(
        &mut self,
        radii: &[f64],
        friction: f64,
        rotations_free: bool,
        pairs: &[DiscPair],
        loads: &[[f64; 3]],
    ) -> Option<DiscMotions>;

    /// The same without any working memory.
    fn new_instance(&self) -> Box<dyn LinearResponses>;
}
