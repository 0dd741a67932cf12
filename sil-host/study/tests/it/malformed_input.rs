//! Invalid scenarios, overrides, grids, campaigns, manifests and shards give an error message
//! or a scenario that runs, without a panic and within bounded time and memory.
//!
//! `PROPTEST_CASES` sets the number of cases of each test, `PAINLEVE_FUZZ_TICKS` the number of ticks
//! for which valid scenarios run. Times are processor times of the test's thread, so that a busy
//! machine fails no test.

#![allow(clippy::unwrap_used)]

use std::fmt::Debug;
use std::fs;
use std::time::Duration;

use nix::time::{ClockId, clock_gettime};
use painleve_plant::closed_loop::ClosedLoop;
use painleve_plant::controller_host::InProcess;
use painleve_plant::scenario::{Scenario, built_in, describe};
use painleve_plant::simulation::Simulation;
use painleve_study_core::Grid;
use painleve_study_sweep::campaign::Campaign;
use painleve_study_sweep::manifest::Manifest;
use proptest::prelude::*;
use proptest::sample::select;
use proptest::strategy::ValueTree;
use proptest::test_runner::{FileFailurePersistence, TestRunner};
use serde_json::Value;

/// Longest time in which an input is read or refused.
const READING: Duration = Duration::from_secs(1);
/// Longest time in which a valid scenario gives a result or an error.
const RUNNING: Duration = Duration::from_secs(10);
/// Largest peak of the memory of all tests together, kB.
const PEAK_KB: u64 = 500_000;
/// Number of ticks for which a valid scenario is run.
const TICKS: u64 = 50;

/// Runs `work`; fails if it takes longer than `limit`, or the process has taken too much memory.
#[track_caller]
fn within<T>(limit: Duration, input: &impl Debug, work: impl FnOnce() -> T) -> T {
    let now = || Duration::from(clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID).unwrap());
    let start = now();
    let result = work();
    let took = now() - start;
    assert!(took < limit, "took {took:?}: {input:?}");
    let status = fs::read_to_string("/proc/self/status").unwrap();
    let peak = status.lines().find(|line| line.starts_with("VmHWM:"));
    let peak = peak.unwrap().split_whitespace().nth(1).unwrap();
    assert!(
        peak.parse::<u64>().unwrap() < PEAK_KB,
        "{peak} kB: {input:?}"
    );
    result
}

/// The number in an environment variable, or `default`.
fn number(variable: &str, default: u64) -> u64 {
    let set = std::env::var(variable).ok();
    set.and_then(|text| text.parse().ok()).unwrap_or(default)
}

/// Plausible values, and values that no user would mean.
fn value() -> impl Strategy<Value = String> {
    prop_oneof![
        any::<f64>().prop_map(|number| number.to_string()),
        any::<i64>().prop_map(|number| number.to_string()),
        (-12_i32..12, any::<f64>())
            .prop_map(|(power, sign)| { format!("{:e}", 10_f64.powi(power).copysign(sign)) }),
        select(vec![
            "nan",
            "inf",
            "-inf",
            "1e308",
            "5e-324",
            "-0.0",
            "0",
            "true",
            "''",
            "\"\"",
            "[]",
            "{}",
            "[[[]]]",
            "2020-01-01",
            "0x7fffffffffffffff",
            "\"\\u0000\"",
            "\u{feff}",
            "=",
            "value = 1",
            "[1, 2",
            "é",
            "hybrid",
            "off",
            "{ kind = \"constant\" }",
        ])
        .prop_map(str::to_owned),
        "\\PC{0,40}",
    ]
}

/// Returns all keys of a scenario, with a dot between the levels.
fn keys() -> Vec<String> {
    fn walk(prefix: &str, value: &toml::Value, keys: &mut Vec<String>) {
        match value {
            toml::Value::Table(table) => {
                for (key, value) in table {
                    walk(&format!("{prefix}{key}."), value, keys);
                }
            }
            _ => keys.push(prefix.trim_end_matches('.').to_owned()),
        }
    }
    let scenario = Scenario::load(built_in::DEFAULT, &[]).unwrap();
    let mut keys = Vec::new();
    walk("", &toml::Value::try_from(scenario).unwrap(), &mut keys);
    keys
}

fn key() -> impl Strategy<Value = String> {
    prop_oneof![
        20 => select(keys()),
        1 => "[a-z_.0-9]{0,30}",
        1 => "\\PC{0,20}",
    ]
}

/// Runs a valid scenario for a while.
fn try_out(scenario: &Scenario, input: &impl Debug) {
    let ticks = number("PAINLEVE_FUZZ_TICKS", TICKS);
    within(RUNNING, input, || {
        if let (Ok(simulation), Ok(host)) = (
            Simulation::new(scenario),
            InProcess::new(&scenario.controller_configuration()),
        ) {
            let mut closed_loop = ClosedLoop::new(simulation, host);
            for _ in 0..scenario.run.ticks().min(ticks) {
                // An arm that cannot continue is a valid result, too.
                if closed_loop.tick(&mut ()).is_err() {
                    break;
                }
            }
        }
    });
}

/// Returns a text with a few of its characters changed, removed, doubled or replaced.
fn damaged(text: String) -> impl Strategy<Value = String> {
    let edits = prop::collection::vec((any::<prop::sample::Index>(), 0..4_u8, value()), 1..6);
    edits.prop_map(move |edits| {
        let mut characters: Vec<char> = text.chars().collect();
        for (at, edit, value) in edits {
            let at = at.index(characters.len().max(1));
            match edit {
                0 => drop(characters.splice(at..at, value.chars())),
                1 => {
                    let end = (at + value.len()).min(characters.len());
                    characters.drain(at.min(end)..end);
                }
                2 => characters.truncate(at),
                _ => {
                    // The rest of a line becomes another value.
                    let rest = &characters[at.min(characters.len())..];
                    let end = at + rest.iter().position(|&c| c == '\n').unwrap_or(rest.len());
                    characters.splice(at..end, value.chars());
                }
            }
        }
        characters.into_iter().collect()
    })
}

fn scenario_text() -> impl Strategy<Value = String> {
    let texts: Vec<String> = built_in::names()
        .map(|name| built_in::text(name).unwrap().to_owned())
        .collect();
    select(texts).prop_flat_map(damaged)
}

fn campaign_text() -> impl Strategy<Value = String> {
    damaged("study = \"bifurcation\"\nmu = \"0.1:1:0.1\"\nv-belt = [\"-0.4\", \"-0.5\"]\nset = \"belt.friction=0.4\"\n".into())
}

/// Cases that have failed are kept beside this file and tried again.
fn config() -> ProptestConfig {
    ProptestConfig {
        failure_persistence: Some(Box::new(FileFailurePersistence::WithSource("regressions"))),
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn overrides_are_refused_or_run(overrides in prop::collection::vec((key(), value()), 1..4)) {
        let overrides: Vec<String> =
            overrides.iter().map(|(key, value)| format!("{key}={value}")).collect();
        let load = || Scenario::load(built_in::DEFAULT, &overrides);
        match within(READING, &overrides, load) {
            Ok(scenario) => try_out(&scenario, &overrides),
            Err(error) => prop_assert!(!error.to_string().trim().is_empty()),
        }
    }

    #[test]
    fn scenario_files_are_refused_or_run(text in scenario_text()) {
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), &text).unwrap();
        let path = file.path().to_str().unwrap();
        if let Ok(scenario) = within(READING, &text, || Scenario::load(path, &[])) {
            try_out(&scenario, &text);
        }
    }

    #[test]
    fn grids_are_refused_or_finite(
        parts in prop::collection::vec(value(), 0..5), separator in select(vec![",", ":", " "]),
    ) {
        let text = parts.join(separator);
        if let Ok(grid) = within(READING, &text, || text.parse::<Grid>()) {
            prop_assert!(grid.values().iter().all(|value| value.is_finite()));
        }
    }

    #[test]
    fn campaigns_and_manifests_are_refused_or_read(text in campaign_text()) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("campaign.toml");
        fs::write(&path, &text).unwrap();
        fs::write(Manifest::path(folder.path()), &text).unwrap();
        within(READING, &text, || {
            let _ = Campaign::load(&path);
            assert!(Manifest::load(folder.path()).is_err());
        });
    }
}

/// A setting with a range.
#[derive(Clone, Debug)]
struct Ranged {
    key: String,
    minimum: f64,
    maximum: f64,
    is_integer: bool,
    /// Elements of an array.
    elements: Option<usize>,
}

/// Returns all settings with a range, from the schema for editors.
fn ranged() -> Vec<Ranged> {
    fn walk(prefix: &str, schema: &Value, found: &mut Vec<Ranged>) {
        for (name, field) in schema["properties"].as_object().into_iter().flatten() {
            let key = format!("{prefix}{name}");
            walk(&format!("{key}."), field, found);
            let elements = field["minItems"].as_u64().map(|count| count as usize);
            let scalar = elements.map_or(field, |_| &field["items"]);
            if let (Some(minimum), Some(maximum)) =
                (scalar["minimum"].as_f64(), scalar["maximum"].as_f64())
            {
                let is_integer = scalar["type"] == "integer";
                found.push(Ranged {
                    key,
                    minimum,
                    maximum,
                    is_integer,
                    elements,
                });
            }
        }
    }
    let mut found = Vec::new();
    walk("", &describe::json_schema(), &mut found);
    found
}

/// Sets some settings to the ends of their ranges, or close to them, or anywhere between.
fn extremes() -> impl Strategy<Value = Vec<String>> {
    let place = prop_oneof![
        2 => Just(0.0),
        2 => Just(1.0),
        1 => 0.0..1e-6_f64,
        1 => 1.0 - 1e-6..1.0_f64,
        2 => (-12.0..0.0_f64).prop_map(|power| 10_f64.powf(power)),
        2 => 0.0..1.0_f64,
    ];
    prop::collection::vec((select(ranged()), place), 1..5).prop_map(|settings| {
        let overrides = settings.into_iter().map(|(setting, place)| {
            let Ranged {
                key,
                minimum,
                maximum,
                is_integer,
                elements,
            } = setting;
            let value = minimum + (maximum - minimum) * place;
            let value = if is_integer {
                format!("{value:.0}")
            } else {
                format!("{value:?}")
            };
            match elements {
                Some(count) => format!("{key}=[{}]", vec![value; count].join(", ")),
                None => format!("{key}={value}"),
            }
        });
        overrides.collect()
    })
}

/// Counts valid scenarios: most draws are refused, because settings must fit each other.
#[test]
fn extreme_scenarios_run_or_fail_in_time() {
    let wanted = number("PROPTEST_CASES", 256);
    let mut runner = TestRunner::deterministic();
    let (strategy, mut drawn, mut valid) = (extremes(), 0_u64, 0);
    while valid < wanted {
        let overrides = strategy.new_tree(&mut runner).unwrap().current();
        drawn += 1;
        match within(READING, &overrides, || {
            Scenario::load(built_in::DEFAULT, &overrides)
        }) {
            Ok(scenario) => {
                valid += 1;
                try_out(&scenario, &overrides);
            }
            Err(error) => assert!(!error.to_string().is_empty()),
        }
        assert!(
            drawn < 100 * (wanted + 100),
            "only {valid} of {drawn} are valid"
        );
    }
    println!("{valid} valid scenarios of {drawn}");
}

/// Links of one gram with the strongest damping once took 60 ms of processor time for each tick.
#[test]
fn an_arm_that_is_too_stiff_ends_with_an_error() {
    let overrides = [
        "arm.link_mass_kg=[0.001, 0.001]",
        "arm.damping_nms_rad=[1000.0, 1000.0]",
    ];
    let scenario = Scenario::load(built_in::DEFAULT, &overrides.map(String::from)).unwrap();
    let simulation = Simulation::new(&scenario).unwrap();
    let host = InProcess::new(&scenario.controller_configuration()).unwrap();
    let mut closed_loop = ClosedLoop::new(simulation, host);
    let error = within(RUNNING, &overrides, || {
        (0..scenario.run.ticks()).find_map(|_| closed_loop.tick(&mut ()).err())
    });
    let error = error.unwrap().to_string();
    assert!(error.contains("too stiff"), "{error}");
}
