//! Which Gauss points have a replica.

use super::ReplicaPlan;
use crate::material::PointId;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The table `[error_estimate]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct ErrorEstimateSettings {
    /// Whether the error of the grain solver is estimated: some Gauss points are solved once more per step, with half the strain per
    /// ramp step. Changes no result, except of runs with `rve.error`, which need it.
    pub enabled: bool,
    /// Share of the Gauss points of each kind of cell that are solved once more; at least one of each kind.
    #[schemars(extend("x-unit" = "-", "exclusiveMinimum" = 0), range(max = 1))]
    pub share: f64,
}

impl Default for ErrorEstimateSettings {
    fn default() -> Self {
        Self { enabled: true, share: 0.04 }
    }
}

/// Chooses the points: of each kind the same share, spread over its points. `kind_of[p]` is the kind of cell of point p, `None` for
/// a point that cannot have a replica. Replicas are numbered on behind the points.
pub fn replicas(kind_of: &[Option<usize>], settings: &ErrorEstimateSettings) -> Vec<ReplicaPlan> {
    let mut of_kind: BTreeMap<usize, Vec<PointId>> = BTreeMap::new();
    for (point, kind) in kind_of.iter().enumerate() {
        if let Some(kind) = kind {
            of_kind.entry(*kind).or_default().push(point);
        }
    }
    let mut chosen: Vec<PointId> = of_kind.values().flat_map(|points| spread(points, settings.share)).collect();
    chosen.sort_unstable();
    let first = kind_of.len();
    chosen.into_iter().enumerate().map(|(place, point)| ReplicaPlan { point, replica: first + place }).collect()
}

/// A share of the points. Multiples of the golden ratio spread evenly and meet all Gauss points of an element in turn, as equal
/// distances would not.
fn spread(points: &[PointId], share: f64) -> Vec<PointId> {
    const GOLDEN_RATIO: f64 = 0.618_033_988_749_894_8;
    let count = ((share * points.len() as f64).ceil() as usize).clamp(1, points.len());
    let mut places: Vec<usize> = Vec::with_capacity(count);
    for turn in 1_u32.. {
        let place = (f64::from(turn) * GOLDEN_RATIO).fract() * points.len() as f64;
        let place = (place as usize).min(points.len() - 1);
        if !places.contains(&place) {
            places.push(place);
        }
        if places.len() == count {
            break;
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
        let plans = replicas(&kind_of, &ErrorEstimateSettings { share: 0.1, ..ErrorEstimateSettings::default() });
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

    #[test]
    fn a_share_of_one_takes_every_point_once() {
        let plans =
            replicas(&[Some(0); 57], &ErrorEstimateSettings { share: 1.0, ..ErrorEstimateSettings::default() });
        assert_eq!(plans.iter().map(|plan| plan.point).collect::<Vec<_>>(), (0..57).collect::<Vec<_>>());
    }
}
