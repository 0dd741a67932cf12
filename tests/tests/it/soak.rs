//! Long runs with a disturbed link: one fault in every simulated minute, after which every counter
//! of both sides must be exact. The frame counters wrap during the run.
//!
//! `PAINLEVE_SOAK_MINUTES` and `PAINLEVE_SOAK_QEMU_MINUTES` set the simulated time;
//! `cargo xtask soak` sets them to a day and an hour.

use std::time::{Duration, Instant};

use painleve_board::{ConnectedBoard, Emulator};
use painleve_firmware::drive::{ControlTask, Drive};
use painleve_firmware::supervise::lapses::{Lapse, LapseCounts};
use painleve_plant::closed_loop::ClosedLoop;
use painleve_plant::controller_host::{Answer, ControllerHost, HostError};
use painleve_plant::law_choice::LawChoice;
use painleve_plant::scenario::Scenario;
use painleve_plant::simulation::Simulation;
use painleve_shared::counts::EncoderCounts;
use painleve_shared::frame::{ActuatorFrame, SensorFrame};
use painleve_shared::message::{FrameSource, MAXIMUM_LENGTH, Request};
use painleve_shared::wire::{self, Inbox, WireError};
use painleve_tests::image;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Ticks before the frame counters wrap.
const TICKS_BEFORE_WRAP: u32 = 10_000;
/// Bytes of garbage, with the zero that ends a message.
const GARBAGE: [u8; 12] = [0x55, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0xaa, 0];

/// Fault of a frame in transit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    /// The frame does not arrive.
    Dropped,
    /// The frame arrives twice.
    Repeated,
    /// The frame arrives with a flipped bit.
    Corrupted,
    /// Garbage arrives before the frame.
    Garbage,
    /// The answer does not arrive.
    Unanswered,
    /// The frame has an encoder reading outside its resolution.
    Impossible,
}

impl Fault {
    const ALL: [Self; 6] = [
        Self::Dropped,
        Self::Repeated,
        Self::Corrupted,
        Self::Garbage,
        Self::Unanswered,
        Self::Impossible,
    ];

    /// Returns whether the controller does not read the frame.
    fn loses_the_frame(self) -> bool {
        matches!(self, Self::Dropped | Self::Corrupted)
    }

    /// Returns whether the plant gets no answer.
    fn loses_the_answer(self) -> bool {
        self.loses_the_frame() || self == Self::Unanswered
    }
}

/// The board's end of the link.
trait Far {
    fn exchange(&mut self, frame: &SensorFrame) -> ActuatorFrame;
    /// Delivers bytes that are not a message.
    fn deliver(&mut self, bytes: &[u8]);
    /// Returns the ticks and lapses counted by the board.
    fn counts(&mut self) -> (u32, LapseCounts);
}

/// A frame that waits for its tick.
#[derive(Default)]
struct Desk(Option<SensorFrame>);

impl Drive for Desk {
    fn begin_tick(&mut self) {}

    fn sample(&mut self) -> Option<SensorFrame> {
        self.0.take()
    }

    fn actuate(&mut self, _: &ActuatorFrame) {}

    fn next_tick_is_due(&self) -> bool {
        false
    }

    fn stopwatch(&self) -> u32 {
        0
    }
}

/// The control task in this process, behind the wire's encoding.
struct Native {
    task: ControlTask<Desk, LawChoice>,
    inbox: Inbox,
}

impl Native {
    fn new(scenario: &Scenario) -> Self {
        let mut task = ControlTask::new(Desk::default());
        let configuration = scenario.controller_configuration();
        let configured = task.configure(&configuration, FrameSource::Lockstep);
        configured.expect("a valid configuration");
        let inbox = Inbox::new();
        Self { task, inbox }
    }

    /// Handles bytes as the image's link does; returns the answer to a sensor frame among them.
    fn take(&mut self, bytes: &[u8]) -> Option<ActuatorFrame> {
        let mut answer = None;
        for byte in bytes {
            let Some(message) = self.inbox.push(*byte) else {
                continue;
            };
            let request = wire::decode::<Request>(message);
            let checksum = matches!(request, Err(WireError::Checksum));
            self.task.note(Lapse::FailedChecksum, checksum.into());
            let garbage = request.is_err() && !checksum;
            self.task.note(Lapse::Garbage, garbage.into());
            if let Ok(Request::Sensor(frame)) = request {
                self.task.drive_mut().0 = Some(frame);
                answer = self.task.tick().map(|answered| *answered.frame);
            }
        }
        answer
    }
}

impl Far for Native {
    fn exchange(&mut self, frame: &SensorFrame) -> ActuatorFrame {
        let mut buffer = [0; MAXIMUM_LENGTH];
        let bytes = wire::encode(&Request::Sensor(*frame), &mut buffer).expect("it fits");
        self.take(bytes).expect("every frame is answered")
    }

    fn deliver(&mut self, bytes: &[u8]) {
        assert_eq!(self.take(bytes), None);
    }

    fn counts(&mut self) -> (u32, LapseCounts) {
        let lapses = self.task.lapses().expect("it is configured").totals();
        (self.task.counts().ticks, lapses)
    }
}

impl Far for Emulator {
    fn exchange(&mut self, frame: &SensorFrame) -> ActuatorFrame {
        let answer = ConnectedBoard::exchange(self, frame);
        answer.expect("the image answers").frame
    }

    fn deliver(&mut self, bytes: &[u8]) {
        self.send_raw(bytes).expect("the image reads");
    }

    fn counts(&mut self) -> (u32, LapseCounts) {
        let health = self.health().expect("the image answers");
        (health.ticks, health.lapses)
    }
}

/// A link with one fault in every minute.
struct Disturbed<B> {
    far: B,
    random: Pcg64,
    minute_ticks: u64,
    tick: u64,
    /// Tick of this minute's fault.
    due: u64,
    /// How often each fault has been injected.
    injected: [u32; Fault::ALL.len()],
}

impl<B> Disturbed<B> {
    fn new(far: B, tick_hz: u32) -> Self {
        let mut disturbed = Self {
            far,
            random: Pcg64::seed_from_u64(15),
            minute_ticks: 60 * u64::from(tick_hz),
            tick: 0,
            due: 0,
            injected: [0; Fault::ALL.len()],
        };
        disturbed.draw();
        disturbed
    }

    /// Draws the tick of the next minute's fault. It is not among the last ticks, so that its
    /// effects are counted in the same minute, and not among the first, so that the arm has been
    /// armed.
    fn draw(&mut self) {
        self.due = self.tick + self.random.random_range(1000..self.minute_ticks - 1000);
    }

    /// Returns the fault of this tick.
    fn fault(&mut self) -> Option<Fault> {
        let is_due = self.tick == self.due;
        self.tick += 1;
        if self.tick.is_multiple_of(self.minute_ticks) {
            self.draw();
        }
        is_due.then(|| {
            let kind = self.random.random_range(0..Fault::ALL.len());
            self.injected[kind] += 1;
            Fault::ALL[kind]
        })
    }

    fn count(&self, is_counted: impl Fn(Fault) -> bool) -> u32 {
        let kinds = Fault::ALL.iter().zip(self.injected);
        let counted = kinds.filter(|(fault, _)| is_counted(**fault));
        counted.map(|(_, injected)| injected).sum()
    }
}

impl<B: Far> ControllerHost for Disturbed<B> {
    fn exchange(&mut self, frame: &SensorFrame) -> Result<Answer, HostError> {
        let fault = self.fault();
        let answer = match fault {
            Some(Fault::Dropped) => None,
            Some(Fault::Corrupted) => {
                let mut buffer = [0; MAXIMUM_LENGTH];
                let bytes = wire::encode(&Request::Sensor(*frame), &mut buffer).expect("it fits");
                let mut bytes = bytes.to_vec();
                let at = self.random.random_range(0..bytes.len() - 1);
                // Avoids zero, which would end the message.
                bytes[at] ^= if bytes[at] == 1 { 2 } else { 1 };
                self.far.deliver(&bytes);
                None
            }
            Some(Fault::Garbage) => {
                self.far.deliver(&GARBAGE);
                Some(self.far.exchange(frame))
            }
            Some(Fault::Repeated) => {
                self.far.exchange(frame);
                Some(self.far.exchange(frame))
            }
            Some(Fault::Impossible) => {
                let mut impossible = *frame;
                impossible.joints[0] = EncoderCounts(u32::MAX);
                Some(self.far.exchange(&impossible))
            }
            Some(Fault::Unanswered) | None => Some(self.far.exchange(frame)),
        };
        let is_lost = fault.is_some_and(Fault::loses_the_answer);
        Ok(Answer {
            frame: answer.filter(|_| !is_lost),
            round_trip: None,
        })
    }
}

fn minutes(variable: &str, default: u32) -> u32 {
    let set = std::env::var(variable).ok();
    set.and_then(|text| text.parse().ok()).unwrap_or(default)
}

/// Runs a number of simulated minutes and compares every counter.
fn soak<B: Far>(minutes: u32, far: impl FnOnce(&Scenario) -> B) {
    let first_tick = format!("run.first_tick={}", u32::MAX - TICKS_BEFORE_WRAP);
    let scenario = Scenario::load("hybrid-elbow-down", &[first_tick]).expect("valid overrides");
    let simulation = Simulation::new(&scenario).expect("a valid scenario");
    let link = Disturbed::new(far(&scenario), scenario.run.tick_hz);
    let ticks = u64::from(minutes) * link.minute_ticks;
    let mut closed_loop = ClosedLoop::new(simulation, link);
    let start = Instant::now();
    for _ in 0..ticks {
        closed_loop.tick(&mut ()).expect("the run continues");
    }
    let (result, mut link) = closed_loop.finish();
    let (board_ticks, lapses) = link.far.counts();
    println!(
        "{minutes} simulated minutes in {:.0} s, faults {:?}, {lapses:?}",
        start.elapsed().as_secs_f64(),
        Fault::ALL.iter().zip(link.injected).collect::<Vec<_>>(),
    );

    let only = |fault: Fault| link.count(|other| other == fault);
    assert_eq!(link.count(|_| true), minutes, "one fault in every minute");
    assert_eq!(result.ticks, ticks);
    assert_eq!((result.fault, result.drive_watchdog_tick), (None, None));
    assert_eq!(result.statistics.lift_offs, 0);
    let unanswered = link.count(Fault::loses_the_answer);
    assert_eq!(result.stale_ticks, u64::from(unanswered));
    let read = ticks - u64::from(link.count(Fault::loses_the_frame));
    let read = read + u64::from(only(Fault::Repeated));
    assert_eq!(u64::from(board_ticks), read);
    // Every flipped bit breaks the checksum or the framing.
    let broken = only(Fault::Corrupted) + only(Fault::Garbage);
    assert_eq!(lapses.failed_checksums + lapses.garbage, broken);
    assert!(lapses.garbage >= only(Fault::Garbage));
    let expected = LapseCounts {
        stale_frames: only(Fault::Repeated),
        lost_frames: link.count(Fault::loses_the_frame),
        encoder_out_of_range: only(Fault::Impossible),
        failed_checksums: lapses.failed_checksums,
        garbage: lapses.garbage,
        ..LapseCounts::default()
    };
    assert_eq!(lapses, expected);
}

#[test]
fn every_counter_is_exact_after_a_long_run_with_a_fault_every_minute() {
    soak(minutes("PAINLEVE_SOAK_MINUTES", 10), Native::new);
}

#[test]
#[ignore = "soak"]
fn every_counter_is_exact_after_a_long_run_of_the_image() {
    soak(minutes("PAINLEVE_SOAK_QEMU_MINUTES", 1), |scenario| {
        let configuration = scenario.controller_configuration();
        let limit = Duration::from_secs(20);
        Emulator::start(image(), &configuration, false, limit).expect("QEMU starts")
    });
}
