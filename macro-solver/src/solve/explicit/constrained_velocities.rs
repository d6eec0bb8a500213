//! Multi-point constraints in motion: rigid bodies, tilting platens, periodic faces.
//!
//! With `u = T v + g` the constraint forces do no work along them, so the velocities after a step are those of the
//! unconstrained nodes, moved to the nearest ones that the constraints allow in the metric `A = m / dt + C / 2` of masses and dampers (Gauss's principle
//! of least constraint): `T^T A T w = T^T A (v' - g')`. Displacements meet the constraints at every instant, without drift. Constraints leave
//! the step stable: a body that may move in fewer ways has no higher frequency.

use crate::model::constraints::Constraints;
use crate::problem::{Moment, ProblemError};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// All constraints of a stage, in groups that share no free component.
#[derive(Clone, Debug)]
pub(super) struct VelocityConstraints {
    groups: Vec<Group>,
    /// Factors of the groups' equations for the metric of their last use.
    factors: Vec<(Vec<f64>, Cholesky<f64, Dyn>)>,
}

#[derive(Clone, Debug, Default)]
struct Group {
    /// Free components.
    masters: Vec<usize>,
    /// Components that follow them, with the masters' places in the group and coefficients.
    followers: Vec<(usize, Vec<(usize, f64)>)>,
}

impl VelocityConstraints {
    /// Those of a stage; `has_oblique_damper` tells of a degree of freedom whether a damper couples it with others of its node.
    ///
    /// # Errors
    /// A constrained component with such a damper.
    pub(super) fn of_stage(
        constraints: &Constraints,
        has_oblique_damper: impl Fn(usize) -> bool,
    ) -> Result<Self, ProblemError> {
        let mut group_of: Vec<Option<usize>> = vec![None; constraints.count()];
        let mut groups: Vec<Group> = Vec::new();
        for (dof, masters) in constraints.followers() {
            if masters.iter().map(|(master, _)| *master).chain([dof]).any(&has_oblique_damper) {
                return Err(ProblemError::Linked {
                    reason: "a node of an absorbing side that is oblique to the axes is linked to others",
                    remedy: "end the absorbing side before the linked nodes, or turn the mesh so that the side's normal is an axis",
                });
            }
            let mut target = groups.len();
            groups.push(Group::default());
            for (master, _) in masters {
                match group_of[*master] {
                    Some(group) if group == target => {}
                    Some(group) => {
                        // Two groups become one; an emptied one is dropped in the end.
                        let (kept, emptied) = (group.min(target), group.max(target));
                        let moved = std::mem::take(&mut groups[emptied]);
                        moved.masters.iter().for_each(|&dof| group_of[dof] = Some(kept));
                        groups[kept].masters.extend(moved.masters);
                        groups[kept].followers.extend(moved.followers);
                        target = kept;
                    }
                    None => {
                        group_of[*master] = Some(target);
                        groups[target].masters.push(*master);
                    }
                }
            }
            groups[target].followers.push((dof, masters.to_vec()));
        }
        groups.retain(|group| !group.followers.is_empty());
        for group in &mut groups {
            group.masters.sort_unstable();
            group.followers.sort_unstable_by_key(|(dof, _)| *dof);
            let Group { masters, followers } = group;
            for (master, _) in followers.iter_mut().flat_map(|(_, shares)| shares) {
                *master = masters.binary_search(master).expect("masters of followers are in their group");
            }
        }
        Ok(Self { groups, factors: Vec::new() })
    }

    /// Whether there are none.
    pub(super) fn is_empty(&self) -> bool {
        self.groups.is_empty()
    }

    /// Constrained components, masters and followers.
    pub(super) fn tied(&self) -> impl Iterator<Item = usize> {
        let of_group = |group: &Group| {
            let followers = group.followers.iter().map(|(dof, _)| *dof);
            group.masters.iter().copied().chain(followers).collect::<Vec<usize>>()
        };
        self.groups.iter().flat_map(of_group)
    }

    /// Moves velocities onto the constraints. `weight` is the diagonal of the metric by degree of freedom, `given` what followers move at
    /// without their masters, m/s.
    pub(super) fn keep(&mut self, velocity: &mut [f64], weight: impl Fn(usize) -> f64, given: &[f64]) {
        for (number, group) in self.groups.iter().enumerate() {
            let weights: Vec<f64> = group
                .masters
                .iter()
                .copied()
                .chain(group.followers.iter().map(|(dof, _)| *dof))
                .map(&weight)
                .collect();
            if self.factors.len() <= number {
                self.factors.push((weights.clone(), group.factor(&weights)));
            } else if self.factors[number].0 != weights {
                self.factors[number] = (weights.clone(), group.factor(&weights));
            }
            let (of_masters, of_followers) = weights.split_at(group.masters.len());
            let mut right =
                DVector::from_fn(group.masters.len(), |place, _| of_masters[place] * velocity[group.masters[place]]);
            for ((dof, shares), weight) in group.followers.iter().zip(of_followers) {
                let pull = weight * (velocity[*dof] - given[*dof]);
                shares.iter().for_each(|&(place, share)| right[place] += share * pull);
            }
            self.factors[number].1.solve_mut(&mut right);
            for (&dof, value) in group.masters.iter().zip(right.iter()) {
                velocity[dof] = *value;
            }
            for (dof, shares) in &group.followers {
                velocity[*dof] = given[*dof] + shares.iter().map(|&(place, share)| share * right[place]).sum::<f64>();
            }
        }
    }
}

impl Group {
    /// Factors of `T^T A T`, which is positive definite since every master weighs something.
    fn factor(&self, weights: &[f64]) -> Cholesky<f64, Dyn> {
        let (of_masters, of_followers) = weights.split_at(self.masters.len());
        let mut matrix = DMatrix::from_diagonal(&DVector::from_column_slice(of_masters));
        for ((_, shares), weight) in self.followers.iter().zip(of_followers) {
            for &(row, left) in shares {
                for &(column, right) in shares {
                    matrix[(row, column)] += left * right * weight;
                }
            }
        }
        matrix.cholesky().expect("masses are positive and dampers positive semidefinite")
    }
}

/// Velocities of followers whose masters stand still, over a step of `step` (s) that ends at `next`: with them displacements
/// meet the constraints then.
pub(super) fn given_velocities(
    constraints: &Constraints,
    displacements: &[f64],
    next: Moment,
    step: f64,
) -> Vec<f64> {
    let mut given = vec![0.0; displacements.len()];
    constraints.complete(&mut given, displacements, next);
    given.iter_mut().for_each(|change| *change /= step);
    given
}
