//! Defects that can be built into a bare board.

use painleve_chips::MICROSECOND;
use painleve_flash_image::bare::{BareBench, LINES, OBSERVER};
use painleve_flash_image::board::{BoardChip, ENABLE, RESET, STAGES_READY};

use super::port::{Disturbances, EmulatedPort};

/// One defect of a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Defect {
    OtherChip,
    SmallerFlash,
    CrystalOffFrequency,
    SlotProtected,
    ReadProtected,
    SlowFlash,
    FlippedConstant,
    NoiseToBoard,
    NoiseToHost,
    LostBytes,
    FirstOutputDead,
    SecondOutputLoaded,
    EnableStuckHigh,
    ResetOpen,
    ReadyStuckLow,
    StagesStuckHigh,
    EncoderLineStuckHigh,
    ForceLineOpen,
    LateInterrupts,
    SelectOpen,
    WindowWatchdogDead,
    WindowWatchdogSlow,
    IndependentWatchdogDead,
    OscillatorTooFast,
    FlashBitStuck,
    ErasesBothSlots,
    LogDead,
}

/// The line's own step, and those after it, in which single messages are missing.
const ON_THE_LINE: &[&str] = &[
    "line",
    "ticks",
    "converter",
    "enable",
    "sensors",
    "release",
    "watchdogs",
    "flash",
    "log",
];

impl Defect {
    /// Every defect, with the steps that find it: one looks for it, others may rely on the same part.
    pub const ALL: &[(Self, &[&str])] = &[
        (Self::OtherChip, &["identity"]),
        (Self::SmallerFlash, &["identity"]),
        (Self::CrystalOffFrequency, &["clock"]),
        (Self::SlotProtected, &["options", "flash"]),
        (Self::ReadProtected, &["options"]),
        (Self::SlowFlash, &["ticks", "flash", "log"]),
        (Self::FlippedConstant, &["ticks"]),
        (Self::NoiseToBoard, ON_THE_LINE),
        (Self::NoiseToHost, ON_THE_LINE),
        (Self::LostBytes, ON_THE_LINE),
        (Self::FirstOutputDead, &["converter"]),
        (Self::SecondOutputLoaded, &["converter"]),
        (Self::EnableStuckHigh, &["enable"]),
        (Self::ResetOpen, &["enable"]),
        (Self::ReadyStuckLow, &["enable"]),
        (Self::StagesStuckHigh, &["enable"]),
        (Self::EncoderLineStuckHigh, &["sensors", "release"]),
        (Self::ForceLineOpen, &["sensors"]),
        (Self::LateInterrupts, &["release"]),
        (Self::SelectOpen, &["release"]),
        (Self::WindowWatchdogDead, &["watchdogs"]),
        (Self::WindowWatchdogSlow, &["watchdogs"]),
        (Self::IndependentWatchdogDead, &["watchdogs"]),
        (Self::OscillatorTooFast, &["watchdogs"]),
        (Self::FlashBitStuck, &["flash"]),
        (Self::ErasesBothSlots, &["flash"]),
        (Self::LogDead, &["log"]),
    ];

    /// Builds the defect into what is on the pins.
    pub fn build_into_bench(self, bench: &mut BareBench) {
        match self {
            Self::FirstOutputDead => bench.outputs[0].gain = 0.0,
            // The green LED of a NUCLEO board at PA5.
            Self::SecondOutputLoaded => bench.outputs[1].limit = 2600,
            Self::EnableStuckHigh => bench.stuck.push((ENABLE, true)),
            Self::ResetOpen => bench.open.push(RESET),
            Self::ReadyStuckLow => bench.stuck.push((STAGES_READY, false)),
            Self::StagesStuckHigh => bench.stuck.push((OBSERVER, true)),
            Self::EncoderLineStuckHigh => bench.stuck.push((LINES[0], true)),
            Self::ForceLineOpen => bench.open.push(LINES[1]),
            Self::SelectOpen => bench.open.push((0, 0)),
            _ => {}
        }
    }

    /// Builds the defect into the chip, or into its line.
    pub fn build_into<C: BoardChip>(self, port: &mut EmulatedPort<C>) {
        let machine = &mut port.board.machine;
        let chip = machine.chip_mut();
        match self {
            Self::OtherChip => chip.individual_mut().identification = 0x1000_0423,
            Self::SmallerFlash => chip.individual_mut().flash_kib /= 2,
            // A ceramic resonator.
            Self::CrystalOffFrequency => chip.detune_crystal(-8000),
            Self::SlotProtected => chip.flip_options(C::SLOT_OPTION),
            Self::ReadProtected => chip.flip_options(C::READ_OPTION),
            Self::SlowFlash => machine.set_cycles_per_instruction(6),
            Self::FlippedConstant => {
                // A coefficient of the sine.
                let places = machine.flip_in_flash((-1.666_665_5e-1_f32).to_bits(), 14);
                assert!(places > 0);
            }
            Self::NoiseToBoard => {
                port.to_board = Disturbances {
                    flips: 5000,
                    losses: 0,
                };
            }
            Self::NoiseToHost => {
                port.to_host = Disturbances {
                    flips: 5000,
                    losses: 0,
                };
            }
            Self::LostBytes => {
                port.to_board = Disturbances {
                    flips: 0,
                    losses: 5000,
                };
            }
            Self::LateInterrupts => machine.set_latency(15 * MICROSECOND),
            Self::WindowWatchdogDead => chip.watchdogs_mut().1.slowness = 0,
            Self::WindowWatchdogSlow => chip.watchdogs_mut().1.slowness = 2,
            Self::IndependentWatchdogDead => chip.watchdogs_mut().0.is_dead = true,
            Self::OscillatorTooFast => {
                let watchdog = chip.watchdogs_mut().0;
                watchdog.oscillator_hz = C::OSCILLATOR_HZ[2] * 5 / 4;
            }
            Self::FlashBitStuck => chip.slots_mut().has_stuck_bit = true,
            Self::ErasesBothSlots => chip.slots_mut().erases_both = true,
            Self::LogDead => {
                // The mark by which a debug probe finds the log's buffer.
                let places = machine.flip_in_flash(u32::from_le_bytes(*b"SEGG"), 0);
                assert!(places > 0);
            }
            _ => {}
        }
    }
}
