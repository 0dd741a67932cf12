//! `cargo xtask test`: the tests, in two tiers.
//!
//! The default tier is for every change: units, hazards, equal bits, runs of several processes, budgets and docs, on one of the
//! two chips, and a sample of kills. `--all` adds campaigns, searches and whole procedures, and what requires further tools.
//! The last lines name the tier, what it left out, and why.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::process::{Command, Stdio};
use std::time::Instant;

use clap::Args;

use crate::build_fw;
use crate::command::{ChoreError, cargo, run_cargo, say, workspace};
use crate::setup::{self, Tools};
use crate::under_test::{PROFILE, build_program, under_test};
use crate::{campaign, chaos, examples, fmu, fuzz, newcomer, policy, python, size, soak};

/// Options of `cargo xtask test`.
#[derive(Debug, Default, Args)]
pub struct TestArguments {
    /// Also run what takes long or requires further tools: the least Rust version, licences, campaigns, examples, Python, ten
    /// tasks of a new user, FMU, malformed input, soak, chaos; and install the browser.
    #[arg(long)]
    all: bool,
    /// List the slowest tests; requires cargo-nextest.
    #[arg(long)]
    durations: bool,
}

/// Number of tests that `--durations` lists.
const LISTED: usize = 25;

/// Longest time for a test of the default tier, s. Longer ones are listed: they belong to `--all`.
const LONGEST_TEST_S: f64 = 20.0;

/// What `--all` runs after the tests of the workspace, in this order.
const FURTHER_STEPS: [(&str, Step); 11] = [
    ("least Rust version", policy::least_rust),
    ("links in doc comments of all crates", policy::doc_comments),
    ("licences and sources of dependencies", policy::dependencies),
    ("campaigns with a fresh seed", campaign::run),
    ("examples", examples::run),
    ("Python package", python::run_chore),
    ("ten tasks of a new user", newcomer::run_chore),
    ("FMU", fmu::run_chore),
    ("malformed input, 2,000 cases each", fuzz::nightly),
    ("soak", soak::nightly),
    ("chaos, 1,000 trials", chaos::nightly),
];

type Step = fn() -> Result<(), ChoreError>;

/// Installs missing tools, builds images and program, and runs the tests of a tier.
///
/// # Errors
/// If a step fails. A failure to build what the tests need ends the run; after any other one the later steps still run, since
/// `--all` takes an hour.
pub fn run(arguments: &TestArguments) -> Result<(), ChoreError> {
    let start = Instant::now();
    let tools = if arguments.all {
        Tools::All
    } else {
        Tools::Default
    };
    let missing = setup::install_missing(tools)?;
    let images = || {
        build_fw::run()?;
        examples::own_firmware()?;
        if arguments.all {
            examples::own_law_image()?;
        }
        size::check_images()
    };
    // Beside each other: the images' link-time optimisation keeps one processor busy.
    let (images, programs) = std::thread::scope(|scope| {
        let images = scope.spawn(images);
        let programs = build_program();
        (images.join(), programs)
    });
    images.map_err(|_| ChoreError("the images: a thread panicked".into()))??;
    programs?;
    let mut left_out: Vec<String> = missing
        .iter()
        .map(|tool| format!("tests that use {tool}: it cannot be installed"))
        .collect();
    let (mut took, mut failed) = (Vec::new(), Vec::new());
    let mut keep = |name: &'static str, step: &mut dyn FnMut() -> Result<(), ChoreError>| {
        let start = Instant::now();
        if let Err(error) = step() {
            failed.push(format!("{name}: {error}"));
        }
        took.push((start.elapsed(), name));
    };
    keep("tests of the workspace", &mut || {
        workspace_tests(arguments, &mut left_out)
    });
    let documentation = || run_cargo(&["test", "--workspace", "--profile", PROFILE, "--doc"]);
    if arguments.all {
        keep("tests of the documentation", &mut { documentation });
        for (name, mut step) in FURTHER_STEPS {
            keep(name, &mut step);
        }
    } else {
        // Beside each other: processes that are killed mostly wait.
        keep("tests of the documentation and chaos", &mut || {
            std::thread::scope(|scope| {
                let chaos = scope.spawn(chaos::short);
                let documentation = documentation();
                chaos
                    .join()
                    .map_err(|_| ChoreError("chaos: a thread panicked".into()))?
                    .and(documentation)
            })
        });
        let further: Vec<&str> = FURTHER_STEPS.iter().map(|(name, _)| *name).collect();
        left_out.push(format!(
            "left to `cargo xtask test --all`: tests marked #[ignore], {}",
            further.join(", ")
        ));
    }
    for (time, name) in took {
        say(&format!("{:>6.0} s  {name}", time.as_secs_f64()))?;
    }
    let tier = if arguments.all { "full" } else { "default" };
    let elapsed_s = start.elapsed().as_secs_f64();
    let not_run = match &left_out[..] {
        [] => "nothing".to_owned(),
        reasons => reasons.join("; "),
    };
    if !failed.is_empty() {
        return Err(ChoreError(format!(
            "{tier} tier failed in {elapsed_s:.0} s: {}; not run: {not_run}",
            failed.join("; ")
        )));
    }
    say(&format!(
        "{tier} tier passed in {elapsed_s:.0} s; not run: {not_run}"
    ))
}

/// Runs the tests of all packages, with nextest where it is installed, and adds what they said that they skipped to
/// `left_out`, whether they pass or not.
fn workspace_tests(
    arguments: &TestArguments,
    left_out: &mut Vec<String>,
) -> Result<(), ChoreError> {
    let notices = tempfile::NamedTempFile::new()
        .map_err(|cause| ChoreError(format!("no temporary file: {cause}")))?;
    let has_nextest = Command::new(cargo())
        .args(["nextest", "--version"])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success());
    let mut line = if has_nextest {
        vec!["nextest", "run", "--workspace", "--cargo-profile", PROFILE]
    } else {
        vec![
            "test",
            "--workspace",
            "--no-fail-fast",
            "--profile",
            PROFILE,
            "--lib",
            "--bins",
            "--tests",
        ]
    };
    // Some tests wait for time-outs: two more at a time than processors keep these busy.
    let threads = std::thread::available_parallelism().map_or(3, |count| count.get() + 2);
    let threads = threads.to_string();
    if has_nextest {
        line.extend(["--test-threads", &threads]);
    }
    match (has_nextest, arguments.all) {
        (true, true) => line.extend(["--run-ignored", "all"]),
        (false, true) => line.extend(["--", "--include-ignored"]),
        (_, false) => {}
    }
    let mut tests = Command::new(cargo());
    tests
        .args(&line)
        .current_dir(workspace())
        .envs(under_test())
        .env("PAINLEVE_SKIPPED", notices.path());
    eprintln!("$ cargo {}", line.join(" "));
    let durations = passed_through(tests);
    let mut skipped: Vec<String> = fs::read_to_string(notices.path())
        .unwrap_or_default()
        .lines()
        .map(str::to_owned)
        .collect();
    skipped.sort();
    skipped.dedup();
    left_out.extend(skipped);
    if !has_nextest {
        left_out.push(
            "the tests that measure time apart from others, and the list of slow tests: cargo-nextest is missing".to_owned(),
        );
    }
    let is_listed = |rank: usize, seconds: f64| {
        (arguments.durations && rank < LISTED) || (!arguments.all && seconds > LONGEST_TEST_S)
    };
    for (rank, (seconds, test)) in durations?.iter().enumerate() {
        if is_listed(rank, *seconds) {
            say(&format!("{seconds:>8.1} s  {test}"))?;
        }
    }
    Ok(())
}

/// Runs a command and repeats its messages. Returns the tests that it timed, slowest first, with their seconds.
fn passed_through(mut command: Command) -> Result<Vec<(f64, String)>, ChoreError> {
    let error = |what: &str| ChoreError(format!("the tests {what}"));
    let mut child = command
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|cause| error(&format!("cannot be started: {cause}")))?;
    let mut durations = Vec::new();
    for line in BufReader::new(
        child
            .stderr
            .take()
            .ok_or_else(|| error("have no messages"))?,
    )
    .lines()
    {
        let line = line.map_err(|cause| error(&format!("cannot be read: {cause}")))?;
        // A closed standard error must not end the tests.
        let _ = writeln!(std::io::stderr(), "{line}");
        durations.extend(duration(&line));
    }
    durations.sort_by(|a, b| b.0.total_cmp(&a.0));
    match child.wait() {
        Ok(status) if status.success() => Ok(durations),
        Ok(status) => Err(error(&format!("failed ({status})"))),
        Err(cause) => Err(error(&format!("cannot be awaited: {cause}"))),
    }
}

/// Returns seconds and name of a test from a line of nextest such as `PASS [   0.012s] package test`.
fn duration(line: &str) -> Option<(f64, String)> {
    let (status, rest) = line.split_once('[')?;
    let (time, name) = rest.split_once(']')?;
    let seconds = time.trim().strip_suffix('s')?.parse().ok()?;
    let is_result = ["PASS", "FAIL"].contains(&status.trim());
    is_result.then(|| (seconds, name.trim().to_owned()))
}

#[cfg(test)]
mod tests {
    use super::duration;

    #[test]
    fn a_line_of_nextest_gives_seconds_and_name() {
        let line = "        PASS [   1.250s] (12/900) painleve-plant impact::tests::sticks";
        let expected = "(12/900) painleve-plant impact::tests::sticks".to_owned();
        assert_eq!(duration(line), Some((1.25, expected)));
        assert_eq!(duration("   Compiling painleve-plant v0.1.0 ([x])"), None);
        assert_eq!(
            duration("        SLOW [> 20.000s] painleve-plant impact"),
            None
        );
    }
}
