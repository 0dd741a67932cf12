//! The watchdogs: they must neither reset a healthy board nor let a dead one drive on, in any phase of their prescalers.

use painleve_chips::machine::Reset;
use painleve_chips::{MILLISECOND, Picoseconds, SECOND};
use painleve_flash_image::bench::{Bench, encoded, with_one_sensor};
use painleve_flash_image::board::{BoardChip, EmulatedBoard};
use painleve_plant::law_choice::build;
use painleve_plant::scenario::Scenario;
use painleve_shared::message::{FrameSource, RefusedRate, Request, Response};
use painleve_shared::stored::StoredState;

use super::DEFAULT;

crate::on_each_board! {
    a_finished_tick_feeds_the_watchdogs_in_time,
    a_plant_that_the_host_simulates_may_have_any_rate,
    a_running_board_can_be_configured_anew,
    a_driven_board_stores_and_forgets_without_a_reset,
}

fn at_rate(tick_hz: u32) -> Scenario {
    let mut scenario = with_one_sensor(DEFAULT);
    scenario.run.tick_hz = tick_hz;
    scenario
}

/// A board that has booted, with an oscillator of this frequency and these phases of the prescalers.
fn booted<C: BoardChip>(oscillator_hz: u64, phase: u64) -> EmulatedBoard<C> {
    let mut board = EmulatedBoard::<C>::with_oscillator(oscillator_hz);
    board.machine.chip_mut().set_watchdog_phase(phase);
    board.machine.run_for(20 * MILLISECOND);
    board
}

/// Each rate is either watched over or refused: no prescaler makes a limit that is longer than a tick and shorter
/// than two. One count of the STM32F405 takes 97.5 µs.
fn a_finished_tick_feeds_the_watchdogs_in_time<C: BoardChip>() {
    let mut accepted = Vec::new();
    for tick_hz in [250, 1000, 2000, 5000, 5200, 5298, 6600, 8000, 10_000] {
        match refusal::<C>(tick_hz) {
            None => {
                watches_over::<C>(tick_hz);
                accepted.push(tick_hz);
            }
            Some(refused) => {
                assert_eq!(refused.tick_hz, tick_hz);
                let nearest = [refused.below_hz, refused.above_hz];
                for other in nearest.into_iter().filter(|it| *it != 0) {
                    assert_eq!(refusal::<C>(other), None, "instead of {tick_hz} Hz");
                }
                println!("{tick_hz} Hz is refused: {nearest:?}");
            }
        }
    }
    let expected: &[u32] = match C::IMAGE {
        "painleve-f405" => &[250, 1000, 2000, 5000, 6600],
        _ => &[250, 1000, 2000, 5000, 5200, 5298, 6600, 8000, 10_000],
    };
    assert_eq!(accepted, expected);
}

/// Configures a board that has just booted with a control rate.
pub fn refusal<C: BoardChip>(tick_hz: u32) -> Option<RefusedRate> {
    let mut board = booted::<C>(32_000, 0);
    match board.configure(FrameSource::Sensors, &encoded(&at_rate(tick_hz))) {
        Some(Response::Ready { .. }) => None,
        Some(Response::RateRefused(refused)) => Some(refused),
        other => panic!("{tick_hz} Hz: {other:?}"),
    }
}

/// The prescaler meets the ticks of one run in many phases.
fn watches_over<C: BoardChip>(tick_hz: u32) {
    let mut bench = Bench::<C>::with_board(&at_rate(tick_hz), booted(32_000, 1234));
    for tick in 0..100 {
        bench.tick();
        assert_eq!(bench.board.resets(), [], "{tick_hz} Hz, tick {tick}");
    }
    let healthy = bench.snapshot();
    for phase in (0..8).map(|it| 512 * it) {
        bench.restore(&healthy);
        bench.board.machine.chip_mut().set_watchdog_phase(phase);
        bench.tick();
        bench.board.machine.hang();
        bench.board.machine.run_for(2 * SECOND / u64::from(tick_hz));
        assert_eq!(
            bench.board.resets(),
            [Reset::WindowWatchdog],
            "{tick_hz} Hz, phase {phase}"
        );
        assert_ne!(bench.board.torque().enabled, Some(true));
    }
}

/// Without torque stages no promise depends on the watchdogs, which must only not be too early.
fn a_plant_that_the_host_simulates_may_have_any_rate<C: BoardChip>() {
    for tick_hz in [250, 5200, 8000, 10_000, 20_000] {
        let mut board = booted::<C>(32_000, 1234);
        let response = board.configure(FrameSource::Lockstep, &encoded(&at_rate(tick_hz)));
        assert!(
            matches!(response, Some(Response::Ready { .. })),
            "{response:?}"
        );
        board.machine.run_for(100 * MILLISECOND);
        assert_eq!(board.resets(), [], "{tick_hz} Hz");
    }
}

/// Driven at rates up to 8 kHz: at faster ones the readings of the force cell come too late.
fn a_running_board_can_be_configured_anew<C: BoardChip>() {
    // The STM32F405 refuses the faster ones.
    let faster = [(8000, 0), (9000, 0), (9000, 333_333), (10_000, 555_555)];
    let faster = match C::IMAGE {
        "painleve-f405" => &faster[..0],
        _ => &faster[..],
    };
    let rates = [(1000, 0), (5000, 0), (5000, 777_777), (6600, 0)];
    // The watchdog of the fastest oscillator ends first.
    let [.., oscillator_hz] = C::OSCILLATOR_HZ;
    for (tick_hz, phase) in rates.iter().chain(faster).copied() {
        let place = format!("{tick_hz} Hz, phase {phase}");
        let board = booted(oscillator_hz, phase);
        let mut bench = Bench::<C>::with_board(&at_rate(tick_hz), board);
        if tick_hz <= 8000 {
            bench.drive();
        }
        let board = &mut bench.board;
        for _ in 0..6 {
            let response = board.configure(FrameSource::Sensors, &encoded(&at_rate(tick_hz)));
            let is_ready = matches!(response, Some(Response::Ready { .. }));
            assert!(is_ready, "{place}: {response:?}");
            assert!(board.torque().is_off(), "{place}");
            board.machine.run_for(5 * MILLISECOND);
            assert!(board.torque().is_off(), "{place}");
            assert_eq!(board.resets(), [], "{place}");
        }
    }
}

/// An erasure takes many ticks, in which nothing else but the watchdogs is served.
fn a_driven_board_stores_and_forgets_without_a_reset<C: BoardChip>() {
    const ERASURE: Picoseconds = 25 * MILLISECOND;
    let rates: &[u32] = match C::IMAGE {
        "painleve-f405" => &[5000],
        _ => &[5000, 8000],
    };
    let [.., oscillator_hz] = C::OSCILLATOR_HZ;
    for tick_hz in rates.iter().copied() {
        let configuration = encoded(&at_rate(tick_hz));
        let store = Request::Store {
            build: build(),
            configuration: &configuration,
        };
        for (request, state) in [
            (store, StoredState::Intact),
            (Request::Forget, StoredState::Empty),
        ] {
            let board = booted(oscillator_hz, 0);
            let mut bench = Bench::<C>::with_board(&at_rate(tick_hz), board);
            bench.drive();
            let board = &mut bench.board;
            board.machine.chip_mut().slots_mut().erasure = ERASURE;
            board.send(&request);
            let response = board.reply(4 * ERASURE);
            let is_done = matches!(&response, Some(Response::Stored(it)) if it.state == state);
            assert!(is_done, "{tick_hz} Hz, {request:?}: {response:?}");
            assert!(board.torque().is_off());
            board.machine.run_for(100 * MILLISECOND);
            assert!(board.torque().is_off());
            assert_eq!(board.resets(), [], "{tick_hz} Hz, {request:?}");
        }
    }
}
