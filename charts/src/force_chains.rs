//! A cell of discs with its contact forces: lines between centres, as wide as the force is large.

use crate::number::short;
use crate::svg::Svg;
use crate::view::View;

/// Width of the line of the largest force over the mean radius of the grains.
const WIDEST: f64 = 0.8;

/// What the colours of lines mean.
const COLOURS: &str = "blue: at rest, orange: sliding, red: attraction";

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
        let view = View::of(&self.grains, &self.outline);
        let legend = format!("widest line {} N; {COLOURS}", short(self.largest()));
        let mut svg = view.picture(&self.title, &legend);
        for &(centre, radius) in &self.grains {
            let style = "fill=\"#f2f2f2\" stroke=\"#b0b0b0\" stroke-width=\"0.5\"";
            svg.circle(view.place(centre), view.length(radius), style);
        }
        view.outline(&mut svg, &self.outline);
        let mean_radius = self.grains.iter().map(|(_, radius)| radius).sum::<f64>() / self.grains.len().max(1) as f64;
        self.draw_lines(&mut svg, &view, mean_radius);
        view.words(&mut svg, &self.title, &legend);
        svg.finish()
    }

    /// The same for the projection of a box in space whose edges are given, without grains.
    pub(crate) fn in_box(&self, mean_radius: f64, edges: &[[[f64; 2]; 2]]) -> String {
        let corners = edges.iter().flatten().copied();
        let ends = self.lines.iter().flat_map(|line| [line.from, line.to]);
        let view = View::of(&[], &corners.chain(ends).collect::<Vec<_>>());
        let legend = format!("contacts from the mean force on, widest line {} N; {COLOURS}", short(self.largest()));
        let mut svg = view.picture(&self.title, &legend);
        for [from, to] in edges {
            let style = "stroke=\"black\" stroke-dasharray=\"6 4\"";
            svg.line(view.place(*from), view.place(*to), 1.0, style);
        }
        self.draw_lines(&mut svg, &view, mean_radius);
        view.words(&mut svg, &self.title, &legend);
        svg.finish()
    }

    /// The largest force, N.
    fn largest(&self) -> f64 {
        self.lines.iter().fold(0.0, |largest: f64, line| largest.max(line.force.abs()))
    }

    fn draw_lines(&self, svg: &mut Svg, view: &View, mean_radius: f64) {
        let largest = self.largest();
        for line in self.lines.iter().filter(|line| line.force != 0.0) {
            let colour = match (line.force < 0.0, line.is_sliding) {
                (true, _) => "#c8142d",
                (false, true) => "#e18c00",
                (false, false) => "#14508c",
            };
            let width = WIDEST * view.length(mean_radius) * line.force.abs() / largest;
            let style = format!("stroke=\"{colour}\" stroke-linecap=\"round\"");
            svg.line(view.place(line.from), view.place(line.to), width, &style);
        }
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

    /// At a column of grains the end of the legend lay outside the picture.
    #[test]
    fn the_picture_of_a_narrow_body_is_wide_enough_for_its_legend() {
        let width = |right: f64| -> f64 {
            let outline = vec![[0.0, 0.0], [right, 0.0], [right, 1.0], [0.0, 1.0]];
            let text = ForceChains { title: "column".to_owned(), outline, ..ForceChains::default() }.to_svg();
            text.split("width=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap()
        };
        // 720 px and the margins; the legend of 64 letters of 13 px takes about 7 px a letter.
        assert_eq!(width(1.0), 800.0);
        assert!(width(0.1) > 80.0 + 64.0 * 6.0 && width(0.1) < 800.0, "{}", width(0.1));
    }
}
