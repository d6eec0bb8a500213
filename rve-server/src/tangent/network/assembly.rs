//! The linear system of a frozen network and the stress that follows from its solution.
//!
//! Unknowns are periodic fluctuations of the grain centres round the mean strain and grain spins, each spin times the
//! grain's radius. The equations say that the forces and moments on every grain stay balanced to first order, geometric
//! changes included; this is appendix B of [Argilaga2018] with the mean field moved to the right-hand side. Only strains
//! are solved for: what a superposed rotation does is known exactly.

use super::bearing::BearingNetwork;
use super::block_matrix::{BlockMatrix, Columns, Place, add};
use super::response::Response;
use crate::tangent::link::LinkedGrains;
use crate::tangent::sliding::ContactStiffness;
use crate::tangent::strain::{PAIRS, pair};

/// The equations of one network.
#[derive(Clone, Debug)]
pub(super) struct System<const D: usize, const B: usize, const P: usize> {
    /// Balance of forces and moments of each kept grain.
    pub matrix: BlockMatrix<B>,
    /// Right-hand sides of the unit strains; the other columns are zero.
    pub loads: Vec<Columns<B, P>>,
    /// Contribution of each unknown to component `D i + j` of `sum_c df x b`.
    shares: Vec<[[f64; PAIRS]; B]>,
    /// The same sum for the uniform strains.
    uniform: [[f64; B]; PAIRS],
    /// `sum_c f x b` of the kept contacts.
    force_branch: [[f64; D]; D],
}

impl<const D: usize, const B: usize, const P: usize> System<D, B, P> {
    /// Assembles the equations of the load-bearing network; pinned unknowns are zero.
    #[inline(always)]
    pub(super) fn of(
        network: &LinkedGrains<D>,
        bearing: &BearingNetwork<D, B>,
        stiffness: &[ContactStiffness<D>],
        typical: f64,
    ) -> Self {
        let ends: Vec<[usize; 2]> = bearing.contacts.iter().map(|contact| [contact.origin, contact.end]).collect();
        let (matrix, places) = BlockMatrix::with_pattern(bearing.radii.len(), &ends);
        let mut system = Self {
            matrix,
            loads: vec![[[0.0; P]; B]; bearing.radii.len()],
            shares: vec![[[0.0; PAIRS]; B]; bearing.radii.len()],
            uniform: [[0.0; B]; PAIRS],
            force_branch: [[0.0; D]; D],
        };
        for ((contact, ends), place) in bearing.contacts.iter().zip(&ends).zip(places) {
            let link = &network.links[contact.index];
            let radii = ends.map(|grain| bearing.radii[grain]);
            let response = Response::<D, B>::of(link, &stiffness[contact.index], radii);
            system.add_blocks(&response, ends, place);
            for side in 0..2 {
                let load = response.load(side, &link.branch);
                for (target, values) in system.loads[ends[side]].iter_mut().zip(&load) {
                    for (target, value) in target.iter_mut().zip(values) {
                        *target += value;
                    }
                }
                add(&mut system.shares[ends[side]], &response.stress_share(side, &link.branch));
            }
            add(&mut system.uniform, &response.uniform(&link.branch));
            let force = link.force();
            for (i, row) in system.force_branch.iter_mut().enumerate() {
                for (j, value) in row.iter_mut().enumerate() {
                    *value += force[i] * link.branch[j];
                }
            }
        }
        for (grain, line) in &bearing.struts {
            for (i, row) in system.matrix.diagonal[*grain][D..].iter_mut().enumerate() {
                for (j, value) in row[D..].iter_mut().enumerate() {
                    *value += typical * line[i] * line[j];
                }
            }
        }
        system.matrix.pin(&bearing.pinned, typical);
        for (load, pins) in system.loads.iter_mut().zip(&bearing.pinned) {
            for (row, _) in load.iter_mut().zip(pins).filter(|(_, pinned)| **pinned) {
                *row = [0.0; P];
            }
        }
        system
    }

    #[inline(always)]
    fn add_blocks(&mut self, response: &Response<D, B>, ends: &[usize; 2], place: Place) {
        add(&mut self.matrix.diagonal[ends[0]], &response.block(0, 0));
        add(&mut self.matrix.diagonal[ends[1]], &response.block(1, 1));
        self.matrix.add_link(ends[0], place, &response.block(0, 1), &response.block(1, 0));
    }

    /// Change of the stress with each unit strain, `[D i + j][strain]`, times the volume: [Argilaga2018] eq. 23 at `F =
    /// I`, with `sum_c df x b`, which equals the sum over the cell's border once the grains are balanced.
    pub(super) fn stress_rate(&self, answers: &[Columns<B, P>]) -> [[f64; B]; PAIRS] {
        let mut rate = self.uniform;
        for (share, answer) in self.shares.iter().zip(answers) {
            for (weights, values) in share.iter().zip(answer) {
                for (row, weight) in rate.iter_mut().take(D * D).zip(weights) {
                    for (value, amount) in row.iter_mut().zip(values) {
                        *value += weight * amount;
                    }
                }
            }
        }
        for (row, values) in rate.iter_mut().take(D * D).enumerate() {
            for (column, value) in values.iter_mut().enumerate() {
                *value += self.area_and_volume([row / D, row % D], pair::<D>(column));
            }
        }
        rate
    }

    /// Corrects the stress rate of answers that leave `residual` of the loads; `radii` are those of the grains.
    ///
    /// Without prestress the balance equations are symmetric and the stress of a motion is minus the work of its loads, so that
    /// the answers themselves weigh what is left: an error of theirs then enters the symmetric part with its square. The
    /// moments that are left are the whole error of the other part. Prestress leaves its ratio to the stiffness of both.
    pub(super) fn correct(
        rate: &mut [[f64; B]; PAIRS],
        answers: &[Columns<B, P>],
        residual: &[Columns<B, P>],
        radii: &[f64],
    ) {
        let mut works = [[0.0; B]; B];
        for (answer, left) in answers.iter().flatten().zip(residual.iter().flatten()) {
            for (works, weight) in works.iter_mut().zip(answer) {
                for (work, left) in works.iter_mut().zip(left) {
                    *work += weight * left;
                }
            }
        }
        for (strain, works) in works.iter().enumerate() {
            let [i, j] = pair::<D>(strain);
            for strain in 0..B {
                rate[D * i + j][strain] -= works[strain];
                if i != j {
                    rate[D * j + i][strain] -= works[strain];
                }
            }
        }
        for spin in 0..B - D {
            let [i, j] = if D == 2 { [0, 1] } else { [(spin + 1) % 3, (spin + 2) % 3] };
            for strain in 0..B {
                let moment: f64 =
                    residual.iter().zip(radii).map(|(left, radius)| radius * left[D + spin][strain]).sum();
                rate[D * i + j][strain] += 0.5 * moment;
                rate[D * j + i][strain] -= 0.5 * moment;
            }
        }
    }

    /// `sigma E - tr(E) sigma`, times the volume, for the unit strain `E` of the pair `kl`.
    fn area_and_volume(&self, [i, j]: [usize; 2], [k, l]: [usize; 2]) -> f64 {
        let half = |m: usize, n: usize| if n == j { 0.5 * self.force_branch[i][m] } else { 0.0 };
        let volume = if k == l { self.force_branch[i][j] } else { 0.0 };
        half(k, l) + half(l, k) - volume
    }
}
