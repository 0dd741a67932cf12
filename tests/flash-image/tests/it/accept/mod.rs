//! The acceptance of a bare board: every built-in defect is found by the step that looks for it, and nothing is found
//! on healthy boards.

#![allow(clippy::unwrap_used)]

mod defect;
mod port;
mod program;

use core::ops::ControlFlow;

use painleve_accept::chip::CHIPS;
use painleve_accept::{AcceptError, Acceptance, Verdict, accept};
use painleve_board::Serial;
use painleve_chips::stm32::WiredChip as _;
use painleve_chips::{MICROSECOND, MILLISECOND, SECOND};
use painleve_flash_image::bare::{BareBench, Output};
use painleve_flash_image::board::{BoardChip, EmulatedBoard, F405, G474};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use self::defect::Defect;
use self::port::EmulatedPort;

/// First seed of the random boards.
const FIRST_SEED: u64 = 31_000;

/// Number of healthy boards of each chip: fifty in all.
const HEALTHY: u64 = 25;

/// Returns a healthy board of this seed, with a defect built in: clocks, phases, converters, delays of the host and open
/// lines are random within the data sheets' tolerances.
fn board<C: BoardChip>(seed: u64, defect: Option<Defect>) -> EmulatedPort<C> {
    let mut random = Pcg64::seed_from_u64(seed);
    let [slowest, _, fastest] = C::OSCILLATOR_HZ;
    let oscillator_hz = random.random_range(slowest..=fastest);
    let output = |random: &mut Pcg64| Output {
        gain: random.random_range(0.996..1.004),
        offset: random.random_range(-10.0..10.0),
        ..Output::default()
    };
    let mut bench = BareBench {
        outputs: [output(&mut random), output(&mut random)],
        noise: 4,
        random: random.random(),
        ..BareBench::default()
    };
    if let Some(defect) = defect {
        defect.build_into_bench(&mut bench);
    }
    let mut board = EmulatedBoard::<C>::bare(oscillator_hz, bench);
    let chip = board.machine.chip_mut();
    chip.set_watchdog_phase(random.random());
    chip.detune_crystal(random.random_range(-50..=50));
    chip.slots_mut().erasure = random.random_range(1..5) * MILLISECOND;
    let mut port = EmulatedPort::new(board, random.random());
    port.delay = random.random_range(0..500) * MICROSECOND;
    if let Some(defect) = defect {
        defect.build_into(&mut port);
    }
    let start = random.random_range(20_000..40_000) * MICROSECOND;
    port.board.machine.run_for(start);
    port
}

fn acceptance<C: BoardChip>(seed: u64, defect: Option<Defect>) -> Acceptance {
    acceptance_of(board::<C>(seed, defect))
        .unwrap_or_else(|error| panic!("seed {seed}, {defect:?}: {error}"))
}

fn acceptance_of<C: BoardChip>(board: EmulatedPort<C>) -> Result<Acceptance, AcceptError> {
    accept(Serial::over(board).unwrap(), |_| ControlFlow::Continue(()))
}

/// Returns what a check of a step has measured.
fn measured<'a>(acceptance: &'a Acceptance, step: &str, what: &str) -> &'a str {
    let steps = acceptance.steps.iter().filter(|it| it.name == step);
    let mut checks = steps.flat_map(|it| &it.checks);
    let check = checks.find(|it| it.what.starts_with(what));
    &check.unwrap_or_else(|| panic!("{step}: {what}")).measured
}

/// Returns what has failed, for messages.
fn failures(acceptance: &Acceptance) -> Vec<String> {
    let steps = acceptance.steps.iter();
    let checks = steps.flat_map(|step| step.checks.iter().map(move |check| (step.name, check)));
    checks
        .filter(|(_, check)| check.verdict == Verdict::Failed)
        .map(|(step, it)| format!("{step}: {}: {}, not {}", it.what, it.measured, it.expected))
        .collect()
}

fn nothing_is_found<C: BoardChip>(boards: u64) {
    for seed in FIRST_SEED..FIRST_SEED + boards {
        let acceptance = acceptance::<C>(seed, None);
        assert_eq!(failures(&acceptance), [""; 0], "{} {seed}", C::IMAGE);
        assert_eq!(acceptance.verdict, Verdict::Passed);
        // The acceptance knows the emulated chip's ticks, from which a real one's may differ by a factor.
        let median = measured(&acceptance, "ticks", "usual tick");
        let median: f64 = median.trim_end_matches(" cycles").parse().unwrap();
        let chip = CHIPS.iter().find(|it| acceptance.chip == Some(it.name));
        let usual = f64::from(chip.unwrap().usual_tick_cycles);
        assert!((median / usual - 1.0).abs() < 0.02, "{median}, not {usual}");
    }
}

#[test]
fn an_acceptance_can_be_ended_after_a_step() {
    let board = Serial::over(board::<F405>(FIRST_SEED, None)).unwrap();
    let mut steps = 0;
    let ended = accept(board, |_| {
        steps += 1;
        ControlFlow::Break(())
    });
    assert!(matches!(ended, Err(AcceptError::Interrupted)), "{ended:?}");
    assert_eq!(steps, 1);
}

#[test]
#[ignore = "a whole acceptance"]
fn a_healthy_board_is_accepted() {
    nothing_is_found::<F405>(1);
}

/// An erasure that takes longer than the timer that resets the board.
#[test]
#[ignore = "takes longer than 20 s"]
fn a_healthy_board_with_a_slow_erasure_is_accepted() {
    let mut port = board::<F405>(FIRST_SEED, None);
    port.board.machine.chip_mut().slots_mut().erasure = SECOND;
    let acceptance = acceptance_of(port).unwrap();
    assert_eq!(failures(&acceptance), [""; 0]);
    let cuts = measured(&acceptance, "flash", "resets that interrupted");
    assert_eq!(cuts, "6");
}

fn every_defect_is_found<C: BoardChip>() {
    let mut missed = Vec::new();
    for (number, (defect, finders)) in (FIRST_SEED..).zip(Defect::ALL) {
        let acceptance = acceptance::<C>(number, Some(*defect));
        let failed = acceptance.failed();
        let is_found = failed.first() == finders.first();
        if !is_found || failed.iter().any(|it| !finders.contains(it)) {
            missed.push(format!("{defect:?}: {:#?}", failures(&acceptance)));
        }
    }
    assert!(missed.is_empty(), "{}: {}", C::IMAGE, missed.join("\n"));
}

#[test]
#[ignore = "takes longer than 20 s"]
fn every_defect_is_found_by_its_step_on_the_f405() {
    every_defect_is_found::<F405>();
}

#[test]
#[ignore = "takes longer than 20 s"]
fn every_defect_is_found_by_its_step_on_the_g474() {
    every_defect_is_found::<G474>();
}

#[test]
#[ignore = "takes longer than 20 s"]
fn nothing_is_found_on_healthy_boards_with_the_f405() {
    nothing_is_found::<F405>(HEALTHY);
}

#[test]
#[ignore = "takes longer than 20 s"]
fn nothing_is_found_on_healthy_boards_with_the_g474() {
    nothing_is_found::<G474>(HEALTHY);
}
