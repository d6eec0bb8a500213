//! Contact laws, put together from parts and compiled as one: normal and tangential springs, friction, adhesion, rolling
//! resistance, viscosity; and the table `[contact]` that chooses among them.
//!
//! Every formula is written over [`Real`](crate::simd::Real) without branches on numbers, so that it serves one contact
//! or one contact in several cells at once. Conventions of one contact: see [`crate::cell::network`]; tangential quantities
//! are axial vectors as in [`KernelSpace`](crate::space::KernelSpace): `f_t = tau x e`.

mod adhesion;
mod compile;
mod composed;
mod hertz_mindlin;
mod law;
mod linear;
mod rolling;
mod springs;
mod table;
#[cfg(test)]
mod tests;
mod unloading;

pub use compile::{ContactLaws, LawVisitor};
pub use composed::{ComposedLaw, ExtendedHertzMindlin, ExtendedLinear, PlainHertzMindlin, PlainLinear};
pub use hertz_mindlin::HertzSprings;
pub use law::{AT_LIMIT, ContactLaw, ContactMotion, ContactResponse, Viscous};
pub use linear::{LinearSprings, NormalStiffness};
pub use rolling::RollingSpring;
pub use springs::Springs;
pub use table::{ContactTable, LawName, Rotations};
pub use unloading::TangentialUnloading;
