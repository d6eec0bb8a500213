//! How the grains of a plane cell move: under the unit strains, and under the forces that are out of balance.
//!
//! Unlike a tangent operator, which needs the load-bearing grains alone, the motion of every grain is asked for. Loose
//! grains are held by a small stiffness, the same for all grains: more of it on a few of them would push the whole assembly
//! aside.

use super::block_matrix::{BlockMatrix, Columns, add};
use super::elimination::Elimination;
use super::factors::Factors;
use super::orderings::Orderings;
use super::response::Response;
use crate::simd::{Vectorised, dispatch};
use crate::solver::{DiscMotions, DiscPair, LinearResponses};
use crate::tangent::link::Link;
use crate::tangent::sliding::{ContactStiffness, Sliding, SlidingSet};

/// Stiffness that holds every unknown, relative to that of the contacts.
const RELATIVE_SHIFT: f64 = 1e-6;

/// Corrections of an answer by the matrix itself: prestress is left out of the cheap factors, and sliding makes the others
/// less accurate than exchanges of rows would.
const CORRECTIONS: usize = 1;

/// Unknowns of a disc: two displacements and its spin times its radius.
const UNKNOWNS: usize = 3;

/// Right-hand sides: the strains 11, 22 and 12 (with 1/2 at both places), and the forces out of balance.
const SIDES: usize = 4;

/// The responses by the equations of the network operators.
#[derive(Debug, Default)]
pub struct NetworkResponses {
    orderings: Orderings,
}

impl LinearResponses for NetworkResponses {
    fn motions(
        &mut self,
        radii: &[f64],
        friction: f64,
        rotations_free: bool,
        pairs: &[DiscPair],
        loads: &[[f64; UNKNOWNS]],
    ) -> Option<DiscMotions> {
        if !pairs.iter().any(|pair| pair.touches) {
            return None;
        }
        let (matrix, columns) = assembled(radii, friction, rotations_free, pairs, loads);
        let elimination = self.orderings.of(matrix.grains(), &matrix.pairs)?;
        let symmetric = !pairs.iter().any(|pair| pair.slides);
        let work = Motions { matrix: &matrix, columns: &columns, elimination: &elimination, symmetric };
        let motions = dispatch(work);
        motions.iter().flatten().flatten().all(|value| value.is_finite()).then_some(motions)
    }

    fn new_instance(&self) -> Box<dyn LinearResponses> {
        Box::new(Self::default())
    }
}

fn assembled(
    radii: &[f64],
    friction: f64,
    rotations_free: bool,
    pairs: &[DiscPair],
    loads: &[[f64; UNKNOWNS]],
) -> (BlockMatrix<UNKNOWNS>, Vec<Columns<UNKNOWNS, SIDES>>) {
    let ends: Vec<[usize; 2]> = pairs.iter().map(|pair| [pair.origin, pair.end]).collect();
    let (mut matrix, places) = BlockMatrix::with_pattern(radii.len(), &ends);
    let mut columns: Vec<Columns<UNKNOWNS, SIDES>> =
        loads.iter().map(|load| load.map(|value| [0.0, 0.0, 0.0, value])).collect();
    let (mut sum, mut contacts) = (0.0, 0.0);
    for ((contact, ends), place) in pairs.iter().zip(&ends).zip(places).filter(|((pair, _), _)| pair.touches) {
        sum += contact.stiffness[0];
        contacts += 1.0;
        let radii = ends.map(|grain| radii[grain]);
        let link = link(contact, radii);
        let stiffness = ContactStiffness::of(&link, Sliding::Slips(SlidingSet::AtRest), friction);
        let response = Response::<2, UNKNOWNS>::of(&link, &stiffness, radii);
        add(&mut matrix.diagonal[ends[0]], &response.block(0, 0));
        add(&mut matrix.diagonal[ends[1]], &response.block(1, 1));
        matrix.add_link(ends[0], place, &response.block(0, 1), &response.block(1, 0));
        for side in 0..2 {
            let load = response.load(side, &link.branch);
            for (target, values) in columns[ends[side]].iter_mut().zip(&load) {
                for (target, value) in target.iter_mut().zip(values) {
                    *target += value;
                }
            }
        }
    }
    let typical = sum / contacts;
    matrix.shift_diagonal(RELATIVE_SHIFT * typical);
    if !rotations_free {
        matrix.pin(&vec![[false, false, true]; radii.len()], typical);
        columns.iter_mut().for_each(|rows| rows[2] = [0.0; SIDES]);
    }
    (matrix, columns)
}

/// The contact as the operators see it.
fn link(contact: &DiscPair, radii: [f64; 2]) -> Link<2> {
    let DiscPair { branch, length, .. } = *contact;
    let normal = branch.map(|component| component / length);
    let half_difference = 0.5 * (radii[0] - radii[1]);
    Link {
        origin: contact.origin,
        end: contact.end,
        shift: [0; 2],
        branch,
        length,
        normal,
        arms: [0.5 * length + half_difference, 0.5 * length - half_difference],
        normal_stiffness: contact.stiffness[0],
        tangential_stiffness: contact.stiffness[1],
        rolling_stiffness: 0.0,
        normal_force: contact.normal_force,
        tangential_force: [-normal[1] * contact.tangential_force, normal[0] * contact.tangential_force],
        slid: contact.slides,
        at_limit: contact.slides,
    }
}

/// Factorisation and solution.
struct Motions<'a> {
    matrix: &'a BlockMatrix<UNKNOWNS>,
    columns: &'a [Columns<UNKNOWNS, SIDES>],
    elimination: &'a Elimination,
    symmetric: bool,
}

impl Vectorised for Motions<'_> {
    type Output = DiscMotions;

    #[inline(always)]
    fn run(self) -> DiscMotions {
        if self.symmetric { self.solved::<true>() } else { self.solved::<false>() }
    }
}

impl Motions<'_> {
    #[inline(always)]
    fn solved<const SYMMETRIC: bool>(&self) -> DiscMotions {
        let factors = Factors::<UNKNOWNS, SIDES, SYMMETRIC>::of(self.matrix, self.elimination);
        let mut motions = factors.solve(self.columns);
        for _ in 0..CORRECTIONS {
            let residual = self.matrix.residual(self.columns, &motions);
            for (motion, change) in motions.iter_mut().flatten().zip(factors.solve(&residual).iter().flatten()) {
                for side in 0..SIDES {
                    motion[side] += change[side];
                }
            }
        }
        motions
    }
}
