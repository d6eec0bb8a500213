//! A broken or hostile peer: whatever bytes it sends, they are refused and counted or are a message; nobody panics, and a
//! port goes on serving the others. The long hunt is `cargo run --release -p grainspan-protocol --example broken_messages`.

mod mutation;

use mutation::{Dice, broken, decode, sound};
use proptest::prelude::*;
use protocol::control::FromWorker;
use protocol::transport::in_process::channel;
use protocol::transport::shared_memory::{ChannelLimits, SharedMemoryMacroPort, SharedMemoryWorkerPort};
use protocol::transport::{MacroEvent, MacroPort, WorkerId, WorkerPort};
use protocol::{Capabilities, PROTOCOL_VERSION};
use std::time::{Duration, Instant};

proptest! {
    #![proptest_config(ProptestConfig { cases: 4000, ..ProptestConfig::default() })]

    #[test]
    fn decoding_never_panics_and_invents_nothing(seed: u64) {
        let sound = sound();
        let mut dice = Dice(seed);
        for _ in 0..16 {
            decode(&broken(&sound, &mut dice));
        }
    }

    #[test]
    fn bytes_of_any_kind_are_decoded_without_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        decode(&bytes);
    }
}

#[test]
fn sound_messages_are_accepted_and_most_broken_ones_are_not() {
    let sound = sound();
    assert!(sound.iter().all(|message| decode(message)));
    let mut dice = Dice(1);
    let accepted = (0..10_000).filter(|_| decode(&broken(&sound, &mut dice))).count();
    // Bits of a number in a job or a reply may change without harm to the frame: the macro judges those.
    assert!((500..5_000).contains(&accepted), "{accepted} of 10000 broken messages were accepted");
}

/// What the macro's port says to messages of one worker.
#[derive(Debug, Default)]
struct Heard {
    refused: u64,
    messages: u64,
    lost: u64,
}

impl Heard {
    fn take(&mut self, event: &MacroEvent<'_>) {
        match event {
            MacroEvent::Refused(_) => self.refused += 1,
            MacroEvent::Control(..) | MacroEvent::Replies(..) => self.messages += 1,
            MacroEvent::Lost(..) | MacroEvent::CutOff(..) => self.lost += 1,
            MacroEvent::Woken => {}
        }
    }
}

#[test]
fn a_port_between_threads_answers_every_message_with_one_event() {
    let (mut port, connector) = channel();
    let mut worker = connector.join();
    let (sound, mut dice, mut heard) = (sound(), Dice(2), Heard::default());
    for _ in 0..5_000 {
        worker.send_raw(&broken(&sound, &mut dice)).unwrap();
    }
    port.poll(Duration::ZERO, &mut |event| heard.take(&event)).unwrap();
    assert_eq!((heard.refused + heard.messages, heard.lost), (5_000, 0));
    assert!(heard.refused > 2_000 && heard.messages > 0, "{heard:?}");
}

fn hello(run: &str) -> FromWorker {
    FromWorker::Hello {
        protocol: PROTOCOL_VERSION,
        run: run.to_owned(),
        pid: std::process::id(),
        capabilities: Capabilities::default(),
        state_cache: 0,
    }
}

/// Polls until `enough` or 20 s have passed.
fn listen(port: &mut SharedMemoryMacroPort, heard: &mut Heard, enough: impl Fn(&Heard) -> bool) {
    let end = Instant::now() + Duration::from_secs(20);
    while !enough(heard) {
        assert!(Instant::now() < end, "{heard:?}");
        port.poll(Duration::from_millis(20), &mut |event| heard.take(&event)).unwrap();
    }
}

#[test]
fn a_port_in_shared_memory_refuses_rubbish_and_goes_on_serving_others() {
    let run = format!("broken{}", std::process::id());
    let limits = ChannelLimits { workers: 4, ..ChannelLimits::default() };
    let mut port = SharedMemoryMacroPort::create(&run, limits).unwrap();
    let (mut heard, patience) = (Heard::default(), Duration::from_secs(5));
    let mut honest = SharedMemoryWorkerPort::join(&run, patience).unwrap();
    honest.send_control(&hello(&run)).unwrap();
    listen(&mut port, &mut heard, |heard| heard.messages == 1);
    // Never says hello, so everything it says is refused: a message with an unknown sender.
    let mut stranger = SharedMemoryWorkerPort::join(&run, patience).unwrap();
    let (sound, mut dice) = (sound(), Dice(3));
    for count in 1..=200 {
        stranger.send_raw(&broken(&sound, &mut dice)).unwrap();
        let before = heard.refused + heard.messages;
        if before < count {
            let _ = port.poll(Duration::ZERO, &mut |event| heard.take(&event)).unwrap();
            let _ = stranger.poll(Duration::ZERO, &mut |_| {}).unwrap();
        }
    }
    let end = Instant::now() + Duration::from_millis(500);
    while Instant::now() < end {
        port.poll(Duration::from_millis(5), &mut |event| heard.take(&event)).unwrap();
        stranger.poll(Duration::ZERO, &mut |_| {}).unwrap();
    }
    assert!(heard.refused >= 100, "{heard:?}");
    let before = heard.messages;
    honest.send_control(&FromWorker::Bye { reason: "still here".to_owned() }).unwrap();
    listen(&mut port, &mut heard, |heard| heard.messages > before);
    assert!(port.send_control(WorkerId(0), &protocol::control::ToWorker::Drain).is_ok());
}

#[test]
fn a_worker_that_names_a_strangers_process_is_lost_and_the_stranger_lives() {
    let run = format!("stranger{}", std::process::id());
    let mut port = SharedMemoryMacroPort::create(&run, ChannelLimits::default()).unwrap();
    let mut worker = SharedMemoryWorkerPort::join(&run, Duration::from_secs(5)).unwrap();
    let mut stranger = std::process::Command::new("sleep").arg("100").spawn().unwrap();
    let FromWorker::Hello { protocol, run: name, capabilities, state_cache, .. } = hello(&run) else {
        unreachable!("a hello is a hello")
    };
    let pid = stranger.id();
    worker.send_control(&FromWorker::Hello { protocol, run: name, pid, capabilities, state_cache }).unwrap();
    let mut reason = String::new();
    let end = Instant::now() + Duration::from_secs(20);
    while reason.is_empty() && Instant::now() < end {
        let polled = port.poll(Duration::from_millis(20), &mut |event| {
            if let MacroEvent::Lost(_, why) = event {
                reason = why;
            }
        });
        polled.unwrap();
        port.kill(WorkerId(0));
    }
    assert!(reason.contains("not in this run"), "{reason}");
    assert!(stranger.try_wait().unwrap().is_none(), "a stranger was killed");
    stranger.kill().unwrap();
    stranger.wait().unwrap();
}
