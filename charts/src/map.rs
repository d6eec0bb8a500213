//! A quantity on several meshes of quadrilaterals, side by side with one scale of colours.

use crate::number::short;
use crate::svg::Svg;

/// Height of the tallest mesh, px.
const TALLEST: f64 = 420.0;

/// Margin around the meshes, and between them, px.
const MARGIN: f64 = 36.0;

/// Height of the line of words above the meshes, and of the scale of colours below, px.
const WORDS: f64 = 30.0;

/// Steps of the scale of colours.
pub(crate) const STEPS: usize = 24;

/// Colours from the smallest to the largest value, evenly spaced: lighter is larger, on paper too.
const COLOURS: [[f64; 3]; 5] =
    [[68.0, 1.0, 84.0], [59.0, 82.0, 139.0], [33.0, 145.0, 140.0], [94.0, 201.0, 98.0], [253.0, 231.0, 37.0]];

/// An element: its corners in order, m, and its value.
pub type Patch = ([[f64; 2]; 4], f64);

/// One mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Panel {
    /// Above the mesh.
    pub name: String,
    /// Its elements.
    pub patches: Vec<Patch>,
}

/// Meshes to be drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Map {
    /// Above the picture.
    pub title: String,
    /// Quantity and unit, next to the scale of colours.
    pub quantity: String,
    /// The meshes, from left to right.
    pub panels: Vec<Panel>,
}

impl Map {
    /// The picture. A patch without a finite value is white.
    pub fn to_svg(&self) -> String {
        let values = self.panels.iter().flat_map(|panel| panel.patches.iter().map(|patch| patch.1));
        let [least, most] = extent(values.filter(|value| value.is_finite()));
        let boxes: Vec<[[f64; 2]; 2]> = self.panels.iter().map(Panel::extent).collect();
        let tallest = boxes.iter().map(|[_, [low, high]]| high - low).fold(0.0, f64::max);
        let scale = if tallest > 0.0 { TALLEST / tallest } else { 1.0 };
        let width = boxes.iter().map(|[[left, right], _]| (right - left) * scale + MARGIN).sum::<f64>() + MARGIN;
        let width = width.max(400.0);
        let foot = 2.0 * WORDS + 0.5 * MARGIN;
        let mut svg = Svg::new(width, TALLEST + foot + 2.5 * WORDS);
        svg.words([MARGIN, TALLEST + foot + 1.5 * WORDS], 18, "start", &self.title);
        let mut begin = MARGIN;
        for (panel, [[left, right], [low, _]]) in self.panels.iter().zip(&boxes) {
            let place = |[x, y]: [f64; 2]| [begin + (x - left) * scale, foot + (y - low) * scale];
            for (corners, value) in &panel.patches {
                let colour = if value.is_finite() { colour((value - least) / (most - least)) } else { "#fff".into() };
                let style = format!("fill=\"{colour}\" stroke=\"black\" stroke-width=\"0.4\"");
                svg.polygon(&corners.map(place), &style);
            }
            let middle = begin + 0.5 * (right - left) * scale;
            svg.words([middle, TALLEST + foot + 0.4 * WORDS], 14, "middle", &panel.name);
            begin += (right - left) * scale + MARGIN;
        }
        colour_scale(&mut svg, MARGIN, width - MARGIN, WORDS, 0.5 * WORDS);
        if least <= most {
            svg.words([MARGIN, 0.4 * WORDS], 13, "start", &short(least));
            svg.words([width - MARGIN, 0.4 * WORDS], 13, "end", &short(most));
        }
        svg.words([0.5 * width, 0.4 * WORDS], 13, "middle", &self.quantity);
        svg.finish()
    }
}

impl Panel {
    /// Smallest and largest coordinate along each axis.
    fn extent(&self) -> [[f64; 2]; 2] {
        [0, 1].map(|axis| {
            let all = extent(self.patches.iter().flat_map(|patch| patch.0.iter().map(move |corner| corner[axis])));
            if all[0] <= all[1] { all } else { [0.0, 0.0] }
        })
    }
}

fn extent(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
}

/// The scale of colours as a strip from `left` to `right`, with its lower side at `low`, px.
pub(crate) fn colour_scale(svg: &mut Svg, left: f64, right: f64, low: f64, height: f64) {
    let step = (right - left) / STEPS as f64;
    for index in 0..STEPS {
        let (from, to) = (left + index as f64 * step, left + (index + 1) as f64 * step);
        let corners = [[from, low], [to, low], [to, low + height], [from, low + height]];
        let style = format!("fill=\"{}\" stroke=\"none\"", colour((index as f64 + 0.5) / STEPS as f64));
        svg.polygon(&corners, &style);
    }
}

/// The colour at a share of the scale; the middle one where all values are equal.
pub(crate) fn colour(share: f64) -> String {
    let place = if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.5 } * (COLOURS.len() - 1) as f64;
    let from = (place.floor() as usize).min(COLOURS.len() - 2);
    let weight = place - from as f64;
    let part = |index: usize| COLOURS[from][index] * (1.0 - weight) + COLOURS[from + 1][index] * weight;
    format!("rgb({:.0},{:.0},{:.0})", part(0), part(1), part(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meshes_share_one_scale_of_colours() {
        let patch = |x: f64, value: f64| ([[x, 0.0], [x + 1.0, 0.0], [x + 1.0, 2.0], [x, 2.0]], value);
        let panel = |name: &str, values: [f64; 2]| Panel {
            name: name.to_owned(),
            patches: vec![patch(0.0, values[0]), patch(1.0, values[1])],
        };
        let map = Map {
            title: "a < b".to_owned(),
            quantity: "strain".to_owned(),
            panels: vec![panel("coarse", [0.0, 0.5]), panel("fine", [1.0, f64::NAN])],
        };
        let text = map.to_svg();
        for part in
            ["rgb(68,1,84)", "rgb(33,145,140)", "rgb(253,231,37)", "#fff", "a &lt; b", "coarse", "fine", "strain"]
        {
            assert!(text.contains(part), "{part}: {text}");
        }
        assert_eq!(text.matches("<polygon").count(), 4 + STEPS);
        assert!(!text.contains("NaN"));
        assert!(!Map::default().to_svg().contains("NaN") && !Map::default().to_svg().contains("inf"));
    }
}
