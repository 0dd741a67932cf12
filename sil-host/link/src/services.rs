//! The iceoryx2 side of a bus: a node, its three services, and who is alive.

use std::time::Duration;

use iceoryx2::identifiers::UniqueNodeId;
use iceoryx2::port::publisher::{Publisher, PublisherCreateError};
use iceoryx2::port::subscriber::{Subscriber, SubscriberCreateError};
use iceoryx2::prelude::{
    CallbackProgression, Config, FileName, LogLevel, Node, NodeBuilder, NodeState, Path,
    SemanticString, ServiceName, SignalHandlingMode, ZeroCopySend, ipc, set_log_level_from_env_or,
};
use iceoryx2::service::builder::publish_subscribe::{
    Builder, PublishSubscribeCreateError, PublishSubscribeOpenError,
};
use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use painleve_shared::frame::{ActuatorFrame, SensorFrame};

use super::session::SessionMessage;
use super::{BusName, LinkError};

/// Frames buffered in each direction before the oldest is dropped: 64 ms at 1 kHz.
pub const FRAME_BUFFER: usize = 64;

/// `Begin` and `End`.
const SESSION_BUFFER: usize = 2;
/// Plant, controller, and a few that look in while they start.
const MAX_NODES: usize = 8;
/// Wait for another process that is clearing up after the same dead one.
const CLEAN_UP_TIMEOUT: Duration = Duration::from_millis(200);

pub(super) type Service<T> = PortFactory<ipc::Service, T, ()>;
pub(super) type Sender<T> = Publisher<ipc::Service, T, ()>;
pub(super) type Receiver<T> = Subscriber<ipc::Service, T, ()>;

/// What may cross the link.
pub(super) trait Payload: ZeroCopySend + std::fmt::Debug + Copy + 'static {}
impl<T: ZeroCopySend + std::fmt::Debug + Copy + 'static> Payload for T {}

/// The settings of iceoryx2: its defaults, whatever configuration file a user
/// has, so that two painleve processes always meet; with files of one's own for
/// every user of a machine, because nobody may open another one's.
pub(super) fn default_config() -> Config {
    let user = nix::unistd::getuid();
    let mut config = Config::default();
    if let Ok(prefix) = FileName::new(format!("painleve_{user}_").as_bytes()) {
        config.global.prefix = prefix;
    }
    if let Ok(folder) = Path::new(format!("/tmp/painleve_{user}").as_bytes()) {
        config.global.set_root_path(&folder);
    }
    config
}

/// Why services could not be had right now.
pub(super) enum Unavailable {
    /// Somebody else has (create) or nobody has (open) made them: may change.
    NotYet,
    /// Will not change by waiting.
    Never(LinkError),
}

/// One process's presence on a bus.
pub(super) struct Presence {
    bus: BusName,
    node: Node<ipc::Service>,
}

impl Presence {
    /// Joins the bus, and clears away what killed processes have left behind.
    pub(super) fn new(bus: &BusName, config: &Config) -> Result<Self, LinkError> {
        set_log_level_from_env_or(LogLevel::Fatal);
        let node = NodeBuilder::new()
            .config(config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>()
            .map_err(|cause| transport(bus, "join the bus", cause))?;
        let presence = Self {
            bus: bus.clone(),
            node,
        };
        presence.clear_dead();
        Ok(presence)
    }

    pub(super) fn bus(&self) -> &BusName {
        &self.bus
    }

    /// Removes what killed processes have left behind.
    pub(super) fn clear_dead(&self) {
        Node::<ipc::Service>::blocking_cleanup_dead_nodes(self.node.config(), CLEAN_UP_TIMEOUT);
    }

    /// A [`LinkError::Transport`] on this bus.
    pub(super) fn transport(&self, action: &'static str, cause: impl ToString) -> LinkError {
        transport(&self.bus, action, cause)
    }

    /// Whether the process of this node lives. When that cannot be told, yes:
    /// the silence limit remains.
    pub(super) fn is_alive(&self, node: UniqueNodeId) -> bool {
        let mut state = None;
        let listed = Node::<ipc::Service>::list(self.node.config(), |other| {
            if *other.node_id() != node {
                return CallbackProgression::Continue;
            }
            state = Some(other);
            CallbackProgression::Stop
        });
        listed.is_err() || !matches!(state, None | Some(NodeState::Dead(_)))
    }

    fn builder<T: Payload>(&self, kind: &str) -> Result<Builder<T, (), ipc::Service>, LinkError> {
        let name = ServiceName::new(&format!("painleve/{}/{kind}", self.bus))
            .map_err(|cause| self.transport("name its services", cause))?;
        Ok(self
            .node
            .service_builder(&name)
            .publish_subscribe::<T>()
            .max_publishers(1)
            .max_subscribers(1)
            .max_nodes(MAX_NODES)
            .enable_safe_overflow(true)
            .subscriber_max_borrowed_samples(1))
    }
}

fn transport(bus: &BusName, action: &'static str, cause: impl ToString) -> LinkError {
    LinkError::Transport {
        bus: bus.clone(),
        action,
        cause: cause.to_string(),
    }
}

/// The three services of a bus.
pub(super) struct Services {
    pub(super) session: Service<SessionMessage>,
    pub(super) sensor: Service<SensorFrame>,
    pub(super) actuator: Service<ActuatorFrame>,
}

impl Services {
    /// Makes the services anew. As long as anybody alive holds one of an earlier
    /// run this is refused, so a run never meets frames of another.
    pub(super) fn create(presence: &Presence) -> Result<Self, Unavailable> {
        let refuse = |cause| match cause {
            PublishSubscribeCreateError::AlreadyExists
            | PublishSubscribeCreateError::IsBeingCreatedByAnotherInstance
            | PublishSubscribeCreateError::HangsInCreation => Unavailable::NotYet,
            cause => Unavailable::Never(presence.transport("create its services", cause)),
        };
        let frames = |name| (name, FRAME_BUFFER, 0);
        let session = ("session", SESSION_BUFFER, 1);
        Ok(Self {
            // The session first: who makes it is the plant.
            session: create(presence, session)?.map_err(refuse)?,
            sensor: create(presence, frames("sensor"))?.map_err(refuse)?,
            actuator: create(presence, frames("actuator"))?.map_err(refuse)?,
        })
    }

    /// Opens the services a plant has made.
    pub(super) fn open(presence: &Presence) -> Result<Self, Unavailable> {
        Ok(Self {
            session: open(presence, "session")?,
            sensor: open(presence, "sensor")?,
            actuator: open(presence, "actuator")?,
        })
    }

    /// The node of the live plant, if there is one.
    pub(super) fn live_plant(&self, presence: &Presence) -> Option<UniqueNodeId> {
        publisher_node(&self.session).filter(|&node| presence.is_alive(node))
    }
}

/// Whether a live plant is on the bus.
pub(super) fn plant_is_alive(presence: &Presence) -> bool {
    open::<SessionMessage>(presence, "session")
        .is_ok_and(|session| publisher_node(&session).is_some_and(|node| presence.is_alive(node)))
}

/// The node that publishes on a service, dead or alive.
pub(super) fn publisher_node<T: Payload>(service: &Service<T>) -> Option<UniqueNodeId> {
    let mut node = None;
    service.dynamic_config().list_publishers(|publisher| {
        node = Some(publisher.node_id);
        CallbackProgression::Stop
    });
    node
}

/// The publishing port of a service; `None` if it is taken.
pub(super) fn sender<T: Payload>(
    presence: &Presence,
    service: &Service<T>,
) -> Result<Option<Sender<T>>, LinkError> {
    match service.publisher_builder().create() {
        Ok(sender) => Ok(Some(sender)),
        Err(PublisherCreateError::ExceedsMaxSupportedPublishers) => Ok(None),
        Err(cause) => Err(presence.transport("create a publisher", cause)),
    }
}

/// The receiving port of a service; `None` if it is taken.
pub(super) fn receiver<T: Payload>(
    presence: &Presence,
    service: &Service<T>,
) -> Result<Option<Receiver<T>>, LinkError> {
    match service.subscriber_builder().create() {
        Ok(receiver) => Ok(Some(receiver)),
        Err(SubscriberCreateError::ExceedsMaxSupportedSubscribers) => Ok(None),
        Err(cause) => Err(presence.transport("create a subscriber", cause)),
    }
}

/// (kind, buffer, history) to a service.
fn create<T: Payload>(
    presence: &Presence,
    (kind, buffer, history): (&str, usize, usize),
) -> Result<Result<Service<T>, PublishSubscribeCreateError>, Unavailable> {
    Ok(presence
        .builder::<T>(kind)
        .map_err(Unavailable::Never)?
        .subscriber_max_buffer_size(buffer)
        .history_size(history)
        .create())
}

fn open<T: Payload>(presence: &Presence, kind: &str) -> Result<Service<T>, Unavailable> {
    presence
        .builder::<T>(kind)
        .map_err(Unavailable::Never)?
        .open()
        .map_err(|cause| match cause {
            PublishSubscribeOpenError::DoesNotExist
            | PublishSubscribeOpenError::IsMarkedForDestruction
            | PublishSubscribeOpenError::HangsInCreation
            | PublishSubscribeOpenError::ExceedsMaxNumberOfNodes => Unavailable::NotYet,
            PublishSubscribeOpenError::IncompatibleTypes => {
                Unavailable::Never(LinkError::Incompatible {
                    bus: presence.bus.clone(),
                })
            }
            cause => Unavailable::Never(presence.transport("open its services", cause)),
        })
}
