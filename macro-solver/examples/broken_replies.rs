//! The long hunt for replies that the macro believes or cannot stand: damaged and hostile ones, half of each, for as many
//! minutes as wanted.
//!
//! `cargo run --release -p grainspan-macro-solver --example broken_replies -- [MINUTES] [SEED]`
//!
//! A finding is a panic: it names the seed of its pool. The same arguments find it again.

#[path = "../tests/hostile/mod.rs"]
mod hostile;

use hostile::{Findings, Manner, hunt};
use std::error::Error;
use std::io::Write;
use std::time::{Duration, Instant};

/// Broken replies between two looks at the clock.
const ROUND: u64 = 10_000;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let minutes: f64 = arguments.next().map_or(Ok(1.0), |text| text.parse())?;
    let seed: u64 = arguments.next().map_or(Ok(1), |text| text.parse())?;
    for manner in [Manner::Damaged, Manner::Hostile] {
        let begun = Instant::now();
        let mut found = Findings::default();
        let mut round = 0;
        while begun.elapsed() < Duration::from_secs_f64(30.0 * minutes) {
            let here = hunt(manner, seed.wrapping_mul(1 << 32).wrapping_add(round), ROUND);
            round += 1;
            found.sent += here.sent;
            found.refused += here.refused;
            found.faulty += here.faulty;
            found.late += here.late;
            found.unknown += here.unknown;
            found.missed += here.missed;
            found.failures += here.failures;
        }
        writeln!(std::io::stdout(), "{manner:?}: {found:?} in {:.1} s", begun.elapsed().as_secs_f64())?;
    }
    Ok(())
}
