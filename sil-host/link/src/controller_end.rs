//! The controller's end of the link, the same for every host of the controller.

use std::time::{Duration, Instant};

use iceoryx2::identifiers::UniqueNodeId;
use iceoryx2::prelude::Config;
use painleve_shared::frame::{ActuatorFrame, SensorFrame};

use super::patience::{DEFAULT_SILENCE_LIMIT, Next, Patience};
use super::services::{
    Presence, Receiver, Sender, Services, Unavailable, default_config, receiver, sender,
};
use super::session::{Announcement, Session, SessionMessage};
use super::{BusName, LinkError};

/// Time between two looks for a plant, short enough not to be in its way.
const PLANT_POLL: Duration = Duration::from_millis(10);

/// What the plant has sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// A sensor frame, to be answered with an actuator frame of the same tick.
    Frame(SensorFrame),
    /// The session is over: no more frames will come.
    End,
}

/// The controller's end: receives sensor frames, sends the answers.
///
/// Nothing of it stays in shared memory once dropped.
pub struct ControllerEnd {
    // Ports before services before the node: fields drop in this order.
    sensor: Receiver<SensorFrame>,
    session: Receiver<SessionMessage>,
    actuator: Sender<ActuatorFrame>,
    services: Services,
    presence: Presence,
    silence_limit: Duration,
    /// `End` has arrived.
    ended: bool,
}

/// Ports that a plant has not yet spoken to.
struct Joined {
    sensor: Receiver<SensorFrame>,
    session: Receiver<SessionMessage>,
    services: Services,
    plant: UniqueNodeId,
}

impl ControllerEnd {
    /// Joins the plant on `bus`, waiting at most `timeout` for it, and learns
    /// of its session.
    ///
    /// # Errors
    /// [`LinkError::PlantMissing`] after `timeout`,
    /// [`LinkError::ControllerInUse`] if a controller is alive on the bus,
    /// [`LinkError::Incompatible`], [`LinkError::Transport`].
    pub fn open(bus: &BusName, timeout: Duration) -> Result<(Self, Session), LinkError> {
        Self::open_with(bus, timeout, &default_config())
    }

    pub(super) fn open_with(
        bus: &BusName,
        timeout: Duration,
        config: &Config,
    ) -> Result<(Self, Session), LinkError> {
        let start = Instant::now();
        let presence = Presence::new(bus, config)?;
        loop {
            if let Some(joined) = join(&presence)?
                && let Some(session) = joined.wait_for_begin(&presence, start + timeout)?
            {
                let end = joined.into_end(presence)?;
                return Ok((end, session));
            }
            let waited = start.elapsed();
            if waited >= timeout {
                return Err(LinkError::PlantMissing {
                    bus: bus.clone(),
                    waited,
                });
            }
            presence.clear_dead();
            std::thread::sleep(PLANT_POLL.min(timeout - waited));
        }
    }

    /// The bus.
    pub fn bus(&self) -> &BusName {
        self.presence.bus()
    }

    /// Sets how long the plant may be silent before that is an error;
    /// [`DEFAULT_SILENCE_LIMIT`] at first. Make it longer than the tick, and
    /// long to stop the plant at breakpoints.
    pub fn set_silence_limit(&mut self, limit: Duration) {
        self.silence_limit = limit;
    }

    /// Waits for the next sensor frame or the end of the session.
    ///
    /// Does not allocate unless the wait takes longer than 50 ms.
    ///
    /// # Errors
    /// [`LinkError::PlantGone`] if the plant left without ending the session,
    /// [`LinkError::PlantSilent`] after the silence limit,
    /// [`LinkError::Incompatible`], [`LinkError::Transport`].
    pub fn receive(&mut self) -> Result<Received, LinkError> {
        let mut patience = Patience::new(self.silence_limit);
        let mut known_gone = false;
        loop {
            if let Some(frame) = self.take()? {
                return Ok(Received::Frame(frame));
            }
            if self.ended {
                return Ok(Received::End);
            }
            // Frames sent before `End` come before it: the loop takes them first.
            self.ended =
                take_announcement(&self.presence, &self.session)? == Some(Announcement::End);
            if self.ended {
                continue;
            }
            if known_gone {
                return Err(LinkError::PlantGone {
                    bus: self.bus().clone(),
                });
            }
            match patience.pause() {
                Next::Poll => {}
                // What was sent just before leaving still counts: poll once more.
                Next::Look => known_gone = self.services.live_plant(&self.presence).is_none(),
                Next::GiveUp(silence) => {
                    return Err(LinkError::PlantSilent {
                        bus: self.bus().clone(),
                        silence,
                    });
                }
            }
        }
    }

    /// Sends the answer to a sensor frame.
    ///
    /// Does not allocate.
    ///
    /// # Errors
    /// [`LinkError::Transport`]. That the plant is gone is left to
    /// [`ControllerEnd::receive`].
    #[inline]
    pub fn send(&mut self, frame: &ActuatorFrame) -> Result<(), LinkError> {
        self.actuator
            .send_copy(*frame)
            .map(|_| ())
            .map_err(|cause| self.presence.transport("send an actuator frame", cause))
    }

    #[inline]
    fn take(&self) -> Result<Option<SensorFrame>, LinkError> {
        match self.sensor.receive() {
            Ok(frame) => Ok(frame.map(|frame| *frame)),
            Err(cause) => Err(self.presence.transport("receive a sensor frame", cause)),
        }
    }
}

/// Connects to the plant's services; `None` if there is no live plant.
fn join(presence: &Presence) -> Result<Option<Joined>, LinkError> {
    let services = match Services::open(presence) {
        Ok(services) => services,
        Err(Unavailable::Never(error)) => return Err(error),
        Err(Unavailable::NotYet) => return Ok(None),
    };
    // Services without a plant are about to go; holding them would keep them.
    let Some(plant) = services.live_plant(presence) else {
        return Ok(None);
    };
    let (Some(sensor), Some(session)) = (
        receiver(presence, &services.sensor)?,
        receiver(presence, &services.session)?,
    ) else {
        return Err(LinkError::ControllerInUse {
            bus: presence.bus().clone(),
        });
    };
    Ok(Some(Joined {
        sensor,
        session,
        services,
        plant,
    }))
}

impl Joined {
    /// Waits for `Begin`; `None` if the plant left or `deadline` has passed.
    fn wait_for_begin(
        &self,
        presence: &Presence,
        deadline: Instant,
    ) -> Result<Option<Session>, LinkError> {
        let mut patience = Patience::new(deadline.saturating_duration_since(Instant::now()));
        loop {
            match take_announcement(presence, &self.session)? {
                Some(Announcement::Begin(session)) => return Ok(Some(session)),
                Some(Announcement::End) => return Ok(None),
                None => {}
            }
            match patience.pause() {
                Next::Poll => {}
                Next::Look if presence.is_alive(self.plant) => {}
                Next::Look | Next::GiveUp(_) => return Ok(None),
            }
        }
    }

    /// The publisher comes last: it tells the plant that the controller is ready.
    fn into_end(self, presence: Presence) -> Result<ControllerEnd, LinkError> {
        let actuator = sender(&presence, &self.services.actuator)?.ok_or_else(|| {
            LinkError::ControllerInUse {
                bus: presence.bus().clone(),
            }
        })?;
        Ok(ControllerEnd {
            sensor: self.sensor,
            session: self.session,
            actuator,
            services: self.services,
            presence,
            silence_limit: DEFAULT_SILENCE_LIMIT,
            ended: false,
        })
    }
}

fn take_announcement(
    presence: &Presence,
    session: &Receiver<SessionMessage>,
) -> Result<Option<Announcement>, LinkError> {
    match session.receive() {
        Ok(None) => Ok(None),
        Ok(Some(message)) => message
            .read()
            .map(Some)
            .ok_or_else(|| LinkError::Incompatible {
                bus: presence.bus().clone(),
            }),
        Err(cause) => Err(presence.transport("receive the session", cause)),
    }
}
