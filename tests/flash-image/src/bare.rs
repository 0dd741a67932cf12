//! A bench without an arm: loop-back wires at the pins, healthy or with a defect, and open lines.

use crate::board::{ENABLE, RESET, STAGES, STAGES_READY};
use painleve_chips::stm32::{Pin, PinLevel};

/// The pin that captures the start of a tick, and the select of encoder 1, to which it is wired.
const CAPTURE: Pin = (0, 0);
const SELECT: Pin = (1, 6);

/// The lines from the encoders and from the force cells.
pub const LINES: [Pin; 2] = [(1, 4), (1, 14)];

/// The pin that observes the stages' enable.
pub const OBSERVER: Pin = (2, 11);

/// Wires, from → to.
const WIRES: [(Pin, Pin); 7] = [
    (SELECT, CAPTURE),
    (STAGES, OBSERVER),
    ((2, 6), ENABLE),
    ((2, 7), RESET),
    ((2, 8), STAGES_READY),
    ((2, 9), LINES[0]),
    ((2, 10), LINES[1]),
];

/// A voltage at an output of the digital-to-analog converter, as a code.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Output {
    /// Factor from the code that was put out.
    pub gain: f64,
    /// Added to it.
    pub offset: f64,
    /// Highest code, which a load permits.
    pub limit: u32,
}

impl Default for Output {
    fn default() -> Self {
        Self {
            gain: 1.0,
            offset: 0.0,
            limit: 4095,
        }
    }
}

/// What is on the pins of a bare board.
#[derive(Clone, Debug, Default)]
pub struct BareBench {
    /// Wires that are missing, by the pins to which they lead.
    pub open: Vec<Pin>,
    /// Pins that are shorted to a level.
    pub stuck: Vec<(Pin, bool)>,
    /// Outputs of the digital-to-analog converter.
    pub outputs: [Output; 2],
    /// Largest noise of a reading of the analog-to-digital converter, codes.
    pub noise: u32,
    /// State of the random numbers of noise and of open lines.
    pub random: u64,
    /// Levels at which wires drive the lines.
    pub lines: [Option<bool>; 2],
}

impl BareBench {
    /// Returns what drives the pins while the chip drives none.
    pub fn at_rest(&self) -> Vec<PinLevel> {
        let pins = WIRES.iter().map(|(_, to)| *to);
        pins.map(|pin| (pin, self.level(pin, None))).collect()
    }

    fn level(&self, pin: Pin, wired: Option<bool>) -> Option<bool> {
        let stuck = self.stuck.iter().find(|(it, _)| *it == pin);
        let wired = wired.filter(|_| !self.open.contains(&pin));
        stuck.map_or(wired, |(_, level)| Some(*level))
    }

    /// Carries the level of a pin along its wire.
    pub(crate) fn carry(&mut self, from: Pin, level: Option<bool>) -> Option<PinLevel> {
        let (_, to) = WIRES.iter().find(|(it, _)| *it == from)?;
        let level = self.level(*to, level);
        if let Some(line) = LINES.iter().position(|it| it == to) {
            self.lines[line] = level;
        }
        Some((*to, level))
    }

    /// Returns what a bus without parts answers.
    pub(crate) fn answer(&mut self, bus: usize, bits: u8) -> u16 {
        let ones = u16::MAX >> (16 - bits);
        match self.level(LINES[bus], self.lines[bus]) {
            Some(false) => 0,
            Some(true) => ones,
            None => self.next() as u16 & ones,
        }
    }

    /// Returns the code that the analog-to-digital converter reads at an output.
    pub(crate) fn code_at_output(&mut self, channel: usize, code: u32) -> u32 {
        let Output {
            gain,
            offset,
            limit,
        } = self.outputs[channel];
        let range = 2 * u64::from(self.noise) + 1;
        let noise = (self.next() % range) as f64 - f64::from(self.noise);
        let code = f64::from(code) * gain + offset + noise;
        (code.round().clamp(0.0, 4095.0) as u32).min(limit)
    }

    /// Marsaglia's xorshift.
    fn next(&mut self) -> u64 {
        self.random = self.random.max(1);
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        self.random
    }
}
