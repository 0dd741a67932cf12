//! Proof that the link itself never touches the heap for a frame, on either end.
//!
//! iceoryx2 0.10 does: every loan of a publisher is one block of fixed size for
//! the bookkeeping of the loan, given back before the frame has left. That is
//! counted here, and nothing beyond it allowed.

// A global allocator is `unsafe` by nature; this one only counts.
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::time::Duration;

use painleve_shared::frame::{ActuatorFrame, SensorFrame};
use painleve_sil_host::link::{BusName, ControllerEnd, Pacing, PlantEnd, Received, Session};

/// The largest block iceoryx2 may take for a loan, in bytes.
const LOAN_SIZE: usize = 64;

/// What a thread has taken from the heap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Heap {
    /// Blocks no larger than a loan.
    small: u64,
    /// Other blocks.
    large: u64,
    /// Blocks not given back.
    live: i64,
}

thread_local! {
    static HEAP: Cell<Heap> = const { Cell::new(Heap { small: 0, large: 0, live: 0 }) };
}

fn heap() -> Heap {
    HEAP.get()
}

fn update(change: impl FnOnce(&mut Heap)) {
    // A thread that is ending has no count any more.
    let _ = HEAP.try_with(|heap| {
        let mut counts = heap.get();
        change(&mut counts);
        heap.set(counts);
    });
}

fn count(size: usize) {
    update(|heap| {
        heap.live += 1;
        if size <= LOAN_SIZE {
            heap.small += 1;
        } else {
            heap.large += 1;
        }
    });
}

struct Counting;

// SAFETY: every call is handed to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        // SAFETY: the caller's contract is the system's.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        update(|heap| heap.live -= 1);
        // SAFETY: the caller's contract is the system's.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        update(|heap| heap.live -= 1);
        count(new_size);
        // SAFETY: the caller's contract is the system's.
        unsafe { System.realloc(pointer, layout, new_size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const WARM_UP: u32 = 10;
const TICKS: u32 = 10_000;
const PATIENT: Duration = Duration::from_secs(20);

/// Nothing but one loan for each of `frames`, and that given back.
#[track_caller]
fn assert_only_loans(before: Heap, after: Heap, frames: u32) {
    assert_eq!(after.large, before.large, "blocks larger than a loan");
    assert_eq!(after.live, before.live, "blocks not given back");
    assert!(after.small - before.small <= u64::from(frames));
}

#[test]
fn frames_cross_with_nothing_allocated_but_the_loan() {
    let bus = BusName::unique();
    let session = Session {
        tick_hz: 1000,
        pacing: Pacing::Lockstep,
        configuration: vec![7; 100],
    };
    let mut plant = PlantEnd::create(&bus, &session).unwrap();
    plant.set_silence_limit(PATIENT);

    let controller = std::thread::spawn(move || {
        let (mut controller, _) = ControllerEnd::open(&bus, PATIENT).unwrap();
        controller.set_silence_limit(PATIENT);
        let mut before = heap();
        let mut after = before;
        while let Received::Frame(frame) = controller.receive().unwrap() {
            if frame.tick == WARM_UP {
                before = heap();
            }
            controller
                .send(&ActuatorFrame {
                    tick: frame.tick,
                    ..ActuatorFrame::default()
                })
                .unwrap();
            after = heap();
        }
        (before, after)
    });

    plant.wait_for_controller(PATIENT).unwrap();
    let mut before = heap();
    for tick in 0..WARM_UP + TICKS {
        if tick == WARM_UP {
            before = heap();
        }
        let frame = SensorFrame {
            tick,
            ..SensorFrame::default()
        };
        plant.exchange(&frame).unwrap();
        // As in real time: without an answer waiting.
        plant.try_receive().unwrap();
    }
    let after = heap();
    plant.end().unwrap();
    assert_only_loans(before, after, TICKS);
    let (before, after) = controller.join().unwrap();
    assert_only_loans(before, after, TICKS);
}
