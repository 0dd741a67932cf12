//! The microcontroller itself fails: reset, clock, supply, program.

use painleve_chips::MILLISECOND;
use painleve_chips::machine::Reset;
use painleve_chips::stm32::Crystal;
use painleve_flash_image::bench::{Bench, encoded, scenario};
use painleve_flash_image::board::{BoardChip, EmulatedBoard, F405, G474};
use painleve_shared::black_box::{BlackBox, Crash, FaultRecord, ResetCause};
use painleve_shared::frame::SensorFrame;
use painleve_shared::message::{FrameSource, Request, Response};
use painleve_shared::status::Fault;

use super::{DEFAULT, assert_off_in_time, driven};

crate::on_each_board! {
    the_first_instructions_switch_the_stages_off,
    a_slow_crystal_is_waited_for,
    a_dead_crystal_leaves_the_stages_off,
    a_hard_fault_takes_the_torque_off,
    a_stack_that_overflows_takes_the_torque_off_and_is_recorded,
    code_is_not_changed_and_data_is_not_executed,
    an_unexpected_interrupt_takes_the_torque_off,
    a_control_timer_that_stops_takes_the_torque_off,
    a_program_that_hangs_takes_the_torque_off,
    a_crystal_that_stops_takes_the_torque_off,
    a_low_supply_takes_the_torque_off,
    a_board_with_a_low_supply_waits_for_a_higher_one,
    a_reset_takes_the_torque_off,
    the_black_box_outlives_a_reset_and_names_its_reason,
    a_fault_without_a_frame_is_recorded_with_the_next_frame,
    an_unread_log_does_not_block_the_image,
    both_torques_change_at_once_over_the_whole_range,
}

fn the_first_instructions_switch_the_stages_off<C: BoardChip>() {
    let mut board = EmulatedBoard::<C>::default();
    board.machine.run_instructions(40, MILLISECOND);
    assert!(board.torque().is_off(), "{:?}", board.torque());
    // From then on the pin is never high, and floats only briefly.
    let mut floating = 0;
    for _ in 0..100_000 {
        board.machine.run_instructions(1, MILLISECOND);
        let enabled = board.torque().enabled;
        assert_ne!(enabled, Some(true));
        floating += u32::from(enabled.is_none());
    }
    assert!(floating < 300, "{floating} instructions");
}

/// The data sheets give 2 ms as typical, and no longest time.
fn a_slow_crystal_is_waited_for<C: BoardChip>() {
    let mut board = EmulatedBoard::<C>::default();
    let slow = Crystal::Slow(90 * MILLISECOND);
    board.machine.chip_mut().set_crystal(slow);
    board.machine.run_for(110 * MILLISECOND);
    board.send(&Request::Identify);
    let answer = board.reply(20 * MILLISECOND);
    assert!(
        matches!(answer, Some(Response::Identity { .. })),
        "{answer:?}"
    );
    assert_eq!(board.resets(), []);
}

fn a_dead_crystal_leaves_the_stages_off<C: BoardChip>() {
    let mut board = EmulatedBoard::<C>::default();
    board.machine.chip_mut().set_crystal(Crystal::Dead);
    for _ in 0..200 {
        board.machine.run_for(10 * MILLISECOND);
        assert!(board.torque().is_off(), "{:?}", board.torque());
    }
}

fn a_hard_fault_takes_the_torque_off<C: BoardChip>() {
    let mut bench = driven::<C>();
    bench.board.machine.execute_undefined();
    assert_off_in_time(bench);
}

fn a_stack_that_overflows_takes_the_torque_off_and_is_recorded<C: BoardChip>() {
    let mut bench = driven::<C>();
    bench.board.machine.recurse();
    assert!(bench.time_until_off().is_some());
    bench.run_ms(30);
    assert_eq!(bench.board.resets(), [Reset::Software]);
    let content = black_box(&mut bench.board);
    assert_eq!(
        (content.starts, content.crash),
        (2, Some(Crash::StackOverflow))
    );
    assert_off_in_time(bench);
}

/// Stores to the program, where it is executed, at the same memory's other address and where it comes from, and executes the
/// stack.
fn code_is_not_changed_and_data_is_not_executed<C: BoardChip>() {
    let mut bench = driven::<C>();
    let healthy = bench.snapshot();
    let program = bench.board.machine.symbol("main").unwrap() & !3;
    let copy = (C::ALIASED_RAM > 0).then_some(C::RAM.0 + program);
    for address in [program, C::FLASH.0 + 0x1000].into_iter().chain(copy) {
        bench.restore(&healthy);
        bench.board.machine.store(address);
        assert_eq!(recorded_status(&mut bench) & 0xff, 1 << 1, "{address:#x}");
    }
    bench.restore(&healthy);
    let data = bench.board.machine.stack_pointer() & !3;
    bench.board.machine.jump(data);
    assert_eq!(recorded_status(&mut bench) & 0xff, 1);
}

/// Checks that the torque is taken off; the fault status in the black box.
fn recorded_status<C: BoardChip>(bench: &mut Bench<C>) -> u32 {
    assert!(bench.time_until_off().is_some());
    bench.run_ms(30);
    match black_box(&mut bench.board).crash {
        Some(Crash::HardFault { status, .. }) => status,
        other => panic!("{other:?}"),
    }
}

fn an_unexpected_interrupt_takes_the_torque_off<C: BoardChip>() {
    let mut bench = driven::<C>();
    bench.board.machine.raise_unexpected();
    assert_off_in_time(bench);
}

/// Tested over the whole range of the independent watchdog's oscillator.
fn a_control_timer_that_stops_takes_the_torque_off<C: BoardChip>() {
    for oscillator_hz in C::OSCILLATOR_HZ {
        let mut board = EmulatedBoard::<C>::with_oscillator(oscillator_hz);
        board.machine.run_for(20 * MILLISECOND);
        let mut bench = Bench::<C>::with_board(&scenario(DEFAULT), board);
        bench.drive();
        for _ in 0..100 {
            bench.tick();
        }
        assert_eq!(bench.board.resets(), [], "fed in time");
        bench.board.machine.chip_mut().stop_control_timer();
        assert_off_in_time(bench);
    }
}

fn a_program_that_hangs_takes_the_torque_off<C: BoardChip>() {
    let mut bench = driven::<C>();
    bench.board.machine.hang();
    assert_off_in_time(bench);
}

fn a_crystal_that_stops_takes_the_torque_off<C: BoardChip>() {
    let mut bench = driven::<C>();
    bench.board.machine.chip_mut().set_crystal(Crystal::Stops);
    assert_off_in_time(bench);
}

fn a_low_supply_takes_the_torque_off<C: BoardChip>() {
    for millivolts in [2850, 2600] {
        let mut bench = driven::<C>();
        bench.board.machine.chip_mut().set_supply(millivolts);
        assert_off_in_time(bench);
    }
}

fn a_board_with_a_low_supply_waits_for_a_higher_one<C: BoardChip>() {
    let mut board = EmulatedBoard::<C>::default();
    board.machine.chip_mut().set_supply(2850);
    board.machine.run_for(20 * MILLISECOND);
    board.send(&Request::Identify);
    assert_eq!(board.reply(20 * MILLISECOND), None, "it has started");
    assert!(board.torque().is_off(), "{:?}", board.torque());
    // The watchdog's.
    board.machine.reset(Reset::Watchdog);
    board.machine.chip_mut().set_supply(3300);
    board.machine.run_for(20 * MILLISECOND);
    assert_eq!(black_box(&mut board).crash, None);
}

/// Programming takes longer than the watchdog's limit during the start. The level counts when power has come up again.
#[test]
fn a_new_chip_programs_its_brown_out_level() {
    programs_its_brown_out_level::<G474>();
}

#[test]
#[ignore = "programs for 800 ms of the chip's time"]
fn a_new_chip_programs_its_brown_out_level_for_long() {
    programs_its_brown_out_level::<F405>();
}

fn programs_its_brown_out_level<C: BoardChip>() {
    const LOW_MV: u32 = 2690;
    let mut board = EmulatedBoard::<C>::with_oscillator(C::OSCILLATOR_HZ[2]);
    board.machine.chip_mut().set_new_options();
    board.machine.chip_mut().set_supply(LOW_MV);
    board.machine.chip_mut().set_supply(3300);
    board.machine.run_for(1000 * MILLISECOND);
    assert_eq!(board.resets(), []);
    assert_eq!(black_box(&mut board).starts, 1);
    board.machine.reset(Reset::Power);
    board.machine.run_for(20 * MILLISECOND);
    board.machine.chip_mut().set_supply(LOW_MV);
    board.machine.run_for(MILLISECOND);
    assert_eq!(board.resets(), [Reset::Power, Reset::BrownOut]);
}

fn a_reset_takes_the_torque_off<C: BoardChip>() {
    let mut bench = driven::<C>();
    bench.board.machine.chip_mut().reset_pin();
    bench.run_ms(1);
    assert_eq!(bench.board.resets(), [Reset::Pin]);
    assert_off_in_time(bench);
}

/// The records of the image, requested after its start.
fn black_box<C: BoardChip>(board: &mut EmulatedBoard<C>) -> BlackBox {
    // A message that a reset has cut spoils the first reply; a host asks again.
    let reply = (0..2).find_map(|_| {
        board.send(&Request::BlackBox);
        board.reply(20 * MILLISECOND)
    });
    match reply {
        Some(Response::BlackBox(content)) => content,
        other => panic!("{other:?}"),
    }
}

fn the_black_box_outlives_a_reset_and_names_its_reason<C: BoardChip>() {
    let mut bench = driven::<C>();
    assert_eq!(black_box(&mut bench.board).reset, ResetCause::Power);
    assert_eq!(black_box(&mut bench.board).starts, 1);
    bench.board.wiring().force.dead = Some(true);
    assert!(bench.time_until_off().is_some());
    bench.assert_stays_off(5);
    let address = bench.board.machine.execute_undefined();
    bench.run_ms(30);
    let content = black_box(&mut bench.board);
    assert_eq!(content.reset, ResetCause::Software);
    assert_eq!(content.starts, 2);
    let fault = content.fault.expect("the fault of the force cell");
    assert_eq!(fault.answer.latched_fault(), Some(Fault::ForceOutOfRange));
    assert!(fault.sensor.normal_force.0 > 1 << 20);
    let is_there = |crash| matches!(crash, Some(Crash::HardFault { program_counter, .. }) if program_counter == address);
    assert!(is_there(content.crash), "{content:?}, {address:#x}");
    bench.board.machine.hang();
    bench.run_ms(30);
    assert_eq!(black_box(&mut bench.board).reset, ResetCause::Watchdog);
}

fn a_fault_without_a_frame_is_recorded_with_the_next_frame<C: BoardChip>() {
    let mut board = EmulatedBoard::<C>::booted();
    let response = board.configure(FrameSource::Realtime, &encoded(&scenario(DEFAULT)));
    assert!(matches!(response, Some(Response::Ready { .. })));
    board.machine.run_for(50 * MILLISECOND);
    while board.response(0).is_some() {}
    assert_eq!(black_box(&mut board).fault, None);
    let frame = SensorFrame {
        sequence: 1,
        ..SensorFrame::default()
    };
    let answer = board.exchange(&frame).expect("an answer");
    let record = FaultRecord {
        sensor: frame,
        answer,
    };
    assert_eq!(answer.latched_fault(), Some(Fault::MissingFrame));
    assert_eq!(black_box(&mut board).fault, Some(record));
}

/// A debugger has attached to the log and then disconnected.
fn an_unread_log_does_not_block_the_image<C: BoardChip>() {
    let mut bench = driven::<C>();
    let control_block = bench.board.machine.symbol("_SEGGER_RTT").unwrap();
    // Flags of the first channel: block if full.
    bench.board.machine.write_word(control_block + 44, 2);
    for n in 0..3000_u32 {
        if n % 10 == 0 {
            bench.board.enable(n % 20 == 0);
        }
        bench.wait_for_tick();
        assert_eq!(bench.board.resets(), [], "tick {n}");
    }
}

fn both_torques_change_at_once_over_the_whole_range<C: BoardChip>() {
    let mut bench = driven::<C>();
    assert!(!bench.board.machine.chip().dac_is_buffered());
    let before = bench.board.machine.chip().dac_writes();
    for _ in 0..10 {
        bench.tick();
    }
    assert_eq!(bench.board.machine.chip().dac_writes() - before, 10);
}
