//! What the inputs, the sequence number and missing samples mean to the controller; `docs/embedding.md` describes it.

use core::sync::atomic::Ordering::Relaxed;

use painleve_firmware::Configuration;
use painleve_firmware::drive::{ControlTask, FrameSource};
use painleve_firmware::frame::DigitalInputs;
use painleve_firmware::status::{Fault, SupervisorState};
use painleve_firmware::supervise::lapses::Lapse;

use crate::{Arm, ENCODERS, FORCES, INPUTS, SAMPLES, STAGES_ON, TICKS};

/// State, latched fault, and whether the stages may be on.
type Outcome = (SupervisorState, Option<Fault>, bool);

/// The firmware, with the arm resting on the belt.
struct Bench {
    task: ControlTask<Arm>,
    configuration: Configuration,
}

impl Bench {
    fn new() -> Self {
        let configuration = Configuration::default();
        let mut task = ControlTask::new(Arm::default());
        task.configure(&configuration, FrameSource::Sensors)
            .expect("valid");
        let encoder = configuration.converters.encoders[0];
        let [theta1, theta2] = [-11.4_f64, -35.1].map(f64::to_radians);
        ENCODERS[0].store(encoder.reading(theta1).0, Relaxed);
        ENCODERS[1].store(encoder.reading(theta2 - theta1).0, Relaxed);
        FORCES[0].store(configuration.converters.force.counts(10.0).0, Relaxed);
        FORCES[1].store(configuration.converters.force.counts(-6.0).0, Relaxed);
        Self {
            task,
            configuration,
        }
    }

    /// Runs ticks, each with `samples` new samples.
    fn ticks(&mut self, count: u32, samples: u32, inputs: DigitalInputs) -> Outcome {
        INPUTS.store(inputs.0, Relaxed);
        let mut last = Default::default();
        for _ in 0..count {
            TICKS.fetch_add(1, Relaxed);
            SAMPLES.fetch_add(samples, Relaxed);
            if let Some(answered) = self.task.tick() {
                last = *answered.frame;
            }
        }
        let state = last.supervisor_state().expect("known");
        (state, last.latched_fault(), STAGES_ON.load(Relaxed))
    }
}

const NOTHING: DigitalInputs = DigitalInputs::empty();
const ENABLE: DigitalInputs = DigitalInputs::ENABLE;
const TRACKING: Outcome = (SupervisorState::Tracking, None, true);

fn faulty(fault: Fault) -> Outcome {
    (SupervisorState::Fault, Some(fault), false)
}

// One test, because the registers are there once.
#[test]
fn enable_arms_lapses_stop_and_reset_then_a_new_enable_start_again() {
    let mut bench = Bench::new();
    let limits = bench.configuration.settings.lapses;
    assert_eq!(
        bench.ticks(20, 1, NOTHING),
        (SupervisorState::Idle, None, false)
    );
    assert_eq!(bench.ticks(30, 1, ENABLE), TRACKING);

    // Ticks without a sample, up to the limit, change nothing; one more stops.
    bench.ticks(limits.missing_frames, 0, ENABLE);
    let lapses = bench.task.lapses().expect("configured");
    assert_eq!(lapses.totals().of(Lapse::MissingFrame), limits.missing_frames);
    assert_eq!(bench.ticks(60, 1, ENABLE), TRACKING);
    assert_eq!(
        bench.ticks(limits.missing_frames + 1, 0, ENABLE),
        faulty(Fault::MissingFrame)
    );

    // Samples are no cure, nor is ENABLE low, nor RESET with ENABLE still high.
    assert_eq!(bench.ticks(50, 1, NOTHING), faulty(Fault::MissingFrame));
    bench.ticks(1, 1, ENABLE | DigitalInputs::RESET);
    assert_eq!(bench.ticks(50, 1, ENABLE).0, SupervisorState::Idle);
    bench.ticks(1, 1, NOTHING);
    assert_eq!(bench.ticks(30, 1, ENABLE), TRACKING);

    // Two samples in a tick: one is lost.
    assert_eq!(
        bench.ticks(limits.lost_frames + 20, 2, ENABLE),
        faulty(Fault::LostFrames)
    );
}

#[test]
fn state_and_settings_are_small() {
    assert!(size_of::<ControlTask<Arm>>() <= 2048);
    assert!(size_of::<Configuration>() <= 1024);
}

#[test]
fn the_firmware_has_less_than_80_lines_of_code() {
    let is_code = |line: &&str| !line.trim().is_empty() && !line.trim().starts_with("//");
    let files = [include_str!("lib.rs"), include_str!("main.rs")];
    let lines = files.map(|file| file.lines().filter(is_code).count());
    assert!(lines[0] + lines[1] < 80, "{lines:?}");
}
