//! Grains in the plane, coloured by a number each that has a sign: rotations.

use crate::number::short;
use crate::svg::Svg;
use crate::view::View;

/// Colours of the largest negative, of no and of the largest positive value.
const COLOURS: [[f64; 3]; 3] = [[33.0, 102.0, 172.0], [247.0, 247.0, 247.0], [178.0, 24.0, 43.0]];

/// Grains to be drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GrainMap {
    /// Above the picture.
    pub title: String,
    /// What the colours are.
    pub quantity: String,
    /// Its unit.
    pub unit: String,
    /// Corners of the cell or body in order, m.
    pub outline: Vec<[f64; 2]>,
    /// Centres and radii of the grains, m.
    pub grains: Vec<([f64; 2], f64)>,
    /// Value of each grain; one that is not finite is drawn without colour.
    pub values: Vec<f64>,
}

impl GrainMap {
    /// The picture: blue is negative, red positive, the strongest colour the largest value of either sign.
    pub fn to_svg(&self) -> String {
        let view = View::of(&self.grains, &self.outline);
        let largest =
            self.values.iter().filter(|value| value.is_finite()).fold(0.0, |most: f64, value| most.max(value.abs()));
        let legend =
            format!("{}; blue -{}, white 0, red {} {}", self.quantity, short(largest), short(largest), self.unit);
        let mut svg = view.picture(&self.title, &legend);
        for (&(centre, radius), value) in self.grains.iter().zip(&self.values) {
            disc(&mut svg, &view, centre, radius, value / if largest > 0.0 { largest } else { 1.0 });
        }
        view.outline(&mut svg, &self.outline);
        view.words(&mut svg, &self.title, &legend);
        svg.finish()
    }
}

/// A grain whose value is this share of the largest one.
fn disc(svg: &mut Svg, view: &View, centre: [f64; 2], radius: f64, share: f64) {
    let fill = if share.is_finite() { colour(share) } else { "none".to_owned() };
    let style = format!("fill=\"{fill}\" stroke=\"#b0b0b0\" stroke-width=\"0.5\"");
    svg.circle(view.place(centre), view.length(radius), &style);
}

/// The colour of a share between -1 and 1.
fn colour(share: f64) -> String {
    let end = if share < 0.0 { COLOURS[0] } else { COLOURS[2] };
    let weight = share.abs().min(1.0);
    let part = |index: usize| COLOURS[1][index] * (1.0 - weight) + end[index] * weight;
    format!("rgb({:.0},{:.0},{:.0})", part(0), part(1), part(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_value_of_either_sign_has_the_strongest_colour() {
        let map = GrainMap {
            title: "a < b".into(),
            quantity: "rotation".into(),
            unit: "rad".into(),
            outline: vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
            grains: vec![([0.2, 0.5], 0.05), ([0.4, 0.5], 0.05), ([0.6, 0.5], 0.05), ([0.8, 0.5], 0.05)],
            values: vec![-0.2, 0.0, 0.1, f64::NAN],
        };
        let text = map.to_svg();
        // Half of the largest value lies half way from white to red.
        for expected in
            ["rgb(33,102,172)", "rgb(247,247,247)", "rgb(212,136,145)", "fill=\"none\" stroke=\"#b0b0b0\""]
        {
            assert_eq!(text.matches(expected).count(), 1, "{expected}: {text}");
        }
        assert!(text.contains("blue -0.2000, white 0, red 0.2000 rad") && text.contains("a &lt; b"), "{text}");
        for still in [GrainMap::default().to_svg(), GrainMap { values: vec![0.0; 4], ..map }.to_svg()] {
            assert!(!still.contains("NaN") && !still.contains("inf"), "{still}");
        }
    }
}
