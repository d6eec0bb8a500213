//! Pictures as SVG text, readable without any tool: charts of several curves (benchmarks, report page), the one curve of a run's
//! `history.svg`, cells with their force chains and rose diagrams, and meshes coloured by a quantity.

mod chart;
mod force_chains;
mod map;
mod number;
mod path;
mod rose;
mod svg;

pub use chart::{Chart, Scale};
pub use force_chains::{ForceChains, ForceLine};
pub use map::{Map, Panel, Patch};
pub use number::short;
pub use path::{PathPoint, path_svg};
pub use rose::Rose;

use plotters::drawing::DrawingAreaErrorKind;

/// A picture could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("could not draw the chart: {0}")]
pub struct ChartError(#[from] DrawingAreaErrorKind<std::io::Error>);
