//! What ends the program: every crash takes the torque off, is recorded, and resets the chip.

use cortex_m::peripheral::SCB;
use painleve_shared::black_box::Crash;

use crate::black_box;
use crate::board::Board;

/// Takes the torque off, records the crash and resets the chip.
pub fn reset<B: Board>(crash: Crash) -> ! {
    B::take_torque_off();
    black_box::note_crash(crash);
    SCB::sys_reset()
}

/// Declares the handlers of hard faults, of the non-maskable interrupt and of unexpected interrupts, among them that of a low supply, for a board.
#[macro_export]
macro_rules! crash_handlers {
    ($board:ty) => {
        use $crate::painleve_shared::black_box::Crash;

        /// Handles an instruction that cannot be executed, a bus that does not answer or a stack overflow.
        #[::cortex_m_rt::exception]
        unsafe fn HardFault(frame: &::cortex_m_rt::ExceptionFrame) -> ! {
            // SAFETY: reads a register of the processor.
            let status = unsafe { (*$crate::cortex_m::peripheral::SCB::PTR).cfsr.read() };
            $crate::crash::reset::<$board>(Crash::HardFault {
                program_counter: frame.pc(),
                link_register: frame.lr(),
                status,
            })
        }

        /// Handles a crystal failure, on which the chip continues on its internal oscillator, and a faulty word of
        /// the configuration's memory.
        #[::cortex_m_rt::exception]
        unsafe fn NonMaskableInt() {
            if !<$board as $crate::board::Board>::take_memory_fault() {
                $crate::crash::reset::<$board>(Crash::Clock)
            }
        }

        /// Handles low supply voltage, or an interrupt that no peripheral in use can have raised.
        #[::cortex_m_rt::exception]
        unsafe fn DefaultHandler(number: i16) -> ! {
            $crate::crash::reset::<$board>(Crash::Interrupt { number })
        }
    };
}
