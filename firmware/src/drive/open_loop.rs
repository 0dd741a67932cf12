//! Torques from the host instead of a law, for commissioning an arm whose mounting is unknown.
//!
//! Nothing here depends on the directions of encoders or stages. Torques are limited, expire unless they are
//! repeated, and a joint that moves far from where the drive was armed latches a fault.

use painleve_shared::counts::{EncoderCounts, EncoderScale, TorqueCounts};
use painleve_shared::frame::{ActuatorFrame, DigitalInputs, SensorFrame};
use painleve_shared::status::{Fault, SupervisorState};

use crate::configuration::Configuration;
use crate::law::Law;
use crate::supervise::lapses::{BOARD_LAPSES, Lapse};
use crate::supervise::supervisor::Supervisor;
use crate::torque_output::TorqueOutput;

/// Time after which a torque that is not repeated expires, s.
const LIFETIME_S: f32 = 0.05;

/// Largest turn of a joint from where the drive was armed, as a part of a turn: 11°.
const FARTHEST: u32 = 32;

/// A drive in open loop.
#[derive(Clone, Debug)]
pub struct OpenLoop {
    /// Scale of both encoders, whose zeros do not matter here.
    encoder: EncoderScale,
    output: TorqueOutput,
    /// Ticks after which a torque expires.
    lifetime: u32,
    torques: [TorqueCounts; 2],
    /// Ticks since the torques were requested.
    age: u32,
    /// Readings when the drive was armed; `None` while it is not.
    armed_at: Option<[EncoderCounts; 2]>,
}

impl OpenLoop {
    /// Makes a drive that is not armed, with the configuration's torque limit.
    pub fn new<L: Law>(configuration: &Configuration<L>) -> Self {
        let (converters, settings) = (&configuration.converters, &configuration.settings);
        let [encoder, _] = converters.encoders;
        Self {
            encoder,
            output: TorqueOutput::new(converters.torque, settings.torque_limit_nm),
            // However slow the ticks are, a torque acts until the next one.
            lifetime: ((LIFETIME_S * configuration.tick_hz) as u32).max(1),
            torques: [TorqueCounts(0); 2],
            age: 0,
            armed_at: None,
        }
    }

    /// Requests torques from now on; without effect while the drive is not armed.
    pub fn request(&mut self, torques: [TorqueCounts; 2]) {
        if self.armed_at.is_some() {
            self.torques = torques.map(|it| TorqueCounts(self.output.limited(it.0)));
            self.age = 0;
        }
    }

    /// Answers one sensor frame in place of the controller, which does not run, and notes its lapses.
    // Out of line: it must not take the place of the law in the control interrupt.
    #[cold]
    #[inline(never)]
    pub fn tick<'a>(
        &mut self,
        frame: &SensorFrame,
        (supervisor, answer): (&mut Supervisor, &'a mut ActuatorFrame),
    ) -> &'a ActuatorFrame {
        let is_enabled = frame.inputs.contains(DigitalInputs::ENABLE);
        let is_readable = frame.joints.iter().all(|it| self.encoder.contains(*it));
        match self.armed_at {
            _ if !is_enabled || supervisor.fault().is_some() => self.armed_at = None,
            Some(start) if self.has_moved_far(start, frame.joints) => {
                supervisor.latch(Fault::MovedTooFar);
            }
            Some(_) => {
                // Forces are not needed here.
                supervisor.note(Lapse::EncoderOutOfRange, u32::from(!is_readable));
                for (input, lapse) in BOARD_LAPSES {
                    supervisor.note(lapse, u32::from(frame.inputs.contains(input)));
                }
            }
            // A missing reading shows no motion from it.
            None if is_readable => self.armed_at = Some(frame.joints),
            None => {}
        }
        if supervisor.fault().is_some() {
            self.armed_at = None;
        }
        self.age = self.age.saturating_add(1);
        if self.armed_at.is_none() || self.age > self.lifetime {
            self.torques = [TorqueCounts(0); 2];
        }
        answer.tick = frame.tick;
        answer.sequence = answer.sequence.wrapping_add(1);
        answer.torques = self.torques;
        supervisor.report(answer);
        if self.armed_at.is_some() {
            answer.state = SupervisorState::Armed as u8;
        }
        answer
    }

    /// Returns whether a joint has turned too far; a missing reading counts as no motion.
    fn has_moved_far(&self, from: [EncoderCounts; 2], to: [EncoderCounts; 2]) -> bool {
        let encoder = &self.encoder;
        from.into_iter().zip(to).any(|(from, to)| {
            let turned = encoder.difference(from, to).unsigned_abs();
            encoder.contains(to) && turned > encoder.modulus() / FARTHEST
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::LawSettings;
    use crate::supervise::lapses::LapseLimits;

    const REQUEST: [TorqueCounts; 2] = [TorqueCounts(100), TorqueCounts(-2000)];

    /// A drive in open loop, with what it needs of the controller.
    struct Tested {
        open_loop: OpenLoop,
        supervisor: Supervisor,
        answer: ActuatorFrame,
    }

    impl Tested {
        fn tick(&mut self, frame: &SensorFrame) -> &ActuatorFrame {
            let controller = (&mut self.supervisor, &mut self.answer);
            self.open_loop.tick(frame, controller)
        }

        fn request(&mut self, torques: [TorqueCounts; 2]) {
            self.open_loop.request(torques);
        }
    }

    fn at_rate(tick_hz: f32) -> Tested {
        let mut configuration = Configuration::<LawSettings> {
            tick_hz,
            ..Default::default()
        };
        configuration.settings.torque_limit_nm = 1.0;
        Tested {
            open_loop: OpenLoop::new(&configuration),
            supervisor: Supervisor::new(
                configuration.settings.supervisor,
                configuration.settings.lapses,
                tick_hz,
            ),
            answer: ActuatorFrame::default(),
        }
    }

    fn open_loop() -> Tested {
        at_rate(1000.0)
    }

    fn frame(tick: u32, joint: u32, inputs: DigitalInputs) -> SensorFrame {
        SensorFrame {
            tick,
            joints: [EncoderCounts(joint), EncoderCounts(7)],
            inputs,
            ..SensorFrame::default()
        }
    }

    #[test]
    fn torques_are_limited_and_expire() {
        let mut open_loop = open_loop();
        open_loop.tick(&frame(0, 100, DigitalInputs::ENABLE));
        open_loop.request(REQUEST);
        for tick in 1..=50 {
            let answer = open_loop.tick(&frame(tick, 100, DigitalInputs::ENABLE));
            assert_eq!(answer.torques, [TorqueCounts(100), TorqueCounts(-409)]);
            assert_eq!(answer.supervisor_state(), Some(SupervisorState::Armed));
            assert_eq!(answer.tick, tick);
        }
        let answer = open_loop.tick(&frame(51, 100, DigitalInputs::ENABLE));
        assert_eq!(answer.torques, [TorqueCounts(0); 2]);
    }

    #[test]
    fn without_enable_there_is_no_torque_before_or_after() {
        let mut open_loop = open_loop();
        open_loop.request(REQUEST);
        let armed = open_loop.tick(&frame(0, 100, DigitalInputs::ENABLE));
        assert_eq!(armed.torques, [TorqueCounts(0); 2]);
        open_loop.request(REQUEST);
        let open = open_loop.tick(&frame(1, 100, DigitalInputs::default()));
        assert_eq!(open.torques, [TorqueCounts(0); 2]);
        assert_eq!(open.supervisor_state(), Some(SupervisorState::Idle));
    }

    #[test]
    fn a_joint_that_moves_far_in_either_direction_latches_a_fault() {
        // 512 of 16,384 counts are allowed, across zero as well.
        for (start, there, is_far) in [
            (100, 612, false),
            (100, 613, true),
            (100, 15_972, false),
            (100, 15_971, true),
        ] {
            let mut open_loop = open_loop();
            open_loop.tick(&frame(0, start, DigitalInputs::ENABLE));
            open_loop.request(REQUEST);
            let answer = open_loop.tick(&frame(1, there, DigitalInputs::ENABLE));
            let fault = is_far.then_some(Fault::MovedTooFar);
            assert_eq!(answer.latched_fault(), fault, "{there}");
            assert_eq!(answer.torques == [TorqueCounts(0); 2], is_far);
            open_loop.request(REQUEST);
            let answer = open_loop.tick(&frame(2, start, DigitalInputs::ENABLE));
            assert_eq!(answer.latched_fault(), fault, "latched");
        }
    }

    #[test]
    fn nothing_is_armed_on_a_missing_reading_from_which_no_motion_would_show() {
        let mut open_loop = open_loop();
        let answer = open_loop.tick(&frame(0, u32::MAX, DigitalInputs::ENABLE));
        assert_eq!(answer.supervisor_state(), Some(SupervisorState::Idle));
        open_loop.tick(&frame(1, 100, DigitalInputs::ENABLE));
        let answer = open_loop.tick(&frame(2, 700, DigitalInputs::ENABLE));
        assert_eq!(answer.latched_fault(), Some(Fault::MovedTooFar));
    }

    /// Returns the fault that is latched by ticks with this frame, and their number, while the host repeats its torques.
    fn latched_by(frame: &SensorFrame) -> Option<(Fault, u32)> {
        let mut open_loop = open_loop();
        open_loop.tick(&self::frame(0, 100, DigitalInputs::ENABLE));
        (1..100).find_map(|ticks| {
            open_loop.request(REQUEST);
            let answer = open_loop.tick(frame);
            let fault = answer.latched_fault();
            assert_eq!(answer.torques == [TorqueCounts(0); 2], fault.is_some());
            Some((fault?, ticks))
        })
    }

    #[test]
    fn what_a_board_reports_takes_the_torque_off_as_with_a_law() {
        for (input, lapse) in BOARD_LAPSES {
            let ticks = LapseLimits::default().of(lapse) + 1;
            let bad = frame(1, 100, DigitalInputs::ENABLE | input);
            assert_eq!(latched_by(&bad), Some((lapse.fault(), ticks)));
        }
    }

    #[test]
    fn lapses_are_counted() {
        let mut open_loop = open_loop();
        open_loop.tick(&frame(0, 100, DigitalInputs::ENABLE));
        open_loop.tick(&frame(1, u32::MAX, DigitalInputs::ENABLE));
        assert_eq!(
            open_loop
                .supervisor
                .lapses
                .totals()
                .of(Lapse::EncoderOutOfRange),
            1
        );
    }

    #[test]
    fn an_encoder_that_stays_silent_takes_the_torque_off() {
        let silent = frame(1, u32::MAX, DigitalInputs::ENABLE);
        assert_eq!(latched_by(&silent), Some((Fault::EncoderOutOfRange, 2)));
        assert_eq!(latched_by(&frame(1, 100, DigitalInputs::ENABLE)), None);
    }

    #[test]
    fn a_torque_acts_at_the_lowest_rate() {
        let mut open_loop = at_rate(10.0);
        open_loop.tick(&frame(0, 100, DigitalInputs::ENABLE));
        open_loop.request(REQUEST);
        let answer = *open_loop.tick(&frame(1, 100, DigitalInputs::ENABLE));
        assert_ne!(answer.torques, [TorqueCounts(0); 2]);
        let answer = open_loop.tick(&frame(2, 100, DigitalInputs::ENABLE));
        assert_eq!(answer.torques, [TorqueCounts(0); 2]);
    }

    #[test]
    fn a_missing_reading_is_no_motion() {
        let mut open_loop = open_loop();
        open_loop.tick(&frame(0, 100, DigitalInputs::ENABLE));
        let answer = open_loop.tick(&frame(1, u32::MAX, DigitalInputs::ENABLE));
        assert_eq!(answer.latched_fault(), None);
    }
}
