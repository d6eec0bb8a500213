//! Cost of a message: round trips and throughput against payload over several channels, the overhead of one RVE call, and
//! the share of the channel in the time of workers that do solve grains.

mod calls;
mod link;

use super::repeat::{interleaved, median, ratio};
use super::report::Report;
use super::table::Table;
use crate::effort::Effort;
use charts::{Chart, Scale};
use link::{Channel, Link};
use std::time::Instant;

/// Bytes in each direction.
const PAYLOADS: [usize; 6] = [64, 1 << 10, 8 << 10, 64 << 10, 512 << 10, 4 << 20];

/// Bytes that one sample moves in each direction, about; more payloads of smaller size.
const SAMPLE_BYTES: usize = 32 << 20;

/// Measures the channels, then the calls.
///
/// # Errors
/// A helper process cannot be started, a channel breaks, or the report cannot be written.
pub(super) fn run(effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    channels(effort, report)?;
    calls::run(effort, report)
}

/// Times of one channel and payload.
struct Trip {
    channel: Channel,
    payload: usize,
    /// Round trip with one message in flight, us; one median per round.
    round_trips: Vec<f64>,
    /// Messages per second with two in flight; one value per round.
    rates: Vec<f64>,
}

fn channels(effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    let rounds = effort.choose(7, 1);
    let mut trips = Vec::new();
    for payload in PAYLOADS {
        let count = (SAMPLE_BYTES / payload).clamp(effort.choose(10, 3), effort.choose(500, 20));
        let mut rates = vec![Vec::new(); Channel::ALL.len()];
        let round_trips = interleaved(rounds, Channel::ALL.len(), |index| -> anyhow::Result<f64> {
            let mut link = Channel::ALL[index].open()?;
            let time = round_trip(link.as_mut(), payload, count)?;
            rates[index].push(throughput(link.as_mut(), payload, count)?);
            Ok(time)
        })?;
        let measured = Channel::ALL.into_iter().zip(round_trips).zip(rates);
        trips.extend(measured.map(|((channel, round_trips), rates)| Trip { channel, payload, round_trips, rates }));
    }
    show(report, &trips)
}

fn show(report: &mut Report, trips: &[Trip]) -> anyhow::Result<()> {
    let heads = ["channel", "payload_B", "round_trip_us", "to_socket", "messages_per_s", "MB_per_s_each_way"];
    let mut table = Table::new(heads);
    for trip in trips {
        let socket = trips.iter().find(|other| other.channel == Channel::Socket && other.payload == trip.payload);
        let to_socket = socket.map_or(f64::NAN, |socket| ratio(&trip.round_trips, &socket.round_trips));
        let rate = median(&trip.rates);
        table.row([
            trip.channel.name().into(),
            trip.payload.into(),
            median(&trip.round_trips).into(),
            to_socket.into(),
            rate.into(),
            (rate * trip.payload as f64 * 1e-6).into(),
        ]);
    }
    report.table("round-trips", "There and back, the payload copied out and written on both sides", &table)?;
    report.note("`to_socket`: round trip over that of the Unix socket, median of the ratios within rounds.")?;
    let time = ("round trip, us", Scale::Logarithmic);
    let mut chart = Chart::new("round trip", ("payload, B", Scale::Logarithmic), time);
    for channel in Channel::ALL {
        let of_channel = trips.iter().filter(|trip| trip.channel == channel);
        chart.curve(&channel.name(), of_channel.map(|trip| [trip.payload as f64, median(&trip.round_trips)]));
    }
    report.chart("round-trips", &chart)?;
    Ok(())
}

/// Median time of `count` round trips, us.
fn round_trip(link: &mut dyn Link, payload: usize, count: usize) -> anyhow::Result<f64> {
    let payload = vec![7; payload];
    let mut times = Vec::with_capacity(count);
    for _ in 0..count {
        let begin = Instant::now();
        link.send(&payload)?;
        link.receive()?;
        times.push(begin.elapsed().as_secs_f64() * 1e6);
    }
    Ok(median(&times))
}

/// Messages per second with two in flight, or as many as the channel can carry.
fn throughput(link: &mut dyn Link, payload: usize, count: usize) -> anyhow::Result<f64> {
    let depth = link.depth(payload);
    let payload = vec![7; payload];
    let begin = Instant::now();
    link.send(&payload)?;
    let (mut sent, mut received) = (1, 0);
    while received < count {
        while sent < count && sent - received < depth {
            link.send(&payload)?;
            sent += 1;
        }
        received += link.receive()?;
    }
    Ok(count as f64 / begin.elapsed().as_secs_f64())
}
