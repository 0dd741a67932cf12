//! The board with the simulated arm on its sensors and torque stages.

use painleve_plant::scenario::Scenario;
use painleve_plant::simulation::Simulation;
use painleve_plant::statistics::Statistics;
use painleve_shared::counts::TorqueCounts;
use painleve_shared::frame::{ActuatorFrame, SensorFrame};
use painleve_shared::message::{Plant, Response};

use crate::board::Board;
use crate::stm32f4::Pin;
use crate::{MICROSECOND, MILLISECOND, Picoseconds};

/// Bits of the force cell's converter.
pub const FORCE_BITS: u8 = 13;

/// Ticks before the switch is closed; the arm is held meanwhile.
const BEFORE_ENABLE: u32 = 20;

/// A board that controls a simulated arm by its own sensors.
pub struct Bench {
    /// The board.
    pub board: Board,
    /// The arm.
    pub simulation: Simulation,
    statistics: Statistics,
    /// What the sensors were last given.
    pub frame: SensorFrame,
    period: Picoseconds,
    held: u32,
}

/// A built-in scenario for this board's converters.
///
/// # Panics
/// If there is none of this name.
pub fn scenario(name: &str) -> Scenario {
    let overrides = [format!("converters.force.bits={FORCE_BITS}")];
    Scenario::load(name, &overrides).unwrap_or_else(|error| panic!("{error}"))
}

/// A scenario's configuration as it is sent.
///
/// # Panics
/// If it cannot be encoded.
pub fn encoded(scenario: &Scenario) -> Vec<u8> {
    postcard::to_stdvec(&scenario.controller_configuration())
        .unwrap_or_else(|error| panic!("{error}"))
}

impl Bench {
    /// Booted and configured for the arm on the board's own sensors, not enabled.
    ///
    /// # Panics
    /// If the image refuses the configuration.
    pub fn new(scenario: &Scenario) -> Self {
        let mut board = Board::booted();
        let response = board.configure(Plant::Real, &encoded(scenario));
        assert!(
            matches!(response, Some(Response::Ready { .. })),
            "{response:?}"
        );
        Self::with_board(scenario, board)
    }

    /// With a board that is configured.
    ///
    /// # Panics
    /// If the scenario is out of range.
    pub fn with_board(scenario: &Scenario, board: Board) -> Self {
        let simulation = Simulation::new(scenario).unwrap_or_else(|error| panic!("{error}"));
        let mut bench = Self {
            board,
            simulation,
            statistics: Statistics::new(0.05),
            frame: SensorFrame::default(),
            period: 1_000_000 * MICROSECOND / u64::from(scenario.run.tick_hz),
            held: 0,
        };
        bench.present();
        bench
    }

    fn present(&mut self) {
        let frame = self.simulation.sample(&mut self.statistics);
        self.frame = frame.unwrap_or_else(|error| panic!("{error}"));
        let wiring = self.board.wiring();
        for (encoder, counts) in wiring.encoders.iter_mut().zip(self.frame.joints) {
            encoder.angle = counts.0 as u16;
        }
        let middle = 2048;
        wiring.force.channels[0] = middle + self.frame.normal_force.0;
        wiring.force.channels[1] = middle;
        wiring.force.channels[2] = middle + self.frame.tangential_force.0;
        wiring.force.channels[3] = middle;
    }

    /// Lets the image control one tick; the arm moves once the switch has been closed.
    pub fn tick(&mut self) {
        self.wait_for_tick();
        if self.held < BEFORE_ENABLE {
            self.held += 1;
            self.board.enable(self.held == BEFORE_ENABLE);
            return;
        }
        let torque = self.board.torque();
        let counts = if torque.enabled == Some(true) {
            torque.counts
        } else {
            [0; 2]
        };
        let answer = ActuatorFrame {
            torques: counts.map(TorqueCounts),
            ..ActuatorFrame::default()
        };
        self.simulation
            .advance(Some(&answer), &mut self.statistics)
            .unwrap_or_else(|error| panic!("{error}"));
        self.present();
    }

    /// Runs until half a period after the next interrupt of the control timer, or two periods.
    pub fn wait_for_tick(&mut self) {
        let machine = &mut self.board.machine;
        let before = machine.chip().timer.updates;
        let end = machine.now() + 2 * self.period;
        while machine.chip().timer.updates == before && machine.now() < end {
            machine.run_for(self.period / 100);
        }
        machine.run_for(self.period / 2);
    }

    /// Runs ticks until the arm is driven and the torque is not zero.
    ///
    /// # Panics
    /// If that does not happen within 100 ticks.
    pub fn drive(&mut self) {
        for _ in 0..100 {
            self.tick();
            let torque = self.board.torque();
            if torque.enabled == Some(true) && torque.counts != [0; 2] && self.held >= BEFORE_ENABLE
            {
                for _ in 0..20 {
                    self.tick();
                }
                return;
            }
        }
        panic!("the arm is not driven: {:?}", self.board.torque());
    }

    /// Time until the torque is off, if that is within `limit`.
    pub fn time_until_off(&mut self, limit: Picoseconds) -> Option<Picoseconds> {
        let start = self.board.machine.now();
        while !self.board.torque().is_off() {
            if self.board.machine.now() - start >= limit {
                return None;
            }
            self.board.machine.run_for(10 * MICROSECOND);
        }
        Some(self.board.machine.now() - start)
    }

    /// Two ticks.
    pub fn two_ticks(&self) -> Picoseconds {
        2 * self.period
    }

    /// Drives a pin from outside.
    pub fn drive_pin(&mut self, pin: Pin, level: Option<bool>) {
        self.board.machine.chip_mut().drive_pin(pin, level);
    }

    /// Runs this many milliseconds without the arm moving.
    pub fn run_ms(&mut self, milliseconds: u64) {
        self.board.machine.run_for(milliseconds * MILLISECOND);
    }
}
