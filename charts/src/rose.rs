//! Rose diagrams: a value for each range of directions, as sectors around a point.

use crate::number::tick;
use crate::svg::Svg;
use std::f64::consts::TAU;

/// Side of the picture, px.
const SIDE: f64 = 480.0;

/// Radius of the largest value, px.
const RADIUS: f64 = 180.0;

/// Straight pieces of the arc of a sector.
const PIECES: usize = 8;

/// A rose diagram of the full circle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rose {
    /// Above the picture.
    pub title: String,
    /// What the values are, with their unit.
    pub quantity: String,
    /// Values of sectors of equal angle, counter-clockwise from the x axis; those that are not positive are empty.
    pub values: Vec<f64>,
}

impl Rose {
    /// The picture; the dashed circle is the mean of the values.
    pub fn to_svg(&self) -> String {
        let mut svg = Svg::new(SIDE, SIDE);
        let middle = [0.5 * SIDE, 0.5 * SIDE - 10.0];
        let largest = self.values.iter().copied().fold(0.0, f64::max);
        let at = |angle: f64, radius: f64| [middle[0] + radius * angle.cos(), middle[1] + radius * angle.sin()];
        let each = TAU / self.values.len().max(1) as f64;
        svg.circle(middle, RADIUS, "fill=\"none\" stroke=\"#b0b0b0\" stroke-width=\"0.7\"");
        for (number, &value) in self.values.iter().enumerate().filter(|(_, value)| **value > 0.0) {
            let radius = RADIUS * value / largest;
            let begin = number as f64 * each;
            let arc = (0..=PIECES).map(|piece| at(begin + each * piece as f64 / PIECES as f64, radius));
            let corners: Vec<[f64; 2]> = std::iter::once(middle).chain(arc).collect();
            svg.polygon(&corners, "fill=\"#14508c\" fill-opacity=\"0.55\" stroke=\"#14508c\" stroke-width=\"0.7\"");
        }
        let mean = self.values.iter().sum::<f64>() / self.values.len().max(1) as f64;
        if largest > 0.0 && mean > 0.0 {
            let style = "fill=\"none\" stroke=\"black\" stroke-width=\"1\" stroke-dasharray=\"5 4\"";
            svg.circle(middle, RADIUS * mean / largest, style);
        }
        let axis = "stroke=\"#808080\"";
        svg.line(at(0.0, RADIUS + 12.0), at(0.5 * TAU, RADIUS + 12.0), 0.7, axis);
        svg.line(at(0.25 * TAU, RADIUS + 12.0), at(0.75 * TAU, RADIUS + 12.0), 0.7, axis);
        svg.words(at(0.0, RADIUS + 16.0), 13, "start", "x");
        svg.words(at(0.25 * TAU, RADIUS + 16.0), 13, "middle", "y");
        svg.words([0.5 * SIDE, SIDE - 24.0], 17, "middle", &self.title);
        let legend = format!("{}: outer circle {}, dashed mean {}", self.quantity, tick(largest), tick(mean));
        svg.words([0.5 * SIDE, 14.0], 13, "middle", &legend);
        svg.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sectors_are_as_long_as_their_values() {
        let rose = Rose { title: "normals".into(), quantity: "contacts".into(), values: vec![2.0, 1.0, 0.0, 1.0] };
        let text = rose.to_svg();
        assert_eq!(text.matches("<polygon").count(), 3, "an empty sector is not drawn");
        // The first sector begins on the x axis at the full radius, the second on the y axis at half of it.
        assert!(text.contains("points=\"240.00,250.00 420.00,250.00"), "{text}");
        assert!(text.contains("points=\"240.00,250.00 240.00,160.00"), "{text}");
        assert!(text.contains("r=\"90.00\"") && text.contains("outer circle 2, dashed mean 1"), "{text}");
        assert!(!Rose::default().to_svg().contains("NaN"));
    }
}
