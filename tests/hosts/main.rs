//! Whatever happens to hosts and to the network between them, the answer keeps its bits.
//!
//! The test makes three network namespaces that play three hosts, `m` with the macro process and `a` and `b` with an agent each, joined
//! by links that lose and delay packets (`tests/hosts/link.py`; the kernel's own `netem` is not needed). Every case is a run of the
//! real program on a shipped scene, shortened; it is disturbed by the faults drawn from its number and compared byte for byte with the
//! same run on one host without any fault.
//!
//! Without arguments a fast selection runs. `cargo test --release --features hosts --test hosts -- --cases 200 --seed 7` is a campaign;
//! `--case K` repeats one case, `--jobs N` runs N at a time. `--overhead N` measures instead what two agents cost against one host, N
//! times on the main scene, with `--set KEY=VALUE` for both sides. Needs root, `ip netns`, `/dev/net/tun` and python3; says SKIPPED otherwise.
#![allow(clippy::print_stdout, unreachable_pub, dead_code, reason = "a program of its own that reports to people")]

mod case;
#[path = "../harness/children.rs"]
mod children;
#[path = "../faults/compare.rs"]
mod compare;
#[path = "../faults/draw.rs"]
mod draw;
mod elastic;
mod network;
mod overhead;
#[path = "../harness/short_scenes.rs"]
mod short_scenes;

use case::{References, Tally};
use draw::Draw;
use network::Network;
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// Cases of the fast selection: each kind of fault once.
const FAST: u64 = case::KINDS.len() as u64;

/// Cases at a time.
const JOBS: u64 = 2;

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    if words.iter().any(|word| word == "--list") {
        println!("campaign between hosts: test");
        return ExitCode::SUCCESS;
    }
    if let Some(reason) = network::missing() {
        println!("SKIPPED: {reason}; faults between hosts are not tested");
        return ExitCode::SUCCESS;
    }
    let number = |name: &str| {
        let place = words.iter().position(|word| word == name)?;
        words.get(place + 1)?.parse::<u64>().ok()
    };
    if let Some(pairs) = number("--overhead") {
        let changes: Vec<String> =
            words.windows(2).filter(|pair| pair[0] == "--set").map(|pair| pair[1].clone()).collect();
        return match overhead::measure(pairs, &changes) {
            Ok(()) => ExitCode::SUCCESS,
            Err(reason) => {
                println!("{reason}");
                ExitCode::FAILURE
            }
        };
    }
    let (cases, seed) = (number("--cases").unwrap_or(FAST), number("--seed").unwrap_or(1));
    let numbers: Vec<u64> = number("--case").map_or_else(|| (0..cases).collect(), |case| vec![case]);
    let jobs = number("--jobs").unwrap_or(JOBS).clamp(1, 16).min(numbers.len() as u64);
    let begun = Instant::now();
    let references = match References::prepare() {
        Ok(references) => references,
        Err(reason) => {
            println!("an undisturbed run: {reason}");
            return ExitCode::FAILURE;
        }
    };
    if number("--case").is_none() {
        if let Err(reason) = Network::make(jobs, seed).and_then(|network| elastic::check(&network)) {
            println!("agents that come late and go early: {reason}");
            return ExitCode::FAILURE;
        }
        println!("agents that come late and go early: same bytes");
    }
    let next = AtomicUsize::new(0);
    let outcome = Mutex::new((Tally::default(), Vec::new()));
    std::thread::scope(|scope| {
        for lane in 0..jobs {
            let (next, outcome, numbers, references) = (&next, &outcome, &numbers, &references);
            scope.spawn(move || {
                while let Some(&number) = numbers.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let mut draw = Draw::new(seed ^ number.wrapping_mul(0x9e37_79b9_7f4a_7c15));
                    let mut tally = Tally::default();
                    let ended = Network::make(lane, draw.next())
                        .and_then(|network| case::run(number, &mut draw, &network, references, &mut tally));
                    let mut outcome = outcome.lock().expect("nobody panics with the tally in hand");
                    outcome.0.merge(&tally);
                    if let Err(reason) = ended {
                        println!("case {number} of seed {seed}: {reason}");
                        outcome.1.push(number);
                    }
                }
            });
        }
    });
    let (tally, failures) = outcome.into_inner().expect("nobody panics with the tally in hand");
    println!("{}", tally.text());
    println!(
        "{} cases of seed {seed}, {} failed {failures:?}, {:.1} s",
        numbers.len(),
        failures.len(),
        begun.elapsed().as_secs_f64()
    );
    let enough = 4 * tally.faults() >= 3 * numbers.len() as u64;
    if !enough {
        println!("only {} faults were injected: the campaign has not shown what it should", tally.faults());
    }
    if failures.is_empty() && enough { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
