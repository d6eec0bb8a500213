//! Groups of neighbouring grains and the ways in which each can move as one rigid body.
//!
//! The balance of a large network converges slowly, because it is soft for motions that are smooth on the
//! scale of the cell. Groups that move rigidly can follow them, and there are few groups.

use super::block_matrix::{Block, BlockMatrix, add};
use crate::tangent::link::{dot, turned};
use std::collections::VecDeque;

/// Two grains that touch, and the vector from the first to the second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bond<const D: usize> {
    /// The grains.
    pub grains: [usize; 2],
    /// From the first to the second, m.
    pub branch: [f64; D],
}

/// Groups of grains.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Aggregates<const B: usize> {
    /// Group of each grain.
    pub group_of: Vec<usize>,
    /// Number of groups.
    pub count: usize,
    /// Each grain's unknowns under each rigid motion of its group, `[unknown][motion]`: displacements, then spins, these
    /// divided by the size of the group so that all motions are of one length.
    pub motions: Vec<Block<B>>,
}

impl<const B: usize> Aggregates<B> {
    /// Gathers linked grains into groups of up to `size`, breadth first; `radii` turn spins into lengths, and what is `pinned`
    /// stays where it is.
    pub(super) fn of<const D: usize>(bonds: &[Bond<D>], radii: &[f64], pinned: &[[bool; B]], size: usize) -> Self {
        let mut gathering = Gathering::new(bonds, radii.len());
        gathering.gather(size);
        gathering.merge_small(size / 3);
        let count = gathering.number_anew();
        let arms = gathering.arms(count);
        let mut squares = vec![[0.0; 2]; count];
        for ((group, arm), radius) in gathering.group_of.iter().zip(&arms).zip(radii) {
            squares[*group][0] += dot(arm, arm) + radius * radius;
            squares[*group][1] += 1.0;
        }
        let grains = gathering.group_of.iter().zip(&arms).zip(radii).zip(pinned);
        let motions = grains.map(|(((group, arm), radius), pinned)| {
            let per_size = (squares[*group][1] / squares[*group][0]).sqrt();
            let mut motions = rigid_motions::<D, B>(arm, *radius, per_size);
            for (row, _) in motions.iter_mut().zip(pinned).filter(|(_, pinned)| **pinned) {
                *row = [0.0; B];
            }
            motions
        });
        Self { motions: motions.collect(), count, group_of: gathering.group_of }
    }

    /// The matrix that the groups' rigid motions see.
    #[inline(always)]
    pub(super) fn projected(&self, matrix: &BlockMatrix<B>) -> BlockMatrix<B> {
        let ends: Vec<[usize; 2]> = matrix.pairs.iter().map(|pair| pair.map(|grain| self.group_of[grain])).collect();
        let (mut coarse, places) = BlockMatrix::with_pattern(self.count, &ends);
        for (grain, block) in matrix.diagonal.iter().enumerate() {
            add(&mut coarse.diagonal[self.group_of[grain]], &self.sandwiched(block, grain, grain));
        }
        let blocks = matrix.pairs.iter().zip(&matrix.upper).zip(&matrix.lower);
        for (((&[first, second], upper), lower), place) in blocks.zip(places) {
            let across = self.sandwiched(upper, first, second);
            let back = self.sandwiched(lower, second, first);
            coarse.add_link(self.group_of[first], place, &across, &back);
        }
        coarse
    }

    /// `Z_row^T block Z_column` with the motions `Z` of two grains.
    #[inline(always)]
    fn sandwiched(&self, block: &Block<B>, row: usize, column: usize) -> Block<B> {
        let (left, right) = (&self.motions[row], &self.motions[column]);
        let mut moved = [[0.0; B]; B];
        for unknown in 0..B {
            for other in 0..B {
                for motion in 0..B {
                    moved[unknown][motion] =
                        block[unknown][other].mul_add(right[other][motion], moved[unknown][motion]);
                }
            }
        }
        let mut result = [[0.0; B]; B];
        for unknown in 0..B {
            for motion in 0..B {
                for other in 0..B {
                    result[motion][other] =
                        left[unknown][motion].mul_add(moved[unknown][other], result[motion][other]);
                }
            }
        }
        result
    }
}

fn rigid_motions<const D: usize, const B: usize>(arm: &[f64; D], radius: f64, per_size: f64) -> Block<B> {
    let mut motions = [[0.0; B]; B];
    for (axis, row) in motions.iter_mut().enumerate().take(D) {
        row[axis] = 1.0;
    }
    for spin in 0..B - D {
        for (axis, velocity) in turned(spin, arm).into_iter().enumerate() {
            motions[axis][D + spin] = velocity * per_size;
        }
        motions[D + spin][D + spin] = radius * per_size;
    }
    motions
}

/// Groups in the making.
struct Gathering<'a, const D: usize> {
    bonds: &'a [Bond<D>],
    /// Where the bonds of each grain begin in `bonds_at`.
    starts: Vec<usize>,
    /// Bond and the side on which the grain is.
    bonds_at: Vec<(usize, usize)>,
    group_of: Vec<usize>,
    /// Members of each group; an emptied one has been merged into another.
    members: Vec<Vec<usize>>,
    /// Of each grain, measured along bonds from the first grain of its group, m.
    position: Vec<[f64; D]>,
}

impl<'a, const D: usize> Gathering<'a, D> {
    fn new(bonds: &'a [Bond<D>], grains: usize) -> Self {
        let mut starts = vec![0; grains + 1];
        for grain in bonds.iter().flat_map(|bond| bond.grains) {
            starts[grain + 1] += 1;
        }
        for grain in 0..grains {
            starts[grain + 1] += starts[grain];
        }
        let mut next = starts.clone();
        let mut bonds_at = vec![(0, 0); 2 * bonds.len()];
        for (index, bond) in bonds.iter().enumerate() {
            for (side, &grain) in bond.grains.iter().enumerate() {
                bonds_at[next[grain]] = (index, side);
                next[grain] += 1;
            }
        }
        Self {
            bonds,
            starts,
            bonds_at,
            group_of: vec![usize::MAX; grains],
            members: Vec::new(),
            position: vec![[0.0; D]; grains],
        }
    }

    /// Neighbours of a grain and the vectors to them.
    fn neighbours(&self, grain: usize) -> impl Iterator<Item = (usize, [f64; D])> {
        self.bonds_at[self.starts[grain]..self.starts[grain + 1]].iter().map(|&(index, side)| {
            let bond = &self.bonds[index];
            let sign = if side == 0 { 1.0 } else { -1.0 };
            (bond.grains[1 - side], bond.branch.map(|component| sign * component))
        })
    }

    /// Groups of up to `size` grains; each begins next to the ones before it.
    fn gather(&mut self, size: usize) {
        let mut border = VecDeque::new();
        for first in 0..self.group_of.len() {
            border.push_back(first);
            while let Some(seed) = border.pop_front() {
                if self.group_of[seed] == usize::MAX {
                    self.grow(seed, size, &mut border);
                }
            }
        }
    }

    fn grow(&mut self, seed: usize, size: usize, border: &mut VecDeque<usize>) {
        let group = self.members.len();
        let mut list = vec![seed];
        self.group_of[seed] = group;
        let mut head = 0;
        while head < list.len() {
            let grain = list[head];
            head += 1;
            for (neighbour, branch) in self.neighbours(grain).collect::<Vec<_>>() {
                if self.group_of[neighbour] != usize::MAX {
                    continue;
                }
                if list.len() == size {
                    border.push_back(neighbour);
                    continue;
                }
                self.group_of[neighbour] = group;
                self.position[neighbour] = plus(self.position[grain], branch);
                list.push(neighbour);
            }
        }
        self.members.push(list);
    }

    /// Groups of fewer than `least` grains join a neighbour.
    fn merge_small(&mut self, least: usize) {
        for group in 0..self.members.len() {
            if self.members[group].len() >= least {
                continue;
            }
            let way_out = self.members[group].iter().find_map(|&grain| {
                self.neighbours(grain)
                    .find(|(neighbour, _)| self.group_of[*neighbour] != group)
                    .map(|(neighbour, branch)| (grain, neighbour, branch))
            });
            let Some((grain, neighbour, branch)) = way_out else { continue };
            let there = plus(self.position[grain], branch);
            let shift = plus(self.position[neighbour], there.map(|component| -component));
            let target = self.group_of[neighbour];
            for member in std::mem::take(&mut self.members[group]) {
                self.group_of[member] = target;
                self.position[member] = plus(self.position[member], shift);
                self.members[target].push(member);
            }
        }
    }

    /// Numbers the groups that are left; returns how many.
    fn number_anew(&mut self) -> usize {
        self.members.retain(|list| !list.is_empty());
        for (group, list) in self.members.iter().enumerate() {
            for &member in list {
                self.group_of[member] = group;
            }
        }
        self.members.len()
    }

    /// Vectors from the centre of each grain's group to the grain, m.
    fn arms(&self, count: usize) -> Vec<[f64; D]> {
        let mut centres = vec![[0.0; D]; count];
        for (group, position) in self.group_of.iter().zip(&self.position) {
            let share = 1.0 / self.members[*group].len() as f64;
            centres[*group] = plus(centres[*group], position.map(|component| component * share));
        }
        let placed = self.group_of.iter().zip(&self.position);
        placed.map(|(group, position)| plus(*position, centres[*group].map(|component| -component))).collect()
    }
}

fn plus<const D: usize>(a: [f64; D], b: [f64; D]) -> [f64; D] {
    std::array::from_fn(|axis| a[axis] + b[axis])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A block of grains on a cubic grid with bonds to their neighbours, spacing 2.
    fn grid(side: usize) -> (Vec<Bond<3>>, Vec<f64>) {
        let number = |[i, j, k]: [usize; 3]| (k * side + j) * side + i;
        let mut bonds = Vec::new();
        for place in 0..side.pow(3) {
            let here = [place % side, place / side % side, place / (side * side)];
            for axis in 0..3 {
                let mut there = here;
                there[axis] += 1;
                if there[axis] < side {
                    let branch = std::array::from_fn(|other| if other == axis { 2.0 } else { 0.0 });
                    bonds.push(Bond { grains: [number(here), number(there)], branch });
                }
            }
        }
        (bonds, (0..side.pow(3)).map(|grain| 0.9 + 0.01 * (grain % 7) as f64).collect())
    }

    #[test]
    fn groups_are_few_of_a_size_and_hold_every_grain() {
        let (bonds, radii) = grid(9);
        let pinned = vec![[false; 6]; radii.len()];
        let groups = Aggregates::<6>::of(&bonds, &radii, &pinned, 30);
        let mut sizes = vec![0; groups.count];
        for group in &groups.group_of {
            sizes[*group] += 1;
        }
        assert_eq!(sizes.iter().sum::<usize>(), radii.len());
        assert!(sizes.iter().all(|size| (10..60).contains(size)), "{sizes:?}");
        assert!(groups.count < 2 * radii.len() / 30);
    }

    #[test]
    fn rigid_motions_strain_no_bond_and_spare_what_is_pinned() {
        let (bonds, radii) = grid(5);
        let mut pinned = vec![[false; 6]; radii.len()];
        pinned[17] = [true, false, false, false, true, false];
        let groups = Aggregates::<6>::of(&bonds, &radii, &pinned, 40);
        assert_eq!(groups.motions[17][0], [0.0; 6]);
        assert_eq!(groups.motions[17][4], [0.0; 6]);
        let inside = bonds.iter().filter(|bond| {
            let [first, second] = bond.grains.map(|grain| groups.group_of[grain]);
            first == second && !bond.grains.contains(&17)
        });
        let mut checked = 0;
        for bond in inside {
            let [first, second] = bond.grains.map(|grain| &groups.motions[grain]);
            for motion in 0..6 {
                // Spins over radius are those of the group; the ends move apart by that spin times the branch.
                let spin: [f64; 3] = std::array::from_fn(|k| first[3 + k][motion] / radii[bond.grains[0]]);
                let other: [f64; 3] = std::array::from_fn(|k| second[3 + k][motion] / radii[bond.grains[1]]);
                let turn: [f64; 3] = (0..3).fold([0.0; 3], |sum, axis| {
                    plus(sum, turned(axis, &bond.branch).map(|component| component * spin[axis]))
                });
                for axis in 0..3 {
                    assert!((spin[axis] - other[axis]).abs() < 1e-14);
                    assert!((second[axis][motion] - first[axis][motion] - turn[axis]).abs() < 1e-13);
                }
            }
            checked += 1;
        }
        assert!(checked > 50);
    }

    /// The groups' matrix is `Z^T A Z`: its quadratic form is that of the grains under the same motion.
    #[test]
    fn projection_keeps_the_work_of_rigid_motions() {
        let (bonds, radii) = grid(4);
        let pinned = vec![[false; 6]; radii.len()];
        let groups = Aggregates::<6>::of(&bonds, &radii, &pinned, 20);
        let ends: Vec<[usize; 2]> = bonds.iter().map(|bond| bond.grains).collect();
        let (mut matrix, _) = BlockMatrix::<6>::with_pattern(radii.len(), &ends);
        let number = |seed: usize| ((seed as f64).powi(2) * std::f64::consts::GOLDEN_RATIO).fract() - 0.5;
        let mut seed = 0;
        let BlockMatrix { diagonal, upper, lower, .. } = &mut matrix;
        for value in diagonal.iter_mut().chain(upper).chain(lower).flatten().flatten() {
            seed += 1;
            *value = number(seed);
        }
        let coarse = groups.projected(&matrix);
        let moved = |group: usize, motion: usize| number(7 * group + motion + 1);
        let fine: Vec<[[f64; 1]; 6]> = groups
            .motions
            .iter()
            .zip(&groups.group_of)
            .map(|(motions, &group)| {
                motions.map(|row| [(0..6).map(|motion| row[motion] * moved(group, motion)).sum()])
            })
            .collect();
        let whole: Vec<[[f64; 1]; 6]> =
            (0..groups.count).map(|group| std::array::from_fn(|motion| [moved(group, motion)])).collect();
        let work = |matrix: &BlockMatrix<6>, values: &[[[f64; 1]; 6]]| -> f64 {
            let zero = vec![[[0.0]; 6]; values.len()];
            let forces = matrix.residual(&zero, values);
            -values.iter().flatten().flatten().zip(forces.iter().flatten().flatten()).map(|(u, f)| u * f).sum::<f64>()
        };
        let (given, wanted) = (work(&coarse, &whole), work(&matrix, &fine));
        assert!((given - wanted).abs() < 1e-10 * wanted.abs().max(1.0), "{given} against {wanted}");
    }
}
