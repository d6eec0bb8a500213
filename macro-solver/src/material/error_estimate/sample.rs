//! Which Gauss points have a replica.

use super::roaming::POINTS_PER_STRAINED;
use super::{ReplicaPlan, SamplePlan};
use crate::material::PointId;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// So many points may have replicas for the sake of their kinds, whatever the share.
const MOST_OF_FEW: usize = 8;

/// Replicas at least: what one or two of them find says little about a body whose points come apart past a peak. Measured in
/// docs/lab-book/error-estimate.md, "Small bodies".
const LEAST: usize = 3;

/// In bodies of more points than this one of them roams.
const MOST_WITHOUT_ROAMING: usize = 8;

/// The table `[error_estimate]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct ErrorEstimateSettings {
    /// Whether the error of the grain solver is estimated: some Gauss points are solved once more per step, with half the strain per
    /// ramp step. Changes no result, except of runs with `rve.error`, which need it.
    pub enabled: bool,
    /// Share of the Gauss points of each kind of cell that are solved once more; at least one of each kind, and three in bodies of up to
    /// eight points, two in others. Where that would be more than eight and more than twice the share of all, as in bodies whose every point has
    /// a cell of its own, as many spread over all.
    #[schemars(extend("x-unit" = "-", "exclusiveMinimum" = 0), range(max = 1))]
    pub share: f64,
    /// Share of the Gauss points that are solved once more besides, chosen from the eighth of them that has strained most: where strain
    /// localises, errors lie there. At least one in bodies of more than eight points, none in others; 0: none.
    #[schemars(extend("x-unit" = "-"), range(min = 0, max = 1))]
    pub most_strained: f64,
}

impl Default for ErrorEstimateSettings {
    fn default() -> Self {
        Self { enabled: true, share: 0.03, most_strained: 0.03 }
    }
}

/// Chooses the points that are followed from the start, of each kind the same share, spread over its points; roaming replicas follow
/// others as the body strains. `kind_of[p]` is the kind of cell of point p, `None` for a point that cannot have a replica. Replicas are numbered on
/// behind the points, roaming ones last.
pub fn sample(kind_of: &[Option<usize>], settings: &ErrorEstimateSettings) -> SamplePlan {
    let points: Vec<PointId> = (0..kind_of.len()).filter(|&point| kind_of[point].is_some()).collect();
    let may_roam = points.len() > MOST_WITHOUT_ROAMING;
    let fixed = fixed(kind_of, settings, if may_roam { LEAST - 1 } else { LEAST });
    let count = match may_roam && settings.most_strained > 0.0 {
        true => ((settings.most_strained * points.len() as f64).round() as usize).max(1),
        false => 0,
    };
    let first = kind_of.len() + fixed.len();
    let most = points.len().div_ceil(POINTS_PER_STRAINED).min(points.len() - fixed.len());
    let roaming = (first..first + count.min(most)).collect();
    SamplePlan { fixed, roaming, points }
}

/// At least `least` of them, if there are so many points.
fn fixed(kind_of: &[Option<usize>], settings: &ErrorEstimateSettings, least: usize) -> Vec<ReplicaPlan> {
    let mut of_kind: BTreeMap<usize, Vec<PointId>> = BTreeMap::new();
    for (point, kind) in kind_of.iter().enumerate() {
        if let Some(kind) = kind {
            of_kind.entry(*kind).or_default().push(point);
        }
    }
    let all: Vec<PointId> = of_kind.values().flatten().copied().collect();
    // Of the least number every kind has its part.
    let least_of = |points: &[PointId]| (least * points.len()).div_ceil(all.len());
    let share_of = |points: &[PointId]| (settings.share * points.len() as f64).ceil() as usize;
    let mut chosen: Vec<PointId> =
        of_kind.values().flat_map(|points| spread(points, share_of(points).max(least_of(points)))).collect();
    let most = (2 * share_of(&all)).max(MOST_OF_FEW).min(all.len());
    if chosen.len() > most {
        chosen = spread(&all, most);
    }
    chosen.sort_unstable();
    let first = kind_of.len();
    chosen.into_iter().enumerate().map(|(place, point)| ReplicaPlan { point, replica: first + place }).collect()
}

/// As many of the points. Multiples of the golden ratio spread evenly and meet all Gauss points of an element in turn, as equal
/// distances would not.
fn spread(points: &[PointId], count: usize) -> Vec<PointId> {
    const GOLDEN_RATIO: f64 = 0.618_033_988_749_894_8;
    let count = count.min(points.len());
    let mut places: Vec<usize> = Vec::with_capacity(count);
    for turn in 1_u32.. {
        if places.len() == count {
            break;
        }
        let place = (f64::from(turn) * GOLDEN_RATIO).fract() * points.len() as f64;
        let place = (place as usize).min(points.len() - 1);
        if !places.contains(&place) {
            places.push(place);
        }
    }
    places.into_iter().map(|place| points[place]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_has_its_share_of_different_points() {
        let kind_of: Vec<Option<usize>> =
            (0..400).map(|point| if point < 10 { None } else { Some(usize::from(point >= 390)) }).collect();
        let plans = fixed(&kind_of, &ErrorEstimateSettings { share: 0.1, ..ErrorEstimateSettings::default() }, 2);
        assert_eq!(plans.len(), 38 + 1);
        assert_eq!(plans[0].replica, 400);
        assert!(plans.windows(2).all(|pair| pair[0].point < pair[1].point && pair[0].replica < pair[1].replica));
        assert!(plans.iter().all(|plan| plan.point >= 10));
        assert_eq!(plans.iter().filter(|plan| plan.point >= 390).count(), 1);
        // All four places within an element of four points occur.
        let mut local: Vec<usize> = plans.iter().map(|plan| plan.point % 4).collect();
        local.sort_unstable();
        local.dedup();
        assert_eq!(local, [0, 1, 2, 3]);
    }

    /// A body of many kinds does not pay for every one of them; a few kinds are all there.
    #[test]
    fn kinds_of_their_own_are_sampled() {
        let settings = ErrorEstimateSettings { share: 0.04, ..ErrorEstimateSettings::default() };
        let of_kinds = |kinds: usize| {
            let kind_of: Vec<Option<usize>> = (0..400).map(|point| Some(point % kinds)).collect();
            fixed(&kind_of, &settings, 2).iter().map(|plan| plan.point).collect::<Vec<_>>()
        };
        assert_eq!(of_kinds(400).len(), 32, "twice the share");
        assert_eq!((of_kinds(1).len(), of_kinds(20).len()), (16, 20));
        let spread = of_kinds(400);
        let gaps = spread.windows(2).map(|pair| pair[1] - pair[0]);
        assert!(gaps.max().unwrap() <= 25, "{spread:?}");
        let few: Vec<Option<usize>> = (0..12).map(|point| Some(point.min(7))).collect();
        assert_eq!(fixed(&few, &settings, 2).len(), 8, "one of each of eight kinds");
        assert_eq!(fixed(&[None, None], &settings, 3), []);
    }

    #[test]
    fn a_share_of_one_takes_every_point_once() {
        let plans =
            fixed(&[Some(0); 57], &ErrorEstimateSettings { share: 1.0, ..ErrorEstimateSettings::default() }, 2);
        assert_eq!(plans.iter().map(|plan| plan.point).collect::<Vec<_>>(), (0..57).collect::<Vec<_>>());
    }

    /// Together they stay below a tenth of the points, except in small bodies.
    #[test]
    fn roaming_replicas_come_last() {
        let kind_of: Vec<Option<usize>> = (0..128).map(|point| (point != 5).then_some(0)).collect();
        let settings = ErrorEstimateSettings::default();
        let plan = sample(&kind_of, &settings);
        assert_eq!((plan.fixed.len(), plan.roaming.clone()), (4, vec![132, 133, 134, 135]));
        assert_eq!((plan.points.len(), plan.points.contains(&5)), (127, false));
        let count = |points: usize, settings: &ErrorEstimateSettings| {
            let plan = sample(&vec![Some(0); points], settings);
            (plan.fixed.len(), plan.roaming.len())
        };
        assert_eq!((count(25, &settings), count(8192, &settings)), ((2, 1), (246, 246)));
        assert_eq!(count(8, &ErrorEstimateSettings { share: 1.0, most_strained: 1.0, ..settings }), (8, 0));
        assert_eq!(count(128, &ErrorEstimateSettings { most_strained: 1.0, ..settings }), (4, 16));
        assert_eq!(count(128, &ErrorEstimateSettings { most_strained: 0.0, ..settings }), (4, 0));
        assert_eq!(count(16, &ErrorEstimateSettings { most_strained: 0.0, ..settings }), (2, 0));
    }

    #[test]
    fn small_bodies_have_three_replicas() {
        let of = |kind_of: &[Option<usize>]| {
            let plan = sample(kind_of, &ErrorEstimateSettings::default());
            (plan.fixed.len(), plan.roaming.len())
        };
        let alike = |points: usize| of(&vec![Some(0); points]);
        assert_eq!([1, 2, 4, 8].map(alike), [(1, 0), (2, 0), (3, 0), (3, 0)]);
        assert_eq!([9, 16, 33].map(alike), [(2, 1); 3]);
        // Points without a cell do not count; every kind has its part of the three, and one at least.
        assert_eq!(of(&[None, Some(0), Some(0), Some(0), Some(0)]), (3, 0));
        assert_eq!(of(&[Some(0), Some(0), Some(0), Some(1), Some(1), Some(1)]), (4, 0));
        assert_eq!(of(&[Some(0), Some(0), Some(0), Some(0), Some(0), Some(0), Some(0), Some(1)]), (4, 0));
    }
}
