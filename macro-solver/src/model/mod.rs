//! The discretised body that all procedures share: geometry, Gauss points, constraints, loads, assembly of the elements.

pub(crate) mod assembly;
pub(crate) mod body;
pub(crate) mod constraints;
pub(crate) mod failure;
pub(crate) mod friction;
pub(crate) mod loads;
pub(crate) mod points;
pub(crate) mod stable_step;
