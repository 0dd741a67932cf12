//! Invalid scenarios, overrides, grids, campaigns, manifests and shards give an error message
//! or a scenario that runs, without a panic and within bounded time.
//!
//! `PROPTEST_CASES` sets the number of cases of each test.

#![allow(clippy::unwrap_used)]

use std::fs;
use std::time::{Duration, Instant};

use painleve_plant::closed_loop::ClosedLoop;
use painleve_plant::controller_host::InProcess;
use painleve_plant::scenario::{Scenario, built_in};
use painleve_plant::simulation::Simulation;
use painleve_study::Grid;
use painleve_study::sweep::campaign::Campaign;
use painleve_study::sweep::manifest::Manifest;
use proptest::prelude::*;
use proptest::sample::select;

/// Longer than any test takes, also on a busy machine.
const LONG: Duration = Duration::from_secs(10);
/// Number of ticks for which a valid scenario is run.
const TICKS: u64 = 50;

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

/// Runs a scenario for a while if it is valid.
fn try_out(scenario: &Scenario) {
    let start = Instant::now();
    if let (Ok(simulation), Ok(host)) = (
        Simulation::new(scenario),
        InProcess::new(&scenario.controller_configuration()),
    ) {
        let mut closed_loop = ClosedLoop::new(simulation, host);
        for _ in 0..scenario.run.ticks().min(TICKS) {
            // An arm that cannot continue is a valid result, too.
            if closed_loop.tick(&mut ()).is_err() {
                break;
            }
        }
    }
    assert!(start.elapsed() < LONG, "took {:?}", start.elapsed());
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

proptest! {
    #[test]
    fn overrides_are_refused_or_run(overrides in prop::collection::vec((key(), value()), 1..4)) {
        let overrides: Vec<String> =
            overrides.iter().map(|(key, value)| format!("{key}={value}")).collect();
        let start = Instant::now();
        match Scenario::load(built_in::DEFAULT, &overrides) {
            Ok(scenario) => try_out(&scenario),
            Err(error) => prop_assert!(!error.to_string().trim().is_empty()),
        }
        prop_assert!(start.elapsed() < LONG);
    }

    #[test]
    fn scenario_files_are_refused_or_run(text in scenario_text()) {
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), &text).unwrap();
        if let Ok(scenario) = Scenario::load(file.path().to_str().unwrap(), &[]) {
            try_out(&scenario);
        }
    }

    #[test]
    fn grids_are_refused_or_finite(
        parts in prop::collection::vec(value(), 0..5), separator in select(vec![",", ":", " "]),
    ) {
        let start = Instant::now();
        if let Ok(grid) = parts.join(separator).parse::<Grid>() {
            prop_assert!(grid.values().iter().all(|value| value.is_finite()));
        }
        prop_assert!(start.elapsed() < LONG);
    }

    #[test]
    fn campaigns_and_manifests_are_refused_or_read(text in campaign_text()) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("campaign.toml");
        fs::write(&path, &text).unwrap();
        let _ = Campaign::load(&path);
        fs::write(Manifest::path(folder.path()), &text).unwrap();
        prop_assert!(Manifest::load(folder.path()).is_err());
    }
}
