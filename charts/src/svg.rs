//! The few SVG elements that pictures of cells need, with coordinates in fractions of a pixel.

use std::fmt::Write as _;

/// An SVG picture under construction. The y axis points up: heights are turned where they are written.
pub(crate) struct Svg {
    text: String,
    height: f64,
}

impl Svg {
    /// A white picture of this width and height, px.
    pub(crate) fn new(width: f64, height: f64) -> Self {
        let text = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" viewBox=\"0 0 {width:.0} \
             {height:.0}\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
        );
        Self { text, height }
    }

    /// A circle; `style` are its attributes.
    pub(crate) fn circle(&mut self, [x, y]: [f64; 2], radius: f64, style: &str) {
        let y = self.height - y;
        self.push(format_args!("<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{radius:.2}\" {style}/>"));
    }

    /// A straight line of this width, px.
    pub(crate) fn line(&mut self, from: [f64; 2], to: [f64; 2], width: f64, style: &str) {
        let ([x1, y1], [x2, y2]) = (from, to);
        let (y1, y2) = (self.height - y1, self.height - y2);
        self.push(format_args!(
            "<line x1=\"{x1:.2}\" y1=\"{y1:.2}\" x2=\"{x2:.2}\" y2=\"{y2:.2}\" stroke-width=\"{width:.2}\" {style}/>"
        ));
    }

    /// A closed polygon.
    pub(crate) fn polygon(&mut self, corners: &[[f64; 2]], style: &str) {
        let places: Vec<String> = corners.iter().map(|[x, y]| format!("{x:.2},{:.2}", self.height - y)).collect();
        self.push(format_args!("<polygon points=\"{}\" {style}/>", places.join(" ")));
    }

    /// A white band over the whole width between two heights, px, that lets little of what is below it through.
    pub(crate) fn band(&mut self, low: f64, high: f64) {
        let (y, height) = (self.height - high, high - low);
        self.push(format_args!(
            "<rect y=\"{y:.2}\" width=\"100%\" height=\"{height:.2}\" fill=\"white\" fill-opacity=\"0.85\"/>"
        ));
    }

    /// Words around a place; `anchor` is `start`, `middle` or `end`.
    pub(crate) fn words(&mut self, [x, y]: [f64; 2], size: u32, anchor: &str, words: &str) {
        let y = self.height - y;
        let words = words.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
        self.push(format_args!(
            "<text x=\"{x:.2}\" y=\"{y:.2}\" font-family=\"sans-serif\" font-size=\"{size}\" text-anchor=\"{anchor}\">{words}</text>"
        ));
    }

    /// The finished text.
    pub(crate) fn finish(mut self) -> String {
        self.text.push_str("</svg>\n");
        self.text
    }

    fn push(&mut self, element: std::fmt::Arguments<'_>) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.text, "{element}");
    }
}
