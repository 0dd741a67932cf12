//! Checks with a counting allocator that the plant's step, the converters, the
//! controller's tick and the exchange of frames never allocate.

// A global allocator requires `unsafe`; this one only counts.
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::hint::black_box;
use std::time::Duration;

use painleve_link::{BusName, ControllerEnd, Pacing, PlantEnd, Received, Session};
use painleve_plant::Controller;
use painleve_plant::closed_loop::ClosedLoop;
use painleve_plant::controller_host::InProcess;
use painleve_plant::scenario::{Scenario, built_in};
use painleve_plant::simulation::Simulation;
use painleve_process::interrupt::Interrupt;
use painleve_shared::frame::{ActuatorFrame, SensorFrame};

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call is passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // The counter of an ending thread is no longer available.
        let _ = ALLOCATIONS.try_with(|count| count.set(count.get() + 1));
        // SAFETY: the caller upholds the contract of the system's allocator.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller upholds the contract of the system's allocator.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

fn allocations_of<R>(work: impl FnOnce() -> R) -> u64 {
    let before = ALLOCATIONS.get();
    let result = work();
    let after = ALLOCATIONS.get();
    drop(result);
    after - before
}

#[test]
fn the_counter_counts() {
    assert_eq!(allocations_of(|| black_box(Box::new(1))), 1);
}

#[test]
fn neither_plant_nor_controller_allocates() {
    for name in built_in::names() {
        let scenario = Scenario::load(name, &[]).unwrap();
        let mut simulation = Simulation::new(&scenario).unwrap();
        let mut controller = Controller::new(&scenario.controller_configuration()).unwrap();
        for _ in 0..2000 {
            let mut frame = None;
            assert_eq!(
                allocations_of(|| frame = simulation.sample(&mut ()).ok()),
                0
            );
            let frame = frame.unwrap();
            let mut answer = None;
            assert_eq!(
                allocations_of(|| answer = Some(controller.tick(&frame))),
                0,
                "{name}"
            );
            let step = allocations_of(|| simulation.advance(answer.as_ref(), &mut ()));
            assert_eq!(step, 0, "{name}");
        }
    }
}

#[test]
fn a_tick_of_the_closed_loop_does_not_allocate() {
    let scenario = Scenario::load(built_in::DEFAULT, &[]).unwrap();
    let simulation = Simulation::new(&scenario).unwrap();
    let host = InProcess::new(&scenario.controller_configuration()).unwrap();
    let mut closed_loop = ClosedLoop::new(simulation, host);
    let ticks = allocations_of(|| {
        (0..2000)
            .try_for_each(|_| closed_loop.tick(&mut ()))
            .is_ok()
    });
    assert_eq!(ticks, 0);
}

const WARM_UP: u32 = 10;
const EXCHANGES: u32 = 10_000;
const PATIENT: Duration = Duration::from_secs(20);

#[test]
fn frames_cross_the_link_without_allocation_on_either_end() {
    let bus = BusName::unique();
    let session = Session {
        tick_hz: 1000,
        pacing: Pacing::Lockstep,
        configuration: vec![7; 100],
    };
    let mut plant = PlantEnd::create(&bus, None, &session, &Interrupt::default()).unwrap();
    plant.set_silence_limit(PATIENT);

    let controller = std::thread::spawn(move || {
        let (mut controller, _) =
            ControllerEnd::open(&bus, None, PATIENT, PATIENT, &Interrupt::default()).unwrap();
        let mut before = 0;
        let mut after = 0;
        while let Received::Frame(frame) = controller.receive().unwrap() {
            if frame.tick == WARM_UP {
                before = ALLOCATIONS.get();
            }
            let answer = ActuatorFrame {
                tick: frame.tick,
                ..ActuatorFrame::default()
            };
            controller.send(&answer).unwrap();
            after = ALLOCATIONS.get();
        }
        after - before
    });

    plant.wait_for_controller(PATIENT).unwrap();
    let mut before = 0;
    for tick in 0..WARM_UP + EXCHANGES {
        if tick == WARM_UP {
            before = ALLOCATIONS.get();
        }
        let frame = SensorFrame {
            tick,
            ..SensorFrame::default()
        };
        plant.exchange(&frame).unwrap();
        // Polls without an answer waiting, as in real time.
        plant.try_receive().unwrap();
    }
    let plant_allocations = ALLOCATIONS.get() - before;
    plant.end().unwrap();
    assert_eq!(plant_allocations, 0);
    assert_eq!(controller.join().unwrap(), 0);
}
