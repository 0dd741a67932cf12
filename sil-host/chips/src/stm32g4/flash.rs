//! The flash's registers and the pages that keep configurations (RM0440, chapter FLASH).

use crate::stm32::{CONTROL_KEYS, FlashSlots, OPTION_KEYS, Power, take_key};
use crate::{MICROSECOND, MILLISECOND, Picoseconds};

/// Bits of the access control register.
const DATA_CACHE: u32 = 1 << 10;
const DATA_CACHE_RESET: u32 = 1 << 12;

/// Bits of the control register.
const LOCK: u32 = 1 << 31;
const OPTION_LOCK: u32 = 1 << 30;
const START: u32 = 1 << 16;
const OPTION_START: u32 = 1 << 17;
const SECOND_BANK: u32 = 1 << 11;
const PAGE_ERASE: u32 = 2;
const PROGRAM: u32 = 1;

/// Error of a double word that is not erased when it is written (PROGERR).
const NOT_ERASED: u32 = 1 << 3;

/// Option bytes of a new chip, and those with the highest brown-out level.
const NEW_OPTIONS: u32 = 0xffef_f8aa;
const USUAL_OPTIONS: u32 = 0xffef_fcaa;

/// Longest programming of the option bytes: the manual gives no time. A page takes up to 25 ms to erase, and both banks
/// have one.
const OPTION_TIME: Picoseconds = 2 * ERASURE;

/// Longest erasure of a page.
const ERASURE: Picoseconds = 25 * MILLISECOND;

/// Longest programming of a double word; it usually takes 82 µs.
const DOUBLE_WORD_TIME: Picoseconds = 91 * MICROSECOND;

/// First page of the slots in the second bank, and its length.
const FIRST_PAGE: u32 = 126;
const PAGE: usize = 2 << 10;

/// Length of the slots.
pub(super) const SLOTS: usize = 2 * PAGE;

/// Registers and slots.
#[derive(Clone)]
pub(super) struct Flash {
    registers: [u32; 32],
    /// Number of keys that have come for the control register and for the option bytes.
    keys: [usize; 2],
    pub slots: FlashSlots,
    /// Option bytes as written to their register and as programmed. The register gives those that were loaded when
    /// power came up.
    written_options: u32,
    programmed_options: u32,
    /// Time until which the option bytes are programmed.
    options_busy_until: Picoseconds,
    /// Whether the data cache may hold what the slots no longer do.
    is_cache_stale: bool,
    /// The first half of a double word that is written.
    half: Option<(u32, u32)>,
    /// Errors in the status register.
    errors: u32,
    /// Whether a word that cannot be corrected has been read, and its interrupt is pending.
    is_uncorrectable: bool,
    has_nmi: bool,
}

impl Flash {
    /// Creates an erased flash.
    pub fn new() -> Self {
        let mut registers = [0; 32];
        registers[8] = USUAL_OPTIONS;
        // No part of the flash is protected against reading as data, or as secure.
        registers[9] = 0xffff_0000;
        registers[10] = 0x0fff_0000;
        registers[28] = 0xff00_ff00;
        Self {
            registers,
            keys: [0; 2],
            slots: FlashSlots::new(SLOTS, ERASURE),
            written_options: USUAL_OPTIONS,
            programmed_options: USUAL_OPTIONS,
            options_busy_until: 0,
            is_cache_stale: false,
            half: None,
            errors: 0,
            is_uncorrectable: false,
            has_nmi: false,
        }
    }

    /// Gives the chip the option bytes of a new one.
    pub fn set_new_options(&mut self) {
        self.programmed_options = NEW_OPTIONS;
        self.load_options();
    }

    /// Changes bits of the option bytes, as a programmer would.
    pub fn flip_options(&mut self, bits: u32) {
        self.programmed_options ^= bits;
        self.load_options();
    }

    /// Loads the option bytes, as when power comes up.
    pub fn load_options(&mut self) {
        self.registers[8] = self.programmed_options;
    }

    fn is_busy(&self, now: Picoseconds) -> bool {
        self.slots.is_busy(now) || now < self.options_busy_until
    }

    /// Resets the registers; option bytes and contents stay.
    pub fn reset(&mut self, now: Picoseconds) {
        assert!(
            now >= self.options_busy_until,
            "a reset spoils the option bytes"
        );
        self.registers[0] = 0x600;
        self.registers[5] = 0xc000_0000;
        self.keys = [0; 2];
        self.slots.reset(now);
        self.is_cache_stale = false;
        self.half = None;
        self.errors = 0;
        self.is_uncorrectable = false;
        self.has_nmi = false;
    }

    /// Returns the wait states of a read.
    pub fn wait_states(&self) -> u64 {
        u64::from(self.registers[0] & 15)
    }

    /// Returns the level of the brown-out reset.
    pub fn brown_out_level(&self) -> usize {
        (self.registers[8] >> 8 & 7) as usize
    }

    /// Takes a pending non-maskable interrupt.
    pub fn take_nmi(&mut self) -> bool {
        std::mem::take(&mut self.has_nmi)
    }

    /// Returns the value of a register.
    pub fn read(&self, offset: u32, now: Picoseconds) -> u32 {
        match offset {
            0x10 => u32::from(self.is_busy(now)) << 16 | self.errors,
            0x18 => u32::from(self.is_uncorrectable) << 31,
            _ => self.registers[((offset / 4) & 31) as usize],
        }
    }

    /// Stores to a register. Handles the keys that unlock the option bytes, which hold the brown-out level.
    pub fn write(&mut self, offset: u32, value: u32, now: Picoseconds) -> Power {
        let is_open = self.registers[5] & LOCK == 0;
        match offset {
            0x08 if take_key(CONTROL_KEYS, &mut self.keys[0], value) => self.registers[5] &= !LOCK,
            0x0c => {
                assert!(is_open, "a key for the option bytes of a locked flash");
                if take_key(OPTION_KEYS, &mut self.keys[1], value) {
                    self.registers[5] &= !OPTION_LOCK;
                }
            }
            0x20 if self.registers[5] & OPTION_LOCK == 0 => self.written_options = value,
            0x00 => self.control_access(value),
            0x10 => self.errors &= !value,
            0x14 if is_open => return self.control(value, now),
            0x18 if value & 1 << 31 != 0 => self.is_uncorrectable = false,
            _ => {}
        }
        Power::On
    }

    /// Stores to the access control register. The data cache is reset while it is off, and before it is on again after a
    /// change of the slots.
    fn control_access(&mut self, value: u32) {
        if value & DATA_CACHE_RESET != 0 {
            assert_eq!(self.registers[0] & DATA_CACHE, 0, "the data cache is on");
            self.is_cache_stale = false;
        }
        assert!(value & DATA_CACHE == 0 || !self.is_cache_stale);
        self.registers[0] = value;
    }

    /// Notes a change of the slots, during which the data cache must be off (ES0430, section 2.2.2).
    fn note_change(&mut self) {
        assert_eq!(self.registers[0] & DATA_CACHE, 0, "the data cache is on");
        self.is_cache_stale = true;
    }

    fn control(&mut self, value: u32, now: Picoseconds) -> Power {
        assert!(!self.is_busy(now), "the flash is busy");
        // Only keys open the option bytes, and a lock of the register locks them, too.
        let locks = if value & LOCK == 0 {
            self.registers[5] & OPTION_LOCK
        } else {
            OPTION_LOCK
        };
        self.registers[5] = value & !(START | OPTION_START) | locks;
        if value & OPTION_START != 0 && self.registers[5] & OPTION_LOCK == 0 {
            self.programmed_options = self.written_options;
            self.options_busy_until = now + OPTION_TIME;
        }
        if value & START == 0 || value & PAGE_ERASE == 0 {
            return Power::On;
        }
        assert!(value & SECOND_BANK != 0, "the program's bank");
        self.note_change();
        let slot = ((value >> 3 & 0x7f) - FIRST_PAGE) as usize;
        self.slots.erase(slot * PAGE, PAGE, now)
    }

    /// Returns a word of the slots.
    pub fn load(&mut self, offset: u32, now: Picoseconds) -> u32 {
        assert!(!self.slots.is_busy(now), "the bank is busy");
        if self.slots.is_uncorrectable(offset) && !self.is_uncorrectable {
            self.is_uncorrectable = true;
            self.has_nmi = true;
        }
        self.slots.word(offset)
    }

    /// Stores a word to the slots: two of them write a double word, which must be erased.
    pub fn store(&mut self, offset: u32, word: u32, size: u32, now: Picoseconds) -> Power {
        assert!(!self.slots.is_busy(now), "the bank is busy");
        assert_eq!(size, 4, "the width of a store");
        assert_eq!(self.registers[5] & (LOCK | PROGRAM), PROGRAM);
        self.note_change();
        let Some((first, low)) = self.half.take() else {
            assert_eq!(offset % 8, 0);
            self.half = Some((offset, word));
            return Power::On;
        };
        assert_eq!(offset, first + 4);
        let is_erased = [first, offset].map(|it| self.slots.word(it)) == [u32::MAX; 2];
        if !is_erased {
            self.errors |= NOT_ERASED;
            return Power::On;
        }
        let unit = (u64::from(word) << 32 | u64::from(low)).to_le_bytes();
        self.slots
            .program(first as usize, &unit, now + DOUBLE_WORD_TIME)
    }
}
