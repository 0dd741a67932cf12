//! The plant on the bus as the drive of a control task; the process takes the place of a board.

use std::time::{Duration, Instant};

use painleve_firmware::drive::Drive;
use painleve_shared::frame::{ActuatorFrame, DigitalInputs, SensorFrame};
use painleve_shared::message::FrameSource;

use crate::{ControllerEnd, Expected, LinkError, Pacing, Received, Session};

/// The controller's end of the link as a [`Drive`].
///
/// In lockstep, each tick begins when the plant's frame arrives. In real time, a tick also begins
/// without a frame once the frame is half a tick overdue. The two processes have separate clocks,
/// so a slightly late frame is not a lapse.
pub struct BusDrive {
    end: ControllerEnd,
    /// Time between two ticks in real time; `None` in lockstep.
    period: Option<Duration>,
    /// Time at which the present tick was due: the arrival of its frame, if it arrived. `None`
    /// before the first frame.
    due: Option<Instant>,
    start: Instant,
    /// Result of the session, once it has ended.
    outcome: Option<Result<(), LinkError>>,
}

impl BusDrive {
    /// Creates a drive for the session that `end` has joined.
    pub fn new(end: ControllerEnd, session: &Session) -> Self {
        Self {
            end,
            period: (session.pacing == Pacing::Realtime)
                .then(|| Duration::from_secs(1) / session.tick_hz),
            due: None,
            start: Instant::now(),
            outcome: None,
        }
    }

    /// Returns the source of the control task's frames.
    pub fn source(&self) -> FrameSource {
        match self.period {
            Some(_) => FrameSource::Realtime,
            None => FrameSource::Lockstep,
        }
    }

    /// Takes the result of the session; `None` while the session continues.
    pub fn take_outcome(&mut self) -> Option<Result<(), LinkError>> {
        self.outcome.take()
    }

    fn receive(&mut self) -> Result<Option<Received>, LinkError> {
        let (Some(period), Some(due)) = (self.period, self.due) else {
            return self.end.receive().map(Some);
        };
        let next = due + period;
        let received = self.end.receive_newest(Expected {
            due: next,
            deadline: next + period / 2,
        })?;
        if received.is_none() {
            self.due = Some(next);
        }
        Ok(received)
    }
}

impl Drive for BusDrive {
    /// Does nothing: a tick begins when its frame arrives.
    fn begin_tick(&mut self) {}

    /// Waits for the tick's frame. In real time, the frame whose input is OVERLOAD is taken only
    /// when the next frame is due.
    fn sample(&mut self) -> Option<SensorFrame> {
        match self.receive() {
            Ok(Some(Received::Frame(frame))) => {
                self.due = Some(Instant::now());
                if self.period.is_some() && frame.inputs.contains(DigitalInputs::OVERLOAD) {
                    while !self.next_tick_is_due() {
                        std::hint::spin_loop();
                    }
                }
                Some(frame)
            }
            Ok(None) => None,
            Ok(Some(Received::End)) => {
                self.outcome = Some(Ok(()));
                None
            }
            Err(error) => {
                self.outcome = Some(Err(error));
                None
            }
        }
    }

    /// Sends the answer. Before the first frame the plant expects none, so nothing is sent.
    fn actuate(&mut self, answer: &ActuatorFrame) {
        if self.due.is_some()
            && let Err(error) = self.end.send(answer)
        {
            self.outcome = Some(Err(error));
        }
    }

    fn next_tick_is_due(&self) -> bool {
        self.period
            .zip(self.due)
            .is_some_and(|(period, due)| due.elapsed() >= period)
    }

    /// Returns a time in nanoseconds.
    fn stopwatch(&self) -> u32 {
        self.start.elapsed().as_nanos() as u32
    }
}
