//! Hazards of the boards: executes every row of the hazard table in docs/flashing.md on the images that are
//! flashed.

#![allow(clippy::unwrap_used)]

mod chip;
mod host;
pub mod second_sensors;
pub mod sensors;
pub mod watchdogs;

use painleve_chips::MILLISECOND;
use painleve_flash_image::bench::{Bench, encoded, scenario};
use painleve_flash_image::board::{BoardChip, EmulatedBoard};
use painleve_plant::simulation::Simulation;
use painleve_shared::message::{FrameSource, Response};
use painleve_shared::status::Fault;

const DEFAULT: &str = "hybrid-elbow-down";

/// Declares tests that execute these functions on each board.
#[macro_export]
macro_rules! on_each_board {
    ($($name:ident),+ $(,)?) => {
        mod f405 {
            type Chip = painleve_flash_image::board::F405;
            $(
                #[test]
                fn $name() {
                    super::$name::<Chip>();
                }
            )+
        }

        mod g474 {
            type Chip = painleve_flash_image::board::G474;
            $(
                #[test]
                #[ignore = "second chip"]
                fn $name() {
                    super::$name::<Chip>();
                }
            )+
        }
    };
}

fn driven<C: BoardChip>() -> Bench<C> {
    let mut bench = Bench::<C>::new(&scenario(DEFAULT));
    bench.drive();
    bench
}

/// Checks that the torque is off by the end of the second tick from now and stays off, although the
/// switch stays closed.
fn assert_off_in_time<C: BoardChip>(mut bench: Bench<C>) {
    let off = bench.time_until_off();
    assert!(off.is_some(), "{:?}", bench.board.torque());
    bench.assert_stays_off(100);
}

fn in_lockstep<C: BoardChip>() -> (EmulatedBoard<C>, Simulation) {
    let scenario = scenario(DEFAULT);
    let mut board = EmulatedBoard::<C>::booted();
    let response = board.configure(FrameSource::Lockstep, &encoded(&scenario));
    assert!(matches!(response, Some(Response::Ready { .. })));
    (board, Simulation::new(&scenario).unwrap())
}

/// The fault latched in the newest answer of the image.
fn latched_fault<C: BoardChip>(bench: &mut Bench<C>) -> Option<Fault> {
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
