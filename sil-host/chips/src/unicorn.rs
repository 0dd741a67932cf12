//! The part of [Unicorn](https://www.unicorn-engine.org)'s C interface that runs a Cortex-M4F.
//!
//! Unicorn is QEMU's instruction translator without QEMU's machines. It models neither interrupts
//! nor peripherals of a Cortex-M; [`machine`](crate::machine) does.
//!
//! Alternatives: the crate `unicorn-engine` builds QEMU's translator in C with every build of the
//! workspace and links GPL code into a test. With the prebuilt Python package, a callback into
//! Python per instruction is several hundred times slower, and the native controller is out of
//! reach. The library of the Python package is therefore loaded while a test runs: none of it is
//! compiled, linked or shipped, and a build without it succeeds.

#![allow(unsafe_code)] // foreign functions and their callbacks

use std::any::Any;
use std::ffi::c_void;
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::Path;

use libloading::Library;

use crate::system_control::Masks;

type Handle = *mut c_void;
type Status = i32;

/// The surroundings of the processor, called in the middle of an instruction.
pub trait Surroundings {
    /// Called before every instruction; `false` stops the run before it.
    fn before_instruction(&mut self, address: u32, processor: &Processor) -> bool;

    /// Returns the value of a load of `size` bytes from a peripheral.
    fn read(&mut self, address: u32, size: u32, processor: &Processor) -> u32;

    /// Performs a store of `size` bytes to a peripheral.
    fn write(&mut self, address: u32, size: u32, value: u32, processor: &Processor);
}

/// A register of the processor, by Unicorn's number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Register(i32);

impl Register {
    /// Link register.
    pub const LR: Self = Self(10);
    /// Program counter.
    pub const PC: Self = Self(11);
    /// Stack pointer.
    pub const SP: Self = Self(12);
    /// Status of the floating-point unit.
    pub const FPSCR: Self = Self(6);
    /// Flags, exception number and state of a conditional block.
    pub const XPSR: Self = Self(120);
    /// 1 while interrupts are masked.
    pub const PRIMASK: Self = Self(123);
    /// Masks interrupts of this priority and below.
    pub const BASEPRI: Self = Self(124);
    /// 1 while even hard faults are masked.
    pub const FAULTMASK: Self = Self(126);
    /// Rn, 0 ≤ n ≤ 12.
    pub const fn r(n: i32) -> Self {
        Self(66 + n)
    }
    /// Sn, 0 ≤ n ≤ 31.
    pub const fn s(n: i32) -> Self {
        Self(79 + n)
    }
    const COPROCESSOR_ACCESS: Self = Self(111);
    const FPEXC: Self = Self(4);
}

/// Error that stopped Unicorn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnicornError(Status);

impl UnicornError {
    /// Returns the bits of the configurable fault status (ARMv7-M, section B3.2.15).
    pub fn fault_status(&self) -> u32 {
        match self.0 {
            // Reading or writing what is not mapped; fetching it.
            6 | 7 => 1 << 9,
            8 => 1 << 8,
            // The same of what is protected.
            12 | 13 => 1 << 1,
            14 => 1,
            _ => 1 << 16,
        }
    }
}

impl fmt::Display for UnicornError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Unicorn's error {}", self.0)
    }
}

type ReadCallback = unsafe extern "C" fn(Handle, u64, u32, *mut c_void) -> u64;
type WriteCallback = unsafe extern "C" fn(Handle, u64, u32, u64, *mut c_void);
type MmioMap = unsafe extern "C" fn(
    Handle,
    u64,
    u64,
    ReadCallback,
    *mut c_void,
    WriteCallback,
    *mut c_void,
) -> Status;
type HookAdd = unsafe extern "C" fn(
    Handle,
    *mut usize,
    i32,
    *mut c_void,
    *mut c_void,
    u64,
    u64,
    ...
) -> Status;

/// The library's functions in use.
struct Functions {
    open: unsafe extern "C" fn(i32, i32, *mut Handle) -> Status,
    close: unsafe extern "C" fn(Handle) -> Status,
    control: unsafe extern "C" fn(Handle, u32, ...) -> Status,
    memory_map: unsafe extern "C" fn(Handle, u64, u64, u32) -> Status,
    memory_protect: unsafe extern "C" fn(Handle, u64, u64, u32) -> Status,
    memory_map_at: unsafe extern "C" fn(Handle, u64, u64, u32, *mut c_void) -> Status,
    memory_read: unsafe extern "C" fn(Handle, u64, *mut c_void, u64) -> Status,
    memory_write: unsafe extern "C" fn(Handle, u64, *const c_void, u64) -> Status,
    mmio_map: MmioMap,
    hook_add: HookAdd,
    start: unsafe extern "C" fn(Handle, u64, u64, u64, usize) -> Status,
    stop: unsafe extern "C" fn(Handle) -> Status,
    register_read: unsafe extern "C" fn(Handle, i32, *mut c_void) -> Status,
    register_write: unsafe extern "C" fn(Handle, i32, *const c_void) -> Status,
    /// Declared last, so that it is unloaded last.
    _library: Library,
}

impl Functions {
    fn load(path: &Path) -> Result<Self, libloading::Error> {
        // SAFETY: the file is Unicorn's library; its initialisers have no requirements, and the types
        // are those of unicorn.h 2.1.
        unsafe {
            let library = Library::new(path)?;
            Ok(Self {
                open: *library.get(b"uc_open\0")?,
                close: *library.get(b"uc_close\0")?,
                control: *library.get(b"uc_ctl\0")?,
                memory_map: *library.get(b"uc_mem_map\0")?,
                memory_protect: *library.get(b"uc_mem_protect\0")?,
                memory_map_at: *library.get(b"uc_mem_map_ptr\0")?,
                memory_read: *library.get(b"uc_mem_read\0")?,
                memory_write: *library.get(b"uc_mem_write\0")?,
                mmio_map: *library.get(b"uc_mmio_map\0")?,
                hook_add: *library.get(b"uc_hook_add\0")?,
                start: *library.get(b"uc_emu_start\0")?,
                stop: *library.get(b"uc_emu_stop\0")?,
                register_read: *library.get(b"uc_reg_read\0")?,
                register_write: *library.get(b"uc_reg_write\0")?,
                _library: library,
            })
        }
    }
}

/// Registers and memory, accessible even during a run.
pub struct Processor {
    functions: Functions,
    handle: Handle,
}

impl Processor {
    /// Returns a register's value.
    pub fn get(&self, register: Register) -> u32 {
        let mut value = 0_u32;
        let place = (&raw mut value).cast();
        // SAFETY: all registers in use have four bytes.
        let status = unsafe { (self.functions.register_read)(self.handle, register.0, place) };
        assert_eq!(status, 0, "{register:?}");
        value
    }

    /// Returns the registers that mask exceptions.
    pub fn masks(&self) -> Masks {
        Masks {
            primask: self.get(Register::PRIMASK) & 1 != 0,
            basepri: self.get(Register::BASEPRI) as u8,
            faultmask: self.get(Register::FAULTMASK) & 1 != 0,
        }
    }

    /// Copies memory; returns `false` for unmapped addresses.
    pub fn read_memory(&self, address: u32, bytes: &mut [u8]) -> bool {
        let (place, length) = (bytes.as_mut_ptr().cast(), bytes.len() as u64);
        // SAFETY: the buffer has this length.
        let status =
            unsafe { (self.functions.memory_read)(self.handle, address.into(), place, length) };
        status == 0
    }

    /// Writes memory; returns `false` for unmapped addresses.
    pub fn write_memory(&self, address: u32, bytes: &[u8]) -> bool {
        let (place, length) = (bytes.as_ptr().cast(), bytes.len() as u64);
        // SAFETY: the buffer has this length.
        let status =
            unsafe { (self.functions.memory_write)(self.handle, address.into(), place, length) };
        status == 0
    }
}

/// Context of the callbacks.
struct CallbackContext<S> {
    processor: Processor,
    surroundings: S,
    regions: Vec<Region>,
    /// Memory with an alias, which Unicorn uses.
    shared_memory: Vec<Vec<Page>>,
    /// Payload of a panic in a callback; no panic may unwind through Unicorn.
    panic: Option<Box<dyn Any + Send>>,
}

/// Context of a peripheral region's callbacks.
struct Region {
    base: u32,
    shared: *mut c_void,
}

/// A page of memory, aligned as Unicorn requires.
#[derive(Clone)]
#[repr(align(4096))]
struct Page(#[allow(dead_code)] [u8; 4096]); // Unicorn reads and writes it

/// A Cortex-M4F with memory and [`Surroundings`].
pub struct Unicorn<S> {
    /// Owned; a raw pointer because the callbacks use it during a run.
    shared: *mut CallbackContext<S>,
}

const MODE_THUMB_AND_MCLASS: i32 = 16 | 32;
const CORTEX_M4: i32 = 9;
/// Control code that sets the processor's model.
const SET_CPU_MODEL: u32 = 7 | 1 << 26 | 1 << 30;
const HOOK_CODE: i32 = 4;

fn check(status: Status) {
    assert_eq!(status, 0, "{}", UnicornError(status));
}

impl<S: Surroundings> Unicorn<S> {
    /// Creates a processor without memory.
    ///
    /// # Errors
    /// If the library cannot be loaded.
    ///
    /// # Panics
    /// If the library is not Unicorn 2.
    pub fn new(library: &Path, surroundings: S) -> Result<Self, libloading::Error> {
        let functions = Functions::load(library)?;
        let mut handle = std::ptr::null_mut();
        // SAFETY: `handle` receives the engine; the control takes one int.
        unsafe {
            check((functions.open)(1, MODE_THUMB_AND_MCLASS, &raw mut handle));
            check((functions.control)(handle, SET_CPU_MODEL, CORTEX_M4));
        }
        let shared = Box::into_raw(Box::new(CallbackContext {
            processor: Processor { functions, handle },
            surroundings,
            regions: Vec::new(),
            shared_memory: Vec::new(),
            panic: None,
        }));
        let mut hook = 0;
        // SAFETY: `shared` lives until the engine is closed; begin > end means every address.
        unsafe {
            let callback = on_code::<S> as *const () as *mut c_void;
            let add = (*shared).processor.functions.hook_add;
            let status = add(
                handle,
                &raw mut hook,
                HOOK_CODE,
                callback,
                shared.cast(),
                1_u64,
                0_u64,
            );
            check(status);
        }
        let mut unicorn = Self { shared };
        // Grants full access to the floating-point unit; a program that fails to request access is
        // not detected.
        unicorn.set(Register::COPROCESSOR_ACCESS, 0x00f0_0000);
        unicorn.set(Register::FPEXC, 0x4000_0000);
        Ok(unicorn)
    }

    fn parts(&self) -> &CallbackContext<S> {
        // SAFETY: allocated in `new`, freed in `drop`; no callback runs while `self` is borrowed,
        // except within `run`, which holds it exclusively and uses the raw pointer.
        unsafe { &*self.shared }
    }

    /// Maps executable memory.
    pub fn map(&mut self, address: u32, length: usize) {
        let parts = self.parts();
        // SAFETY: Unicorn allocates the memory.
        check(unsafe {
            (parts.processor.functions.memory_map)(
                parts.processor.handle,
                address.into(),
                length as u64,
                7,
            )
        });
    }

    /// Sets what a mapped block of memory may be used for: reading 1, writing 2, execution 4.
    pub fn protect(&mut self, address: u32, length: usize, permitted: u32) {
        let parts = self.parts();
        // SAFETY: Unicorn checks the addresses; no callback runs.
        check(unsafe {
            (parts.processor.functions.memory_protect)(
                parts.processor.handle,
                address.into(),
                length as u64,
                permitted,
            )
        });
    }

    /// Maps executable memory that is also found at address `alias`.
    pub fn map_with_alias(&mut self, address: u32, length: usize, alias: u32) {
        let shared = self.shared;
        // SAFETY: see `parts`.
        let parts = unsafe { &mut *shared };
        let mut pages = vec![Page([0; 4096]); length.div_ceil(4096)];
        let place: *mut c_void = pages.as_mut_ptr().cast();
        parts.shared_memory.push(pages);
        let processor = &parts.processor;
        for address in [address, alias] {
            // SAFETY: the pages are at least as long, never move, and are freed after the engine.
            check(unsafe {
                (processor.functions.memory_map_at)(
                    processor.handle,
                    address.into(),
                    length as u64,
                    7,
                    place,
                )
            });
        }
    }

    /// Directs loads and stores of address ranges to the [`Surroundings`].
    pub fn map_peripherals(&mut self, regions: &[(u32, u32)]) {
        let shared = self.shared;
        // SAFETY: see `parts`; the regions are set once and never move.
        let parts = unsafe { &mut *shared };
        assert!(parts.regions.is_empty(), "peripherals are mapped once");
        parts.regions = regions
            .iter()
            .map(|(base, _)| Region {
                base: *base,
                shared: shared.cast(),
            })
            .collect();
        for (region, (base, length)) in parts.regions.iter().zip(regions) {
            let context = (&raw const *region).cast_mut().cast();
            // SAFETY: `region` lives as long as the engine.
            check(unsafe {
                (parts.processor.functions.mmio_map)(
                    parts.processor.handle,
                    (*base).into(),
                    (*length).into(),
                    on_read::<S>,
                    context,
                    on_write::<S>,
                    context,
                )
            });
        }
    }

    /// Returns registers and memory.
    pub fn processor(&self) -> &Processor {
        &self.parts().processor
    }

    /// Returns a register's value.
    pub fn get(&self, register: Register) -> u32 {
        self.processor().get(register)
    }

    /// Sets a register.
    pub fn set(&mut self, register: Register, value: u32) {
        let processor = &self.parts().processor;
        // Eight bytes, because Unicorn treats some registers as 64-bit.
        let value = u64::from(value);
        let place = (&raw const value).cast();
        // SAFETY: no register in use is longer than eight bytes.
        check(unsafe { (processor.functions.register_write)(processor.handle, register.0, place) });
    }

    /// Returns the surroundings and the processor.
    pub fn split(&mut self) -> (&mut S, &Processor) {
        // SAFETY: see `parts`; two separate fields.
        unsafe { (&mut (*self.shared).surroundings, &(*self.shared).processor) }
    }

    /// Returns the surroundings.
    pub fn surroundings(&self) -> &S {
        &self.parts().surroundings
    }

    /// Returns the surroundings, mutably.
    pub fn surroundings_mut(&mut self) -> &mut S {
        // SAFETY: see `parts`.
        unsafe { &mut (*self.shared).surroundings }
    }

    /// Runs from `address` until [`Surroundings::before_instruction`] stops it.
    ///
    /// # Errors
    /// [`UnicornError`] for an instruction that would fault.
    pub fn run(&mut self, address: u32) -> Result<(), UnicornError> {
        // SAFETY: only fields are read here; the callbacks use the same pointer.
        let (start, handle) = unsafe {
            let processor = &(*self.shared).processor;
            (processor.functions.start, processor.handle)
        };
        // SAFETY: callbacks receive pointers that live as long as the engine. The low bit selects
        // Thumb; no program reaches `until`.
        let status = unsafe { start(handle, u64::from(address | 1), 0xffff_fffe, 0, 0) };
        // SAFETY: as in `surroundings_mut`.
        if let Some(panic) = unsafe { (*self.shared).panic.take() } {
            resume_unwind(panic);
        }
        if status == 0 {
            Ok(())
        } else {
            Err(UnicornError(status))
        }
    }
}

impl<S> Drop for Unicorn<S> {
    fn drop(&mut self) {
        // SAFETY: created in `new`; the engine is closed before the callbacks' data is freed.
        unsafe {
            let processor = &(*self.shared).processor;
            (processor.functions.close)(processor.handle);
            drop(Box::from_raw(self.shared));
        }
    }
}

/// Calls the surroundings; a panic stops the run and is resumed by the caller of the run.
///
/// # Safety
/// `shared` comes from [`Unicorn::new`], and nothing else uses it.
unsafe fn call<S, R>(
    shared: *mut CallbackContext<S>,
    otherwise: R,
    work: impl FnOnce(&mut S, &Processor) -> R,
) -> R {
    // SAFETY: guaranteed by the caller.
    let shared = unsafe { &mut *shared };
    let processor = &shared.processor;
    let surroundings = &mut shared.surroundings;
    match catch_unwind(AssertUnwindSafe(|| work(surroundings, processor))) {
        Ok(result) => result,
        Err(panic) => {
            shared.panic = Some(panic);
            // SAFETY: the engine is open.
            unsafe { (processor.functions.stop)(processor.handle) };
            otherwise
        }
    }
}

unsafe extern "C" fn on_code<S: Surroundings>(
    handle: Handle,
    address: u64,
    _: u32,
    context: *mut c_void,
) {
    // SAFETY: `context` comes from `new`; nothing else uses it during a run.
    unsafe {
        call(
            context.cast::<CallbackContext<S>>(),
            (),
            |surroundings, processor| {
                if !surroundings.before_instruction(address as u32, processor) {
                    (processor.functions.stop)(handle);
                }
            },
        );
    }
}

unsafe extern "C" fn on_read<S: Surroundings>(
    _: Handle,
    offset: u64,
    size: u32,
    context: *mut c_void,
) -> u64 {
    // SAFETY: as in `on_code`; `context` is a region of `map_peripherals`.
    unsafe {
        let region = &*context.cast::<Region>();
        let address = region.base + offset as u32;
        let read = |it: &mut S, processor: &Processor| it.read(address, size, processor);
        call(region.shared.cast::<CallbackContext<S>>(), 0, read).into()
    }
}

unsafe extern "C" fn on_write<S: Surroundings>(
    _: Handle,
    offset: u64,
    size: u32,
    value: u64,
    context: *mut c_void,
) {
    // SAFETY: as in `on_read`.
    unsafe {
        let region = &*context.cast::<Region>();
        let address = region.base + offset as u32;
        let value = value as u32;
        let write = |it: &mut S, processor: &Processor| it.write(address, size, value, processor);
        call(region.shared.cast::<CallbackContext<S>>(), (), write);
    }
}
