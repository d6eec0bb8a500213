//! Operators that let the frozen network relax: shared by all choices of contact law.

use super::PlaneOperator;
use super::assembly;
use super::backbone::Backbone;
use super::contact_stiffness::ContactStiffness;
use super::network_solver;
use crate::network::{ContactNetwork, NetworkContact};

/// Stiffness, relative to the mean normal stiffness, that holds the mechanisms of a singular network.
const RELATIVE_SHIFT: f64 = 1e-8;

/// A solved network operator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NetworkOperator {
    /// `d sigma_ij / d F_kl`, Pa.
    pub operator: PlaneOperator,
    /// Whether mechanisms were held by a small stiffness of their own, or spins against load.
    pub regularised: bool,
}

/// Linearises `network` with the contact law that `law` gives each contact; `None` when no solution was found.
pub(super) fn solve(
    network: &ContactNetwork,
    law: impl Fn(&NetworkContact) -> ContactStiffness,
) -> Option<NetworkOperator> {
    let stiffness: Vec<ContactStiffness> = network.contacts.iter().map(law).collect();
    let backbone = Backbone::of(network, &stiffness);
    if backbone.contacts.is_empty() {
        return Some(NetworkOperator { operator: [[0.0; 4]; 4], regularised: false });
    }
    let typical = backbone.contacts.iter().map(|contact| stiffness[contact.index].normal).sum::<f64>()
        / backbone.contacts.len() as f64;
    let (mut matrix, mut loads) = assembly::assemble(network, &backbone, &stiffness);
    for (grain, pins) in backbone.pinned.iter().enumerate() {
        for (component, _) in pins.iter().enumerate().filter(|(_, pinned)| **pinned) {
            matrix.pin(grain, component, typical);
            loads[super::block_matrix::BLOCK * grain + component] = [0.0; assembly::DIRECTIONS];
        }
    }
    let mut regularised = backbone.spin_held_against_load;
    let solution = match network_solver::solve(&matrix, &loads, typical) {
        Some(solution) => solution,
        None => {
            regularised = true;
            matrix.shift_diagonal(RELATIVE_SHIFT * typical);
            network_solver::solve(&matrix, &loads, typical)?
        }
    };
    let operator = assembly::stress_rate(network, &backbone, &stiffness, &solution);
    Some(NetworkOperator { operator, regularised })
}
