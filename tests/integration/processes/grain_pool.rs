//! The pool of `grain-pool` as other programs use it: the bits of a single cell, states, lost workers, refusals, stops.

use crate::harness::table::Table;
use grain_pool::{PoolError, PoolOptions, Rve, RvePool, Snapshot, State, Trial, element_test};
use protocol::{Observables, TangentKind, Tensor2, TrialOptions, TrialResult};
use rve_server::definition::AnyDefinition;
use rve_server::space::{inverse, product};
use scene_reader::{Document, read_cell};
use std::path::Path;
use std::time::{Duration, Instant};

const CELL: &str = "packing = 'packings/discs-100.json'
contact = { modulus = 1.0e8, stiffness_ratio = 0.5, friction = 0.5 }
rve = { accuracy = 'draft' }
";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn cell(more: &[&str]) -> AnyDefinition {
    let overrides: Vec<String> = more.iter().map(|&text| text.to_owned()).collect();
    read_cell(&Document::from_text(&root().join("cell.toml"), CELL.to_owned(), &overrides).unwrap()).unwrap()
}

fn pool(workers: usize) -> RvePool {
    let options = PoolOptions { workers, ..PoolOptions::new(env!("CARGO_BIN_EXE_grainspan")) };
    RvePool::open(vec![cell(&[])], options).unwrap()
}

/// Vertical compression with some shear; every point differs.
fn trial(state: State, strain: f64) -> Trial {
    let share = 1.0 + 0.1 * state.number() as f64;
    let target = Tensor2::from_plane([[0.3 * strain, 0.2 * strain * share], [0.0, -strain * share]]);
    let options = TrialOptions {
        tangent: TangentKind::TrussLikeSlip,
        observables: Observables::ALL,
        ramp_steps: 0,
        ..TrialOptions::default()
    };
    Trial { state, target, options }
}

fn trials(states: &[State], strain: f64) -> Vec<Trial> {
    states.iter().map(|&state| trial(state, strain)).collect()
}

/// Everything of a result that is the same in every run; times are not.
fn bits(result: &TrialResult) -> Vec<u64> {
    let tangent = result.tangent.as_ref().map_or(&[][..], |tangent| &tangent.0[..]);
    let fabric = &result.observed.fabric.0;
    let scalars = [result.scalars.void_ratio, result.scalars.unbalanced_force_ratio, result.observed.elastic_energy];
    [&result.stress.0, tangent, fabric, &scalars].concat().into_iter().map(f64::to_bits).collect()
}

fn all_bits(results: &[TrialResult]) -> Vec<Vec<u64>> {
    results.iter().map(bits).collect()
}

#[test]
fn a_path_has_the_bits_of_a_cell_in_process_for_any_number_of_workers() {
    let steps = [2e-4, 3e-4, -1e-4];
    let path = |workers: usize| {
        let pool = pool(workers);
        let states = pool.new_states(0, 5).unwrap();
        let mut found = Vec::new();
        for strain in steps {
            found.extend(all_bits(&pool.trial(&trials(&states, strain)).unwrap()));
            pool.commit(&states).unwrap();
        }
        let snapshots = pool.snapshot(&states).unwrap();
        (found, snapshots.iter().map(Snapshot::to_bytes).collect::<Vec<_>>(), states)
    };
    let (alone, snapshots, states) = path(1);
    let (several, snapshots_of_several, _) = path(3);
    assert_eq!((&alone, &snapshots), (&several, &snapshots_of_several));
    for (number, &state) in states.iter().enumerate() {
        let mut rve = Rve::new(&cell(&[])).unwrap();
        for (step, strain) in steps.into_iter().enumerate() {
            let Trial { target, options, .. } = trial(state, strain);
            let result = rve.trial(&target, &options).unwrap();
            assert_eq!(bits(&result), alone[5 * step + number], "point {number}, step {step}");
            rve.commit().unwrap();
        }
        assert_eq!(rve.snapshot().to_bytes(), snapshots[number]);
    }
}

/// The rows of `grainspan element`: a prescribed path, each increment a trial of the pool.
#[test]
fn a_path_has_the_rows_of_an_element_test() {
    let test = format!("{CELL}[[path]]\nincrements = 1\nrepeat = 4\nstrain = {{ xx = 1e-4, yy = -2e-4 }}\n");
    let outcome = element_test(test, root(), TangentKind::None, &mut || true).unwrap();
    let rows = String::from_utf8(outcome.csv).unwrap();
    assert_eq!(outcome.summary.rows, 5);
    let pool = pool(1);
    let states = pool.new_states(0, 1).unwrap();
    let change = [[1e-4, 0.0, 0.0], [0.0, -2e-4, 0.0], [0.0; 3]];
    let mut deformation = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for values in Table::of(&rows).rows().into_iter().skip(1) {
        // As the driver forms it: relative to the committed deformation, which costs a rounding.
        let target = product(&product(&change, &deformation), &inverse(&deformation));
        (deformation[0][0], deformation[1][1]) = (values[1], values[4]);
        let options = TrialOptions { observables: Observables::ALL, ..TrialOptions::default() };
        let target = Tensor2::from_rows(&target);
        let request = Trial { state: states[0], target, options };
        let result = pool.trial(&[request]).unwrap().remove(0);
        pool.commit(&states).unwrap();
        let stress = result.stress.plane();
        assert_eq!([stress[0][0], stress[0][1], stress[1][0], stress[1][1]], values[5..9], "{values:?}");
        assert_eq!(result.scalars.void_ratio, values[9]);
    }
}

#[test]
fn trials_leave_committed_states_alone_and_snapshots_travel_between_pools() {
    let (first, second) = (pool(1), pool(1));
    let states = first.new_states(0, 2).unwrap();
    let initial = first.snapshot(&states).unwrap();
    let result = first.trial(&trials(&states, 3e-4)).unwrap();
    assert_eq!(all_bits(&result), all_bits(&first.trial(&trials(&states, 3e-4)).unwrap()));
    first.rollback(&states[..1]).unwrap();
    assert!(matches!(first.commit(&states), Err(PoolError::NothingToCommit { place: 0 })));
    first.commit(&states[1..]).unwrap();
    let kept = first.snapshot(&states).unwrap();
    assert_eq!(kept[0].to_bytes(), initial[0].to_bytes());
    assert_ne!(kept[1].to_bytes(), initial[1].to_bytes());

    let elsewhere = second.new_states(0, 1).unwrap();
    let read = Snapshot::from_bytes(&kept[1].to_bytes()).unwrap();
    second.restore(&elsewhere, &[read]).unwrap();
    let again = |pool: &RvePool, state| all_bits(&pool.trial(&[Trial { state, ..trial(states[0], 1e-4) }]).unwrap());
    assert_eq!(again(&second, elsewhere[0]), again(&first, states[1]));
    assert!(matches!(second.trial(&trials(&states, 1e-4)), Err(PoolError::ForeignState { place: 0 })));
    first.restore(&states[1..], &initial[..1]).unwrap();
    assert_eq!(first.snapshot(&states).unwrap()[1].to_bytes(), initial[0].to_bytes());
}

#[test]
fn damaged_and_foreign_snapshots_are_refused() {
    let pool = pool(1);
    let states = pool.new_states(0, 1).unwrap();
    pool.trial(&trials(&states, 1e-4)).unwrap();
    pool.commit(&states).unwrap();
    let mut bytes = pool.snapshot(&states).unwrap()[0].to_bytes();
    let mut other = Rve::new(&cell(&["contact.friction=0.4"])).unwrap();
    let sound = Snapshot::from_bytes(&bytes).unwrap();
    assert!(matches!(other.restore(&sound, &cell(&[])), Err(PoolError::Snapshot { .. })));
    *bytes.last_mut().unwrap() ^= 1;
    assert!(Snapshot::from_bytes(&bytes).unwrap_err().to_string().contains("damaged"));
    assert!(Snapshot::from_bytes(b"short").unwrap_err().to_string().contains("too short"));
}

#[test]
fn a_killed_worker_costs_no_result() {
    let pool = pool(2);
    let states = pool.new_states(0, 40).unwrap();
    let expected = all_bits(&pool.trial(&trials(&states, 2e-3)).unwrap());
    let killed = pool.worker_processes().unwrap()[0];
    let killer = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(30));
        let pid = rustix::process::Pid::from_raw(i32::try_from(killed).unwrap()).unwrap();
        rustix::process::kill_process(pid, rustix::process::Signal::KILL).unwrap();
    });
    assert_eq!(all_bits(&pool.trial(&trials(&states, 2e-3)).unwrap()), expected);
    killer.join().unwrap();
    // The loss is noticed at the latest by the next call.
    assert_eq!(all_bits(&pool.trial(&trials(&states, 2e-3)).unwrap()), expected);
    assert!(!pool.worker_processes().unwrap().contains(&killed));
    assert_eq!(pool.statistics().unwrap().workers_lost, 1);
}

#[test]
fn refusals_name_the_point_and_leave_the_pool_in_service() {
    let pool = pool(1);
    let states = pool.new_states(0, 3).unwrap();
    let mut request = trials(&states, 1e-4);
    request[1].target = Tensor2::from_plane([[-3.0, 0.0], [0.0, 1.0]]);
    let refused = pool.trial(&request).unwrap_err();
    assert!(
        matches!(refused, PoolError::Refused { point: 1, .. }) && refused.is_curable_by_smaller_step(),
        "{refused}"
    );
    assert!(matches!(pool.commit(&states), Err(PoolError::NothingToCommit { .. })));
    pool.trial(&trials(&states, 1e-4)).unwrap();
    assert!(matches!(pool.new_states(1, 1), Err(PoolError::NoSuchCell { cell: 1, cells: 1 })));
    pool.close();
    assert!(matches!(pool.trial(&trials(&states, 1e-4)), Err(PoolError::Closed)));
}

#[test]
fn a_stop_ends_a_call_and_not_the_pool() {
    let pool = pool(1);
    let states = pool.new_states(0, 40).unwrap();
    let long = trials(&states, 2e-2);
    let begun = Instant::now();
    assert!(matches!(pool.trial_while(&long, &mut || false), Err(PoolError::Interrupted)));
    assert!(begun.elapsed() < Duration::from_secs(5), "{:?}", begun.elapsed());
    let short = trials(&states[..2], 1e-4);
    let mut rve = Rve::new(&cell(&[])).unwrap();
    let expected = bits(&rve.trial(&short[0].target, &short[0].options).unwrap());
    assert_eq!(bits(&pool.trial(&short).unwrap()[0]), expected);
}

#[test]
fn a_pool_that_cannot_start_says_why() {
    let open = |program: &str, workers| {
        let options = PoolOptions { workers, ..PoolOptions::new(program) };
        RvePool::open(vec![cell(&[])], options).err().expect("nothing can start").to_string()
    };
    assert!(open("/nonexistent/grainspan", 1).contains("there is no program at /nonexistent/grainspan"));
    assert!(open(env!("CARGO_BIN_EXE_grainspan"), 0).contains("at least one worker"));
    assert!(open("/bin/false", 1).contains("exit status: 1"));
}
