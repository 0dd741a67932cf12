//! Proof that the plant's step, the converters and the controller's tick never
//! touch the heap: a counting allocator watches a bouncing run and a controlled one.

// A global allocator is `unsafe` by nature; this one only counts.
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use painleve_firmware::Controller;
use painleve_sil_host::closed_loop::ClosedLoop;
use painleve_sil_host::controller_host::InProcess;
use painleve_sil_host::scenario::{Scenario, built_in};
use painleve_sil_host::simulation::Simulation;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call is handed to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // A thread that is ending has no count any more.
        let _ = ALLOCATIONS.try_with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's contract is the system's.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's contract is the system's.
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
    assert_eq!(allocations_of(|| Box::new(1)), 1);
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
