//! From grains to a continuum: stress, fabric, coordination, energy of a frozen cell.
//!
//! All measures are functions of a [`ContactNetwork`](crate::cell::ContactNetwork) and sums in contact order.

pub mod fabric;
pub mod fluctuation;
pub mod force_anisotropy;
pub(crate) mod observation;
pub mod picture;
pub(crate) mod rattlers;
pub mod stress;
