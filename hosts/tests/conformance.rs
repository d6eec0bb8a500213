//! The claims of every transport, for the one between hosts: alone, and behind the port that joins it to this host's workers.

#[macro_use]
#[path = "../../protocol/tests/conformance/claims.rs"]
mod claims;

use claims::{Channel, PATIENCE};
use hosts::{DoorOptions, JoinedPort, Limits, NetworkMacroPort, NetworkWorkerPort, Secret, Target, this_program};
use protocol::transport::in_process::{InProcessDoor, InProcessMacroPort, channel};

fn listen() -> (NetworkMacroPort, Target) {
    let secret = Secret::draw().unwrap();
    let options = DoorOptions {
        run: "test".into(),
        secret: secret.clone(),
        limits: Limits::default(),
        program: this_program().into(),
    };
    let port = NetworkMacroPort::listen("127.0.0.1:0", options).unwrap();
    let target = Target { endpoints: vec![port.address().to_string()], secret };
    (port, target)
}

struct Network;

impl Channel for Network {
    type Macro = NetworkMacroPort;
    type Worker = NetworkWorkerPort;
    type Door = Target;
    fn open() -> (Self::Macro, Self::Door) {
        listen()
    }
    fn join(door: &Self::Door) -> Self::Worker {
        NetworkWorkerPort::join(door, Limits::default(), PATIENCE).unwrap()
    }
    fn send_raw(worker: &mut Self::Worker, bytes: &[u8]) {
        worker.send_raw(bytes).unwrap();
    }
}

/// Workers over the network at a port that could have workers here too.
struct Joined;

impl Channel for Joined {
    type Macro = JoinedPort<InProcessMacroPort>;
    type Worker = NetworkWorkerPort;
    type Door = (Target, InProcessDoor);
    fn open() -> (Self::Macro, Self::Door) {
        let ((network, target), (here, door)) = (listen(), channel());
        (JoinedPort::new(here, Some(network)).transparent(), (target, door))
    }
    fn join(door: &Self::Door) -> Self::Worker {
        Network::join(&door.0)
    }
    fn send_raw(worker: &mut Self::Worker, bytes: &[u8]) {
        worker.send_raw(bytes).unwrap();
    }
}

claims!(network: Network, joined: Joined);
