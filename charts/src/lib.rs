//! Pictures as SVG text, readable without any tool: charts of several curves (benchmarks, report page), the one curve of a run's
//! `history.svg`, cells with their force chains, fluctuations and rose diagrams, and meshes coloured by a quantity.

mod arrows;
mod chart;
mod force_chains;
mod grain_map;
mod map;
mod number;
mod path;
mod rose;
mod spatial_chains;
mod stereonet;
mod svg;
mod view;

pub use arrows::Arrows;
pub use chart::{Chart, Scale};
pub use force_chains::{ForceChains, ForceLine};
pub use grain_map::GrainMap;
pub use map::{Map, Panel, Patch};
pub use number::short;
pub use path::{PathPoint, path_svg};
pub use rose::Rose;
pub use spatial_chains::{SpatialChains, SpatialLine};
pub use stereonet::Stereonet;

use plotters::drawing::DrawingAreaErrorKind;

/// A picture could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("could not draw the chart: {0}")]
pub struct ChartError(#[from] DrawingAreaErrorKind<std::io::Error>);
