//! The seam between a force kernel and a contact law.

use crate::simd::{Real, Tuple};
use crate::space::KernelSpace;
use std::fmt::Debug;

/// The motion of one touching pair since the last evaluation, as a law sees it.
#[derive(Clone, Copy, Debug)]
pub struct ContactMotion<K: KernelSpace, R: Real> {
    /// Sum of the radii minus the distance of the centres, m; positive.
    pub overlap: R,
    /// Whether the pair touched at the last evaluation. If not, it starts without any history.
    pub touched: R::Mask,
    /// Tangential force of the last evaluation, carried along with the contact, N; zero for a new contact.
    pub carried: K::Axial<R>,
    /// Slip of the end grain's surface against the origin grain's, m: `tau` grows by `k_t slip` where nothing slides.
    pub slip: K::Axial<R>,
    /// Spin of the origin minus that of the end grain without its part along the normal, rad: what rolls.
    pub rolling: K::Axial<R>,
}

/// Forces that act but are no part of a contact's history, its limits or the stress: they vanish with the motion.
#[derive(Clone, Copy, Debug)]
pub struct Viscous<K: KernelSpace, R: Real> {
    /// Added to the normal force on the grains, N.
    pub normal_force: R,
    /// Added to the tangential force on the grains, N.
    pub tangential_force: K::Axial<R>,
}

/// Forces of one touching pair.
#[derive(Clone, Copy, Debug)]
pub struct ContactResponse<K: KernelSpace, R: Real> {
    /// Normal force, N; negative in compression.
    pub normal_force: R,
    /// Tangential force as an axial vector, N.
    pub tangential_force: K::Axial<R>,
    /// Viscous forces, of laws that have any.
    pub viscous: Option<Viscous<K, R>>,
    /// Moment that the contact itself transmits onto the origin grain, N m; its opposite acts on the end grain.
    pub couple: Option<K::Axial<R>>,
    /// Where the contact is at its friction limit, see [`AT_LIMIT`].
    pub at_limit: R::Mask,
    /// Energy lost since the last evaluation, J: to friction, to a tangential stiffness that changed, and to viscous forces.
    pub dissipation: R,
}

/// A contact counts as being at the Coulomb limit from this share of the limit on. The relaxation breathes a little, so
/// a contact that slides steadily is often a hair below the limit at the moment of evaluation.
pub const AT_LIMIT: f64 = 1.0 - 1e-3;

/// A contact law: forces of touching pairs from their motion.
///
/// Values of lanes that do not touch are computed and thrown away. `constants` belong to the pair (stiffnesses from both
/// radii), `memory` to the contact: it is zero for a new contact, and [`resumed`](Self::resumed) rebuilds it from a
/// stored state.
pub trait ContactLaw<K: KernelSpace>: Copy + Debug + PartialEq + Send + Sync + 'static {
    /// Constants of one pair.
    type Constants<R: Real>: Tuple<R>;

    /// History of a contact besides its direction and tangential force; zero for a new contact.
    type Memory<R: Real>: Tuple<R>;

    /// Whether contacts transmit moments, so that states must hold them.
    const ROLLS: bool;

    /// The same law with another Coulomb coefficient.
    fn with_friction(self, friction: f64) -> Self;

    /// Constants of a pair of grains with these radii, m.
    fn constants(&self, radii: [f64; 2]) -> Self::Constants<f64>;

    /// Constants of a grain of this radius, m, on a rigid plane of the grains' material. The arm of rolling is the grain's own
    /// radius. A smooth plane (friction 0) bears no moment either.
    fn wall_constants(&self, radius: f64) -> Self::Constants<f64>;

    /// The same constants with friction and rolling limits `factor` times as large: a dashpot presses too.
    fn limits_scaled<R: Real>(&self, constants: &Self::Constants<R>, factor: R) -> Self::Constants<R>;

    /// Memory of a contact that is taken from a state: its overlap, m, and rolling moment on the origin grain, N m.
    fn resumed(&self, overlap: f64, rolling_moment: K::Axial<f64>) -> Self::Memory<f64>;

    /// Rolling moment on the origin grain, N m; zero for laws without.
    fn rolling_moment(&self, memory: &Self::Memory<f64>) -> K::Axial<f64>;

    /// Carries what the memory holds in the contact's frame along with its turn: `carry` is applied to the rolling moment.
    fn carry<R: Real>(&self, memory: &mut Self::Memory<R>, carry: impl Fn(K::Axial<R>) -> K::Axial<R>);

    /// Forces of a touching pair. `memory` is zero for a new contact, and has been carried along otherwise.
    fn respond<R: Real>(
        &self,
        constants: &Self::Constants<R>,
        motion: &ContactMotion<K, R>,
        memory: &mut Self::Memory<R>,
    ) -> ContactResponse<K, R>;

    /// Normal force, N, negative in compression, at this overlap.
    fn normal_force<R: Real>(&self, constants: &Self::Constants<R>, overlap: R) -> R;

    /// Normal, tangential and rolling stiffness, N/m and N m, at this overlap.
    fn stiffness<R: Real>(&self, constants: &Self::Constants<R>, overlap: R) -> [R; 3];

    /// Largest tangential force, N, at this overlap.
    fn friction_limit<R: Real>(&self, constants: &Self::Constants<R>, overlap: R) -> R;

    /// Largest rolling moment, N m, at this overlap.
    fn rolling_limit<R: Real>(&self, constants: &Self::Constants<R>, overlap: R) -> R;

    /// Stored energy, J, at this overlap, length of the tangential force and rolling moment; zero where a contact opens.
    fn energy<R: Real>(
        &self,
        constants: &Self::Constants<R>,
        overlap: R,
        tangential_force: R,
        memory: &Self::Memory<R>,
    ) -> R;

    /// Tangential and rolling energy that is lost when a contact opens before friction has let go of it, J. The
    /// tangential force belongs to the overlap of the last evaluation, of which `memory` holds what matters.
    fn opening_loss<R: Real>(
        &self,
        constants: &Self::Constants<R>,
        tangential_force: K::Axial<R>,
        memory: &Self::Memory<R>,
    ) -> R;

    /// By how much contact viscosity shortens the stable pseudo-time step: the factor by which masses must grow.
    fn mass_factor(&self) -> f64;
}
