//! A cell of spheres with its contact forces, seen obliquely: lines between centres, as wide as the force is large.

use crate::force_chains::{ForceChains, ForceLine};

/// Turn about the vertical axis y, and height of the eye above the horizontal plane, degrees.
const TURN: f64 = 30.0;
const HEIGHT: f64 = 20.0;

/// Share by which the mean of equal forces may be larger than each of them, as a sum of many is rounded.
const ROUNDING: f64 = 1e-12;

/// A contact in space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpatialLine {
    /// Centre of one grain, m.
    pub from: [f64; 3],
    /// Centre of the other one, m.
    pub to: [f64; 3],
    /// Force, N; negative numbers are attraction.
    pub force: f64,
    /// Whether the contact slides.
    pub is_sliding: bool,
}

/// A cell in space to be drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SpatialChains {
    /// Above the picture.
    pub title: String,
    /// Periodicity vectors, m; the cell begins at the origin.
    pub cell: [[f64; 3]; 3],
    /// Mean radius of the grains, m.
    pub mean_radius: f64,
    /// Contacts.
    pub lines: Vec<SpatialLine>,
}

impl SpatialChains {
    /// The picture, a parallel projection with y upwards: contacts that bear the mean force or more, the nearest on top. All contacts of a
    /// dense cell would hide each other; those above the mean are the ones that carry the deviator (Radjai et al. 1998).
    pub fn to_svg(&self) -> String {
        let mean = self.lines.iter().map(|line| line.force.abs()).sum::<f64>() / self.lines.len().max(1) as f64;
        let mut strong: Vec<(f64, &SpatialLine)> = self
            .lines
            .iter()
            .filter(|line| line.force.abs() >= mean * (1.0 - ROUNDING))
            .map(|line| (seen(line.from)[2] + seen(line.to)[2], line))
            .collect();
        strong.sort_by(|one, other| one.0.total_cmp(&other.0));
        let flat = |line: &SpatialLine| ForceLine {
            from: plane(line.from),
            to: plane(line.to),
            force: line.force,
            is_sliding: line.is_sliding,
        };
        let corner = |number: usize| -> [f64; 2] {
            plane([0, 1, 2].map(|axis| {
                (0..3).filter(|vector| number >> vector & 1 == 1).map(|vector| self.cell[vector][axis]).sum()
            }))
        };
        let edges = (0..8).flat_map(|number| {
            (0..3).filter(move |vector| number >> vector & 1 == 0).map(move |vector| [number, number | 1 << vector])
        });
        let chains = ForceChains {
            title: self.title.clone(),
            lines: strong.into_iter().map(|(_, line)| flat(line)).collect(),
            ..ForceChains::default()
        };
        chains.in_box(self.mean_radius, &edges.map(|ends| ends.map(corner)).collect::<Vec<_>>())
    }
}

/// Coordinates to the right, upwards and towards the eye.
fn seen([x, y, z]: [f64; 3]) -> [f64; 3] {
    let ((sin, cos), (rise, level)) = (TURN.to_radians().sin_cos(), HEIGHT.to_radians().sin_cos());
    let (right, depth) = (cos * x - sin * z, sin * x + cos * z);
    [right, level * y - rise * depth, rise * y + level * depth]
}

fn plane(place: [f64; 3]) -> [f64; 2] {
    let [right, up, _] = seen(place);
    [right, up]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_projection_keeps_lengths_of_space_and_y_upright() {
        for place in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.3, -0.4, 1.2]] {
            let length = |vector: [f64; 3]| vector.iter().map(|part| part * part).sum::<f64>().sqrt();
            assert!((length(seen(place)) - length(place)).abs() < 1e-15);
        }
        let [right, up] = plane([0.0, 1.0, 0.0]);
        assert!(right == 0.0 && (up - HEIGHT.to_radians().cos()).abs() < 1e-15);
        assert!(seen([0.0, 0.0, 1.0])[2] > 0.0, "z comes towards the eye");
    }

    #[test]
    fn contacts_above_the_mean_force_are_drawn_in_their_box() {
        let line = |z: f64, force| SpatialLine { from: [0.2, 0.5, z], to: [0.8, 0.5, z], force, is_sliding: false };
        let chains = SpatialChains {
            title: "cell".into(),
            cell: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            mean_radius: 0.1,
            lines: vec![line(0.9, 8.0), line(0.1, 4.0), line(0.5, 1.0), line(0.5, 0.5), line(0.5, 0.5)],
        };
        let text = chains.to_svg();
        // Twelve edges, and two of the five contacts are above the mean of 2.8; the farther one comes first.
        assert_eq!(text.matches("<line").count(), 12 + 2, "{text}");
        let widths: Vec<&str> = text.lines().filter(|line| line.contains("#14508c")).collect();
        let width = |line: &str| -> f64 {
            line.split("stroke-width=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap()
        };
        assert!((width(widths[1]) / width(widths[0]) - 2.0).abs() < 0.01, "{widths:?}");
        // No force is above the mean of equal ones.
        let equal =
            SpatialChains { lines: (0..10).map(|place| line(0.1 * f64::from(place), 1.0)).collect(), ..chains };
        assert_eq!(equal.to_svg().matches("<line").count(), 12 + 10);
        assert!(!SpatialChains::default().to_svg().contains("NaN"));
    }
}
