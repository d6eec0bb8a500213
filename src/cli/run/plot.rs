//! `history.svg`: one curve of the history, readable without any tool.

use macro_solver::output::HistoryRow;
use plotters::prelude::*;
use std::ops::Range;

/// Width and height of the picture, px.
const SIZE: (u32, u32) = (720, 480);

/// Draws one column of the history over another and returns the SVG text; `None` if there are not two points that
/// differ along x, or a number is not finite.
pub(super) fn curve(
    rows: &[HistoryRow],
    probes: &[String],
    x: &str,
    y: &str,
) -> Result<Option<String>, DrawingAreaErrorKind<std::io::Error>> {
    let column = |name: &str| -> Vec<f64> {
        rows.iter()
            .map(|row| match name {
                "time" => row.time,
                "load" => row.load,
                name => probes.iter().position(|probe| probe == name).map_or(f64::NAN, |index| row.probes[index]),
            })
            .collect()
    };
    let (xs, ys) = (column(x), column(y));
    let (Some(horizontal), Some(vertical)) = (range(&xs), range(&ys)) else { return Ok(None) };
    let mut text = String::new();
    let points: Vec<Point> = (xs.into_iter().zip(ys).zip(rows))
        .map(|(place, row)| Point { place, cut_back: row.cut_backs > 0, stabilised: row.stabilised > 0 })
        .collect();
    draw(&mut text, [x, y], [horizontal, vertical], &points)?;
    Ok(Some(text))
}

/// A step in the picture.
#[derive(Clone, Copy)]
struct Point {
    place: (f64, f64),
    cut_back: bool,
    stabilised: bool,
}

fn draw(
    text: &mut String,
    [x, y]: [&str; 2],
    [across, up]: [Range<f64>; 2],
    points: &[Point],
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
        .x_label_formatter(&|value| tick(*value, &across))
        .y_label_formatter(&|value| tick(*value, &up))
        .label_style(("sans-serif", 14))
        .axis_desc_style(("sans-serif", 16))
        .light_line_style(WHITE)
        .draw()?;
    let colour = RGBColor(20, 80, 160);
    chart.draw_series(LineSeries::new(points.iter().map(|point| point.place), colour.stroke_width(2)))?;
    chart.draw_series(points.iter().map(|point| Circle::new(point.place, 3, colour.filled())))?;
    // Steps that were not reached at once, or not along balanced states.
    let (again, crept) = (RGBColor(225, 140, 0), RGBColor(200, 20, 40));
    let marks = |wanted: fn(&Point) -> bool| points.iter().filter(move |point| wanted(point));
    let mut told = false;
    if marks(|point| point.cut_back && !point.stabilised).next().is_some() {
        let found = marks(|point| point.cut_back && !point.stabilised);
        chart
            .draw_series(found.map(|point| TriangleMarker::new(point.place, 6, again.stroke_width(2))))?
            .label("after cut-backs")
            .legend(move |(x, y)| TriangleMarker::new((x + 8, y), 6, again.stroke_width(2)));
        told = true;
    }
    if marks(|point| point.stabilised).next().is_some() {
        let found = marks(|point| point.stabilised);
        chart
            .draw_series(found.map(|point| Circle::new(point.place, 6, crept.stroke_width(2))))?
            .label("stabilised")
            .legend(move |(x, y)| Circle::new((x + 8, y), 6, crept.stroke_width(2)));
        told = true;
    }
    if told {
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::LowerRight)
            .background_style(WHITE.mix(0.8))
            .label_font(("sans-serif", 14))
            .draw()?;
    }
    area.present()
}

/// Smallest range that holds all values with a margin; `None` when a value is not finite or there are none.
fn range(values: &[f64]) -> Option<Range<f64>> {
    if values.is_empty() || !values.iter().all(|value| value.is_finite()) {
        return None;
    }
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // A constant column still needs a range that is not empty.
    let margin = if high > low { 0.04 * (high - low) } else { 0.5 * high.abs().max(1.0) };
    Some(low - margin..high + margin)
}

/// Four significant digits, without trailing zeros; what is nothing on the scale of the axis is 0.
fn tick(value: f64, axis: &Range<f64>) -> String {
    if value.abs() < 1e-9 * (axis.end - axis.start) {
        return "0".to_owned();
    }
    if !(1e-4..1e5).contains(&value.abs()) {
        return format!("{value:.1e}");
    }
    let decimals = (3 - value.abs().log10().floor() as i32).clamp(0, 8) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(step: u64, value: f64) -> HistoryRow {
        let load = step as f64 / 10.0;
        HistoryRow {
            step,
            time: load,
            load,
            iterations: 1,
            evaluations: 8,
            stage: 0,
            probes: vec![value],
            cut_backs: 0,
            stabilised: 0,
        }
    }

    #[test]
    fn a_curve_is_an_svg_with_its_axes_named() {
        let rows: Vec<HistoryRow> = (0..5).map(|step| row(step, 2.0 * step as f64)).collect();
        let text = curve(&rows, &["ratio".to_owned()], "load", "ratio").unwrap().unwrap();
        assert!(text.starts_with("<svg") && text.trim_end().ends_with("</svg>"));
        assert!(text.contains("ratio") && text.contains("load") && text.contains("<polyline"));
    }

    #[test]
    fn steps_that_were_hard_to_reach_are_marked() {
        let mut rows: Vec<HistoryRow> = (0..5).map(|step| row(step, 2.0 * step as f64)).collect();
        let drawn = |rows: &[HistoryRow]| curve(rows, &["ratio".to_owned()], "load", "ratio").unwrap().unwrap();
        let circles = |text: &str| text.matches("<circle").count();
        let plain = drawn(&rows);
        assert!(!plain.contains("stabilised") && !plain.contains("cut-backs"));
        rows[2].cut_backs = 3;
        let again = drawn(&rows);
        assert!(
            again.contains("after cut-backs")
                && again.matches("<polygon").count() > plain.matches("<polygon").count()
        );
        rows[3].stabilised = 12;
        let crept = drawn(&rows);
        assert!(crept.contains("stabilised") && circles(&crept) == circles(&plain) + 2, "the step and the legend");
    }

    #[test]
    fn a_column_that_is_not_finite_gives_no_picture() {
        let rows = [row(0, f64::NAN), row(1, 1.0)];
        assert_eq!(curve(&rows, &["ratio".to_owned()], "load", "ratio").unwrap(), None);
        assert_eq!(curve(&[], &[], "load", "load").unwrap(), None);
    }

    #[test]
    fn ticks_are_short() {
        let texts = [1e-18, 0.02, 100_000.0, 1234.0, -2.5e-7].map(|value| tick(value, &(0.0..1.0)));
        assert_eq!(texts, ["0", "0.02", "1.0e5", "1234", "-2.5e-7"]);
    }
}
