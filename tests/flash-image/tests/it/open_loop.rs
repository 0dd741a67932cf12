//! Hazards of commissioning, executed on the image that is flashed: torques from the host are limited, expire,
//! and need permission and switch like any other.

#![allow(clippy::unwrap_used)]

use painleve_flash_image::bench::{Bench, encoded, scenario, with_one_sensor};
use painleve_flash_image::board::{BoardChip, EmulatedBoard};
use painleve_plant::scenario::Scenario;
use painleve_shared::counts::TorqueCounts;
use painleve_shared::message::{FrameSource, Request, Response};
use painleve_shared::status::Fault;

crate::on_each_board! {
    torques_from_the_host_are_limited_by_the_board,
    a_torque_that_is_not_repeated_expires,
    without_permission_or_switch_there_is_no_torque,
    torques_from_the_host_do_nothing_to_a_law,
    a_joint_that_moves_far_takes_the_torque_off,
    a_winding_that_the_host_heats_takes_the_torque_off,
    switch_sensors_stages_and_host_take_the_torque_off_as_with_a_law,
}

/// 1 N·m of 5 N·m in 12 bits, rounded down.
const LIMIT_COUNTS: i32 = 409;

/// Commissioning reads one sensor of each channel at a time. The windings become hot within a fifth of a second.
fn limited() -> Scenario {
    let mut scenario = with_one_sensor("hybrid-elbow-down");
    scenario.controller.torque_limit_nm = 1.0;
    scenario.converters.winding.continuous_torque_nm = Some([0.3; 2]);
    scenario.converters.winding.time_constant_s = [1.0; 2];
    scenario
}

/// A board that is configured for commissioning, with the arm held in the air.
fn configured<C: BoardChip>() -> Bench<C> {
    let mut bench = Bench::<C>::without_configuration(&limited(), EmulatedBoard::booted());
    bench.host_is_there = true;
    bench.hold([-40.0, -60.0]);
    let response = bench
        .board
        .configure(FrameSource::Commissioning, &encoded(&limited()));
    assert!(
        matches!(response, Some(Response::Ready { .. })),
        "{response:?}"
    );
    bench
}

fn request<C: BoardChip>(bench: &mut Bench<C>, torques: [i32; 2]) {
    bench
        .board
        .send(&Request::Torque(torques.map(TorqueCounts)));
}

/// A board whose stages are on at zero torque.
fn armed<C: BoardChip>() -> Bench<C> {
    let mut bench = configured::<C>();
    assert!(bench.board.permit_arming());
    for _ in 0..120 {
        bench.tick();
    }
    assert_eq!(bench.board.torque().enabled, Some(true));
    assert_eq!(bench.board.torque().counts, [0; 2]);
    bench
}

/// A board that puts out a torque.
fn driven<C: BoardChip>() -> Bench<C> {
    let mut bench = armed::<C>();
    request(&mut bench, [300, -200]);
    bench.tick();
    bench.tick();
    assert_eq!(bench.board.torque().counts, [300, -200]);
    bench
}

/// Returns the fault latched in the newest answer.
fn latched_fault<C: BoardChip>(bench: &mut Bench<C>) -> Option<Fault> {
    let mut fault = None;
    for _ in 0..5 {
        bench.tick();
        while let Some(response) = bench.board.response(0) {
            if let Response::Tick { answer, .. } = response {
                fault = answer.latched_fault();
            }
        }
    }
    fault
}

fn torques_from_the_host_are_limited_by_the_board<C: BoardChip>() {
    let mut bench = armed::<C>();
    for torques in [[2000, -2000], [i32::MAX, i32::MIN], [411, -411]] {
        request(&mut bench, torques);
        bench.tick();
        bench.tick();
        assert_eq!(bench.board.torque().counts, [LIMIT_COUNTS, -LIMIT_COUNTS]);
    }
}

fn a_torque_that_is_not_repeated_expires<C: BoardChip>() {
    let mut bench = driven::<C>();
    let is_still_there = (0..45).all(|_| {
        bench.tick();
        bench.board.torque().counts == [300, -200]
    });
    assert!(is_still_there);
    for _ in 0..7 {
        bench.tick();
    }
    assert_eq!(bench.board.torque().counts, [0; 2]);
}

fn without_permission_or_switch_there_is_no_torque<C: BoardChip>() {
    for (permitted, closed) in [(false, true), (true, false)] {
        let mut bench = configured::<C>();
        bench.closes_switch = closed;
        if permitted {
            assert!(bench.board.permit_arming());
        }
        for _ in 0..200 {
            request(&mut bench, [300, 300]);
            bench.tick();
            assert!(bench.board.torque().is_off());
            assert_eq!(bench.board.torque().counts, [0; 2]);
        }
    }
}

fn torques_from_the_host_do_nothing_to_a_law<C: BoardChip>() {
    let mut bench = Bench::<C>::new(&scenario("hybrid-elbow-down"));
    bench.drive();
    let mut undisturbed = Bench::<C>::new(&scenario("hybrid-elbow-down"));
    undisturbed.drive();
    for _ in 0..50 {
        request(&mut bench, [2000, 2000]);
        bench.tick();
        undisturbed.tick();
        assert_eq!(bench.board.torque(), undisturbed.board.torque());
    }
}

/// Either encoder, in either direction: nothing is known about the signs yet.
fn a_joint_that_moves_far_takes_the_torque_off<C: BoardChip>() {
    for (joint, turn) in [(0, 600), (0, -600_i16), (1, 600), (1, -600)] {
        let mut bench = driven::<C>();
        bench.encoder_offset[joint] = turn.cast_unsigned();
        bench.present();
        // One tick to read the encoder, then two.
        bench.tick();
        assert!(bench.time_until_off().is_some(), "joint {joint}, {turn}");
        assert_eq!(latched_fault(&mut bench), Some(Fault::MovedTooFar));
        for _ in 0..50 {
            request(&mut bench, [300, 300]);
            bench.tick();
            assert!(bench.board.torque().is_off());
        }
    }
}

fn a_winding_that_the_host_heats_takes_the_torque_off<C: BoardChip>() {
    let mut bench = driven::<C>();
    let mut ticks = 0;
    while !bench.board.torque().is_off() {
        request(&mut bench, [300, -200]);
        bench.tick();
        ticks += 1;
        assert!(ticks < 1000);
    }
    assert!(ticks > 100, "{ticks}");
    assert_eq!(latched_fault(&mut bench), Some(Fault::WindingTooHot));
}

fn switch_sensors_stages_and_host_take_the_torque_off_as_with_a_law<C: BoardChip>() {
    let mut bench = driven::<C>();
    bench.board.enable(false);
    assert!(bench.time_until_off().is_some());

    let mut bench = driven::<C>();
    bench.board.wiring().encoders[0].dead = Some(true);
    bench.tick();
    assert!(bench.time_until_off().is_some());

    let mut bench = driven::<C>();
    bench.drive_pin(painleve_flash_image::board::STAGES_READY, Some(false));
    assert!(bench.time_until_off().is_some());

    let mut bench = driven::<C>();
    bench.board.machine.execute_undefined();
    assert!(bench.time_until_off().is_some());

    let mut bench = driven::<C>();
    bench.host_is_there = false;
    for _ in 0..210 {
        bench.tick();
    }
    assert!(bench.board.torque().is_off());
}
