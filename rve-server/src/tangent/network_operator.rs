//! Operators that let the frozen network relax: PSTLO, the prestressed truss-like operator of [Argilaga2018] eqs. 22-23
//! and appendix B, and its variants for sliding contacts.

use super::assembly::System;
use super::backbone::Backbone;
use super::iterative;
use super::link::LinkedGrains;
use super::network_solver;
use super::orderings::Orderings;
use super::sliding::{ContactStiffness, Sliding};
use super::strain::objective;
use protocol::Tensor4;

/// Stiffness, relative to the mean normal stiffness, that holds the mechanisms of a singular network.
const RELATIVE_SHIFT: f64 = 1e-8;

/// A solved network operator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct NetworkOperator {
    /// `d sigma_ij / d F_kl`, Pa.
    pub operator: Tensor4,
    /// Whether mechanisms were held by a small stiffness of their own, or spins against load.
    pub regularised: bool,
}

/// Most spheres that are solved for directly: the fill of a factor grows with the square of their number, and so does its
/// cost per sphere.
const MOST_DIRECT_SPHERES: usize = 150;

/// Linearises `network`: every grain finds its own translation and spin. `None` when no solution was found.
pub(super) fn solve<const D: usize, const B: usize, const P: usize>(
    orderings: &mut Orderings,
    network: &LinkedGrains<D>,
    sliding: Sliding,
) -> Option<NetworkOperator> {
    solve_within::<D, B, P>(orderings, network, sliding, if D == 2 { usize::MAX } else { MOST_DIRECT_SPHERES })
}

/// As [`solve`]; networks of more than `most_direct` load-carrying grains are solved by iteration.
pub(super) fn solve_within<const D: usize, const B: usize, const P: usize>(
    orderings: &mut Orderings,
    network: &LinkedGrains<D>,
    sliding: Sliding,
    most_direct: usize,
) -> Option<NetworkOperator> {
    let stiffness: Vec<ContactStiffness<D>> =
        network.links.iter().map(|link| ContactStiffness::of(link, sliding, network.friction)).collect();
    let backbone = Backbone::<D, B>::of(network, &stiffness);
    if backbone.contacts.is_empty() {
        return Some(NetworkOperator { operator: Tensor4::ZERO, regularised: false });
    }
    let typical = backbone.contacts.iter().map(|contact| stiffness[contact.index].normal).sum::<f64>()
        / backbone.contacts.len() as f64;
    let mut system = System::<D, B, P>::of(network, &backbone, &stiffness, typical);
    let mut regularised = backbone.spin_held_against_load;
    let iterate = backbone.radii.len() > most_direct;
    let mut answer = |system: &System<D, B, P>| {
        if iterate {
            iterative::solve(&system.matrix, &system.loads)
        } else {
            network_solver::solve(orderings, &system.matrix, &system.loads, typical, sliding.is_symmetric())
        }
    };
    let answers = match answer(&system) {
        Some(answers) => answers,
        None => {
            regularised = true;
            system.matrix.shift_diagonal(RELATIVE_SHIFT * typical);
            answer(&system)?
        }
    };
    let rate = system.stress_rate(&answers).map(|row| row.map(|value| value / network.volume));
    Some(NetworkOperator { operator: objective(&rate, &network.stress()), regularised })
}
