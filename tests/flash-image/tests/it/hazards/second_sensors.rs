//! An arm with two sensors on each channel: what one of them shows wrongly, the other contradicts.

use painleve_chips::BitErrors;
use painleve_flash_image::bench::{Bench, encoded, scenario, with_one_sensor};
use painleve_flash_image::board::{BoardChip, EmulatedBoard};
use painleve_flash_image::harm::Harm;
use painleve_plant::plant::Plant as _;
use painleve_plant::scenario::Scenario;
use painleve_shared::message::{FrameSource, Response};
use painleve_shared::mounting::{Mounting, SensorParts};
use painleve_shared::status::Fault;

use super::{DEFAULT, assert_off_in_time, driven, latched_fault};

crate::on_each_board! {
    a_frozen_encoder_is_contradicted_by_the_other,
    a_stuck_force_cell_is_contradicted_by_the_other,
    a_second_sensor_that_dies_takes_the_torque_off,
    without_second_sensors_the_default_arm_is_never_driven,
    nothing_arms_on_a_second_encoder_without_a_magnet,
    healthy_second_sensors_mounted_backwards_change_nothing,
    the_second_sensors_alone_drive_the_same_arm,
    an_unknown_direction_of_a_second_encoder_is_found_with_the_first_motion,
    with_bit_errors_the_run_with_second_sensors_goes_on,
}

/// Most ticks with the torque on after the two sensors have come apart by more than their tolerance.
const LIMIT_TICKS: u32 = 2;

fn bench<C: BoardChip>(scenario: &Scenario, mounted: Mounting) -> Bench<C> {
    let mut bench = Bench::<C>::without_configuration(scenario, EmulatedBoard::<C>::booted());
    bench.host_is_there = true;
    bench.mounted = mounted;
    // Second sensors that are alone have the zeros of the configuration.
    bench.second_is_aligned = scenario.converters.mounting.sensors == SensorParts::Second;
    bench.present();
    let configuration = encoded(scenario);
    let response = bench.board.configure(FrameSource::Sensors, &configuration);
    assert!(matches!(response, Some(Response::Ready { .. })));
    assert!(bench.board.permit_arming());
    bench
}

/// The first or the second encoder of either joint repeats a plausible angle while the tip moves along the belt.
fn a_frozen_encoder_is_contradicted_by_the_other<C: BoardChip>() {
    for joint in 0..2 {
        frozen::<C>(joint);
    }
}

/// Returns the worse of what the arm does until the torque is off.
pub fn frozen<C: BoardChip>(joint: usize) -> Harm {
    let tolerance = i64::from(Mounting::default().second_encoder_tolerance);
    let harms = [false, true].map(|is_second| {
        let mut bench = driven::<C>();
        let frozen = if is_second {
            &mut bench.second_is_frozen
        } else {
            &mut bench.is_frozen
        };
        frozen[joint] = true;
        let frozen_at = bench.frame.joints[joint].0;
        let (harm, ticks) = Harm::until_off_counting(&mut bench, 2000, |bench| {
            let apart = i64::from(bench.frame.joints[joint].0) - i64::from(frozen_at);
            apart.abs() > tolerance
        });
        println!("joint {joint}, second {is_second}: {ticks} ticks, {harm:?}");
        assert!(ticks <= LIMIT_TICKS, "{ticks}");
        bench.assert_stays_off(100);
        assert_eq!(latched_fault(&mut bench), Some(Fault::EncoderOutOfRange));
        harm
    });
    harms[0].or_worse(&harms[1])
}

/// The first or the second force cell repeats the reading without a force, or the present one.
fn a_stuck_force_cell_is_contradicted_by_the_other<C: BoardChip>() {
    for is_zero in [true, false] {
        stuck::<C>(is_zero);
    }
}

/// Returns the worse of what the arm does until the torque is off.
pub fn stuck<C: BoardChip>(is_zero: bool) -> Harm {
    // The difference that the image has measured before has an error by noise, too.
    let tolerance = i32::from(Mounting::default().second_force_tolerance) + 4;
    let harms = [false, true].map(|is_second| {
        let mut bench = driven::<C>();
        let present = [bench.frame.tangential_force.0, bench.frame.normal_force.0];
        let stuck_at = if is_zero { [0; 2] } else { present };
        let stuck = if is_second {
            &mut bench.second_force_is_stuck_at
        } else {
            &mut bench.force_is_stuck_at
        };
        *stuck = Some(stuck_at);
        bench.present();
        let (mut ticks, mut worst) = (0, Harm::default());
        // With noise the readings may contradict each other in one tick and not in the next.
        while bench.board.torque().enabled == Some(true) {
            let (harm, wrong) = Harm::until_off_counting(&mut bench, 2000, |bench| {
                let now = [bench.frame.tangential_force.0, bench.frame.normal_force.0];
                (0..2).any(|axis| (now[axis] - stuck_at[axis]).abs() > tolerance)
            });
            ticks += wrong;
            println!("zero {is_zero}, second {is_second}: {ticks} ticks, {harm:?}");
            worst = worst.or_worse(&harm);
            bench.tick();
        }
        assert!(ticks <= LIMIT_TICKS, "{ticks}");
        bench.assert_stays_off(100);
        assert_eq!(latched_fault(&mut bench), Some(Fault::ForceOutOfRange));
        worst
    });
    harms[0].or_worse(&harms[1])
}

fn a_second_sensor_that_dies_takes_the_torque_off<C: BoardChip>() {
    for level in [false, true] {
        for encoder in 0..2 {
            let mut bench = driven::<C>();
            bench.board.wiring().second_encoders[encoder].dead = Some(level);
            assert_off_in_time(bench);
        }
        let mut bench = driven::<C>();
        bench.board.wiring().second_force.dead = Some(level);
        assert_off_in_time(bench);
    }
}

/// The pull-ups of the lines, or a level that a fault gives them.
fn without_second_sensors_the_default_arm_is_never_driven<C: BoardChip>() {
    for level in [false, true] {
        let mut board = EmulatedBoard::<C>::booted();
        for encoder in &mut board.wiring().second_encoders {
            encoder.dead = Some(level);
        }
        board.wiring().second_force.dead = Some(level);
        let mut bench = Bench::<C>::with_board(&scenario(DEFAULT), board);
        for _ in 0..300 {
            bench.tick();
            assert!(bench.board.torque().is_off());
        }
    }
}

fn nothing_arms_on_a_second_encoder_without_a_magnet<C: BoardChip>() {
    const TOO_WEAK: u16 = 0x0980;
    for joint in 0..2 {
        let mut board = EmulatedBoard::<C>::booted();
        board.wiring().second_encoders[joint].diagnostics = TOO_WEAK;
        let mut bench = Bench::<C>::with_board(&scenario(DEFAULT), board);
        for _ in 0..300 {
            bench.tick();
            assert!(bench.board.torque().is_off());
        }
        assert_eq!(latched_fault(&mut bench), Some(Fault::ArmingRefused));
    }
}

/// Returns the place of the tip after 300 ticks, m.
fn tip_m<C: BoardChip>(scenario: &Scenario, mounted: Mounting) -> f64 {
    let mut bench = bench::<C>(scenario, mounted);
    bench.drive();
    for _ in 0..300 {
        bench.tick();
    }
    assert_eq!(bench.board.torque().enabled, Some(true));
    assert_eq!(bench.board.wiring().violations(), [""; 0]);
    bench.simulation.plant().snapshot().tip_t_m
}

fn healthy_second_sensors_mounted_backwards_change_nothing<C: BoardChip>() {
    let without = tip_m::<C>(&with_one_sensor(DEFAULT), Mounting::default());
    let mut scenario = scenario(DEFAULT);
    assert_eq!(tip_m::<C>(&scenario, Mounting::default()), without);
    let mounting = &mut scenario.converters.mounting;
    mounting.second_encoder_reversed = [true, false];
    mounting.second_force_reversed = [false, true];
    let mounted = *mounting;
    assert_eq!(tip_m::<C>(&scenario, mounted), without);
}

/// For the commissioning of the second sensors.
fn the_second_sensors_alone_drive_the_same_arm<C: BoardChip>() {
    let without = tip_m::<C>(&with_one_sensor(DEFAULT), Mounting::default());
    let mut scenario = scenario(DEFAULT);
    let mounting = &mut scenario.converters.mounting;
    mounting.sensors = SensorParts::Second;
    mounting.second_encoder_reversed = [false, true];
    mounting.second_force_reversed = [true, false];
    let mounted = *mounting;
    let mut bench = bench::<C>(&scenario, mounted);
    bench.board.wiring().force.dead = Some(false);
    bench.present();
    bench.drive();
    for _ in 0..300 {
        bench.tick();
    }
    // Their magnets are checked two ticks later, so that the drive arms later.
    let tip_m = bench.simulation.plant().snapshot().tip_t_m;
    assert!((tip_m - without).abs() < 1e-3, "{tip_m} {without}");
}

fn an_unknown_direction_of_a_second_encoder_is_found_with_the_first_motion<C: BoardChip>() {
    for joint in 0..2 {
        let scenario = scenario(DEFAULT);
        let mut mounted = Mounting::default();
        mounted.second_encoder_reversed[joint] = true;
        let mut bench = bench::<C>(&scenario, mounted);
        bench.drive();
        let harm = Harm::until_off(&mut bench, 2000);
        println!("joint {joint} backwards: {harm:?}");
        bench.assert_stays_off(100);
        assert_eq!(latched_fault(&mut bench), Some(Fault::EncoderOutOfRange));
    }
}

/// One bit in ten thousand on every line: the controller goes on, with the torque off at the ticks without a reading.
fn with_bit_errors_the_run_with_second_sensors_goes_on<C: BoardChip>() {
    let mut bench = driven::<C>();
    let wiring = bench.board.wiring();
    let encoders = wiring
        .encoders
        .iter_mut()
        .chain(&mut wiring.second_encoders);
    for (seed, encoder) in (1..).zip(encoders) {
        encoder.bit_errors = BitErrors::new(1e-4, seed);
    }
    wiring.force.bit_errors = BitErrors::new(1e-4, 11);
    wiring.second_force.bit_errors = BitErrors::new(1e-4, 12);
    for _ in 0..1000 {
        bench.tick();
    }
    assert_eq!(latched_fault(&mut bench), None);
    let wiring = bench.board.wiring();
    let encoders = wiring.encoders.iter().chain(&wiring.second_encoders);
    let flipped: u64 = encoders.map(|it| it.bit_errors.count).sum();
    assert!(flipped > 5, "{flipped}");
}
