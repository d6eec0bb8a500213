//! Which points the roaming replicas follow: some of those that strain most.
//!
//! Errors of a body in which strain localises lie where the strain is, and are up to a hundred times those elsewhere. A sample that is spread
//! over the body has too few points there. So the points are told apart by the length of their strain path: an eighth of them, those with
//! the longest, are the strained part of the body, and roaming replicas follow points of it. One that begins to follow a point knows the
//! error that comes from then on only. Measured in docs/lab-book/error-estimate.md.

use crate::formulation::tensor::matrix;
use crate::material::PointId;
use protocol::Tensor2;
use serde::{Deserialize, Serialize};

/// Points of the body for each one of its strained part.
pub(super) const POINTS_PER_STRAINED: usize = 8;

/// The replicas are placed again when a point has strained by this much since the last time: about a load step of a static stage. Increments of
/// waves and of stabilised steps are too small to tell where a body strains.
const STRAIN_OF_A_REVIEW: f64 = 5e-4;

/// Strain paths of the points, and the strained part of the body.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Strains {
    kept: Kept,
    /// Strain and [level](super::stress_level) of the stress, Pa, of the latest trial, by point.
    latest: Vec<Option<(f64, f64)>>,
}

/// What checkpoints and marks keep.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Kept {
    /// Length of the strain path, by point; empty without roaming replicas.
    path: Vec<f64>,
    /// Part of it since the last review.
    since_review: Vec<f64>,
    /// Largest level of the stress so far, Pa, by point.
    level: Vec<f64>,
    /// Error over the pressure that a replica knew of a point when it left it, by point: an error that has been made stays.
    left: Vec<f64>,
    /// Points of the strained part, ascending; empty before the first review.
    strained: Vec<PointId>,
    /// Points of it whose replica was refused a trial.
    refused: Vec<PointId>,
}

impl Strains {
    /// Points none of which has strained.
    pub(super) fn of(points: usize) -> Self {
        let zeros = vec![0.0; points];
        let kept = Kept {
            path: zeros.clone(),
            since_review: zeros.clone(),
            level: zeros.clone(),
            left: zeros,
            ..Kept::default()
        };
        Self { kept, latest: vec![None; points] }
    }

    /// Takes note of a trial and of the level of its stress, Pa.
    pub(super) fn trial(&mut self, point: PointId, target: &Tensor2, level: impl FnOnce() -> f64) {
        if let Some(latest) = self.latest.get_mut(point) {
            let gradient = matrix(target);
            *latest = Some(((0.5 * (gradient + gradient.transpose())).norm(), level()));
        }
    }

    /// Adds the latest trials to the paths.
    pub(super) fn commit(&mut self) {
        for (point, latest) in self.latest.iter_mut().enumerate() {
            let Some((strain, level)) = latest.take() else { continue };
            self.kept.path[point] += strain;
            self.kept.since_review[point] += strain;
            self.kept.level[point] = self.kept.level[point].max(level);
        }
    }

    /// Forgets the latest trials.
    pub(super) fn rollback(&mut self) {
        self.latest.fill(None);
    }

    /// Whether it is time to place the replicas anew.
    pub(super) fn is_review_due(&self, points: &[PointId]) -> bool {
        points.iter().any(|&point| self.kept.since_review[point] >= STRAIN_OF_A_REVIEW)
    }

    /// Finds the strained part anew, among these points. Equal paths go by the number of the point.
    pub(super) fn review(&mut self, points: &[PointId]) {
        self.kept.since_review.fill(0.0);
        self.kept.strained = points.to_vec();
        let path = &self.kept.path;
        self.kept.strained.sort_by(|&one, &other| path[other].total_cmp(&path[one]).then(one.cmp(&other)));
        self.kept.strained.truncate(points.len().div_ceil(POINTS_PER_STRAINED));
        self.kept.strained.sort_unstable();
        let strained = &self.kept.strained;
        self.kept.refused.retain(|point| strained.binary_search(point).is_ok());
    }

    /// Largest level of the stress of a point so far, Pa.
    pub(super) fn level(&self, point: PointId) -> f64 {
        self.kept.level[point]
    }

    /// A replica leaves a point, of which it knows this error over the pressure.
    pub(super) fn leave(&mut self, point: PointId, error: f64) {
        self.kept.left[point] = error.max(self.kept.left[point]);
    }

    /// Error over the pressure that was known of a point when a replica left it; 0 if none did.
    pub(super) fn left(&self, point: PointId) -> f64 {
        self.kept.left[point]
    }

    /// Sum of the squares of such errors over the rest of the body.
    pub(super) fn left_squares(&self) -> f64 {
        let left = self.kept.left.iter().enumerate().filter(|(point, _)| !self.is_strained(*point));
        left.map(|(_, error)| error * error).sum()
    }

    /// A replica of the point was refused a trial: none follows it again while it belongs to the strained part.
    pub(super) fn refuse(&mut self, point: PointId) {
        self.kept.refused.push(point);
    }

    /// The strained part, ascending.
    pub(super) fn strained(&self) -> &[PointId] {
        &self.kept.strained
    }

    /// Whether a point belongs to it.
    pub(super) fn is_strained(&self, point: PointId) -> bool {
        self.kept.strained.binary_search(&point).is_ok()
    }

    pub(super) fn kept(&self) -> &Kept {
        &self.kept
    }

    /// Takes up what was saved; `false` if it belongs to another number of points.
    pub(super) fn restore(&mut self, kept: Kept) -> bool {
        let points = self.latest.len();
        let fits = kept.path.len() == points
            && kept.since_review.len() == points
            && kept.level.len() == points
            && kept.left.len() == points
            && kept.strained.iter().chain(&kept.refused).all(|&point| point < points);
        self.kept = kept;
        self.rollback();
        fits
    }

    /// The point that each replica follows from now on; `followed` is what it has followed. One stays with its point while that belongs to
    /// the strained part; the others go to points of it that have no replica, in the order of their paths.
    pub(super) fn placed(
        &self,
        has_fixed: impl Fn(PointId) -> bool,
        followed: impl Iterator<Item = Option<PointId>>,
    ) -> Vec<Option<PointId>> {
        let mut placed: Vec<Option<PointId>> =
            followed.map(|point| point.filter(|&point| self.is_strained(point))).collect();
        let path = &self.kept.path;
        let mut free: Vec<PointId> = self.kept.strained.clone();
        let refused = &self.kept.refused;
        free.retain(|point| {
            !has_fixed(*point) && !placed.contains(&Some(*point)) && !refused.contains(point) && path[*point] > 0.0
        });
        free.sort_by(|&one, &other| path[other].total_cmp(&path[one]).then(one.cmp(&other)));
        let mut free = free.into_iter();
        placed.iter_mut().filter(|place| place.is_none()).for_each(|place| *place = free.next());
        placed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn strained(by_point: &[f64]) -> Strains {
        let mut strains = Strains::of(by_point.len());
        for (point, strain) in by_point.iter().enumerate() {
            strains.trial(point, &Tensor2::from_plane([[0.0, 0.0], [0.0, -strain]]), || 1.0);
        }
        strains.commit();
        let all: Vec<PointId> = (0..by_point.len()).collect();
        strains.review(&all);
        strains
    }

    #[test]
    fn replicas_go_where_the_strain_is_and_stay_with_points_that_belong_to_it() {
        let mut by_point = [1e-4; 24];
        (by_point[3], by_point[9], by_point[20]) = (5e-3, 9e-3, 7e-3);
        let strains = strained(&by_point);
        assert_eq!(strains.strained(), [3, 9, 20]);
        let placed = |fixed: &[PointId], followed: &[Option<PointId>]| {
            strains.placed(|point| fixed.contains(&point), followed.iter().copied())
        };
        assert_eq!(placed(&[], &[None, None]), [Some(9), Some(20)]);
        assert_eq!(placed(&[], &[Some(3), Some(4)]), [Some(3), Some(9)]);
        assert_eq!(placed(&[9], &[None, Some(3)]), [Some(20), Some(3)]);
        // There may be fewer points than replicas, and points at rest are not followed.
        assert_eq!(placed(&[3, 9], &[None, None]), [Some(20), None]);
        assert_eq!(strained(&[0.0; 3]).placed(|_| false, [None].into_iter()), [None]);
        assert_eq!(strained(&[2e-3; 16]).strained(), [0, 1]);
        // Nor are points whose replica was refused.
        let mut strains = strains;
        strains.refuse(9);
        assert_eq!(strains.placed(|_| false, [None, None].into_iter()), [Some(20), Some(3)]);
        // What was known of a point counts when it belongs to the rest.
        strains.leave(4, 0.2);
        strains.leave(4, 0.1);
        strains.leave(20, 0.5);
        assert!((strains.left_squares() - 0.04).abs() < 1e-15);
    }

    #[test]
    fn small_increments_add_up_to_a_review() {
        let mut strains = Strains::of(2);
        let compression = Tensor2::from_plane([[0.0, 1e-4], [-1e-4, -2e-4]]);
        for _ in 0..3 {
            assert!(!strains.is_review_due(&[0, 1]));
            strains.trial(0, &Tensor2::from_plane([[0.0, 0.0], [0.0, -1e-2]]), || 9.0);
            strains.rollback();
            strains.trial(0, &compression, || 2.0);
            strains.commit();
            strains.commit();
        }
        assert!(strains.is_review_due(&[0, 1]) && !strains.is_review_due(&[1]));
        assert_eq!(strains.level(0), 2.0, "a trial that is not committed has no level");
        assert!((strains.kept().path[0] - 6e-4).abs() < 1e-15, "turning is no strain");
        strains.review(&[0, 1]);
        assert!(!strains.is_review_due(&[0, 1]));
        // The path is that of the whole run.
        strains.trial(1, &Tensor2::from_plane([[0.0, 0.0], [0.0, -5.5e-4]]), || 1.0);
        strains.commit();
        assert!(strains.is_review_due(&[0, 1]));
        strains.review(&[0, 1]);
        assert_eq!(strains.strained(), [0]);
    }
}
