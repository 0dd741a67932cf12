//! The supervisor's state machine: idle → armed → tracking ⇄ lift-off, and a fault from every
//! state. A fault is latched until a reset.

use painleve_shared::frame::{ActuatorFrame, DigitalInputs};
use painleve_shared::status::{Fault, SupervisorState};
use painleve_shared::{OutOfRange, check_setting, settings};

use super::lapses::{Lapse, LapseLimits, LapseMonitor};

settings! {
    /// Reaction to a loss of contact while tracking.
    #[derive(Copy, Eq)]
    pub enum OnLiftOff = Recover {
        /// Return the tip to the belt, a limited number of times.
        "recover" => Recover,
        /// Let the law continue, as in the paper, until the time limit.
        "continue" => Continue,
    }
}

settings! {
    /// Settings of the supervisor. Times are rounded to ticks; the longest time is still countable
    /// at the highest control rate.
    #[derive(Copy)]
    pub struct SupervisorSettings {
        /// Time in contact before the reference starts.
        arming_s: f32 = 0.01, 0.0..=1e4, "s";
        /// Time from arming after which a tip that has not been in contact for `arming_s` latches the fault
        /// `ContactNotFound`; at least `arming_s`.
        arming_limit_s: f32 = 1.0, 0.0..=1e4, "s";
        /// Reaction to a loss of contact while tracking.
        on_lift_off: OnLiftOff = OnLiftOff::Recover;
        /// Time without contact after which the fault `LiftOffTooLong` is latched; 0 for never.
        lift_off_limit_s: f32 = 2.0, 0.0..=1e4, "s";
        /// Number of lift-offs in a row from which the controller recovers; one more latches the
        /// fault `RecoveryFailed`.
        recoveries_limit: u32 = 10, 0..=1_000_000;
        /// Time in contact after which the count of lift-offs in a row starts again.
        recovered_s: f32 = 1.0, 0.0..=1e4, "s";
    }
    check Self::relations;
}

impl SupervisorSettings {
    fn relations(&self) -> Result<(), OutOfRange> {
        check_setting!(self.arming_limit_s, self.arming_s, 1e4)
    }
}

/// The state machine; initially idle.
#[derive(Clone, Copy, Debug, Default)]
pub struct Supervisor {
    state: SupervisorState,
    fault: Option<Fault>,
    /// Ticks in the present state.
    ticks: u32,
    /// Ticks in contact while armed, without interruption.
    contact_ticks: u32,
    /// Lift-offs in a row.
    lift_offs: u32,
    inputs: DigitalInputs,
    settings: SupervisorSettings,
    tick_hz: f32,
    /// How often each kind of lapse has occurred.
    pub(crate) lapses: LapseMonitor,
}

/// The supervisor's decision at one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Phase {
    /// Present state.
    pub state: SupervisorState,
    /// Whether the drive has just been armed.
    pub arms: bool,
    /// Whether tracking has just started, for the first time since the drive was armed.
    pub starts_tracking: bool,
    /// Whether a drive that is on returns a tip in the air to the belt.
    pub recovers: bool,
}

impl Supervisor {
    /// Makes a supervisor that is called `tick_hz` times a second.
    pub fn new(settings: SupervisorSettings, limits: LapseLimits, tick_hz: f32) -> Self {
        Self {
            settings,
            tick_hz,
            lapses: LapseMonitor::new(limits),
            ..Self::default()
        }
    }

    /// Advances one tick; `has_law` states whether there is a law to arm.
    #[inline]
    pub fn tick(&mut self, inputs: DigitalInputs, contact: bool, has_law: bool) -> Phase {
        let (mut arms, mut starts_tracking) = (false, false);
        let before = core::mem::replace(&mut self.inputs, inputs);
        let rises = |bit| inputs.contains(bit) && !before.contains(bit);
        let enabled = inputs.contains(DigitalInputs::ENABLE);
        self.ticks = self.ticks.saturating_add(1);
        match self.state {
            SupervisorState::Fault if rises(DigitalInputs::RESET) => {
                self.fault = None;
                self.enter(SupervisorState::Idle);
            }
            // Arm on a rising edge, so that a reset alone does not start the drive again.
            SupervisorState::Idle if rises(DigitalInputs::ENABLE) && has_law => {
                self.lift_offs = 0;
                self.enter(SupervisorState::Armed);
                arms = true;
            }
            SupervisorState::Idle | SupervisorState::Fault => {}
            _ if !enabled => self.enter(SupervisorState::Idle),
            SupervisorState::Armed => {
                self.contact_ticks = if contact {
                    self.contact_ticks.saturating_add(1)
                } else {
                    0
                };
                if self.exceeds(self.contact_ticks, self.settings.arming_s) {
                    self.enter(SupervisorState::Tracking);
                    starts_tracking = true;
                } else if self.exceeds(self.ticks, self.settings.arming_limit_s) {
                    self.latch(Fault::ContactNotFound);
                }
            }
            SupervisorState::Tracking => {
                if self.exceeds(self.ticks, self.settings.recovered_s) {
                    self.lift_offs = 0;
                }
                if !contact {
                    self.lift_offs = self.lift_offs.saturating_add(1);
                    let too_many = self.lift_offs > self.settings.recoveries_limit;
                    if self.recovers() && too_many {
                        self.latch(Fault::RecoveryFailed);
                    } else {
                        self.enter(SupervisorState::LiftOff);
                    }
                }
            }
            SupervisorState::LiftOff => {
                let limit_s = self.settings.lift_off_limit_s;
                if contact {
                    self.enter(SupervisorState::Tracking);
                } else if limit_s > 0.0 && self.exceeds(self.ticks, limit_s) {
                    self.latch(Fault::LiftOffTooLong);
                }
            }
        }
        Phase {
            state: self.state,
            arms,
            starts_tracking,
            recovers: self.recovers(),
        }
    }

    fn recovers(&self) -> bool {
        self.settings.on_lift_off == OnLiftOff::Recover
    }

    /// Returns whether a count of ticks has exceeded `time_s`.
    fn exceeds(&self, ticks: u32, time_s: f32) -> bool {
        ticks as f32 > time_s * self.tick_hz
    }

    /// Returns the present state.
    pub fn state(&self) -> SupervisorState {
        self.state
    }

    /// Returns the latched fault.
    pub fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// Records how many times a lapse occurred, 0 for none. Returns whether this has just latched a
    /// fault; the caller then takes the torque off.
    #[inline]
    pub fn note(&mut self, lapse: Lapse, times: u32) -> bool {
        let latches = self.lapses.note(lapse, times) && self.fault.is_none();
        if latches {
            self.latch(lapse.fault());
        }
        latches
    }

    /// Latches a fault unless one is latched already.
    pub fn latch(&mut self, fault: Fault) {
        if self.fault.is_none() {
            self.fault = Some(fault);
        }
        self.enter(SupervisorState::Fault);
    }

    /// Writes state and fault to an answer.
    pub fn report(&self, answer: &mut ActuatorFrame) {
        answer.state = self.state as u8;
        answer.fault = self.fault.map_or(0, |fault| fault as u8);
    }

    /// Stops the drive without evaluating the other inputs.
    pub fn disable(&mut self) {
        self.enter(SupervisorState::Idle);
    }

    fn enter(&mut self, state: SupervisorState) {
        if self.state != state {
            self.state = state;
            self.ticks = 0;
            self.contact_ticks = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use SupervisorState::{Armed, Idle, LiftOff, Tracking};

    const ON: DigitalInputs = DigitalInputs::ENABLE;
    const OFF: DigitalInputs = DigitalInputs(0);

    /// A supervisor with the default settings.
    struct Tested(Supervisor);

    impl Default for Tested {
        fn default() -> Self {
            let (settings, limits) = (SupervisorSettings::default(), LapseLimits::default());
            Self(Supervisor::new(settings, limits, 1000.0))
        }
    }

    impl Tested {
        fn tick(&mut self, inputs: DigitalInputs, contact: bool, has_law: bool) {
            self.0.tick(inputs, contact, has_law);
        }

        fn state(&self) -> SupervisorState {
            self.0.state()
        }

        fn fault(&self) -> Option<Fault> {
            self.0.fault()
        }
    }

    fn tracking() -> Tested {
        let mut supervisor = Tested::default();
        for _ in 0..12 {
            supervisor.tick(ON, true, true);
        }
        assert_eq!(supervisor.state(), Tracking);
        supervisor
    }

    #[test]
    fn enabling_arms_and_confirmed_contact_starts_tracking() {
        let mut supervisor = Tested::default();
        supervisor.tick(OFF, true, true);
        assert_eq!(supervisor.state(), Idle);
        supervisor.tick(ON, true, true);
        assert_eq!(supervisor.state(), Armed);
        assert_eq!(tracking().state(), Tracking);
    }

    #[test]
    fn without_a_law_nothing_arms() {
        let mut supervisor = Tested::default();
        supervisor.tick(ON, true, false);
        assert_eq!(supervisor.state(), Idle);
    }

    #[test]
    fn arming_without_contact_is_given_up() {
        let mut supervisor = Tested::default();
        for _ in 0..1002 {
            supervisor.tick(ON, false, true);
        }
        assert_eq!(supervisor.fault(), Some(Fault::ContactNotFound));
        assert!(!supervisor.state().drives());
    }

    #[test]
    fn lift_off_is_left_on_contact_and_faults_after_its_limit() {
        let mut supervisor = tracking();
        supervisor.tick(ON, false, true);
        assert_eq!(supervisor.state(), LiftOff);
        supervisor.tick(ON, true, true);
        assert_eq!(supervisor.state(), Tracking);
        for _ in 0..2002 {
            supervisor.tick(ON, false, true);
        }
        assert_eq!(supervisor.fault(), Some(Fault::LiftOffTooLong));
    }

    #[test]
    fn a_fault_is_latched_until_reset_and_needs_a_new_enable() {
        let mut supervisor = tracking();
        supervisor.0.latch(Fault::NotFinite);
        supervisor.0.latch(Fault::StaleFrame);
        for inputs in [ON, OFF, ON] {
            supervisor.tick(inputs, true, true);
            assert_eq!(supervisor.fault(), Some(Fault::NotFinite));
        }
        supervisor.tick(ON | DigitalInputs::RESET, true, true);
        assert_eq!((supervisor.state(), supervisor.fault()), (Idle, None));
        supervisor.tick(ON, true, true);
        assert_eq!(supervisor.state(), Idle);
        supervisor.tick(OFF, true, true);
        supervisor.tick(ON, true, true);
        assert_eq!(supervisor.state(), Armed);
    }

    #[test]
    fn disabling_stops_the_drive() {
        let mut supervisor = tracking();
        supervisor.tick(OFF, true, true);
        assert_eq!(supervisor.state(), Idle);
    }
}
