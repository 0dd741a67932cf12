//! Entry into exceptions and return from them (ARMv7-M reference manual, sections B1.5.6 and B1.5.8).

use super::{Chip, Machine};
use crate::protection::WRITE;
use crate::system_control::{Exception, HARD_FAULT};
use crate::unicorn::Register;

/// Return address of an exception whose frame holds floating-point registers.
const RETURN_TO_HANDLER: u32 = 0xffff_ffe1;
const RETURN_TO_THREAD: u32 = 0xffff_ffe9;

/// There is no memory at these addresses: a jump to them returns from an exception.
pub(super) const EXCEPTION_RETURN: u32 = 0xffff_ff00;

/// Number of words of such a frame.
const FRAME_WORDS: usize = 26;

impl<C: Chip> Machine<C> {
    /// Enters an exception, with floating-point registers in its frame.
    pub(super) fn enter(&mut self, exception: Exception, return_address: u32) {
        let unicorn = &mut self.unicorn;
        let stack_pointer = unicorn.get(Register::SP);
        let is_unaligned = stack_pointer & 4 != 0;
        let frame_at = (stack_pointer - 4 * FRAME_WORDS as u32) & !7;
        let mut status = unicorn.get(Register::XPSR) & !(1 << 9);
        status |= u32::from(is_unaligned) << 9 | 1 << 24;
        let mut frame = [0; FRAME_WORDS];
        for (n, register) in [0, 1, 2, 3, 12].into_iter().enumerate() {
            frame[n] = unicorn.get(Register::r(register));
        }
        frame[5] = unicorn.get(Register::LR);
        frame[6] = return_address;
        frame[7] = status;
        for n in 0..16 {
            frame[8 + n] = unicorn.get(Register::s(n as i32));
        }
        frame[24] = unicorn.get(Register::FPSCR);
        let bytes: Vec<u8> = frame.iter().flat_map(|it| it.to_le_bytes()).collect();
        let system = &unicorn.surroundings().system;
        let ends = [frame_at, frame_at + bytes.len() as u32 - 4];
        let is_permitted = ends.iter().all(|it| system.permits(*it) & WRITE != 0);
        let is_stored = is_permitted && unicorn.processor().write_memory(frame_at, &bytes);
        let core = unicorn.surroundings_mut();
        // Without room for a frame, the fault of its storing is taken instead (section B1.5.11).
        let exception = if is_stored {
            exception
        } else {
            core.system.fault_status |= if is_permitted { 1 << 12 } else { 1 << 4 };
            HARD_FAULT.min(exception)
        };
        // A delay by a defect: the same instructions take longer.
        if core.latency > 0 {
            let delay = u64::from(core.random()) % core.latency;
            core.now += delay;
            let hz = u128::from(core.chip.core_hz());
            core.cycles += (u128::from(delay) * hz / u128::from(crate::SECOND)) as u64;
        }
        let nested = !core.system.active.is_empty();
        core.system.enter(exception);
        core.is_dirty = true;
        core.conditional = 0;
        let mut vector = core.system.vector_table + 4 * exception as u32;
        if vector < C::FLASH.0 && !core.chip.ram_is_at_zero() {
            vector += C::FLASH.0;
        }
        assert!(
            vector >= C::RAM.0 || !core.chip.flash_is_stalled(core.now),
            "exception {exception} while the flash is busy"
        );
        let mut handler = [0; 4];
        unicorn.processor().read_memory(vector, &mut handler);
        unicorn.set(Register::SP, frame_at);
        unicorn.set(
            Register::LR,
            if nested {
                RETURN_TO_HANDLER
            } else {
                RETURN_TO_THREAD
            },
        );
        unicorn.set(Register::XPSR, 1 << 24);
        unicorn.set(Register::PC, u32::from_le_bytes(handler));
    }

    /// Returns from the innermost exception.
    pub(super) fn leave(&mut self) {
        let unicorn = &mut self.unicorn;
        let core = unicorn.surroundings_mut();
        core.system.leave();
        core.is_dirty = true;
        let frame_at = unicorn.get(Register::SP);
        let mut bytes = [0; 4 * FRAME_WORDS];
        unicorn.processor().read_memory(frame_at, &mut bytes);
        let word = |n: usize| {
            let bytes = &bytes[4 * n..4 * n + 4];
            u32::from_le_bytes(bytes.try_into().unwrap_or([0; 4]))
        };
        for (n, register) in [0, 1, 2, 3, 12].into_iter().enumerate() {
            unicorn.set(Register::r(register), word(n));
        }
        unicorn.set(Register::LR, word(5));
        for n in 0..16 {
            unicorn.set(Register::s(n as i32), word(8 + n));
        }
        unicorn.set(Register::FPSCR, word(24));
        let status = word(7);
        let padding = if status & 1 << 9 != 0 { 4 } else { 0 };
        unicorn.set(Register::SP, frame_at + 4 * FRAME_WORDS as u32 + padding);
        unicorn.set(Register::XPSR, status & !(1 << 9) & !0x1ff);
        unicorn.set(Register::FAULTMASK, 0);
        unicorn.set(Register::PC, word(6));
    }
}
