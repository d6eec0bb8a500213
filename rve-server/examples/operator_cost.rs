//! Cost in processor time of tangent operators against that of one default increment of 1e-3, and the force evaluations of
//! their probes (least and median of five rounds):
//! `cargo run --release -p grainspan-rve-server --example operator_cost -- PACKING [strain before] [repeats] [operators]`;
//! all operators if none is named. Discs have linear contacts, spheres Hertz-Mindlin contacts of glass.

#[path = "support/processor_time.rs"]
mod processor_time;

use processor_time::processor_time;
use protocol::{RveSolver, TangentKind, Tensor2, TrialOptions};
use rve_server::contact::ContactTable;
use rve_server::definition::{GrainDefinition, Packing, PackingFile, RveOptions};
use rve_server::engine::GrainRve;
use rve_server::solver::SolverFor;
use rve_server::tangent::needs_grain_solver;
use std::path::Path;

/// Rounds of measurements.
const ROUNDS: usize = 5;

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let path = arguments.get(1).map_or("packings/discs-400.json", String::as_str);
    let strain: f64 = arguments.get(2).map_or(2e-3, |text| text.parse().expect("a strain"));
    let repeats: usize = arguments.get(3).map_or(30, |text| text.parse().expect("a count"));
    let named: Vec<TangentKind> = arguments
        .iter()
        .skip(4)
        .map(|name| {
            TangentKind::ALL.into_iter().find(|kind| kind.keyword() == name).expect("the keyword of an operator")
        })
        .collect();
    let all = TangentKind::ALL.into_iter().filter(|kind| *kind != TangentKind::None);
    let kinds = if named.is_empty() { all.collect() } else { named };
    let linear = ContactTable { normal_stiffness: None, modulus: Some(1e8), ..ContactTable::linear(1.0, 0.5, 0.5) };
    let glass = "law = \"hertz_mindlin\"\nshear_modulus = 29e9\npoisson_ratio = 0.2\nfriction = 0.5";
    match Packing::read(Path::new(path)).expect("a packing") {
        Packing::Discs(packing) => measure(packing, linear, strain, repeats, &kinds),
        Packing::Spheres(packing) => {
            measure(packing, toml::from_str(glass).expect("a sound table"), strain, repeats, &kinds);
        }
    }
}

#[expect(clippy::print_stdout, reason = "a program for people")]
fn measure<S: SolverFor>(
    packing: PackingFile<S>,
    contact: ContactTable,
    strain: f64,
    repeats: usize,
    kinds: &[TangentKind],
) {
    let mut cell =
        GrainRve::new(&GrainDefinition { packing, contact, options: RveOptions::default() }).expect("a cell");
    let target = |size: f64| Tensor2::from_plane([[0.0, 0.0], [0.0, -size]]);
    cell.trial(&target(strain), &TrialOptions::default()).expect("a trial");
    cell.commit().expect("a commit");
    let mut increments = Vec::new();
    let mut evaluations = 0;
    for _ in 0..3 {
        let started = processor_time();
        let answer = cell.trial(&target(1e-3), &TrialOptions::default()).expect("a trial");
        increments.push((processor_time() - started) * 1e3);
        evaluations = answer.cost.force_evaluations;
    }
    let increment = least_and_median(&mut increments);
    let network = cell.network().expect("a trial").clone();
    println!(
        "{} grains, {} contacts; increment of 1e-3: {:.2} ms (median {:.2} ms), {evaluations} force evaluations",
        network.radii.len(),
        network.contacts.len(),
        increment[0],
        increment[1]
    );
    // Rounds of all kinds in turn, so that a busy moment of the machine meets them all. The clock ticks in milliseconds:
    // each round of a cheap operator is many evaluations.
    let mut times = vec![Vec::new(); kinds.len()];
    let mut outcomes = vec![None; kinds.len()];
    for round in 0..ROUNDS {
        for ((kind, times), outcome) in kinds.iter().zip(&mut times).zip(&mut outcomes) {
            let needs_grain_solver = needs_grain_solver(*kind);
            if needs_grain_solver && round > 0 {
                continue;
            }
            let repeats = if needs_grain_solver { 1 } else { repeats };
            let started = processor_time();
            for _ in 0..repeats {
                *outcome = cell.operator(*kind);
            }
            times.push((processor_time() - started) * 1e3 / repeats as f64);
        }
    }
    for ((kind, times), outcome) in kinds.iter().zip(&mut times).zip(outcomes) {
        let [least, median] = least_and_median(times);
        let perturbed = outcome.expect("there is a trial");
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
}

fn least_and_median(times: &mut [f64]) -> [f64; 2] {
    times.sort_by(f64::total_cmp);
    [times[0], times[times.len() / 2]]
}
