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
        summary: "discs behind a frame of boundary grains [Liu2018]",
        create: || Box::new(FrameEngine),
    },
];

/// The engine of this keyword, if it is inside this program.
pub fn built_in_engine(keyword: &str) -> Option<BuiltInEngine> {
    BUILT_IN_ENGINES.into_iter().find(|engine| engine.keyword == keyword || engine.aliases.contains(&keyword))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::ContactTable;
    use crate::definition::{GrainDefinition, PackingFile, RveOptions};
    use crate::space::Discs;
    use protocol::{Tensor2, TrialOptions};
    use std::path::Path;

    #[test]
    fn every_engine_solves_a_plane_scene() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings/discs-100.json");
        let contact =
            ContactTable { normal_stiffness: None, modulus: Some(1e8), ..ContactTable::linear(1.0, 0.5, 0.5) };
        let packing = PackingFile::<Discs>::read(&file).unwrap();
        let definition = GrainDefinition { packing, contact, options: RveOptions::default() }.to_protocol();
        for engine in BUILT_IN_ENGINES {
            let mut solver = (engine.create)().create(&definition).unwrap();
            let target = Tensor2::from_plane([[-1e-5, 0.0], [0.0, -1e-5]]);
            let answer = solver.trial(&target, &TrialOptions::default()).unwrap();
            assert!(answer.stress.get(0, 0) < 0.0 && answer.stress.get(1, 1) < 0.0, "{}", engine.keyword);
            solver.commit().unwrap();
            let mut snapshot = Vec::new();
            solver.snapshot(&mut snapshot);
            (engine.create)().create(&definition).unwrap().restore(&snapshot).unwrap();
        }
    }

    #[test]
    fn keywords_and_aliases_name_one_engine_each() {
        let names = || BUILT_IN_ENGINES.iter().flat_map(|one| std::iter::once(&one.keyword).chain(one.aliases));
        for name in names() {
            assert_eq!(names().filter(|other| *other == name).count(), 1, "{name}");
            assert!(built_in_engine(name).is_some());
        }
        assert!(built_in_engine("nonsense").is_none());
    }
}
