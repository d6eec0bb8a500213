//! When a cell counts as being in equilibrium: three measures from the literature, by name.

use super::assembly::Assembly;
use super::kernel::ContactSums;
use super::motion::GrainSums;
use crate::definition::Criterion;
use crate::lanes::Tuple;
use crate::law::ContactLaw;
use crate::space::Space;

/// Steps in a row that the energy criterion must hold: the motion has no kinetic energy at a turning point either.
pub(crate) const ENERGY_HITS: u32 = 10;

/// Value of a criterion; 0 without contacts, because then nothing is out of balance.
pub(crate) fn unbalanced<S: Space, L: ContactLaw<S::Kinematics>>(
    criterion: Criterion,
    assembly: &Assembly<S, L>,
    contacts: &ContactSums,
    grains: &GrainSums,
) -> f64 {
    if contacts.contacts == 0 {
        return 0.0;
    }
    let count = f64::from(contacts.contacts);
    let (measure, scale) = match criterion {
        Criterion::MaxForce => (grains.largest_force, contacts.normal_force / count),
        Criterion::RmsForce => {
            let mean_square = grains.force_square / assembly.grains.len() as f64;
            (mean_square.sqrt(), (contact_force_square(assembly) / count).sqrt())
        }
        Criterion::Energy => (grains.kinetic_energy, elastic_energy(assembly)),
    };
    if measure == 0.0 { 0.0 } else { measure / scale.abs() }
}

fn contact_force_square<S: Space, L: ContactLaw<S::Kinematics>>(assembly: &Assembly<S, L>) -> f64 {
    assembly
        .contacts()
        .map(|(_, pair)| {
            let normal = assembly.normal_force(pair);
            normal * normal + pair.tangential_force.dot(pair.tangential_force)
        })
        .sum()
}

/// Stored energy of all contacts, J; zero where a contact opens.
pub(crate) fn elastic_energy<S: Space, L: ContactLaw<S::Kinematics>>(assembly: &Assembly<S, L>) -> f64 {
    assembly.contacts().map(|(_, pair)| assembly.energy(pair)).sum()
}
