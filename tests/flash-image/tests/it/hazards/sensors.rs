//! Sensors, switches and torque stages fail.

use painleve_chips::BridgeFailure;
use painleve_chips::MILLISECOND;
use painleve_flash_image::bench::{Bench, encoded, scenario, with_one_sensor};
use painleve_flash_image::board::{BoardChip, EmulatedBoard, STAGES_READY};
use painleve_plant::plant::Plant as _;
use painleve_plant::scenario::Scenario;
use painleve_shared::counts::ForceCounts;
use painleve_shared::message::{FrameSource, Response};
use painleve_shared::mounting::Mounting;
use painleve_shared::status::Fault;

use super::{DEFAULT, assert_off_in_time, driven, latched_fault};
use painleve_flash_image::harm::Harm;

crate::on_each_board! {
    the_switch_takes_the_torque_off_and_a_bounce_does_not_put_it_on,
    sensors_that_die_take_the_torque_off,
    a_force_cell_that_dies_takes_the_torque_off,
    an_encoder_that_freezes_takes_the_torque_off,
    an_encoder_that_loses_its_magnet_takes_the_torque_off,
    a_torque_stage_that_is_not_ready_takes_the_torque_off,
    a_winding_that_becomes_too_hot_takes_the_torque_off,
    arming_on_implausible_readings_is_refused_with_a_fault,
    parts_mounted_backwards_drive_the_same_arm,
    one_disturbed_transfer_is_no_fault,
    nothing_arms_on_dead_lines_or_on_a_switch_that_was_closed_before,
}

fn the_switch_takes_the_torque_off_and_a_bounce_does_not_put_it_on<C: BoardChip>() {
    let mut bench = driven::<C>();
    bench.board.enable(false);
    assert!(bench.time_until_off().is_some());
    assert!(bench.board.permit_arming());
    for n in 0..40 {
        // The switch opens for two ticks at a time.
        bench.board.enable(n % 10 > 1);
        bench.wait_for_tick();
        assert!(bench.board.torque().is_off());
    }
}

fn sensors_that_die_take_the_torque_off<C: BoardChip>() {
    for level in [false, true] {
        for encoder in 0..2 {
            let mut bench = driven::<C>();
            bench.board.wiring().encoders[encoder].dead = Some(level);
            assert_off_in_time(bench);
        }
    }
}

/// Every single failure between the strain gauges and the processor, on either axis.
fn a_force_cell_that_dies_takes_the_torque_off<C: BoardChip>() {
    for level in [false, true] {
        let mut bench = driven::<C>();
        bench.board.wiring().force.dead = Some(level);
        assert_off_in_time(bench);
    }
    let mut bench = driven::<C>();
    let driven = bench.snapshot();
    for axis in 0..2 {
        for failure in BridgeFailure::ALL {
            bench.restore(&driven);
            bench.board.wiring().bridges[axis].failure = Some(*failure);
            bench.present();
            let off = bench.time_until_off();
            assert!(off.is_some(), "{axis} {failure:?}");
            bench.assert_stays_off(10);
            assert_eq!(latched_fault(&mut bench), Some(Fault::ForceOutOfRange));
        }
    }
}

/// The tip moves on the belt; the only encoder of a joint repeats a plausible angle.
fn an_encoder_that_freezes_takes_the_torque_off<C: BoardChip>() {
    for encoder in 0..2 {
        frozen::<C>(encoder);
    }
}

/// Returns what the arm does until the torque is off.
pub fn frozen<C: BoardChip>(encoder: usize) -> Harm {
    let mut bench = Bench::<C>::new(&with_one_sensor(DEFAULT));
    bench.drive();
    bench.is_frozen[encoder] = true;
    let harm = Harm::until_off(&mut bench, 2000);
    let fault = latched_fault(&mut bench);
    println!("encoder {encoder}: {fault:?} after {harm:?}");
    assert!(fault.is_some());
    bench.assert_stays_off(100);
    harm
}

/// The only encoder of a joint repeats its last angle and says why; its diagnostics are read every 64 ticks.
fn an_encoder_that_loses_its_magnet_takes_the_torque_off<C: BoardChip>() {
    const TOO_WEAK: u16 = 0x0980;
    for encoder in 0..2 {
        let mut bench = Bench::<C>::new(&with_one_sensor(DEFAULT));
        bench.drive();
        bench.is_frozen[encoder] = true;
        bench.board.wiring().encoders[encoder].diagnostics = TOO_WEAK;
        let mut ticks = 0;
        while !bench.board.torque().is_off() {
            bench.tick();
            ticks += 1;
            assert!(ticks < 80, "encoder {encoder}");
        }
        bench.assert_stays_off(100);
        assert_eq!(latched_fault(&mut bench), Some(Fault::EncoderOutOfRange));
    }
}

fn a_torque_stage_that_is_not_ready_takes_the_torque_off<C: BoardChip>() {
    let mut bench = driven::<C>();
    bench.drive_pin(STAGES_READY, Some(false));
    assert!(bench.time_until_off().is_some());
    bench.assert_stays_off(10);
    assert_eq!(latched_fault(&mut bench), Some(Fault::StageNotReady));
    bench.drive_pin(STAGES_READY, Some(true));
    bench.assert_stays_off(100);
}

/// A continuous torque far below what the arm needs; then the drive does not arm until the winding has cooled.
fn a_winding_that_becomes_too_hot_takes_the_torque_off<C: BoardChip>() {
    let mut scenario = scenario(DEFAULT);
    scenario.converters.winding.continuous_torque_nm = Some([0.3; 2]);
    scenario.converters.winding.time_constant_s = [1.0; 2];
    let mut bench = Bench::<C>::new(&scenario);
    bench.drive();
    let mut ticks = 0;
    while !bench.board.torque().is_off() {
        bench.tick();
        ticks += 1;
        assert!(ticks < 2000);
    }
    let fault = latched_fault(&mut bench);
    println!("{fault:?} after {ticks} ticks");
    assert_eq!(fault, Some(Fault::WindingTooHot));
    // A new configuration does not cool it.
    let response = bench
        .board
        .configure(FrameSource::Sensors, &encoded(&scenario));
    assert!(matches!(response, Some(Response::Ready { .. })));
    assert!(bench.board.permit_arming());
    bench.board.enable(false);
    bench.assert_stays_off(10);
    bench.board.enable(true);
    bench.assert_stays_off(90);
    assert_eq!(latched_fault(&mut bench), Some(Fault::ArmingRefused));
}

/// An encoder that is zeroed 30° wrongly, a torque stage that is not ready.
fn arming_on_implausible_readings_is_refused_with_a_fault<C: BoardChip>() {
    for (offsets, ready) in [([1365, 0], true), ([0, 1365], true), ([0, 0], false)] {
        let mut bench =
            Bench::<C>::without_configuration(&scenario(DEFAULT), EmulatedBoard::<C>::booted());
        bench.host_is_there = true;
        bench.encoder_offset = offsets;
        bench.present();
        bench.drive_pin(STAGES_READY, Some(ready));
        let configuration = encoded(&scenario(DEFAULT));
        let response = bench.board.configure(FrameSource::Sensors, &configuration);
        assert!(matches!(response, Some(Response::Ready { .. })));
        assert!(bench.board.permit_arming());
        for _ in 0..150 {
            bench.tick();
            assert!(bench.board.torque().is_off());
        }
        let fault = latched_fault(&mut bench);
        assert_eq!(fault, Some(Fault::ArmingRefused), "{offsets:?} {ready}");
    }
}

/// Every part mounted backwards and the force cell not at zero: the settings make it the same arm.
fn parts_mounted_backwards_drive_the_same_arm<C: BoardChip>() {
    let mounted = Mounting {
        encoder_reversed: [true; 2],
        stage_reversed: [true; 2],
        force_reversed: [true; 2],
        force_tare: [ForceCounts(37), ForceCounts(-55)],
        ..Mounting::default()
    };
    let mut scenario = scenario(DEFAULT);
    let tip_m = |scenario: &Scenario, mounted| {
        let mut bench = Bench::<C>::without_configuration(scenario, EmulatedBoard::<C>::booted());
        bench.host_is_there = true;
        bench.mounted = mounted;
        bench.present();
        let response = bench
            .board
            .configure(FrameSource::Sensors, &encoded(scenario));
        assert!(matches!(response, Some(Response::Ready { .. })));
        assert!(bench.board.permit_arming());
        bench.drive();
        for _ in 0..300 {
            bench.tick();
        }
        bench.simulation.plant().snapshot().tip_t_m
    };
    let straight = tip_m(&scenario, Mounting::default());
    scenario.converters.mounting = mounted;
    assert!((tip_m(&scenario, mounted) - straight).abs() < 1e-3);
}

fn one_disturbed_transfer_is_no_fault<C: BoardChip>() {
    let mut bench = driven::<C>();
    bench.board.wiring().encoders[0].errors |= 4;
    for _ in 0..50 {
        bench.tick();
    }
    assert_eq!(bench.board.torque().enabled, Some(true));
}

fn nothing_arms_on_dead_lines_or_on_a_switch_that_was_closed_before<C: BoardChip>() {
    for level in [false, true] {
        let mut board = EmulatedBoard::<C>::default();
        board.enable(true);
        for encoder in &mut board.wiring().encoders {
            encoder.dead = Some(level);
        }
        board.wiring().force.dead = Some(level);
        board.machine.run_for(20 * MILLISECOND);
        let response = board.configure(FrameSource::Sensors, &encoded(&scenario(DEFAULT)));
        assert!(matches!(response, Some(Response::Ready { .. })));
        for n in 0..600 {
            if n % 100 == 0 {
                assert!(board.permit_arming());
            }
            // It is opened and closed, too.
            board.enable(n % 100 > 20);
            board.machine.run_for(MILLISECOND);
            assert!(board.torque().is_off());
        }
    }
    // Healthy sensors, but a switch that has been closed from the start.
    let mut board = EmulatedBoard::<C>::default();
    board.enable(true);
    board.machine.run_for(20 * MILLISECOND);
    let mut bench = Bench::<C>::with_board(&scenario(DEFAULT), board);
    for _ in 0..300 {
        bench.board.enable(true);
        bench.wait_for_tick();
        assert!(bench.board.torque().is_off());
    }
}
