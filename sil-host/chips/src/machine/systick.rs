//! The SysTick timer (ARMv7-M reference manual, section B3.3): counts down and raises its exception.

use crate::{Picoseconds, SECOND};

/// Registers of the timer.
#[derive(Clone, Debug, Default)]
pub(super) struct SysTick {
    control: u32,
    reload: u32,
    fires_at: Option<Picoseconds>,
    /// Whether the exception is pending.
    pub is_pending: bool,
}

impl SysTick {
    pub(super) fn read(&self, address: u32) -> u32 {
        match address & 0xf {
            0x0 => self.control,
            0x4 => self.reload,
            // The count is not modelled.
            _ => 0,
        }
    }

    pub(super) fn write(&mut self, address: u32, value: u32, core_hz: u64, now: Picoseconds) {
        match address & 0xf {
            0x0 => self.control = value & 7,
            0x4 => self.reload = value & 0x00ff_ffff,
            _ => {}
        }
        self.fires_at = (self.control & 1 != 0).then(|| now + self.period(core_hz));
    }

    fn period(&self, core_hz: u64) -> Picoseconds {
        // Without bit 2, an eighth of the processor's clock.
        let cycles = u64::from(self.reload) * if self.control & 4 == 0 { 8 } else { 1 };
        (u128::from(cycles) * u128::from(SECOND) / u128::from(core_hz.max(1))) as Picoseconds
    }

    /// Returns when the timer fires.
    pub(super) fn next_event(&self) -> Picoseconds {
        self.fires_at.unwrap_or(Picoseconds::MAX)
    }

    /// Fires if it is time.
    pub(super) fn advance(&mut self, core_hz: u64, now: Picoseconds) {
        if self.next_event() <= now {
            self.is_pending |= self.control & 2 != 0;
            self.fires_at = Some(now + self.period(core_hz).max(1));
        }
    }
}
