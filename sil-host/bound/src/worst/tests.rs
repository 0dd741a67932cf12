//! Worst cases of code short enough to count by hand.

use super::*;
use crate::cycles::{FLASH_WAIT_STATES, PIPELINE_REFILL};
use crate::loops::Declared;

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
    let bytes: Vec<u8> = code.iter().flat_map(|half| half.to_le_bytes()).collect();
    let image = Image::of_code(at, &bytes, "kernel");
    let declared = limits.iter().map(|(function, limit)| Declared {
        function,
        limit: *limit,
        because: "",
    });
    let limits = Limits(declared.collect());
    Analysis::new(&image, &limits)?.of(at)
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
    // Subtract, branch, refill, read of the line.
    assert_eq!(
        cycles(3) - cycles(2),
        1 + 1 + PIPELINE_REFILL + FLASH_WAIT_STATES
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
        2 * FLASH_WAIT_STATES
    );
}

#[test]
fn a_waiting_loop_costs_its_time_and_two_iterations() {
    let worst = worst(&COUNT_DOWN, &[("kernel", Limit::Cycles(1000))]);
    let cycles = worst.unwrap().unwrap().cycles;
    assert!((1002..1060).contains(&cycles), "{cycles}");
}

#[test]
fn a_loop_without_a_limit_is_refused_by_name() {
    let error = worst(&COUNT_DOWN, &[("other", Limit::Times(1))]).unwrap_err();
    assert!(error.to_string().contains("in kernel"), "{error}");
}

#[test]
fn the_more_expensive_path_is_taken() {
    // cmp r0, #0; beq end; vdiv.f32 s0, s0, s1; end: bx lr
    let code = [0x2800, 0xd001, 0xee80, 0x0a20, 0x4770];
    let worst = worst(&code, &[]).unwrap().unwrap();
    assert_eq!(worst.cycles, 1 + 1 + 14 + 1);
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
    assert_eq!(peripheral, memory + crate::cycles::PERIPHERAL_WAIT);
}

#[test]
fn a_function_that_calls_itself_is_refused() {
    // bl here; bx lr
    let error = worst(&[0xf7ff, 0xfffe, 0x4770], &[]).unwrap_err();
    assert!(matches!(error, BoundError::Recursion { .. }), "{error}");
}

#[test]
fn an_instruction_of_unknown_cost_is_refused() {
    // wfi
    let error = worst(&[0xbf30, 0x4770], &[]).unwrap_err();
    assert!(error.to_string().contains("wfi"), "{error}");
}
