//! The plant's end of the link.

use std::error::Error;
use std::io;
use std::time::{Duration, Instant};

use iceoryx2::port::update_connections::UpdateConnections;
use painleve_shared::frame::{ActuatorFrame, SensorFrame};

use super::bell::Bell;
use super::claim::{Bus, Claim, Taken, remove_dead};
use super::guardian::{CallMark, Guardian};
use super::lock_file::{LockFile, Role};
use super::patience::{
    AfterPause, DEFAULT_SILENCE_LIMIT, LOOK_INTERVAL, Patience, Pauses, Silence,
};
use super::place::{Place, SHARED_MEMORY};
use super::run_files::{OWN_CONTROLLER, RunFiles};
use super::services::{Presence, Receiver, Sender, Services, receiver, sender, transport};
use super::session::{Session, SessionMessage};
use super::{BusName, LinkError, Pair};
use painleve_process::free_space::free_bytes;
use painleve_process::interrupt::Interrupt;

/// Time allowed for the controller of a killed plant to leave the bus. It is shorter than the
/// silence limit, so that a controller waiting for this plant does not report it as silent.
const TAKEOVER_TIMEOUT: Duration = Duration::from_secs(1);
const TAKEOVER_POLL: Duration = Duration::from_millis(10);
const CONTROLLER_POLL: Duration = Duration::from_millis(5);
/// Free shared memory required to create a bus, in bytes: three times the amount one bus uses. A
/// segment takes its memory only when it is written; if none is left, the kernel kills the writer.
const SHARED_MEMORY_NEEDED: u64 = 256 * 1024;

/// The plant's end of the link: sends sensor frames and receives the controller's answers.
///
/// Dropping it without [`PlantEnd::end`] shows the controller that the plant has failed. Either
/// way, nothing remains in shared memory.
pub struct PlantEnd {
    // Fields drop in this order: the guardian watches the ports drop, then the claim cleans up.
    ports: Ports,
    run: RunFiles,
    guardian: Guardian,
    claim: Claim,
    pair: Option<Pair>,
    begin: SessionMessage,
    silence_limit: Duration,
    /// Silence of the controller in real time.
    silence: Silence,
    interrupt: Interrupt,
}

/// Everything iceoryx2 has created for this end.
struct Ports {
    _leaving: CallMark,
    // Drop order: ports, services, node.
    sensor: Sender<SensorFrame>,
    actuator: Receiver<ActuatorFrame>,
    session: Sender<SessionMessage>,
    _services: Services,
    presence: Presence,
    _left: CallMark,
    bell: Bell,
    /// Held while the run's shared memory is in use.
    _in_use: LockFile,
}

impl Ports {
    fn create(bus: &Bus, run: &RunFiles, guardian: &Guardian) -> Result<Self, LinkError> {
        let in_use = run
            .hold(Role::Plant)
            .map_err(|cause| transport(&bus.name, "mark its shared memory as in use", cause))?;
        let bell = Bell::hang(&bus.name, &in_use, Role::Plant)?;
        let presence = Presence::new(&bus.name, run)?;
        let services = Services::create(&presence)?;
        let (leaving, left) = guardian.marks();
        Ok(Self {
            _leaving: leaving,
            sensor: sender(&presence, &services.sensor)?,
            actuator: receiver(&presence, &services.actuator)?,
            session: sender(&presence, &services.session)?,
            _services: services,
            presence,
            _left: left,
            bell,
            _in_use: in_use,
        })
    }
}

impl PlantEnd {
    /// Creates the bus and announces `session` on it.
    ///
    /// First removes what killed processes left behind. The controller of a killed plant gets a
    /// second to leave. With a `pair`, only its controller can join; without one, any controller
    /// that belongs to no pair.
    ///
    /// # Errors
    /// [`LinkError::BusInUse`] if a plant is alive on the bus,
    /// [`LinkError::BusOccupied`] if a controller of an earlier plant stays,
    /// [`LinkError::ConfigurationTooLong`], [`LinkError::Interrupted`],
    /// [`LinkError::SharedMemoryFull`], [`LinkError::Folder`], [`LinkError::Held`],
    /// [`LinkError::Transport`].
    pub fn create(
        bus: &BusName,
        pair: Option<Pair>,
        session: &Session,
        interrupt: &Interrupt,
    ) -> Result<Self, LinkError> {
        Self::create_in(Place::of_user()?, bus, pair, session, interrupt)
    }

    pub(super) fn create_in(
        place: Place,
        bus: &BusName,
        pair: Option<Pair>,
        session: &Session,
        interrupt: &Interrupt,
    ) -> Result<Self, LinkError> {
        let begin = SessionMessage::begin(session)?;
        remove_dead(&place);
        let bus = Bus {
            name: bus.clone(),
            place,
        };
        check_shared_memory(&bus.name)?;
        let claim = take_over(&bus, interrupt)?;
        let guardian = Guardian::start(&claim)
            .map_err(|cause| transport(&bus.name, "start a thread", cause))?;
        let (run, ports) = start_run(&bus, pair, &guardian, &begin)?;
        Ok(Self {
            ports,
            run,
            guardian,
            claim,
            pair,
            begin,
            silence_limit: DEFAULT_SILENCE_LIMIT,
            silence: Silence::default(),
            interrupt: interrupt.clone(),
        })
    }

    /// Returns the name of the bus.
    pub fn bus(&self) -> &BusName {
        self.ports.presence.bus()
    }

    /// Sets how long the controller may be silent before [`LinkError::ControllerSilent`] is
    /// returned; initially [`DEFAULT_SILENCE_LIMIT`]. Choose a long limit to stop at breakpoints.
    pub fn set_silence_limit(&mut self, limit: Duration) {
        self.silence_limit = limit;
    }

    /// Waits until a controller has read the session and is ready for frames.
    ///
    /// # Errors
    /// [`LinkError::ControllerMissing`] if none has joined after `timeout`; the call may be repeated.
    /// [`LinkError::ControllerSilent`] if a controller has joined but is not ready within the
    /// silence limit. [`LinkError::Interrupted`], [`LinkError::Transport`].
    pub fn wait_for_controller(&mut self, timeout: Duration) -> Result<(), LinkError> {
        let start = Instant::now();
        let mut silence = Silence::default();
        loop {
            self.deliver_session()?;
            if self.run.is_joined() {
                if !self.claim.peer_is_alive() {
                    self.restart()?;
                    silence = Silence::default();
                } else if self.run.is_answering() {
                    // Without a connection, answers of a controller that leaves would be lost.
                    self.guardian
                        .during(|| self.ports.actuator.update_connections())
                        .map_err(|cause| self.transport("connect to the controller", cause))?;
                    self.silence = Silence::default();
                    return Ok(());
                } else if let AfterPause::GiveUp(silence) = silence.grow(self.silence_limit) {
                    return Err(self.silent_for(silence));
                }
            }
            if self.interrupt.is_requested() {
                return Err(LinkError::Interrupted);
            }
            let waited = start.elapsed();
            if waited >= timeout && !self.run.is_joined() {
                return Err(LinkError::ControllerMissing {
                    bus: self.bus().clone(),
                    waited,
                });
            }
            std::thread::sleep(CONTROLLER_POLL);
        }
    }

    /// Returns the name of a controller that is not this program's own, once one has joined:
    /// `external` if it has not given any. `None` for this program's own.
    pub fn external_controller(&self) -> Option<String> {
        match self.run.controller_name() {
            Some(name) if name == OWN_CONTROLLER => None,
            name => Some(name.unwrap_or_else(|| "external".into())),
        }
    }

    /// Creates a new run for the next controller, because the last one died while it joined.
    fn restart(&mut self) -> Result<(), LinkError> {
        let bus = self.claim.bus();
        RunFiles::remove_half_made(&bus.folder(), &bus.place);
        let (run, ports) = start_run(bus, self.pair, &self.guardian, &self.begin)?;
        self.ports = ports;
        std::mem::replace(&mut self.run, run)
            .remove()
            .map_err(|cause| transport(&bus.name, "remove a dead controller's files", cause))
    }

    /// Sends a frame and waits for its answer: one lockstep tick.
    ///
    /// Does not allocate unless the answer takes longer than 50 ms.
    ///
    /// # Errors
    /// [`LinkError::ControllerGone`] and [`LinkError::ControllerSilent`], the
    /// latter after the silence limit; [`LinkError::WrongTick`] if the answer
    /// echoes another tick; [`LinkError::Interrupted`], [`LinkError::Transport`].
    pub fn exchange(&mut self, frame: &SensorFrame) -> Result<ActuatorFrame, LinkError> {
        if self.send_to_controller(frame)? == 0 {
            return Err(self.gone());
        }
        let mut patience = Patience::new(self.silence_limit);
        let mut known_gone = false;
        patience.begin(&self.ports.bell);
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
            match patience.pause(&self.ports.bell, LOOK_INTERVAL) {
                AfterPause::Poll => {}
                AfterPause::Look if self.interrupt.is_requested() => {
                    return Err(LinkError::Interrupted);
                }
                // An answer sent just before the controller left still counts: poll once more.
                AfterPause::Look => known_gone = !self.claim.peer_is_alive(),
                AfterPause::GiveUp(silence) => return Err(self.silent_for(silence)),
            }
        }
    }

    /// Sends a frame without waiting, for real-time pacing. A controller that joins later receives
    /// the session and all frames from then on.
    ///
    /// # Errors
    /// [`LinkError::Transport`].
    pub fn send(&mut self, frame: &SensorFrame) -> Result<(), LinkError> {
        self.deliver_session()?;
        self.send_to_controller(frame).map(|_| ())
    }

    /// Waits for the next answer until `deadline`; `None` if none has arrived by then.
    ///
    /// # Errors
    /// As [`PlantEnd::try_receive`].
    pub fn receive_before(
        &mut self,
        deadline: Instant,
    ) -> Result<Option<ActuatorFrame>, LinkError> {
        let mut pauses = Pauses::default();
        pauses.begin(&self.ports.bell);
        loop {
            if let Some(answer) = self.try_receive()? {
                return Ok(Some(answer));
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            pauses.pause(&self.ports.bell, left);
        }
    }

    /// Returns the next answer, if one has arrived. Call it until it returns `None` to get the
    /// newest.
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
            AfterPause::Poll => Ok(None),
            AfterPause::Look if self.claim.peer_is_alive() => Ok(None),
            // An answer sent just before the controller left still counts: poll once more.
            AfterPause::Look => self.take()?.map(Some).ok_or_else(|| self.gone()),
            AfterPause::GiveUp(silence) => Err(self.silent_for(silence)),
        }
    }

    /// Announces the end of the session and leaves the bus.
    ///
    /// # Errors
    /// [`LinkError::Transport`].
    pub fn end(self) -> Result<(), LinkError> {
        self.announce(SessionMessage::end())
    }

    fn announce(&self, message: SessionMessage) -> Result<(), LinkError> {
        self.guardian.during(|| announce(&self.ports, message))
    }

    /// Delivers `Begin` to a controller that has joined since the last call.
    fn deliver_session(&self) -> Result<(), LinkError> {
        self.guardian
            .during(|| self.ports.session.update_connections())
            .map(|_| self.ports.bell.ring())
            .map_err(|cause| self.transport("announce the session", cause))
    }

    #[inline]
    fn send_to_controller(&self, frame: &SensorFrame) -> Result<usize, LinkError> {
        self.guardian
            .during(|| self.ports.sensor.send_copy(*frame))
            .inspect(|_| self.ports.bell.ring())
            .map_err(|cause| self.transport("send a sensor frame", cause))
    }

    #[inline]
    fn take(&mut self) -> Result<Option<ActuatorFrame>, LinkError> {
        let received = self.guardian.during(|| self.ports.actuator.receive());
        match received {
            Ok(None) => Ok(None),
            Ok(Some(answer)) => {
                self.silence = Silence::default();
                Ok(Some(*answer))
            }
            Err(cause) => Err(self.transport("receive an actuator frame", cause)),
        }
    }

    #[cold]
    fn transport(
        &self,
        action: &'static str,
        cause: impl Into<Box<dyn Error + Send + Sync>>,
    ) -> LinkError {
        self.ports.presence.transport(action, cause)
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

/// Creates a run, announces its session and admits a controller.
fn start_run(
    bus: &Bus,
    pair: Option<Pair>,
    guardian: &Guardian,
    begin: &SessionMessage,
) -> Result<(RunFiles, Ports), LinkError> {
    let refuse = |cause: io::Error| transport(&bus.name, "make the files of its run", cause);
    let run = RunFiles::create(&bus.folder(), &bus.place).map_err(refuse)?;
    let ports = guardian.during(|| {
        let ports = Ports::create(bus, &run, guardian)?;
        announce(&ports, *begin).map(|()| ports)
    })?;
    run.reserve()
        .map_err(|cause| transport(&bus.name, "reserve its shared memory", cause))?;
    run.set_ready(pair).map_err(refuse)?;
    Ok((run, ports))
}

fn announce(ports: &Ports, message: SessionMessage) -> Result<(), LinkError> {
    ports
        .session
        .send_copy(message)
        .map(|_| ports.bell.ring())
        .map_err(|cause| ports.presence.transport("announce the session", cause))
}

/// Claims the bus once no process of an earlier run is on it.
fn take_over(bus: &Bus, interrupt: &Interrupt) -> Result<Claim, LinkError> {
    let start = Instant::now();
    loop {
        let name = || bus.name.clone();
        match bus.claim(Role::Plant)? {
            Ok(claim) => return Ok(claim),
            Err(Taken::ByAnother) => return Err(LinkError::BusInUse { bus: name() }),
            Err(Taken::ByEarlierRun) if start.elapsed() >= TAKEOVER_TIMEOUT => {
                return Err(LinkError::BusOccupied { bus: name() });
            }
            Err(Taken::ByEarlierRun) if interrupt.is_requested() => {
                return Err(LinkError::Interrupted);
            }
            Err(Taken::ByEarlierRun) => std::thread::sleep(TAKEOVER_POLL),
        }
    }
}

fn check_shared_memory(bus: &BusName) -> Result<(), LinkError> {
    let free = free_bytes(SHARED_MEMORY)
        .map_err(|cause| transport(bus, "look at shared memory", cause))?;
    match free.filter(|free| *free < SHARED_MEMORY_NEEDED) {
        None => Ok(()),
        Some(available) => Err(LinkError::SharedMemoryFull {
            bus: bus.clone(),
            folder: SHARED_MEMORY,
            available,
            needed: SHARED_MEMORY_NEEDED,
        }),
    }
}
