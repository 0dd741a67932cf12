//! The controller in this process, woken at absolute deadlines as by a microcontroller's timer.

use std::io;
use std::time::{Duration, Instant};

use painleve_plant::Configuration;
use painleve_plant::controller_host::{Answer, ControllerHost, HostError, InProcess};
use painleve_process::realtime::Pacer;
use painleve_shared::frame::SensorFrame;

use super::TickTimes;

/// A controller that waits for the clock before every tick and records the latency of each wake-up.
pub struct Metronome {
    controller: InProcess,
    pacer: Pacer,
    period: Duration,
    /// Latencies of the wake-ups, ns.
    pub lateness_ns: TickTimes,
    /// Number of answers that were not ready when the next tick was due.
    pub missed_deadlines: u64,
}

impl Metronome {
    /// Starts the clock at the configuration's rate.
    ///
    /// # Errors
    /// If the clock cannot be read.
    pub fn start(controller: InProcess, configuration: &Configuration) -> io::Result<Self> {
        let period = Duration::from_secs_f32(configuration.tick_s());
        Ok(Self {
            controller,
            pacer: Pacer::start(period)?,
            period,
            lateness_ns: TickTimes::default(),
            missed_deadlines: 0,
        })
    }
}

impl ControllerHost for Metronome {
    fn exchange(&mut self, frame: &SensorFrame) -> Result<Answer, HostError> {
        let late = self.pacer.wait().map_err(HostError::new)?;
        let start = Instant::now();
        let answer = self.controller.exchange(frame)?;
        if let Some(frame) = &answer.frame {
            let late_ns = u32::try_from(late.as_nanos()).unwrap_or(u32::MAX);
            self.lateness_ns.push(frame, late_ns);
        }
        self.missed_deadlines += u64::from(late + start.elapsed() >= self.period);
        Ok(answer)
    }

    fn skip(&mut self) -> Result<Answer, HostError> {
        self.pacer.wait().map_err(HostError::new)?;
        Ok(Answer::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use painleve_plant::scenario::Scenario;

    #[test]
    fn every_tick_waits_for_its_deadline_and_a_late_one_is_missed() {
        let mut scenario = Scenario::default();
        scenario.run.tick_hz = 500;
        let configuration = scenario.controller_configuration();
        let controller = InProcess::new(&configuration).unwrap();
        let start = Instant::now();
        let mut metronome = Metronome::start(controller, &configuration).unwrap();
        metronome.skip().unwrap();
        for tick in 0..4 {
            let frame = SensorFrame {
                tick,
                sequence: tick,
                ..Default::default()
            };
            metronome.exchange(&frame).unwrap();
        }
        assert!(start.elapsed() >= Duration::from_millis(10));
        // Sleeping past several deadlines delays the following ticks.
        std::thread::sleep(Duration::from_millis(20));
        metronome.exchange(&SensorFrame::default()).unwrap();
        assert_eq!(metronome.lateness_ns.ticks(), 5);
        assert!(metronome.lateness_ns.at_quantile(1.0) >= 17_000_000);
        assert!(metronome.missed_deadlines >= 1);
    }
}
