//! Tests of the control task on a drive of plain values.

use super::*;
use crate::test_readings::pressing as frame;
use painleve_shared::counts::TorqueCounts;
use painleve_shared::status::{Fault, SupervisorState};
use std::cell::Cell;
use std::vec::Vec;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Call {
    BeginTick,
    Sample,
    Actuate(ActuatorFrame),
}

/// A drive that records the calls it receives.
#[derive(Default)]
struct Mock {
    calls: Vec<Call>,
    frame: Option<SensorFrame>,
    is_due: bool,
    stopwatch: Cell<u32>,
}

impl Drive for Mock {
    fn begin_tick(&mut self) {
        self.calls.push(Call::BeginTick);
    }

    fn sample(&mut self) -> Option<SensorFrame> {
        self.calls.push(Call::Sample);
        self.frame.take()
    }

    fn actuate(&mut self, answer: &ActuatorFrame) {
        self.calls.push(Call::Actuate(*answer));
    }

    fn next_tick_is_due(&self) -> bool {
        self.is_due
    }

    fn stopwatch(&self) -> u32 {
        let before = self.stopwatch.get();
        self.stopwatch.set(before.wrapping_add(7));
        before
    }
}

impl Mock {
    fn calls(&mut self) -> Vec<Call> {
        core::mem::take(&mut self.calls)
    }
}

/// Returns a task that tracks after 20 ticks.
fn tracking(source: FrameSource) -> ControlTask<Mock> {
    let mut task = ControlTask::new(Mock::default());
    task.configure(&Configuration::default(), source).unwrap();
    let answered = (0..20).map(|tick| {
        task.drive.frame = Some(frame(tick));
        *task.tick().unwrap().frame
    });
    let last = answered.last().unwrap();
    assert_eq!(last.supervisor_state(), Some(SupervisorState::Tracking));
    assert_ne!(last.torques, [TorqueCounts(0); 2]);
    task.drive.calls();
    task
}

fn assert_off(frame: &ActuatorFrame, fault: Fault) {
    assert_eq!(frame.latched_fault(), Some(fault));
    assert_eq!(frame.torques, [TorqueCounts(0); 2]);
}

#[test]
fn a_tick_begins_samples_and_actuates_in_this_order() {
    let mut task = tracking(FrameSource::Realtime);
    task.drive.frame = Some(frame(20));
    let answered = task.tick().unwrap();
    assert_eq!(answered.elapsed, 14, "answer and update");
    let actuated = Call::Actuate(*answered.frame);
    assert_eq!(
        task.drive.calls(),
        [Call::BeginTick, Call::Sample, actuated]
    );
    assert_eq!((task.counts().ticks, task.counts().worst_elapsed), (21, 14));
}

#[test]
fn a_stop_instead_of_a_tick_takes_the_torque_off_and_samples_nothing() {
    let mut task = tracking(FrameSource::Realtime);
    task.stop_instead_of_tick();
    let off = Call::Actuate(ActuatorFrame::default());
    assert_eq!(task.drive.calls(), [Call::BeginTick, off]);
    assert_eq!(task.lapses().map(|_| ()), None);
}

#[test]
fn missing_frames_stop_a_drive_with_its_own_clock() {
    for source in [FrameSource::Realtime, FrameSource::Sensors] {
        missing_frames_stop(source);
    }
    let mut task = tracking(FrameSource::Lockstep);
    assert!((0..100).all(|_| task.tick().is_none()));
    assert_eq!(task.lapses().unwrap().totals().of(Lapse::MissingFrame), 0);
}

fn missing_frames_stop(source: FrameSource) {
    let mut task = tracking(source);
    let limit = 10;
    for _ in 0..limit {
        assert_eq!(task.tick(), None);
    }
    task.drive.calls();
    let stopped = task.tick().unwrap();
    assert_off(stopped.frame, Fault::MissingFrame);
    assert_eq!((stopped.sensor, stopped.elapsed), (None, 0));
    let actuated = Call::Actuate(*stopped.frame);
    assert_eq!(
        task.drive.calls(),
        [Call::BeginTick, Call::Sample, actuated]
    );
    assert_eq!(task.tick(), None, "reported once");
}

#[test]
fn an_overrun_beyond_the_limit_replaces_the_answer_already_output() {
    let mut task = tracking(FrameSource::Realtime);
    task.drive.is_due = true;
    task.drive.frame = Some(frame(20));
    assert_eq!(task.tick().unwrap().frame.latched_fault(), None);
    task.drive.calls();
    task.drive.frame = Some(frame(21));
    let stopped = *task.tick().unwrap().frame;
    assert_off(&stopped, Fault::Overrun);
    let calls = task.drive.calls();
    assert!(matches!(calls[2], Call::Actuate(answer) if answer.latched_fault().is_none()));
    assert_eq!(calls[3], Call::Actuate(stopped));
    assert_eq!(calls.len(), 4);
}

/// A board's timer interrupts an update that is late, and the next tick finishes it.
#[test]
fn the_answer_of_a_late_tick_is_reported_with_the_next_one() {
    let mut task = tracking(FrameSource::Lockstep);
    let overruns = |task: &ControlTask<Mock>| {
        let counts = task.lapses().unwrap();
        counts.totals().of(Lapse::Overrun)
    };
    task.drive.frame = Some(frame(20));
    task.answer();
    task.drive.is_due = true;
    task.drive.frame = None;
    task.answer();
    assert_eq!(overruns(&task), 1);
    task.drive.is_due = false;
    let late = task.update().unwrap();
    assert_eq!((late.sensor, late.frame.tick), (None, 20));
    assert_eq!(task.update(), None, "it is reported once");
    // Both parts of both ticks, in order: the same state as without the overrun.
    let mut in_time = tracking(FrameSource::Lockstep);
    in_time.drive.frame = Some(frame(20));
    in_time.tick();
    for task in [&mut task, &mut in_time] {
        task.drive.frame = Some(frame(21));
    }
    assert_eq!(task.tick().unwrap().frame, in_time.tick().unwrap().frame);
}

#[test]
fn a_broken_message_beyond_the_limit_stops_the_drive_between_ticks() {
    let mut task = tracking(FrameSource::Lockstep);
    for _ in 0..=10 {
        task.note(Lapse::FailedChecksum, 1);
    }
    let [Call::Actuate(stopped)] = task.drive.calls()[..] else {
        panic!("the torque goes off once");
    };
    assert_off(&stopped, Fault::CorruptMessages);
}

#[test]
fn a_new_configuration_takes_the_torque_off_and_starts_afresh() {
    let mut task = tracking(FrameSource::Realtime);
    let configuration = Configuration::default();
    task.configure(&configuration, FrameSource::Lockstep)
        .unwrap();
    assert_eq!(
        task.drive.calls(),
        [Call::Actuate(ActuatorFrame::default())]
    );
    assert_eq!(task.counts(), TaskCounts::default());
    let bad = Configuration {
        tick_hz: 0.0,
        ..configuration
    };
    assert!(task.configure(&bad, FrameSource::Lockstep).is_err());
    task.drive.frame = Some(frame(0));
    assert_eq!(task.tick(), None, "nothing without a configuration");
    assert_eq!(task.lapses().map(|_| ()), None);
}
