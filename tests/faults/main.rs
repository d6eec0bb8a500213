//! Whatever happens to workers and to the macro, the answer keeps its bits: a randomized campaign of injected faults.
//!
//! Without arguments a fast selection runs, as part of the tests. `cargo test --release --test faults -- --cases 120
//! --seed 7` is a campaign; `--case K` repeats one case of it, `--jobs N` runs N at
//! a time: most of the time of a case is waiting for deadlines. Every case is a run of the real program on a shipped scene,
//! shortened, that is drawn from all procedures, links, regions and stages. It is disturbed in one of three manners, and compared byte for byte with the same run undisturbed:
//!
//! - *faulty*: the workers are this program in the role of a worker. It is the real worker loop with the real engine, and
//!   fails in a given way when it reaches a given state of the protocol;
//! - *struck*: the run's own workers get SIGKILL, SIGSTOP, SIGSEGV and SIGTERM at times that nobody chose;
//! - *resumed*: the macro itself gets SIGKILL, SIGTERM or SIGINT, again and again, and is continued with `--resume`.
//!
//! `--steady ROUNDS [--every SECONDS]` measures instead what a worker killed every so often costs (P-7).
//!
//! Nothing of this is compiled into the program.
#![allow(clippy::print_stdout, unreachable_pub, reason = "a program of its own that reports to people")]

mod case;
#[path = "../harness/children.rs"]
mod children;
mod compare;
mod draw;
mod fault;
mod macros;
#[path = "../harness/short_scenes.rs"]
mod short_scenes;
mod steady;
mod worker;

use case::{Site, Tally};
use claims::Claim;
use draw::Draw;
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// Cases of the fast selection.
const FAST: u64 = 9;

/// Cases at a time.
const JOBS: usize = 3;

/// Cases from which on every state must have been hit.
const CAMPAIGN: u64 = 100;

struct Arguments {
    cases: u64,
    seed: u64,
    only: Option<u64>,
    jobs: usize,
    steady: Option<u64>,
    every: u64,
}

/// Understands its own arguments; what the test runner may add (filters, `--nocapture`) is passed over.
fn arguments() -> Arguments {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number = |name: &str| {
        let place = words.iter().position(|word| word == name)?;
        words.get(place + 1)?.parse::<u64>().ok()
    };
    Arguments {
        cases: number("--cases").unwrap_or(FAST),
        seed: number("--seed").unwrap_or(1),
        only: number("--case"),
        steady: number("--steady"),
        every: number("--every").unwrap_or(60),
        jobs: number("--jobs").map_or(JOBS, |jobs| jobs.clamp(1, 64) as usize),
    }
}

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().collect();
    if words.get(1).map(String::as_str) == Some("worker") {
        return worker::play(&words[2..]);
    }
    if words.iter().any(|word| word == "--list") {
        println!("campaign: test");
        return ExitCode::SUCCESS;
    }
    let arguments = arguments();
    if let Some(rounds) = arguments.steady {
        return match steady::compare(rounds, arguments.every) {
            Ok(()) => ExitCode::SUCCESS,
            Err(reason) => {
                println!("{reason}");
                ExitCode::FAILURE
            }
        };
    }
    let begun = Instant::now();
    let site = Site::new();
    if let Err(reason) = site.prepare() {
        println!("an undisturbed run: {reason}");
        return ExitCode::FAILURE;
    }
    let numbers: Vec<u64> = arguments.only.map_or_else(|| (0..arguments.cases).collect(), |case| vec![case]);
    let (tally, failures) = campaign(&site, &numbers, &arguments);
    println!("{}", tally.text());
    println!(
        "{} cases of seed {}, {} faults, {} failed {failures:?}, {:.1} s",
        numbers.len(),
        arguments.seed,
        tally.faults(),
        failures.len(),
        begun.elapsed().as_secs_f64()
    );
    let wanted = arguments.only.is_none();
    let enough = !wanted || tally.faults() >= 2 * numbers.len() as u64;
    if !enough {
        println!("too few faults were injected: the campaign has not shown what it should");
    }
    let missed = if wanted && arguments.cases >= CAMPAIGN { tally.missed() } else { Vec::new() };
    if !missed.is_empty() {
        println!("no worker has failed in these states: {missed:?}");
    }
    // The reasons are printed by now.
    Claim::of("A-2", "runs with injected faults that fail or differ in a byte from the undisturbed run")
        .value(failures.len() as f64, 0.0)
        .within_absolute(0.0);
    if enough && missed.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Runs the cases, some at a time; each draws from its own number, so their order does not matter. Returns what was done
/// and the cases that failed.
fn campaign(site: &Site, numbers: &[u64], arguments: &Arguments) -> (Tally, Vec<u64>) {
    let next = AtomicUsize::new(0);
    let outcome = Mutex::new((Tally::default(), Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..arguments.jobs.min(numbers.len()) {
            scope.spawn(|| {
                while let Some(&number) = numbers.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let mut tally = Tally::default();
                    let mut draw = Draw::new(arguments.seed ^ number.wrapping_mul(0x9e37_79b9_7f4a_7c15));
                    let ended = site.run(number, &mut draw, &mut tally);
                    let mut outcome = outcome.lock().expect("nobody panics with the tally in hand");
                    outcome.0.merge(tally);
                    if let Err(reason) = ended {
                        println!("case {number} of seed {}: {reason}", arguments.seed);
                        outcome.1.push(number);
                    }
                }
            });
        }
    });
    outcome.into_inner().expect("nobody panics with the tally in hand")
}
