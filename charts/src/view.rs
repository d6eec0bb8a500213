//! From metres to pixels: the frame that all pictures of grains share.

use crate::svg::Svg;

/// Longer side of the drawing, px.
const SIDE: f64 = 720.0;

/// Sizes of the letters of title and legend, px.
const LETTERS: [u32; 2] = [18, 13];

/// Width of a letter over its size, at most on average.
const LETTER: f64 = 0.56;

/// Margin around it, px; the title stands in the upper one.
const MARGIN: f64 = 40.0;

/// Where things of the plane lie in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct View {
    left: f64,
    low: f64,
    /// Pixels per metre.
    scale: f64,
    /// Width and height, px.
    size: [f64; 2],
}

impl View {
    /// A view of these grains and corners, m.
    pub(crate) fn of(grains: &[([f64; 2], f64)], corners: &[[f64; 2]]) -> Self {
        let extent = |axis: usize| {
            let grains = grains.iter().flat_map(|(centre, radius)| [centre[axis] - radius, centre[axis] + radius]);
            let all = corners.iter().map(|corner| corner[axis]).chain(grains);
            all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
        };
        let [[left, right], [low, high]] = [extent(0), extent(1)];
        let longest = (right - left).max(high - low);
        let scale = if longest > 0.0 { SIDE / longest } else { 1.0 };
        let size = [right - left, high - low].map(|length| if length > 0.0 { length * scale } else { SIDE });
        Self { left, low, scale, size }
    }

    /// An empty picture of this size, wide enough for the words at a narrow body as well.
    pub(crate) fn picture(&self, title: &str, legend: &str) -> Svg {
        let of_words = |(words, size): (&str, u32)| LETTER * f64::from(size) * words.chars().count() as f64;
        let words = [title, legend].into_iter().zip(LETTERS).map(of_words).fold(0.0, f64::max);
        Svg::new(self.size[0].max(words) + 2.0 * MARGIN, self.size[1] + 2.5 * MARGIN)
    }

    /// A place in pixels.
    pub(crate) fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [MARGIN + (x - self.left) * self.scale, MARGIN + (y - self.low) * self.scale]
    }

    /// A length in pixels.
    pub(crate) fn length(&self, length: f64) -> f64 {
        length * self.scale
    }

    /// The border of the cell or body.
    pub(crate) fn outline(&self, svg: &mut Svg, corners: &[[f64; 2]]) {
        let corners: Vec<[f64; 2]> = corners.iter().map(|corner| self.place(*corner)).collect();
        svg.polygon(&corners, "fill=\"none\" stroke=\"black\" stroke-width=\"1\" stroke-dasharray=\"6 4\"");
    }

    /// Title above and legend below the drawing, on white bands: lines to images of grains reach into the margins.
    pub(crate) fn words(&self, svg: &mut Svg, title: &str, legend: &str) {
        let height = self.size[1] + 2.5 * MARGIN;
        svg.band(height - 0.9 * MARGIN, height);
        svg.band(0.0, 0.75 * MARGIN);
        svg.words([MARGIN, self.size[1] + 1.9 * MARGIN], LETTERS[0], "start", title);
        svg.words([MARGIN, 0.35 * MARGIN], LETTERS[1], "start", legend);
    }
}
