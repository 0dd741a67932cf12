//! The plant on the bus as the drive of a control task: a process is its board.

use std::time::{Duration, Instant};

use painleve_firmware::drive::Drive;
use painleve_shared::frame::{ActuatorFrame, DigitalInputs, SensorFrame};
use painleve_shared::message::FrameSource;

use crate::{ControllerEnd, LinkError, Pacing, Received, Session};

/// The controller's end of the link as a [`Drive`].
///
/// In lockstep a tick begins with the plant's frame, whenever it comes. By the clock it is also
/// due when no frame has come for half a tick longer than it should have: the clocks of two
/// processes are not one, and a frame that is a little late is no lapse.
pub struct BusDrive {
    end: ControllerEnd,
    /// Time between two ticks by the clock; `None` in lockstep.
    period: Option<Duration>,
    /// When the present tick was due: at its frame, if there is one. `None` before the first.
    due: Option<Instant>,
    start: Instant,
    /// How the session has ended.
    outcome: Option<Result<(), LinkError>>,
}

impl BusDrive {
    /// A drive for the session that this end has joined.
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

    /// Where the control task's frames come from.
    pub fn source(&self) -> FrameSource {
        match self.period {
            Some(_) => FrameSource::Realtime,
            None => FrameSource::Lockstep,
        }
    }

    /// How the session has ended; `None` while it goes on.
    pub fn take_outcome(&mut self) -> Option<Result<(), LinkError>> {
        self.outcome.take()
    }

    fn receive(&mut self) -> Result<Option<Received>, LinkError> {
        let (Some(period), Some(due)) = (self.period, self.due) else {
            return self.end.receive().map(Some);
        };
        let next = due + period;
        let received = self.end.receive_newest(next + period / 2)?;
        if received.is_none() {
            self.due = Some(next);
        }
        Ok(received)
    }
}

impl Drive for BusDrive {
    /// A tick begins when its frame is there.
    fn begin_tick(&mut self) {}

    /// Waits for the tick. A frame with the input OVERLOAD is taken by the clock when the next one
    /// is due.
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

    /// Sends the answer; before the first frame nobody waits for one.
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

    /// Nanoseconds.
    fn stopwatch(&self) -> u32 {
        self.start.elapsed().as_nanos() as u32
    }
}
