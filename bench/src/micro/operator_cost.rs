//! Cost in processor time of tangent operators against that of one default increment of 1e-3, and the force evaluations of
//! their probes (least and median of five rounds):
//! `grainspan bench micro operator_cost PACKING [strain before] [repeats] [operators]`;
//! all operators if none is named. Discs have linear contacts, spheres Hertz-Mindlin contacts of glass.
//!
//! Each round makes a new cell for every operator. Within a round an operator that needs no grain solver is repeated (30 times), and all but
//! the first find the order of elimination again, as at a point whose contacts stay; one repeat shows what a new network costs.

use super::processor_time::processor_time;
use crate::repeat::interleaved;
use anyhow::Context;
use protocol::{RveSolver, TangentKind, Tensor2, TrialOptions};
use rve_server::contact::ContactTable;
use rve_server::definition::{GrainDefinition, Packing, PackingFile, RveOptions};
use rve_server::engine::GrainRve;
use rve_server::solver::SolverFor;
use rve_server::tangent::needs_grain_solver;
use std::path::Path;

/// Rounds of measurements.
const ROUNDS: usize = 5;

/// See the head of this file.
pub(super) fn run(arguments: &[String]) -> anyhow::Result<()> {
    let path = arguments.first().map_or("packings/discs-400.json", String::as_str);
    let strain: f64 = arguments.get(1).map_or(Ok(2e-3), |text| text.parse())?;
    let repeats: usize = arguments.get(2).map_or(Ok(30), |text| text.parse())?;
    let operator =
        |name: &String| name.parse::<TangentKind>().with_context(|| format!("there is no operator `{name}`"));
    let named: Vec<TangentKind> = arguments.iter().skip(3).map(operator).collect::<anyhow::Result<_>>()?;
    let all = TangentKind::ALL.into_iter().filter(|kind| *kind != TangentKind::None);
    let kinds = if named.is_empty() { all.collect() } else { named };
    let linear = ContactTable { normal_stiffness: None, modulus: Some(1e8), ..ContactTable::linear(1.0, 0.5, 0.5) };
    let glass = "law = \"hertz_mindlin\"\nshear_modulus = 29e9\npoisson_ratio = 0.2\nfriction = 0.5";
    match Packing::read(Path::new(path))? {
        Packing::Discs(packing) => measure(packing, linear, strain, repeats, &kinds),
        Packing::Spheres(packing) => measure(packing, toml::from_str(glass)?, strain, repeats, &kinds),
    }
}

#[expect(clippy::print_stdout, reason = "a program for people")]
fn measure<S: SolverFor>(
    packing: PackingFile<S>,
    contact: ContactTable,
    strain: f64,
    repeats: usize,
    kinds: &[TangentKind],
) -> anyhow::Result<()> {
    let definition = GrainDefinition { packing, contact, options: RveOptions::default() };
    let target = |size: f64| Tensor2::from_plane([[0.0, 0.0], [0.0, -size]]);
    let mut strained = GrainRve::new(&definition)?;
    strained.trial(&target(strain), &TrialOptions::default())?;
    strained.commit()?;
    let mut state = Vec::new();
    strained.snapshot(&mut state);
    let mut increments = Vec::new();
    let mut outcomes = vec![None; kinds.len()];
    let mut counts = [0; 2];
    let mut evaluations = 0;
    // Rounds of all kinds in turn, so that a busy moment of the machine meets them all. The clock ticks in milliseconds:
    // each round of a cheap operator is many evaluations.
    let mut times = interleaved(ROUNDS, kinds.len(), |place| -> anyhow::Result<f64> {
        let mut cell = GrainRve::new(&definition)?;
        cell.restore(&state)?;
        let started = processor_time();
        let answer = cell.trial(&target(1e-3), &TrialOptions::default())?;
        increments.push((processor_time() - started) * 1e3);
        evaluations = answer.cost.force_evaluations;
        let network = cell.network().context("there is no trial")?;
        counts = [network.radii.len(), network.contacts.len()];
        let repeats = if needs_grain_solver(kinds[place]) { 1 } else { repeats.max(1) };
        let started = processor_time();
        for _ in 0..repeats {
            outcomes[place] = cell.operator(kinds[place]);
        }
        Ok((processor_time() - started) * 1e3 / repeats as f64)
    })?;
    let increment = least_and_median(&mut increments);
    let [grains, contacts] = counts;
    println!(
        "{grains} grains, {contacts} contacts; increment of 1e-3: {:.2} ms (median {:.2} ms), {evaluations} force evaluations",
        increment[0], increment[1]
    );
    for ((kind, times), outcome) in kinds.iter().zip(&mut times).zip(outcomes) {
        let [least, median] = least_and_median(times);
        let perturbed = outcome.context("there is no trial")?;
        println!(
            "{:32} {least:10.3} ms ({median:10.3})  {:8.2} % of the increment, {:6} force evaluations, C1111 {:.4e}{}{}",
            kind.keyword(),
            100.0 * least / increment[0],
            perturbed.force_evaluations,
            perturbed.outcome.operator.get(0, 0, 0, 0),
            if perturbed.outcome.fallback { " FALLBACK" } else { "" },
            if perturbed.outcome.regularised { " regularised" } else { "" },
        );
    }
    Ok(())
}

fn least_and_median(times: &mut [f64]) -> [f64; 2] {
    times.sort_by(f64::total_cmp);
    [times[0], times[times.len() / 2]]
}
