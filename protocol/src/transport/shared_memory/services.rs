//! The iceoryx2 services of one run: one exchange of messages, two wake-ups.

use super::run_directory::RunRecord;
use super::{CREDITS, WINDOW, refused};
use crate::transport::TransportError;
use iceoryx2::port::{client, listener, notifier, server};
use iceoryx2::prelude::*;
use iceoryx2::service::builder::request_response::RequestResponseOpenError;
use iceoryx2::service::port_factory::{event, request_response};
use iceoryx2::{active_request, pending_response};

pub(super) type Service = ipc::Service;
pub(super) type Exchange = request_response::PortFactory<Service, [u8], (), [u8], ()>;
pub(super) type Wake = event::PortFactory<Service>;
pub(super) type Server = server::Server<Service, [u8], (), [u8], ()>;
pub(super) type Client = client::Client<Service, [u8], (), [u8], ()>;
pub(super) type OpenRequest = active_request::ActiveRequest<Service, [u8], (), [u8], ()>;
pub(super) type Pending = pending_response::PendingResponse<Service, [u8], (), [u8], ()>;
pub(super) type Listener = listener::Listener<Service>;
pub(super) type Notifier = notifier::Notifier<Service>;

pub(crate) const EXCHANGE: &str = "exchange";
pub(crate) const TO_MACRO: &str = "to-macro";
pub(crate) const TO_WORKER: &str = "to-worker";

/// A node and the services of its run. Ports made from it must be dropped first.
pub(super) struct Services {
    pub(super) exchange: Exchange,
    pub(super) to_macro: Wake,
    pub(super) to_worker: Wake,
    pub(super) node: Node<Service>,
}

impl Services {
    /// Makes the services of a run: the macro's part.
    pub(super) fn create(record: &RunRecord) -> Result<Self, TransportError> {
        let node = node(record)?;
        let workers = record.limits.workers as usize;
        let exchange = node
            .service_builder(&name(EXCHANGE)?)
            .request_response::<[u8], [u8]>()
            .max_servers(1)
            .max_clients(workers)
            .max_nodes(workers + 2)
            .max_active_requests_per_client(WINDOW)
            .max_loaned_requests(1)
            .max_response_buffer_size(1)
            .max_borrowed_responses_per_pending_response(1)
            .enable_safe_overflow_for_requests(false)
            .enable_safe_overflow_for_responses(false)
            // What a worker says last is delivered although it waits for no answer.
            .enable_fire_and_forget_requests(true)
            .create()
            .map_err(refused("create the exchange of the run"))?;
        let wake = |label: &str| {
            node.service_builder(&name(label)?)
                .event()
                .max_listeners(workers + 1)
                .max_notifiers(workers + 1)
                .max_nodes(workers + 2)
                .create()
                .map_err(refused("create a wake-up of the run"))
        };
        Ok(Self { exchange, to_macro: wake(TO_MACRO)?, to_worker: wake(TO_WORKER)?, node })
    }

    /// Opens the services of a run: a worker's part.
    pub(super) fn open(record: &RunRecord) -> Result<Self, TransportError> {
        let node = node(record)?;
        let exchange = node
            .service_builder(&name(EXCHANGE)?)
            .request_response::<[u8], [u8]>()
            .open()
            .map_err(refused::<RequestResponseOpenError>("open the exchange of the run"))?;
        let wake = |label: &str| {
            node.service_builder(&name(label)?).event().open().map_err(refused("open a wake-up of the run"))
        };
        Ok(Self { exchange, to_macro: wake(TO_MACRO)?, to_worker: wake(TO_WORKER)?, node })
    }

    /// The macro's end of the exchange.
    pub(super) fn server(&self, record: &RunRecord) -> Result<Server, TransportError> {
        self.exchange
            .server_builder()
            // The default waits for room, for ever if the peer is dead; permissions make sure that there is room.
            .backpressure_strategy(iceoryx2::port::backpressure_strategy::BackpressureStrategy::DiscardData)
            .allocation_strategy(AllocationStrategy::Static)
            .initial_max_slice_len(message_bytes(record))
            .max_loaned_responses_per_request(1)
            .create()
            .map_err(refused("open the macro's end of the exchange"))
    }

    /// A worker's end of the exchange.
    pub(super) fn client(&self, record: &RunRecord) -> Result<Client, TransportError> {
        self.exchange
            .client_builder()
            .backpressure_strategy(iceoryx2::port::backpressure_strategy::BackpressureStrategy::DiscardData)
            .allocation_strategy(AllocationStrategy::Static)
            .initial_max_slice_len(message_bytes(record))
            .create()
            .map_err(refused("open a worker's end of the exchange"))
    }
}

/// Largest message of a run, bytes.
pub(super) fn message_bytes(record: &RunRecord) -> usize {
    usize::try_from(record.limits.message_bytes).unwrap_or(usize::MAX)
}

/// The name of a port, from a worker's number.
pub(super) fn port_name(sender: u64) -> PortName {
    PortName::new(&format!("{sender:016x}")).expect("sixteen hexadecimal digits are a port name")
}

fn name(label: &str) -> Result<ServiceName, TransportError> {
    label.try_into().map_err(refused("name a service"))
}

/// A node with a configuration made here: the default would read a file in the working directory.
fn node(record: &RunRecord) -> Result<Node<Service>, TransportError> {
    let mut config = Config::default();
    config.global.prefix = FileName::new(record.prefix.as_bytes()).map_err(refused("use the run's prefix"))?;
    let root = record.root.as_os_str().as_encoded_bytes();
    config.global.set_root_path(&Path::new(root).map_err(refused("use the run's directory"))?);
    NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<Service>()
        .map_err(refused("join the run's shared memory"))
}

const _: () = assert!(CREDITS < WINDOW);
