//! The plant's end of the link.

use std::time::{Duration, Instant};

use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::Config;
use painleve_shared::frame::{ActuatorFrame, SensorFrame};

use super::patience::{DEFAULT_SILENCE_LIMIT, Next, Patience, Silence};
use super::services::{
    Presence, Receiver, Sender, Services, Unavailable, default_config, plant_is_alive,
    publisher_node, receiver, sender,
};
use super::session::{Session, SessionMessage};
use super::{BusName, LinkError};

/// How long the controller of a plant that was killed may take to leave the bus.
const TAKEOVER_TIMEOUT: Duration = Duration::from_secs(2);
const TAKEOVER_POLL: Duration = Duration::from_millis(10);
const CONTROLLER_POLL: Duration = Duration::from_millis(5);

/// The plant's end: sends sensor frames, receives the controller's answers.
///
/// Dropping it without [`PlantEnd::end`] tells the controller that the plant
/// has failed. Either way nothing stays in shared memory.
pub struct PlantEnd {
    // Ports before services before the node: fields drop in this order.
    sensor: Sender<SensorFrame>,
    actuator: Receiver<ActuatorFrame>,
    session: Sender<SessionMessage>,
    services: Services,
    presence: Presence,
    silence_limit: Duration,
    /// Of the controller, while frames go by the clock.
    silence: Silence,
}

impl PlantEnd {
    /// Makes the bus and announces `session` on it.
    ///
    /// What killed processes have left on the bus is removed first. A controller
    /// of a killed plant is given two seconds to leave.
    ///
    /// # Errors
    /// [`LinkError::BusInUse`] if a plant is alive on the bus,
    /// [`LinkError::BusOccupied`] if a controller of an earlier plant stays,
    /// [`LinkError::ConfigurationTooLong`], [`LinkError::Transport`].
    pub fn create(bus: &BusName, session: &Session) -> Result<Self, LinkError> {
        Self::create_with(bus, session, &default_config())
    }

    pub(super) fn create_with(
        bus: &BusName,
        session: &Session,
        config: &Config,
    ) -> Result<Self, LinkError> {
        let begin = SessionMessage::begin(session)?;
        let presence = Presence::new(bus, config)?;
        let services = take_over(&presence)?;

        let in_use = || LinkError::BusInUse { bus: bus.clone() };
        let end = Self {
            sensor: sender(&presence, &services.sensor)?.ok_or_else(in_use)?,
            actuator: receiver(&presence, &services.actuator)?.ok_or_else(in_use)?,
            session: sender(&presence, &services.session)?.ok_or_else(in_use)?,
            services,
            presence,
            silence_limit: DEFAULT_SILENCE_LIMIT,
            silence: Silence::default(),
        };
        end.announce(begin)?;
        Ok(end)
    }

    /// The bus.
    pub fn bus(&self) -> &BusName {
        self.presence.bus()
    }

    /// Sets how long the controller may be silent before that is an error;
    /// [`DEFAULT_SILENCE_LIMIT`] at first. Make it long to stop at breakpoints.
    pub fn set_silence_limit(&mut self, limit: Duration) {
        self.silence_limit = limit;
    }

    /// Waits until a controller has read the session and is ready for frames.
    ///
    /// # Errors
    /// [`LinkError::ControllerMissing`] after `timeout`; may be called again.
    pub fn wait_for_controller(&mut self, timeout: Duration) -> Result<(), LinkError> {
        let start = Instant::now();
        loop {
            self.deliver_session()?;
            // Its publisher is the last thing a controller makes.
            if let Some(controller) = publisher_node(&self.services.actuator) {
                if self.presence.is_alive(controller) {
                    self.silence = Silence::default();
                    return Ok(());
                }
                self.presence.clear_dead();
            }
            let waited = start.elapsed();
            if waited >= timeout {
                return Err(LinkError::ControllerMissing {
                    bus: self.bus().clone(),
                    waited,
                });
            }
            std::thread::sleep(CONTROLLER_POLL.min(timeout - waited));
        }
    }

    /// Sends a frame and waits for its answer: one lockstep tick.
    ///
    /// Does not allocate unless the answer takes longer than 50 ms.
    ///
    /// # Errors
    /// [`LinkError::ControllerGone`] and [`LinkError::ControllerSilent`], the
    /// latter after the silence limit; [`LinkError::WrongTick`] if the answer
    /// echoes another tick; [`LinkError::Transport`].
    pub fn exchange(&mut self, frame: &SensorFrame) -> Result<ActuatorFrame, LinkError> {
        if self.send_to_controller(frame)? == 0 {
            return Err(self.gone());
        }
        let mut patience = Patience::new(self.silence_limit);
        let mut known_gone = false;
        loop {
            if let Some(answer) = self.take()? {
                return if answer.tick == frame.tick {
                    Ok(answer)
                } else {
                    Err(LinkError::WrongTick {
                        bus: self.bus().clone(),
                        asked: frame.tick,
                        answered: answer.tick,
                    })
                };
            }
            if known_gone {
                return Err(self.gone());
            }
            match patience.pause() {
                Next::Poll => {}
                // An answer sent just before leaving still counts: poll once more.
                Next::Look => known_gone = !self.controller_is_alive(),
                Next::GiveUp(silence) => return Err(self.silent_for(silence)),
            }
        }
    }

    /// Sends a frame without waiting, for real-time pacing. A controller that
    /// joins later gets the session, and the frames from then on.
    ///
    /// # Errors
    /// [`LinkError::Transport`].
    pub fn send(&mut self, frame: &SensorFrame) -> Result<(), LinkError> {
        self.deliver_session()?;
        self.send_to_controller(frame).map(|_| ())
    }

    /// The next answer, if one has arrived; call until `None` to get the newest.
    ///
    /// # Errors
    /// [`LinkError::ControllerGone`] and [`LinkError::ControllerSilent`] as for
    /// [`PlantEnd::exchange`], counted from the first `None` after an answer;
    /// [`LinkError::Transport`].
    pub fn try_receive(&mut self) -> Result<Option<ActuatorFrame>, LinkError> {
        if let Some(answer) = self.take()? {
            return Ok(Some(answer));
        }
        match self.silence.grow(self.silence_limit) {
            Next::Poll => Ok(None),
            Next::Look if self.controller_is_alive() => Ok(None),
            // An answer sent just before leaving still counts: poll once more.
            Next::Look => self.take()?.map(Some).ok_or_else(|| self.gone()),
            Next::GiveUp(silence) => Err(self.silent_for(silence)),
        }
    }

    /// Tells the controller that the session is over, and leaves the bus.
    ///
    /// # Errors
    /// [`LinkError::Transport`].
    pub fn end(self) -> Result<(), LinkError> {
        self.announce(SessionMessage::end())
    }

    fn announce(&self, message: SessionMessage) -> Result<(), LinkError> {
        self.session
            .send_copy(message)
            .map(|_| ())
            .map_err(|cause| self.presence.transport("announce the session", cause))
    }

    /// Hands `Begin` to a controller that has joined since.
    fn deliver_session(&self) -> Result<(), LinkError> {
        self.session
            .update_connections()
            .map_err(|cause| self.presence.transport("announce the session", cause))
    }

    #[inline]
    fn send_to_controller(&self, frame: &SensorFrame) -> Result<usize, LinkError> {
        self.sensor
            .send_copy(*frame)
            .map_err(|cause| self.presence.transport("send a sensor frame", cause))
    }

    #[inline]
    fn take(&mut self) -> Result<Option<ActuatorFrame>, LinkError> {
        match self.actuator.receive() {
            Ok(None) => Ok(None),
            Ok(Some(answer)) => {
                self.silence = Silence::default();
                Ok(Some(*answer))
            }
            Err(cause) => Err(self.presence.transport("receive an actuator frame", cause)),
        }
    }

    fn controller_is_alive(&self) -> bool {
        publisher_node(&self.services.actuator).is_some_and(|node| self.presence.is_alive(node))
    }

    #[cold]
    fn gone(&self) -> LinkError {
        LinkError::ControllerGone {
            bus: self.bus().clone(),
        }
    }

    #[cold]
    fn silent_for(&self, silence: Duration) -> LinkError {
        LinkError::ControllerSilent {
            bus: self.bus().clone(),
            silence,
        }
    }
}

/// Makes the services, once nobody of an earlier run holds them any more.
fn take_over(presence: &Presence) -> Result<Services, LinkError> {
    let start = Instant::now();
    loop {
        match Services::create(presence) {
            Ok(services) => return Ok(services),
            Err(Unavailable::Never(error)) => return Err(error),
            Err(Unavailable::NotYet) => {}
        }
        let bus = || presence.bus().clone();
        if plant_is_alive(presence) {
            return Err(LinkError::BusInUse { bus: bus() });
        }
        if start.elapsed() >= TAKEOVER_TIMEOUT {
            return Err(LinkError::BusOccupied { bus: bus() });
        }
        presence.clear_dead();
        std::thread::sleep(TAKEOVER_POLL);
    }
}
