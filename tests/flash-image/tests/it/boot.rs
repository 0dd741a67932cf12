#![allow(clippy::unwrap_used)]
//! The image starts on the modelled board and controls a simulated arm as on a PC.

use painleve_flash_image::bench::{encoded, scenario};
use painleve_flash_image::board::{
    BoardChip, EmulatedBoard, F405, FlashedBoard, FlashedNucleo, G474,
};
use painleve_plant::Controller;
use painleve_plant::simulation::Simulation;
use painleve_plant::statistics::Statistics;
use painleve_shared::message::{FrameSource, Response};

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
