//! One problem solved on grains, with workers in this process.

use crate::workers::processor_seconds;
use anyhow::Context;
use macro_solver::material::PointMaterial;
use macro_solver::material::error_estimate::{ErrorEstimateSettings, ErrorEstimator, SamplePlan, sample};
use macro_solver::observer::{FieldsView, Observer, Outcome, Run, StepReport, StopRequest};
use macro_solver::pool::{Interrupt, JoiningWorkers, Pool, PoolSettings, PoolStatistics};
use macro_solver::problem::{Problem, Stabilisation};
use macro_solver::solve::solve;
use protocol::Definition;
use protocol::transport::in_process::channel;
use rve_server::contact::ContactTable;
use rve_server::definition::{Accuracy, AnyDefinition, GrainDefinition, Packing, PackingFile, RveOptions};
use rve_server::engine::GrainEngine;
use rve_server::preparation::{PackingRecipe, generate_any};
use rve_server::server::{ServeOptions, serve};
use rve_server::space::Discs;
use scene_reader::{JOBS_A_MESSAGE, drawn};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Result of one run.
#[derive(Debug)]
pub(crate) struct StrategyRun {
    /// Accepted steps, the initial state first.
    pub(crate) steps: Vec<Step>,
    /// Evaluations that workers computed.
    pub(crate) computed: u64,
    /// Equal steps that the path was to be followed in.
    pub(crate) increments: usize,
    /// Wall time, s.
    pub(crate) wall: f64,
    /// Processor time of the solver and of the worker, s: other work on the machine does not count.
    pub(crate) processor: f64,
    /// How it ended, with the solver's counts.
    pub(crate) run: Run,
}

/// One accepted step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step {
    /// As reported.
    pub(crate) report: StepReport,
    /// Mean vertical over mean horizontal stress.
    pub(crate) ratio: f64,
    /// Mean stress, Pa, as 11, 12, 13, 21, ...
    pub(crate) stress: [f64; 9],
}

impl StrategyRun {
    /// Whether the whole path was followed.
    pub(crate) fn is_complete(&self) -> bool {
        matches!(self.run.outcome, Outcome::Completed)
    }

    /// Evaluations requested up to a load factor, initial state included; NaN if the run did not come that far.
    pub(crate) fn requested_until(&self, load: f64) -> f64 {
        let reached = |step: &&Step| step.report.load < load + 1e-9;
        let (count, sum) = self
            .steps
            .iter()
            .take_while(reached)
            .fold((0, 0), |(_, sum), step| (step.report.step, sum + step.report.evaluations));
        let last = self.steps.iter().find(|step| step.report.step == count);
        let is_there = last.is_some_and(|last| last.report.load > load - 1e-9);
        if is_there { sum as f64 } else { f64::NAN }
    }

    /// How the run ended, in a word or two.
    pub(crate) fn end(&self) -> &'static str {
        match self.run.outcome {
            Outcome::Completed => "completed",
            Outcome::DidNotConverge { .. } => "did not converge",
            Outcome::Stopped(_) => "time is over",
            _ => "broke off",
        }
    }

    /// Number of the step with the largest stress ratio.
    pub(crate) fn peak(&self) -> usize {
        let largest = self.steps.iter().max_by(|one, other| one.ratio.total_cmp(&other.ratio));
        largest.map_or(0, |step| step.report.step)
    }
}

struct Recorder {
    steps: Vec<Step>,
    end: Instant,
}

impl Observer for Recorder {
    fn accepted(&mut self, report: &StepReport, fields: &FieldsView<'_>) -> Result<(), StopRequest> {
        let volume: f64 = fields.points.iter().map(|point| point.volume).sum();
        let mean = |row: usize, column: usize| {
            fields.points.iter().map(|p| p.volume * p.stress.get(row, column)).sum::<f64>() / volume
        };
        let stress = std::array::from_fn(|place| mean(place / 3, place % 3));
        self.steps.push(Step { report: *report, ratio: mean(1, 1) / mean(0, 0), stress });
        if Instant::now() > self.end {
            return Err(StopRequest { reason: "the time limit of one variant is reached".into() });
        }
        Ok(())
    }
}

/// As in scenes whose supports move under constant loads: a step that fails is stabilised at once. No iterate is committed
/// before a step has converged, so that iterations are those of the strategy.
pub(crate) const STABILISATION: Option<Stabilisation> =
    Some(Stabilisation { commit_iterates_after: None, ..Stabilisation::UNDER_MOVING_SUPPORTS });

/// Seed by which packings are dealt out to points.
const DEAL: u64 = 1;

/// Longest wall time of one run: a variant that fails at every second step must not delay the others for ever. It is
/// stopped after the next accepted step, and the table says so.
const LONGEST: Duration = Duration::from_secs(1500);

/// Solves `problem` with one worker; every point gets one of the definitions at random, with a fixed seed.
///
/// # Errors
/// A worker ends early.
pub(crate) fn solve_on_grains(problem: &Problem, definitions: &[Definition]) -> anyhow::Result<StrategyRun> {
    let draw = |point| drawn(DEAL, point as u64, definitions.len());
    let points: Vec<usize> = (0..problem.point_count()).map(draw).collect();
    solve_with(problem, definitions.to_vec(), &points, &|problem, pool, recorder| solve(problem, pool, recorder))
}

/// Solves `problem` with one worker, all points with the same cell. If the problem keeps to an error, replicas estimate it as in a scene.
///
/// # Errors
/// A worker ends early.
pub(crate) fn solve_on_cell(problem: &Problem, definition: &AnyDefinition) -> anyhow::Result<StrategyRun> {
    let mut definitions = vec![definition.to_protocol()];
    let mut made_of = vec![0; problem.point_count()];
    let mut plan = SamplePlan::default();
    if problem.error_control.is_some() {
        plan = sample(&vec![Some(0); made_of.len()], &ErrorEstimateSettings::default());
        definitions.push(definition.with_half_tolerance().to_protocol());
        made_of.extend(plan.fixed.iter().map(|_| 1));
        made_of.extend(plan.roaming.iter().map(|_| 0));
    }
    let axes = definition.dimension() as usize;
    solve_with(problem, definitions, &made_of, &|problem, pool, recorder| match plan.is_empty() {
        true => solve(problem, pool, recorder),
        false => solve(problem, &mut ErrorEstimator::new(pool, axes, &plan), recorder),
    })
}

/// How a problem is solved on a pool.
type Solving<'a> = dyn Fn(&Problem, &mut dyn PointMaterial, &mut Recorder) -> Run + 'a;

fn solve_with(
    problem: &Problem,
    definitions: Vec<Definition>,
    points: &[usize],
    solving: &Solving<'_>,
) -> anyhow::Result<StrategyRun> {
    let (port, connector) = channel();
    std::thread::scope(|scope| {
        let mut worker = connector.join();
        let served = scope.spawn(move || {
            let reason = serve(&mut GrainEngine, &mut worker, &ServeOptions::new("newton"));
            reason.map(|_| processor_seconds("thread-self"))
        });
        let before = processor_seconds("thread-self");
        // As in a run: enough trials at a time for the lanes.
        let settings = PoolSettings { jobs_per_message: JOBS_A_MESSAGE, ..PoolSettings::new("newton") };
        let supply = Box::new(JoiningWorkers);
        let mut pool = Pool::new(port, supply, Interrupt::new(), settings, definitions, points);
        pool.gather(1)?;
        let begin = Instant::now();
        let mut recorder = Recorder { steps: Vec::new(), end: begin + LONGEST };
        let run = solving(problem, &mut pool, &mut recorder);
        let wall = begin.elapsed().as_secs_f64();
        let PoolStatistics { solved: computed, .. } = pool.statistics();
        pool.close();
        drop(pool);
        let worker = served.join().map_err(|_| anyhow::anyhow!("a worker panicked"))??;
        Ok(StrategyRun {
            steps: recorder.steps,
            computed,
            increments: problem.stages[0].control.increments,
            wall,
            processor: worker + processor_seconds("thread-self") - before,
            run,
        })
    })
}

/// Does `count` pieces of work, as many at a time as there are cores, and returns what they gave in their order.
pub(crate) fn side_by_side<T: Send>(count: usize, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get);
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<(usize, T)>> = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..cores.min(count) {
            scope.spawn(|| {
                loop {
                    let piece = next.fetch_add(1, Ordering::Relaxed);
                    if piece >= count {
                        break;
                    }
                    let result = work(piece);
                    done.lock().expect("no thread panics while it pushes").push((piece, result));
                }
            });
        }
    });
    let mut done = done.into_inner().expect("all threads have ended");
    done.sort_by_key(|(piece, _)| *piece);
    done.into_iter().map(|(_, result)| result).collect()
}

/// 400 discs as the shipped recipe makes them from another seed.
///
/// # Errors
/// The recipe finds no packing from this seed.
pub(crate) fn packing_of_seed(seed: u64) -> anyhow::Result<PackingFile> {
    made(PackingRecipe { seed, ..recipe()? })
}

/// As many discs as the shipped recipe makes them from another seed, with this friction and modulus, Pa, of the preparation.
///
/// # Errors
/// The recipe finds no packing.
pub(crate) fn packing_of(seed: u64, number: usize, friction: f64, modulus: f64) -> anyhow::Result<PackingFile> {
    let recipe = recipe()?;
    let contact = ContactTable { friction, modulus: Some(modulus), ..recipe.contact.clone() };
    made(PackingRecipe { seed, number, contact, ..recipe })
}

fn recipe() -> anyhow::Result<PackingRecipe> {
    Ok(toml::from_str(include_str!("../../../packings/discs-400.toml"))?)
}

fn made(recipe: PackingRecipe) -> anyhow::Result<PackingFile> {
    let seed = recipe.seed;
    match generate_any(&recipe, &mut |_| {}).with_context(|| format!("packing of seed {seed}"))?.0 {
        Packing::Discs(packing) => Ok(packing),
        Packing::Spheres(_) => anyhow::bail!("the recipe is that of discs"),
    }
}

/// The shipped packing of 100 discs, for a quick look.
///
/// # Errors
/// None in a sound build.
pub(crate) fn small_packing() -> anyhow::Result<PackingFile> {
    Ok(serde_json::from_str(include_str!("../../../packings/discs-100.json"))?)
}

/// Grains with the contact law of the shipped scenes.
///
/// # Errors
/// None in a sound build.
pub(crate) fn definition(packing: PackingFile<Discs>, accuracy: Accuracy) -> anyhow::Result<Definition> {
    let contact = toml::from_str("law = \"linear\"\nmodulus = 1e8\nstiffness_ratio = 0.5\nfriction = 0.5")?;
    let options = RveOptions { accuracy, ..RveOptions::default() };
    Ok(GrainDefinition { packing, contact, options }.validate()?.to_protocol())
}
