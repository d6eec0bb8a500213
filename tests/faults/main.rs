//! Whatever happens to workers and to the macro, the answer keeps its bits: a randomized campaign of injected faults.
//!
//! Without arguments a fast selection runs, as part of the tests. `cargo test --release --test faults -- --cases 120
//! --seed 7` is a campaign; `--case K` repeats one case of it. Every case is a small run of the real program that is
//! disturbed in one of three manners, and compared byte for byte with the same run undisturbed:
//!
//! - *faulty*: the workers are this program in the role of a worker. It is the real worker loop with the real engine, and
//!   fails in a given way when it reaches a given state of the protocol;
//! - *struck*: the run's own workers get SIGKILL, SIGSTOP, SIGSEGV and SIGTERM at times that nobody chose;
//! - *resumed*: the macro itself gets SIGKILL, SIGTERM or SIGINT, again and again, and is continued with `--resume`.
//!
//! Nothing of this is compiled into the program.
#![allow(clippy::print_stdout, unreachable_pub, reason = "a program of its own that reports to people")]

mod case;
mod compare;
mod draw;
mod fault;
mod macros;
mod worker;

use case::{Site, Tally};
use draw::Draw;
use std::process::ExitCode;
use std::time::Instant;

/// Cases of the fast selection.
const FAST: u64 = 9;

struct Arguments {
    cases: u64,
    seed: u64,
    only: Option<u64>,
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
    let begun = Instant::now();
    let site = Site::new();
    let mut tally = Tally::default();
    let numbers: Vec<u64> = arguments.only.map_or_else(|| (0..arguments.cases).collect(), |case| vec![case]);
    let mut failures = Vec::new();
    for &number in &numbers {
        let mut draw = Draw::new(arguments.seed ^ number.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        if let Err(reason) = site.run(number, &mut draw, &mut tally) {
            println!("case {number} of seed {}: {reason}", arguments.seed);
            failures.push(number);
        }
    }
    println!("{}", tally.text());
    println!(
        "{} cases of seed {}, {} faults, {} failed {failures:?}, {:.1} s",
        numbers.len(),
        arguments.seed,
        tally.faults(),
        failures.len(),
        begun.elapsed().as_secs_f64()
    );
    let enough = arguments.only.is_some() || tally.faults() >= 2 * numbers.len() as u64;
    if !enough {
        println!("too few faults were injected: the campaign has not shown what it should");
    }
    if failures.is_empty() && enough { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
