//! Time of every tangent operator against that of one default increment: `cargo run --release -p grainspan-rve-server
//! --example operator_cost -- packings/discs-400.json [strain] [repeats]`.

use protocol::{Ask, RveSolver, TangentKind, Tensor2};
use rve_server::definition::{ContactTable, GrainDefinition, RveOptions};
use rve_server::engine::GrainRve;
use rve_server::packing::PackingFile;
use rve_server::tangent;
use std::path::Path;
use std::time::Instant;

#[expect(clippy::print_stdout, reason = "a program for people")]
fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let path = arguments.get(1).map_or("packings/discs-400.json", String::as_str);
    let strain: f64 = arguments.get(2).map_or(2e-3, |text| text.parse().expect("a strain"));
    let repeats: usize = arguments.get(3).map_or(30, |text| text.parse().expect("a count"));
    let packing = PackingFile::read(Path::new(path)).expect("a packing");
    let contact = ContactTable { normal_stiffness: None, modulus: Some(1e8), ..ContactTable::linear(1.0, 0.5, 0.5) };
    let mut cell =
        GrainRve::new(&GrainDefinition { packing, contact, options: RveOptions::default() }).expect("a cell");
    let target = |size: f64| Tensor2::from_plane([[0.0, 0.0], [0.0, -size]]);
    cell.trial(&target(strain), &Ask::default()).expect("a trial");
    cell.commit().expect("a commit");
    let mut increments = Vec::new();
    let mut evaluations = 0;
    for _ in 0..5 {
        let started = Instant::now();
        let answer = cell.trial(&target(1e-3), &Ask::default()).expect("a trial");
        increments.push(started.elapsed().as_secs_f64() * 1e3);
        evaluations = answer.cost.force_evaluations;
    }
    let increment = least_and_median(&mut increments);
    let network = cell.network().expect("a trial").clone();
    println!(
        "{} grains, {} contacts; increment of 1e-3: {:.2} ms ({:.2} ms), {evaluations} force evaluations",
        network.radii.len(),
        network.contacts.len(),
        increment[0],
        increment[1]
    );
    for kind in TangentKind::ALL.into_iter().filter(|kind| !rve_server::probing::is_probed(*kind)) {
        let mut times = Vec::new();
        let mut outcome = None;
        for _ in 0..repeats {
            let started = Instant::now();
            outcome = Some(tangent::evaluate(&network, kind));
            times.push(started.elapsed().as_secs_f64() * 1e3);
        }
        let [least, median] = least_and_median(&mut times);
        let outcome = outcome.expect("repeated at least once");
        println!(
            "{:32} {least:9.3} ms ({median:.3})  {:8.2} % of the increment{}{}  C1111 {:.6e}",
            kind.keyword(),
            100.0 * least / increment[0],
            if outcome.fallback { " FALLBACK" } else { "" },
            if outcome.regularised { " regularised" } else { "" },
            outcome.operator.get(0, 0, 0, 0)
        );
    }
}

fn least_and_median(times: &mut [f64]) -> [f64; 2] {
    times.sort_by(f64::total_cmp);
    [times[0], times[times.len() / 2]]
}
