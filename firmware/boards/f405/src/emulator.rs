//! This image under QEMU, whose `netduinoplus2` has this chip: the very bytes that are flashed.
//!
//! QEMU 7.2 models the timers, the serial port and the SPI, but not the following. What the image then does is decided at
//! its start, by what the registers say, and not when it is built: what is tested here is then what is flashed.
//!
//! | not modelled | sign | the image |
//! |---|---|---|
//! | clocks | RCC_CR is 0: no oscillator is on, and yet the processor executes | starts no clock; timers count nanoseconds |
//! | cycle counter | the same | times ticks with TIM5 |
//! | DMA | a number stored in its register is not there | moves bytes in the port's interrupt (`uart_dma`) |
//! | mapping of memory | – | finds the program at 0x400 of the flash as well (`memory.x`) |
//! | flash registers, watchdogs, converter, pins | – | goes on: they read 0 |
//! | erased flash, which reads 0 instead of 0xff | – | finds no stored configuration |
//!
//! With descriptors 100 and 101 for the emulator, the link is semihosting on these two pipes. The virtual clock stands still
//! during a semihosting call, so that a run under `-icount` is deterministic to the instruction, however long the
//! host takes.

#![allow(unsafe_code)] // the log's buffer, which its crate keeps for a debugger

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::DWT;
use painleve_image::dma_serial::DmaPort;
use painleve_image::port::Port;
use painleve_stm32f4::uart_dma::UartDma;
use semihosting::fd::{BorrowedFd, RawFd};
use semihosting::sys::arm_compat::{OpenMode, sys_open, sys_read_orig, sys_write_orig};
use stm32f4xx_hal::pac;

/// QEMU's timers count nanoseconds of virtual time, whatever the clock settings are.
const TIMER_HZ: u32 = 1_000_000_000;

/// Returns whether the image runs under QEMU.
pub fn is_here() -> bool {
    // SAFETY: a load. The chip's oscillator is on, or it would not execute this.
    unsafe { (*pac::RCC::ptr()).cr().read().bits() == 0 }
}

/// Ends the emulator, if there is one: the host detects it.
pub fn end() {
    if is_here() {
        semihosting::process::exit(1);
    }
}

/// Returns the clocks of the control timer and of the stopwatch, Hz, which are `of_chip` on the chip.
#[inline(never)]
pub fn clocks(is_emulated: bool, of_chip: [u32; 2]) -> [u32; 2] {
    if is_emulated { [TIMER_HZ; 2] } else { of_chip }
}

/// Returns the register of the counter that times ticks: of cycles, or a timer's where the emulator counts none.
#[inline(never)]
pub fn stopwatch(is_emulated: bool, timer: pac::TIM5) -> &'static AtomicU32 {
    let register = if is_emulated {
        timer.arr().write(|w| w.arr().set(u32::MAX));
        timer.cr1().write(|w| w.cen().set_bit());
        timer.cnt().as_ptr()
    } else {
        // SAFETY: the address of a register.
        unsafe { (&raw const (*DWT::PTR).cyccnt).cast_mut().cast() }
    };
    // SAFETY: aligned, always there, and a load has no side effect.
    unsafe { AtomicU32::from_ptr(register) }
}

/// The link task's end of the link: the serial port, or the emulator's pipes.
pub struct Link {
    line: DmaPort<UartDma>,
    /// Descriptors of the pipes and of the emulator's output, or [`NONE`].
    requests: RawFd,
    responses: RawFd,
    log: RawFd,
}

/// No descriptor.
const NONE: RawFd = -1;

impl Link {
    /// Takes the pipes, if an emulator has them, and otherwise the serial port.
    #[inline(never)]
    pub fn new(line: DmaPort<UartDma>, is_emulated: bool) -> Self {
        let open = |path, mode| match is_emulated.then(|| sys_open(path, mode)) {
            Some(Ok(file)) => file.into_raw_fd(),
            _ => NONE,
        };
        Self {
            line,
            requests: open(c"/dev/fd/100", OpenMode::RDONLY_BINARY),
            responses: open(c"/dev/fd/101", OpenMode::WRONLY_TRUNC_BINARY),
            log: open(c":tt", OpenMode::WRONLY_TRUNC),
        }
    }

    /// Writes what has been logged, as a debugger would read it.
    fn pass_log_on(&self) {
        // SAFETY: defmt-rtt's, with the layout that SEGGER's RTT prescribes.
        let channel = unsafe { &LOG };
        let written = channel.written.load(Ordering::Acquire);
        let mut read = channel.read.load(Ordering::Relaxed);
        while read != written {
            let end = if read < written {
                written
            } else {
                channel.size
            };
            // SAFETY: `written` is below the size of the buffer, and the bytes before it stay for a whole round.
            let bytes = unsafe {
                let start = channel.buffer as *const u8;
                core::slice::from_raw_parts(start.add(read as usize), (end - read) as usize)
            };
            write(self.log, bytes);
            read = if end == channel.size { 0 } else { end };
            channel.read.store(read, Ordering::Release);
        }
    }
}

impl Port for Link {
    fn is_half_duplex(&self) -> bool {
        self.requests != NONE
    }

    /// With pipes, blocks, with all of virtual time, until the host sends a request, and ends the image if the host is
    /// gone.
    fn receive(&mut self, buffer: &mut [u8]) -> usize {
        if self.requests == NONE {
            return self.line.receive(buffer);
        }
        self.pass_log_on();
        // SAFETY: it stays open.
        let requests = unsafe { BorrowedFd::borrow_raw(self.requests) };
        let length = buffer.len();
        match sys_read_orig(requests, buffer) {
            Ok(unread) if unread < length => length - unread,
            _ => semihosting::process::exit(1),
        }
    }

    fn send(&mut self, bytes: &[u8], spare: usize) -> bool {
        if self.requests == NONE {
            self.line.send(bytes, spare)
        } else {
            write(self.responses, bytes)
        }
    }
}

/// Writes all bytes; returns whether they have been taken.
fn write(file: RawFd, bytes: &[u8]) -> bool {
    // SAFETY: it stays open.
    let file = unsafe { BorrowedFd::borrow_raw(file) };
    matches!(sys_write_orig(file, bytes), Ok(0))
}

/// The control block of the log with its one channel to the host (SEGGER, J-Link user guide, RTT).
#[repr(C)]
struct ControlBlock {
    id: [u8; 16],
    numbers_of_channels: [u32; 2],
    name: u32,
    buffer: u32,
    size: u32,
    written: AtomicU32,
    read: AtomicU32,
    flags: AtomicU32,
}

unsafe extern "C" {
    #[link_name = "_SEGGER_RTT"]
    static LOG: ControlBlock;
}
