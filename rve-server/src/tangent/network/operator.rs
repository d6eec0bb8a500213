//! Operators that let the frozen network relax: PSTLO, the prestressed truss-like operator of [Argilaga2018] eqs. 22-23
//! and appendix B, and its variants for sliding contacts.

use super::aggregates::Bond;
use super::assembly::System;
use super::bearing::BearingNetwork;
use super::block_matrix::Columns;
use super::closeness::Closeness;
use super::orderings::Orderings;
use super::two_level::{Groups, Problem};
use super::{bicgstab, conjugate_gradients, solver};
use crate::simd::{Vectorised, dispatch};
use crate::tangent::link::LinkedGrains;
use crate::tangent::sliding::{ContactStiffness, Sliding};
use crate::tangent::strain::objective;
use protocol::Tensor4;

/// Stiffness, relative to the mean normal stiffness, that holds the mechanisms of a singular network.
const RELATIVE_SHIFT: f64 = 1e-8;

/// A solved network operator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::tangent) struct NetworkOperator {
    /// `d sigma_ij / d F_kl`, Pa.
    pub operator: Tensor4,
    /// Whether mechanisms were held by a small stiffness of their own, or spins against load.
    pub regularised: bool,
}

/// Most spheres that are solved for directly: the fill of a factor grows with the square of their number, and so does its
/// cost per sphere.
const MOST_DIRECT_SPHERES: usize = 150;

/// Cells of this dimension.
struct Cells<const D: usize>;

impl<const D: usize> Cells<D> {
    /// Whether large ones are solved by iteration. Factors of discs hardly fill up; the iterations are not compiled for them.
    const ITERATE: bool = D == 3;
}

/// Linearises `network`: every grain finds its own translation and spin. `None` when no solution was found.
pub(in crate::tangent) fn solve<const D: usize, const B: usize, const P: usize>(
    orderings: &mut Orderings,
    network: &LinkedGrains<D>,
    sliding: Sliding,
    closeness: Closeness,
) -> Option<NetworkOperator> {
    solve_within::<D, B, P>(orderings, network, sliding, closeness, MOST_DIRECT_SPHERES)
}

/// As [`solve`]; networks of more than `most_direct` load-carrying spheres are solved by iteration.
pub(in crate::tangent) fn solve_within<const D: usize, const B: usize, const P: usize>(
    orderings: &mut Orderings,
    network: &LinkedGrains<D>,
    sliding: Sliding,
    closeness: Closeness,
    most_direct: usize,
) -> Option<NetworkOperator> {
    let stiffness: Vec<ContactStiffness<D>> =
        network.links.iter().map(|link| ContactStiffness::of(link, sliding, network.friction)).collect();
    let bearing = BearingNetwork::<D, B>::of(network, &stiffness);
    if bearing.contacts.is_empty() {
        return Some(NetworkOperator { operator: Tensor4::ZERO, regularised: false });
    }
    let typical = bearing.contacts.iter().map(|contact| stiffness[contact.index].normal).sum::<f64>()
        / bearing.contacts.len() as f64;
    let mut system = dispatch(Assembly::<D, B, P> { network, bearing: &bearing, stiffness: &stiffness, typical });
    let mut regularised = bearing.spin_held_against_load;
    let iterate = Cells::<D>::ITERATE && bearing.radii.len() > most_direct;
    let mut answer = |system: &System<D, B, P>| {
        // The constant by itself keeps the iterations from being compiled.
        if Cells::<D>::ITERATE && iterate {
            return iterated(system, &bearing, network, typical, sliding, closeness);
        }
        let symmetric = sliding.is_symmetric();
        let answers = solver::solve(orderings, &system.matrix, &system.loads, typical, symmetric, closeness);
        answers.map(Answers::exact)
    };
    let answers = match answer(&system) {
        Some(answers) => answers,
        // Iterations do not mind free mechanisms, so that a shift would not help them.
        None if iterate => return None,
        None => {
            regularised = true;
            system.matrix.shift_diagonal(RELATIVE_SHIFT * typical);
            answer(&system)?
        }
    };
    let mut rate = system.stress_rate(&answers.columns);
    if let Some(residual) = &answers.residual {
        System::<D, B, P>::correct(&mut rate, &answers.columns, residual, &bearing.radii);
    }
    let rate = rate.map(|row| row.map(|value| value / network.volume));
    Some(NetworkOperator { operator: objective(&rate, &network.stress()), regularised })
}

/// The equations, put together.
struct Assembly<'a, const D: usize, const B: usize, const P: usize> {
    network: &'a LinkedGrains<D>,
    bearing: &'a BearingNetwork<D, B>,
    stiffness: &'a [ContactStiffness<D>],
    typical: f64,
}

impl<const D: usize, const B: usize, const P: usize> Vectorised for Assembly<'_, D, B, P> {
    type Output = System<D, B, P>;

    #[inline(always)]
    fn run(self) -> System<D, B, P> {
        System::of(self.network, self.bearing, self.stiffness, self.typical)
    }
}

/// Motions of the grains under the unit strains.
struct Answers<const B: usize, const P: usize> {
    columns: Vec<Columns<B, P>>,
    /// Residual of the loads, where the operator is to be corrected by it.
    residual: Option<Vec<Columns<B, P>>>,
}

impl<const B: usize, const P: usize> Answers<B, P> {
    fn exact(columns: Vec<Columns<B, P>>) -> Self {
        Self { columns, residual: None }
    }
}

/// Solves by iteration; where symmetry does not help, without it.
fn iterated<const D: usize, const B: usize, const P: usize>(
    system: &System<D, B, P>,
    bearing: &BearingNetwork<D, B>,
    network: &LinkedGrains<D>,
    typical: f64,
    sliding: Sliding,
    closeness: Closeness,
) -> Option<Answers<B, P>> {
    let bonds: Vec<Bond<D>> = bearing
        .contacts
        .iter()
        .map(|contact| Bond { grains: [contact.origin, contact.end], branch: network.links[contact.index].branch })
        .collect();
    let groups = Groups::of(&system.matrix, &bonds, &bearing.radii, &bearing.pinned);
    let problem = Problem { matrix: &system.matrix, loads: &system.loads, groups: &groups, typical };
    let symmetric = if sliding.is_symmetric() { conjugate_gradients::solve(problem, closeness) } else { None };
    match symmetric {
        Some([columns, residual]) => Some(Answers { columns, residual: Some(residual) }),
        None => bicgstab::solve(problem, closeness).map(Answers::exact),
    }
}
