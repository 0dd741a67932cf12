//! What the controller may do: idle → armed → tracking ⇄ lift-off, and fault
//! from everywhere. A fault is latched until a reset.

use painleve_shared::frame::DigitalInputs;
use painleve_shared::status::{Fault, SupervisorState};
use painleve_shared::{OutOfRange, check_setting, settings};

settings! {
    /// What to do when contact is lost while tracking.
    #[derive(Copy, Eq)]
    pub enum OnLiftOff = Recover {
        /// Bring the tip back onto the belt, a limited number of times.
        "recover" => Recover,
        /// Let the law go on, as in the paper, until the time limit.
        "continue" => Continue,
        /// Latch the fault `LiftOffTooLong` at once.
        "fault" => Fault,
    }
}

settings! {
    /// Settings of the supervisor. Times are rounded to ticks; the longest is countable at the
    /// highest control rate.
    #[derive(Copy)]
    pub struct SupervisorSettings {
        /// Time in contact before the reference starts.
        arming_s: f32 = 0.01, 0.0..=1e4, "s";
        /// Time without contact after which arming ends in the fault `ContactNotFound`; at least
        /// `arming_s`.
        arming_limit_s: f32 = 1.0, 0.0..=1e4, "s";
        /// What to do when contact is lost while tracking.
        on_lift_off: OnLiftOff = OnLiftOff::Recover;
        /// Time without contact after which the fault `LiftOffTooLong` is latched; 0 for never.
        lift_off_limit_s: f32 = 2.0, 0.0..=1e4, "s";
        /// Lift-offs in a row that are recovered from; one more is the fault `RecoveryFailed`.
        recoveries_limit: u32 = 10, 0..=1_000_000;
        /// Time in contact that ends such a row.
        recovered_s: f32 = 1.0, 0.0..=1e4, "s";
    }
    check Self::relations;
}

impl SupervisorSettings {
    fn relations(&self) -> Result<(), OutOfRange> {
        check_setting!(self.arming_limit_s, self.arming_s, 1e4)
    }
}

/// The state machine.
#[derive(Clone, Copy, Debug)]
pub struct Supervisor {
    settings: SupervisorSettings,
    tick_hz: f32,
    state: SupervisorState,
    fault: Option<Fault>,
    /// Ticks in the present state, or in contact while armed.
    ticks: u32,
    contact_ticks: u32,
    /// Lift-offs in a row.
    lift_offs: u32,
    inputs: DigitalInputs,
}

impl Supervisor {
    /// An idle supervisor that is called `tick_hz` times a second.
    pub fn new(settings: SupervisorSettings, tick_hz: f32) -> Self {
        Self {
            settings,
            tick_hz,
            state: SupervisorState::Idle,
            fault: None,
            ticks: 0,
            contact_ticks: 0,
            lift_offs: 0,
            inputs: DigitalInputs::default(),
        }
    }

    /// Present state.
    pub fn state(&self) -> SupervisorState {
        self.state
    }

    /// The latched fault.
    pub fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// Whether torque may be applied.
    pub fn drives(&self) -> bool {
        matches!(
            self.state,
            SupervisorState::Armed | SupervisorState::Tracking | SupervisorState::LiftOff
        )
    }

    /// Whether a tip in the air is brought back onto the belt.
    pub fn recovers(&self) -> bool {
        self.settings.on_lift_off == OnLiftOff::Recover && self.drives()
    }

    /// Latches a fault. The first one stays.
    pub fn latch(&mut self, fault: Fault) {
        if self.fault.is_none() {
            self.fault = Some(fault);
        }
        self.enter(SupervisorState::Fault);
    }

    /// Stops the drive without looking at anything else.
    pub fn disable(&mut self) {
        self.enter(SupervisorState::Idle);
    }

    /// One tick: `has_law` says whether there is anything to arm.
    pub fn tick(&mut self, inputs: DigitalInputs, contact: bool, has_law: bool) {
        let before = core::mem::replace(&mut self.inputs, inputs);
        let rises = |bit| inputs.contains(bit) && !before.contains(bit);
        let enabled = inputs.contains(DigitalInputs::ENABLE);
        self.ticks = self.ticks.saturating_add(1);
        match self.state {
            SupervisorState::Fault => {
                if rises(DigitalInputs::RESET) {
                    self.fault = None;
                    self.enter(SupervisorState::Idle);
                }
            }
            SupervisorState::Idle => {
                // An edge, so that a reset alone does not start the drive again.
                if rises(DigitalInputs::ENABLE) && has_law {
                    self.lift_offs = 0;
                    self.enter(SupervisorState::Armed);
                }
            }
            _ if !enabled => self.enter(SupervisorState::Idle),
            SupervisorState::Armed => {
                self.contact_ticks = if contact {
                    self.contact_ticks.saturating_add(1)
                } else {
                    0
                };
                if self.exceeds(self.contact_ticks, self.settings.arming_s) {
                    self.enter(SupervisorState::Tracking);
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
                    let limit = self.settings.recoveries_limit;
                    match self.settings.on_lift_off {
                        OnLiftOff::Recover if self.lift_offs > limit => {
                            self.latch(Fault::RecoveryFailed);
                        }
                        OnLiftOff::Recover | OnLiftOff::Continue => {
                            self.enter(SupervisorState::LiftOff);
                        }
                        OnLiftOff::Fault => self.latch(Fault::LiftOffTooLong),
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
    }

    /// Whether a count of ticks has gone on for longer than `time_s`.
    fn exceeds(&self, ticks: u32, time_s: f32) -> bool {
        ticks as f32 > time_s * self.tick_hz
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

    fn tracking() -> Supervisor {
        let mut supervisor = Supervisor::new(SupervisorSettings::default(), 1000.0);
        for _ in 0..12 {
            supervisor.tick(ON, true, true);
        }
        assert_eq!(supervisor.state(), Tracking);
        supervisor
    }

    #[test]
    fn enabling_arms_and_confirmed_contact_starts_tracking() {
        let mut supervisor = Supervisor::new(SupervisorSettings::default(), 1000.0);
        supervisor.tick(OFF, true, true);
        assert_eq!(supervisor.state(), Idle);
        supervisor.tick(ON, true, true);
        assert_eq!(supervisor.state(), Armed);
        assert_eq!(tracking().state(), Tracking);
    }

    #[test]
    fn without_a_law_nothing_arms() {
        let mut supervisor = Supervisor::new(SupervisorSettings::default(), 1000.0);
        supervisor.tick(ON, true, false);
        assert_eq!(supervisor.state(), Idle);
    }

    #[test]
    fn arming_without_contact_is_given_up() {
        let mut supervisor = Supervisor::new(SupervisorSettings::default(), 1000.0);
        for _ in 0..1002 {
            supervisor.tick(ON, false, true);
        }
        assert_eq!(supervisor.fault(), Some(Fault::ContactNotFound));
        assert!(!supervisor.drives());
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
        supervisor.latch(Fault::NotFinite);
        supervisor.latch(Fault::StaleFrame);
        for inputs in [ON, OFF, ON] {
            supervisor.tick(inputs, true, true);
            assert_eq!(supervisor.fault(), Some(Fault::NotFinite));
        }
        supervisor.tick(ON.with(DigitalInputs::RESET), true, true);
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
