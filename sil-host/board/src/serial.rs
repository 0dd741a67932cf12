//! Hardware in the loop: a board behind a serial port, 921,600 baud, 8N1.
//!
//! The board's timer sets the pace: it answers a frame at its next tick. Both ends count and skip
//! bytes that are not a message. The host repeats a request that is not answered; a repeated frame
//! changes nothing on the board.

use std::path::Path;
use std::time::Duration;

use painleve_plant::Configuration;
use painleve_plant::law_choice::build;
use painleve_shared::black_box::BlackBox;
use painleve_shared::frame::SensorFrame;
use painleve_shared::message::{
    FrameSource, Health, MAXIMUM_LENGTH, MAXIMUM_RESPONSE_LENGTH, PROTOCOL, Request, Response,
};
use painleve_shared::wire::{self, Inbox, WireError};

use super::{BoardError, ConnectedBoard, LineHealth, SILENCE_LIMIT, TimedAnswer};
use crate::port::{Port, SerialPort};
use crate::timing::Unit;

/// Time allowed for the answer to any request other than a frame.
pub(crate) const PATIENCE: Duration = Duration::from_millis(200);

/// Time allowed for the answer to a frame in lockstep.
const LOCKSTEP_PATIENCE: Duration = Duration::from_millis(50);

/// Time allowed for the answer to a frame in real time, in ticks: a frame can be repeated twice
/// before the board's limit of [10 ticks](painleve_firmware::supervise::lapses::LapseLimits) is
/// reached.
const REALTIME_PATIENCE_TICKS: u32 = 3;

/// Checks that the port can be used, before anything is started.
///
/// # Errors
/// [`BoardError::Port`] and [`BoardError::InUse`].
pub fn check(path: &Path) -> Result<(), BoardError> {
    SerialPort::open(path).map(|_| ())
}

/// Factor by which the allowed time grows with every repetition. In lockstep, five repetitions fit
/// into the time that a board may be silent, which covers the longest series that occurs.
const PATIENCE_GROWTH: f32 = 1.5;

/// A flashed and configured board.
pub struct Serial<P: Port = SerialPort> {
    port: P,
    inbox: Inbox,
    /// Received bytes not decoded yet.
    pending: Vec<u8>,
    /// Bytes decoded since the last frame.
    unframed_bytes: usize,
    /// Whether any frame has arrived.
    has_answered: bool,
    line: LineHealth,
    frame_patience: Duration,
    pub(crate) silence_limit: Duration,
    /// Hash of the board's sources, once it is identified.
    sources: u64,
    stopwatch_hz: u32,
}

impl Serial {
    /// Opens the port and sends the board its configuration. With [`FrameSource::Realtime`] the
    /// board counts its ticks without a frame, and stops after too many. A board that is silent
    /// for longer than `silence_limit` is an error.
    ///
    /// # Errors
    /// [`BoardError::Port`] or [`BoardError::InUse`] if it cannot be opened, [`BoardError::Silent`] or
    /// [`BoardError::NoFrames`] if no board answers, [`BoardError::OtherProtocol`], [`BoardError::OtherBuild`],
    /// [`BoardError::RateRefused`], [`BoardError::Refused`].
    pub fn open(
        path: &Path,
        configuration: &Configuration,
        source: FrameSource,
        silence_limit: Duration,
    ) -> Result<Self, BoardError> {
        let mut serial = Self::connect(path)?;
        serial.silence_limit = silence_limit;
        serial.identify()?;
        serial.configure(configuration, source)?;
        Ok(serial)
    }

    /// Opens the port; says nothing to the board yet.
    ///
    /// # Errors
    /// [`BoardError::Port`] or [`BoardError::InUse`] if it cannot be opened.
    pub fn connect(path: &Path) -> Result<Self, BoardError> {
        Self::over(SerialPort::open(path)?)
    }
}

impl<P: Port> Serial<P> {
    /// Takes a line to a board; says nothing to the board yet.
    ///
    /// # Errors
    /// [`BoardError::System`] if the port fails.
    pub fn over(mut port: P) -> Result<Self, BoardError> {
        // Ends a message that the board may have received in part.
        port.write(&[0], SILENCE_LIMIT)?;
        Ok(Self {
            port,
            inbox: Inbox::new(),
            pending: Vec::new(),
            unframed_bytes: 0,
            has_answered: false,
            line: LineHealth::default(),
            frame_patience: LOCKSTEP_PATIENCE,
            silence_limit: SILENCE_LIMIT,
            sources: 0,
            stopwatch_hz: 0,
        })
    }

    /// Compares the board's protocol and build with this program's, and asks for the board's sources.
    ///
    /// # Errors
    /// [`BoardError::OtherProtocol`] or [`BoardError::OtherBuild`] if they differ, and
    /// [`BoardError::Silent`] if no board answers.
    pub fn identify(&mut self) -> Result<(), BoardError> {
        let is_identity = |response: &Response| matches!(response, Response::Identity { .. });
        match self.ask(&Request::Identify, PATIENCE, is_identity)? {
            Response::Identity { protocol, .. } if protocol != PROTOCOL => {
                Err(BoardError::OtherProtocol {
                    board: protocol,
                    host: PROTOCOL,
                })
            }
            Response::Identity { build, .. } if build != self::build() => {
                Err(BoardError::other_build(build))
            }
            _ => self.ask_for_sources(),
        }
    }

    fn ask_for_sources(&mut self) -> Result<(), BoardError> {
        let is_wanted = |response: &Response| matches!(response, Response::Sources(_));
        match self.ask(&Request::Sources, PATIENCE, is_wanted)? {
            Response::Sources(board) => self.sources = board,
            other => return Err(BoardError::OutOfTurn(other)),
        }
        Ok(())
    }

    /// Returns the hash of the identified board's sources.
    pub fn sources(&self) -> u64 {
        self.sources
    }

    /// Returns whether the identified board was built from this program's sources.
    ///
    /// # Errors
    /// [`BoardError::OtherSources`] if it was not.
    pub fn compare_sources(&self) -> Result<(), BoardError> {
        BoardError::compare_sources(self.sources)
    }

    /// Returns the board's record of its last reset, crash and fault.
    ///
    /// # Errors
    /// [`BoardError::Silent`] if no board answers.
    pub fn black_box(&mut self) -> Result<BlackBox, BoardError> {
        let is_wanted = |response: &Response| matches!(response, Response::BlackBox(_));
        match self.ask(&Request::BlackBox, PATIENCE, is_wanted)? {
            Response::BlackBox(content) => Ok(content),
            other => Err(BoardError::OutOfTurn(other)),
        }
    }

    /// Gives the board a configuration, with frames from `source`.
    ///
    /// # Errors
    /// [`BoardError::Silent`] if no board answers, [`BoardError::OtherBuild`], [`BoardError::RateRefused`] and
    /// [`BoardError::Refused`].
    pub fn configure(
        &mut self,
        configuration: &Configuration,
        source: FrameSource,
    ) -> Result<(), BoardError> {
        let patience =
            REALTIME_PATIENCE_TICKS * Duration::from_secs_f32(1.0 / configuration.tick_hz);
        self.frame_patience = match source {
            FrameSource::Lockstep => LOCKSTEP_PATIENCE.max(patience),
            FrameSource::Realtime
            | FrameSource::Sensors
            | FrameSource::DryRun
            | FrameSource::Commissioning
            | FrameSource::StandAlone => patience,
        };
        let configuration = super::encode(configuration)?;
        let request = Request::Configure {
            build: build(),
            source,
            configuration: &configuration,
        };
        let is_wanted = |response: &Response| {
            matches!(
                response,
                Response::Ready { .. }
                    | Response::Refused
                    | Response::RateRefused(_)
                    | Response::OtherBuild { .. }
            )
        };
        match self.ask(&request, PATIENCE, is_wanted)? {
            Response::Ready { stopwatch_hz } => self.stopwatch_hz = stopwatch_hz,
            Response::OtherBuild { build } => return Err(BoardError::other_build(build)),
            Response::RateRefused(rate) => return Err(BoardError::RateRefused(rate)),
            _ => return Err(BoardError::Refused),
        }
        Ok(())
    }

    /// Sends a request without waiting for its response, which [`Serial::listen`] returns.
    ///
    /// # Errors
    /// [`BoardError::System`] if the port fails.
    pub fn send(&mut self, request: &Request<'_>) -> Result<(), BoardError> {
        let mut buffer = [0; MAXIMUM_LENGTH];
        let bytes = wire::encode(request, &mut buffer)?;
        self.port.write(bytes, self.silence_limit)
    }

    /// Takes the torque off, and waits until the board has confirmed it.
    ///
    /// # Errors
    /// [`BoardError::Silent`] if the board does not answer.
    pub fn stop(&mut self) -> Result<(), BoardError> {
        let is_stopped = |response: &Response| matches!(response, Response::Stopped);
        self.ask(&Request::Stop, PATIENCE, is_stopped).map(|_| ())
    }

    /// Returns the time on the line's clock.
    pub fn now(&self) -> Duration {
        self.port.now()
    }

    /// Waits for a message that the board sends unasked; `None` after `limit`.
    ///
    /// # Errors
    /// [`BoardError::System`] if the port fails.
    pub fn listen(&mut self, limit: Duration) -> Result<Option<Response>, BoardError> {
        self.receive(limit, |_| true)
    }

    /// Sends a request, and repeats it with growing patience until it is answered.
    ///
    /// # Errors
    /// [`BoardError::Silent`] or [`BoardError::NoFrames`] if no board answers.
    pub fn ask(
        &mut self,
        request: &Request<'_>,
        patience: Duration,
        is_wanted: impl Fn(&Response) -> bool,
    ) -> Result<Response, BoardError> {
        self.ask_within(request, patience, self.silence_limit, is_wanted)
    }

    /// The same with another limit of the board's silence.
    pub(crate) fn ask_within(
        &mut self,
        request: &Request<'_>,
        mut patience: Duration,
        silence_limit: Duration,
        is_wanted: impl Fn(&Response) -> bool,
    ) -> Result<Response, BoardError> {
        let mut buffer = [0; MAXIMUM_LENGTH];
        let bytes = wire::encode(request, &mut buffer)?;
        let mut silence = Duration::ZERO;
        loop {
            let left = silence_limit.saturating_sub(silence);
            let sent = self.port.now();
            self.port.write(bytes, left)?;
            let limit = patience.min(left);
            if let Some(response) = self.receive(limit, &is_wanted)? {
                return Ok(response);
            }
            // A longer wait means that this process was stopped.
            silence += (self.port.now() - sent).min(limit);
            if silence >= silence_limit {
                return Err(self.silence(silence));
            }
            self.line.repeated_requests += 1;
            patience = patience.mul_f32(PATIENCE_GROWTH);
        }
    }

    /// Waits for the response for which `is_wanted` holds; skips others.
    fn receive(
        &mut self,
        limit: Duration,
        is_wanted: impl Fn(&Response) -> bool,
    ) -> Result<Option<Response>, BoardError> {
        let start = self.port.now();
        loop {
            if let Some(response) = self.take(&is_wanted) {
                return Ok(Some(response));
            }
            let left = limit.saturating_sub(self.port.now() - start);
            if left.is_zero() {
                return Ok(None);
            }
            let mut bytes = [0; 256];
            let length = self.port.read(&mut bytes, left)?;
            self.pending.extend_from_slice(&bytes[..length]);
        }
    }

    /// Returns the error for a board that has not answered, from the bytes that have arrived instead.
    pub(crate) fn silence(&self, lasted: Duration) -> BoardError {
        // A line that breaks leaves a part of a response behind.
        let part_of_response = if self.has_answered {
            MAXIMUM_RESPONSE_LENGTH
        } else {
            0
        };
        if self.unframed_bytes > part_of_response {
            BoardError::NoFrames {
                bytes: self.unframed_bytes,
                lasted,
            }
        } else {
            BoardError::Silent(lasted)
        }
    }

    /// Returns the first response among the received bytes for which `is_wanted` holds.
    fn take(&mut self, is_wanted: impl Fn(&Response) -> bool) -> Option<Response> {
        let mut looked_at = 0;
        let mut found = None;
        for byte in &self.pending {
            looked_at += 1;
            self.unframed_bytes += 1;
            let Some(message) = self.inbox.push(*byte) else {
                continue;
            };
            match wire::decode::<Response>(message) {
                Ok(response) => {
                    self.unframed_bytes = 0;
                    self.has_answered = true;
                    if is_wanted(&response) {
                        found = Some(response);
                        break;
                    }
                }
                Err(WireError::Checksum) => self.line.failed_checksums += 1,
                Err(_) => self.line.garbage += 1,
            }
        }
        self.pending.drain(..looked_at);
        found
    }
}

/// Makes the board discard its configuration, if the line still carries the request.
impl<P: Port> Drop for Serial<P> {
    fn drop(&mut self) {
        let mut buffer = [0; MAXIMUM_LENGTH];
        if let Ok(bytes) = wire::encode(&Request::Stop, &mut buffer) {
            let _ = self.port.write(bytes, PATIENCE);
        }
    }
}

impl<P: Port> ConnectedBoard for Serial<P> {
    const HOST: &'static str = "serial";

    fn unit(&self) -> Unit {
        Unit::Cycles {
            hz: self.stopwatch_hz,
        }
    }

    fn exchange(&mut self, frame: &SensorFrame) -> Result<TimedAnswer, BoardError> {
        let tick = frame.tick;
        let answers = |response: &Response| matches!(response, Response::Actuator { frame, .. } if frame.tick == tick);
        match self.ask(&Request::Sensor(*frame), self.frame_patience, answers)? {
            Response::Actuator { frame, elapsed } => Ok(TimedAnswer {
                frame,
                cost: elapsed,
            }),
            other => Err(BoardError::OutOfTurn(other)),
        }
    }

    fn health(&mut self) -> Result<Health, BoardError> {
        let answers = |response: &Response| matches!(response, Response::Health(_));
        match self.ask(&Request::Health, PATIENCE, answers)? {
            Response::Health(health) => Ok(health),
            other => Err(BoardError::OutOfTurn(other)),
        }
    }

    fn line(&self) -> Option<LineHealth> {
        Some(self.line)
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    /// A line whose host is stopped for three seconds while it first waits.
    #[derive(Default)]
    struct Stopped {
        clock: Cell<Duration>,
        reads: u32,
    }

    impl Port for Stopped {
        fn read(&mut self, bytes: &mut [u8], limit: Duration) -> Result<usize, BoardError> {
            self.reads += 1;
            if self.reads == 1 {
                self.clock.set(self.clock.get() + 3 * SILENCE_LIMIT);
                return Ok(0);
            }
            self.clock.set(self.clock.get() + limit);
            Ok(wire::encode(&Response::Stopped, bytes)?.len())
        }

        fn write(&mut self, _: &[u8], _: Duration) -> Result<(), BoardError> {
            Ok(())
        }

        fn now(&self) -> Duration {
            self.clock.get()
        }
    }

    #[test]
    fn the_time_for_which_the_host_is_stopped_is_no_silence_of_the_board() {
        let mut serial = Serial::over(Stopped::default()).unwrap();
        serial.stop().unwrap();
        assert_eq!(serial.line.repeated_requests, 1);
    }
}
