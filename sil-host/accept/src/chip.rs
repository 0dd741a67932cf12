//! What is known of the chips and of the bench: registers, option bytes, wires.

/// Address of the device's identification (DBGMCU_IDCODE), the same on both families.
pub const IDENTIFICATION: u32 = 0xe004_2000;

/// Address of the processor's identification (CPUID).
pub const PROCESSOR: u32 = 0xe000_ed00;

/// Identification of a Cortex-M4, without its revision.
pub const CORTEX_M4: u32 = 0x410f_c240;

/// Reload, count and control of the SysTick timer, in the order in which they are written.
pub const SYSTICK: [u32; 3] = [0xe000_e014, 0xe000_e018, 0xe000_e010];

/// Registers of the control timer, TIM2.
pub mod timer {
    /// Control: bit 0 lets it count.
    pub const CONTROL: u32 = 0x4000_0000;
    /// Flags: bit 1 is a capture that has not been read.
    pub const FLAGS: u32 = 0x4000_0010;
    /// Modes of the first two channels.
    pub const MODES: u32 = 0x4000_0018;
    /// Edges of the channels.
    pub const EDGES: u32 = 0x4000_0020;
    /// The count since the last update.
    pub const COUNT: u32 = 0x4000_0024;
    /// Its largest value.
    pub const RELOAD: u32 = 0x4000_002c;
    /// The first channel's capture.
    pub const CAPTURE: u32 = 0x4000_0034;
}

/// Counter of the window watchdog.
pub const WINDOW: u32 = 0x4000_2c00;

/// Key of the independent watchdog that feeds it.
pub const FEED_INDEPENDENT: (u32, u32) = (0x4000_3000, 0xaaaa);

/// Prescaler and reload of the independent watchdog.
pub const INDEPENDENT: [u32; 2] = [0x4000_3004, 0x4000_3008];

/// Offsets of a port's registers.
pub mod port {
    /// Modes, two bits a pin.
    pub const MODES: u32 = 0x00;
    /// Pull resistors, two bits a pin.
    pub const PULLS: u32 = 0x0c;
    /// Levels of the pins.
    pub const LEVELS: u32 = 0x10;
    /// Levels of outputs.
    pub const OUTPUTS: u32 = 0x14;
    /// Functions of the lower pins, four bits each.
    pub const FUNCTIONS: u32 = 0x20;
}

/// Numbers of the pins of port C that drive inputs.
pub mod driver {
    /// ENABLE, PC0.
    pub const ENABLE: u32 = 6;
    /// RESET, PC1.
    pub const RESET: u32 = 7;
    /// READY, PC2.
    pub const READY: u32 = 8;
    /// The encoders' line to the board, PB4.
    pub const ENCODERS: u32 = 9;
    /// The force cells' line to the board, PB14.
    pub const FORCE_CELLS: u32 = 10;
    /// Observes the enable of the torque stages, PB0.
    pub const STAGES: u32 = 11;
}

/// The loop-back wires, from → to, and what they show.
pub const WIRES: [(&str, &str, &str); 7] = [
    (
        "PB6",
        "PA0",
        "start of every tick, at the select of encoder 1",
    ),
    ("PB0", "PC11", "enable of the torque stages"),
    ("PC6", "PC0", "ENABLE"),
    ("PC7", "PC1", "RESET"),
    ("PC8", "PC2", "READY"),
    ("PC9", "PB4", "line of the encoders"),
    ("PC10", "PB14", "line of the force cells"),
];

/// A field of the option bytes.
#[derive(Clone, Copy, Debug)]
pub struct OptionField {
    /// Its name in the manual, and its meaning.
    pub name: &'static str,
    /// Bits of the register.
    pub mask: u32,
    /// Expected value, in place.
    pub expected: u32,
}

/// A chip that has an image.
#[derive(Debug)]
pub struct Chip {
    /// Name.
    pub name: &'static str,
    /// Its device number.
    pub device: u32,
    /// Address of the word with the size of its flash, KiB.
    pub flash_size_address: u32,
    /// Position of the size in the word, bits.
    pub flash_size_shift: u32,
    /// Expected size of its flash, KiB.
    pub flash_kib: u32,
    /// Address of its unique number, three words.
    pub unique: u32,
    /// Expected clock of the processor, Hz.
    pub core_hz: f64,
    /// Expected clock of the control timer, Hz.
    pub timer_hz: f64,
    /// Lowest and highest frequency of the independent watchdog's oscillator, Hz.
    pub oscillator_hz: [f64; 2],
    /// Most cycles of answer and update: the proved bound.
    pub tick_cycles: u32,
    /// Median of the cycles of answer and update on the emulated chip.
    pub usual_tick_cycles: u32,
    /// Most cycles by which a tick begins late: the proved bound.
    pub release_cycles: u32,
    /// Longest time to store a configuration, s: an erasure by the data sheet, and the writing.
    pub store_s: f64,
    /// Usual time to write a configuration after the erasure, s.
    pub writing_s: f64,
    /// Addresses of ports A, B and C.
    pub ports: [u32; 3],
    /// Both codes of the digital-to-analog converter, and those at its outputs.
    pub codes: u32,
    /// Register of the option bytes.
    pub option_register: u32,
    /// Fields of the option bytes.
    pub options: &'static [OptionField],
    /// The analog-to-digital converter.
    pub converter: Converter,
    /// Start of the memory with the log's buffer.
    pub variables_address: u32,
    /// Length of this memory.
    pub variables_bytes: u32,
}

/// Stores that prepare an analog-to-digital converter, and its registers.
#[derive(Debug)]
pub struct Converter {
    /// Addresses and words, in their order; each takes effect before the next arrives.
    pub preparation: &'static [(u32, u32)],
    /// Register that selects a channel.
    pub selection_address: u32,
    /// Words for it that select PA4 and PA5.
    pub selections: [u32; 2],
    /// Register that starts a conversion.
    pub start_address: u32,
    /// Word for it that does.
    pub start: u32,
    /// The result.
    pub result: u32,
}

/// The chips that have an image.
pub static CHIPS: [Chip; 2] = [
    Chip {
        name: "STM32F405",
        device: 0x413,
        flash_size_address: 0x1fff_7a20,
        flash_size_shift: 16,
        flash_kib: 1024,
        unique: 0x1fff_7a10,
        core_hz: 168e6,
        timer_hz: 84e6,
        oscillator_hz: [17e3, 47e3],
        tick_cycles: 8000,
        usual_tick_cycles: 3778,
        release_cycles: 1680,
        // A sector of 128 KiB: up to 4 s at any width of a store.
        store_s: 4.5,
        // 400 bytes, in words of 4 that take 16 µs each.
        writing_s: 1.6e-3,
        ports: [0x4002_0000, 0x4002_0400, 0x4002_0800],
        codes: 0x4000_7420,
        option_register: 0x4002_3c14,
        options: &[
            OptionField {
                name: "BOR_LEV: brown-out reset at the highest level",
                mask: 3 << 2,
                expected: 0,
            },
            OptionField {
                name: "WDG_SW: the program starts the independent watchdog",
                mask: 1 << 5,
                expected: 1 << 5,
            },
            OptionField {
                name: "RDP: no read protection, so that it can be flashed again",
                mask: 0xff << 8,
                expected: 0xaa << 8,
            },
            OptionField {
                name: "nWRP: no sector is protected against writing",
                mask: 0xfff << 16,
                expected: 0xfff << 16,
            },
        ],
        converter: Converter {
            // Clock of ADC1; 21 MHz; 480 cycles a sample; on.
            preparation: &[
                (0x4002_3844, 1 << 8),
                (0x4001_2304, 1 << 16),
                (0x4001_2010, 0x0003_f000),
                (0x4001_2008, 1),
            ],
            selection_address: 0x4001_2034,
            selections: [4, 5],
            start_address: 0x4001_2008,
            start: 1 << 30 | 1,
            result: 0x4001_204c,
        },
        variables_address: 0x2001_da80,
        variables_bytes: 9600,
    },
    Chip {
        name: "STM32G474",
        device: 0x469,
        flash_size_address: 0x1fff_75e0,
        flash_size_shift: 0,
        flash_kib: 512,
        unique: 0x1fff_7590,
        core_hz: 170e6,
        timer_hz: 170e6,
        oscillator_hz: [29.5e3, 34e3],
        tick_cycles: 17_300,
        usual_tick_cycles: 3770,
        release_cycles: 2550,
        store_s: 0.2,
        // 400 bytes, in double words of 8 that take 82 µs each.
        writing_s: 4.1e-3,
        ports: [0x4800_0000, 0x4800_0400, 0x4800_0800],
        codes: 0x5000_0820,
        option_register: 0x4002_2020,
        options: &[
            OptionField {
                name: "BOR_LEV: brown-out reset at the highest level; takes effect when the power comes up again",
                mask: 7 << 8,
                expected: 4 << 8,
            },
            OptionField {
                name: "IWDG_SW, WWDG_SW: the program starts the watchdogs",
                mask: 1 << 16 | 1 << 19,
                expected: 1 << 16 | 1 << 19,
            },
            OptionField {
                name: "RDP: no read protection, so that it can be flashed again",
                mask: 0xff,
                expected: 0xaa,
            },
            OptionField {
                name: "DBANK: two banks, so that the program runs while a configuration is written",
                mask: 1 << 22,
                expected: 1 << 22,
            },
            OptionField {
                name: "BFB2: starts from the first bank",
                mask: 1 << 20,
                expected: 0,
            },
        ],
        converter: Converter {
            // Clock of ADC1 and ADC2; 42.5 MHz; ADC2: out of deep power-down, regulator, calibration, on; 640.5 cycles a
            // sample.
            preparation: &[
                (0x4002_104c, 1 << 13),
                (0x5000_0308, 3 << 16),
                (0x5000_0108, 0),
                (0x5000_0108, 1 << 28),
                (0x5000_0108, 1 << 31 | 1 << 28),
                (0x5000_0108, 1 << 28 | 1),
                (0x5000_0118, 7 << 9 | 7 << 21),
            ],
            selection_address: 0x5000_0130,
            selections: [17 << 6, 13 << 6],
            start_address: 0x5000_0108,
            start: 1 << 28 | 1 << 2 | 1,
            result: 0x5000_0140,
        },
        variables_address: 0x2000_4000,
        variables_bytes: 16 << 10,
    },
];

impl Chip {
    /// Returns the chip of a device's identification.
    pub fn of(identification: u32) -> Option<&'static Self> {
        CHIPS.iter().find(|it| it.device == identification & 0xfff)
    }
}

#[cfg(test)]
mod tests {
    use super::{CHIPS, WIRES};

    #[test]
    fn the_proved_bounds_are_those_of_the_budget() {
        let budget: serde_json::Value =
            serde_json::from_str(include_str!("../../../tests/budget.json")).expect("JSON");
        for (chip, image) in CHIPS.iter().zip(["painleve-f405", "painleve-g474"]) {
            let proved = &budget["images"][image]["bound_cycles"];
            assert_eq!(proved["tick"], chip.tick_cycles, "{image}");
            assert_eq!(proved["release"], chip.release_cycles, "{image}");
        }
    }

    /// Every wire is a level line, with the name of a pin beside each end.
    #[test]
    fn the_drawing_shows_every_wire_between_its_pins() {
        let drawing = include_str!("../../../docs/images/wiring-bare-board.svg");
        let drawn: Vec<&str> = drawing.split("<path class=\"wire\"").skip(1).collect();
        assert_eq!(drawn.len(), WIRES.len());
        for (wire, (from, to, _)) in drawn.iter().zip(WIRES) {
            let y = wire
                .split("d=\"M120 ")
                .nth(1)
                .and_then(|it| it.split('H').next());
            let y: f64 = y.and_then(|it| it.parse().ok()).expect("a level line");
            for (x, anchor, pin) in [(112, "end", from), (588, "start", to)] {
                let (x, y) = (x, y + 5.5);
                let name = format!("x=\"{x}\" y=\"{y}\" text-anchor=\"{anchor}\">{pin}<");
                assert!(wire.contains(&name), "{from} to {to}: {name}");
            }
        }
    }
}
