//! Contact laws, put together from parts and compiled as one: normal and tangential springs, friction, adhesion, rolling
//! resistance, viscosity.
//!
//! Every formula is written over [`Real`](crate::lanes::Real) without branches on numbers, so that it serves one contact
//! or one contact in several cells at once. Conventions of one contact: see [`crate::network`]; tangential quantities are
//! axial vectors as in [`crate::lanes::Kinematics`]: `f_t = tau x e`.

mod adhesion;
mod composed;
mod contact_law;
mod hertz;
mod linear;
mod rolling;
mod slip;
mod springs;
mod tangential;
#[cfg(test)]
mod tests;

pub use composed::{ComposedLaw, ExtendedHertzMindlin, ExtendedLinear, PlainHertzMindlin, PlainLinear};
pub use contact_law::{AT_LIMIT, ContactLaw, ContactMotion, ContactResponse, Viscous};
pub use hertz::HertzSprings;
pub use linear::LinearSprings;
pub use rolling::RollingSpring;
pub use slip::{Slip, slip_of_spheres};
pub use springs::Springs;
pub use tangential::Unloading;
