//! Hazards of the board: executes every row of the hazard table in docs/flashing.md on the image
//! that is flashed.

#![allow(clippy::unwrap_used)]

use std::collections::BTreeSet;

use painleve_firmware::BUILD;
use painleve_flash_image::bench::{BoardBench, encoded, scenario};
use painleve_flash_image::board::{FlashedBoard, STAGES_READY};
use painleve_flash_image::machine::Reset;
use painleve_flash_image::{MICROSECOND, MILLISECOND};
use painleve_plant::plant::Plant as _;
use painleve_plant::scenario::Scenario;
use painleve_plant::simulation::Simulation;
use painleve_plant::statistics::Statistics;
use painleve_shared::black_box::{BlackBox, Crash, ResetCause};
use painleve_shared::counts::ForceCounts;
use painleve_shared::message::{FrameSource, PROTOCOL, Request, Response};
use painleve_shared::mounting::Mounting;
use painleve_shared::status::{Fault, SupervisorState};
use painleve_shared::wire;

const DEFAULT: &str = "hybrid-elbow-down";

/// Number of the control timer's interrupt.
const CONTROL_TIMER: usize = 28;

fn driven() -> BoardBench {
    let mut bench = BoardBench::new(&scenario(DEFAULT));
    bench.drive();
    bench
}

/// Checks that the torque is off by the end of the second tick from now and stays off, although the
/// switch stays closed.
fn assert_off_in_time(mut bench: BoardBench) {
    let off = bench.time_until_off();
    assert!(off.is_some(), "{:?}", bench.board.torque());
    bench.assert_stays_off(100);
}

fn in_lockstep() -> (FlashedBoard, Simulation) {
    let scenario = scenario(DEFAULT);
    let mut board = FlashedBoard::booted();
    let response = board.configure(FrameSource::Lockstep, &encoded(&scenario));
    assert!(matches!(response, Some(Response::Ready { .. })));
    (board, Simulation::new(&scenario).unwrap())
}

#[test]
fn a_simulated_plant_never_switches_the_stages_on() {
    let (mut board, mut simulation) = in_lockstep();
    let mut statistics = Statistics::new(0.05);
    for _ in 0..400 {
        let frame = simulation.sample(&mut statistics).unwrap();
        let answer = board.exchange(&frame).expect("an answer");
        simulation.advance(Some(&answer), &mut statistics).unwrap();
        assert!(board.torque().is_off());
        assert_eq!(board.torque().counts, [0; 2]);
    }
    // No more frames.
    board.machine.run_for(5000 * MILLISECOND);
    assert!(board.torque().is_off());
    assert_eq!(board.torque().counts, [0; 2]);
}

/// Runs a tick of the control timer at every instruction of the reconfiguration at which one is
/// possible.
#[test]
fn a_refused_configuration_leaves_the_torque_off_at_any_time_of_a_tick() {
    const THREADS: usize = 4;
    let results = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..THREADS)
            .map(|share| scope.spawn(move || torque_on_after_ticks(share, THREADS)))
            .collect();
        let join = |thread: std::thread::ScopedJoinHandle<'_, _>| thread.join().unwrap();
        threads.into_iter().map(join).collect::<Vec<_>>()
    });
    let instants: usize = results.iter().map(|(instants, _)| instants).sum();
    assert!(instants > 1000, "{instants}");
    let on: BTreeSet<_> = results.into_iter().flat_map(|(_, on)| on).collect();
    assert!(on.is_empty(), "{on:?}");
}

/// Tests every `of`-th instant, starting with `share`. Returns their number, and the functions in
/// which a tick left the torque on.
fn torque_on_after_ticks(share: usize, of: usize) -> (usize, BTreeSet<String>) {
    let mut bench = driven();
    let mut bytes = encoded(&scenario(DEFAULT));
    // The control rate is the first field of the configuration.
    bytes[..4].copy_from_slice(&f32::NAN.to_le_bytes());
    let board = &mut bench.board;
    while board.response(0).is_some() {}
    let mut buffer = [0; 1024];
    let request = Request::Configure {
        build: BUILD,
        source: FrameSource::Sensors,
        configuration: &bytes,
    };
    let message = wire::encode(&request, &mut buffer).unwrap().to_vec();
    board.send_slowly(&message, 150 * MICROSECOND);
    while !board.machine.chip().usart.incoming.is_empty() {
        board.machine.run_for(5 * MICROSECOND);
    }
    let received = board.machine.snapshot();
    assert_eq!(board.reply(20 * MILLISECOND), Some(Response::Refused));
    let end = board.machine.now();
    board.machine.restore(&received);
    let (mut instant, mut tried, mut on) = (0, 0, BTreeSet::new());
    while board.machine.now() < end {
        board.machine.run_instructions(1, MICROSECOND);
        if !board.machine.would_take(CONTROL_TIMER) {
            continue;
        }
        instant += 1;
        if instant % of != share {
            continue;
        }
        tried += 1;
        let here = board.machine.snapshot();
        board.machine.pend(CONTROL_TIMER);
        board.machine.run_for(1200 * MICROSECOND);
        if !board.torque().is_off() {
            let place = board.machine.symbol_at(here.program_counter());
            on.insert(place.to_owned());
        }
        board.machine.restore(&here);
    }
    (tried, on)
}

#[test]
fn the_first_instructions_switch_the_stages_off() {
    let mut board = FlashedBoard::default();
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

#[test]
fn a_dead_crystal_leaves_the_stages_off() {
    let mut board = FlashedBoard::default();
    board.machine.chip_mut().rcc.crystal_works = false;
    for _ in 0..200 {
        board.machine.run_for(10 * MILLISECOND);
        assert!(board.torque().is_off(), "{:?}", board.torque());
    }
}

#[test]
fn a_hard_fault_takes_the_torque_off() {
    let mut bench = driven();
    bench.board.machine.hard_fault();
    assert_off_in_time(bench);
}

#[test]
fn an_unexpected_interrupt_takes_the_torque_off() {
    let mut bench = driven();
    bench.board.machine.raise(16 + 40);
    assert_off_in_time(bench);
}

/// Tested over the whole range of the independent watchdog's oscillator.
#[test]
fn a_control_timer_that_stops_takes_the_torque_off() {
    for oscillator_hz in [17_000, 32_000, 47_000] {
        let mut board = FlashedBoard::with_oscillator(oscillator_hz);
        board.machine.run_for(20 * MILLISECOND);
        let mut bench = BoardBench::with_board(&scenario(DEFAULT), board);
        bench.drive();
        for _ in 0..500 {
            bench.tick();
        }
        assert_eq!(bench.board.resets(), [], "fed in time");
        bench.board.machine.chip_mut().timer = Default::default();
        assert_off_in_time(bench);
    }
}

#[test]
fn a_program_that_hangs_takes_the_torque_off() {
    let mut bench = driven();
    bench.board.machine.hang();
    assert_off_in_time(bench);
}

#[test]
fn a_crystal_that_stops_takes_the_torque_off() {
    let mut bench = driven();
    bench.board.machine.chip_mut().rcc.stop_crystal();
    assert_off_in_time(bench);
}

#[test]
fn a_low_supply_takes_the_torque_off() {
    for millivolts in [2850, 2600] {
        let mut bench = driven();
        bench.board.machine.chip_mut().set_supply(millivolts);
        assert_off_in_time(bench);
    }
}

/// The host's process has ended, or its cable is disconnected.
#[test]
fn a_lost_host_takes_the_torque_off() {
    let mut bench = driven();
    for _ in 0..600 {
        bench.tick();
    }
    assert_eq!(
        bench.board.torque().enabled,
        Some(true),
        "the host is there"
    );
    bench.host_is_there = false;
    for _ in 0..210 {
        bench.wait_for_tick();
    }
    assert!(bench.board.torque().is_off());
    bench.assert_stays_off(100);
}

#[test]
fn the_image_says_its_protocol_and_build_while_the_arm_is_driven() {
    let mut bench = driven();
    bench.board.send(&Request::Identify);
    let identity = Response::Identity {
        protocol: PROTOCOL,
        build: BUILD,
    };
    assert_eq!(bench.board.reply(5 * MILLISECOND), Some(identity));
    bench.tick();
    assert_eq!(bench.board.torque().enabled, Some(true));
}

#[test]
fn a_request_to_stop_takes_the_torque_off() {
    let mut bench = driven();
    bench.board.send(&Request::Stop);
    assert_eq!(bench.board.reply(5 * MILLISECOND), Some(Response::Stopped));
    assert!(bench.board.torque().is_off());
    bench.assert_stays_off(100);
}

#[test]
fn nothing_arms_without_the_hosts_permission() {
    let mut board = FlashedBoard::booted();
    let response = board.configure(FrameSource::Sensors, &encoded(&scenario(DEFAULT)));
    assert!(matches!(response, Some(Response::Ready { .. })));
    for n in 0..300 {
        if n % 50 == 0 {
            board.send(&Request::Alive);
        }
        board.enable(n > 100);
        board.machine.run_for(MILLISECOND);
        assert!(board.torque().is_off());
    }
}

/// A drive that has stopped needs a new permission: closing the switch again is not enough.
#[test]
fn a_drive_that_was_switched_off_needs_a_new_permission() {
    let mut bench = driven();
    bench.board.enable(false);
    assert!(bench.time_until_off().is_some());
    bench.assert_stays_off(20);
    bench.board.enable(true);
    bench.assert_stays_off(100);
}

#[test]
fn a_dry_run_controls_with_the_stages_off() {
    let BoardBench { mut board, .. } =
        BoardBench::without_configuration(&scenario(DEFAULT), FlashedBoard::booted());
    let response = board.configure(FrameSource::DryRun, &encoded(&scenario(DEFAULT)));
    assert!(matches!(response, Some(Response::Ready { .. })));
    assert!(board.permit_arming());
    let mut was_armed = false;
    for n in 0..300 {
        if n % 50 == 0 {
            board.send(&Request::Alive);
        }
        board.enable(n > 100);
        board.machine.run_for(MILLISECOND);
        assert!(board.torque().is_off());
        while let Some(response) = board.response(0) {
            if let Response::Tick { answer, .. } = response {
                was_armed |= answer.supervisor_state() == Some(SupervisorState::Armed);
            }
        }
    }
    assert!(was_armed);
}

#[test]
fn a_configuration_of_another_build_is_refused() {
    let mut bench = driven();
    bench.board.send(&Request::Configure {
        build: BUILD ^ 1,
        source: FrameSource::Sensors,
        configuration: &encoded(&scenario(DEFAULT)),
    });
    let reply = bench.board.reply(20 * MILLISECOND);
    assert_eq!(reply, Some(Response::OtherBuild { build: BUILD }));
    assert_off_in_time(bench);
}

#[test]
fn a_reset_takes_the_torque_off() {
    let mut bench = driven();
    bench.board.machine.chip_mut().reset_pin();
    bench.run_ms(1);
    assert_eq!(bench.board.resets(), [Reset::Pin]);
    assert_off_in_time(bench);
}

#[test]
fn the_switch_takes_the_torque_off_and_a_bounce_does_not_put_it_on() {
    let mut bench = driven();
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

#[test]
fn sensors_that_die_take_the_torque_off() {
    for level in [false, true] {
        for encoder in 0..2 {
            let mut bench = driven();
            bench.board.wiring().encoders[encoder].dead = Some(level);
            assert_off_in_time(bench);
        }
    }
    let mut bench = driven();
    bench.board.wiring().force.dead = Some(true);
    assert_off_in_time(bench);
}

/// The fault latched in the newest answer of the image.
fn latched_fault(bench: &mut BoardBench) -> Option<Fault> {
    bench.wait_for_tick();
    bench.board.machine.run_for(MILLISECOND / 2);
    let mut fault = None;
    while let Some(response) = bench.board.response(0) {
        if let Response::Tick { answer, .. } = response {
            fault = answer.latched_fault();
        }
    }
    fault
}

/// The tip moves on the belt; the encoder repeats a plausible angle.
#[test]
fn an_encoder_that_freezes_takes_the_torque_off() {
    for encoder in 0..2 {
        let mut bench = driven();
        bench.is_frozen[encoder] = true;
        let mut ticks = 0;
        while !bench.board.torque().is_off() {
            bench.tick();
            ticks += 1;
            assert!(ticks < 2000, "encoder {encoder}");
        }
        let fault = latched_fault(&mut bench);
        println!("encoder {encoder}: {fault:?} after {ticks} ticks");
        assert!(fault.is_some());
        bench.assert_stays_off(100);
    }
}

#[test]
fn a_torque_stage_that_is_not_ready_takes_the_torque_off() {
    let mut bench = driven();
    bench.drive_pin(STAGES_READY, Some(false));
    assert!(bench.time_until_off().is_some());
    bench.assert_stays_off(10);
    assert_eq!(latched_fault(&mut bench), Some(Fault::StageNotReady));
    bench.drive_pin(STAGES_READY, Some(true));
    bench.assert_stays_off(100);
}

/// An encoder that is zeroed 30° wrongly, a torque stage that is not ready.
#[test]
fn arming_on_implausible_readings_is_refused_with_a_fault() {
    for (offsets, ready) in [([1365, 0], true), ([0, 1365], true), ([0, 0], false)] {
        let mut bench =
            BoardBench::without_configuration(&scenario(DEFAULT), FlashedBoard::booted());
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

/// The records of the image, requested after its start.
fn black_box(board: &mut FlashedBoard) -> BlackBox {
    board.send(&Request::BlackBox);
    match board.reply(20 * MILLISECOND) {
        Some(Response::BlackBox(content)) => content,
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_black_box_outlives_a_reset_and_names_its_reason() {
    let mut bench = driven();
    assert_eq!(black_box(&mut bench.board).reset, ResetCause::Power);
    assert_eq!(black_box(&mut bench.board).starts, 1);
    bench.board.wiring().force.dead = Some(true);
    assert!(bench.time_until_off().is_some());
    bench.assert_stays_off(5);
    let before = bench.board.machine.program_counter();
    bench.board.machine.hard_fault();
    bench.run_ms(30);
    let content = black_box(&mut bench.board);
    assert_eq!(content.reset, ResetCause::Software);
    assert_eq!(content.starts, 2);
    let fault = content.fault.expect("the fault of the force cell");
    assert_eq!(fault.answer.latched_fault(), Some(Fault::ForceOutOfRange));
    assert!(fault.sensor.normal_force.0 > 1 << 20);
    let is_there = |crash| matches!(crash, Some(Crash::HardFault { program_counter, .. }) if program_counter == before);
    assert!(is_there(content.crash), "{content:?}, {before:#x}");
    bench.board.machine.hang();
    bench.run_ms(30);
    assert_eq!(black_box(&mut bench.board).reset, ResetCause::Watchdog);
}

/// Every part mounted backwards and the force cell not at zero: the settings make it the same arm.
#[test]
fn parts_mounted_backwards_drive_the_same_arm() {
    let mounted = Mounting {
        encoder_reversed: [true; 2],
        stage_reversed: [true; 2],
        force_reversed: [true; 2],
        force_tare: [ForceCounts(37), ForceCounts(-55)],
    };
    let mut scenario = scenario(DEFAULT);
    let tip_m = |scenario: &Scenario, mounted| {
        let mut bench = BoardBench::without_configuration(scenario, FlashedBoard::booted());
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

#[test]
fn the_image_respects_the_limits_of_the_data_sheets() {
    let mut bench = driven();
    for _ in 0..200 {
        bench.tick();
    }
    assert_eq!(bench.board.wiring().violations(), [""; 0]);
}

#[test]
fn forces_of_either_sign_are_converted() {
    let mut bench = driven();
    let conversions = &bench.board.wiring().force.conversions;
    assert!(conversions.iter().any(|it| *it < 0), "{conversions:?}");
}

#[test]
fn one_disturbed_transfer_is_no_fault() {
    let mut bench = driven();
    bench.board.wiring().encoders[0].errors |= 4;
    for _ in 0..50 {
        bench.tick();
    }
    assert_eq!(bench.board.torque().enabled, Some(true));
}

#[test]
fn nothing_arms_on_dead_lines_or_on_a_switch_that_was_closed_before() {
    for level in [false, true] {
        let mut board = FlashedBoard::default();
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
    let mut board = FlashedBoard::default();
    board.enable(true);
    board.machine.run_for(20 * MILLISECOND);
    let mut bench = BoardBench::with_board(&scenario(DEFAULT), board);
    for _ in 0..300 {
        bench.board.enable(true);
        bench.wait_for_tick();
        assert!(bench.board.torque().is_off());
    }
}

#[test]
fn a_configuration_is_accepted_while_the_arm_is_driven() {
    let mut bench = driven();
    let response = bench
        .board
        .configure(FrameSource::Sensors, &encoded(&scenario(DEFAULT)));
    assert_eq!(bench.board.machine.chip().usart.overruns, 0);
    assert!(
        matches!(response, Some(Response::Ready { .. })),
        "{response:?}"
    );
    assert_off_in_time(bench);
}

/// A debugger has attached to the log and then disconnected.
#[test]
fn an_unread_log_does_not_block_the_image() {
    let mut bench = driven();
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

#[test]
fn a_board_without_a_configuration_waits() {
    let mut board = FlashedBoard::booted();
    board.machine.run_for(5000 * MILLISECOND);
    assert_eq!(board.resets(), []);
}

#[test]
fn both_torques_change_at_once_over_the_whole_range() {
    let mut bench = driven();
    assert!(!bench.board.machine.chip().dac_is_buffered());
    let before = bench.board.machine.chip().dac_writes();
    for _ in 0..10 {
        bench.tick();
    }
    assert_eq!(bench.board.machine.chip().dac_writes() - before, 10);
}
