//! A cell of discs with its contact forces: lines between centres, as wide as the force is large.

use crate::number::short;
use crate::svg::Svg;

/// Longer side of the drawing, px.
const SIDE: f64 = 720.0;

/// Margin around it, px; the title stands in the upper one.
const MARGIN: f64 = 40.0;

/// Width of the line of the largest force over the mean radius of the grains.
const WIDEST: f64 = 0.8;

/// A contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceLine {
    /// Centre of one grain, m.
    pub from: [f64; 2],
    /// Centre of the other one, m; outside the cell if it is an image.
    pub to: [f64; 2],
    /// Force, N; negative numbers are drawn by their size in another colour (attraction).
    pub force: f64,
    /// Whether the contact slides.
    pub is_sliding: bool,
}

/// A cell to be drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ForceChains {
    /// Above the picture.
    pub title: String,
    /// Corners of the cell in order, m.
    pub outline: Vec<[f64; 2]>,
    /// Centres and radii of the grains, m.
    pub grains: Vec<([f64; 2], f64)>,
    /// Contacts.
    pub lines: Vec<ForceLine>,
}

impl ForceChains {
    /// The picture: blue lines press, red ones attract, orange ones slide.
    pub fn to_svg(&self) -> String {
        let extent = |axis: usize| {
            let grains =
                self.grains.iter().flat_map(|(centre, radius)| [centre[axis] - radius, centre[axis] + radius]);
            let all = self.outline.iter().map(|corner| corner[axis]).chain(grains);
            all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
        };
        let [[left, right], [low, high]] = [extent(0), extent(1)];
        let longest = (right - left).max(high - low);
        let scale = if longest > 0.0 { SIDE / longest } else { 1.0 };
        let size = [right - left, high - low].map(|length| if length > 0.0 { length * scale } else { SIDE });
        let place = |[x, y]: [f64; 2]| [MARGIN + (x - left) * scale, MARGIN + (y - low) * scale];
        let mut svg = Svg::new(size[0] + 2.0 * MARGIN, size[1] + 2.5 * MARGIN);
        for &(centre, radius) in &self.grains {
            svg.circle(place(centre), radius * scale, "fill=\"#f2f2f2\" stroke=\"#b0b0b0\" stroke-width=\"0.5\"");
        }
        let corners: Vec<[f64; 2]> = self.outline.iter().copied().map(place).collect();
        svg.polygon(&corners, "fill=\"none\" stroke=\"black\" stroke-width=\"1\" stroke-dasharray=\"6 4\"");
        let largest = self.lines.iter().fold(0.0, |largest: f64, line| largest.max(line.force.abs()));
        let mean_radius = self.grains.iter().map(|(_, radius)| radius).sum::<f64>() / self.grains.len().max(1) as f64;
        for line in self.lines.iter().filter(|line| line.force != 0.0) {
            let colour = match (line.force < 0.0, line.is_sliding) {
                (true, _) => "#c8142d",
                (false, true) => "#e18c00",
                (false, false) => "#14508c",
            };
            let width = WIDEST * mean_radius * scale * line.force.abs() / largest;
            let style = format!("stroke=\"{colour}\" stroke-linecap=\"round\"");
            svg.line(place(line.from), place(line.to), width, &style);
        }
        let legend = format!("widest line {} N; blue: at rest, orange: sliding, red: attraction", short(largest));
        svg.words([MARGIN, size[1] + 1.9 * MARGIN], 18, "start", &self.title);
        svg.words([MARGIN, 0.35 * MARGIN], 13, "start", &legend);
        svg.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_width_of_a_line_is_the_force() {
        let line = |force, is_sliding| ForceLine { from: [0.25, 0.5], to: [0.75, 0.5], force, is_sliding };
        let chains = ForceChains {
            title: "a < b".to_owned(),
            outline: vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
            grains: vec![([0.25, 0.5], 0.25), ([0.75, 0.5], 0.25)],
            lines: vec![line(4.0, false), line(1.0, true), line(-2.0, false), line(0.0, false)],
        };
        let text = chains.to_svg();
        // 0.8 x 0.25 x 720 px for the largest, in proportion for the others, nothing for a contact without force.
        for part in ["stroke-width=\"144.00\" stroke=\"#14508c\"", "stroke-width=\"36.00\" stroke=\"#e18c00\""] {
            assert!(text.contains(part), "{part}: {text}");
        }
        assert!(text.contains("stroke-width=\"72.00\" stroke=\"#c8142d\""));
        assert_eq!((text.matches("<line").count(), text.matches("<circle").count()), (3, 2));
        assert!(text.contains("a &lt; b") && text.contains("widest line 4.000 N"));
        assert!(!ForceChains::default().to_svg().contains("NaN"));
    }
}
