//! A controller in another process, in real time: a tick lasts as long as its simulated time, and
//! an answer that has not arrived by the end of its tick is missed. A late answer is applied only
//! if it reports a fault, because the controller has then removed the torque.

use std::io;
use std::time::{Duration, Instant};

use hdrhistogram::Histogram;
use painleve_plant::controller_host::{Answer, ControllerHost, HostError};
use painleve_process::realtime::Pacer;
use painleve_shared::frame::SensorFrame;

use crate::PlantEnd;

/// The plant's end of the link with absolute deadlines.
pub struct Paced {
    /// The link.
    pub end: PlantEnd,
    pacer: Pacer,
    /// Part of a tick within which an answer is in time.
    patience: Duration,
    /// Lateness of the wake-ups, ns.
    pub lateness_ns: Histogram<u64>,
    /// Number of wake-ups that were late by a tick or more.
    pub missed_deadlines: u64,
    period: Duration,
}

impl Paced {
    /// Starts the clock at `tick_hz`.
    ///
    /// # Errors
    /// If the clock cannot be read.
    pub fn start(end: PlantEnd, tick_hz: u32) -> io::Result<Self> {
        let period = Duration::from_secs(1) / tick_hz;
        Ok(Self {
            end,
            pacer: Pacer::start(period)?,
            patience: period.mul_f64(0.9),
            lateness_ns: Histogram::new_with_max(60_000_000_000, 3).map_err(io::Error::other)?,
            missed_deadlines: 0,
            period,
        })
    }

    /// Spends a tick: sends its frame, unless it is lost, and waits for the answer and for the clock.
    fn spend(&mut self, frame: Option<&SensorFrame>) -> Result<Answer, HostError> {
        let start = Instant::now();
        if let Some(frame) = frame {
            self.end.send(frame).map_err(HostError::new)?;
        }
        let mut answer = Answer::default();
        let deadline = start + self.patience;
        while let Some(received) = self.end.receive_before(deadline).map_err(HostError::new)? {
            if frame.is_some_and(|frame| frame.tick == received.tick) {
                answer = Answer {
                    frame: Some(received),
                    round_trip: Some(start.elapsed()),
                };
                break;
            }
            // A late answer to a tick that was given up.
            answer.frame = received.latched_fault().map(|_| received);
        }
        let late = self.pacer.wait().map_err(HostError::new)?;
        let nanoseconds = u64::try_from(late.as_nanos()).unwrap_or(u64::MAX);
        self.lateness_ns.saturating_record(nanoseconds);
        self.missed_deadlines += u64::from(late >= self.period);
        Ok(answer)
    }
}

impl ControllerHost for Paced {
    fn exchange(&mut self, frame: &SensorFrame) -> Result<Answer, HostError> {
        self.spend(Some(frame))
    }

    /// The controller may report a fault meanwhile, because it misses the frame.
    fn skip(&mut self) -> Result<Answer, HostError> {
        self.spend(None)
    }
}
