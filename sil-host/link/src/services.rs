//! The iceoryx2 side of a run: a node, its three services, and their ports.

use std::error::Error;

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{
    Node, NodeBuilder, ServiceName, SignalHandlingMode, ZeroCopySend, ipc,
    set_log_level_from_env_or, set_logger,
};
use iceoryx2::service::builder::publish_subscribe::{Builder, PublishSubscribeOpenError};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use iceoryx2_log_types::{Log, LogLevel};
use painleve_shared::frame::{ActuatorFrame, SensorFrame};

use super::run_files::RunFiles;
use super::session::SessionMessage;
use super::{BusName, LinkError};

/// Frames buffered in each direction before the oldest is dropped: 64 ms at 1 kHz.
pub const FRAME_BUFFER: usize = 64;

/// Messages buffered for the session: `Begin` and `End`.
const SESSION_BUFFER: usize = 2;
/// The other end, and up to three viewers.
const MAX_SUBSCRIBERS: usize = 4;
/// Plant, controller and viewers.
const MAX_NODES: usize = 5;

pub(super) type Service<T> = PortFactory<ipc::Service, T, ()>;
pub(super) type Sender<T> = Publisher<ipc::Service, T, ()>;
pub(super) type Receiver<T> = Subscriber<ipc::Service, T, ()>;

/// Data that may cross the link.
pub(super) trait BusPayload: ZeroCopySend + std::fmt::Debug + Copy + 'static {}
impl<T: ZeroCopySend + std::fmt::Debug + Copy + 'static> BusPayload for T {}

/// Why services are not available now.
pub(super) enum Unavailable {
    /// They do not exist: the plant has just left.
    NotYet,
    /// Waiting will not help.
    Never(LinkError),
}

/// A process as iceoryx2 sees it.
pub(super) struct Presence {
    bus: BusName,
    run: RunFiles,
    node: Node<ipc::Service>,
}

impl Presence {
    /// Joins a run as an iceoryx2 node.
    pub(super) fn new(bus: &BusName, run: &RunFiles) -> Result<Self, LinkError> {
        quieten();
        let node = NodeBuilder::new()
            .config(&run.config()?)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>()
            .map_err(|cause| refused(bus, run, "join the bus", cause))?;
        Ok(Self {
            bus: bus.clone(),
            run: run.clone(),
            node,
        })
    }

    pub(super) fn bus(&self) -> &BusName {
        &self.bus
    }

    /// Returns the reason of a failure of iceoryx2 on this bus.
    pub(super) fn transport(
        &self,
        action: &'static str,
        cause: impl Into<Box<dyn Error + Send + Sync>>,
    ) -> LinkError {
        refused(&self.bus, &self.run, action, cause)
    }

    fn builder<T: BusPayload>(
        &self,
        kind: &str,
    ) -> Result<Builder<T, (), ipc::Service>, LinkError> {
        let name = ServiceName::new(&format!("painleve/{}/{kind}", self.bus))
            .map_err(|cause| self.transport("name its services", cause))?;
        Ok(self
            .node
            .service_builder(&name)
            .publish_subscribe::<T>()
            .max_publishers(1)
            .max_subscribers(MAX_SUBSCRIBERS)
            .max_nodes(MAX_NODES)
            .enable_safe_overflow(true)
            .subscriber_max_borrowed_samples(1))
    }
}

/// Discards the log of iceoryx2: relevant failures become a [`LinkError`], and the program itself
/// reports a panic.
struct Silent;

impl Log for Silent {
    fn log(&self, _: LogLevel, _: std::fmt::Arguments, _: std::fmt::Arguments) {}
}

/// Silences iceoryx2 unless its log is requested.
fn quieten() {
    if std::env::var_os("IOX2_LOG_LEVEL").is_some() {
        set_log_level_from_env_or(LogLevel::Fatal);
    } else {
        // Refused from the second call on, because the logger is already set.
        let _ = set_logger(&Silent);
    }
}

pub(super) fn transport(
    bus: &BusName,
    action: &'static str,
    cause: impl Into<Box<dyn Error + Send + Sync>>,
) -> LinkError {
    LinkError::Transport {
        bus: bus.clone(),
        action,
        source: cause.into(),
    }
}

/// Returns the reason of a failure of iceoryx2, whose own errors do not tell what the system has refused: what it
/// refuses now, else that error.
fn refused(
    bus: &BusName,
    run: &RunFiles,
    action: &'static str,
    cause: impl Into<Box<dyn Error + Send + Sync>>,
) -> LinkError {
    let refusal = run.probe().err();
    refusal.unwrap_or_else(|| transport(bus, action, cause))
}

/// The three services of a bus.
pub(super) struct Services {
    pub(super) session: Service<SessionMessage>,
    pub(super) sensor: Service<SensorFrame>,
    pub(super) actuator: Service<ActuatorFrame>,
}

impl Services {
    /// Creates the services of a new run.
    pub(super) fn create(presence: &Presence) -> Result<Self, LinkError> {
        Ok(Self {
            session: create(presence, "session", SESSION_BUFFER, 1)?,
            sensor: create(presence, "sensor", FRAME_BUFFER, 0)?,
            actuator: create(presence, "actuator", FRAME_BUFFER, 0)?,
        })
    }

    /// Opens the services that a plant has created.
    pub(super) fn open(presence: &Presence) -> Result<Self, Unavailable> {
        Ok(Self {
            session: open(presence, "session")?,
            sensor: open(presence, "sensor")?,
            actuator: open(presence, "actuator")?,
        })
    }
}

/// Creates the publishing port of a service.
pub(super) fn sender<T: BusPayload>(
    presence: &Presence,
    service: &Service<T>,
) -> Result<Sender<T>, LinkError> {
    service
        .publisher_builder()
        .create()
        .map_err(|cause| presence.transport("create a publisher", cause))
}

/// Creates the receiving port of a service.
pub(super) fn receiver<T: BusPayload>(
    presence: &Presence,
    service: &Service<T>,
) -> Result<Receiver<T>, LinkError> {
    service
        .subscriber_builder()
        .create()
        .map_err(|cause| presence.transport("create a subscriber", cause))
}

fn create<T: BusPayload>(
    presence: &Presence,
    kind: &str,
    buffer: usize,
    history: usize,
) -> Result<Service<T>, LinkError> {
    presence
        .builder::<T>(kind)?
        .subscriber_max_buffer_size(buffer)
        .history_size(history)
        .create()
        .map_err(|cause| presence.transport("create its services", cause))
}

fn open<T: BusPayload>(presence: &Presence, kind: &str) -> Result<Service<T>, Unavailable> {
    presence
        .builder::<T>(kind)
        .map_err(Unavailable::Never)?
        .open()
        .map_err(|cause| match cause {
            PublishSubscribeOpenError::DoesNotExist
            | PublishSubscribeOpenError::IsMarkedForDestruction
            | PublishSubscribeOpenError::HangsInCreation => Unavailable::NotYet,
            PublishSubscribeOpenError::IncompatibleTypes => {
                Unavailable::Never(LinkError::Incompatible {
                    bus: presence.bus.clone(),
                })
            }
            cause => Unavailable::Never(presence.transport("open its services", cause)),
        })
}
