//! The release of the control task: how long after the timer's event a tick begins.

#![allow(clippy::unwrap_used)]

use painleve_bound::report::Bound;
use painleve_chips::{MICROSECOND, SECOND};
use painleve_flash_image::bench::{Bench, scenario};
use painleve_flash_image::board::{BoardChip, F405, G474};
use painleve_shared::message::Request;
use painleve_tests::printed::{self, LastFigure};

use crate::bound::flashed;
use crate::bound::random::Random;

const TICKS: u32 = 300;

/// With two sensors on each channel, while the host asks for the board's health and its black box at random times. At 5 kHz the
/// sensors are still being read when the next tick is due.
#[test]
fn ticks_begin_within_the_bound_after_the_timer() {
    let mut table = String::from(
        "| µs: median, longest | 1 kHz | 3.3 kHz | 5 kHz | bound |\n|---|---|---|---|---|\n",
    );
    table += &row::<F405>("STM32F405");
    table += &row::<G474>("STM32G474");
    println!("{table}");
    printed::check("benchmarks.md", "release", &table, LastFigure::Measured);
}

fn row<C: BoardChip>(label: &str) -> String {
    let bound = Bound::of(&flashed::<C>()).unwrap_or_else(|error| panic!("{error}"));
    let bound_us = bound.chip.microseconds(bound.release_cycles());
    let cells = [1000, 3300, 5000].map(|tick_hz| {
        let mut delays = delays_us::<C>(tick_hz);
        delays.sort_by(f64::total_cmp);
        let (median, longest) = (delays[delays.len() / 2], delays[delays.len() - 1]);
        assert!(longest <= bound_us, "{label}, {tick_hz} Hz: {longest} µs");
        format!("{median:.1}, {longest:.1}")
    });
    format!("| {label} | {} | {bound_us:.1} |\n", cells.join(" | "))
}

/// From the timer's event to the feeding of the independent watchdog, with which a tick begins.
fn delays_us<C: BoardChip>(tick_hz: u32) -> Vec<f64> {
    let mut scenario = scenario("hybrid-elbow-down");
    scenario.run.tick_hz = tick_hz;
    let mut bench = Bench::<C>::new(&scenario);
    let mut random = Random(u64::from(tick_hz));
    let mut delays = Vec::new();
    for tick in 0..TICKS {
        if tick % 7 == 0 {
            let pause = random.below(SECOND / u64::from(2 * tick_hz) - MICROSECOND);
            bench.board.machine.run_for(pause);
            let is_health = random.below(2) == 0;
            bench.board.send(if is_health {
                &Request::Health
            } else {
                &Request::BlackBox
            });
        }
        let event = bench.board.machine.chip().next_tick();
        bench.tick();
        let fed = bench.board.machine.chip_mut().watchdogs_mut().0.fed;
        let delay = fed.checked_sub(event).expect("a tick");
        delays.push(delay as f64 / MICROSECOND as f64);
    }
    delays
}
