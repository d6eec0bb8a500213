//! The engines of one run, their capabilities, and the Gauss points of each.

use super::{Catalogue, Compatibility, Engine, Requirements, capabilities_of, compatibility};
use crate::exit::{Exit, Failure};
use macro_solver::material::error_estimate::SamplePlan;
use protocol::{Capabilities, Definition, OptionalResult};
use rve_server::server::built_in_engine;
use scene_reader::{Materials, Scene};
use std::collections::BTreeMap;

/// One engine of a run.
#[derive(Clone, Debug)]
pub(crate) struct AssignedEngine {
    /// How its workers are started.
    pub(crate) engine: Engine,
    /// What it reported.
    pub(crate) capabilities: Capabilities,
    /// What they mean for the scene.
    pub(crate) compatibility: Compatibility,
}

/// The definitions that a pool serves, with their engines and points.
#[derive(Clone, Debug)]
pub(crate) struct PoolDefinitions {
    /// Definitions of the cells; a definition solved by two engines is listed twice.
    pub(crate) definitions: Vec<Definition>,
    /// Name of the engine of each definition.
    pub(crate) engines: Vec<String>,
    /// Optional results that the engine of each definition does not deliver.
    pub(crate) lacking: Vec<Vec<OptionalResult>>,
    /// For each Gauss point the index of its definition.
    pub(crate) made_of: Vec<usize>,
}

/// The engines of a run and the Gauss points of each.
#[derive(Clone, Debug)]
pub(crate) struct EngineAssignment {
    /// The engines; each has at least one point.
    pub(crate) engines: Vec<AssignedEngine>,
    /// For each Gauss point the index of its engine.
    pub(crate) engine_of: Vec<usize>,
}

impl AssignedEngine {
    /// Whether it is one of the engines inside this program, by any of their names.
    fn is_inside(&self) -> bool {
        built_in_engine(&self.engine.name).is_some()
    }

    /// Remarks that the points of an engine outside this program do not keep to `rve.error`.
    fn remark_on_error(&mut self) {
        if !self.is_inside() {
            self.compatibility.remarks.push(format!(
                "engine `{}` does not follow rve.error: its points keep to rve.accuracy = \"default\"",
                self.engine.name
            ));
        }
    }
}

/// Refuses engines that are two for the scene and one for the pool, which knows workers by the name that their engine reports: their
/// points would be mixed.
///
/// # Errors
/// Names both. Several names of an engine inside this program are one program, and mix nothing.
fn refuse_equal_names(engines: &[AssignedEngine]) -> Result<(), Failure> {
    for (place, second) in engines.iter().enumerate() {
        let reported = &second.capabilities.engine;
        let equal = |first: &&AssignedEngine| {
            first.capabilities.engine == *reported && !(first.is_inside() && second.is_inside())
        };
        if let Some(first) = engines[..place].iter().find(equal) {
            let (one, other) = (&first.engine.name, &second.engine.name);
            let problem = format!(
                "engines '{one}' and '{other}' both report the name `{reported}`, by which their workers are told apart\nhint: give \
                 the points of both to one of them, or have one report another name"
            );
            return Err(Failure::new(Exit::BadInput, problem));
        }
    }
    Ok(())
}

impl PoolDefinitions {
    /// Adds the replicas of a sample: those that stay with their points are solved by the same engine with half the tolerance; those that
    /// roam take up what the points that they follow are made of.
    pub(crate) fn add_replicas(&mut self, plan: &SamplePlan, materials: &Materials) {
        let mut replica_of: BTreeMap<usize, usize> = BTreeMap::new();
        for plan in &plan.fixed {
            let original = self.made_of[plan.point];
            let place = *replica_of.entry(original).or_insert_with(|| {
                let finer = materials.definitions[materials.made_of[plan.point]].with_half_tolerance();
                self.definitions.push(finer.to_protocol());
                self.engines.push(self.engines[original].clone());
                self.lacking.push(self.lacking[original].clone());
                self.definitions.len() - 1
            });
            debug_assert_eq!(plan.replica, self.made_of.len());
            self.made_of.push(place);
        }
        let begin = plan.points.first().map(|&point| self.made_of[point]);
        self.made_of.extend(plan.roaming.iter().filter_map(|_| begin));
    }
}

impl EngineAssignment {
    /// Finds the engines that the scene, or `requested` (`--engine`) in its place, names, requests the capabilities of each and
    /// checks them against the scene.
    ///
    /// # Errors
    /// An engine is not listed, cannot be started or cannot solve the scene.
    pub(crate) fn assemble(scene: &Scene, requested: Option<&str>) -> Result<Self, Failure> {
        let refuse = |error: anyhow::Error| Failure::new(Exit::BadInput, format!("{error:#}"));
        let main = requested.unwrap_or(&scene.engines.engine);
        let mut names = vec![main.to_owned()];
        let mut engine_of = vec![0; scene.problem.point_count()];
        for (name, points) in &scene.engines.points {
            if name == main {
                continue;
            }
            names.push(name.clone());
            points.iter().for_each(|&point| engine_of[point] = names.len() - 1);
        }
        // Without points the main engine needs no workers.
        if !engine_of.contains(&0) {
            names.remove(0);
            engine_of.iter_mut().for_each(|engine| *engine -= 1);
        }
        let catalogue = match names.iter().all(|name| built_in_engine(name).is_some()) {
            true => Catalogue::default(),
            false => Catalogue::read().map_err(refuse)?,
        };
        let problem = &scene.problem;
        let requirements = Requirements {
            definitions: &scene.materials.definitions,
            tangents: &problem.requested_tangents(),
            observables: problem.observables,
            changes_friction: problem.changes_friction(),
        };
        let mut engines = Vec::new();
        for name in &names {
            let engine = catalogue.find(name).map_err(refuse)?;
            let capabilities = capabilities_of(&engine).map_err(refuse)?;
            let compatibility =
                compatibility(&capabilities, &requirements).map_err(|error| Failure::new(Exit::BadInput, error))?;
            engines.push(AssignedEngine { engine, capabilities, compatibility });
        }
        refuse_equal_names(&engines)?;
        Ok(Self { engines, engine_of })
    }

    /// Whether a point is solved by the engine inside this program.
    pub(crate) fn is_built_in(&self, point: usize) -> bool {
        self.engines[self.engine_of[point]].engine.is_built_in()
    }

    /// Engines inside this program with their versions, which workers must have: the first of another build would let in its like alone.
    pub(crate) fn own_versions(&self) -> Vec<(String, String)> {
        let own = self.engines.iter().filter(|assigned| built_in_engine(&assigned.engine.name).is_some());
        own.map(|assigned| (assigned.capabilities.engine.clone(), assigned.capabilities.version.clone())).collect()
    }

    /// What the pool serves: every pair of definition and engine that occurs, and for each point the index of its pair.
    pub(crate) fn pool_definitions(&self, materials: &Materials) -> PoolDefinitions {
        let mut kinds: Vec<(usize, usize)> = Vec::new();
        let mut made_of = Vec::with_capacity(self.engine_of.len());
        for (&engine, &material) in self.engine_of.iter().zip(&materials.made_of) {
            let place = kinds.iter().position(|kind| *kind == (engine, material)).unwrap_or_else(|| {
                kinds.push((engine, material));
                kinds.len() - 1
            });
            made_of.push(place);
        }
        let definitions = kinds.iter().map(|&(_, material)| materials.definitions[material].to_protocol()).collect();
        let capabilities = |&(engine, _): &(usize, usize)| &self.engines[engine].capabilities;
        let engines = kinds.iter().map(capabilities).map(|known| known.engine.clone()).collect();
        let lacking = kinds.iter().map(capabilities).map(Capabilities::lacking).collect();
        PoolDefinitions { definitions, engines, lacking, made_of }
    }

    /// As [`EngineAssignment::assemble`], for a run or what is told of it: a scene whose error cannot be estimated does not keep to one
    /// by default, and in one that does there is a remark on points that cannot.
    ///
    /// # Errors
    /// As [`EngineAssignment::assemble`].
    pub(crate) fn of(mut scene: Scene, requested: Option<&str>) -> Result<(Scene, Self), Failure> {
        let mut assignment = Self::assemble(&scene, requested)?;
        if assignment.replicated_kinds(&scene.materials).iter().all(Option::is_none) {
            scene.give_up_default_error();
        }
        if scene.materials.definitions.iter().any(|definition| definition.options().error.is_some()) {
            assignment.engines.iter_mut().for_each(AssignedEngine::remark_on_error);
        }
        Ok((scene, assignment))
    }

    /// For each point the kind of its cell; `None` where an external engine solves it, which has no replicas.
    pub(crate) fn replicated_kinds(&self, materials: &Materials) -> Vec<Option<usize>> {
        let kind = |(point, &material): (usize, &usize)| self.is_built_in(point).then_some(material);
        materials.made_of.iter().enumerate().map(kind).collect()
    }

    /// For each point, whether its tangents are found by finite differences.
    pub(crate) fn differences(&self) -> Vec<bool> {
        self.engine_of.iter().map(|&engine| self.engines[engine].compatibility.needs_differences).collect()
    }

    /// Remarks for the user before the run, one line each.
    pub(crate) fn remarks(&self) -> impl Iterator<Item = &str> {
        self.engines.iter().flat_map(|engine| engine.compatibility.remarks.iter().map(String::as_str))
    }

    /// Engines as scenes and `--engine` name them, with versions and numbers of points, for display.
    pub(crate) fn overview(&self) -> String {
        let parts = self.engines.iter().enumerate().map(|(index, assigned)| {
            let points = self.engine_of.iter().filter(|&&engine| engine == index).count();
            format!("{} {} ({points} points)", assigned.engine.name, assigned.capabilities.version)
        });
        parts.collect::<Vec<_>>().join(", ")
    }

    /// Engines as scenes and `--engine` name them, each with the ranges of its points: what must not change when a run is continued.
    pub(crate) fn by_points(&self) -> String {
        let name = |engine: usize| &self.engines[engine].engine.name;
        let mut first = 0;
        let parts = self.engine_of.chunk_by(|one, next| name(*one) == name(*next)).map(|range| {
            let (begin, end) = (first, first + range.len() - 1);
            first = end + 1;
            format!("{} ({begin} to {end})", name(range[0]))
        });
        parts.collect::<Vec<_>>().join(", ")
    }

    /// Engines outside this program with their versions: those inside are of its own build.
    pub(crate) fn outside_versions(&self) -> String {
        let outside = self.engines.iter().filter(|assigned| !assigned.engine.is_of_this_program());
        let parts = outside.map(|assigned| format!("{} {}", assigned.engine.name, assigned.capabilities.version));
        parts.collect::<Vec<_>>().join(", ")
    }

    /// Engines with their versions and numbers of points, for the summary.
    pub(crate) fn description(&self) -> String {
        let parts: Vec<String> = (self.engines.iter().enumerate())
            .map(|(index, assigned)| {
                let points = self.engine_of.iter().filter(|&&engine| engine == index).count();
                let (engine, version) = (&assigned.capabilities.engine, &assigned.capabilities.version);
                format!("{engine} {version} ({points} points)")
            })
            .collect();
        parts.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rve_server::server::BUILT_IN_ENGINES;

    fn assigned(name: &str, reported: &str) -> AssignedEngine {
        AssignedEngine {
            engine: Engine::built_in(name, "/bin/false".into()),
            capabilities: Capabilities { engine: reported.into(), ..Capabilities::default() },
            compatibility: Compatibility { needs_differences: false, remarks: Vec::new() },
        }
    }

    /// Both got the points of the other: the pool tells workers apart by the name that they report.
    #[test]
    fn two_entries_of_a_catalogue_that_report_one_name_are_refused() {
        let own = BUILT_IN_ENGINES[0].keyword;
        let reported = (BUILT_IN_ENGINES[0].create)().capabilities().engine;
        let refused = |engines: &[AssignedEngine]| refuse_equal_names(engines).map_err(|failure| failure.to_string());
        let twins = [assigned("grains", &reported), assigned("one", "mine"), assigned("other", "mine")];
        let text = refused(&twins).unwrap_err();
        assert!(text.contains("'one' and 'other' both report the name `mine`"), "{text}");
        // An engine outside this program that calls itself as the one inside.
        let text = refused(&[assigned("grains", &reported), assigned("one", &reported)]).unwrap_err();
        assert!(text.contains("'grains' and 'one'"), "{text}");
        assert_eq!(refused(&[assigned("grains", &reported), assigned(own, &reported)]), Ok(()));
        assert_eq!(refused(&[assigned("one", "mine"), assigned("other", "another")]), Ok(()));
    }

    #[test]
    fn engines_outside_do_not_follow_the_error_of_a_run_and_say_so() {
        let mut engines = [assigned("grains", "grainspan-grains"), assigned("one", "mine")];
        engines.iter_mut().for_each(AssignedEngine::remark_on_error);
        assert!(engines[0].compatibility.remarks.is_empty());
        assert!(engines[1].compatibility.remarks[0].contains("engine `one` does not follow rve.error"));
    }
}
