//! Copies the program from flash to RAM at reset, so that it runs without wait states.
//!
//! At 168 MHz a read of the flash takes six cycles, and the accelerator hides them only for code that is
//! executed in sequence or again. SRAM1 takes one. Mapped to address 0, it is reached by the core's
//! instruction bus; RM0090, section 2.3.1: "To get the max performance on SRAM execution, physical remap
//! should be selected". `memory.x` places the program.

#![allow(unsafe_code)] // the linker's symbols

// In assembly and in flash, because neither memory nor program are in place yet: copy the program and the
// vectors, which must not be read from a flash that is being erased, map SRAM1 to address 0. Called by `safety`'s `__pre_init`, returns to its caller.
core::arch::global_asm!(
    ".section .Reset, \"ax\", %progbits",
    ".global __copy_program",
    ".type __copy_program, %function",
    ".thumb_func",
    "__copy_program:",
    "ldr r0, =__program_start + {sram1}",
    "ldr r1, =__program_end + {sram1}",
    "ldr r2, =__program_in_flash",
    "2:",
    "cmp r0, r1",
    "beq 3f",
    "ldm r2!, {{r3, r12}}",
    "stm r0!, {{r3, r12}}",
    "b 2b",
    "3:",
    "ldr r0, ={sram1}",
    "add r1, r0, #{vector_bytes}",
    "ldr r2, =__vector_table",
    "4:",
    "ldm r2!, {{r3, r12}}",
    "stm r0!, {{r3, r12}}",
    "cmp r0, r1",
    "bne 4b",
    "ldr r0, ={scb_vtor}",
    "ldr r1, ={sram1}",
    "str r1, [r0]",
    "ldr r0, ={rcc_apb2enr}",
    "ldr r1, [r0]",
    "orr r1, r1, {syscfgen}",
    "str r1, [r0]",
    "ldr r1, [r0]",
    "ldr r0, ={syscfg_memrmp}",
    "movs r1, #3",
    "str r1, [r0]",
    "dsb",
    "isb",
    "bx lr",
    ".ltorg",
    ".size __copy_program, . - __copy_program",
    sram1 = const 0x2000_0000_u32,
    // Vectors of 16 exceptions and 82 interrupts.
    vector_bytes = const 4 * (16 + 82),
    scb_vtor = const 0xe000_ed08_u32,
    rcc_apb2enr = const 0x4002_3844_u32,
    syscfgen = const 1_u32 << 14,
    syscfg_memrmp = const 0x4001_3800_u32,
);
