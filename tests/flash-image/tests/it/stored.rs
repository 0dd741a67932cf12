//! A configuration that the board has stored in its flash: it drives the arm without a host, and survives a power
//! failure at any operation of the flash.

#![allow(clippy::unwrap_used)]

use std::convert::Infallible;

use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use painleve_chips::machine::Reset;
use painleve_chips::{MILLISECOND, Picoseconds, SECOND};
use painleve_drivers::slots::Slots;
use painleve_flash_image::bench::{Bench, encoded, scenario};
use painleve_flash_image::board::{BoardChip, ENABLE, EmulatedBoard, F405, G474, RESET};
use painleve_plant::law_choice::build;
use painleve_shared::message::{Request, Response};
use painleve_shared::stored::{StoredConfiguration, StoredState};

const DEFAULT: &str = "hybrid-elbow-down";

/// Longest time to store a configuration, with a short erasure.
const PATIENCE: Picoseconds = 20 * MILLISECOND;

fn intact(version: u32) -> StoredConfiguration {
    StoredConfiguration {
        state: StoredState::Intact,
        version,
    }
}

fn ask<C: BoardChip>(board: &mut EmulatedBoard<C>, request: &Request<'_>) -> Option<Response> {
    while board.response(0).is_some() {}
    board.send(request);
    let erasure = board.machine.chip_mut().slots_mut().erasure;
    board.reply(PATIENCE + 2 * erasure)
}

fn store<C: BoardChip>(board: &mut EmulatedBoard<C>, name: &str) -> Option<Response> {
    let configuration = encoded(&scenario(name));
    let request = Request::Store {
        build: build(),
        configuration: &configuration,
    };
    ask(board, &request)
}

/// Switches the power off and on again, and asks for the stored configuration.
fn found_after_power_up<C: BoardChip>(board: &mut EmulatedBoard<C>) -> StoredConfiguration {
    board.machine.reset(Reset::Power);
    found_after_start(board)
}

fn found_after_start<C: BoardChip>(board: &mut EmulatedBoard<C>) -> StoredConfiguration {
    board.machine.run_for(30 * MILLISECOND);
    match ask(board, &Request::Stored) {
        Some(Response::Stored(stored)) => stored,
        other => panic!("{other:?}"),
    }
}

fn press_reset<C: BoardChip>(bench: &mut Bench<C>, ticks: u32) {
    bench.drive_pin(RESET, Some(true));
    for _ in 0..ticks {
        bench.tick();
    }
    bench.drive_pin(RESET, Some(false));
}

fn close_enable<C: BoardChip>(bench: &mut Bench<C>, is_closed: bool) {
    bench.drive_pin(ENABLE, Some(is_closed));
    for _ in 0..30 {
        bench.tick();
    }
}

fn is_driven<C: BoardChip>(bench: &Bench<C>) -> bool {
    bench.board.torque().enabled == Some(true)
}

fn drives_the_arm_without_a_host<C: BoardChip>(erasure: Picoseconds) {
    let mut board = EmulatedBoard::<C>::booted();
    // The control timer runs meanwhile, and the watchdogs are fed.
    board.machine.chip_mut().slots_mut().erasure = erasure;
    assert_eq!(
        store(&mut board, DEFAULT),
        Some(Response::Stored(intact(1)))
    );
    assert_eq!(board.resets(), []);
    assert_eq!(found_after_power_up(&mut board), intact(1));
    let mut bench = Bench::without_configuration(&scenario(DEFAULT), board);
    bench.closes_switch = false;
    // Neither the switch alone nor a short press arms the drive, nor a press with the switch closed.
    press_reset(&mut bench, 500);
    close_enable(&mut bench, true);
    assert!(!is_driven(&bench));
    press_reset(&mut bench, 1100);
    assert!(!is_driven(&bench));
    close_enable(&mut bench, false);
    close_enable(&mut bench, true);
    assert!(!is_driven(&bench));
    close_enable(&mut bench, false);
    // A second of the button, then the switch.
    press_reset(&mut bench, 1010);
    assert!(!is_driven(&bench));
    close_enable(&mut bench, true);
    for _ in 0..500 {
        assert!(is_driven(&bench));
        bench.tick();
    }
    // A stop withdraws the permission.
    close_enable(&mut bench, false);
    assert!(!is_driven(&bench));
    close_enable(&mut bench, true);
    bench.assert_stays_off(50);
    // A button that is stuck permits once.
    close_enable(&mut bench, false);
    bench.drive_pin(RESET, Some(true));
    for _ in 0..1010 {
        bench.tick();
    }
    close_enable(&mut bench, true);
    assert!(is_driven(&bench));
    close_enable(&mut bench, false);
    for _ in 0..1100 {
        bench.tick();
    }
    close_enable(&mut bench, true);
    bench.assert_stays_off(50);
    assert_eq!(bench.board.resets(), [Reset::Power]);
}

fn survives_a_power_failure_at_every_operation<C: BoardChip>() {
    let mut board = EmulatedBoard::<C>::booted();
    let mut versions = Vec::new();
    // With one and two configurations stored before, so that either slot is overwritten.
    for before in 1..3_u32 {
        let stored = store(&mut board, DEFAULT);
        assert_eq!(stored, Some(Response::Stored(intact(before))));
        let snapshot = board.snapshot();
        let start = board.machine.chip_mut().slots_mut().operations;
        assert!(store(&mut board, "edge").is_some());
        let operations = board.machine.chip_mut().slots_mut().operations - start;
        assert!(operations > 30, "{operations}");
        board.restore(&snapshot);
        for operation in 0..operations {
            board.machine.chip_mut().slots_mut().fail_in(operation);
            assert_eq!(store(&mut board, "edge"), None);
            assert_eq!(board.resets().last(), Some(&Reset::Power));
            let found = found_after_start(&mut board);
            let place = format!("operation {operation} after {before}: {found:?}");
            match found.state {
                StoredState::Intact => {
                    // The last words of the header are those of an erased flash.
                    let newer = operation + 3 >= operations && found.version == before + 1;
                    assert!(newer || found.version == before, "{place}");
                }
                _ => panic!("{place}"),
            }
            // Nothing has been reset but by the failure, and another configuration can be stored.
            let resets = board.resets().len();
            let next = intact(found.version + 1);
            assert_eq!(store(&mut board, DEFAULT), Some(Response::Stored(next)));
            assert_eq!(board.resets().len(), resets, "{place}");
            versions.push(found.version);
            board.restore(&snapshot);
        }
    }
    assert!(versions.contains(&1) && versions.contains(&2));
}

fn is_refused_with_a_reason<C: BoardChip>() {
    let mut board = EmulatedBoard::<C>::booted();
    let nothing = StoredConfiguration::default();
    assert_eq!(found_after_power_up(&mut board), nothing);
    let configuration = encoded(&scenario(DEFAULT));
    let request = Request::Store {
        build: build() ^ 1,
        configuration: &configuration,
    };
    let other_build = Some(Response::OtherBuild { build: build() });
    assert_eq!(ask(&mut board, &request), other_build);
    let mut invalid = configuration.clone();
    // The control rate is the first field of the configuration.
    invalid[..4].copy_from_slice(&f32::NAN.to_le_bytes());
    let request = Request::Store {
        build: build(),
        configuration: &invalid,
    };
    assert_eq!(ask(&mut board, &request), Some(Response::Refused));
    assert_eq!(board.machine.chip_mut().slots_mut().operations, 0);

    // Stored by a board with another build, or with other limits.
    let mut flash = ProgrammedFlash(vec![
        0xff;
        board.machine.chip_mut().slots_mut().bytes().len()
    ]);
    for (version, build, content, state) in [
        (1, build() ^ 1, &configuration, StoredState::OtherBuild),
        (2, build(), &invalid, StoredState::Refused),
        (3, build(), &configuration, StoredState::Intact),
    ] {
        let mut buffer = [0; 1024];
        let stored = Slots::new(&mut flash).store(build, content, &mut buffer);
        assert_eq!(stored, Ok(version));
        let slots = board.machine.chip_mut().slots_mut();
        slots.bytes_mut().copy_from_slice(&flash.0);
        let found = found_after_power_up(&mut board);
        assert_eq!(found, StoredConfiguration { state, version });
    }
    // A damaged newest one leaves the one before.
    let slots = board.machine.chip_mut().slots_mut();
    slots.bytes_mut()[100] ^= 0x10;
    let found = found_after_power_up(&mut board);
    assert_eq!((found.state, found.version), (StoredState::Refused, 2));
    let forgotten = ask(&mut board, &Request::Forget);
    assert_eq!(forgotten, Some(Response::Stored(nothing)));
    assert_eq!(found_after_power_up(&mut board), nothing);
}

#[test]
#[ignore = "takes longer than 20 s"]
fn a_stored_configuration_drives_the_arm_without_a_host() {
    drives_the_arm_without_a_host::<F405>(2 * SECOND);
    drives_the_arm_without_a_host::<G474>(25 * MILLISECOND);
}

#[test]
#[ignore = "takes longer than 20 s"]
fn a_power_failure_at_any_operation_leaves_a_configuration_f405() {
    survives_a_power_failure_at_every_operation::<F405>();
}

#[test]
#[ignore = "takes longer than 20 s"]
fn a_power_failure_at_any_operation_leaves_a_configuration_g474() {
    survives_a_power_failure_at_every_operation::<G474>();
}

#[test]
fn what_cannot_be_used_is_refused_with_a_reason() {
    is_refused_with_a_reason::<F405>();
    is_refused_with_a_reason::<G474>();
}

/// The content of a flash, as a programmer writes it.
struct ProgrammedFlash(Vec<u8>);

impl ErrorType for ProgrammedFlash {
    type Error = Infallible;
}

impl ReadNorFlash for ProgrammedFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Infallible> {
        let start = offset as usize;
        bytes.copy_from_slice(&self.0[start..start + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.len()
    }
}

impl NorFlash for ProgrammedFlash {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = 1;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Infallible> {
        self.0[from as usize..to as usize].fill(0xff);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Infallible> {
        let start = offset as usize;
        self.0[start..start + bytes.len()].copy_from_slice(bytes);
        Ok(())
    }
}
