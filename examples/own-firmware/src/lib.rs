//! The arm on a board of one's own. Nothing here depends on the chip: drivers and timer fill the first five values, and
//! drivers put out the last two. One interrupt must fill all values of a sample.

#![no_std]

#[cfg(test)]
mod tests;

use core::sync::atomic::{AtomicBool, AtomicI32, AtomicU32, Ordering::*, fence};

use painleve_firmware::counts::{EncoderCounts, ForceCounts};
use painleve_firmware::drive::Drive;
use painleve_firmware::frame::{ActuatorFrame, DigitalInputs, SensorFrame};

pub static TICKS: AtomicU32 = AtomicU32::new(0);
/// Raised when all readings of a sample are in place.
pub static SAMPLES: AtomicU32 = AtomicU32::new(0);
pub static ENCODERS: [AtomicU32; 2] = [const { AtomicU32::new(0) }; 2];
pub static FORCES: [AtomicI32; 2] = [const { AtomicI32::new(0) }; 2];
pub static INPUTS: AtomicU32 = AtomicU32::new(0);
pub static TORQUES: [AtomicI32; 2] = [const { AtomicI32::new(0) }; 2];
pub static STAGES_ON: AtomicBool = AtomicBool::new(false);

#[derive(Default)]
pub struct Arm {
    frame: SensorFrame,
}

impl Drive for Arm {
    fn begin_tick(&mut self) {
        self.frame.tick = TICKS.load(Relaxed);
    }
    fn sample(&mut self) -> Option<SensorFrame> {
        let mut frame = self.frame;
        frame.sequence = SAMPLES.load(Acquire);
        frame.joints = [0, 1].map(|joint: usize| EncoderCounts(ENCODERS[joint].load(Relaxed)));
        frame.normal_force = ForceCounts(FORCES[0].load(Relaxed));
        frame.tangential_force = ForceCounts(FORCES[1].load(Relaxed));
        frame.inputs = DigitalInputs(INPUTS.load(Relaxed));
        fence(Acquire);
        // If another sample has come meanwhile, the next tick has it whole.
        let is_whole = SAMPLES.load(Relaxed) == frame.sequence;
        let before = core::mem::replace(&mut self.frame, frame).sequence;
        (is_whole && frame.sequence != before).then_some(frame)
    }
    fn actuate(&mut self, answer: &ActuatorFrame) {
        TORQUES[0].store(answer.torques[0].0, Relaxed);
        TORQUES[1].store(answer.torques[1].0, Relaxed);
        let state = answer.supervisor_state();
        STAGES_ON.store(state.is_some_and(|state| state.drives()), Relaxed);
    }
    fn next_tick_is_due(&self) -> bool {
        TICKS.load(Relaxed) != self.frame.tick
    }
    fn stopwatch(&self) -> u32 {
        0 // times nothing: it only serves statistics
    }
}
