//! The host fails, or asks for what must not be.

use std::collections::BTreeSet;

use painleve_chips::{BitErrors, MICROSECOND, MILLISECOND};
use painleve_flash_image::bench::{Bench, encoded, scenario};
use painleve_flash_image::board::{BoardChip, EmulatedBoard, F405, G474, RESET, STAGES_READY};
use painleve_plant::law_choice::build;
use painleve_plant::statistics::Statistics;
use painleve_shared::message::{FrameSource, PROTOCOL, Request, Response};
use painleve_shared::status::SupervisorState;
use painleve_shared::wire;

use super::{DEFAULT, assert_off_in_time, driven, in_lockstep};

/// Number of the control timer's interrupt.
const CONTROL_TIMER: usize = 28;

crate::on_each_board! {
    a_simulated_plant_never_switches_the_stages_on,
    a_lost_host_takes_the_torque_off,
    the_image_says_its_protocol_and_build_while_the_arm_is_driven,
    a_request_to_stop_takes_the_torque_off,
    nothing_arms_without_the_hosts_permission,
    a_drive_that_was_switched_off_needs_a_new_permission,
    a_permission_does_not_arm_while_the_switch_is_closed,
    a_switch_closed_in_a_fault_does_not_arm_after_the_reset,
    a_dry_run_controls_with_the_stages_off,
    a_configuration_of_another_build_is_refused,
    a_configuration_is_accepted_while_the_arm_is_driven,
    a_board_without_a_configuration_waits,
}

fn a_simulated_plant_never_switches_the_stages_on<C: BoardChip>() {
    let (mut board, mut simulation) = in_lockstep::<C>();
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
#[ignore = "takes longer than 20 s"]
fn a_refused_configuration_leaves_the_torque_off_at_any_time_of_a_tick() {
    leaves_the_torque_off_at_any_time_of_a_tick::<F405>();
}

#[test]
#[ignore = "takes longer than 20 s"]
fn a_refused_configuration_leaves_the_torque_off_at_any_time_of_a_tick_of_the_nucleo() {
    leaves_the_torque_off_at_any_time_of_a_tick::<G474>();
}

fn leaves_the_torque_off_at_any_time_of_a_tick<C: BoardChip>() {
    const THREADS: usize = 4;
    let results = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..THREADS)
            .map(|share| scope.spawn(move || torque_on_after_ticks::<C>(share, THREADS)))
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
fn torque_on_after_ticks<C: BoardChip>(share: usize, of: usize) -> (usize, BTreeSet<String>) {
    let mut bench = driven::<C>();
    let mut bytes = encoded(&scenario(DEFAULT));
    // The control rate is the first field of the configuration.
    bytes[..4].copy_from_slice(&f32::NAN.to_le_bytes());
    let board = &mut bench.board;
    while board.response(0).is_some() {}
    let mut buffer = [0; 1024];
    let request = Request::Configure {
        build: build(),
        source: FrameSource::Sensors,
        configuration: &bytes,
    };
    let message = wire::encode(&request, &mut buffer).unwrap().to_vec();
    board.send_slowly(&message, 150 * MICROSECOND);
    while !board.machine.chip().usart().incoming.is_empty() {
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

/// The host's process has ended, or its cable is disconnected.
fn a_lost_host_takes_the_torque_off<C: BoardChip>() {
    /// How long the host may be silent, ms; a tick takes as long.
    const LIMIT_MS: u32 = 200;
    let mut bench = driven::<C>();
    for _ in 0..600 {
        bench.tick();
    }
    assert_eq!(
        bench.board.torque().enabled,
        Some(true),
        "the host is there"
    );
    bench.host_is_there = false;
    bench.board.send(&Request::Alive);
    bench.wait_for_tick();
    let mut silent_ms = 0;
    while !bench.board.torque().is_off() {
        bench.wait_for_tick();
        silent_ms += 1;
        assert!(silent_ms < 1000);
    }
    println!("off after {silent_ms} ms");
    assert!((LIMIT_MS..=LIMIT_MS + 2).contains(&silent_ms));
    bench.assert_stays_off(100);
}

fn the_image_says_its_protocol_and_build_while_the_arm_is_driven<C: BoardChip>() {
    let mut bench = driven::<C>();
    bench.board.send(&Request::Identify);
    let identity = Response::Identity {
        protocol: PROTOCOL,
        build: build(),
    };
    assert_eq!(bench.board.reply(5 * MILLISECOND), Some(identity));
    bench.board.send(&Request::Sources);
    let sources = Response::Sources(painleve_firmware::SOURCES);
    assert_eq!(bench.board.reply(5 * MILLISECOND), Some(sources));
    bench.tick();
    assert_eq!(bench.board.torque().enabled, Some(true));
}

fn a_request_to_stop_takes_the_torque_off<C: BoardChip>() {
    let mut bench = driven::<C>();
    bench.board.send(&Request::Stop);
    assert_eq!(bench.board.reply(5 * MILLISECOND), Some(Response::Stopped));
    assert!(bench.board.torque().is_off());
    bench.assert_stays_off(100);
}

/// Runs 300 ms on an arm at rest, with a host; the switch is closed after 100 ms. Checks that the torque stays
/// off, and returns whether the controller was armed.
fn was_armed_with_the_stages_off<C: BoardChip>(board: &mut EmulatedBoard<C>) -> bool {
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
    was_armed
}

fn nothing_arms_without_the_hosts_permission<C: BoardChip>() {
    let Bench::<C> { mut board, .. } =
        Bench::<C>::without_configuration(&scenario(DEFAULT), EmulatedBoard::<C>::booted());
    let response = board.configure(FrameSource::Sensors, &encoded(&scenario(DEFAULT)));
    assert!(matches!(response, Some(Response::Ready { .. })));
    assert!(!was_armed_with_the_stages_off(&mut board));
}

/// A drive that has stopped needs a new permission: closing the switch again is not enough.
fn a_drive_that_was_switched_off_needs_a_new_permission<C: BoardChip>() {
    let mut bench = driven::<C>();
    bench.board.enable(false);
    assert!(bench.time_until_off().is_some());
    bench.assert_stays_off(20);
    bench.board.enable(true);
    bench.assert_stays_off(100);
}

/// Opens the switch and closes it again, and checks that the arm is driven then.
fn assert_drives_after_opening_and_closing<C: BoardChip>(bench: &mut Bench<C>) {
    bench.board.enable(false);
    bench.assert_stays_off(20);
    bench.board.enable(true);
    assert!(!bench.stays_off(100));
}

/// The arm moves when the operator closes the switch, never when the host permits it.
fn a_permission_does_not_arm_while_the_switch_is_closed<C: BoardChip>() {
    let mut bench = driven::<C>();
    bench.board.enable(false);
    assert!(bench.time_until_off().is_some());
    bench.assert_stays_off(20);
    bench.board.enable(true);
    bench.assert_stays_off(20);
    assert!(bench.board.permit_arming());
    bench.assert_stays_off(100);
    assert_drives_after_opening_and_closing(&mut bench);
}

/// Nor does it if a reading is lost then, after which ENABLE comes again.
fn a_switch_closed_in_a_fault_does_not_arm_after_the_reset<C: BoardChip>() {
    let mut bench = driven::<C>();
    bench.drive_pin(STAGES_READY, Some(false));
    assert!(bench.time_until_off().is_some());
    bench.assert_stays_off(5);
    bench.drive_pin(STAGES_READY, Some(true));
    bench.board.enable(false);
    bench.assert_stays_off(100);
    assert!(bench.board.permit_arming());
    bench.assert_stays_off(20);
    bench.board.enable(true);
    bench.assert_stays_off(20);
    bench.drive_pin(RESET, Some(true));
    bench.assert_stays_off(20);
    bench.drive_pin(RESET, Some(false));
    bench.assert_stays_off(100);
    bench.board.wiring().encoders[0].bit_errors = BitErrors::new(0.5, 1);
    bench.assert_stays_off(1);
    bench.board.wiring().encoders[0].bit_errors = BitErrors::new(0.0, 1);
    bench.assert_stays_off(200);
    assert_drives_after_opening_and_closing(&mut bench);
}

fn a_dry_run_controls_with_the_stages_off<C: BoardChip>() {
    let Bench::<C> { mut board, .. } =
        Bench::<C>::without_configuration(&scenario(DEFAULT), EmulatedBoard::<C>::booted());
    let response = board.configure(FrameSource::DryRun, &encoded(&scenario(DEFAULT)));
    assert!(matches!(response, Some(Response::Ready { .. })));
    assert!(board.permit_arming());
    assert!(was_armed_with_the_stages_off(&mut board));
}

fn a_configuration_of_another_build_is_refused<C: BoardChip>() {
    let mut bench = driven::<C>();
    bench.board.send(&Request::Configure {
        build: build() ^ 1,
        source: FrameSource::Sensors,
        configuration: &encoded(&scenario(DEFAULT)),
    });
    let reply = bench.board.reply(20 * MILLISECOND);
    assert_eq!(reply, Some(Response::OtherBuild { build: build() }));
    assert_off_in_time(bench);
}

fn a_configuration_is_accepted_while_the_arm_is_driven<C: BoardChip>() {
    let mut bench = driven::<C>();
    let response = bench
        .board
        .configure(FrameSource::Sensors, &encoded(&scenario(DEFAULT)));
    assert_eq!(bench.board.machine.chip().usart().overruns, 0);
    assert!(
        matches!(response, Some(Response::Ready { .. })),
        "{response:?}"
    );
    assert_off_in_time(bench);
}

fn a_board_without_a_configuration_waits<C: BoardChip>() {
    let mut board = EmulatedBoard::<C>::booted();
    board.machine.run_for(5000 * MILLISECOND);
    assert_eq!(board.resets(), []);
}
