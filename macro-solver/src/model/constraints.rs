//! Which displacement components are prescribed or follow others in a stage, and the numbering of the rest.
//!
//! Degrees of freedom are numbered `dimension * node + axis`. Prescribed and dependent ones are eliminated: unknowns are the
//! free ones in ascending order. With `u = T v + g` of the free components `v`, forces become `T^T f` and the stiffness
//! `T^T K T`, block by block.

use crate::model::assembly::block::{Block, BlockDofs};
use crate::problem::elimination::Dependent;
use crate::problem::{Amplitude, Moment, Origin, Prescribed};
use std::borrow::Cow;

/// Split of the degrees of freedom.
#[derive(Clone, Debug)]
pub(crate) struct Constraints {
    start: Vec<f64>,
    paths: Vec<Option<Path>>,
    histories: Vec<Amplitude>,
    unknowns: Vec<Option<usize>>,
    free: Vec<usize>,
    followers: Vec<Follower>,
    /// For each degree of freedom its place among the followers.
    follower_of: Vec<Option<usize>>,
    /// Whether a free component is followed by others.
    is_master: Vec<bool>,
}

/// Change of one degree of freedom over a stage: `change x factor`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Path {
    change: f64,
    history: usize,
}

/// A dependent degree of freedom: its change is that of others times coefficients, and what is given.
#[derive(Clone, Debug)]
struct Follower {
    dof: usize,
    masters: Vec<(usize, f64)>,
    given: Vec<Path>,
}

impl Constraints {
    /// From what is prescribed and what follows at every degree of freedom, and the displacements at the beginning of the
    /// stage, m.
    pub(crate) fn new(prescribed: &[Option<Prescribed<'_>>], dependents: &[Dependent<'_>], start: &[f64]) -> Self {
        let mut histories = Histories::default();
        let paths: Vec<Option<Path>> = (prescribed.iter().zip(start))
            .map(|(given, start)| {
                given.map(|given| {
                    let change = match given.origin {
                        Origin::Stage => given.value,
                        Origin::Run => given.value - start,
                    };
                    Path { change, history: histories.place(given.history) }
                })
            })
            .collect();
        let followers: Vec<Follower> = dependents
            .iter()
            .map(|Dependent { dof, masters, given }| Follower {
                dof: *dof,
                masters: masters.clone(),
                given: given
                    .iter()
                    .map(|&(change, history)| Path { change, history: histories.place(history) })
                    .collect(),
            })
            .collect();
        let mut follower_of = vec![None; paths.len()];
        let mut is_master = vec![false; paths.len()];
        for (place, follower) in followers.iter().enumerate() {
            follower_of[follower.dof] = Some(place);
            follower.masters.iter().for_each(|&(dof, _)| is_master[dof] = true);
        }
        let free: Vec<usize> =
            (0..paths.len()).filter(|&dof| paths[dof].is_none() && follower_of[dof].is_none()).collect();
        let mut unknowns = vec![None; paths.len()];
        for (unknown, &dof) in free.iter().enumerate() {
            unknowns[dof] = Some(unknown);
        }
        let (start, histories) = (start.to_vec(), histories.0);
        Self { start, paths, histories, unknowns, free, followers, follower_of, is_master }
    }

    /// Degrees of freedom, free or not.
    pub(crate) fn count(&self) -> usize {
        self.paths.len()
    }

    /// Free degrees of freedom, ascending.
    pub(crate) fn free(&self) -> &[usize] {
        &self.free
    }

    /// Unknown of a degree of freedom, `None` when it is prescribed or follows others.
    pub(crate) fn unknown(&self, dof: usize) -> Option<usize> {
        self.unknowns[dof]
    }

    /// Whether no support and no link acts on a degree of freedom.
    pub(crate) fn is_unloaded(&self, dof: usize) -> bool {
        self.unknowns[dof].is_some() && !self.is_master[dof]
    }

    /// Whether a degree of freedom is prescribed.
    pub(crate) fn is_prescribed(&self, dof: usize) -> bool {
        self.paths[dof].is_some()
    }

    /// Whether the motion of a degree of freedom is given: it is prescribed, or links leave it nothing else to follow.
    pub(crate) fn is_given(&self, dof: usize) -> bool {
        let follows_nothing = |place: usize| self.followers[place].masters.is_empty();
        self.is_prescribed(dof) || self.follower_of[dof].is_some_and(follows_nothing)
    }

    /// Degrees of freedom that follow others, with the free ones that they follow and coefficients.
    pub(crate) fn followers(&self) -> impl Iterator<Item = (usize, &[(usize, f64)])> {
        self.followers.iter().map(|follower| (follower.dof, follower.masters.as_slice()))
    }

    /// Prescribed total displacement at a moment of the stage, or a step after it, m.
    pub(crate) fn prescribed(&self, dof: usize, moment: Moment) -> Option<f64> {
        self.paths[dof].map(|path| self.start[dof] + self.change(path, moment))
    }

    /// Velocity of a prescribed degree of freedom at the beginning of the stage, m/s, where its history says so.
    pub(crate) fn velocity_at_start(&self, dof: usize) -> Option<f64> {
        let path = self.paths[dof]?;
        Some(path.change * self.histories[path.history].rate_at_start()?)
    }

    fn change(&self, path: Path, moment: Moment) -> f64 {
        path.change * self.histories[path.history].continued(moment)
    }

    /// Adds to a motion from one moment to another what links give to the components that follow others, m.
    pub(crate) fn add_given_motion(&self, motion: &mut [f64], from: Moment, to: Moment) {
        for Follower { dof, given, .. } in &self.followers {
            motion[*dof] += given.iter().map(|&path| self.change(path, to) - self.change(path, from)).sum::<f64>();
        }
    }

    /// Makes the dependent components of an increment from the displacements `before` it follow the free ones.
    pub(crate) fn complete(&self, increment: &mut [f64], before: &[f64], moment: Moment) {
        for Follower { dof, masters, given } in &self.followers {
            let followed: f64 = masters
                .iter()
                .map(|&(master, share)| share * (before[master] + increment[master] - self.start[master]))
                .sum();
            let added: f64 = given.iter().map(|&path| self.change(path, moment)).sum();
            increment[*dof] = self.start[*dof] + followed + added - before[*dof];
        }
    }

    /// The free components of displacements at all degrees of freedom.
    pub(crate) fn select(&self, all: &[f64]) -> Vec<f64> {
        self.free.iter().map(|&dof| all[dof]).collect()
    }

    /// The forces along the unknowns, of forces at all degrees of freedom.
    pub(crate) fn restrict(&self, all: &[f64]) -> Vec<f64> {
        let mut free = self.select(all);
        for Follower { dof, masters, .. } in &self.followers {
            for &(master, share) in masters {
                if let Some(unknown) = self.unknowns[master] {
                    free[unknown] += share * all[*dof];
                }
            }
        }
        free
    }

    /// The change of all displacements for a change of the unknowns; zero at prescribed ones.
    pub(crate) fn expand(&self, free: &[f64]) -> Vec<f64> {
        let mut all = vec![0.0; self.count()];
        for (&dof, value) in self.free.iter().zip(free) {
            all[dof] = *value;
        }
        for Follower { dof, masters, .. } in &self.followers {
            all[*dof] = masters.iter().map(|&(master, share)| share * all[master]).sum();
        }
        all
    }

    /// Blocks in which dependent degrees of freedom are replaced by those that they follow; as they are without any.
    pub(crate) fn condense<'a>(&self, blocks: &'a [Block]) -> Cow<'a, [Block]> {
        if self.followers.is_empty() {
            return Cow::Borrowed(blocks);
        }
        Cow::Owned(blocks.iter().map(|block| self.condensed(block)).collect())
    }

    /// Degrees of freedom of a condensed block, in the order of [`Constraints::condense`].
    pub(crate) fn condensed_dofs(&self, dofs: &BlockDofs) -> BlockDofs {
        dofs.map(|dofs| self.masters_of(dofs))
    }

    /// Degrees of freedom in which those that follow others are replaced by them.
    fn masters_of(&self, dofs: &[usize]) -> Vec<usize> {
        let mut condensed: Vec<usize> = dofs.iter().copied().filter(|&dof| self.follower_of[dof].is_none()).collect();
        for follower in dofs.iter().filter_map(|&dof| self.follower_of[dof]) {
            for &(master, _) in &self.followers[follower].masters {
                if !condensed.contains(&master) {
                    condensed.push(master);
                }
            }
        }
        condensed
    }

    fn condensed(&self, block: &Block) -> Block {
        let (rows, columns) = (&block.dofs.rows, block.dofs.columns());
        if rows.iter().chain(columns).all(|&dof| self.follower_of[dof].is_none()) {
            return block.clone();
        }
        let mut condensed = Block::zero(self.condensed_dofs(&block.dofs));
        let width = condensed.dofs.columns().len();
        let row_shares = self.shares(rows, &condensed.dofs.rows);
        let column_shares = self.shares(columns, condensed.dofs.columns());
        for (row, row_shares) in row_shares.iter().enumerate() {
            for (column, column_shares) in column_shares.iter().enumerate() {
                let entry = block.matrix[row * columns.len() + column];
                for &(target, row_share) in row_shares {
                    for &(source, column_share) in column_shares {
                        condensed.matrix[target * width + source] += row_share * column_share * entry;
                    }
                }
            }
        }
        condensed
    }

    /// For each degree of freedom the places of those that it follows among `condensed`, with coefficients; its own place if it
    /// follows none.
    fn shares(&self, dofs: &[usize], condensed: &[usize]) -> Vec<Vec<(usize, f64)>> {
        let place = |wanted: usize| condensed.iter().position(|&dof| dof == wanted);
        let of_dof = |&dof: &usize| match self.follower_of[dof] {
            None => place(dof).map(|place| (place, 1.0)).into_iter().collect(),
            Some(follower) => {
                let masters = &self.followers[follower].masters;
                masters.iter().filter_map(|&(master, share)| Some((place(master)?, share))).collect()
            }
        };
        dofs.iter().map(of_dof).collect()
    }
}

/// Histories, each once.
#[derive(Default)]
struct Histories(Vec<Amplitude>);

impl Histories {
    fn place(&mut self, history: &Amplitude) -> usize {
        self.0.iter().position(|known| known == history).unwrap_or_else(|| {
            self.0.push(history.clone());
            self.0.len() - 1
        })
    }
}
