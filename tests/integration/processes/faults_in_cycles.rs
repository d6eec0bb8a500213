//! Check S-14: ten thousand commits and rollbacks leave the same bits and need no memory.

use claims::Claim;
use macro_solver::material::{PointMaterial, PointTrial};
use macro_solver::pool::{Interrupt, JoiningWorkers, Pool, PoolSettings};
use protocol::transport::in_process::channel;
use protocol::{Definition, RveEngine, Tensor2, TrialOptions};
use rve_server::definition::{GrainDefinition, PackingFile, RveOptions};
use rve_server::engine::GrainEngine;
use rve_server::server::{ServeOptions, serve};
use std::path::Path;

const CYCLES: u32 = 10_000;

/// Growth that is no growth, bytes: what the allocator keeps in hand.
const SLACK: u64 = 2 << 20;

fn definition() -> Definition {
    let packing: PackingFile = PackingFile::read(Path::new("packings/discs-100.json")).unwrap();
    let contact = toml::from_str("law = \"linear\"\nmodulus = 1e8\nstiffness_ratio = 0.5\nfriction = 0.5").unwrap();
    let options: RveOptions = toml::from_str("accuracy = \"draft\"").unwrap();
    GrainDefinition { packing, contact, options }.validate().unwrap().to_protocol()
}

fn target(size: f64) -> Tensor2 {
    Tensor2::from_plane([[0.3 * size, 0.1 * size], [0.0, -size]])
}

/// Memory of this process that is in use, bytes.
fn resident() -> u64 {
    let text = std::fs::read_to_string("/proc/self/statm").unwrap();
    let pages: u64 = text.split_whitespace().nth(1).unwrap().parse().unwrap();
    pages * 4096
}

/// Runs the cycles; the first thousand may still fill caches.
fn without_growth(what: &str, mut cycle: impl FnMut(u32)) {
    (0..CYCLES / 10).for_each(&mut cycle);
    let before = resident();
    (CYCLES / 10..CYCLES).for_each(&mut cycle);
    let grown = resident().saturating_sub(before);
    Claim::of("S-14", &format!("growth of the memory over the last 9000 of 10 000 cycles of {what}, bytes"))
        .number(grown as f64)
        .at_most(SLACK as f64);
}

/// States that are the same as before, of as many as there should be.
fn all_returned(quantity: &str, same: u32, of: u32) {
    Claim::of("S-14", quantity).value(f64::from(same), f64::from(of)).within_absolute(0.0);
}

#[test]
fn a_cell_returns_to_the_same_bits_ten_thousand_times() {
    let mut cell = GrainEngine.create(&definition()).unwrap();
    let options = TrialOptions { ramp_steps: 2, ..TrialOptions::default() };
    cell.trial(&target(1e-4), &options).unwrap();
    cell.commit().unwrap();
    let (mut start, mut end, mut now) = (Vec::new(), Vec::new(), Vec::new());
    cell.snapshot(&mut start);
    cell.trial(&target(-2e-5), &options).unwrap();
    cell.snapshot_trial(&mut end).unwrap();
    let (mut same_starts, mut same_ends) = (0, 0);
    without_growth("a cell", |number| {
        cell.trial(&target(1e-5 * f64::from(number % 7)), &options).unwrap();
        cell.rollback();
        if number % 5 == 0 {
            cell.trial(&target(-2e-5), &options).unwrap();
            cell.commit().unwrap();
            cell.snapshot(&mut now);
            same_ends += u32::from(now == end);
            cell.restore(&start).unwrap();
        }
        cell.snapshot(&mut now);
        same_starts += u32::from(now == start);
    });
    all_returned("states of a cell with the bits of the first after rollback or restore", same_starts, CYCLES);
    all_returned("states of a cell with the bits of the first after a commit", same_ends, CYCLES / 5);
}

#[test]
fn a_pool_returns_to_the_same_states_ten_thousand_times() {
    let (port, connector) = channel();
    let servant =
        std::thread::spawn(move || serve(&mut GrainEngine, &mut connector.join(), &ServeOptions::new("cycles")));
    let settings = PoolSettings::new("cycles");
    let mut pool = Pool::new(port, Box::new(JoiningWorkers), Interrupt::new(), settings, vec![definition()], &[0, 0]);
    let options = TrialOptions { ramp_steps: 1, ..TrialOptions::default() };
    let trials =
        |size: f64| [0, 1].map(|point| PointTrial { point, target: target(size * (1.0 + point as f64)), options });
    pool.evaluate(&trials(1e-4)).unwrap();
    pool.commit().unwrap();
    let start = [0, 1].map(|point| pool.committed_snapshot(point).1.clone());
    let mut first = None;
    let (mut same_starts, mut same_ends) = (0, 0);
    without_growth("a pool", |number| {
        pool.evaluate(&trials(1e-5)).unwrap();
        pool.rollback();
        if number % 10 == 0 {
            pool.evaluate(&trials(2e-5)).unwrap();
            pool.commit().unwrap();
            let ids = [0, 1].map(|point| pool.committed_snapshot(point).1.id);
            same_ends += u32::from(*first.get_or_insert(ids) == ids);
            (0..2).for_each(|point| pool.restore_point(point, start[point].clone()));
        }
        same_starts += u32::from((0..2).all(|point| pool.committed_snapshot(point).1.id == start[point].id));
    });
    all_returned("states of a pool that are the first again after rollback or restore", same_starts, CYCLES);
    all_returned("states of a pool that are the first again after a commit", same_ends, CYCLES / 10);
    pool.close();
    servant.join().unwrap().unwrap();
}
