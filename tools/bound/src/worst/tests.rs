//! Worst cases of code short enough to count by hand.

use super::*;
use crate::cycles::{G474, PIPELINE_REFILL};
use crate::image::Image;
use crate::instruction::KEPT_BY_CALLS;
use crate::loops::Declared;
use crate::trace::Tracer;

const AT: u32 = 0x0800_1000;
const AT_IN_RAM: u32 = 0x0000_1000;

fn worst(code: &[u16], limits: &[(&'static str, Limit)]) -> Result<Option<Worst>, BoundError> {
    worst_at(AT, code, limits)
}

fn worst_at(
    at: u32,
    code: &[u16],
    limits: &[(&'static str, Limit)],
) -> Result<Option<Worst>, BoundError> {
    worst_without(at, code, limits, &BTreeSet::new())
}

fn worst_without(
    at: u32,
    code: &[u16],
    limits: &[(&'static str, Limit)],
    left_out: &BTreeSet<u32>,
) -> Result<Option<Worst>, BoundError> {
    worst_of_image(&image(at, code), at, limits, left_out)
}

fn image(at: u32, code: &[u16]) -> Image {
    let bytes: Vec<u8> = code.iter().flat_map(|half| half.to_le_bytes()).collect();
    Image::of_code(at, &bytes, "kernel")
}

fn worst_of_image(
    image: &Image,
    at: u32,
    limits: &[(&'static str, Limit)],
    left_out: &BTreeSet<u32>,
) -> Result<Option<Worst>, BoundError> {
    let declared = limits.iter().map(|(function, limit)| Declared {
        function,
        limit: *limit,
        because: "",
    });
    let limits = Limits(declared.collect());
    // r1 to r5 point to variables.
    let known = ARGUMENTS[1..].iter().chain(&KEPT_BY_CALLS[..2]);
    let known = known.map(|it| (*it, Value::Data)).collect();
    let program = Program::of(image, BTreeMap::from([(at, known)]), &BTreeSet::new())?;
    Analysis::new(&program, &limits).without(left_out).of(at)
}

/// movs r0, #3; again: subs r0, #1; bne again; bx lr
const COUNT_DOWN: [u16; 4] = [0x2003, 0x3801, 0xd1fd, 0x4770];

#[test]
fn a_loop_costs_its_iterations() {
    let cycles = |times| {
        let worst = worst(&COUNT_DOWN, &[("kernel", Limit::Times(times))]);
        let worst = worst.unwrap().unwrap();
        assert_eq!(worst.instructions, 2 + 2 * times);
        worst.cycles
    };
    // Subtract, branch, refill, the end of a read of the flash, that of the line.
    assert_eq!(
        cycles(3) - cycles(2),
        1 + 1 + PIPELINE_REFILL + G474.fetch_wait(AT)
    );
    assert_eq!(cycles(1), 4);
}

/// again: cmp r0, #0; beq end; subs r0, #1; b again; end: bx lr
const CHECK_FIRST: [u16; 5] = [0x2800, 0xd001, 0x3801, 0xe7fb, 0x4770];

#[test]
fn a_loop_that_ends_at_its_first_block_executes_it_once_more() {
    let limits = [("kernel", Limit::Times(3))];
    let worst = worst(&CHECK_FIRST, &limits).unwrap().unwrap();
    assert_eq!(worst.loops[0].limit, Limit::Times(4));
    assert_eq!(worst.instructions, 4 * 2 + 3 * 2 + 1);
}

#[test]
fn code_in_ram_waits_for_no_line() {
    // Sixteen instructions of a cycle each, over two lines, then the return.
    let code = [0x2003; 16].into_iter().chain([0x4770]).collect::<Vec<_>>();
    let cycles = |at| worst_at(at, &code, &[]).unwrap().unwrap().cycles;
    assert_eq!(cycles(AT_IN_RAM), 17);
    assert!(cycles(AT) >= cycles(AT_IN_RAM));
    let limits = [("kernel", Limit::Times(3))];
    let count_down = |at| worst_at(at, &COUNT_DOWN, &limits).unwrap().unwrap().cycles;
    assert_eq!(
        count_down(AT) - count_down(AT_IN_RAM),
        2 * G474.fetch_wait(AT)
    );
}

#[test]
fn a_waiting_loop_costs_its_time_and_two_iterations() {
    // Also at the function's first block.
    for code in [&COUNT_DOWN[..], &COUNT_DOWN[1..]] {
        let worst = worst(code, &[("kernel", Limit::Cycles(1000))]);
        let cycles = worst.unwrap().unwrap().cycles;
        assert!((1002..1060).contains(&cycles), "{cycles}");
    }
}

#[test]
fn a_loop_without_a_limit_is_refused_by_name() {
    let error = worst(&COUNT_DOWN, &[("other", Limit::Times(1))]).unwrap_err();
    assert!(error.to_string().contains("in kernel"), "{error}");
}

/// The loop is `kernel`'s; `inlined` is in its body.
#[test]
fn a_loop_does_not_have_the_limit_of_code_inlined_into_it() {
    let mut image = image(AT, &COUNT_DOWN);
    image.begin_function(AT + 2, "inlined");
    image.begin_function(AT + 4, "kernel");
    let worst =
        |function| worst_of_image(&image, AT, &[(function, Limit::Times(3))], &BTreeSet::new());
    let error = worst("inlined").unwrap_err();
    assert!(matches!(error, BoundError::Unbounded { .. }), "{error}");
    assert_eq!(worst("kernel").unwrap().unwrap().instructions, 2 + 2 * 3);
}

#[test]
fn the_more_expensive_path_is_taken() {
    // cmp r0, #0; beq end; vdiv.f32 s0, s0, s1; end: bx lr
    let code = [0x2800, 0xd001, 0xee80, 0x0a20, 0x4770];
    let worst = worst_at(AT_IN_RAM, &code, &[]).unwrap().unwrap();
    // At the end of a block, the next instruction is assumed to use the quotient.
    assert_eq!(worst.cycles, 1 + 1 + 15 + 1);
    assert_eq!(worst.path.len(), 3);
}

#[test]
fn immediately_used_results_and_peripheral_accesses_cost_waits() {
    // vadd.f32 s0, s0, s1; vadd.f32 s0, s0, s1 (then s2, s2); bx lr
    let used = worst(&[0xee30, 0x0a20, 0xee30, 0x0a20, 0x4770], &[]);
    let free = worst(&[0xee30, 0x0a20, 0xee31, 0x1a21, 0x4770], &[]);
    let [used, free] = [used, free].map(|worst| worst.unwrap().unwrap().cycles);
    assert_eq!(used, free + 1);
    // movw r0, #0; movt r0, #0x4001 or #0x2000; ldr r1, [r0]; bx lr
    let load = |upper: u16| {
        worst(
            &[
                0xf240,
                0x0000,
                0xf2c0 | upper >> 12,
                upper & 0xff,
                0x6801,
                0x4770,
            ],
            &[],
        )
    };
    let peripheral = load(0x4001).unwrap().unwrap().cycles;
    let memory = load(0x2000).unwrap().unwrap().cycles;
    assert_eq!(peripheral, memory + G474.peripheral_wait);
}

/// The cycles of code in RAM without those of its return.
fn cycles_in_ram(code: &[u16]) -> u32 {
    let code: Vec<u16> = code.iter().copied().chain([0x4770]).collect();
    worst_at(AT_IN_RAM, &code, &[]).unwrap().unwrap().cycles - 1
}

/// The examples of ARM's manual, section 3.3.2.
#[test]
fn loads_and_stores_overlap_as_in_the_manual() {
    // ldr r0, [r1]; ldr r1, [r2]
    assert_eq!(cycles_in_ram(&[0x6808, 0x6811]), 3);
    // ldr r0, [r1, r2]; str r0, [r3, #20]
    assert_eq!(cycles_in_ram(&[0x5888, 0x6158]), 3);
    // ldr r0, [r1, r2]; str r1, [r3, r2]
    assert_eq!(cycles_in_ram(&[0x5888, 0x5099]), 3);
    // ldr r0, [r1, r5]; ldr r1, [r2]; ldr r2, [r3, #4]
    assert_eq!(cycles_in_ram(&[0x5948, 0x6811, 0x685a]), 4);
    // str r0, [r3, #20]
    assert_eq!(cycles_in_ram(&[0x6158]), 1);
    // strd r0, r1, [r2]; ldrd r0, r1, [r2]
    assert_eq!(cycles_in_ram(&[0xe9c2, 0x0100, 0xe9d2, 0x0100]), 6);
    // stm r0!, {eight registers}
    assert_eq!(cycles_in_ram(&[0xe8a0, 0x01fe]), 9);
}

#[test]
fn loads_and_stores_do_not_overlap_where_the_manual_excludes_it() {
    // ldr r0, [r1]; ldr r1, [r0]: the address is loaded, and may be one of the program
    assert_eq!(cycles_in_ram(&[0x6808, 0x6801]), 4 + 2);
    // str r0, [r1, r2]; ldr r0, [r3]: nothing overlaps with a store to the sum of two registers
    assert_eq!(cycles_in_ram(&[0x5088, 0x6818]), 4);
    // nop; str.w r0, [r1]; ldr r0, [r1], #4; ldr r2, [r3]: an odd half-word; an updated base
    assert_eq!(cycles_in_ram(&[0xbf00, 0xf8c1, 0x0000]), 3);
    assert_eq!(cycles_in_ram(&[0xf851, 0x0b04, 0x681a]), 4);
}

/// Also if it is computed, or passed to a function.
#[test]
fn a_load_is_one_from_the_program_unless_its_address_is_known() {
    // ldr r0, [r1]; ldr r0, [r6]
    let [data, unknown] = [0x6808, 0x6830].map(|load| cycles_in_ram(&[load]));
    assert_eq!(unknown, data + 2);
    // add r6, r1, r0; ldr r0, [r6], then add r6, r0, r0 and ldr r0, [r1]; ldr r1, [r1]; ldr r0, [r1]
    assert_eq!(cycles_in_ram(&[0x180e, 0x6830]), 1 + data + 1);
    assert_eq!(cycles_in_ram(&[0x1806, 0x6830]), 1 + unknown + 1);
    assert_eq!(cycles_in_ram(&[0x6809, 0x6808]), 2 + unknown);
    // mov r0, r1 (then r6); bl callee; bx lr; callee: ldr r0, [r0]; bx lr
    let called = |copy: u16| cycles_in_ram(&[copy, 0xf000, 0xf801, 0x4770, 0x6800]);
    assert_eq!(called(0x4630), called(0x4608) + 2);
}

/// A small constant in a register is an index, also where the instruction names it first.
#[test]
fn a_constant_that_is_no_address_does_not_show_where_a_load_is_from() {
    // movs r0, #4; ldr r2, [r0, r6] (then r6, r0); bx lr
    let [first, last] = [0x5982, 0x5832].map(|load| worst(&[0x2004, load, 0x4770], &[]));
    assert_eq!(
        first.unwrap().unwrap().cycles,
        last.unwrap().unwrap().cycles
    );
}

/// Flash: each line of four short instructions is waited for.
#[test]
fn every_line_of_the_flash_is_waited_for() {
    let code = |length| [vec![0x2003; length], vec![0x4770]].concat();
    let cycles = |length| worst(&code(length), &[]).unwrap().unwrap().cycles;
    assert_eq!(cycles(3), 4);
    assert_eq!(cycles(4), 5 + G474.flash_wait_states);
    assert_eq!(cycles(8), 9 + 2 * G474.flash_wait_states);
}

#[test]
fn an_address_computed_just_before_stalls() {
    // adds r1, #4; ldr r0, [r1], then with a nop between
    assert_eq!(cycles_in_ram(&[0x3104, 0x6808]), 4);
    assert_eq!(cycles_in_ram(&[0x3104, 0xbf00, 0x6808]), 4);
    // cmp r0, #0; beq last; six movs; adds r1, #4 (then r2, #4); last: ldr r0, [r1]
    let across_blocks = |add: u16| {
        let code = [&[0x2800, 0xd006][..], &[0x2003; 6], &[add, 0x6808]].concat();
        cycles_in_ram(&code)
    };
    assert_eq!(across_blocks(0x3104), 1 + 1 + 6 + 1 + 1 + 2);
    assert_eq!(across_blocks(0x3204), 1 + 1 + 6 + 1 + 2);
}

#[test]
fn integer_instructions_are_executed_during_a_division() {
    const DIVIDE: [u16; 2] = [0xee80, 0x0a20]; // vdiv.f32 s0, s0, s1
    const ADD: [u16; 2] = [0xee71, 0x0a20]; // vadd.f32 s1, s2, s1
    let with = |between: usize, last: [u16; 2]| {
        let moves = vec![0x2003; between];
        cycles_in_ram(&[&DIVIDE[..], &moves, &last].concat())
    };
    assert_eq!(with(0, ADD), 14 + 1);
    assert_eq!(with(10, ADD), 14 + 1);
    assert_eq!(with(20, ADD), 1 + 20 + 1);
    // vadd.f32 s1, s0, s1 uses the result at once.
    assert_eq!(with(0, [0xee70, 0x0a20]), 15 + 1);
}

#[test]
fn a_function_that_calls_itself_is_refused() {
    // bl here; bx lr
    let itself = [0xf7ff, 0xfffe, 0x4770];
    // bl other; bx lr; other: cmp r0, #0; beq end; bl first; end: bx lr
    let one_another = [
        0xf000, 0xf801, 0x4770, 0x2800, 0xd001, 0xf7ff, 0xfff9, 0x4770,
    ];
    for code in [&itself[..], &one_another] {
        let error = worst(code, &[]).unwrap_err();
        assert!(matches!(error, BoundError::Recursion { .. }), "{error}");
    }
}

#[test]
fn an_instruction_of_unknown_cost_is_refused() {
    // wfi
    let error = worst(&[0xbf30, 0x4770], &[]).unwrap_err();
    assert!(error.to_string().contains("wfi"), "{error}");
}

/// Whether its condition holds or not.
#[test]
fn an_executed_path_with_a_conditional_instruction_costs_no_more_than_the_worst() {
    // cmp r0, #0; it ne; movne r0, #3; bx lr
    let code = [0x2800, 0xbf18, 0x2003, 0x4770];
    for at in [AT_IN_RAM, AT] {
        let image = image(at, &code);
        let worst = worst_at(at, &code, &[]).unwrap().unwrap();
        let mut tracer = Tracer::new(&image).unwrap();
        for executed in [vec![at, at + 2, at + 4, at + 6], vec![at, at + 2, at + 6]] {
            let cycles = tracer.cost(&executed).unwrap().cycles;
            assert_eq!(cycles, worst.cycles + image.chip.around(at, false));
        }
    }
}

#[test]
fn a_call_that_depends_on_a_condition_may_be_skipped() {
    // cmp r0, #0; condition; bl callee; bx lr; callee: bx lr
    let returns_without_callee = |condition| {
        let code = [0x2800, condition, 0xf000, 0xf801, 0x4770, 0x4770];
        let callee = BTreeSet::from([AT_IN_RAM + 10]);
        let worst = worst_without(AT_IN_RAM, &code, &[], &callee);
        matches!(worst, Ok(Some(_)))
    };
    let (it_ne, nop) = (0xbf18, 0xbf00);
    assert!(returns_without_callee(it_ne));
    assert!(!returns_without_callee(nop));
}
