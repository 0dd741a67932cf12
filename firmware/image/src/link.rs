//! The link task: requests from the host, responses to it; and the start with the board's own configuration.

use embedded_storage::nor_flash::NorFlash;
use heapless::spsc::Consumer;
use painleve_drivers::slots::NotWritten;
use painleve_firmware::drive::ControlTask;
use painleve_firmware::law::Law;
use painleve_firmware::supervise::lapses::Lapse;
use painleve_firmware::{Configuration, SOURCES};
use painleve_shared::message::{
    FrameSource, MAXIMUM_RESPONSE_LENGTH, PROTOCOL, Probe, Request, Response,
};
use painleve_shared::stored::{StoredConfiguration, StoredState};
use painleve_shared::wire::{self, Inbox, WireError};
use rtic::Mutex;
use serde::de::DeserializeOwned;

use crate::black_box;
use crate::board::BoardDrive;
use crate::memory::FlashMemory;
use crate::port::Port;
use crate::probe;
use crate::stack;
use crate::tasks::Control;
use crate::watch::health;

/// Bytes that are taken from the port at once.
const RECEIVED_LENGTH: usize = 64;

/// State of the link task between calls.
pub struct Link<L: Law> {
    inbox: Inbox,
    decoded: Option<Configuration<L>>,
    received: [u8; RECEIVED_LENGTH],
    /// Whether a frame has been received whose answer has not been sent.
    awaits_answer: bool,
    /// The stored configuration, as found at the start or stored since; `None` before the first call.
    stored: Option<StoredConfiguration>,
    /// Whether the host has changed a register: until the next reset nothing is driven.
    is_changed: bool,
}

impl<L: Law> Link<L> {
    /// Starts with an empty inbox.
    pub const fn new() -> Self {
        Self {
            inbox: Inbox::new(),
            decoded: None,
            received: [0; RECEIVED_LENGTH],
            awaits_answer: false,
            stored: None,
            is_changed: false,
        }
    }
}

impl<L: Law> Default for Link<L> {
    fn default() -> Self {
        Self::new()
    }
}

/// Sends the waiting answers, then serves requests until no bytes are left.
pub fn link<D, L, P, F>(
    mut control: impl Mutex<T = Control<D, L>>,
    port: &mut P,
    memory: &mut FlashMemory<F>,
    answers: &mut Consumer<'static, Response>,
    state: &mut Link<L>,
) where
    D: BoardDrive,
    L: Law + DeserializeOwned,
    P: Port,
    F: NorFlash,
{
    let Link {
        inbox,
        decoded,
        received,
        awaits_answer,
        stored,
        is_changed,
    } = state;
    let stored = stored.get_or_insert_with(|| start_alone(&mut control, memory, decoded));
    if let Some(fault) = control.lock(|control| control.fault_to_record.take()) {
        black_box::note_fault(fault);
    }
    while let Some(answer) = answers.dequeue() {
        // At a rate that the line cannot carry, ticks are lost rather than the responses to requests.
        send(port, &answer, MAXIMUM_RESPONSE_LENGTH);
        *awaits_answer = false;
    }
    // A later tick has the answer.
    while !(*awaits_answer && port.is_half_duplex()) {
        let length = port.receive(received);
        if length == 0 {
            return;
        }
        for byte in received.iter().take(length) {
            let Some(message) = inbox.push(*byte) else {
                continue;
            };
            let request = wire::decode(message);
            control.lock(|control| {
                note_message(&mut control.task, &request);
                if request.is_ok() {
                    control.silent_ticks = 0;
                }
            });
            let response = match request {
                Ok(Request::Sensor(frame)) => {
                    control.lock(|control| control.task.drive_mut().offer(frame));
                    *awaits_answer = true;
                    continue;
                }
                Ok(Request::Configure { build, .. } | Request::Store { build, .. })
                    if build != Configuration::<L>::BUILD =>
                {
                    control.lock(|control| control.task.stop());
                    Response::OtherBuild {
                        build: Configuration::<L>::BUILD,
                    }
                }
                Ok(Request::Configure { source, .. }) if *is_changed && source.drives() => {
                    control.lock(|control| control.task.stop());
                    Response::Refused
                }
                Ok(Request::Configure {
                    source,
                    configuration,
                    ..
                }) => {
                    stop(&mut control);
                    configure(&mut control, decoded, configuration, source)
                        .unwrap_or_else(|refusal| refusal)
                }
                Ok(Request::Store { configuration, .. }) => {
                    stop(&mut control);
                    let source = FrameSource::StandAlone;
                    let accepted = configure(&mut control, decoded, configuration, source);
                    stop(&mut control);
                    match accepted {
                        Err(refusal) => refusal,
                        Ok(_) => {
                            let written = memory.store(Configuration::<L>::BUILD, configuration);
                            note_written(stored, written)
                        }
                    }
                }
                Ok(Request::Forget) => {
                    stop(&mut control);
                    let written = memory.forget().map(|()| 0);
                    note_written(stored, written)
                }
                Ok(Request::Stored) => Response::Stored(*stored),
                Ok(Request::Health) => {
                    let mut health =
                        control.lock(|control| health(&control.task, control.dropped_responses));
                    // Outside the lock: inspecting the stack takes too long to delay the control
                    // task.
                    health.stack_bytes = stack::high_water_bytes();
                    Response::Health(health)
                }
                Ok(Request::BlackBox) => Response::BlackBox(black_box::read()),
                Ok(Request::Alive) => continue,
                Ok(Request::Torque(torques)) => {
                    control.lock(|control| control.task.request_torques(torques));
                    continue;
                }
                Ok(Request::Identify) => Response::Identity {
                    protocol: PROTOCOL,
                    build: Configuration::<L>::BUILD,
                },
                Ok(Request::Probe(probe)) => {
                    let drives = control.lock(|control| {
                        let task = &control.task;
                        task.lapses().is_some() && task.source().drives()
                    });
                    let probed = if drives {
                        None
                    } else {
                        probe::carry_out(probe, D::SPARE)
                    };
                    match probed {
                        Some(value) => {
                            *is_changed |= matches!(probe, Probe::Store { .. });
                            let stopwatch =
                                control.lock(|control| control.task.drive().stopwatch());
                            Response::Probed { value, stopwatch }
                        }
                        None => Response::Refused,
                    }
                }
                Ok(Request::Sources) => Response::Sources(SOURCES),
                Ok(Request::PermitArming(permitted)) => {
                    Response::Permission(control.lock(|control| {
                        let is_configured = control.task.lapses().is_some();
                        let drive = control.task.drive_mut();
                        drive.permit_arming(permitted && is_configured)
                    }))
                }
                Ok(Request::Stop) => {
                    control.lock(|control| control.task.stop());
                    Response::Stopped
                }
                Err(_) => continue,
            };
            send(port, &response, 0);
        }
    }
}

/// Takes the torque off and waits for a configuration.
#[inline(never)]
fn stop<D: BoardDrive, L: Law>(control: &mut impl Mutex<T = Control<D, L>>) {
    control.lock(|control| {
        control.task.stop();
        control.task.drive_mut().idle();
    });
}

/// Starts with a configuration, encoded by postcard; returns the response to the host.
///
/// # Errors
/// The response, if the configuration is refused.
fn configure<D: BoardDrive, L: Law + DeserializeOwned>(
    control: &mut impl Mutex<T = Control<D, L>>,
    decoded: &mut Option<Configuration<L>>,
    bytes: &[u8],
    source: FrameSource,
) -> Result<Response, Response> {
    decode(decoded, bytes);
    let configuration = decoded.as_ref().ok_or(Response::Refused)?;
    control.lock(|control| {
        control.dropped_responses = 0;
        control.expect_host(source, configuration.tick_hz as u32);
        let accepted = control.task.configure(configuration, source);
        accepted.map_err(|_| Response::Refused)?;
        let rate = control
            .task
            .drive_mut()
            .check_rate(configuration.tick_hz, source);
        if let Err(rate) = rate {
            control.task.stop();
            return Err(Response::RateRefused(rate));
        }
        let drive = control.task.drive_mut();
        drive.start(configuration, source);
        Ok(Response::Ready {
            stopwatch_hz: drive.stopwatch_hz(),
        })
    })
}

/// Starts with the configuration that the board has stored, if it has one.
#[inline(never)]
fn start_alone<D: BoardDrive, L: Law + DeserializeOwned, F: NorFlash>(
    control: &mut impl Mutex<T = Control<D, L>>,
    memory: &mut FlashMemory<F>,
    decoded: &mut Option<Configuration<L>>,
) -> StoredConfiguration {
    let Some((content, bytes)) = memory.newest() else {
        return StoredConfiguration::default();
    };
    let state = if content.build != Configuration::<L>::BUILD {
        StoredState::OtherBuild
    } else if configure(control, decoded, bytes, FrameSource::StandAlone).is_err() {
        StoredState::Refused
    } else {
        StoredState::Intact
    };
    let version = content.version;
    StoredConfiguration { state, version }
}

/// Records what has been stored, version 0 for nothing.
fn note_written(stored: &mut StoredConfiguration, written: Result<u32, NotWritten>) -> Response {
    let written = match written {
        Ok(0) => StoredConfiguration::default(),
        Ok(version) => StoredConfiguration {
            state: StoredState::Intact,
            version,
        },
        Err(NotWritten) => StoredConfiguration {
            state: StoredState::NotWritten,
            ..*stored
        },
    };
    *stored = written;
    Response::Stored(written)
}

/// Decodes a configuration; stores `None` if decoding fails.
// Out of line: decoding and building the controller need the most stack, and their stack use must
// not add up.
#[inline(never)]
fn decode<L: Law + DeserializeOwned>(configuration: &mut Option<Configuration<L>>, bytes: &[u8]) {
    *configuration = None;
    if let Ok(decoded) = postcard::from_bytes(bytes) {
        *configuration = Some(decoded);
    }
}

/// Counts broken messages as lapses, and intact ones as good.
fn note_message<D: BoardDrive, L: Law, M>(
    task: &mut ControlTask<D, L>,
    request: &Result<M, WireError>,
) {
    if task.source() == FrameSource::StandAlone {
        // Nothing may be connected to the line.
        return;
    }
    let broken = |kinds: &[WireError]| request.as_ref().is_err_and(|it| kinds.contains(it));
    let checksum = broken(&[WireError::Checksum]);
    let garbage = broken(&[WireError::Garbage, WireError::Content]);
    task.note(Lapse::FailedChecksum, u32::from(checksum));
    task.note(Lapse::Garbage, u32::from(garbage));
}

/// Sends a response if the port can keep `spare` bytes after it. One that the host does not accept is lost; the host asks again or
/// gives up.
#[inline(never)]
fn send(port: &mut impl Port, response: &Response, spare: usize) {
    let mut buffer = [0; MAXIMUM_RESPONSE_LENGTH];
    if let Ok(bytes) = wire::encode(response, &mut buffer) {
        let _ = port.send(bytes, spare);
    }
}
