//! Curves of a study as one SVG picture.

use crate::ChartError;
use crate::number::{logarithmic_ticks, tick, tick_within};
use plotters::coord::Shift;
use plotters::coord::combinators::{BindKeyPoints, LogCoord, WithKeyPoints};
use plotters::coord::ranged1d::{AsRangedCoord, Ranged, ValueFormatter};
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use std::ops::Range;

/// Width and height of the picture, px.
const SIZE: (u32, u32) = (760, 500);

/// Colours that are told apart on paper and by most eyes.
const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 90, 160),
    RGBColor(210, 90, 0),
    RGBColor(0, 130, 80),
    RGBColor(170, 30, 110),
    RGBColor(90, 90, 90),
    RGBColor(120, 80, 200),
    RGBColor(150, 120, 0),
    RGBColor(0, 150, 190),
];

type DrawingError = DrawingAreaErrorKind<std::io::Error>;

/// Whether equal distances on an axis are equal differences or equal ratios.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Equal differences.
    Linear,
    /// Equal ratios; points that are not positive are left out.
    Logarithmic,
}

/// How the points of a curve are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Style {
    /// Joined, each with a dot as long as dots can be told apart.
    Joined,
    /// Black crosses.
    Published,
    /// A thin dashed black line.
    Reference,
}

/// Most points of a curve that get dots.
const MOST_DOTS: usize = 60;

/// Lengths of dash and gap of curves whose colours were all taken once, twice, three times, px. All fit into the sample of the legend.
const DASHES_OF_ROUNDS: [(u32, u32); 3] = [(8, 4), (2, 3), (3, 7)];

/// Lengths of dash and gap of the references, one after the other, px.
const DASHES: [(u32, u32); 3] = [(6, 4), (2, 3), (14, 4)];

#[derive(Clone, Debug)]
struct Curve {
    name: String,
    points: Vec<[f64; 2]>,
    style: Style,
    /// Lower and upper edge of a band over x.
    band: Vec<[f64; 3]>,
}

/// Named curves over two axes.
#[derive(Clone, Debug)]
pub struct Chart {
    title: String,
    axes: [(String, Scale); 2],
    curves: Vec<Curve>,
}

impl Chart {
    /// An empty chart; axes are named with their units.
    pub fn new(title: &str, x: (&str, Scale), y: (&str, Scale)) -> Self {
        Self {
            title: title.to_owned(),
            axes: [x, y].map(|(name, scale)| (name.to_owned(), scale)),
            curves: Vec::new(),
        }
    }

    /// Adds a curve; points that cannot be drawn are left out.
    pub fn curve(&mut self, name: &str, points: impl IntoIterator<Item = [f64; 2]>) {
        self.add(name, points, Style::Joined);
    }

    /// Adds points of another source, as black crosses that no line joins.
    pub fn published(&mut self, name: &str, points: impl IntoIterator<Item = [f64; 2]>) {
        self.add(name, points, Style::Published);
    }

    /// Adds a curve to compare with, such as a level or a closed form, as a thin dashed line.
    pub fn reference(&mut self, name: &str, points: impl IntoIterator<Item = [f64; 2]>) {
        self.add(name, points, Style::Reference);
    }

    fn add(&mut self, name: &str, points: impl IntoIterator<Item = [f64; 2]>, style: Style) {
        let drawable = |point: &[f64; 2]| {
            point
                .iter()
                .zip(&self.axes)
                .all(|(value, (_, scale))| value.is_finite() && (*scale == Scale::Linear || *value > 0.0))
        };
        let points = points.into_iter().filter(drawable).collect();
        self.curves.push(Curve { name: name.to_owned(), points, style, band: Vec::new() });
    }

    /// Gives the curve that was added last a band in its colour: places along the x axis, each with the lower and the upper edge there. Places
    /// that cannot be drawn are left out.
    pub fn band(&mut self, edges: impl IntoIterator<Item = [f64; 3]>) {
        let is_drawable =
            |value: f64, axis: usize| value.is_finite() && (self.axes[axis].1 == Scale::Linear || value > 0.0);
        let band = edges
            .into_iter()
            .filter(|[x, low, high]| is_drawable(*x, 0) && is_drawable(*low, 1) && is_drawable(*high, 1))
            .collect();
        if let Some(curve) = self.curves.last_mut() {
            curve.band = band;
        }
    }

    /// The picture.
    ///
    /// # Errors
    /// The drawing library refuses.
    pub fn to_svg(&self) -> Result<String, ChartError> {
        let mut text = String::new();
        let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let [(_, across), (_, up)] = &self.axes;
        let (x, y) = (self.range(0), self.range(1));
        match (across, up) {
            (Scale::Linear, Scale::Linear) => self.draw(&area, x, y)?,
            (Scale::Linear, Scale::Logarithmic) => self.draw(&area, x, logarithmic(y))?,
            (Scale::Logarithmic, Scale::Linear) => self.draw(&area, logarithmic(x), y)?,
            (Scale::Logarithmic, Scale::Logarithmic) => self.draw(&area, logarithmic(x), logarithmic(y))?,
        }
        area.present()?;
        drop(area);
        Ok(text)
    }

    /// The smallest range with a margin that holds all points of one axis.
    fn range(&self, axis: usize) -> Range<f64> {
        let of_curve = |curve: &Curve| {
            let edges = curve.band.iter().flat_map(|[x, low, high]| [[*x, *low], [*x, *high]]);
            curve.points.iter().copied().chain(edges).map(|point| point[axis]).collect::<Vec<_>>()
        };
        let values = self.curves.iter().flat_map(of_curve);
        let (low, high) =
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        match self.axes[axis].1 {
            _ if low > high => 1.0..2.0,
            Scale::Linear => {
                let margin = if high > low { 0.05 * (high - low) } else { 0.5 * high.abs().max(1.0) };
                // A quantity that is never negative gets no negative ticks.
                let floor = if low >= 0.0 && low < 3.0 * margin { 0.0 } else { low - margin };
                floor..high + margin
            }
            Scale::Logarithmic => low / 1.3..high * 1.3,
        }
    }

    /// What stands at a mark of an axis.
    fn label(&self, axis: usize, value: f64) -> String {
        let range = self.range(axis);
        match self.axes[axis].1 {
            Scale::Linear => tick_within(value, range.end - range.start),
            Scale::Logarithmic => tick(value),
        }
    }

    /// The corner, upper ones first, where the names of the curves hide the fewest points and segments.
    fn emptiest_corner(&self) -> SeriesLabelPosition {
        let ranges = [self.range(0), self.range(1)];
        let share = |axis: usize, value: f64| {
            let (range, scale) = (&ranges[axis], self.axes[axis].1);
            let place = |value: f64| if scale == Scale::Logarithmic { value.ln() } else { value };
            (place(value) - place(range.start)) / (place(range.end) - place(range.start))
        };
        let ends = |points: &[[f64; 2]]| points.iter().map(|p| [share(0, p[0]), share(1, p[1])]).collect::<Vec<_>>();
        let mut places = Vec::new();
        for points in self.curves.iter().map(|curve| ends(&curve.points)) {
            places.extend(points.first().copied());
            for pair in points.windows(2) {
                places.extend((1..=10).map(|part| {
                    let weight = f64::from(part) / 10.0;
                    std::array::from_fn(|axis| pair[0][axis] + weight * (pair[1][axis] - pair[0][axis]))
                }));
            }
        }
        let longest = self.curves.iter().map(|curve| curve.name.chars().count()).max().unwrap_or(0) as f64;
        // As shares of the plot: seven pixels a letter, and the sample of the line.
        let (width, height) = ((0.06 + 0.0105 * longest).min(0.95), 0.1 + 0.045 * self.curves.len() as f64);
        let hidden = |right: bool, upper: bool| {
            let inside = |place: &&[f64; 2]| {
                (if right { place[0] > 1.0 - width } else { place[0] < width })
                    && (if upper { place[1] > 1.0 - height } else { place[1] < height })
            };
            places.iter().filter(inside).count()
        };
        let corners = [
            (SeriesLabelPosition::UpperRight, hidden(true, true)),
            (SeriesLabelPosition::UpperLeft, hidden(false, true)),
            (SeriesLabelPosition::LowerLeft, hidden(false, false)),
            (SeriesLabelPosition::LowerRight, hidden(true, false)),
        ];
        corners
            .into_iter()
            .min_by_key(|(_, hidden)| *hidden)
            .map_or(SeriesLabelPosition::UpperRight, |(corner, _)| corner)
    }

    fn draw<X, Y>(&self, area: &DrawingArea<SVGBackend<'_>, Shift>, x: X, y: Y) -> Result<(), DrawingError>
    where
        X: AsRangedCoord<Value = f64>,
        Y: AsRangedCoord<Value = f64>,
        X::CoordDescType: ValueFormatter<f64> + Ranged<ValueType = f64>,
        Y::CoordDescType: ValueFormatter<f64> + Ranged<ValueType = f64>,
    {
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, ("sans-serif", 18))
            .margin(16)
            .x_label_area_size(44)
            .y_label_area_size(84)
            .build_cartesian_2d(x, y)?;
        chart
            .configure_mesh()
            .x_desc(&self.axes[0].0)
            .y_desc(&self.axes[1].0)
            .x_label_formatter(&|value| self.label(0, *value))
            .y_label_formatter(&|value| self.label(1, *value))
            .label_style(("sans-serif", 13))
            .axis_desc_style(("sans-serif", 15))
            .light_line_style(WHITE)
            .draw()?;
        // Below all curves.
        let joined_curves = self.curves.iter().filter(|curve| curve.style == Style::Joined);
        for (number, Curve { band, .. }) in joined_curves.enumerate().filter(|(_, curve)| !curve.band.is_empty()) {
            let (colour, _) = look(number);
            let upper = band.iter().map(|[x, _, high]| (*x, *high));
            let lower = band.iter().rev().map(|[x, low, _]| (*x, *low));
            chart.draw_series([Polygon::new(upper.chain(lower).collect::<Vec<_>>(), colour.mix(0.15))])?;
        }
        let mut joined = 0;
        let mut dashes = DASHES.into_iter().cycle();
        for Curve { name, points, style, .. } in &self.curves {
            let line = points.iter().map(|point| (point[0], point[1]));
            match style {
                Style::Joined => {
                    let (colour, dashes) = look(joined);
                    joined += 1;
                    match dashes {
                        None => chart
                            .draw_series(LineSeries::new(line.clone(), colour.stroke_width(2)))?
                            .label(name)
                            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2))),
                        Some((dash, gap)) => chart
                            .draw_series(DashedLineSeries::new(line.clone(), dash, gap, colour.stroke_width(2)))?
                            .label(name)
                            .legend(move |(x, y)| {
                                DashedPathElement::new([(x, y), (x + 18, y)], dash, gap, colour.stroke_width(2))
                            }),
                    };
                    if points.len() <= MOST_DOTS {
                        chart.draw_series(line.map(|point| Circle::new(point, 3, colour.filled())))?;
                    }
                }
                Style::Published => {
                    chart
                        .draw_series(line.map(|point| Cross::new(point, 6, BLACK.stroke_width(2))))?
                        .label(name)
                        .legend(move |(x, y)| Cross::new((x + 9, y), 6, BLACK.stroke_width(2)));
                }
                Style::Reference => {
                    let (dash, gap) = dashes.next().unwrap_or((6, 4));
                    let sample = i32::try_from(dash).unwrap_or(6);
                    chart
                        .draw_series(DashedLineSeries::new(line, dash, gap, BLACK.stroke_width(1)))?
                        .label(name)
                        .legend(move |(x, y)| PathElement::new([(x, y), (x + sample, y)], BLACK.stroke_width(1)));
                }
            }
        }
        chart
            .configure_series_labels()
            .position(self.emptiest_corner())
            .background_style(WHITE.mix(0.85))
            .border_style(BLACK.mix(0.3))
            .label_font(("sans-serif", 13))
            .draw()
    }
}

/// Colour of a curve, and dash and gap once all colours are taken: names in the legend would tell nothing apart.
fn look(number: usize) -> (RGBColor, Option<(u32, u32)>) {
    let dashes =
        (number / COLOURS.len()).checked_sub(1).map(|round| DASHES_OF_ROUNDS[round % DASHES_OF_ROUNDS.len()]);
    (COLOURS[number % COLOURS.len()], dashes)
}

/// A logarithmic axis with marks wherever it begins; those of the library begin with the first power of ten.
fn logarithmic(range: Range<f64>) -> WithKeyPoints<LogCoord<f64>> {
    let marks = logarithmic_ticks(&range);
    range.log_scale().with_key_points(marks)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chart_names_its_axes_and_curves_and_leaves_out_what_cannot_be_drawn() {
        for scale in [Scale::Linear, Scale::Logarithmic] {
            let mut chart = Chart::new("cost", ("payload, B", scale), ("time, us", Scale::Logarithmic));
            chart.curve("spin", [[64.0, 2.0], [1e6, f64::NAN], [1e6, 200.0], [2.0, -1.0]]);
            chart.curve("empty", []);
            chart.published("theirs", [[1e2, 3.0]]);
            chart.reference("law", [[64.0, 2.0], [1e6, 200.0]]);
            let text = chart.to_svg().unwrap();
            for part in ["<svg", "cost", "payload, B", "time, us", "spin", "theirs", "law", "<polyline", "</svg>"] {
                assert!(text.contains(part), "{part} is missing");
            }
            assert!(!text.contains("NaN"));
        }
        assert!(Chart::new("nothing", ("x", Scale::Linear), ("y", Scale::Linear)).to_svg().is_ok());
    }

    #[test]
    fn a_band_is_drawn_in_the_colour_of_its_curve_and_widens_the_axis() {
        let mut chart = Chart::new("", ("x", Scale::Linear), ("y", Scale::Linear));
        chart.curve("a", [[0.0, 1.0], [1.0, 1.0]]);
        chart.band([[0.0, 0.5, 1.5], [1.0, f64::NAN, 2.0], [1.0, 0.0, 2.0]]);
        assert!(chart.range(1).end > 2.0);
        let text = chart.to_svg().unwrap();
        assert!(text.contains("<polygon") && !text.contains("NaN"), "{text}");
    }

    /// Grains from 200 to 400 had no number on their axis.
    #[test]
    fn a_logarithmic_axis_without_a_power_of_ten_has_numbers() {
        let mut chart = Chart::new("", ("grains", Scale::Logarithmic), ("scatter", Scale::Logarithmic));
        chart.curve("a", [[200.0, 0.02], [400.0, 0.06]]);
        let text = chart.to_svg().unwrap();
        for label in ["200", "300", "400", "0.02", "0.06"] {
            assert!(text.contains(&format!("\n{label}\n")), "{label} is missing");
        }
    }

    /// From the ninth on, curves had the look of those before.
    #[test]
    fn more_curves_than_colours_are_told_apart() {
        let looks: std::collections::BTreeSet<_> =
            (0..32).map(|number| (look(number).0.0, look(number).0.1, look(number).1)).collect();
        assert_eq!(looks.len(), 32);
        let strokes = |count: u32| {
            let mut chart = Chart::new("", ("x", Scale::Linear), ("y", Scale::Linear));
            for number in 0..count {
                let height = f64::from(number);
                chart.curve(&format!("curve {number}"), [[0.0, height], [1.0, height]]);
            }
            let text = chart.to_svg().unwrap();
            let elements = text.split("<polyline").skip(1).filter_map(|rest| rest.split('>').next());
            elements.filter(|element| element.contains("stroke=\"#005AA0\"")).count()
        };
        // The curve and its sample, one stroke each; those of the ninth curve are dashed.
        assert_eq!(strokes(8), 2);
        assert!(strokes(16) > 20, "{}", strokes(16));
    }

    #[test]
    fn names_stand_where_they_hide_least() {
        let corner = |points: [[f64; 2]; 2]| {
            let mut chart = Chart::new("", ("x", Scale::Logarithmic), ("y", Scale::Linear));
            chart.curve("a", points);
            format!("{:?}", chart.emptiest_corner())
        };
        assert_eq!(corner([[1.0, 1.0], [1e3, 0.0]]), "UpperRight");
        assert_eq!(corner([[1.0, 0.0], [1e3, 1.0]]), "UpperLeft");
    }
}
