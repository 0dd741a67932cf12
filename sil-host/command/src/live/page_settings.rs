//! The settings that the page of a live run offers; every other key can be set by name.

use painleve_plant::decimal::as_written;
use painleve_plant::scenario::Scenario;
use serde_json::{Value, json};

use crate::scenario::set_option;

/// Settings of the hybrid law: key, label, largest value.
const HYBRID: [(&str, &str, f64); 3] = [
    ("normal_force_n", "normal force f_n*, N", 100.0),
    ("position_gain_per_s2", "position gain, 1/s²", 1e6),
    ("velocity_gain_per_s", "velocity gain, 1/s", 1e4),
];

/// Returns the settings with their present values. In a template, `%` stands for the number.
pub fn settings(scenario: &Scenario) -> Value {
    let target_m = scenario.target_m();
    let mut settings = vec![
        json!({ "key": "belt.friction", "label": "belt friction μ", "value": scenario.belt.friction, "minimum": 0, "maximum": 2, "step": 0.01 }),
        json!({ "key": "belt.profile", "label": "belt speed, m/s", "value": scenario.belt.profile.speed_m_s(0.0), "minimum": -2, "maximum": 2, "step": 0.05, "template": "{ kind = \"constant\", speed_m_s = % }" }),
        json!({ "key": "controller.reference", "label": "target of the tip, m", "value": target_m, "minimum": -1, "maximum": 1, "step": 0.005, "template": "[{ minimum-jerk = { target_m = %, duration_s = 1.0 } }]" }),
    ];
    let law = serde_json::to_value(&scenario.controller.law).unwrap_or_default();
    for (key, label, maximum) in HYBRID {
        // Without the binary digits beyond single precision.
        let value = law["hybrid"][key].as_f64();
        if let Some(value) = value.map(|value| as_written(value as f32)) {
            settings.push(json!({ "key": format!("controller.law.hybrid.{key}"), "label": label, "value": value, "minimum": 0, "maximum": maximum, "step": "any" }));
        }
    }
    settings.into()
}

/// Returns the command that runs a scenario with what was set in a live run, one key on each line. `command` runs it
/// as it was `given`.
pub fn changes(command: &str, given: &Scenario, set: &Scenario) -> String {
    // Nothing that is set makes another key absent, except the other way to give the start.
    let options = given.differences(set).into_iter().filter_map(|change| {
        let value = change.second?;
        Some(set_option(&format!("{}={value}", change.key)))
    });
    format!("{command}{}\n", options.collect::<String>())
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::process::Command;

    use clap::Parser;

    use super::*;
    use crate::scenario::ScenarioArguments;

    /// The options of `painleve run` that say what runs.
    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        scenario: ScenarioArguments,
    }

    /// Returns the words after `painleve` that a shell makes of a command.
    fn words(command: &str) -> Vec<String> {
        let script = format!("painleve() {{ printf '%s\\0' \"$@\"; }}\n{command}");
        let output = Command::new("sh").args(["-c", &script]).output().unwrap();
        assert!(output.status.success() && output.stderr.is_empty());
        let text = String::from_utf8(output.stdout).unwrap();
        text.split_terminator('\0').map(str::to_owned).collect()
    }

    #[test]
    fn the_saved_command_runs_what_runs() {
        let folder = tempfile::tempdir().unwrap();
        // An edited copy, whose name and path would do harm if a shell read them.
        let harm = format!("it's $(touch {0}/a); touch {0}/b", folder.path().display());
        let copy = folder.path().join("it's $(exit 1).toml");
        let text = format!("name = \"{harm}\"\nbelt.friction = 0.41\n");
        fs::write(&copy, text).unwrap();
        let overridden = ["edge", "--set", "belt.friction=0.3", "--set", "run.seed=7"];
        for arguments in [
            &["edge"][..],
            &overridden,
            &["--scenario", copy.to_str().unwrap()],
            &[
                "--replay",
                "3:5",
                "--arms",
                "general",
                "--set",
                "run.seed=8",
            ],
        ] {
            let read = |arguments: &[String]| {
                let arguments = arguments.iter().map(String::as_str);
                Line::try_parse_from([""].into_iter().chain(arguments)).unwrap()
            };
            let arguments: Vec<String> = arguments.iter().map(ToString::to_string).collect();
            let started = read(&arguments).scenario;
            let given = started.load().unwrap();
            let set = ["run.seed=9", "controller.law=pid"].map(str::to_owned);
            let set = given.clone().with_overrides("live", &set).unwrap();
            for running in [&given, &set] {
                let command = changes(&started.command(), &given, running);
                let words = words(&command);
                assert_eq!(words[0], "run");
                let again = read(&words[1..]).scenario.load().unwrap();
                assert_eq!(&again, running, "{command}");
            }
        }
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
    }

    #[test]
    fn the_values_are_those_of_the_scenario() {
        let overrides = [
            "belt.friction=0.3",
            "belt.profile.speed_m_s=-0.25",
            "controller.reference.0.minimum-jerk.target_m=0.148",
            "controller.law.hybrid.normal_force_n=12.3",
            "controller.law.hybrid.position_gain_per_s2=2000",
            "controller.law.hybrid.velocity_gain_per_s=70",
        ];
        let overrides = overrides.map(str::to_owned);
        let scenario = Scenario::load("hybrid-elbow-down", &overrides).unwrap();
        let settings = settings(&scenario);
        let values = settings.as_array().unwrap().iter();
        let values: Vec<_> = values.map(|setting| setting["value"].as_f64()).collect();
        let expected = [0.3, -0.25, 0.148, 12.3, 2000.0, 70.0].map(Some);
        assert_eq!(values, expected);
    }

    #[test]
    fn settings_of_another_law_are_not_offered() {
        let scenario = Scenario::load("pid-elbow-up", &[]).unwrap();
        assert_eq!(settings(&scenario).as_array().unwrap().len(), 3);
    }
}
