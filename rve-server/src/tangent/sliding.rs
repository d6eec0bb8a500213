//! Which contacts slide, and what that leaves of their tangential stiffness.

use super::link::{Link, dot};

/// Where the set of sliding contacts is taken from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SlidingSet {
    /// The contacts that slid during the ramp of the evaluation.
    OfRamp,
    /// The contacts at the Coulomb limit in the relaxed state. The last relaxation steps unload the cone, so this set
    /// is nearly empty after a tight relaxation.
    AtRest,
}

/// Incremental behaviour of a sliding contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sliding {
    /// It sticks like all others.
    Sticks,
    /// It has no stiffness along its slip.
    Released(SlidingSet),
    /// As released, and its tangential force follows the cone while the normal force changes.
    Slips(SlidingSet),
}

impl Sliding {
    /// Whether the operator is symmetric but for the prestress.
    pub(super) fn is_symmetric(self) -> bool {
        !matches!(self, Self::Slips(_))
    }

    fn applies_to<const D: usize>(self, link: &Link<D>) -> bool {
        match self {
            Self::Sticks => false,
            Self::Released(set) | Self::Slips(set) => match set {
                SlidingSet::OfRamp => link.slid,
                SlidingSet::AtRest => link.at_limit,
            },
        }
    }
}

/// Incremental law of one contact: `d f = (k_n e + c) (e . d) + T d` for a relative displacement `d` of the two grains at
/// the contact point, before the contact's own turning is added.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ContactStiffness<const D: usize> {
    /// `k_n`, N/m.
    pub normal: f64,
    /// `T`: symmetric, acts in the tangent plane, N/m.
    pub tangential: [[f64; D]; D],
    /// `c`: tangential force per change of length, because the cone narrows as the contact unloads, N/m.
    pub coupling: [f64; D],
}

impl<const D: usize> ContactStiffness<D> {
    /// The law of `link` under `sliding`.
    ///
    /// A sliding contact keeps `|f_t| = friction (c - f_n)` with constant cohesive force c; slip changes no normal
    /// distance (non-associated). In three dimensions slip has one direction, that of the force, and the other keeps
    /// `k_t`: the rate of the force is `k_t` times what slip leaves over.
    pub(super) fn of(link: &Link<D>, sliding: Sliding, friction: f64) -> Self {
        let mut tangential: [[f64; D]; D] = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let unit = if i == j { 1.0 } else { 0.0 };
                link.tangential_stiffness * (unit - link.normal[i] * link.normal[j])
            })
        });
        let mut coupling = [0.0; D];
        if sliding.applies_to(link) {
            let force = dot(&link.tangential_force, &link.tangential_force).sqrt();
            if force > 0.0 && D == 3 {
                let direction = link.tangential_force.map(|component| component / force);
                for (row, along) in tangential.iter_mut().zip(direction) {
                    for (value, other) in row.iter_mut().zip(direction) {
                        *value -= link.tangential_stiffness * along * other;
                    }
                }
            } else {
                tangential = [[0.0; D]; D];
            }
            if force > 0.0 && matches!(sliding, Sliding::Slips(_)) {
                let slope = -friction * link.normal_stiffness / force;
                coupling = link.tangential_force.map(|component| slope * component);
            }
        }
        Self { normal: link.normal_stiffness, tangential, coupling }
    }

    /// Whether the contact resists tangential motion at all.
    pub(super) fn resists_slip(&self) -> bool {
        self.tangential.iter().flatten().any(|value| *value != 0.0)
    }
}
