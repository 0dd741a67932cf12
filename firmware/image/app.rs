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
    use painleve_firmware::{Configuration, Controller};
    use painleve_shared::frame::SensorFrame;
    use painleve_shared::message::{Health, MAXIMUM_LENGTH, Request, Response};
    use painleve_shared::status::{Fault, SupervisorState};
    use painleve_shared::wire;
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
    pub struct Event {
        tick: u32,
        state: SupervisorState,
        fault: Option<Fault>,
    }

    #[shared]
    struct Shared {
        /// `None` until the host has sent a configuration.
        controller: Option<Controller>,
        drive: <Hardware as Board>::Drive,
        /// Newest sensor frame from the host.
        from_host: Option<SensorFrame>,
        health: Health,
    }

    #[local]
    struct Local {
        bytes: <Hardware as Board>::Bytes,
        port: <Hardware as Board>::Port,
        inbox: Inbox,
        answers_in: Producer<'static, Response>,
        answers_out: Consumer<'static, Response>,
        events_in: Producer<'static, Event>,
        events_out: Consumer<'static, Event>,
        reported: Event,
    }

    #[init(local = [
        answers: Queue<Response, ANSWERS> = Queue::new(),
        events: Queue<Event, EVENTS> = Queue::new(),
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
                health: Health::default(),
            },
            Local {
                bytes,
                port,
                inbox: Inbox::new(),
                answers_in,
                answers_out,
                events_in,
                events_out,
                reported: Event {
                    tick: 0,
                    state: SupervisorState::Idle,
                    fault: None,
                },
            },
        )
    }

    #[task(binds = TIM2, priority = 3,
           shared = [controller, drive, from_host, health],
           local = [answers_in, events_in, reported])]
    fn control(cx: control::Context) {
        let control::SharedResources {
            controller,
            drive,
            from_host,
            health,
            ..
        } = cx.shared;
        (controller, drive, from_host, health).lock(|controller, drive, from_host, health| {
            drive.begin_tick();
            let (Some(controller), Some(frame)) = (controller, drive.sample(from_host.take()))
            else {
                return;
            };
            let start = drive.stopwatch();
            let answer = controller.tick(&frame);
            let elapsed = drive.stopwatch().wrapping_sub(start);
            drive.actuate(&answer);

            health.ticks = health.ticks.wrapping_add(1);
            let overrun = drive.next_tick_is_due();
            health.overruns = health.overruns.wrapping_add(u32::from(overrun));
            let response = Response::Actuator {
                frame: answer,
                elapsed,
            };
            if cx.local.answers_in.enqueue(response).is_err() {
                health.dropped_responses = health.dropped_responses.wrapping_add(1);
            }
            rtic::pend(LINK);
            let telemetry = controller.telemetry();
            let event = Event {
                tick: telemetry.tick,
                state: telemetry.state,
                fault: telemetry.fault,
            };
            let before = cx.local.reported;
            if (event.state, event.fault) != (before.state, before.fault)
                && cx.local.events_in.enqueue(event).is_ok()
            {
                *before = event;
            }
        });
    }

    #[task(binds = USART1, priority = 2, local = [bytes])]
    fn serial(cx: serial::Context) {
        cx.local.bytes.serve();
        rtic::pend(LINK);
    }

    #[task(binds = SPI3, priority = 1,
           shared = [controller, drive, from_host, health],
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
            mut health,
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
                let response = match decode(message) {
                    Some(Request::Sensor(frame)) => {
                        from_host.lock(|newest| *newest = Some(frame));
                        awaits_control = true;
                        continue;
                    }
                    Some(Request::Configure {
                        configuration,
                        plant,
                    }) => {
                        from_host.lock(|newest| *newest = None);
                        // Holds up `control`, which has nothing to control yet.
                        if controller.lock(|controller| configure(controller, &configuration)) {
                            health.lock(|health| *health = Health::default());
                            drive.lock(|drive| drive.start(&configuration, plant));
                            Response::Ready
                        } else {
                            Response::Refused
                        }
                    }
                    Some(Request::Health) => Response::Health(Health {
                        stack_bytes: stack::high_water_bytes(),
                        ..health.lock(|health| *health)
                    }),
                    None => {
                        health.lock(|health| {
                            health.corrupt_messages = health.corrupt_messages.wrapping_add(1);
                        });
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

    /// Decodes a message. Out of line for the sake of the stack.
    #[inline(never)]
    fn decode(message: &mut [u8]) -> Option<Request<Configuration>> {
        wire::decode(message).ok()
    }

    /// A response that the host does not take is lost; the host asks again or gives up.
    fn send(port: &mut <Hardware as Board>::Port, response: &Response) {
        let mut buffer = [0; 96];
        if let Ok(bytes) = wire::encode(response, &mut buffer) {
            let _ = port.send(bytes);
        }
    }

    #[idle(local = [events_out])]
    fn idle(cx: idle::Context) -> ! {
        defmt::info!(
            "painleve {=str} on {=str}",
            env!("CARGO_PKG_VERSION"),
            Hardware::NAME
        );
        loop {
            while let Some(event) = cx.local.events_out.dequeue() {
                match event.fault {
                    None => defmt::info!("tick {=u32}: {}", event.tick, event.state),
                    Some(fault) => defmt::error!("tick {=u32}: {}", event.tick, fault),
                }
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
