//! The image's tasks, from the highest priority down:
//!
//! - `control`, the timer's interrupt at the control rate: sample → tick → actuate
//! - `serial`, the serial port's interrupt: bytes from and to the host
//! - `link`: requests from the host, responses to it
//! - `idle`: the log
//!
//! `control` never waits: for `link` it leaves its answers in a bounded queue,
//! for `idle` its events, and drops what does not fit.

use core::panic::PanicInfo;

use rtic::app;

use crate::Hardware;
use crate::board::Board;

#[app(device = stm32f4xx_hal::pac, peripherals = true)]
mod tasks {
    use heapless::spsc::{Consumer, Producer, Queue};
    use painleve_firmware::deadline_monitor::{DeadlineMonitor, Lapse};
    use painleve_firmware::{Configuration, Controller};
    use painleve_shared::frame::SensorFrame;
    use painleve_shared::message::{Health, MAXIMUM_LENGTH, Plant, Request, Response};
    use painleve_shared::status::{Fault, SupervisorState};
    use painleve_shared::wire;
    use rtic::Mutex;
    use stm32f4xx_hal::pac::Interrupt;

    use crate::Hardware;
    use crate::board::{Board, Bytes, Drive, Parts, Port};
    use crate::inbox::Inbox;
    use crate::stack;

    /// An interrupt that no peripheral in use raises: it runs `link`.
    const LINK: Interrupt = Interrupt::SPI3;

    /// Answers that may wait for the link.
    const ANSWERS: usize = 4;

    /// Changes that may wait for the log.
    const EVENTS: usize = 8;

    /// What the log hears of the control task.
    #[derive(Clone, Copy, PartialEq)]
    pub struct Change {
        state: SupervisorState,
        fault: Option<Fault>,
    }

    /// What is counted since the configuration.
    pub struct Watch {
        plant: Plant,
        monitor: DeadlineMonitor,
        /// What the link has against going on.
        broken_link: Option<Fault>,
        ticks: u32,
        /// Ticks a second.
        tick_hz: u32,
        worst_elapsed: u32,
        dropped_responses: u32,
    }

    impl Watch {
        const fn new(plant: Plant, monitor: DeadlineMonitor, tick_hz: u32) -> Self {
            Self {
                plant,
                monitor,
                broken_link: None,
                ticks: 0,
                tick_hz,
                worst_elapsed: 0,
                dropped_responses: 0,
            }
        }

        /// The counters; the stack is not looked at in here, it takes too long.
        fn health(&self) -> Health {
            Health {
                stack_bytes: 0,
                ticks: self.ticks,
                corrupt_messages: self.monitor.total(Lapse::CorruptMessage),
                dropped_responses: self.dropped_responses,
                missing_frames: self.monitor.total(Lapse::MissingFrame),
                overruns: self.monitor.total(Lapse::Overrun),
            }
        }
    }

    #[shared]
    struct Shared {
        /// `None` until the host has sent a configuration.
        controller: Option<Controller>,
        drive: <Hardware as Board>::Drive,
        /// Newest sensor frame from the host.
        from_host: Option<SensorFrame>,
        watch: Watch,
    }

    #[local]
    struct Local {
        bytes: <Hardware as Board>::Bytes,
        port: <Hardware as Board>::Port,
        inbox: Inbox,
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
        stack::paint();
        let parts = Hardware::start(cx.device, cx.core);
        let Parts { drive, bytes, port } = match parts {
            Ok(parts) => parts,
            Err(fault) => {
                defmt::error!("{=str} does not start: {}", Hardware::NAME, fault);
                Hardware::halt()
            }
        };
        let (answers_in, answers_out) = cx.local.answers.split();
        let (events_in, events_out) = cx.local.events.split();
        rtic::pend(LINK);
        (
            Shared {
                controller: None,
                drive,
                from_host: None,
                watch: Watch::new(Plant::Lockstep, DeadlineMonitor::default(), 0),
            },
            Local {
                bytes,
                port,
                inbox: Inbox::new(),
                answers_in,
                answers_out,
                events_in,
                events_out,
                reported: Change {
                    state: SupervisorState::Idle,
                    fault: None,
                },
            },
        )
    }

    #[task(binds = TIM2, priority = 3,
           shared = [controller, drive, from_host, watch],
           local = [answers_in, events_in, reported])]
    fn control(cx: control::Context) {
        let control::SharedResources {
            controller,
            drive,
            from_host,
            watch,
            ..
        } = cx.shared;
        (controller, drive, from_host, watch).lock(|controller, drive, from_host, watch| {
            drive.begin_tick();
            let Some(controller) = controller else {
                return;
            };
            let frame = drive.sample(from_host.take());
            let missing = frame.is_none() && watch.plant == Plant::Realtime;
            let missing = watch.monitor.note(Lapse::MissingFrame, missing);
            if let Some(fault) = missing.or(watch.broken_link.take()) {
                drive.actuate(&controller.stop(fault));
            }
            let Some(frame) = frame else {
                return;
            };
            let start = drive.stopwatch();
            let answer = controller.tick(&frame);
            let elapsed = drive.stopwatch().wrapping_sub(start);
            drive.actuate(&answer);
            let response = Response::Actuator {
                frame: answer,
                elapsed,
            };
            if cx.local.answers_in.enqueue(response).is_err() {
                watch.dropped_responses = watch.dropped_responses.wrapping_add(1);
            }
            rtic::pend(LINK);

            watch.ticks = watch.ticks.wrapping_add(1);
            watch.worst_elapsed = watch.worst_elapsed.max(elapsed);
            let telemetry = controller.telemetry();
            let change = Change {
                state: telemetry.state,
                fault: telemetry.fault,
            };
            // What the queue has no room for is not said.
            if change != *cx.local.reported && cx.local.events_in.enqueue(change).is_ok() {
                *cx.local.reported = change;
            }
            let overrun = drive.next_tick_is_due();
            if let Some(fault) = watch.monitor.note(Lapse::Overrun, overrun) {
                drive.actuate(&controller.stop(fault));
            }
        });
    }

    #[task(binds = USART1, priority = 2, local = [bytes])]
    fn serial(cx: serial::Context) {
        cx.local.bytes.serve();
        rtic::pend(LINK);
    }

    #[task(binds = SPI3, priority = 1,
           shared = [controller, drive, from_host, watch],
           local = [port, inbox, answers_out, received: [u8; MAXIMUM_LENGTH] = [0; MAXIMUM_LENGTH]])]
    fn link(cx: link::Context) {
        let link::LocalResources {
            port,
            inbox,
            answers_out,
            received,
            ..
        } = cx.local;
        let link::SharedResources {
            mut controller,
            mut drive,
            mut from_host,
            mut watch,
            ..
        } = cx.shared;
        while let Some(answer) = answers_out.dequeue() {
            send(port, &answer);
        }
        loop {
            let length = port.receive(received);
            if length == 0 {
                return;
            }
            let mut awaits_control = false;
            for byte in received.iter().take(length) {
                let Some(message) = inbox.push(*byte) else {
                    continue;
                };
                let response = match wire::decode(message) {
                    Ok(Request::Sensor(frame)) => {
                        note_message(&mut watch, false);
                        from_host.lock(|newest| *newest = Some(frame));
                        awaits_control = true;
                        continue;
                    }
                    Ok(Request::Configure {
                        configuration,
                        plant,
                    }) => {
                        from_host.lock(|newest| *newest = None);
                        // Holds up `control`, which has nothing to control yet.
                        if controller.lock(|controller| configure(controller, &configuration)) {
                            let tick_hz = configuration.tick_hz as u32;
                            let monitor = DeadlineMonitor::default();
                            watch.lock(|watch| *watch = Watch::new(plant, monitor, tick_hz));
                            drive.lock(|drive| drive.start(&configuration, plant));
                            Response::Ready
                        } else {
                            Response::Refused
                        }
                    }
                    Ok(Request::Health) => Response::Health(Health {
                        stack_bytes: stack::high_water_bytes(),
                        ..watch.lock(|watch| watch.health())
                    }),
                    Err(_) => {
                        note_message(&mut watch, true);
                        continue;
                    }
                };
                send(port, &response);
            }
            if awaits_control && <Hardware as Board>::Port::HALF_DUPLEX {
                // `control` calls again when it has an answer.
                return;
            }
        }
    }

    /// Counts good and broken messages; `control` acts on too many of these.
    fn note_message(watch: &mut impl Mutex<T = Watch>, broken: bool) {
        watch.lock(|watch| {
            let fault = watch.monitor.note(Lapse::CorruptMessage, broken);
            watch.broken_link = fault.or(watch.broken_link);
        });
    }

    /// Makes a new controller in place of the old one, which stays if the
    /// configuration is out of range. Out of line for the sake of the stack.
    #[inline(never)]
    fn configure(controller: &mut Option<Controller>, configuration: &Configuration) -> bool {
        match Controller::new(configuration) {
            Ok(new) => {
                *controller = Some(new);
                true
            }
            Err(_) => false,
        }
    }

    /// A response that the host does not take is lost; the host asks again or gives up.
    fn send(port: &mut <Hardware as Board>::Port, response: &Response) {
        let mut buffer = [0; 96];
        if let Ok(bytes) = wire::encode(response, &mut buffer) {
            let _ = port.send(bytes);
        }
    }

    #[idle(shared = [watch], local = [events_out])]
    fn idle(mut cx: idle::Context) -> ! {
        defmt::info!(
            "painleve {=str} on {=str}",
            env!("CARGO_PKG_VERSION"),
            Hardware::NAME
        );
        let mut second = 0;
        loop {
            while let Some(change) = cx.local.events_out.dequeue() {
                match change.fault {
                    None => defmt::info!("{}", change.state),
                    Some(fault) => defmt::error!("{}", fault),
                }
            }
            let (ticks, tick_hz, worst) = cx
                .shared
                .watch
                .lock(|watch| (watch.ticks, watch.tick_hz, watch.worst_elapsed));
            if let Some(now) = ticks.checked_div(tick_hz)
                && now != second
            {
                second = now;
                defmt::info!("{=u32} ticks, the longest took {=u32}", ticks, worst);
            }
            Hardware::idle();
        }
    }
}

/// A defect in the program: torque off, and nothing more until a reset.
#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    Hardware::take_torque_off();
    // The place alone: formatting the message would link 20 KiB of text formatting.
    if let Some(place) = info.location() {
        defmt::error!("panic at {=str}:{=u32}", place.file(), place.line());
    }
    Hardware::halt()
}
