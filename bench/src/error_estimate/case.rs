//! One cell on one path: solved tightly, at fixed strains per ramp step, and with the accuracy chosen by error.

use crate::newton::case::packing_of_seed;
use anyhow::Context;
use macro_solver::material::error_estimate::{ErrorEstimateSettings, ErrorEstimator, SamplePlan, sample};
use macro_solver::mesh::ElementKind;
use macro_solver::mesh::block::Block;
use macro_solver::observer::{FieldsView, Observer, Outcome, StepReport, StopRequest};
use macro_solver::pool::{Interrupt, JoiningWorkers, Pool, PoolSettings};
use macro_solver::problem::{Axis, Condition, ErrorControl, Platen, PressureKind, Problem};
use macro_solver::solve::solve;
use protocol::Tensor2;
use protocol::transport::in_process::channel;
use rve_server::contact::ContactTable;
use rve_server::definition::{AnyDefinition, Packing, RveOptions};
use rve_server::engine::GrainEngine;
use rve_server::preparation::{PackingRecipe, generate_any};
use rve_server::server::{ServeOptions, serve};

/// Strain of one load step.
const STEP: f64 = 1e-3;

/// A cell, named for tables.
#[derive(Clone, Debug)]
pub(super) struct Grains {
    pub(super) name: String,
    packing: Packing,
    contact: ContactTable,
    pressure: f64,
}

macro_rules! shipped {
    ($name:literal) => {
        (
            $name,
            include_str!(concat!("../../../packings/", $name, ".json")),
            include_str!(concat!("../../../packings/", $name, ".toml")),
        )
    };
}

/// Shipped packings that are measured.
const SHIPPED: [(&str, &str, &str); 5] = [
    shipped!("discs-100"),
    shipped!("discs-400"),
    shipped!("discs-400-dense"),
    shipped!("discs-liu2018"),
    shipped!("spheres-100"),
];

/// Seeds of further packings of 400 discs and of 100 spheres. The factor of the estimate was fixed without them.
const HELD_BACK: ([u64; 3], [u64; 2]) = ([11, 12, 13], [11, 12]);

/// Friction and k_t / k_n of the cells in turn.
const CONTACTS: [(f64, f64); 3] = [(0.5, 0.5), (0.3, 0.8), (0.8, 1.0)];

fn discs_of_seed(seed: u64) -> String {
    format!("discs-400 of seed {seed}")
}

fn spheres_of_seed(seed: u64) -> String {
    format!("spheres-100 of seed {seed}")
}

/// Names of the [`cells`], without making them.
pub(super) fn names(quick: bool) -> Vec<String> {
    let shipped = SHIPPED.iter().map(|(name, ..)| (*name).to_owned());
    if quick {
        return shipped.take(1).collect();
    }
    let held_back = HELD_BACK.0.into_iter().map(discs_of_seed).chain(HELD_BACK.1.into_iter().map(spheres_of_seed));
    shipped.chain(held_back).collect()
}

/// The cells: the shipped ones and some made from other seeds; only the first in a quick look.
///
/// # Errors
/// A packing cannot be made.
pub(super) fn cells(quick: bool) -> anyhow::Result<Vec<Grains>> {
    let mut cells = Vec::new();
    for (name, packing, recipe) in SHIPPED {
        let recipe = PackingRecipe::from_toml(recipe).with_context(|| format!("the recipe of {name}"))?;
        let packing = Packing::from_json(name, packing)?;
        cells.push(Grains::new(name.to_owned(), packing, &recipe, cells.len())?);
        if quick {
            return Ok(cells);
        }
    }
    let [_, discs, .., spheres] = &SHIPPED;
    for seed in HELD_BACK.0 {
        let recipe = PackingRecipe::from_toml(discs.2)?;
        let packing = Packing::Discs(packing_of_seed(seed)?);
        cells.push(Grains::new(discs_of_seed(seed), packing, &recipe, cells.len())?);
    }
    for seed in HELD_BACK.1 {
        let recipe = PackingRecipe { seed, ..PackingRecipe::from_toml(spheres.2)? };
        let (packing, ..) = generate_any(&recipe, &mut |_| {}).with_context(|| format!("spheres of seed {seed}"))?;
        cells.push(Grains::new(spheres_of_seed(seed), packing, &recipe, cells.len())?);
    }
    Ok(cells)
}

impl Grains {
    fn new(name: String, packing: Packing, recipe: &PackingRecipe, place: usize) -> anyhow::Result<Self> {
        let (friction, ratio) = CONTACTS[place % CONTACTS.len()];
        let mut contact = recipe.contact.clone();
        contact.friction = friction;
        if contact.stiffness_ratio.is_some() {
            contact.stiffness_ratio = Some(ratio);
        }
        let pressure = recipe.pressure.with_context(|| format!("{name} is at rest under a pressure"))?;
        Ok(Self { name, packing, contact, pressure })
    }

    fn definition(&self, options: RveOptions) -> anyhow::Result<AnyDefinition> {
        Ok(AnyDefinition::new(self.packing.clone(), self.contact.clone(), options).validate()?)
    }
}

/// What is done to a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Loading {
    /// Compression at constant volume, all strains prescribed.
    Isochoric,
    /// Simple shear, all strains prescribed.
    Shear,
    /// Compression at constant lateral stress: the lateral strain answers to the error of the stress, and what the balance of forces
    /// leaves is part of it.
    Drained,
}

impl Loading {
    pub(super) const ALL: [Self; 3] = [Self::Isochoric, Self::Shear, Self::Drained];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Isochoric => "isochoric",
            Self::Shear => "shear",
            Self::Drained => "drained",
        }
    }

    /// Whether no strain answers to the stress.
    pub(super) fn prescribes_strains(self) -> bool {
        self != Self::Drained
    }

    fn conditions(self, strain: f64, pressure: f64) -> Vec<Condition> {
        let platen = |nodes: &str, axis, displacement| Condition::Platen {
            nodes: nodes.into(),
            contact: Platen::Smooth,
            axis,
            displacement,
        };
        let heads = [platen("bottom", Axis::Y, 0.0), platen("top", Axis::Y, -strain)];
        let others = match self {
            Self::Isochoric => {
                let widening = 1.0 / (1.0 - strain) - 1.0;
                vec![platen("left", Axis::X, 0.0), platen("right", Axis::X, widening)]
            }
            // A shear angle of 1.5 times the compression of the other paths.
            Self::Shear => {
                let [bottom, top] = ["bottom", "top"].map(|nodes| Condition::fixed(nodes, Axis::Y));
                return vec![bottom, top, platen("bottom", Axis::X, 0.0), platen("top", Axis::X, 1.5 * strain)];
            }
            Self::Drained => {
                let kind = PressureKind::Dead;
                let side = |sides: &str| Condition::Pressure { sides: sides.into(), value: pressure, kind };
                vec![Condition::fixed("bottom_left", Axis::X), side("left"), side("right")]
            }
        };
        heads.into_iter().chain(others).collect()
    }
}

/// What is compared at the end of a load step of full size.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mark {
    /// Number of the load step, from 1.
    pub(super) step: usize,
    /// Cauchy stress of the first Gauss point, Pa.
    pub(super) stress: Tensor2,
    /// Estimated error; NaN without an estimate.
    pub(super) estimate: f64,
}

/// One solution of a cell along its path.
#[derive(Clone, Debug, Default)]
pub(super) struct Solution {
    /// Load steps of the whole path.
    pub(super) steps: usize,
    /// Ends of load steps, in their order. After a step that was cut back some may be missing.
    pub(super) marks: Vec<Mark>,
    /// Share of the path that was followed.
    pub(super) load: f64,
    /// Force evaluations of the points and of the replicas.
    pub(super) force_evaluations: [u64; 2],
    /// Whether the whole path was followed.
    pub(super) is_complete: bool,
}

impl Observer for Solution {
    fn accepted(&mut self, report: &StepReport, fields: &FieldsView<'_>) -> Result<(), StopRequest> {
        let place = report.load * self.steps as f64;
        self.load = report.load;
        if report.step > 0 && (place - place.round()).abs() < 1e-6 {
            let estimate = report.accuracy.estimate.map_or(f64::NAN, |estimate| estimate.rms);
            self.marks.push(Mark { step: place.round() as usize, stress: fields.points[0].stress, estimate });
        }
        Ok(())
    }
}

/// Solves a cell behind one element along a path of `steps` load steps.
///
/// # Errors
/// A worker ends early, or the options are not sound.
pub(super) fn solution(
    grains: &Grains,
    loading: Loading,
    options: &RveOptions,
    steps: usize,
    estimates: bool,
) -> anyhow::Result<Solution> {
    let mesh = Block::plane([1.0, 1.0], [1, 1], ElementKind::Q4).mesh()?;
    let points = mesh.point_count();
    let mut problem = Problem::new(mesh, loading.conditions(STEP * steps as f64, grains.pressure));
    problem.stages[0].control.increments = steps;
    problem.strain_per_step = options.strain_per_step();
    let [smallest, largest] = options.strain_per_step_bounds();
    problem.error_control = options.error.map(|error| ErrorControl { error, smallest, largest });
    let definition = grains.definition(options.clone())?;
    let mut definitions = vec![definition.to_protocol()];
    let mut made_of = vec![0; points];
    let plan = match estimates {
        true => sample(&vec![Some(0); points], &ErrorEstimateSettings::default()),
        false => SamplePlan::default(),
    };
    if estimates {
        definitions.push(definition.with_half_tolerance().to_protocol());
        made_of.extend(plan.fixed.iter().map(|_| 1));
        made_of.extend(plan.roaming.iter().map(|_| 0));
    }
    let (port, connector) = channel();
    std::thread::scope(|scope| {
        let mut worker = connector.join();
        let served = scope.spawn(move || serve(&mut GrainEngine, &mut worker, &ServeOptions::new("error-estimate")));
        let settings = PoolSettings::new("error-estimate");
        let mut pool = Pool::new(port, Box::new(JoiningWorkers), Interrupt::new(), settings, definitions, &made_of);
        pool.gather(1)?;
        let mut solution = Solution { steps, ..Solution::default() };
        let dimension = usize::try_from(grains.packing.dimension())?;
        let mut estimator = ErrorEstimator::new(&mut pool, dimension, &plan);
        let run = solve(&problem, &mut estimator, &mut solution);
        let replicas = estimator.figures().force_evaluations;
        pool.close();
        drop(pool);
        served.join().map_err(|_| anyhow::anyhow!("a worker panicked"))??;
        // All points of the element are alike and are solved once.
        let own = run.statistics.cost.force_evaluations / points as u64;
        Ok(Solution {
            force_evaluations: [own, replicas],
            is_complete: matches!(run.outcome, Outcome::Completed),
            ..solution
        })
    })
}
