//! The controller's end of the link, the same for every host of the controller.

use std::io;
use std::time::{Duration, Instant};

use painleve_shared::frame::{ActuatorFrame, SensorFrame};

use super::bell::Bell;
use super::claim::{Bus, Claim, remove_dead};
use super::guardian::{CallMark, Guardian};
use super::lock_file::{LockFile, Role};
use super::patience::{AfterPause, LOOK_INTERVAL, Patience, Silence};
use super::place::Place;
use super::run_files::{OWN_CONTROLLER, RunFiles};
use super::services::{
    Presence, Receiver, Sender, Services, Unavailable, receiver, sender, transport,
};
use super::session::{Announcement, Session, SessionMessage};
use super::{BusName, LinkError, Pair};
use painleve_process::interrupt::Interrupt;

/// Interval at which a waiting controller looks for a plant, long enough not to disturb the plant's
/// start.
const PLANT_POLL: Duration = Duration::from_millis(10);

/// Longest time before a frame is due at which its receiver wakes up, to spin until that time after it. It covers the slack
/// of Linux's timers (50 µs) and the start of an idle processor.
const WAKE_UP: Duration = Duration::from_micros(120);

/// When a frame is expected in real time.
#[derive(Clone, Copy, Debug)]
pub struct Expected {
    /// When it is due.
    pub due: Instant,
    /// When to give it up.
    pub deadline: Instant,
}

/// What a wait for an expected frame does next.
enum Wait {
    /// Spin: the frame is about to arrive.
    Spin,
    /// Sleep, at most so long.
    Sleep(Duration),
    /// Give the frame up.
    Missed,
}

impl Expected {
    fn wait(&self, bell: &Bell) -> Wait {
        let now = Instant::now();
        let left = self.deadline.saturating_duration_since(now);
        // A receiver that spins for all of a short tick keeps a whole processor busy, and under SCHED_FIFO the system then
        // stops it for a part of every second.
        let wake_up = WAKE_UP.min(self.deadline.saturating_duration_since(self.due));
        let early = self.due.saturating_duration_since(now);
        if left.is_zero() {
            Wait::Missed
        } else if early > wake_up {
            Wait::Sleep(early - wake_up)
        // While the plant needs this processor, it cannot send.
        } else if now < self.due + wake_up && bell.peer_runs_elsewhere() {
            Wait::Spin
        } else {
            Wait::Sleep(left)
        }
    }
}

/// Message received from the plant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// A sensor frame, to be answered with an actuator frame of the same tick.
    Frame(SensorFrame),
    /// The session is over: no more frames will come.
    End,
}

/// The controller's end of the link: receives sensor frames and sends the answers.
///
/// Dropping it removes everything it holds in shared memory.
pub struct ControllerEnd {
    // Fields drop in this order: the guardian watches the ports drop, then the claim cleans up.
    ports: Ports,
    guardian: Guardian,
    claim: Claim,
    silence_limit: Duration,
    interrupt: Interrupt,
    /// Patience with the plant since its last frame.
    patience: Patience,
    /// Whether `End` has arrived.
    ended: bool,
}

/// Everything iceoryx2 has created for this end.
struct Ports {
    _leaving: CallMark,
    // Drop order: ports, services, node.
    sensor: Receiver<SensorFrame>,
    session: Receiver<SessionMessage>,
    actuator: Sender<ActuatorFrame>,
    _services: Services,
    presence: Presence,
    _left: CallMark,
    bell: Bell,
    /// Held while the run's shared memory is in use.
    _in_use: LockFile,
}

/// Result of an attempt to join.
enum Attempt {
    Joined(Box<ControllerEnd>, Session),
    /// There is no plant.
    NoPlant,
    /// There is a plant that is not ready yet.
    NotReady,
}

impl ControllerEnd {
    /// Joins the plant on `bus`, waiting at most `timeout` for it, and reads its session. With a
    /// `pair`, it joins only the plant of that pair; without one, only a plant that belongs to none.
    ///
    /// `silence_limit` is how long the plant may be silent, from now on, before
    /// [`LinkError::PlantSilent`] is returned; normally [`DEFAULT_SILENCE_LIMIT`](crate::DEFAULT_SILENCE_LIMIT). It must be longer
    /// than a tick; choose a long one to stop the plant at breakpoints.
    ///
    /// # Errors
    /// [`LinkError::PlantMissing`] after `timeout`,
    /// [`LinkError::PlantSilent`] if there is a plant that does not become ready,
    /// [`LinkError::ControllerInUse`] if a controller is alive on the bus,
    /// [`LinkError::Interrupted`], [`LinkError::Incompatible`], [`LinkError::Folder`],
    /// [`LinkError::Held`], [`LinkError::Transport`].
    pub fn open(
        bus: &BusName,
        pair: Option<Pair>,
        timeout: Duration,
        silence_limit: Duration,
        interrupt: &Interrupt,
    ) -> Result<(Self, Session), LinkError> {
        let place = Place::of_user()?;
        Self::open_in(place, bus, pair, timeout, silence_limit, interrupt)
    }

    pub(super) fn open_in(
        place: Place,
        bus: &BusName,
        pair: Option<Pair>,
        timeout: Duration,
        silence_limit: Duration,
        interrupt: &Interrupt,
    ) -> Result<(Self, Session), LinkError> {
        let start = Instant::now();
        remove_dead(&place);
        let bus = Bus {
            name: bus.clone(),
            place,
        };
        let mut silence = Silence::default();
        loop {
            match join(&bus, pair, silence_limit, interrupt)? {
                Attempt::Joined(end, session) => return Ok((*end, session)),
                Attempt::NoPlant => silence = Silence::default(),
                Attempt::NotReady => {
                    if let AfterPause::GiveUp(silence) = silence.grow(silence_limit) {
                        return Err(LinkError::PlantSilent {
                            bus: bus.name,
                            silence,
                        });
                    }
                }
            }
            if interrupt.is_requested() {
                return Err(LinkError::Interrupted);
            }
            let waited = start.elapsed();
            if waited >= timeout {
                // The plant may have been killed while it created its bus.
                bus.remove_if_dead();
                return Err(LinkError::PlantMissing {
                    bus: bus.name,
                    waited,
                });
            }
            std::thread::sleep(PLANT_POLL.min(timeout - waited));
        }
    }

    /// Returns the name of the bus.
    pub fn bus(&self) -> &BusName {
        self.ports.presence.bus()
    }

    /// Waits for the next sensor frame or the end of the session.
    ///
    /// Does not allocate unless the wait takes longer than 50 ms.
    ///
    /// # Errors
    /// [`LinkError::PlantGone`] if the plant left without ending the session,
    /// [`LinkError::PlantSilent`] after the silence limit, [`LinkError::Interrupted`],
    /// [`LinkError::Incompatible`], [`LinkError::Transport`].
    pub fn receive(&mut self) -> Result<Received, LinkError> {
        loop {
            if let Some(received) = self.receive_before(None)? {
                return Ok(received);
            }
        }
    }

    /// Waits as [`ControllerEnd::receive`] does for a frame that is due, but only until its deadline,
    /// and returns `None` if nothing has arrived by then. If several frames have arrived, returns the
    /// newest; the discarded ones show as a jump of its `sequence`.
    ///
    /// # Errors
    /// As [`ControllerEnd::receive`]; the silence limit keeps counting across calls.
    pub fn receive_newest(&mut self, expected: Expected) -> Result<Option<Received>, LinkError> {
        let mut newest = self.receive_before(Some(expected))?;
        while let (Some(Received::Frame(_)), Some(newer)) = (newest, self.take()?) {
            newest = Some(Received::Frame(newer));
        }
        Ok(newest)
    }

    fn receive_before(
        &mut self,
        expected: Option<Expected>,
    ) -> Result<Option<Received>, LinkError> {
        let mut known_gone = false;
        self.patience.begin(&self.ports.bell);
        loop {
            if let Some(frame) = self.take()? {
                self.patience = Patience::new(self.silence_limit);
                return Ok(Some(Received::Frame(frame)));
            }
            if self.ended {
                return Ok(Some(Received::End));
            }
            // The loop first takes the frames sent before `End`.
            self.ended = self.announcement()? == Some(Announcement::End);
            if self.ended {
                continue;
            }
            if known_gone {
                return Err(LinkError::PlantGone {
                    bus: self.bus().clone(),
                });
            }
            let bell = &self.ports.bell;
            let wait = expected.map(|expected| expected.wait(bell));
            let next = match wait {
                None => self.patience.pause(bell, LOOK_INTERVAL),
                Some(Wait::Spin) => {
                    std::hint::spin_loop();
                    continue;
                }
                Some(Wait::Sleep(longest)) => self.patience.rest(bell, longest),
                // However late this process is, it notices a plant that has left.
                Some(Wait::Missed) => self.patience.count(),
            };
            match next {
                AfterPause::Poll if matches!(wait, Some(Wait::Missed)) => return Ok(None),
                AfterPause::Poll => {}
                AfterPause::Look if self.interrupt.is_requested() => {
                    return Err(LinkError::Interrupted);
                }
                // A frame sent just before the plant left still counts: poll once more.
                AfterPause::Look => known_gone = !self.claim.peer_is_alive(),
                AfterPause::GiveUp(silence) => return Err(self.silent_for(silence)),
            }
        }
    }

    /// Sends the answer to a sensor frame.
    ///
    /// Does not allocate.
    ///
    /// # Errors
    /// [`LinkError::Transport`]. Only [`ControllerEnd::receive`] detects that the plant is gone.
    #[inline]
    pub fn send(&mut self, frame: &ActuatorFrame) -> Result<(), LinkError> {
        self.guardian
            .during(|| self.ports.actuator.send_copy(*frame))
            .map(|_| self.ports.bell.ring())
            .map_err(|cause| {
                self.ports
                    .presence
                    .transport("send an actuator frame", cause)
            })
    }

    #[inline]
    fn take(&self) -> Result<Option<SensorFrame>, LinkError> {
        match self.guardian.during(|| self.ports.sensor.receive()) {
            Ok(frame) => Ok(frame.map(|frame| *frame)),
            Err(cause) => Err(self
                .ports
                .presence
                .transport("receive a sensor frame", cause)),
        }
    }

    fn announcement(&self) -> Result<Option<Announcement>, LinkError> {
        match self.guardian.during(|| self.ports.session.receive()) {
            Ok(None) => Ok(None),
            Ok(Some(message)) => message
                .read()
                .map(Some)
                .ok_or_else(|| LinkError::Incompatible {
                    bus: self.bus().clone(),
                }),
            Err(cause) => Err(self.ports.presence.transport("receive the session", cause)),
        }
    }

    /// Waits for the plant's session; `None` if the plant has left.
    fn wait_for_begin(&self) -> Result<Option<Session>, LinkError> {
        let mut patience = Patience::new(self.silence_limit);
        patience.begin(&self.ports.bell);
        loop {
            match self.announcement()? {
                Some(Announcement::Begin(session)) => return Ok(Some(session)),
                Some(Announcement::End) => return Ok(None),
                None => {}
            }
            match patience.pause(&self.ports.bell, LOOK_INTERVAL) {
                AfterPause::Poll => {}
                AfterPause::Look if self.interrupt.is_requested() => {
                    return Err(LinkError::Interrupted);
                }
                AfterPause::Look if self.claim.peer_is_alive() => {}
                AfterPause::Look => return Ok(None),
                AfterPause::GiveUp(silence) => return Err(self.silent_for(silence)),
            }
        }
    }

    #[cold]
    fn silent_for(&self, silence: Duration) -> LinkError {
        LinkError::PlantSilent {
            bus: self.bus().clone(),
            silence,
        }
    }
}

/// Tries to join the run of the plant on the bus.
fn join(
    bus: &Bus,
    pair: Option<Pair>,
    silence_limit: Duration,
    interrupt: &Interrupt,
) -> Result<Attempt, LinkError> {
    let Some(lock) = bus.look().filter(|lock| lock.is_held(Role::Plant)) else {
        return Ok(Attempt::NoPlant);
    };
    let in_use = || LinkError::ControllerInUse {
        bus: bus.name.clone(),
    };
    let Some(run) = RunFiles::ready(&bus.folder(), &bus.place, pair) else {
        // A stranger's plant and controller do not concern a pair, whose plant may yet come.
        return if pair.is_some() {
            Ok(Attempt::NoPlant)
        // Another controller has joined, or the plant is not ready yet.
        } else if lock.is_held(Role::Controller) {
            Err(in_use())
        } else {
            Ok(Attempt::NotReady)
        };
    };
    let claim = bus.claim(Role::Controller)?.map_err(|_| in_use())?;
    let refuse = |action| move |cause: io::Error| transport(&bus.name, action, cause);
    if !claim.peer_is_alive() || !run.join().map_err(refuse("join its run"))? {
        return Ok(Attempt::NotReady);
    }
    let guardian = Guardian::start(&claim).map_err(refuse("start a thread"))?;
    let Some(ports) = guardian.during(|| Ports::open(bus, &run, &guardian))? else {
        return Ok(Attempt::NotReady);
    };
    let end = ControllerEnd {
        ports,
        guardian,
        claim,
        silence_limit,
        patience: Patience::new(silence_limit),
        interrupt: interrupt.clone(),
        ended: false,
    };
    let Some(session) = end.wait_for_begin()? else {
        return Ok(Attempt::NotReady);
    };
    run.reserve().map_err(refuse("reserve its shared memory"))?;
    run.set_answering(OWN_CONTROLLER)
        .map_err(refuse("join its run"))?;
    Ok(Attempt::Joined(Box::new(end), session))
}

impl Ports {
    /// Connects to the plant's services; `None` if the plant has just left.
    fn open(bus: &Bus, run: &RunFiles, guardian: &Guardian) -> Result<Option<Self>, LinkError> {
        let in_use = match run.hold(Role::Controller) {
            Ok(in_use) => in_use,
            Err(cause) if cause.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(cause) => {
                let action = "mark its shared memory as in use";
                return Err(transport(&bus.name, action, cause));
            }
        };
        let bell = Bell::hang(&bus.name, &in_use, Role::Controller)?;
        let presence = Presence::new(&bus.name, run)?;
        let services = match Services::open(&presence) {
            Ok(services) => services,
            Err(Unavailable::Never(error)) => return Err(error),
            Err(Unavailable::NotYet) => return Ok(None),
        };
        let (leaving, left) = guardian.marks();
        Ok(Some(Self {
            _leaving: leaving,
            sensor: receiver(&presence, &services.sensor)?,
            session: receiver(&presence, &services.session)?,
            actuator: sender(&presence, &services.actuator)?,
            _services: services,
            presence,
            _left: left,
            bell,
            _in_use: in_use,
        }))
    }
}
