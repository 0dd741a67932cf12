//! Hazards of commissioning, executed on the image that is flashed: torques from the host are limited, expire,
//! and need permission and switch like any other.

#![allow(clippy::unwrap_used)]

use painleve_flash_image::bench::{BoardBench, encoded, scenario, with_one_sensor};
use painleve_flash_image::board::FlashedBoard;
use painleve_plant::scenario::Scenario;
use painleve_shared::counts::TorqueCounts;
use painleve_shared::message::{FrameSource, Request, Response};
use painleve_shared::status::Fault;

/// 1 N·m of 5 N·m in 12 bits.
const LIMIT_COUNTS: i32 = 410;

/// Commissioning reads one sensor of each channel at a time.
fn limited() -> Scenario {
    let mut scenario = with_one_sensor("hybrid-elbow-down");
    scenario.controller.torque_limit_nm = 1.0;
    scenario
}

/// A board that is configured for commissioning, with the arm held in the air.
fn configured() -> BoardBench {
    let mut bench = BoardBench::without_configuration(&limited(), FlashedBoard::booted());
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

fn request(bench: &mut BoardBench, torques: [i32; 2]) {
    bench
        .board
        .send(&Request::Torque(torques.map(TorqueCounts)));
}

/// A board whose stages are on at zero torque.
fn armed() -> BoardBench {
    let mut bench = configured();
    assert!(bench.board.permit_arming());
    for _ in 0..120 {
        bench.tick();
    }
    assert_eq!(bench.board.torque().enabled, Some(true));
    assert_eq!(bench.board.torque().counts, [0; 2]);
    bench
}

/// A board that puts out a torque.
fn driven() -> BoardBench {
    let mut bench = armed();
    request(&mut bench, [300, -200]);
    bench.tick();
    bench.tick();
    assert_eq!(bench.board.torque().counts, [300, -200]);
    bench
}

/// Returns the fault latched in the newest answer.
fn latched_fault(bench: &mut BoardBench) -> Option<Fault> {
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

#[test]
fn torques_from_the_host_are_limited_by_the_board() {
    let mut bench = armed();
    for torques in [[2000, -2000], [i32::MAX, i32::MIN], [411, -411]] {
        request(&mut bench, torques);
        bench.tick();
        bench.tick();
        assert_eq!(bench.board.torque().counts, [LIMIT_COUNTS, -LIMIT_COUNTS]);
    }
}

#[test]
fn a_torque_that_is_not_repeated_expires() {
    let mut bench = driven();
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

#[test]
fn without_permission_or_switch_there_is_no_torque() {
    for (permitted, closed) in [(false, true), (true, false)] {
        let mut bench = configured();
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

#[test]
fn torques_from_the_host_do_nothing_to_a_law() {
    let mut bench = BoardBench::new(&scenario("hybrid-elbow-down"));
    bench.drive();
    let mut undisturbed = BoardBench::new(&scenario("hybrid-elbow-down"));
    undisturbed.drive();
    for _ in 0..50 {
        request(&mut bench, [2000, 2000]);
        bench.tick();
        undisturbed.tick();
        assert_eq!(bench.board.torque(), undisturbed.board.torque());
    }
}

/// Either encoder, in either direction: nothing is known about the signs yet.
#[test]
fn a_joint_that_moves_far_takes_the_torque_off() {
    for (joint, turn) in [(0, 600), (0, -600_i16), (1, 600), (1, -600)] {
        let mut bench = driven();
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

#[test]
fn switch_sensors_stages_and_host_take_the_torque_off_as_with_a_law() {
    let mut bench = driven();
    bench.board.enable(false);
    assert!(bench.time_until_off().is_some());

    let mut bench = driven();
    bench.board.wiring().encoders[0].dead = Some(true);
    bench.tick();
    assert!(bench.time_until_off().is_some());

    let mut bench = driven();
    bench.drive_pin(painleve_flash_image::board::STAGES_READY, Some(false));
    assert!(bench.time_until_off().is_some());

    let mut bench = driven();
    bench.board.machine.hard_fault();
    assert!(bench.time_until_off().is_some());

    let mut bench = driven();
    bench.host_is_there = false;
    for _ in 0..210 {
        bench.tick();
    }
    assert!(bench.board.torque().is_off());
}
