//! Grains in the plane with an arrow each: displacement fluctuations.

use crate::number::short;
use crate::svg::Svg;
use crate::view::View;

/// Length of the longest arrow over the mean radius of the grains.
const LONGEST: f64 = 4.0;

/// Arrows that are shorter than this share of the mean radius are rounding and are not drawn.
const LEAST: f64 = 1e-9;

/// Length of the head of an arrow over that of the arrow, and half of its width.
const HEAD: [f64; 2] = [0.3, 0.12];

/// Grains to be drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Arrows {
    /// Above the picture.
    pub title: String,
    /// What the arrows are.
    pub quantity: String,
    /// Corners of the cell or body in order, m.
    pub outline: Vec<[f64; 2]>,
    /// Centres and radii of the grains, m.
    pub grains: Vec<([f64; 2], f64)>,
    /// Arrow of each grain, m, from its centre.
    pub arrows: Vec<[f64; 2]>,
}

impl Arrows {
    /// The picture. The longest arrow has four mean radii whatever its size, which the legend gives; grains without an arrow keep none, and so do
    /// those whose arrow is rounding.
    pub fn to_svg(&self) -> String {
        let view = View::of(&self.grains, &self.outline);
        let size = |arrow: &[f64; 2]| arrow[0].hypot(arrow[1]);
        let longest = self.arrows.iter().map(size).filter(|size| size.is_finite()).fold(0.0, f64::max);
        let mean_radius = self.grains.iter().map(|(_, radius)| radius).sum::<f64>() / self.grains.len().max(1) as f64;
        let of_radius = if mean_radius > 0.0 { longest / mean_radius } else { 0.0 };
        let legend =
            format!("{}; longest arrow {} m, {} mean radii", self.quantity, short(longest), short(of_radius));
        let mut svg = view.picture(&self.title, &legend);
        for &(centre, radius) in &self.grains {
            let style = "fill=\"#f2f2f2\" stroke=\"#b0b0b0\" stroke-width=\"0.5\"";
            svg.circle(view.place(centre), view.length(radius), style);
        }
        view.outline(&mut svg, &self.outline);
        let unit = LONGEST * view.length(mean_radius) / longest;
        for (&(centre, _), arrow) in self.grains.iter().zip(&self.arrows) {
            if size(arrow) > LEAST * mean_radius && size(arrow).is_finite() {
                draw(&mut svg, view.place(centre), arrow.map(|component| component * unit));
            }
        }
        view.words(&mut svg, &self.title, &legend);
        svg.finish()
    }
}

/// An arrow in pixels.
fn draw(svg: &mut Svg, from: [f64; 2], way: [f64; 2]) {
    let at = |along: f64, across: f64| {
        [from[0] + along * way[0] - across * way[1], from[1] + along * way[1] + across * way[0]]
    };
    svg.line(from, at(1.0 - HEAD[0], 0.0), 1.0, "stroke=\"#14508c\"");
    let corners = [at(1.0, 0.0), at(1.0 - HEAD[0], HEAD[1]), at(1.0 - HEAD[0], -HEAD[1])];
    svg.polygon(&corners, "fill=\"#14508c\"");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrows_are_as_long_as_their_vectors() {
        let arrows = Arrows {
            title: "a < b".into(),
            quantity: "fluctuation".into(),
            outline: vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
            grains: vec![([0.25, 0.5], 0.05), ([0.75, 0.5], 0.05), ([0.5, 0.5], 0.05)],
            arrows: vec![[1e-3, 0.0], [0.0, -5e-4], [0.0, 0.0]],
        };
        let text = arrows.to_svg();
        // The scale is 720 px for the side: 4 x 0.05 x 720 = 144 px for the longest, 72 px for the other one, which points down.
        assert!(text.contains("points=\"364.00,420.00 320.80,402.72 320.80,437.28\""), "{text}");
        assert!(text.contains("points=\"580.00,492.00 "), "{text}");
        assert_eq!((text.matches("<polygon").count(), text.matches("<circle").count()), (3, 3));
        assert!(text.contains("longest arrow 0.001000 m, 0.02000 mean radii") && text.contains("a &lt; b"), "{text}");
        for empty in [Arrows::default().to_svg(), Arrows { arrows: vec![[0.0; 2]; 3], ..arrows }.to_svg()] {
            assert!(!empty.contains("NaN") && !empty.contains("inf"), "{empty}");
        }
    }
}
