//! The board on its bench: probes, resets, pins.

use std::time::Duration;

use painleve_board::{BoardError, Port, Serial};
use painleve_plant::Configuration;
use painleve_plant::scenario::Scenario;
use painleve_shared::black_box::BlackBox;
use painleve_shared::frame::{ActuatorFrame, SensorFrame};
use painleve_shared::message::{FrameSource, Probe, Request, Response};

use crate::chip::{Chip, SYSTICK, driver, port};

/// Time allowed for the answer to a probe.
const PATIENCE: Duration = Duration::from_millis(200);

/// Longest time from a reset until the image answers.
const START: Duration = Duration::from_millis(1500);

/// Most probes that are under way at once: their answers fit into the board's buffer.
const TOGETHER: usize = 8;

/// Counts of the SysTick timer, at the processor's clock, until a reset at once.
const AT_ONCE: u32 = 2000;

/// Failure of a step.
#[derive(Debug, thiserror::Error)]
pub enum StepError {
    /// The board failed, or does not answer.
    #[error(transparent)]
    Board(#[from] BoardError),
    /// The board refuses a probe.
    #[error(
        "the board refuses to look at {0:#010x}: it drives an arm, or does not list this address"
    )]
    Probe(u32),
    /// Some answers to probes are missing.
    #[error("{missing} of {sent} answers are missing")]
    Lost {
        /// Missing answers.
        missing: usize,
        /// Probes.
        sent: usize,
    },
    /// The chip is none that has an image.
    #[error("not carried out: the chip is unknown")]
    UnknownChip,
}

/// Answer to a probe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Probed {
    /// The word.
    pub value: u32,
    /// The board's cycle counter after the access.
    pub cycles: u32,
}

/// A board on its bench.
pub struct Bench<P: Port> {
    /// The board.
    pub board: Serial<P>,
    /// Its chip, once identified.
    pub chip: Option<&'static Chip>,
    scenario: Scenario,
}

impl<P: Port> Bench<P> {
    pub(crate) fn new(board: Serial<P>) -> Self {
        Self {
            board,
            chip: None,
            scenario: Scenario::default(),
        }
    }

    /// Returns the chip.
    ///
    /// # Errors
    /// [`StepError::UnknownChip`].
    pub fn chip(&self) -> Result<&'static Chip, StepError> {
        self.chip.ok_or(StepError::UnknownChip)
    }

    /// Returns the scenario with which the board is tested.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// Configures the board at a control rate, with frames from `source`.
    ///
    /// # Errors
    /// [`StepError`] if the board does not answer or refuses.
    pub fn configure(&mut self, tick_hz: f32, source: FrameSource) -> Result<(), StepError> {
        let mut configuration = Configuration {
            tick_hz,
            ..self.scenario.controller_configuration()
        };
        // A slow controller permits no fast estimator.
        let bandwidth_rad_s = &mut configuration.settings.estimator.bandwidth_rad_s;
        *bandwidth_rad_s = bandwidth_rad_s.min(tick_hz);
        self.board.configure(&configuration, source)?;
        Ok(())
    }

    /// Lets the board wait for frames from the host, at 1 kHz.
    ///
    /// # Errors
    /// As [`Bench::configure`].
    pub fn rest(&mut self) -> Result<(), StepError> {
        self.configure(1000.0, FrameSource::Lockstep)
    }

    /// Loads a word.
    ///
    /// # Errors
    /// [`StepError`] if the board does not answer or refuses.
    pub fn load(&mut self, address: u32) -> Result<Probed, StepError> {
        self.probe(Probe::Load { address })
    }

    /// Stores the spare bits of a word, and returns the word afterwards.
    ///
    /// # Errors
    /// As [`Bench::load`].
    pub fn store(&mut self, address: u32, value: u32) -> Result<Probed, StepError> {
        self.probe(Probe::Store { address, value })
    }

    /// Stores `value` in the bits of `mask` of a word.
    ///
    /// # Errors
    /// As [`Bench::load`].
    pub fn modify(&mut self, address: u32, mask: u32, value: u32) -> Result<(), StepError> {
        let before = self.load(address)?.value;
        self.store(address, before & !mask | value & mask)?;
        Ok(())
    }

    fn probe(&mut self, probe: Probe) -> Result<Probed, StepError> {
        let is_wanted = |it: &Response| matches!(it, Response::Probed { .. } | Response::Refused);
        let answer = self
            .board
            .ask(&Request::Probe(probe), PATIENCE, is_wanted)?;
        probed(&answer).ok_or(StepError::Probe(address(probe)))
    }

    /// Carries out probes that follow each other without a pause.
    ///
    /// # Errors
    /// [`StepError::Lost`] if some are not answered.
    pub fn probe_all(&mut self, probes: &[Probe]) -> Result<Vec<Probed>, StepError> {
        let mut answers = Vec::new();
        for together in probes.chunks(TOGETHER) {
            for probe in together {
                self.board.send(&Request::Probe(*probe))?;
            }
            let expected = answers.len() + together.len();
            while answers.len() < expected {
                match self.board.listen(PATIENCE)? {
                    Some(Response::Refused) => {
                        return Err(StepError::Probe(address(probes[answers.len()])));
                    }
                    Some(answer) => answers.extend(probed(&answer)),
                    None => {
                        return Err(StepError::Lost {
                            missing: expected - answers.len(),
                            sent: together.len(),
                        });
                    }
                }
            }
        }
        Ok(answers)
    }

    /// Sends a probe; returns the answer, `None` after `limit`.
    ///
    /// # Errors
    /// [`StepError::Board`] if the line fails.
    pub fn try_probe(
        &mut self,
        probe: Probe,
        limit: Duration,
    ) -> Result<Option<Probed>, StepError> {
        self.board.send(&Request::Probe(probe))?;
        let end = self.board.now() + limit;
        loop {
            let left = end.saturating_sub(self.board.now());
            match self.board.listen(left)? {
                Some(answer) if probed(&answer).is_some() => return Ok(probed(&answer)),
                None if left.is_zero() => return Ok(None),
                _ => {}
            }
        }
    }

    /// Resets the board `cycles` of an eighth of the processor's clock from now, by an exception that nothing handles.
    ///
    /// # Errors
    /// As [`Bench::load`].
    pub fn reset_after(&mut self, cycles: u32) -> Result<(), StepError> {
        let [reload, count, control] = SYSTICK;
        let stores = [(reload, cycles), (count, 0), (control, 3)];
        for (address, value) in stores {
            self.board
                .send(&Request::Probe(Probe::Store { address, value }))?;
        }
        Ok(())
    }

    /// Resets the board, and waits until it answers.
    ///
    /// # Errors
    /// [`StepError::Board`] if it does not.
    pub fn reset(&mut self) -> Result<(), StepError> {
        self.reset_after(AT_ONCE)?;
        self.wait_for_start()?;
        Ok(())
    }

    /// Waits until the board answers again after a reset; returns its record.
    ///
    /// # Errors
    /// [`StepError::Board`] if it does not.
    pub fn wait_for_start(&mut self) -> Result<BlackBox, StepError> {
        let end = self.board.now() + START;
        // What it sent before the reset.
        self.wait(Duration::from_millis(20))?;
        loop {
            match self.board.black_box() {
                Ok(record) => return Ok(record),
                Err(error) if self.board.now() > end => return Err(error.into()),
                Err(_) => {}
            }
        }
    }

    /// Drives a pin of port C that leads to an input, or releases it.
    ///
    /// # Errors
    /// As [`Bench::load`].
    pub fn drive(&mut self, pin: u32, level: Option<bool>) -> Result<(), StepError> {
        let [_, _, c] = self.chip()?.ports;
        if let Some(level) = level {
            self.modify(c + port::OUTPUTS, 1 << pin, u32::from(level) << pin)?;
        }
        let mode = u32::from(level.is_some());
        self.modify(c + port::MODES, 3 << (2 * pin), mode << (2 * pin))
    }

    /// Drives the pins of the switches: ENABLE, RESET, READY.
    ///
    /// # Errors
    /// As [`Bench::load`].
    pub fn switches(&mut self, levels: [bool; 3]) -> Result<(), StepError> {
        let pins = [driver::ENABLE, driver::RESET, driver::READY];
        for (pin, level) in pins.into_iter().zip(levels) {
            self.drive(pin, Some(level))?;
        }
        Ok(())
    }

    /// Returns the level of a pin of a port, 0 for A.
    ///
    /// # Errors
    /// As [`Bench::load`].
    pub fn level(&mut self, of_port: usize, pin: u32) -> Result<bool, StepError> {
        let base = self.chip()?.ports[of_port];
        Ok(self.load(base + port::LEVELS)?.value >> pin & 1 != 0)
    }

    /// Returns the next ticks on the board's own sensors.
    ///
    /// # Errors
    /// [`StepError::Lost`] if they do not come.
    pub fn ticks(&mut self, count: usize) -> Result<Vec<(SensorFrame, ActuatorFrame)>, StepError> {
        // What has waited is older.
        while self.board.listen(Duration::ZERO)?.is_some() {}
        self.board.send(&Request::Alive)?;
        let mut ticks = Vec::new();
        while ticks.len() < count {
            match self.board.listen(PATIENCE)? {
                Some(Response::Tick { sensor, answer, .. }) => ticks.push((sensor, answer)),
                Some(_) => {}
                None => {
                    return Err(StepError::Lost {
                        missing: count - ticks.len(),
                        sent: count,
                    });
                }
            }
        }
        Ok(ticks)
    }

    /// Lets time pass, while the board goes on.
    ///
    /// # Errors
    /// [`StepError::Board`] if the line fails.
    pub fn wait(&mut self, time: Duration) -> Result<(), StepError> {
        let end = self.board.now() + time;
        while self.board.now() < end {
            let left = end.saturating_sub(self.board.now());
            self.board.listen(left)?;
        }
        Ok(())
    }
}

fn probed(answer: &Response) -> Option<Probed> {
    match *answer {
        Response::Probed { value, stopwatch } => Some(Probed {
            value,
            cycles: stopwatch,
        }),
        _ => None,
    }
}

fn address(probe: Probe) -> u32 {
    match probe {
        Probe::Load { address } | Probe::Store { address, .. } => address,
    }
}
