//! The claims of every transport, for the one between hosts: alone, and behind the port that joins it to this host's workers.

#[macro_use]
#[path = "../../protocol/tests/conformance/claims.rs"]
mod claims;

use claims::{Channel, PATIENCE};
use hosts::{JoinedPort, Limits, ListenerOptions, NetworkMacroPort, NetworkWorkerPort, Secret, Target, this_program};
use protocol::transport::in_process::{InProcessConnector, InProcessMacroPort, channel};

fn listen() -> (NetworkMacroPort, Target) {
    let secret = Secret::draw().unwrap();
    let options = ListenerOptions {
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
    type Connector = Target;
    fn open() -> (Self::Macro, Self::Connector) {
        listen()
    }
    fn join(connector: &Self::Connector) -> Self::Worker {
        NetworkWorkerPort::join(connector, Limits::default(), PATIENCE).unwrap()
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
    type Connector = (Target, InProcessConnector);
    fn open() -> (Self::Macro, Self::Connector) {
        let ((network, target), (here, connector)) = (listen(), channel());
        (JoinedPort::new(here, Some(network)).transparent(), (target, connector))
    }
    fn join(connector: &Self::Connector) -> Self::Worker {
        Network::join(&connector.0)
    }
    fn send_raw(worker: &mut Self::Worker, bytes: &[u8]) {
        worker.send_raw(bytes).unwrap();
    }
}

claims!(network: Network, joined: Joined);
