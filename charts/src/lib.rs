//! Curves as SVG text, readable without any tool: charts of several curves (benchmarks, report page) and the one curve of a
//! run's `history.svg`.

mod chart;
mod number;
mod path;

pub use chart::{Chart, Scale};
pub use number::short;
pub use path::{PathPoint, path_svg};

use plotters::drawing::DrawingAreaErrorKind;

/// A picture could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("could not draw the chart: {0}")]
pub struct ChartError(#[from] DrawingAreaErrorKind<std::io::Error>);
