//! A Cortex-M whose system timer starts the ticks.

#![no_std]
#![no_main]

use core::sync::atomic::Ordering::Relaxed;

use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::{entry, exception};
use own_firmware::{Arm, TICKS};
use painleve_firmware::Configuration;
use painleve_firmware::drive::{ControlTask, Drive, FrameSource};
use panic_halt as _;

/// Clock of the core, to which start-up code sets the chip, Hz.
const CORE_HZ: f32 = 64e6;

#[entry]
fn main() -> ! {
    let configuration = Configuration::default();
    let mut task: ControlTask<Arm> = ControlTask::new(Arm::default());
    let accepted = task.configure(&configuration, FrameSource::Sensors);
    if let (Ok(()), Some(mut core)) = (accepted, cortex_m::Peripherals::take()) {
        // After a reset the timer may count another clock, from any value.
        core.SYST.set_clock_source(SystClkSource::Core);
        core.SYST
            .set_reload((CORE_HZ / configuration.tick_hz) as u32 - 1);
        core.SYST.clear_current();
        core.SYST.enable_interrupt();
        core.SYST.enable_counter();
    }
    loop {
        while !task.drive().next_tick_is_due() {}
        task.tick(); // sample, answer, output, update
    }
}

#[exception]
fn SysTick() {
    TICKS.store(TICKS.load(Relaxed).wrapping_add(1), Relaxed);
}
