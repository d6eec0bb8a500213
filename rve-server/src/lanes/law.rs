//! The seam between the force kernel and a contact law.

use super::kinematics::Kinematics;
use super::real::Real;
use super::tuple::Tuple;
use std::fmt::Debug;

/// The motion of one touching pair since the last evaluation, as a law sees it.
#[derive(Clone, Copy, Debug)]
pub struct ContactMotion<K: Kinematics, R: Real> {
    /// Sum of the radii minus the distance of the centres, m; positive.
    pub overlap: R,
    /// Distance of the centres, m.
    pub length: R,
    /// Whether the pair touched at the last evaluation. If not, it starts without any history.
    pub touched: R::Mask,
    /// Tangential force of the last evaluation, carried along with the contact, N; zero for a new contact.
    pub carried: K::Axial<R>,
    /// Slip of the end grain's surface against the origin grain's, m: `tau` grows by `k_t slip` where nothing slides.
    pub slip: K::Axial<R>,
    /// Spin of the origin minus that of the end grain, rad: what rolls and twists.
    pub rolling: K::Axial<R>,
}

/// Forces of one touching pair.
#[derive(Clone, Copy, Debug)]
pub struct ContactResponse<K: Kinematics, R: Real> {
    /// Normal force, N; negative in compression.
    pub normal_force: R,
    /// Tangential force as an axial vector, N.
    pub tangential_force: K::Axial<R>,
    /// Moment that the contact itself transmits onto the origin grain, N m; its opposite acts on the end grain.
    pub couple: Option<K::Axial<R>>,
    /// Where the contact is at its friction limit, see [`AT_LIMIT`].
    pub at_limit: R::Mask,
    /// Work lost to friction since the last evaluation, J.
    pub dissipation: R,
}

/// A contact counts as being at the Coulomb limit from this share of the limit on. The relaxation breathes a little, so
/// a contact that slides steadily is often a hair below the limit at the moment of evaluation.
pub const AT_LIMIT: f64 = 1.0 - 1e-3;

/// A contact law: forces of touching pairs from their motion.
///
/// Formulas are written over [`Real`] without branches on numbers; values of lanes that do not touch are computed and
/// thrown away. `constants` belong to the pair (stiffnesses from both radii), `memory` to the contact.
pub trait ContactLaw<K: Kinematics>: Copy + Debug + PartialEq + Send + Sync + 'static {
    /// Constants of one pair.
    type Constants<R: Real>: Tuple<R>;

    /// What a contact remembers beside its direction and tangential force; zero for a new contact.
    type Memory<R: Real>: Tuple<R>;

    /// What a contact of this overlap remembers if it has been there before: all that follows from its geometry.
    fn recalled(&self, constants: &Self::Constants<f64>, overlap: f64) -> Self::Memory<f64>;

    /// Constants of a pair of grains with these radii, m.
    fn constants(&self, radii: [f64; 2]) -> Self::Constants<f64>;

    /// Forces of a touching pair. `memory` is zero for a new contact.
    fn respond<R: Real>(
        &self,
        constants: &Self::Constants<R>,
        motion: &ContactMotion<K, R>,
        memory: &mut Self::Memory<R>,
    ) -> ContactResponse<K, R>;

    /// Normal and tangential stiffness, N/m, at this overlap.
    fn stiffness<R: Real>(&self, constants: &Self::Constants<R>, overlap: R) -> [R; 2];

    /// Stored energy, J, at this overlap and length of the tangential force; zero where a contact opens.
    fn energy<R: Real>(&self, constants: &Self::Constants<R>, overlap: R, tangential_force: R) -> R;

    /// Tangential energy that is lost when a contact opens before friction has let go of it, J.
    fn opening_loss<R: Real>(
        &self,
        constants: &Self::Constants<R>,
        tangential_force: K::Axial<R>,
        memory: &Self::Memory<R>,
    ) -> R;
}
