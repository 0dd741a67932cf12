//! Random frames that no arm would send: for any input, the controller's torque stays within the
//! limit, its faults stay latched, and off means zero torque.
//!
//! `PAINLEVE_FUZZ_TICKS` sets the number of ticks per scenario, at least 10,000.

use painleve_plant::Controller;
use painleve_plant::scenario::{Scenario, built_in};
use painleve_shared::counts::{EncoderCounts, ForceCounts};
use painleve_shared::frame::{ActuatorFrame, DigitalInputs, SensorFrame};
use painleve_shared::status::SupervisorState;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

const TICKS: u64 = 100_000;
/// Fewer ticks may not drive every arm and cause a fault.
const LEAST_TICKS: u64 = 10_000;
/// Ticks between two changes of the kind of frames.
const PHASE: u64 = 200;

/// Default limit of consecutive rejected frames; more are a fault.
const MOST_UNBELIEVED: u32 = 10;

/// Kind of frames sent for some time.
#[derive(Clone, Copy, Debug)]
enum FrameKind {
    /// Small steps from the last reading, as of an arm that moves.
    Walk,
    /// The same readings repeatedly.
    Stuck,
    /// Arbitrary numbers in all fields.
    Wild,
    /// A walk with lost, late and repeated frames.
    Lossy,
}

struct Frames {
    random: Pcg64,
    kind: FrameKind,
    last: SensorFrame,
    encoder_counts: u32,
}

impl Frames {
    fn next(&mut self, tick: u64) -> SensorFrame {
        let random = &mut self.random;
        if tick.is_multiple_of(PHASE) {
            self.kind = match random.random_range(0..5) {
                0 | 1 => FrameKind::Walk,
                2 => FrameKind::Stuck,
                3 => FrameKind::Wild,
                _ => FrameKind::Lossy,
            };
        }
        let mut frame = self.last;
        frame.tick = frame.tick.wrapping_add(1);
        frame.sequence = frame.sequence.wrapping_add(1);
        match self.kind {
            FrameKind::Stuck => {}
            FrameKind::Wild => {
                frame.joints = [random.random(), random.random()].map(EncoderCounts);
                frame.normal_force = ForceCounts(random.random());
                frame.tangential_force = ForceCounts(random.random());
                if random.random_bool(0.5) {
                    frame.sequence = random.random();
                }
            }
            FrameKind::Walk | FrameKind::Lossy => {
                let steps = [random.random_range(0..7), random.random_range(0..7)];
                for (joint, step) in frame.joints.iter_mut().zip(steps) {
                    let counts = joint.0 % self.encoder_counts;
                    joint.0 = (counts + self.encoder_counts + step - 3) % self.encoder_counts;
                }
                frame.normal_force = ForceCounts(random.random_range(-100..600));
                frame.tangential_force = ForceCounts(random.random_range(-400..400));
                if let FrameKind::Lossy = self.kind {
                    let gap = random.random_range(0..5);
                    frame.sequence = frame.sequence.wrapping_add(gap).wrapping_sub(1);
                }
            }
        }
        // Switches change occasionally, by hand or because of a loose wire.
        if random.random_bool(0.02) {
            frame.inputs = DigitalInputs(random.random_range(0..4));
        }
        if random.random_bool(1e-4) {
            frame.inputs = DigitalInputs(random.random());
        }
        self.last = frame;
        frame
    }
}

#[test]
fn no_frame_drives_the_controller_beyond_its_limits() {
    let ticks = std::env::var("PAINLEVE_FUZZ_TICKS")
        .ok()
        .and_then(|text| text.parse().ok())
        .unwrap_or(TICKS);
    assert!(
        ticks >= LEAST_TICKS,
        "PAINLEVE_FUZZ_TICKS={ticks} are too few to drive every arm: give at least {LEAST_TICKS}"
    );
    for (seed, name) in built_in::names().enumerate() {
        let scenario = Scenario::load(name, &[]).unwrap();
        let torque = &scenario.converters.torque;
        let count_nm = torque.range_nm / f64::from(1_u32 << (torque.bits - 1));
        let limit = f64::from(scenario.controller.torque_limit_nm) / count_nm;
        let mut controller = Controller::new(&scenario.controller_configuration()).unwrap();
        let mut frames = Frames {
            random: Pcg64::seed_from_u64(seed as u64),
            kind: FrameKind::Walk,
            last: SensorFrame::default(),
            encoder_counts: 1 << scenario.converters.encoder.bits,
        };
        let (mut before, mut disabled) = (ActuatorFrame::default(), 0_u32);
        let (mut driven, mut faults) = (0_u64, 0_u64);
        for tick in 0..ticks {
            let frame = frames.next(tick);
            let answer = controller.tick(&frame);
            let context =
                || format!("{name}, tick {tick}: {frame:?} → {answer:?} after {before:?}");

            assert_eq!(answer.tick, frame.tick, "{}", context());
            assert!(answer.is_understood(), "{}", context());
            for counts in answer.torques {
                assert!(f64::from(counts.0).abs() <= limit + 1.0, "{}", context());
            }
            let state = answer.supervisor_state();
            let off = matches!(
                state,
                Some(SupervisorState::Idle | SupervisorState::Fault) | None
            );
            // A frame with an old number is rejected completely; too many in a row are a fault.
            let enabled = frame.inputs.contains(DigitalInputs::ENABLE);
            disabled = if enabled { 0 } else { disabled + 1 };
            if off || disabled > MOST_UNBELIEVED {
                assert!(answer.torques.iter().all(|c| c.0 == 0), "{}", context());
            }
            let latched = state == Some(SupervisorState::Fault);
            assert_eq!(latched, answer.fault != 0, "{}", context());
            // The edge of RESET is that between accepted frames; lost frames have none.
            if before.fault != 0 && !frame.inputs.contains(DigitalInputs::RESET) {
                assert_eq!(answer.fault, before.fault, "{}", context());
            }
            driven += u64::from(!off);
            faults += u64::from(before.fault == 0 && answer.fault != 0);
            before = answer;
        }
        // The frames must drive the arm, or the test shows nothing.
        let has_law = scenario.controller.law.name() != "off";
        assert!(
            !has_law || (driven > ticks / 1000 && faults > ticks / 10_000),
            "{name}: of {ticks} ticks {driven} drive the arm, and {faults} faults occur"
        );
    }
}
