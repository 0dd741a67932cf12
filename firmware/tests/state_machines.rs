//! Supervisor and lapse monitor against models of them, under random sequences of events.
//!
//! The models say the same in other terms: since when something has been so, instead of counters
//! that are reset on entering a state; and a list of all lapses instead of counts.

use proptest::prelude::*;
use proptest::sample::select;
use proptest_state_machine::{ReferenceStateMachine, StateMachineTest, prop_state_machine};

use painleve_firmware::supervise::lapses::{Lapse, LapseLimits, LapseMonitor};
use painleve_firmware::supervise::supervisor::{OnLiftOff, Supervisor, SupervisorSettings};
use painleve_shared::frame::DigitalInputs;
use painleve_shared::status::{Fault, SupervisorState};

/// A power of two, so that times are whole numbers of ticks in binary as well.
const TICK_HZ: u16 = 1024;

/// Settings of the supervisor, times in ticks.
#[derive(Clone, Copy, Debug)]
struct Limits {
    arming: u16,
    arming_limit: u16,
    on_lift_off: OnLiftOff,
    lift_off_limit: u16,
    recoveries: u32,
    recovered: u16,
}

impl Limits {
    fn settings(&self) -> SupervisorSettings {
        let seconds = |ticks: u16| f32::from(ticks) / f32::from(TICK_HZ);
        SupervisorSettings {
            arming_s: seconds(self.arming),
            arming_limit_s: seconds(self.arming_limit),
            on_lift_off: self.on_lift_off,
            lift_off_limit_s: seconds(self.lift_off_limit),
            recoveries_limit: self.recoveries,
            recovered_s: seconds(self.recovered),
        }
    }
}

/// State of the supervisor, and the tick since which it has been in it.
#[derive(Clone, Copy, Debug)]
enum Doing {
    Nothing,
    Arming {
        since: u64,
        contact_since: Option<u64>,
    },
    Tracking {
        since: u64,
    },
    InTheAir {
        since: u64,
    },
    Stopped(Fault),
}

#[derive(Clone, Debug)]
struct SupervisorModel {
    limits: Limits,
    now: u64,
    doing: Doing,
    /// Lift-offs since arming or since the last long contact.
    lift_offs: u32,
    was_enabled: bool,
    was_reset: bool,
}

/// Inputs of a tick.
#[derive(Clone, Copy, Debug)]
struct Inputs {
    enable: bool,
    reset: bool,
    contact: bool,
    has_law: bool,
}

#[derive(Clone, Copy, Debug)]
enum Event {
    /// So many ticks with the same inputs.
    Ticks(u8, Inputs),
    /// A fault that another part has found.
    Fault(Fault),
    /// Another part stops a drive that is on.
    Disable,
}

impl SupervisorModel {
    fn new(limits: Limits) -> Self {
        Self {
            limits,
            now: 0,
            doing: Doing::Nothing,
            lift_offs: 0,
            was_enabled: false,
            was_reset: false,
        }
    }

    fn drives(&self) -> bool {
        !matches!(self.doing, Doing::Nothing | Doing::Stopped(_))
    }

    fn tick(&mut self, inputs: Inputs) {
        let switched_on = inputs.enable && !self.was_enabled;
        let reset_pressed = inputs.reset && !self.was_reset;
        (self.was_enabled, self.was_reset) = (inputs.enable, inputs.reset);
        self.now += 1;
        let now = self.now;
        let limits = self.limits;
        let is_longer = |since: u64, limit: u16| now - since > u64::from(limit);
        self.doing = match self.doing {
            Doing::Stopped(_) if reset_pressed => Doing::Nothing,
            Doing::Stopped(fault) => Doing::Stopped(fault),
            Doing::Nothing if switched_on && inputs.has_law => {
                self.lift_offs = 0;
                Doing::Arming {
                    since: now,
                    contact_since: None,
                }
            }
            Doing::Nothing => Doing::Nothing,
            _ if !inputs.enable => Doing::Nothing,
            Doing::Arming {
                since,
                contact_since,
            } => {
                let contact_since = inputs.contact.then(|| contact_since.unwrap_or(now - 1));
                if contact_since.is_some_and(|since| is_longer(since, limits.arming)) {
                    Doing::Tracking { since: now }
                } else if is_longer(since, limits.arming_limit) {
                    Doing::Stopped(Fault::ContactNotFound)
                } else {
                    Doing::Arming {
                        since,
                        contact_since,
                    }
                }
            }
            Doing::Tracking { since } => {
                if is_longer(since, limits.recovered) {
                    self.lift_offs = 0;
                }
                if inputs.contact {
                    Doing::Tracking { since }
                } else {
                    self.lift_offs += 1;
                    self.lift_off()
                }
            }
            Doing::InTheAir { .. } if inputs.contact => Doing::Tracking { since: now },
            Doing::InTheAir { since }
                if limits.lift_off_limit > 0 && is_longer(since, limits.lift_off_limit) =>
            {
                Doing::Stopped(Fault::LiftOffTooLong)
            }
            Doing::InTheAir { since } => Doing::InTheAir { since },
        };
    }

    fn lift_off(&self) -> Doing {
        match self.limits.on_lift_off {
            OnLiftOff::Recover if self.lift_offs > self.limits.recoveries => {
                Doing::Stopped(Fault::RecoveryFailed)
            }
            OnLiftOff::Recover | OnLiftOff::Continue => Doing::InTheAir { since: self.now },
        }
    }

    fn state(&self) -> (SupervisorState, Option<Fault>) {
        match self.doing {
            Doing::Nothing => (SupervisorState::Idle, None),
            Doing::Arming { .. } => (SupervisorState::Armed, None),
            Doing::Tracking { .. } => (SupervisorState::Tracking, None),
            Doing::InTheAir { .. } => (SupervisorState::LiftOff, None),
            Doing::Stopped(fault) => (SupervisorState::Fault, Some(fault)),
        }
    }
}

struct SupervisorReference;

impl ReferenceStateMachine for SupervisorReference {
    type State = SupervisorModel;
    type Transition = Event;

    fn init_state() -> BoxedStrategy<SupervisorModel> {
        let reactions = [OnLiftOff::Recover, OnLiftOff::Continue];
        let times = (0..12_u16, 0..40_u16, 0..20_u16, 0..20_u16);
        (times, select(reactions.to_vec()), 0..4_u32)
            .prop_map(|(times, on_lift_off, recoveries)| {
                let (arming, more, lift_off_limit, recovered) = times;
                SupervisorModel::new(Limits {
                    arming,
                    arming_limit: arming + more,
                    on_lift_off,
                    lift_off_limit,
                    recoveries,
                    recovered,
                })
            })
            .boxed()
    }

    fn transitions(_: &SupervisorModel) -> BoxedStrategy<Event> {
        let weighted = prop::bool::weighted;
        let inputs = (weighted(0.9), weighted(0.2), weighted(0.7), weighted(0.9));
        let inputs = inputs.prop_map(|(enable, reset, contact, has_law)| Inputs {
            enable,
            reset,
            contact,
            has_law,
        });
        prop_oneof![
            20 => (1..25_u8, inputs).prop_map(|(count, inputs)| Event::Ticks(count, inputs)),
            1 => select(Fault::ALL).prop_map(Event::Fault),
            1 => Just(Event::Disable),
        ]
        .boxed()
    }

    fn preconditions(model: &SupervisorModel, event: &Event) -> bool {
        model.drives() || !matches!(event, Event::Disable)
    }

    fn apply(mut model: SupervisorModel, event: &Event) -> SupervisorModel {
        match *event {
            Event::Ticks(count, inputs) => (0..count).for_each(|_| model.tick(inputs)),
            Event::Fault(fault) => {
                if !matches!(model.doing, Doing::Stopped(_)) {
                    model.doing = Doing::Stopped(fault);
                }
            }
            Event::Disable => model.doing = Doing::Nothing,
        }
        model
    }
}

struct SupervisorTest;

impl StateMachineTest for SupervisorTest {
    type SystemUnderTest = Supervisor;
    type Reference = SupervisorReference;

    fn init_test(model: &SupervisorModel) -> Self::SystemUnderTest {
        let limits = LapseLimits::default();
        Supervisor::new(model.limits.settings(), limits, f32::from(TICK_HZ))
    }

    fn apply(mut supervisor: Supervisor, _: &SupervisorModel, event: Event) -> Supervisor {
        match event {
            Event::Ticks(count, inputs) => {
                let Inputs {
                    enable,
                    reset,
                    contact,
                    has_law,
                } = inputs;
                let mut inputs = DigitalInputs::default();
                inputs.set(DigitalInputs::ENABLE, enable);
                inputs.set(DigitalInputs::RESET, reset);
                for _ in 0..count {
                    let before = supervisor.state();
                    let phase = supervisor.tick(inputs, contact, has_law);
                    assert_eq!(phase.state, supervisor.state());
                    let arms = before != phase.state && phase.state == SupervisorState::Armed;
                    assert_eq!(phase.arms, arms);
                    // Off is off at once, and nothing drives with a fault.
                    assert!(!phase.state.drives() || enable && supervisor.fault().is_none());
                }
            }
            Event::Fault(fault) => supervisor.latch(fault),
            Event::Disable => supervisor.disable(),
        }
        supervisor
    }

    fn check_invariants(supervisor: &Supervisor, model: &SupervisorModel) {
        assert_eq!((supervisor.state(), supervisor.fault()), model.state());
    }
}

/// Every lapse so far.
#[derive(Clone, Debug)]
struct LapseModel {
    limit: u32,
    /// For each kind how often it occurred at a time, 0 for not at all; oldest first.
    history: Vec<Vec<u32>>,
}

impl LapseModel {
    fn total(&self, lapse: Lapse) -> u32 {
        let times = self.history[lapse as usize].iter();
        times.fold(0, |total: u32, times| total.wrapping_add(*times))
    }

    fn is_too_much(&self, lapse: Lapse) -> bool {
        let limit = 2 * i64::from(self.limit);
        let owed = self.history[lapse as usize].iter().fold(0, |owed, times| {
            let change = if *times == 0 {
                -1
            } else {
                2 * i64::from(*times)
            };
            (owed + change).clamp(0, limit + 2)
        });
        owed > limit
    }
}

struct LapseReference;

impl ReferenceStateMachine for LapseReference {
    type State = LapseModel;
    type Transition = (Lapse, u32);

    fn init_state() -> BoxedStrategy<LapseModel> {
        (0..=100_u32)
            .prop_map(|limit| LapseModel {
                limit,
                history: vec![Vec::new(); Lapse::ALL.len()],
            })
            .boxed()
    }

    fn transitions(_: &LapseModel) -> BoxedStrategy<(Lapse, u32)> {
        let times = prop_oneof![2 => Just(0), 6 => 1..8_u32, 1 => 50..200_u32, 1 => any::<u32>()];
        (select(Lapse::ALL), times).boxed()
    }

    fn apply(mut model: LapseModel, (lapse, times): &(Lapse, u32)) -> LapseModel {
        model.history[*lapse as usize].push(*times);
        model
    }
}

struct LapseTest;

impl StateMachineTest for LapseTest {
    type SystemUnderTest = LapseMonitor;
    type Reference = LapseReference;

    fn init_test(model: &LapseModel) -> LapseMonitor {
        let limit = model.limit;
        LapseMonitor::new(LapseLimits {
            overruns: limit,
            missing_frames: limit,
            stale_frames: limit,
            lost_frames: limit,
            encoder_out_of_range: limit,
            force_out_of_range: limit,
            arming_refused: limit,
            stage_not_ready: limit,
            gap_against_force: limit,
            winding_hot: limit,
            garbage: limit,
            failed_checksums: limit,
        })
    }

    fn apply(
        mut monitor: LapseMonitor,
        model: &LapseModel,
        (lapse, times): (Lapse, u32),
    ) -> LapseMonitor {
        if times == 0 {
            assert!(!monitor.note(lapse, 0));
        } else {
            assert_eq!(monitor.note(lapse, times), model.is_too_much(lapse));
        }
        monitor
    }

    fn check_invariants(monitor: &LapseMonitor, model: &LapseModel) {
        for lapse in Lapse::ALL {
            assert_eq!(
                monitor.totals().of(*lapse),
                model.total(*lapse),
                "{lapse:?}"
            );
        }
    }
}

prop_state_machine! {
    #[test]
    fn the_supervisor_does_what_its_model_does(sequential 1..60 => SupervisorTest);

    #[test]
    fn the_lapse_monitor_counts_what_its_model_counts(sequential 1..120 => LapseTest);
}
