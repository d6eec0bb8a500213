//! The long hunt for bytes that a decoder cannot stand: broken messages for as many minutes as wanted.
//!
//! `cargo run --release -p grainspan-protocol --example broken_messages -- [MINUTES] [SEED]`
//!
//! A finding is a panic; its message and the seed of the round before it are printed, and the same seed finds it again.

#[path = "../tests/mutation/mod.rs"]
mod mutation;

use mutation::{Dice, broken, decode, sound};
use std::error::Error;
use std::io::Write;
use std::time::{Duration, Instant};

/// Messages between two looks at the clock.
const ROUND: u64 = 10_000;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let minutes: f64 = arguments.next().map_or(Ok(1.0), |text| text.parse())?;
    let seed: u64 = arguments.next().map_or(Ok(1), |text| text.parse())?;
    let (sound, begun) = (sound(), Instant::now());
    let (mut rounds, mut accepted, mut findings) = (0, 0, 0);
    while begun.elapsed() < Duration::from_secs_f64(60.0 * minutes) {
        let mut dice = Dice(seed.wrapping_mul(1 << 32).wrapping_add(rounds));
        let decoded = std::panic::catch_unwind(|| {
            let mut dice = dice.clone();
            (0..ROUND).filter(|_| decode(&broken(&sound, &mut dice))).count()
        });
        match decoded {
            Ok(count) => accepted += count,
            Err(_) => {
                findings += 1;
                writeln!(std::io::stdout(), "finding in the round that begins with {:#x}", dice.draw())?;
            }
        }
        rounds += 1;
    }
    let messages = rounds * ROUND;
    writeln!(
        std::io::stdout(),
        "{messages} broken messages in {:.1} minutes, {accepted} of them still messages, {findings} findings",
        begun.elapsed().as_secs_f64() / 60.0
    )?;
    if findings > 0 { Err("decoding panicked".into()) } else { Ok(()) }
}
