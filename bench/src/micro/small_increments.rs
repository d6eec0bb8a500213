//! Small increments by relaxation and by the event-driven solver: force evaluations, time, error against tight relaxation.
//!
//! `grainspan bench micro small_increments [PACKING.json]...` takes each packing as it is, after a biaxial compression of 0.1 %, and
//! after 20 cycles of shear of 1e-4 on that, through three cycles of pure shear of amplitude 1e-5 and 1e-4 in 40 increments a cycle
//! and through a compressive pulse of 1e-5 with a tail of oscillations, and prints one line per solver. Errors are the largest
//! difference of a stress from that of relaxation at 2.5e-8 strain per step and tolerance 1e-9, over the pressure. Times are the shortest of
//! five passes, each with all solvers in turn, every one new.
//!
//! `grainspan bench micro small_increments drift CYCLES [PACKING.json]...` shears each shaken-down packing through that many cycles of
//! 1e-5, and prints how far the stress at the end of cycle 1, 10, 100, ... is from that of tight relaxation.

#![expect(clippy::print_stdout, reason = "a program for people")]

use crate::repeat::interleaved;
use anyhow::Context;
use rve_server::cell::GrainState;
use rve_server::contact::ContactTable;
use rve_server::definition::{GrainDefinition, GrainModel, PackingFile, RveOptions, SolverName};
use rve_server::engine::GrainRve;
use rve_server::solver::{AnsweredBy, SolveJob, SolverFor};
use rve_server::space::Discs;
use rve_server::tangent::network::NetworkResponses;
use std::path::Path;
use std::time::Instant;

type Plane = [[f64; 2]; 2];

/// Passes over a path that are timed.
const PASSES: usize = 5;

/// Increments of a pure shear `amplitude sin(2 pi t)`, 40 a cycle.
fn cyclic(amplitude: f64, cycles: usize) -> Vec<Plane> {
    let at = |step: usize| 0.5 * amplitude * (std::f64::consts::TAU * step as f64 / 40.0).sin();
    let increment = |step: usize| at(step + 1) - at(step);
    (0..40 * cycles).map(|step| [[0.0, increment(step)], [increment(step), 0.0]]).collect()
}

/// Increments of a uniaxial pulse with a decaying tail of oscillations.
fn wave(amplitude: f64) -> Vec<Plane> {
    let at = |step: usize| {
        let time = step as f64 / 40.0;
        -amplitude
            * ((-(time - 1.0).powi(2) / 0.1).exp() + 0.2 * (9.0 * time).sin() * (1.0 - (-time).exp()) * (-time).exp())
    };
    (0..160).map(|step| [[0.0, 0.0], [0.0, at(step + 1) - at(step)]]).collect()
}

/// A packing with its law.
struct Cell<'a> {
    packing: &'a PackingFile,
    pressure: f64,
}

/// One solver on one path.
struct Driven {
    stresses: Vec<Plane>,
    state: GrainState,
    evaluations: u64,
    counts: [usize; 3],
}

impl Cell<'_> {
    fn definition(&self, options: RveOptions) -> GrainDefinition {
        let contact =
            ContactTable { normal_stiffness: None, modulus: Some(1.0e8), ..ContactTable::linear(1.0, 0.5, 0.5) };
        GrainDefinition { packing: self.packing.clone(), contact, options }
    }

    fn driven(&self, options: RveOptions, start: &GrainState, path: &[Plane]) -> anyhow::Result<Driven> {
        let definition = self.definition(options);
        let model = GrainModel::new(&definition)?;
        let mut solver = Discs::solver(definition.options.solver, &definition.contact)?;
        solver.use_responses(Box::new(NetworkResponses::default()));
        let mut driven = Driven { stresses: Vec::new(), state: start.clone(), evaluations: 0, counts: [0; 3] };
        for strain in path {
            let ramp_steps = ramp_steps(&definition.options, strain);
            let end = solver.solve_one(
                &model,
                SolveJob { state: &driven.state, strain: *strain, ramp_steps, counts_work: false },
            )?;
            driven.evaluations += end.solved.force_evaluations;
            for (count, answered_by) in
                driven.counts.iter_mut().zip([AnsweredBy::Elastic, AnsweredBy::Events, AnsweredBy::HandedOver])
            {
                *count += usize::from(end.solved.answered_by == answered_by);
            }
            driven.stresses.push(solver.network(&model, &end).stress());
            driven.state = end.state;
        }
        Ok(driven)
    }

    /// Time of a new solver alone along a path, s: one that has been there keeps its orders of elimination.
    fn seconds(&self, options: RveOptions, start: &GrainState, path: &[Plane]) -> anyhow::Result<f64> {
        let definition = self.definition(options);
        let model = GrainModel::new(&definition)?;
        let mut solver = Discs::solver(definition.options.solver, &definition.contact)?;
        solver.use_responses(Box::new(NetworkResponses::default()));
        let mut state = start.clone();
        let begin = Instant::now();
        for strain in path {
            let ramp_steps = ramp_steps(&definition.options, strain);
            state = solver
                .solve_one(&model, SolveJob { state: &state, strain: *strain, ramp_steps, counts_work: false })?
                .state;
        }
        Ok(begin.elapsed().as_secs_f64())
    }

    fn error(&self, stresses: &[Plane], reference: &[Plane]) -> f64 {
        let of = |a: &Plane, b: &Plane| {
            let squares = a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b) * (a - b));
            squares.sum::<f64>().sqrt() / self.pressure
        };
        stresses.iter().zip(reference).map(|(a, b)| of(a, b)).fold(0.0, f64::max)
    }
}

/// Steps of the ramp of an increment.
fn ramp_steps(options: &RveOptions, strain: &Plane) -> u32 {
    let largest = strain.iter().flatten().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    ((largest / options.strain_per_step()).ceil() as u32).max(5)
}

fn event_driven() -> RveOptions {
    RveOptions { solver: SolverName::EventDriven, ..RveOptions::default() }
}

fn with(strain_per_step: f64, tolerance: f64) -> RveOptions {
    RveOptions { strain_per_step: Some(strain_per_step), tolerance: Some(tolerance), ..RveOptions::default() }
}

fn measure(name: &str) -> anyhow::Result<()> {
    let packing = PackingFile::<Discs>::read(Path::new(name))?;
    let cell = Cell { packing: &packing, pressure: 1e5 };
    let tight = || with(1e-7, 1e-8);
    let fresh = GrainRve::new(&cell.definition(tight()))?.committed().clone();
    let compression: Vec<Plane> = (0..20).map(|_| [[1.25e-5, 0.0], [0.0, -5e-5]]).collect();
    let loaded = cell.driven(tight(), &fresh, &compression)?.state;
    let shaken = cell.driven(tight(), &loaded, &cyclic(1e-4, 20))?.state;
    for (history, start) in [("as prepared", &fresh), ("compressed", &loaded), ("shaken down", &shaken)] {
        for (kind, path) in
            [("shear 1e-5", cyclic(1e-5, 3)), ("shear 1e-4", cyclic(1e-4, 3)), ("pulse 1e-5", wave(1e-5))]
        {
            let reference = cell.driven(with(2.5e-8, 1e-9), start, &path)?;
            let solvers = [
                ("relaxation", RveOptions::default()),
                ("event-driven", event_driven()),
                ("relaxation, tight", tight()),
            ];
            let times =
                interleaved(PASSES, solvers.len(), |place| cell.seconds(solvers[place].1.clone(), start, &path))?;
            for ((solver, options), times) in solvers.into_iter().zip(times) {
                // The machine may do other work.
                let seconds = times.into_iter().fold(f64::INFINITY, f64::min);
                let driven = cell.driven(options, start, &path)?;
                let [elastic, events, handed_over] = driven.counts;
                println!(
                    "| {} | {history} | {kind} | {solver} | {:.1} | {:.0} | {:.1e} | {elastic} / {events} / {handed_over} |",
                    Path::new(name).file_stem().context("the packing has a name")?.to_string_lossy(),
                    driven.evaluations as f64 / path.len() as f64,
                    1e6 * seconds / path.len() as f64,
                    cell.error(&driven.stresses, &reference.stresses),
                );
            }
        }
    }
    Ok(())
}

/// Stress at the end of cycle 1, 10, 100, ... against tight relaxation on the same path.
fn drift(cycles: usize, name: &str) -> anyhow::Result<()> {
    let packing = PackingFile::<Discs>::read(Path::new(name))?;
    let cell = Cell { packing: &packing, pressure: 1e5 };
    let tight = || with(1e-7, 1e-8);
    let fresh = GrainRve::new(&cell.definition(tight()))?.committed().clone();
    let shaken = cell.driven(tight(), &fresh, &cyclic(1e-4, 20))?.state;
    let path = cyclic(1e-5, cycles);
    let reference = cell.driven(tight(), &shaken, &path)?;
    let decades: Vec<usize> =
        std::iter::successors(Some(1), |cycle| Some(10 * cycle)).take_while(|cycle| *cycle <= cycles).collect();
    for (solver, options) in [("relaxation", RveOptions::default()), ("event-driven", event_driven())] {
        let driven = cell.driven(options, &shaken, &path)?;
        let ends = |stresses: &[Plane]| decades.iter().map(|cycle| stresses[40 * cycle - 1]).collect::<Vec<Plane>>();
        for (cycle, (end, reference)) in
            decades.iter().zip(ends(&driven.stresses).iter().zip(ends(&reference.stresses)))
        {
            println!(
                "| {} | {solver} | {cycle} | {:.1e} | {:.1} |",
                Path::new(name).file_stem().context("the packing has a name")?.to_string_lossy(),
                cell.error(&[*end], &[reference]),
                driven.evaluations as f64 / path.len() as f64,
            );
        }
    }
    Ok(())
}

/// See the head of this file.
pub(super) fn run(arguments: &[String]) -> anyhow::Result<()> {
    if let [mode, cycles, packings @ ..] = arguments
        && mode == "drift"
    {
        let cycles = cycles.parse().with_context(|| format!("`{cycles}` is no number of cycles"))?;
        println!("| packing | solver | cycle | difference from tight relaxation / p | evaluations each |");
        println!("| --- | --- | --- | --- | --- |");
        return packings.iter().try_for_each(|name| drift(cycles, name));
    }
    println!(
        "| packing | state | increments | solver | evaluations each | us each | largest error / p | elastic / events / handed over |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    let usual =
        ["packings/discs-100.json", "packings/discs-400.json", "packings/discs-400-dense.json"].map(String::from);
    for name in if arguments.is_empty() { &usual[..] } else { arguments } {
        measure(name)?;
    }
    Ok(())
}
