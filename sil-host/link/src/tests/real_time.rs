//! Controllers in real time, faster than the time by which they wake up early.

use std::sync::mpsc::channel;
use std::time::Instant;

use nix::time::{ClockId, clock_gettime};
use painleve_firmware::drive::Drive;
use painleve_plant::controller_host::{Answer, ControllerHost};
use painleve_process::realtime::Pacer;

use super::*;
use crate::paced::Paced;

const FAST_HZ: u32 = 10_000;

/// The drive of a fast controller that has joined a plant.
fn fast(end: ControllerEnd, session: Session) -> BusDrive {
    let session = Session {
        tick_hz: FAST_HZ,
        pacing: Pacing::Realtime,
        ..session
    };
    BusDrive::new(end, &session)
}

#[test]
fn a_fast_controller_notices_that_its_plant_is_gone_or_silent() {
    for (silence_limit, is_dropped) in [(PATIENT, true), (5 * SHORT, false)] {
        let bus = TestBus::new();
        let mut plant = bus.plant().unwrap();
        let (sender, received) = channel();
        let controller = bus.spawn_with(silence_limit, move |end, session| {
            let mut drive = fast(end, session);
            let mut last = Instant::now();
            loop {
                if drive.sample().is_some() {
                    sender.send(()).unwrap();
                    last = Instant::now();
                }
                if let Some(outcome) = drive.take_outcome() {
                    return outcome;
                }
                assert!(last.elapsed() < Duration::from_secs(2), "nothing noticed");
            }
        });
        plant.wait_for_controller(PATIENT).unwrap();
        plant.send(&sensor(0)).unwrap();
        received.recv().unwrap();
        let silent = (!is_dropped).then_some(plant);
        let outcome = controller.join().unwrap();
        match silent {
            Some(_) => assert!(matches!(outcome, Err(LinkError::PlantSilent { .. }))),
            None => assert!(matches!(outcome, Err(LinkError::PlantGone { .. }))),
        }
    }
}

#[test]
fn a_tick_without_an_answer_takes_its_time_and_has_no_round_trip() {
    let bus = TestBus::new();
    let tick_hz = 50;
    let start = Instant::now();
    let mut paced = Paced::start(bus.plant().unwrap(), tick_hz).unwrap();
    let answers = [paced.exchange(&sensor(0)), paced.skip()].map(Result::unwrap);
    assert!(start.elapsed() >= 2 * Duration::from_secs(1) / tick_hz);
    for Answer { frame, round_trip } in answers {
        assert_eq!((frame, round_trip), (None, None));
    }
}

/// Under SCHED_FIFO, a thread that always runs is stopped for a part of every second.
#[test]
fn a_fast_controller_does_not_keep_its_processor_busy() {
    let bus = TestBus::new();
    let mut plant = bus.plant().unwrap();
    let controller = bus.spawn(|end, session| {
        let mut drive = fast(end, session);
        drive.sample();
        let start = Instant::now();
        let used = || Duration::from(clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID).unwrap());
        let before = used();
        while drive.take_outcome().is_none() {
            drive.sample();
        }
        (used() - before).as_secs_f64() / start.elapsed().as_secs_f64()
    });
    plant.wait_for_controller(PATIENT).unwrap();
    let mut pacer = Pacer::start(Duration::from_secs(1) / FAST_HZ).unwrap();
    for tick in 0..FAST_HZ {
        plant.send(&sensor(tick)).unwrap();
        pacer.wait().unwrap();
    }
    plant.end().unwrap();
    let share = controller.join().unwrap();
    assert!(share < 0.9, "{share}");
}
