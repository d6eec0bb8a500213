//! When a cell counts as being in equilibrium: three measures from the literature, by name.

use super::assembly::Assembly;
use super::kernel::{ContactSums, LinearLaw};
use super::motion::GrainSums;
use crate::definition::Criterion;

/// Steps in a row that the energy criterion must hold: the motion has no kinetic energy at a turning point either.
pub(crate) const ENERGY_HITS: u32 = 10;

/// Value of a criterion; 0 without contacts, because then nothing is out of balance.
pub(crate) fn unbalanced(
    criterion: Criterion,
    law: &LinearLaw,
    assembly: &Assembly,
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
            (mean_square.sqrt(), (contact_force_square(law, assembly) / count).sqrt())
        }
        Criterion::Energy => (grains.kinetic_energy, elastic_energy(law, assembly)),
    };
    if measure == 0.0 { 0.0 } else { measure / scale.abs() }
}

fn contact_force_square(law: &LinearLaw, assembly: &Assembly) -> f64 {
    assembly
        .contacts()
        .map(|(_, pair)| {
            let normal = assembly.normal_force(law, pair);
            normal * normal + pair.tangential_force * pair.tangential_force
        })
        .sum()
}

/// Stored energy of all contacts, J: `((f_n)^2 - (k_n C)^2) / 2 k_n + f_t^2 / 2 k_t`, which is zero where a contact opens.
pub(crate) fn elastic_energy(law: &LinearLaw, assembly: &Assembly) -> f64 {
    assembly
        .contacts()
        .map(|(_, pair)| {
            let stiffness = pair.normal_stiffness;
            let normal = assembly.normal_force(law, pair);
            let adhesion = stiffness * law.cohesion;
            let stored = 0.5 * (normal * normal - adhesion * adhesion) / stiffness;
            if pair.tangential_force == 0.0 {
                return stored;
            }
            let force = pair.tangential_force;
            stored + 0.5 * force * force / (law.stiffness_ratio * stiffness)
        })
        .sum()
}
