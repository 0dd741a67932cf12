//! `cargo xtask fuzz`: malformed input for every parser, extreme scenarios, random frames for the
//! controller and random events for the state machines. CI runs a short part of it with the tests.

use clap::Args;

use crate::command::ChoreError;
use crate::options::number;
use crate::under_test::run_tests;

/// Options of the fuzzing.
#[derive(Debug, Args)]
pub struct FuzzArguments {
    /// Number of cases of each test.
    #[arg(long, default_value_t = 10_000, value_parser = count)]
    cases: u32,
    /// Number of ticks for which each valid scenario runs.
    #[arg(long, default_value_t = 200, value_parser = count)]
    scenario_ticks: u32,
    /// Number of random sensor frames for each built-in scenario.
    #[arg(long, default_value_t = 10_000_000, value_parser = frames)]
    frames: u32,
}

fn count(text: &str) -> Result<u32, String> {
    number(text, 1..=u32::MAX, "a whole number")
}

/// Fewer frames may not drive every arm and cause a fault, which the test requires.
fn frames(text: &str) -> Result<u32, String> {
    number(text, 10_000..=u32::MAX, "a number of frames")
}

/// Tests with as many cases as requested.
const TESTS: [&str; 7] = [
    "malformed_input",
    "does_what_its_model_does",
    "counts_what_its_model_counts",
    "damaged_shards",
    "damaged_manifests",
    "damaged_records",
    "any_bytes",
];
const FRAMES: &str = "random_frames";
/// Compares both ends of a bus with a model. Its cases wait for each other, so there are fewer.
const BUS: &str = "both_ends";
const BUS_SHARE: u32 = 20;

/// Runs the part that belongs to `cargo xtask test --all`.
///
/// # Errors
/// If a test fails.
pub fn nightly() -> Result<(), ChoreError> {
    run(&FuzzArguments {
        cases: 2000,
        scenario_ticks: 50,
        frames: 200_000,
    })
}

/// Runs all tests with random input for the requested number of cases.
///
/// # Errors
/// If a test fails; its input is printed.
pub fn run(arguments: &FuzzArguments) -> Result<(), ChoreError> {
    let cases = arguments.cases.to_string();
    let ticks = arguments.scenario_ticks.to_string();
    let variables = [
        ("PROPTEST_CASES", cases.as_str()),
        ("PAINLEVE_FUZZ_TICKS", ticks.as_str()),
    ];
    run_tests(
        &["--workspace", "--lib", "--tests"],
        &TESTS,
        &[],
        &variables,
    )?;
    let bus_cases = (arguments.cases / BUS_SHARE).max(1).to_string();
    let variables = [("PROPTEST_CASES", bus_cases.as_str())];
    run_tests(&["--workspace", "--lib"], &[BUS], &[], &variables)?;
    let frames = arguments.frames.to_string();
    let variables = [("PAINLEVE_FUZZ_TICKS", frames.as_str())];
    run_tests(&["--workspace", "--tests"], &[FRAMES], &[], &variables)
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Debug, Parser)]
    struct Fuzz {
        #[command(flatten)]
        arguments: FuzzArguments,
    }

    #[test]
    fn too_few_cases_ticks_or_frames_are_refused() {
        for (option, few, least) in [
            ("--cases", "0", "1"),
            ("--scenario-ticks", "0", "1"),
            ("--frames", "9999", "10000"),
        ] {
            let refusal = Fuzz::try_parse_from(["fuzz", option, few]).unwrap_err();
            let message = refusal.to_string();
            assert!(
                message.contains(&format!("'{few}' for '{option}")),
                "{message}"
            );
            assert!(message.contains(&format!("from {least} to")), "{message}");
            let fuzz = Fuzz::try_parse_from(["fuzz", option, least]).unwrap();
            assert!(fuzz.arguments.cases > 0);
        }
    }
}
