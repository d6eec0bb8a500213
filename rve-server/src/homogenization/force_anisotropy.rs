//! Anisotropies of contacts and contact forces ([Rothenburg1989], in tensors).
//!
//! With the fabric `Phi = 1/C sum n x n` and its deviator, the density of contact normals is `1 + n . A_c n` over that of equal
//! distribution, `A_c = 4 dev Phi` in the plane and `15/2 dev Phi` in space. Normal and tangential forces are averaged over
//! directions, each contact weighted with the inverse of that density:
//!
//! ```text
//! X_n = 1/C sum f_n n x n / (1 + n . A_c n)      f_0 = tr X_n      A_n = k dev X_n / f_0       k = 4, in space 15/2
//! X_t = 1/C sum sym(f_t x n) / (1 + n . A_c n)                     A_t = k_t dev X_t / f_0     k_t = 4, in space 5
//! ```
//!
//! Where contacts lie so unevenly that this density is not positive in the direction of one of them, `a_n` and `a_t` are NaN. The size of a tensor `A` is `sqrt(A:A / 2)` in the plane and `sqrt(3/2 A:A)` in space. With three coaxial tensors the stress ratio of discs is
//! `(s1 - s2) / (s1 + s2) = (a_c + a_n + a_t) / (2 + a_c a_n)`.

use crate::cell::ContactNetwork;
use crate::space::{Components, Space, Tensor, add_scaled, scaled};

/// Anisotropies of a cell, dimensionless; negative where they lie across the largest compression.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ForceAnisotropy {
    /// Of the contact normals, `a_c`.
    pub contacts: f64,
    /// Of the normal forces, `a_n`.
    pub normal: f64,
    /// Of the tangential forces, `a_t`.
    pub tangential: f64,
}

/// A contact as these measures see it.
#[derive(Clone, Copy, Debug)]
struct ContactForce<S: Space> {
    normal: S::Vector,
    /// Compression, N.
    compression: f64,
    /// Tangential force of the same sign convention, N.
    tangential: S::Vector,
}

impl<S: Space> ContactNetwork<S> {
    /// Anisotropies of contacts and forces; zero without contacts or without load.
    pub fn force_anisotropy(&self) -> ForceAnisotropy {
        let contacts: Vec<ContactForce<S>> = self
            .contacts
            .iter()
            .map(|contact| {
                let branch = self.branch(contact);
                let normal = branch.times(1.0 / branch.norm());
                let tangential = S::contact_force(normal, 0.0, contact.tangential_force).times(-1.0);
                ContactForce { normal, compression: -contact.normal_force, tangential }
            })
            .collect();
        let compression = scaled(&self.stress(), -1.0);
        of_contacts(&contacts, &compression)
    }
}

/// The anisotropies of contacts that carry this stress, compression positive.
fn of_contacts<S: Space>(contacts: &[ContactForce<S>], compression: &S::Tensor) -> ForceAnisotropy {
    if contacts.is_empty() {
        return ForceAnisotropy::default();
    }
    let (factor, shear_factor) = if S::DIMENSION == 2 { (4.0, 4.0) } else { (7.5, 5.0) };
    let count = contacts.len() as f64;
    let sum = |part: &dyn Fn(&ContactForce<S>) -> S::Tensor| {
        let total = contacts.iter().fold(S::Tensor::ZERO, |total, contact| add_scaled(&total, 1.0, &part(contact)));
        scaled(&total, 1.0 / count)
    };
    let density = scaled(&deviator(&sum(&|contact| outer::<S>(contact.normal, contact.normal))), factor);
    let weight = |contact: &ContactForce<S>| {
        let n = contact.normal;
        1.0 / (1.0 + product_of(&density, &outer::<S>(n, n)))
    };
    let is_positive = contacts.iter().all(|contact| weight(contact) > 0.0);
    let normal =
        sum(&|contact| scaled(&outer::<S>(contact.normal, contact.normal), contact.compression * weight(contact)));
    let tangential = sum(&|contact| scaled(&outer::<S>(contact.tangential, contact.normal), weight(contact)));
    let mean = (0..S::DIMENSION).map(|axis| normal[axis][axis]).sum::<f64>();
    let direction = deviator(compression);
    let size = |tensor: &S::Tensor| {
        let scale: f64 = if S::DIMENSION == 2 { 0.5 } else { 1.5 };
        let size = (scale * product_of(tensor, tensor)).sqrt();
        if product_of(tensor, &direction) < 0.0 { -size } else { size }
    };
    let of_force = |tensor: &S::Tensor, factor: f64| match (is_positive, mean > 0.0) {
        (false, _) => f64::NAN,
        // Without load there is no mean force to compare with.
        (true, false) => 0.0,
        (true, true) => size(&scaled(&deviator(tensor), factor / mean)),
    };
    ForceAnisotropy {
        contacts: size(&density),
        normal: of_force(&normal, factor),
        tangential: of_force(&tangential, shear_factor),
    }
}

fn outer<S: Space>(a: S::Vector, b: S::Vector) -> S::Tensor {
    S::Tensor::from_fn(|i, j| a[i] * b[j])
}

/// Deviator of the symmetric part.
fn deviator<T: Tensor>(a: &T) -> T {
    let mean = (0..T::DIMENSION).map(|axis| a[axis][axis]).sum::<f64>() / T::DIMENSION as f64;
    T::from_fn(|i, j| 0.5 * (a[i][j] + a[j][i]) - if i == j { mean } else { 0.0 })
}

/// Double product `A:B`.
fn product_of<T: Tensor>(a: &T, b: &T) -> f64 {
    a.components().zip(b.components()).map(|(one, other)| one * other).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::{Discs, Spheres};

    /// Normals with the density `1 + a_c cos 2(theta - theta_0)`, forces `f_n = f_0 (1 + a_n cos ..)`, `f_t = -f_0 a_t sin ..`: the
    /// quantiles of the density stand for the contacts.
    #[test]
    fn the_anisotropies_of_a_known_distribution_are_found() {
        let (a_c, a_n, a_t, axis): (f64, f64, f64, f64) = (0.3, 0.4, 0.1, 0.6);
        let number = 4000;
        let contacts: Vec<ContactForce<Discs>> = (0..number)
            .map(|number_of| {
                let share = std::f64::consts::TAU * (f64::from(number_of) + 0.5) / f64::from(number);
                // theta + a_c / 2 sin 2 theta = share.
                let mut theta = share;
                for _ in 0..60 {
                    theta -= (theta + 0.5 * a_c * (2.0 * theta).sin() - share) / (1.0 + a_c * (2.0 * theta).cos());
                }
                let (sin, cos) = (theta + axis).sin_cos();
                let shear = -7.0 * a_t * (2.0 * theta).sin();
                ContactForce {
                    normal: [cos, sin],
                    compression: 7.0 * (1.0 + a_n * (2.0 * theta).cos()),
                    tangential: [-sin * shear, cos * shear],
                }
            })
            .collect();
        let stress = |axis: f64| {
            let (sin, cos) = (2.0 * axis).sin_cos();
            [[1.0 + 0.2 * cos, 0.2 * sin], [0.2 * sin, 1.0 - 0.2 * cos]]
        };
        let found = of_contacts(&contacts, &stress(axis));
        for (found, expected) in [(found.contacts, a_c), (found.normal, a_n), (found.tangential, a_t)] {
            assert!((found - expected).abs() < 1e-5, "{found} {expected}");
        }
        let across = of_contacts(&contacts, &stress(axis + 0.5 * std::f64::consts::PI));
        assert_eq!((across.contacts, across.normal), (-found.contacts, -found.normal));
    }

    /// Spheres with contacts along the axes, two of four along z: `Phi = diag(1, 1, 2) / 4`, `A_c = 15/2 diag(-1, -1, 2) / 12`.
    #[test]
    fn spheres_with_contacts_along_the_axes_have_a_known_fabric() {
        let contact = |axis: usize| ContactForce::<Spheres> {
            normal: std::array::from_fn(|one| if one == axis { 1.0 } else { 0.0 }),
            compression: 1.0,
            tangential: [0.0; 3],
        };
        let contacts: Vec<_> = [0, 1, 2, 2].map(contact).to_vec();
        let stress = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 2.0]];
        let found = of_contacts(&contacts, &stress);
        assert!((found.contacts - 1.875).abs() < 1e-12, "{found:?}");
        assert_eq!((found.tangential, of_contacts::<Spheres>(&[], &stress)), (0.0, ForceAnisotropy::default()));
    }
}
