//! Who solves what in one run: its engines, what they can do, and the Gauss points of each.

use super::{Catalogue, Engine, Suitability, capabilities_of, suitability};
use crate::cli::exit::{Exit, Failure};
use crate::scene::{Materials, Scene};
use protocol::{Capabilities, Definition};
use rve_server::server::built_in_engine;

/// One engine of a run.
#[derive(Clone, Debug)]
pub(crate) struct Member {
    /// How its workers are started.
    pub(crate) engine: Engine,
    /// What it said it can do.
    pub(crate) capabilities: Capabilities,
    /// What that means for the scene.
    pub(crate) suitability: Suitability,
}

/// Definitions with the engines that solve them, and the points of each.
#[derive(Clone, Debug)]
pub(crate) struct Shares {
    /// What points are made of.
    pub(crate) definitions: Vec<Definition>,
    /// Name of the engine of each definition.
    pub(crate) engines: Vec<String>,
    /// For each point the place of its definition.
    pub(crate) made_of: Vec<usize>,
}

/// The engines of a run and the points of each.
#[derive(Clone, Debug)]
pub(crate) struct Crew {
    /// The engines; every one has points.
    pub(crate) members: Vec<Member>,
    /// For each Gauss point, the place of its engine among the members.
    pub(crate) member_of: Vec<usize>,
}

impl Crew {
    /// Finds the engines that the scene, or `--engine` in its place, names, asks each what it can do and judges it.
    ///
    /// # Errors
    /// An engine is not listed, cannot be started or cannot solve the scene.
    pub(crate) fn assemble(scene: &Scene, asked: Option<&str>) -> Result<Self, Failure> {
        let refuse = |error: anyhow::Error| Failure::new(Exit::BadInput, format!("{error:#}"));
        let main = asked.unwrap_or(&scene.engines.engine);
        let mut names = vec![main.to_owned()];
        let mut member_of = vec![0; scene.problem.point_count()];
        for (name, points) in &scene.engines.points {
            if name == main {
                continue;
            }
            names.push(name.clone());
            points.iter().for_each(|&point| member_of[point] = names.len() - 1);
        }
        // Without points the main engine needs no workers: they would wait for nothing.
        if !member_of.contains(&0) {
            names.remove(0);
            member_of.iter_mut().for_each(|member| *member -= 1);
        }
        let catalogue = match names.iter().all(|name| built_in_engine(name).is_some()) {
            true => Catalogue::default(),
            false => Catalogue::read().map_err(refuse)?,
        };
        let mut members = Vec::new();
        for name in &names {
            let engine = catalogue.find(name).map_err(refuse)?;
            let capabilities = capabilities_of(&engine).map_err(refuse)?;
            let suitability = suitability(&capabilities, &scene.materials.definitions, &scene.problem.tangents())
                .map_err(|reason| Failure::new(Exit::BadInput, reason))?;
            members.push(Member { engine, capabilities, suitability });
        }
        Ok(Self { members, member_of })
    }

    /// Whether a point is solved by the engine inside this program.
    pub(crate) fn is_built_in(&self, point: usize) -> bool {
        self.members[self.member_of[point]].engine.is_built_in()
    }

    /// What the pool is made of: every definition that an engine solves, the name of that engine, and for each point its
    /// place among them.
    pub(crate) fn shares(&self, materials: &Materials) -> Shares {
        let mut kinds: Vec<(usize, usize)> = Vec::new();
        let mut made_of = Vec::with_capacity(self.member_of.len());
        for (&member, &material) in self.member_of.iter().zip(&materials.made_of) {
            let place = kinds.iter().position(|kind| *kind == (member, material)).unwrap_or_else(|| {
                kinds.push((member, material));
                kinds.len() - 1
            });
            made_of.push(place);
        }
        let definitions = kinds.iter().map(|&(_, material)| materials.definitions[material].to_protocol()).collect();
        let engines = kinds.iter().map(|&(member, _)| self.members[member].capabilities.engine.clone()).collect();
        Shares { definitions, engines, made_of }
    }

    /// For each point, whether its tangents are found by finite differences.
    pub(crate) fn differences(&self) -> Vec<bool> {
        self.member_of.iter().map(|&member| self.members[member].suitability.differences).collect()
    }

    /// What people should know before the run, one line each.
    pub(crate) fn remarks(&self) -> impl Iterator<Item = &str> {
        self.members.iter().flat_map(|member| member.suitability.remarks.iter().map(String::as_str))
    }

    /// Engines as scenes and `--engine` name them, with their versions and numbers of points, for people.
    pub(crate) fn overview(&self) -> String {
        let parts = self.members.iter().enumerate().map(|(place, member)| {
            let points = self.member_of.iter().filter(|&&one| one == place).count();
            format!("{} {} ({points} points)", member.engine.name, member.capabilities.version)
        });
        parts.collect::<Vec<_>>().join(", ")
    }

    /// Engines with their versions and numbers of points, for the summary.
    pub(crate) fn description(&self) -> String {
        let parts: Vec<String> = (self.members.iter().enumerate())
            .map(|(place, member)| {
                let points = self.member_of.iter().filter(|&&one| one == place).count();
                let (engine, version) = (&member.capabilities.engine, &member.capabilities.version);
                format!("{engine} {version} ({points} points)")
            })
            .collect();
        parts.join(", ")
    }
}
