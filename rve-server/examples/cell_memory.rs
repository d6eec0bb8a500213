//! Memory of a live cell: `cargo run --release -p grainspan-rve-server --example cell_memory -- PACKING [cells]`.
//!
//! Makes many cells of one packing, lets each answer a trial and commit it, and divides what the process has grown by
//! their number (Linux, from `/proc/self/statm`). Cells that only wait cost their snapshot; a worker has one cell per
//! definition and takes the states of its points in turn.

use protocol::{RveSolver, Tensor2, TrialOptions};
use rve_server::contact::ContactTable;
use rve_server::definition::{GrainDefinition, Packing, PackingFile, RveOptions};
use rve_server::engine::GrainRve;
use rve_server::solver::SolverFor;
use std::path::Path;

/// Bytes of a page.
const PAGE: f64 = 4096.0;

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let path = arguments.get(1).map_or("packings/discs-400.json", String::as_str);
    let cells: usize = arguments.get(2).map_or(200, |text| text.parse().expect("a count"));
    match Packing::read(Path::new(path)).expect("a packing") {
        Packing::Discs(packing) => measure(packing, cells),
        Packing::Spheres(packing) => measure(packing, cells),
    }
}

/// Resident memory of this process, bytes.
fn resident() -> f64 {
    let text = std::fs::read_to_string("/proc/self/statm").expect("this example needs Linux");
    text.split_whitespace().nth(1).and_then(|pages| pages.parse::<f64>().ok()).expect("pages") * PAGE
}

#[expect(clippy::print_stdout, reason = "a program for people")]
fn measure<S: SolverFor>(packing: PackingFile<S>, cells: usize) {
    let contact = ContactTable { normal_stiffness: None, modulus: Some(1e8), ..ContactTable::linear(1.0, 0.5, 0.5) };
    let grains = packing.grains.len();
    let definition = GrainDefinition { packing, contact, options: RveOptions::default() };
    let target = Tensor2::from_plane([[0.0, 0.0], [0.0, -1e-5]]);
    let live = || {
        let mut cell = GrainRve::new(&definition).expect("a cell");
        cell.trial(&target, &TrialOptions::default()).expect("a trial");
        cell.commit().expect("a commit");
        cell
    };
    // The first cells fill the allocator's pools.
    let mut all: Vec<GrainRve<S>> = (0..10).map(|_| live()).collect();
    let before = resident();
    all.extend((0..cells).map(|_| live()));
    let each = (resident() - before) / cells as f64;
    let mut snapshot = Vec::new();
    all[0].snapshot(&mut snapshot);
    println!(
        "{grains} {}: a live cell with its working memory takes {:.0} kB, its snapshot {:.1} kB",
        S::GRAINS,
        each / 1e3,
        snapshot.len() as f64 / 1e3
    );
}
