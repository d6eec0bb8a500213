//! Memory of a live cell: `grainspan bench micro cell_memory [PACKING] [CELLS]`.
//!
//! Makes many cells of one packing, solves and commits a trial in each, and divides the growth of the process by their number (Linux, from `/proc/self/statm`). Cells that only wait cost their snapshot; a worker has one cell per
//! definition and takes the states of its points in turn.

use anyhow::Context;
use protocol::{RveSolver, Tensor2, TrialOptions};
use rve_server::contact::ContactTable;
use rve_server::definition::{GrainDefinition, Packing, PackingFile, RveOptions};
use rve_server::engine::GrainRve;
use rve_server::solver::SolverFor;
use std::path::Path;

/// Bytes of a page.
const PAGE: f64 = 4096.0;

/// See the head of this file.
pub(super) fn run(arguments: &[String]) -> anyhow::Result<()> {
    let path = arguments.first().map_or("packings/discs-400.json", String::as_str);
    let cells: usize = arguments.get(1).map_or(Ok(200), |text| text.parse())?;
    match Packing::read(Path::new(path))? {
        Packing::Discs(packing) => measure(packing, cells),
        Packing::Spheres(packing) => measure(packing, cells),
    }
}

/// Resident memory of this process, bytes.
fn resident() -> anyhow::Result<f64> {
    let text = std::fs::read_to_string("/proc/self/statm")?;
    let pages = text.split_whitespace().nth(1).context("/proc/self/statm has no second number")?;
    Ok(pages.parse::<f64>()? * PAGE)
}

#[expect(clippy::print_stdout, reason = "a program for people")]
fn measure<S: SolverFor>(packing: PackingFile<S>, cells: usize) -> anyhow::Result<()> {
    let contact = ContactTable { normal_stiffness: None, modulus: Some(1e8), ..ContactTable::linear(1.0, 0.5, 0.5) };
    let grains = packing.grains.len();
    let definition = GrainDefinition { packing, contact, options: RveOptions::default() };
    let target = Tensor2::from_plane([[0.0, 0.0], [0.0, -1e-5]]);
    let live = || -> anyhow::Result<GrainRve<S>> {
        let mut cell = GrainRve::new(&definition)?;
        cell.trial(&target, &TrialOptions::default())?;
        cell.commit()?;
        Ok(cell)
    };
    // The first cells fill the allocator's pools.
    let mut all = (0..10).map(|_| live()).collect::<anyhow::Result<Vec<_>>>()?;
    let before = resident()?;
    for _ in 0..cells {
        all.push(live()?);
    }
    let each = (resident()? - before) / cells as f64;
    let mut snapshot = Vec::new();
    all[0].snapshot(&mut snapshot);
    println!(
        "{grains} {}: a live cell with its working memory takes {:.0} kB, its snapshot {:.1} kB",
        S::GRAINS,
        each / 1e3,
        snapshot.len() as f64 / 1e3
    );
    Ok(())
}
