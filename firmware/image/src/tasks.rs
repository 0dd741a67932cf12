//! The image's tasks, in order of priority, highest first:
//!
//! - `control`, the timer's interrupt at the control rate: sample → answer → actuate; and the sensors'
//!   buses, whose interrupts read the sensors for the next tick. They do not interrupt each other.
//! - `update`, after each control interrupt: prepares the next one, and reports the answer
//! - `serial`, the serial port's interrupt: bytes from and to the host. It has the priority of `update`.
//! - `link`: requests from the host, responses to it
//! - `idle`: the log
//!
//! Neither of the first two waits. `update` masks `control` while it works on what both share, and has the rest of
//! the period: a tick that begins before it has ended is an overrun, and finishes it first. Answers are therefore
//! the same whenever the tasks run. `update` puts answers for `link` and events for `idle` in bounded queues and
//! discards those that do not fit.

use core::panic::PanicInfo;

use heapless::spsc::{Consumer, Producer};
use painleve_firmware::drive::{Answered, ControlTask, TaskCounts};
use painleve_firmware::law::Law;
use painleve_shared::black_box::{Crash, FaultRecord};
use painleve_shared::message::{FrameSource, Response};
use rtic::Mutex;

use crate::black_box;
use crate::board::{Board, BoardDrive, Parts};
use crate::stack;
pub use crate::watch::Change;

/// Length of the queue of answers for the link, one more than may wait.
pub const ANSWERS: usize = 4;

/// Length of the queue of events for the log, one more than may wait.
pub const EVENTS: usize = 8;

/// How long a host that watches an arm may be silent, ms. It sends [`Alive`](painleve_shared::message::Request::Alive) more often.
pub const SENSORS_SILENCE_MS: u32 = 200;

/// How long a host whose frames are awaited may be silent, ms. No torque depends on it.
pub const FRAMES_SILENCE_MS: u32 = 5000;

/// State that the tasks share.
#[repr(C)]
pub struct Control<D, L: Law> {
    /// The control task.
    pub task: ControlTask<D, L>,
    /// Answers discarded because the queue to the link was full.
    pub dropped_responses: u32,
    /// Control rate, Hz; 0 until there is a configuration.
    pub tick_hz: u32,
    /// Ticks since the host's last message, and their limit.
    pub silent_ticks: u32,
    silence_limit_ticks: u32,
    /// Number of the fault latched at the last tick; 0 for none.
    fault: u8,
    /// A newly latched fault, for the black box.
    pub(crate) fault_to_record: Option<FaultRecord>,
}

impl<D: BoardDrive, L: Law> Control<D, L> {
    /// Nothing is configured yet.
    pub const fn new(drive: D) -> Self {
        Self {
            task: ControlTask::new(drive),
            dropped_responses: 0,
            tick_hz: 0,
            silent_ticks: 0,
            silence_limit_ticks: u32::MAX,
            fault: 0,
            fault_to_record: None,
        }
    }

    /// Sets the limit of the host's silence for frames from `source` at the control rate `tick_hz`.
    pub fn expect_host(&mut self, source: FrameSource, tick_hz: u32) {
        let limit_ms = match source {
            FrameSource::Sensors | FrameSource::DryRun | FrameSource::Commissioning => {
                SENSORS_SILENCE_MS
            }
            FrameSource::Lockstep | FrameSource::Realtime => FRAMES_SILENCE_MS,
            FrameSource::StandAlone => return self.expect_no_host(tick_hz),
        };
        self.tick_hz = tick_hz;
        // 32 bits hold 5 s at 100 kHz.
        self.silence_limit_ticks = limit_ms.saturating_mul(tick_hz) / 1000;
    }

    /// Lets the host be silent without limit.
    pub fn expect_no_host(&mut self, tick_hz: u32) {
        self.tick_hz = tick_hz;
        self.silence_limit_ticks = u32::MAX;
    }

    /// Returns whether the host has been silent for too long, whatever the frames' source.
    fn note_silence(&mut self) -> bool {
        self.silent_ticks = self.silent_ticks.saturating_add(1);
        self.silent_ticks > self.silence_limit_ticks
    }
}

/// Starts the board; if that fails, logs the fault and stops.
pub fn start<B: Board>(device: B::Device, core: cortex_m::Peripherals) -> Parts<B> {
    stack::paint();
    black_box::note_start(B::reset_cause());
    match B::start(device, core) {
        Ok(parts) => parts,
        Err(fault) => {
            defmt::error!("{=str} does not start: {}", B::NAME, fault);
            B::halt()
        }
    }
}

/// Samples, answers and actuates.
#[inline]
pub fn control<D: BoardDrive, L: Law>(control: &mut Control<D, L>) {
    if control.note_silence() {
        control.task.stop_instead_of_tick();
        control.expect_no_host(0);
        return;
    }
    control.task.answer();
}

/// Finishes a control tick, and puts its answer, if there is one, in the link's queue.
#[inline]
pub fn update<D: BoardDrive, L: Law>(
    control: &mut Control<D, L>,
    answers: &mut Producer<'static, Response>,
    events: &mut Producer<'static, Change>,
    reported: &mut Change,
) {
    let Control {
        task,
        dropped_responses,
        fault,
        fault_to_record,
        ..
    } = control;
    let is_on_board = task.source().is_on_board();
    let Some(Answered {
        sensor,
        frame,
        elapsed,
    }) = task.update()
    else {
        return;
    };
    // Each kind is built in its place in the queue.
    let sent = match sensor {
        Some(sensor) if is_on_board => answers.enqueue(Response::Tick {
            sensor: *sensor,
            answer: *frame,
            elapsed,
        }),
        _ => answers.enqueue(Response::Actuator {
            frame: *frame,
            elapsed,
        }),
    };
    if sent.is_err() {
        *dropped_responses = dropped_responses.wrapping_add(1);
    }
    // A fault that latches at a tick without a frame is recorded with the next one.
    if frame.fault != *fault && (sensor.is_some() || frame.fault == 0) {
        *fault = frame.fault;
        if let (Some(sensor), Some(_)) = (sensor, frame.latched_fault()) {
            *fault_to_record = Some(FaultRecord {
                sensor: *sensor,
                answer: *frame,
            });
        }
    }
    // An event for which the queue has no room is not logged.
    if !reported.is_of(frame) {
        let change = Change::of(frame);
        if events.enqueue(change).is_ok() {
            *reported = change;
        }
    }
}

/// Logs events and, once a second, the statistics.
pub fn idle<B: Board, L: Law>(
    mut control: impl Mutex<T = Control<B::Drive, L>>,
    events: &mut Consumer<'static, Change>,
) -> ! {
    defmt::info!(
        "painleve {=str} on {=str}",
        env!("CARGO_PKG_VERSION"),
        B::NAME
    );
    let mut second = 0;
    loop {
        while let Some(change) = events.dequeue() {
            match change.fault {
                None => defmt::info!("{}", change.state),
                Some(fault) => defmt::error!("{}", fault),
            }
        }
        let (counts, tick_hz) = control.lock(|control| (control.task.counts(), control.tick_hz));
        let TaskCounts {
            ticks,
            worst_elapsed,
        } = counts;
        if let Some(now) = ticks.checked_div(tick_hz)
            && now != second
        {
            second = now;
            defmt::info!(
                "{=u32} ticks, the longest took {=u32}",
                ticks,
                worst_elapsed
            );
        }
        B::idle();
    }
}

/// Handles a panic, that is, a defect in the program: torque off until a reset.
pub fn panicked<B: Board>(info: &PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    B::take_torque_off();
    // Log the location only: formatting the message would link 20 KiB of text formatting.
    if let Some(place) = info.location() {
        black_box::note_crash(Crash::Panic {
            line: place.line(),
            file: black_box::end_of(place.file()),
        });
        defmt::error!("panic at {=str}:{=u32}", place.file(), place.line());
    }
    B::halt()
}

/// Declares the tasks of an image for one board and one set of laws. Board crates invoke it with
/// their chip's `device` and four interrupts: the `control` timer's, the `serial` port's, and two
/// that no peripheral in use raises, which run `update` and `link`; `sensors` adds those of the sensors' buses.
#[macro_export]
macro_rules! tasks {
    (
        board = $board:ty, laws = $laws:ty, device = $($device:ident)::+,
        control = $control:ident, update = $update:ident, serial = $serial:ident, link = $link:ident,
        sensors = [$($task:ident($number:literal): $bus:ident),+]
    ) => {
        #[::rtic::app(device = $($device)::+, peripherals = true)]
        mod tasks {
            use $crate::board::{Board, BoardDrive, Parts};
            use $crate::dma_serial::DmaBytes;
            use $crate::heapless::spsc::{Consumer, Producer, Queue};
            use $crate::painleve_shared::message::Response;
            use $crate::link::Link;
            use $crate::memory::FlashMemory;
            use $crate::tasks::{ANSWERS, Change, Control, EVENTS};

            use super::*;

            type Hardware = $board;
            type Laws = $laws;

            const UPDATE: $($device)::+::Interrupt = $($device)::+::Interrupt::$update;
            const LINK: $($device)::+::Interrupt = $($device)::+::Interrupt::$link;

            #[shared]
            struct Shared {
                control: Control<<Hardware as Board>::Drive, Laws>,
            }

            #[local]
            struct Local {
                bytes: DmaBytes<<Hardware as Board>::Serial>,
                port: <Hardware as Board>::Port,
                memory: FlashMemory<<Hardware as Board>::Flash>,
                answers_in: Producer<'static, Response>,
                answers_out: Consumer<'static, Response>,
                events_in: Producer<'static, Change>,
                events_out: Consumer<'static, Change>,
                reported: Change,
            }

            #[init(local = [
                answers: Queue<Response, ANSWERS> = Queue::new(),
                events: Queue<Change, EVENTS> = Queue::new(),
            ])]
            fn init(cx: init::Context) -> (Shared, Local) {
                let Parts { drive, bytes, port, memory } =
                    $crate::tasks::start::<Hardware>(cx.device, cx.core);
                let (answers_in, answers_out) = cx.local.answers.split();
                let (events_in, events_out) = cx.local.events.split();
                let control = Control::new(drive);
                let local = Local {
                    bytes,
                    port,
                    memory,
                    answers_in,
                    answers_out,
                    events_in,
                    events_out,
                    reported: Change::NONE,
                };
                (Shared { control }, local)
            }

            #[task(binds = $control, priority = 3, shared = [control])]
            fn control(mut cx: control::Context) {
                cx.shared.control.lock($crate::tasks::control);
                rtic::pend(UPDATE);
            }

            #[task(binds = $update, priority = 2, shared = [control],
                   local = [answers_in, events_in, reported])]
            fn update(mut cx: update::Context) {
                let local = cx.local;
                cx.shared.control.lock(|control| {
                    let (answers, events) = (local.answers_in, local.events_in);
                    $crate::tasks::update(control, answers, events, local.reported);
                });
                // Bytes may have arrived without the idle line that would have woken `link`.
                rtic::pend(LINK);
            }

            $(
                #[task(binds = $bus, priority = 3, shared = [control])]
                fn $task(mut cx: $task::Context) {
                    cx.shared
                        .control
                        .lock(|control| control.task.drive_mut().serve_sensor_bus($number));
                }
            )+

            #[task(binds = $serial, priority = 2, local = [bytes])]
            fn serial(cx: serial::Context) {
                cx.local.bytes.serve();
                rtic::pend(LINK);
            }

            #[task(binds = $link, priority = 1, shared = [control],
                   local = [port, memory, answers_out, state: Link<Laws> = Link::new()])]
            fn link(cx: link::Context) {
                // A tick may have raised it between `init` and `idle`.
                if !$crate::stack::is_free() {
                    return;
                }
                let local = cx.local;
                let (port, memory) = (local.port, local.memory);
                $crate::link::link(cx.shared.control, port, memory, local.answers_out, local.state);
            }

            #[idle(shared = [control], local = [events_out])]
            fn idle(cx: idle::Context) -> ! {
                let idle = move || {
                    rtic::pend(LINK);
                    $crate::tasks::idle::<Hardware, Laws>(cx.shared.control, cx.local.events_out)
                };
                // SAFETY: RTIC's resources are static, and its start leaves nothing on the stack that is used again.
                unsafe { $crate::stack::empty_for(idle) }
            }
        }

        #[panic_handler]
        fn panic(info: &::core::panic::PanicInfo<'_>) -> ! {
            $crate::tasks::panicked::<$board>(info)
        }
    };
}
