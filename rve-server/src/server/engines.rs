//! The engines inside this program. A further one is a line here.

use crate::engine::GrainEngine;
use crate::programs::frame::FrameEngine;
use protocol::RveEngine;

/// An engine inside this program.
#[derive(Clone, Copy, Debug)]
pub struct BuiltInEngine {
    /// Keyword in scenes and for `rve-server --engine`.
    pub keyword: &'static str,
    /// Other keywords that name it too.
    pub aliases: &'static [&'static str],
    /// Short description for messages.
    pub summary: &'static str,
    /// Builds it.
    pub create: fn() -> Box<dyn RveEngine>,
}

/// All of them.
pub const BUILT_IN_ENGINES: [BuiltInEngine; 2] = [
    BuiltInEngine {
        keyword: "grainspan-dem",
        aliases: &["grains"],
        summary: "periodic cells of discs or spheres",
        create: || Box::new(GrainEngine),
    },
    BuiltInEngine {
        keyword: "boundary-frame",
        aliases: &[],
        summary: "discs behind a frame of boundary grains [Liu2018], periodic constraint",
        create: || Box::new(FrameEngine),
    },
];

/// The engine of this keyword, if it is inside this program.
pub fn built_in_engine(keyword: &str) -> Option<BuiltInEngine> {
    BUILT_IN_ENGINES.into_iter().find(|engine| engine.keyword == keyword || engine.aliases.contains(&keyword))
}
