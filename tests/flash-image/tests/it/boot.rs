#![allow(clippy::unwrap_used)]
//! The image starts on the modelled board and controls a simulated arm as on a PC.

use painleve_chips::{MILLISECOND, Picoseconds, SECOND};
use painleve_flash_image::bench::{encoded, scenario};
use painleve_flash_image::board::{
    BoardChip, EmulatedBoard, F405, FlashedBoard, FlashedNucleo, G474,
};
use painleve_plant::Controller;
use painleve_plant::simulation::Simulation;
use painleve_plant::statistics::Statistics;
use painleve_shared::message::{FrameSource, Probe, Request, Response};

#[test]
fn the_image_boots_and_waits_with_the_stages_off() {
    assert!(FlashedBoard::booted().torque().is_off());
    assert!(FlashedNucleo::booted().torque().is_off());
}

/// The board's compiler output, arithmetic and serial driver give the same bits.
#[test]
fn frames_over_the_serial_line_are_answered_as_on_a_pc() {
    frames_are_answered_as_on_a_pc::<F405>();
    frames_are_answered_as_on_a_pc::<G474>();
}

fn frames_are_answered_as_on_a_pc<C: BoardChip>() {
    let scenario = scenario("hybrid-elbow-down");
    let mut controller = Controller::new(&scenario.controller_configuration()).unwrap();
    let mut simulation = Simulation::new(&scenario).unwrap();
    let mut statistics = Statistics::new(0.05);
    let mut board = EmulatedBoard::<C>::booted();
    let ready = board.configure(FrameSource::Lockstep, &encoded(&scenario));
    assert!(matches!(ready, Some(Response::Ready { .. })), "{ready:?}");
    for _ in 0..200 {
        let frame = simulation.sample(&mut statistics).unwrap();
        let answer = board.exchange(&frame).expect("an answer in time");
        assert_eq!(answer, controller.tick(&frame));
        simulation.advance(Some(&answer), &mut statistics).unwrap();
    }
}

/// By its counts, `accept` measures the clock and the watchdogs of a board that mostly sleeps.
#[test]
fn the_cycle_counter_counts_in_sleep() {
    cycles_count_in_sleep::<F405>(168_000_000);
    cycles_count_in_sleep::<G474>(170_000_000);
}

fn cycles_count_in_sleep<C: BoardChip>(core_hz: u64) {
    const DEBUG_CONTROL: u32 = 0xe004_2004;
    let mut board = EmulatedBoard::<C>::booted();
    for _ in 0..2 {
        let [(first, begin), (second, end)] = [cycles(&mut board), cycles(&mut board)];
        let expected = u128::from(end - begin) * u128::from(core_hz) / u128::from(SECOND);
        let counted = f64::from(second.wrapping_sub(first));
        let ratio = counted / expected as f64;
        assert!((ratio - 1.0).abs() < 1e-3, "{}: {ratio}", C::IMAGE);
        // A debugger that leaves restores what it has found when it came.
        let now = board.machine.now();
        board.machine.chip_mut().write(DEBUG_CONTROL, 4, 0, now);
        board.machine.run_for(2 * MILLISECOND);
    }
}

/// Returns the cycle counter, and when its answer came; then lets time pass.
fn cycles<C: BoardChip>(board: &mut EmulatedBoard<C>) -> (u32, Picoseconds) {
    let address = 0xe000_ed00;
    board.send(&Request::Probe(Probe::Load { address }));
    let Some(Response::Probed { stopwatch, .. }) = board.reply(20 * MILLISECOND) else {
        panic!("no answer");
    };
    let now = board.machine.now();
    board.machine.run_for(100 * MILLISECOND);
    (stopwatch, now)
}
