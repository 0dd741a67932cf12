//! What ends the program: every crash takes the torque off, is recorded, and resets the chip.

#![allow(unsafe_code)] // the frame of a hard fault

use cortex_m::peripheral::SCB;
use painleve_shared::black_box::Crash;

use crate::black_box;
use crate::board::Board;
use crate::stack;

/// Takes the torque off, records the crash and resets the chip.
pub fn reset<B: Board>(crash: Crash) -> ! {
    B::take_torque_off();
    black_box::note_crash(crash);
    SCB::sys_reset()
}

/// Stack that a handler needs which takes the torque off and records the crash, bytes.
pub const ROOM_BYTES: usize = 1024;

/// Returns what the processor has stored about a hard fault on the stack.
pub fn hard_fault(frame: *const u32) -> Crash {
    // Six words into the frame. Without room for a frame, the processor stored none.
    let [link_register, program_counter] = [5, 6].map(|word| frame.wrapping_add(word));
    if !stack::contains(frame) || !stack::contains(program_counter) {
        return Crash::StackOverflow;
    }
    // SAFETY: words of the stack; a register of the processor.
    unsafe {
        Crash::HardFault {
            program_counter: program_counter.read_volatile(),
            link_register: link_register.read_volatile(),
            status: (*SCB::PTR).cfsr.read(),
        }
    }
}

/// Declares the handlers of hard faults, of the non-maskable interrupt and of unexpected interrupts, among them that of a low supply, for a board.
#[macro_export]
macro_rules! crash_handlers {
    ($board:ty) => {
        use $crate::painleve_shared::black_box::Crash;

        // In assembly, because the stack may have no room left: the handler then begins again at its top, as nothing
        // returns to what was there.
        ::core::arch::global_asm!(
            ".section .text.HardFault, \"ax\", %progbits",
            ".global HardFault",
            ".type HardFault, %function",
            ".thumb_func",
            "HardFault:",
            "mrs r0, msp",
            "ldr r1, =_stack_end + {room}",
            "cmp r0, r1",
            "bhs 1f",
            "ldr r1, =_stack_start",
            "msr msp, r1",
            "1:",
            "b {handler}",
            ".ltorg",
            ".size HardFault, . - HardFault",
            room = const $crate::crash::ROOM_BYTES,
            handler = sym hard_fault,
        );

        /// Handles an instruction that cannot be executed, a bus that does not answer or an access that is not permitted.
        unsafe extern "C" fn hard_fault(frame: *const u32) -> ! {
            $crate::crash::reset::<$board>($crate::crash::hard_fault(frame))
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
