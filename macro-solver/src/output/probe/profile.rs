//! Profiles: a measure over rows of the body, one after the other along an axis.

use super::field::FieldProbe;
use super::reference::References;
use crate::observer::{FieldsView, PointFields};

/// A measure along an axis. The bins have equal thickness in the mesh as given and move with the material.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// Name of the file, without its ending.
    pub name: String,
    /// What is measured over the points of a bin.
    pub probe: FieldProbe,
    /// Axis along which the bins follow each other, 0 = x, 1 = y, 2 = z.
    pub axis: usize,
    /// Beginning of the first bin along the axis, m.
    pub from: f64,
    /// End of the last bin, m.
    pub to: f64,
    /// Number of bins.
    pub bins: usize,
    /// Every how many steps it is written, in addition to the ends of stages.
    pub every: u64,
}

impl Profile {
    /// Centre of each bin in the mesh as given, m, and the value there. Bins that hold no Gauss point are left out.
    pub fn values(&self, view: &FieldsView<'_>, references: &References) -> Vec<[f64; 2]> {
        let mut members: Vec<Vec<(usize, &PointFields)>> = vec![Vec::new(); self.bins];
        let thickness = (self.to - self.from) / self.bins as f64;
        for (number, point) in self.probe.part.of(view.points) {
            let coordinate = point.initial_position[self.axis];
            if (self.from..=self.to).contains(&coordinate) {
                // The end belongs to the last bin.
                let bin = ((coordinate - self.from) / thickness).floor() as usize;
                members[bin.min(self.bins - 1)].push((number, point));
            }
        }
        let origin = references.origin(self.probe.reference);
        let occupied = members.iter().enumerate().filter(|(_, points)| !points.is_empty());
        occupied
            .map(|(bin, points)| {
                [self.from + (bin as f64 + 0.5) * thickness, self.probe.over(points.iter().copied(), origin)]
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{point, seen};
    use super::super::{Measure, StressMeasure};
    use super::*;

    /// A stress that grows linearly from 0 to 2 over the height of 2 m, at 2 x 8 places.
    #[test]
    fn the_profile_of_a_linear_field_is_the_line_at_the_centres_of_the_bins() {
        let points: Vec<PointFields> = (0..16)
            .map(|number| {
                let height = 0.25 * (f64::from(number / 2) + 0.5);
                let stress = [[0.0, 0.0], [0.0, height]];
                PointFields { initial_position: [0.0, height, 0.0], ..point(1.0, stress, 1.0) }
            })
            .collect();
        let probe = FieldProbe::mean(Measure::Stress(StressMeasure::Component(1, 1)));
        let profile = Profile { name: "stress".into(), probe, axis: 1, from: 0.0, to: 2.0, bins: 4, every: 1 };
        seen(&points, 0.0, |view| {
            let values = profile.values(view, &References::default());
            assert_eq!(values, [[0.25; 2], [0.75; 2], [1.25; 2], [1.75; 2]]);
            let fine = Profile { bins: 16, ..profile.clone() };
            assert_eq!(fine.values(view, &References::default()).len(), 8, "every other bin is empty");
            // Points on both ends belong to the profile.
            let tight = Profile { from: 0.125, to: 1.875, bins: 1, ..profile.clone() };
            assert_eq!(tight.values(view, &References::default()), [[1.0; 2]]);
            let last = Profile { from: 1.5, to: 1.875, bins: 1, ..profile.clone() };
            assert_eq!(last.values(view, &References::default())[0][1], 0.5 * (1.625 + 1.875));
        });
    }
}
