//! The stack. Its largest use is measured: the free part is painted at the start and inspected later.

#![allow(unsafe_code)] // reads and writes the stack below the program's own

use core::convert::Infallible;
use core::ptr::{addr_of, addr_of_mut, null_mut};
use core::sync::atomic::{AtomicBool, Ordering};

/// Pattern of untouched stack.
const PAINT: u32 = 0xdead_57ac;

/// Bytes left unpainted below the caller's stack pointer.
const MARGIN_BYTES: usize = 128;

unsafe extern "C" {
    /// Lowest address of the stack (cortex-m-rt).
    static mut _stack_end: u32;
    /// One past the highest address of the stack.
    static mut _stack_start: u32;
}

/// Returns whether a word belongs to the stack.
pub fn contains(word: *const u32) -> bool {
    (addr_of!(_stack_end)..addr_of!(_stack_start)).contains(&word)
}

/// Paints the unused part of the stack. Must be called first.
pub fn paint() {
    let mut word = addr_of_mut!(_stack_end);
    let top = (cortex_m::register::msp::read() as usize - MARGIN_BYTES) as *mut u32;
    while word < top {
        // SAFETY: nothing uses the memory between the end of the stack and the margin below the stack
        // pointer; both ends are aligned to words.
        unsafe {
            word.write_volatile(PAINT);
            word = word.add(1);
        }
    }
}

/// Whether the start has left the stack.
static IS_FREE: AtomicBool = AtomicBool::new(false);

/// Returns whether what the start needed of the stack is free again.
pub fn is_free() -> bool {
    IS_FREE.load(Ordering::Relaxed)
}

/// Runs `idle` with an empty stack: what the start has left there is never used again, and the tasks that interrupt `idle` have
/// the whole stack.
///
/// # Safety
/// `idle` owns or refers to static values only, and nothing else refers to what is on the stack.
pub unsafe fn empty_for<F: FnOnce() -> Infallible>(idle: F) -> ! {
    // What `idle` holds crosses in a register: the new stack may overwrite the place where it was.
    const { assert!(size_of::<F>() <= 4 && align_of::<F>() <= 4) };
    let mut held = null_mut::<()>();
    // SAFETY: the place is large enough and aligned. The code never returns, so that the whole stack is free.
    unsafe {
        (&raw mut held).cast::<F>().write(idle);
        core::arch::asm!(
            "msr msp, {top}",
            "bx {resume}",
            top = in(reg) addr_of!(_stack_start),
            resume = in(reg) resume::<F> as extern "C" fn(*mut ()) -> !,
            in("r0") held,
            options(noreturn),
        )
    }
}

extern "C" fn resume<F: FnOnce() -> Infallible>(held: *mut ()) -> ! {
    // SAFETY: `empty_for` has written it, and does not use it again.
    let idle = unsafe { (&raw const held).cast::<F>().read() };
    IS_FREE.store(true, Ordering::Relaxed);
    match idle() {}
}

/// Returns the largest stack use since [`paint`], bytes.
pub fn high_water_bytes() -> u32 {
    let mut word = addr_of_mut!(_stack_end);
    let top = addr_of_mut!(_stack_start);
    // SAFETY: reads the words of the stack; a value that changes during the read does no harm.
    while word < top && unsafe { word.read_volatile() } == PAINT {
        word = word.wrapping_add(1);
    }
    (top as usize - word as usize) as u32
}
