//! The dimension of a packing: what differs between discs in a plane and spheres in space, and nothing else.
//!
//! All grain code is written once, for any [`Space`], and compiled for each of its two kinds: [`Discs`] and [`Spheres`].
//! Types that carry a dimension take it as a parameter that defaults to [`Discs`]. Sums over axes run in axis order, so
//! that a plane computation has the bits that it would have if it were written out for two axes.

mod components;
mod discs;
mod kernel_space;
pub mod plane;
mod slip;
mod spheres;
mod tensor;

pub use components::Components;
pub use discs::Discs;
pub use kernel_space::{KernelSpace, Shortened};
pub use slip::{Slip, slip_of_spheres};
pub use spheres::Spheres;
pub(crate) use tensor::cross;
pub use tensor::{
    Tensor, add_scaled, apply, determinant, inverse, largest_component, norm, product, rotated, scaled, transpose,
};

use bytemuck::Pod;
use serde::{Serialize, de::DeserializeOwned};
use std::fmt::Debug;
use std::ops::{Index, IndexMut};

/// Rotation and stretch of a deformation gradient, `F = I + H = R U`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PolarParts<S: Space> {
    /// The rotation `R`.
    pub turn: S::Turn,
    /// `U - I`, symmetric.
    pub strain: S::Tensor,
}

/// Rotations, moments and tangential forces as the force kernel has them.
pub type Axial<S> = <<S as Space>::Kernel as KernelSpace>::Axial<f64>;

/// A kind of grains with the space they live in.
pub trait Space: Copy + Debug + Default + PartialEq + Eq + PartialOrd + Ord + Send + Sync + Sized + 'static {
    /// Number of axes, 2 or 3.
    const DIMENSION: usize;

    /// Name of the grains in messages.
    const GRAINS: &'static str;

    /// This dimension in the force kernel.
    type Kernel: KernelSpace<Coordinates<f64> = Self::Vector>;

    /// Rotation that carries a contact's history along in one step.
    type Carrier: Copy + Debug;

    /// One number per axis.
    type Vector: Components + Index<usize, Output = f64> + IndexMut<usize> + Serialize + DeserializeOwned;

    /// Whole numbers of cells along the periodicity vectors.
    type Shift: Copy
        + Debug
        + Default
        + Eq
        + Ord
        + Send
        + Sync
        + 'static
        + Pod
        + Index<usize, Output = i32>
        + IndexMut<usize>
        + Serialize
        + DeserializeOwned;

    /// A second-order tensor, row-major.
    type Tensor: Tensor<Vector = Self::Vector> + Serialize + DeserializeOwned;

    /// Rotations and moments: one number in the plane, a vector in space.
    type Spin: Components + Serialize + DeserializeOwned;

    /// A tangential force: the component along `e` rotated by +90 degrees in the plane, a vector normal to `e` in space.
    type Tangential: Components + Serialize + DeserializeOwned;

    /// Centre and radius of a grain as packing files have them.
    type Grain: Copy
        + Debug
        + PartialEq
        + Send
        + Sync
        + 'static
        + Index<usize, Output = f64>
        + IndexMut<usize>
        + AsRef<[f64]>
        + Serialize
        + DeserializeOwned;

    /// A rotation of the whole space; [`Default`] is none at all.
    type Turn: Copy + Debug + Default + PartialEq + Send + Sync + 'static;

    /// The grain with this centre and radius.
    fn grain(centre: Self::Vector, radius: f64) -> Self::Grain;

    /// Centre of a grain, m.
    fn centre(grain: &Self::Grain) -> Self::Vector {
        Self::Vector::from_fn(|axis| grain[axis])
    }

    /// Radius of a grain, m.
    fn radius(grain: &Self::Grain) -> f64 {
        grain[Self::DIMENSION]
    }

    /// Area (m2) or volume (m3) of a grain.
    fn grain_measure(radius: f64) -> f64;

    /// Moment of inertia of a homogeneous grain over mass times radius squared.
    const INERTIA_FACTOR: f64;

    /// Shift with the given components.
    fn shift(component: impl FnMut(usize) -> i32) -> Self::Shift;

    /// Rows that are normal to all periodicity vectors but one: fractional coordinate `i` of a point is its product with
    /// row `i` over the cell's area or volume.
    fn cofactors(rows: &Self::Tensor) -> Self::Tensor;

    /// Force `f_n e + f_t` on the origin grain, N.
    fn contact_force(direction: Self::Vector, normal: f64, tangential: Self::Tangential) -> Self::Vector;

    /// A tangential force on one grain of a contact as the force on the other one, if `is_swapped`. Along t it is the same
    /// number seen from either grain, because e, t and the force all change sign; a vector changes its sign.
    fn seen_from(tangential: Self::Tangential, is_swapped: bool) -> Self::Tangential;

    /// Moment of the tangential force on either grain of a contact per unit of its arm, N: both grains are turned the
    /// same way.
    fn contact_moment(direction: Self::Vector, tangential: Self::Tangential) -> Self::Spin;

    /// A rotation or moment as the force kernel has it.
    fn axial(spin: Self::Spin) -> Axial<Self>;

    /// A rotation or moment from the force kernel.
    fn spin(axial: Axial<Self>) -> Self::Spin;

    /// The axial vector `tau` of a tangential force `f_t = tau x e`.
    fn to_axial(tangential: Self::Tangential, direction: Self::Vector) -> Axial<Self>;

    /// The tangential force of an axial vector.
    fn from_axial(axial: Axial<Self>, direction: Self::Vector) -> Self::Tangential;

    /// Slip of a step in which the normal went from `before` to `direction` and the grains span, m, and what carries
    /// the contact's history along. A pair that rotates rigidly slips by exactly nothing.
    fn slip(
        before: Self::Vector,
        direction: Self::Vector,
        length: f64,
        arms: [f64; 2],
        spins: [Self::Spin; 2],
    ) -> (Axial<Self>, Self::Carrier);

    /// An axial vector of a contact's history, turned along with the contact.
    fn carry(carrier: &Self::Carrier, axial: Axial<Self>) -> Axial<Self>;

    /// Polar decomposition; `det(I + h) > 0` is the caller's duty. A symmetric `h` gives no rotation at all and returns
    /// itself, so that pure stretch suffers no rounding; a small strain behind a rotation keeps its digits.
    fn polar(h: &Self::Tensor) -> PolarParts<Self>;

    /// Matrix of a rotation.
    fn rotation_matrix(turn: Self::Turn) -> Self::Tensor;

    /// Rotation vector of a rotation, rad.
    fn rotation_vector(turn: Self::Turn) -> Self::Spin;

    /// A tangential force turned with everything else.
    fn turned_tangential(tangential: Self::Tangential, matrix: &Self::Tensor) -> Self::Tangential;

    /// A rotation or moment turned with everything else.
    fn turned_spin(spin: Self::Spin, matrix: &Self::Tensor) -> Self::Spin;

    /// A rotation or moment as the three components that travel in messages.
    fn spin_in_space(spin: Self::Spin) -> [f64; 3];
}
