//! One curve along the steps of a run, with the hard steps marked: `history.svg`.

use crate::ChartError;
use crate::number::tick_within;
use plotters::prelude::*;
use std::ops::Range;

/// Width and height of the picture, px.
const SIZE: (u32, u32) = (720, 480);

/// An accepted step in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathPoint {
    /// Values on the two axes.
    pub place: (f64, f64),
    /// Half the height of the band around the value, its estimated error; 0 draws none.
    pub error: f64,
    /// Whether the step was reached after cut-backs.
    pub cut_back: bool,
    /// Whether the step was reached by viscous stabilisation.
    pub stabilised: bool,
}

impl PathPoint {
    fn is_finite(&self) -> bool {
        [self.place.0, self.place.1, self.error].into_iter().all(f64::is_finite)
    }
}

/// Draws the points in order, joined by a line, and returns the SVG text. A point with a value that is not finite leaves a gap; `None` without
/// any other.
///
/// # Errors
/// The drawing library refuses.
pub fn path_svg([x, y]: [&str; 2], points: &[PathPoint]) -> Result<Option<String>, ChartError> {
    let pieces: Vec<&[PathPoint]> =
        points.split(|point| !point.is_finite()).filter(|piece| !piece.is_empty()).collect();
    let known = || pieces.iter().copied().flatten();
    let across = range(&known().map(|point| point.place.0).collect::<Vec<_>>());
    let edge = |side: f64| known().map(move |point| point.place.1 + side * point.error);
    let up = range(&edge(-1.0).chain(edge(1.0)).collect::<Vec<_>>());
    let (Some(across), Some(up)) = (across, up) else {
        return Ok(None);
    };
    let mut text = String::new();
    draw(&mut text, [x, y], [across, up], &pieces)?;
    Ok(Some(text))
}

fn draw(
    text: &mut String,
    [x, y]: [&str; 2],
    [across, up]: [Range<f64>; 2],
    pieces: &[&[PathPoint]],
) -> Result<(), DrawingAreaErrorKind<std::io::Error>> {
    let area = SVGBackend::with_string(text, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .margin(16)
        .x_label_area_size(44)
        .y_label_area_size(84)
        .build_cartesian_2d(across.clone(), up.clone())?;
    chart
        .configure_mesh()
        .x_desc(x)
        .y_desc(y)
        .x_label_formatter(&|value| tick_within(*value, across.end - across.start))
        .y_label_formatter(&|value| tick_within(*value, up.end - up.start))
        .label_style(("sans-serif", 14))
        .axis_desc_style(("sans-serif", 16))
        .light_line_style(WHITE)
        .draw()?;
    let colour = RGBColor(20, 80, 160);
    let points = || pieces.iter().copied().flatten();
    let has_band = points().any(|point| point.error > 0.0);
    if has_band {
        let bands =
            pieces.iter().flat_map(|piece| one_way(piece)).map(|piece| Polygon::new(band(piece), colour.mix(0.25)));
        chart
            .draw_series(bands)?
            .label("estimated error; past a snap runs scatter by more")
            .legend(move |(x, y)| Rectangle::new([(x, y - 5), (x + 16, y + 5)], colour.mix(0.25).filled()));
    }
    for piece in pieces {
        chart.draw_series(LineSeries::new(piece.iter().map(|point| point.place), colour.stroke_width(2)))?;
    }
    chart.draw_series(points().map(|point| Circle::new(point.place, 3, colour.filled())))?;
    // Steps that were not reached at once, or not through states of equilibrium.
    let (repeated, stabilised) = (RGBColor(225, 140, 0), RGBColor(200, 20, 40));
    let marks = |wanted: fn(&PathPoint) -> bool| points().filter(move |point| wanted(point));
    let mut has_legend = has_band;
    if marks(|point| point.cut_back && !point.stabilised).next().is_some() {
        let found = marks(|point| point.cut_back && !point.stabilised);
        chart
            .draw_series(found.map(|point| TriangleMarker::new(point.place, 6, repeated.stroke_width(2))))?
            .label("after cut-backs")
            .legend(move |(x, y)| TriangleMarker::new((x + 8, y), 6, repeated.stroke_width(2)));
        has_legend = true;
    }
    if marks(|point| point.stabilised).next().is_some() {
        let found = marks(|point| point.stabilised);
        chart
            .draw_series(found.map(|point| Circle::new(point.place, 6, stabilised.stroke_width(2))))?
            .label("stabilised")
            .legend(move |(x, y)| Circle::new((x + 8, y), 6, stabilised.stroke_width(2)));
        has_legend = true;
    }
    if has_legend {
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::LowerRight)
            .background_style(WHITE.mix(0.8))
            .label_font(("sans-serif", 14))
            .draw()?;
    }
    area.present()
}

/// Parts of a curve along which the first value moves one way: the band of a curve that turns back would cross itself. Neighbours share
/// the point of the turn.
fn one_way(points: &[PathPoint]) -> Vec<&[PathPoint]> {
    let (mut parts, mut first, mut way) = (Vec::new(), 0, 0.0);
    for (last, pair) in points.windows(2).enumerate() {
        let step = pair[1].place.0 - pair[0].place.0;
        if step * way < 0.0 {
            parts.push(&points[first..=last]);
            first = last;
        }
        if step != 0.0 {
            way = step;
        }
    }
    parts.push(&points[first..]);
    parts
}

/// Outline of the band around points: there above them, back below.
fn band(points: &[PathPoint]) -> Vec<(f64, f64)> {
    let edge = |side: f64| points.iter().map(move |point| (point.place.0, point.place.1 + side * point.error));
    edge(1.0).chain(edge(-1.0).rev()).collect()
}

/// Smallest range that holds all values with a margin; `None` where there are none.
fn range(values: &[f64]) -> Option<Range<f64>> {
    if values.is_empty() {
        return None;
    }
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // A constant column still needs a range that is not empty.
    let margin = if high > low { 0.04 * (high - low) } else { 0.5 * high.abs().max(1.0) };
    Some(low - margin..high + margin)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points() -> Vec<PathPoint> {
        (0..5)
            .map(|step| f64::from(step) / 10.0)
            .map(|load| PathPoint { place: (load, 20.0 * load), error: 0.0, cut_back: false, stabilised: false })
            .collect()
    }

    #[test]
    fn a_curve_is_an_svg_with_its_axes_named() {
        let text = path_svg(["load", "ratio"], &points()).unwrap().unwrap();
        assert!(text.starts_with("<svg") && text.trim_end().ends_with("</svg>"));
        assert!(text.contains("ratio") && text.contains("load") && text.contains("<polyline"));
    }

    #[test]
    fn steps_that_were_hard_to_reach_are_marked() {
        let mut points = points();
        let drawn = |points: &[PathPoint]| path_svg(["load", "ratio"], points).unwrap().unwrap();
        let circles = |text: &str| text.matches("<circle").count();
        let plain = drawn(&points);
        assert!(!plain.contains("stabilised") && !plain.contains("cut-backs"));
        points[2].cut_back = true;
        let repeated = drawn(&points);
        assert!(
            repeated.contains("after cut-backs")
                && repeated.matches("<polygon").count() > plain.matches("<polygon").count()
        );
        points[3].stabilised = true;
        let stabilised = drawn(&points);
        assert!(
            stabilised.contains("stabilised") && circles(&stabilised) == circles(&plain) + 2,
            "the step and the legend"
        );
    }

    #[test]
    fn an_estimated_error_is_a_band_around_the_curve_and_within_the_picture() {
        let mut points = points();
        let drawn = |points: &[PathPoint]| path_svg(["load", "ratio"], points).unwrap().unwrap();
        let plain = points.clone();
        assert!(!drawn(&plain).contains("estimated error"));
        points.iter_mut().for_each(|point| point.error = 30.0);
        let text = drawn(&points);
        assert!(text.contains("estimated error") && text.contains("<polygon"));
        assert!(text.contains("-20") && !drawn(&plain).contains("-20"), "the lower edge is in the picture");
    }

    /// Along a cycle every way there and back has a band of its own.
    #[test]
    fn a_band_does_not_cross_itself_where_a_curve_turns_back() {
        let along = |loads: &[f64]| -> Vec<PathPoint> {
            let at = |load: &f64| PathPoint { place: (*load, 1.0), error: 0.1, cut_back: false, stabilised: false };
            loads.iter().map(at).collect()
        };
        let lengths = |loads: &[f64]| one_way(&along(loads)).iter().map(|part| part.len()).collect::<Vec<_>>();
        assert_eq!(lengths(&[0.0, 1.0, 2.0]), [3]);
        assert_eq!(lengths(&[0.0, 1.0, 1.0, 2.0, 0.0, -1.0, 0.0]), [4, 3, 2], "standing still is no turn");
        assert_eq!(lengths(&[0.0]), [1]);
        let cycle = path_svg(["strain", "ratio"], &along(&[0.0, 1.0, 0.0, -1.0])).unwrap().unwrap();
        assert_eq!(cycle.matches("<polygon").count(), 2);
        assert_eq!(band(&along(&[0.0, 1.0])), [(0.0, 1.1), (1.0, 1.1), (1.0, 0.9), (0.0, 0.9)]);
    }

    #[test]
    fn a_value_that_is_not_finite_leaves_a_gap() {
        let mut points = points();
        let lines = |points: &[PathPoint]| {
            let text = path_svg(["load", "ratio"], points).unwrap().unwrap();
            assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
            text.matches("fill=\"none\"").count()
        };
        let whole = lines(&points);
        points[2].place.1 = f64::NAN;
        assert_eq!(lines(&points), whole + 1);
        points.iter_mut().for_each(|point| point.place.0 = f64::INFINITY);
        assert_eq!(path_svg(["load", "ratio"], &points).unwrap(), None);
        assert_eq!(path_svg(["load", "ratio"], &[]).unwrap(), None);
    }
}
