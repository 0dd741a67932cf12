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
    use painleve_firmware::supervise::lapses::Lapse;
    use painleve_firmware::{Configuration, Controller};
    use painleve_shared::frame::{ActuatorFrame, SensorFrame};
    use painleve_shared::message::{
        Health, MAXIMUM_LENGTH, MAXIMUM_RESPONSE_LENGTH, Plant, Request, Response,
    };
    use painleve_shared::wire::{self, Inbox, WireError};
    use stm32f4xx_hal::pac::Interrupt;

    use crate::Hardware;
    use crate::board::{Board, Bytes, Drive, Parts, Port};
    use crate::configure;
    use crate::stack;
    use crate::watch::{Change, Watch};

    /// An interrupt that no peripheral in use raises: it runs `link`.
    const LINK: Interrupt = Interrupt::SPI3;

    /// Answers that may wait for the link.
    const ANSWERS: usize = 4;

    /// Changes that may wait for the log.
    const EVENTS: usize = 8;

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
                watch: Watch::new(Plant::Lockstep, 0),
            },
            Local {
                bytes,
                port,
                inbox: Inbox::new(),
                answers_in,
                answers_out,
                events_in,
                events_out,
                reported: Change::NONE,
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
            drive.end_tick();
            if !<Hardware as Board>::Port::HALF_DUPLEX {
                // Bytes may have come without a pause that would have woken `link`.
                rtic::pend(LINK);
            }
            let Some(controller) = controller else {
                drive.actuate(&ActuatorFrame::default());
                return;
            };
            let frame = drive.sample(from_host.take());
            let missing = frame.is_none() && watch.plant == Plant::Realtime;
            let stopped = controller.note(Lapse::MissingFrame, u32::from(missing));
            let (frame, elapsed) = match (frame, stopped) {
                (None, None) => return,
                (None, Some(stopped)) => {
                    drive.actuate(&stopped);
                    (stopped, 0)
                }
                (Some(frame), _) => {
                    let start = drive.stopwatch();
                    let mut answer = controller.tick(&frame);
                    let elapsed = drive.stopwatch().wrapping_sub(start);
                    drive.actuate(&answer);
                    watch.tick(elapsed);
                    let overrun = u32::from(drive.next_tick_is_due());
                    if let Some(stopped) = controller.note(Lapse::Overrun, overrun) {
                        drive.actuate(&stopped);
                        answer = stopped;
                    }
                    (answer, elapsed)
                }
            };
            let change = Change::of(&frame);
            let response = Response::Actuator { frame, elapsed };
            if cx.local.answers_in.enqueue(response).is_err() {
                watch.dropped_responses = watch.dropped_responses.wrapping_add(1);
            }
            rtic::pend(LINK);
            // What the queue has no room for is not said.
            if change != *cx.local.reported && cx.local.events_in.enqueue(change).is_ok() {
                *cx.local.reported = change;
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
           local = [port, inbox, answers_out, decoded: Option<Configuration> = None,
                    received: [u8; MAXIMUM_LENGTH] = [0; MAXIMUM_LENGTH]])]
    fn link(cx: link::Context) {
        let link::LocalResources {
            port,
            inbox,
            answers_out,
            decoded,
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
                let request = wire::decode(message);
                let stopped = controller.lock(|it| note_message(it.as_mut(), &request));
                if let Some(stopped) = stopped {
                    drive.lock(|drive| drive.actuate(&stopped));
                }
                let response = match request {
                    Ok(Request::Sensor(frame)) => {
                        from_host.lock(|newest| *newest = Some(frame));
                        awaits_control = true;
                        continue;
                    }
                    Ok(Request::Configure {
                        plant,
                        configuration,
                    }) => {
                        // Without a controller `control` does nothing: the torque goes off before.
                        drive.lock(|drive| drive.actuate(&ActuatorFrame::default()));
                        controller.lock(|controller| *controller = None);
                        from_host.lock(|newest| *newest = None);
                        configure::decode(decoded, configuration);
                        match decoded {
                            Some(configuration) => {
                                let tick_hz = configuration.tick_hz as u32;
                                watch.lock(|watch| *watch = Watch::new(plant, tick_hz));
                                let stopwatch_hz =
                                    (&mut controller, &mut drive).lock(|controller, drive| {
                                        configure::make(controller, configuration);
                                        controller.as_ref()?;
                                        drive.start(configuration, plant);
                                        Some(drive.stopwatch_hz())
                                    });
                                stopwatch_hz.map_or(Response::Refused, |stopwatch_hz| {
                                    Response::Ready { stopwatch_hz }
                                })
                            }
                            None => Response::Refused,
                        }
                    }
                    Ok(Request::Health) => Response::Health(Health {
                        stack_bytes: stack::high_water_bytes(),
                        ..(&mut controller, &mut watch)
                            .lock(|controller, watch| watch.health(controller.as_ref()))
                    }),
                    Err(_) => continue,
                };
                send(port, &response);
            }
            if awaits_control && <Hardware as Board>::Port::HALF_DUPLEX {
                // `control` calls again when it has an answer.
                return;
            }
        }
    }

    /// Counts broken messages, good ones start over; the answer without torque if there are
    /// too many of these.
    fn note_message<M>(
        controller: Option<&mut Controller>,
        request: &Result<M, WireError>,
    ) -> Option<ActuatorFrame> {
        let controller = controller?;
        let broken = |kinds: &[WireError]| request.as_ref().is_err_and(|it| kinds.contains(it));
        let checksum = broken(&[WireError::Checksum]);
        let garbage = broken(&[WireError::Garbage, WireError::Content]);
        let stopped = controller.note(Lapse::FailedChecksum, u32::from(checksum));
        controller
            .note(Lapse::Garbage, u32::from(garbage))
            .or(stopped)
    }

    /// A response that the host does not take is lost; the host asks again or gives up.
    #[inline(never)]
    fn send(port: &mut <Hardware as Board>::Port, response: &Response) {
        let mut buffer = [0; MAXIMUM_RESPONSE_LENGTH];
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
