//! Nodal forces and stiffness of the elements.

pub(crate) mod balance;
pub(crate) mod block;
pub(crate) mod forces;
pub(crate) mod isotropic;
pub(crate) mod viscosity;
