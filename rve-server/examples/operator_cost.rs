//! Cost of every tangent operator against that of one default increment of 1e-3, and the force evaluations of its probes:
//! `cargo run --release -p grainspan-rve-server --example operator_cost -- PACKING [strain before] [repeats]`.

use protocol::{Ask, RveSolver, TangentKind, Tensor2};
use rve_server::definition::{ContactTable, GrainDefinition, RveOptions};
use rve_server::engine::GrainRve;
use rve_server::packing::{Packing, PackingFile};
use rve_server::space::Space;
use std::path::Path;
use std::time::Instant;

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let path = arguments.get(1).map_or("packings/discs-400.json", String::as_str);
    let strain: f64 = arguments.get(2).map_or(2e-3, |text| text.parse().expect("a strain"));
    let repeats: usize = arguments.get(3).map_or(30, |text| text.parse().expect("a count"));
    match Packing::read(Path::new(path)).expect("a packing") {
        Packing::Discs(packing) => measure(packing, strain, repeats),
        Packing::Spheres(packing) => measure(packing, strain, repeats),
    }
}

#[expect(clippy::print_stdout, reason = "a program for people")]
fn measure<S: Space>(packing: PackingFile<S>, strain: f64, repeats: usize) {
    let contact = ContactTable { normal_stiffness: None, modulus: Some(1e8), ..ContactTable::linear(1.0, 0.5, 0.5) };
    let mut cell =
        GrainRve::new(&GrainDefinition { packing, contact, options: RveOptions::default() }).expect("a cell");
    let target = |size: f64| Tensor2::from_plane([[0.0, 0.0], [0.0, -size]]);
    cell.trial(&target(strain), &Ask::default()).expect("a trial");
    cell.commit().expect("a commit");
    let mut increments = Vec::new();
    let mut evaluations = 0;
    for _ in 0..3 {
        let started = Instant::now();
        let answer = cell.trial(&target(1e-3), &Ask::default()).expect("a trial");
        increments.push(started.elapsed().as_secs_f64() * 1e3);
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
    for kind in TangentKind::ALL.into_iter().filter(|kind| *kind != TangentKind::None) {
        let mut times = Vec::new();
        let mut probed = None;
        let repeats = if rve_server::probing::is_probed(kind) { 1 } else { repeats };
        for _ in 0..repeats {
            let started = Instant::now();
            probed = cell.operator(kind);
            times.push(started.elapsed().as_secs_f64() * 1e3);
        }
        let [least, median] = least_and_median(&mut times);
        let probed = probed.expect("there is a trial");
        println!(
            "{:32} {least:10.3} ms ({median:10.3})  {:8.2} % of the increment, {:6} force evaluations, C1111 {:.4e}{}{}",
            kind.keyword(),
            100.0 * least / increment[0],
            probed.force_evaluations,
            probed.outcome.operator.get(0, 0, 0, 0),
            if probed.outcome.fallback { " FALLBACK" } else { "" },
            if probed.outcome.regularised { " regularised" } else { "" },
        );
    }
}

fn least_and_median(times: &mut [f64]) -> [f64; 2] {
    times.sort_by(f64::total_cmp);
    [times[0], times[times.len() / 2]]
}
