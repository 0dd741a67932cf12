//! Scenarios from names, files and overrides.

use std::path::{Path, PathBuf};

use painleve_files::input_file;
use painleve_shared::settings::Settings;
use toml::{Table, Value};

use super::error::ScenarioError;
use super::override_key::with_override;
use super::table::{from_table, parse};
use super::{Scenario, built_in};
use crate::mechanics::compliant::ContactKind;
use crate::mechanics::{BuiltInPlant, with_paths_only, without_files};

impl Scenario {
    /// Loads the built-in scenario or file called `name`, applies the overrides `key=value` in
    /// order and validates the result as a whole.
    ///
    /// # Errors
    /// [`ScenarioError`] in one sentence for the user.
    pub fn load(name: &str, overrides: &[String]) -> Result<Self, ScenarioError> {
        let scenario = Self::load_unplaced(name, overrides)?;
        scenario.checked_start(&origin(name))
    }

    /// Loads a scenario like [`load`](Self::load) from the copy of standard input in a file.
    ///
    /// # Errors
    /// [`ScenarioError`] in one sentence for the user, who knows nothing of the copy.
    pub fn load_standard_input(copy: &Path, overrides: &[String]) -> Result<Self, ScenarioError> {
        let origin = "standard input";
        let table = read_file(copy, origin, "standard-input")?;
        let scenario = from_table(Some(origin), table)?.with_overrides(origin, overrides)?;
        scenario.checked_start(origin)
    }

    /// Loads a scenario like [`load`](Self::load), but without checking the start against the belt,
    /// for studies that place the arm themselves.
    ///
    /// # Errors
    /// [`ScenarioError`] in one sentence for the user.
    pub fn load_unplaced(name: &str, overrides: &[String]) -> Result<Self, ScenarioError> {
        from_table(Some(&origin(name)), read(name)?)?.with_overrides(&origin(name), overrides)
    }

    /// Reads a scenario from TOML text and validates it as a whole, except for the start of the
    /// arm.
    ///
    /// # Errors
    /// [`ScenarioError`] in one sentence for the user.
    pub fn from_toml(text: &str) -> Result<Self, ScenarioError> {
        let origin = "scenario";
        from_table(Some(origin), parse(origin, text)?)?.with_overrides(origin, &[])
    }

    /// Reads the scenario of a record from its TOML text, without the files that it names: they may have changed since, or
    /// be elsewhere. It is to be shown and compared, not run.
    ///
    /// # Errors
    /// [`ScenarioError`] in one sentence for the user, which names the record.
    pub fn of_record(record: &Path, text: &str) -> Result<Self, ScenarioError> {
        let origin = format!("record {}", record.display());
        let table = parse(&origin, text)?;
        with_paths_only(|| from_table(Some(&origin), table)?.with_overrides(&origin, &[]))
    }

    /// Returns this scenario if the arm can start where it says.
    fn checked_start(self, origin: &str) -> Result<Self, ScenarioError> {
        match BuiltInPlant::new(&self) {
            Ok(_) => Ok(self),
            Err(source) => Err(ScenarioError::start(origin, &self.initial, source)),
        }
    }

    /// Returns this scenario with overrides `key=value` applied in order and validated, except for the
    /// start of the arm. Messages name `origin` as the scenario that was overridden.
    ///
    /// # Errors
    /// [`ScenarioError`] in one sentence for the user.
    pub fn with_overrides(
        mut self,
        origin: &str,
        overrides: &[String],
    ) -> Result<Self, ScenarioError> {
        for text in overrides {
            self = with_override(self, text)?;
        }
        self.validate().map_err(|source| ScenarioError::Range {
            origin: origin.into(),
            source,
        })?;
        // Here rather than where the plant is made, so that studies, which make theirs later, say the same.
        let on = self.effects.first_on(&self.plant_parameters().arm);
        match on.filter(|_| self.contact.kind == ContactKind::Rigid) {
            Some(key) => Err(ScenarioError::NeedsCompliant {
                origin: origin.into(),
                key,
            }),
            None => Ok(self),
        }
    }

    /// Returns this scenario with one key changed by somebody who may not read what this process may: files that
    /// the scenario has loaded stay as they were read, and the value cannot name another one.
    ///
    /// # Errors
    /// [`ScenarioError`] in one sentence, which contains nothing from any file.
    pub fn with_remote_override(&self, key: &str, value: &str) -> Result<Self, ScenarioError> {
        let text = format!("{key}={value}");
        without_files(|| self.clone().with_overrides("live run", &[text]))
    }
}

/// Returns the description of a scenario's origin for messages.
fn origin(name: &str) -> String {
    match built_in::text(name) {
        Some(_) => format!("scenario {name}"),
        None => format!("scenario file {name}"),
    }
}

fn read(name: &str) -> Result<Table, ScenarioError> {
    let origin = origin(name);
    if let Some(text) = built_in::text(name) {
        return parse(&origin, text);
    }
    let path = PathBuf::from(name);
    if !path.exists() {
        return Err(ScenarioError::Unknown { name: name.into() });
    }
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    read_file(&path, &origin, &stem)
}

/// Reads a file whose scenario is called `name` unless it has a name itself.
fn read_file(path: &Path, origin: &str, name: &str) -> Result<Table, ScenarioError> {
    let or_else = |error| match input_file::kind(path) {
        Some(kind) => ScenarioError::Other {
            origin: origin.into(),
            kind,
        },
        None => error,
    };
    let text = input_file::read(path).map_err(|source| {
        or_else(ScenarioError::Unreadable {
            origin: origin.into(),
            source,
        })
    })?;
    let mut table = parse(origin, &text).map_err(or_else)?;
    if table.is_empty() {
        return Err(ScenarioError::Empty {
            origin: origin.into(),
        });
    }
    table
        .entry("name")
        .or_insert_with(|| Value::String(name.into()));
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn load(overrides: &[&str]) -> Result<Scenario, ScenarioError> {
        let overrides: Vec<String> = overrides.iter().map(ToString::to_string).collect();
        Scenario::load("hybrid-elbow-down", &overrides)
    }

    fn message(overrides: &[&str]) -> String {
        load(overrides).unwrap_err().to_string()
    }

    #[test]
    fn the_rotors_of_elastic_gears_move_with_the_arm() {
        let stiff = load(&["arm.rotor_inertia_kg_m2=[1e-5, 2e-5]"]).unwrap();
        assert_eq!(stiff.moving_arm(), stiff.arm);
        let elastic = load(&[
            "arm.rotor_inertia_kg_m2=[1e-5, 2e-5]",
            "contact.kind=compliant",
            "effects.gear.elastic=true",
            "effects.gear.rotor_inertia_kg_m2=1e-4",
        ]);
        let moving = elastic.unwrap().moving_arm().rotor_inertia_kg_m2;
        assert!((moving[0] - 1.1e-4).abs() < 1e-12 && (moving[1] - 1.2e-4).abs() < 1e-12);
    }

    #[test]
    fn a_kind_without_keys_is_chosen_by_its_name_and_the_same_kind_keeps_its_keys() {
        let changed = ["effects.friction={ kind = \"step\", at_s = 1.0, change = 0.2 }"];
        let without = Scenario::load("hybrid-elbow-down", &[]).unwrap();
        for none in ["effects.friction=none", "effects.friction.kind=none"] {
            let scenario = load(&[changed[0], none]).unwrap();
            assert_eq!(scenario.effects.friction, without.effects.friction);
        }
        let same = load(&["belt.profile.kind=constant"]).unwrap();
        assert_eq!(same.belt.profile, without.belt.profile);
    }

    #[test]
    fn overrides_change_one_key_each() {
        let scenario = load(&[
            "belt.friction=0.4",
            "run.duration_s=2",
            "impact.law=energetic",
            "controller.reference.0.minimum-jerk.target_m=0.1",
            "belt.profile={ kind = \"sine\", mean_m_s = -0.4, amplitude_m_s = 0.1, frequency_hz = 2.0 }",
        ])
        .unwrap();
        assert_eq!(scenario.belt.friction, 0.4);
        assert_eq!(scenario.run.duration_s, 2.0);
        assert_eq!(scenario.belt.profile.speed_m_s(0.0), -0.4);
        assert_eq!(scenario.name, "hybrid-elbow-down");
    }

    #[test]
    fn a_run_has_at_least_one_tick() {
        let of_duration = |key: &str| load(&["run.tick_hz=250", key]);
        assert_eq!(of_duration("run.duration_s=0.002").unwrap().run.ticks(), 1);
        let text = of_duration("run.duration_s=0.0019")
            .unwrap_err()
            .to_string();
        assert!(text.contains("run.duration_s = 0.0019"), "{text}");
        assert!(text.ends_with("0.002 to 10000000"), "{text}");
    }

    #[test]
    fn targets_keep_their_decimals() {
        let target = |name| Scenario::load(name, &[]).unwrap().target_m();
        assert_eq!(target("hybrid-elbow-up"), Some(0.163));
        assert_eq!(target("capture"), None);
    }

    #[test]
    fn messages_name_no_types_of_the_program() {
        for (wrong, expected) in [
            ("converters.encoder=3", "expected a table of keys"),
            (
                "effects.friction=rising",
                "expected a table with the key 'kind'",
            ),
            (
                "effects.friction=step",
                "missing key 'change'; give the variant with all its keys in one { }",
            ),
            (
                "belt.profile.kind=step",
                "belt.profile: missing key 'from_m_s'",
            ),
            ("contact=rigid", "expected a table of keys"),
            (
                "run.tick_hz=fast",
                "expected a whole number from 10 to 100000, not \"fast\"",
            ),
            ("run.tick_hz=1e9", "from 10 to 100000, not 1000000000.0"),
            (
                "converters.encoder.bits=8.5",
                "a whole number from 8 to 24, not 8.5",
            ),
            ("arm.link_length_m=[1,2,3]", "a list of 2 items, not 3"),
            (
                "arm.link_length_m=[1,\"x\"]",
                "a number from 0.01 to 10, not \"x\"",
            ),
            (
                "run.seed=18446744073709551615",
                "run.seed: expected a whole number from 0 to 9223372036854775807, not \"18446744073709551615\"",
            ),
            (
                "controller.law.hybrid.friction=foo",
                "friction: unknown name 'foo'; known: measured, observed, model",
            ),
            (
                "controller.law.pid=3",
                "controller.law.pid: expected a table",
            ),
        ] {
            let message = message(&[wrong]);
            assert!(message.contains(expected), "{message}");
        }
    }

    #[test]
    fn the_name_of_a_variant_chooses_it_with_its_defaults() {
        let pid = load(&[
            "controller.law=pid",
            "controller.law.pid.proportional_nm_rad=[30.0, 20.0]",
        ]);
        let law = pid.unwrap().controller.law;
        assert_eq!(law.name(), "pid");
        let law = toml::to_string(&law).unwrap();
        assert!(law.contains("proportional_nm_rad = [30.0, 20.0]"), "{law}");
        let pid = load(&["controller.law.pid={ proportional_nm_rad = [30.0, 20.0] }"]).unwrap();
        assert_eq!(toml::to_string(&pid.controller.law).unwrap(), law);
        let off = load(&["controller.law=off"]).unwrap();
        assert_eq!(off.controller.law.name(), "off");
    }

    #[test]
    fn overrides_set_keys_that_are_optional() {
        let scenario = load(&[
            "controller.belt.given_m_s=-0.4",
            "arm_model.link_length_m=[0.21, 0.2]",
        ])
        .unwrap();
        assert_eq!(scenario.controller.belt.given_m_s, Some(-0.4));
        let arm = scenario.arm_model.unwrap();
        assert_eq!(
            (arm.link_length_m, arm.link_mass_kg),
            ([0.21, 0.2], [0.12; 2])
        );
        let message = message(&["controller.belt.given_m_s=fast"]);
        assert!(
            message.ends_with("given_m_s: expected a number from -100 to 100, not \"fast\""),
            "{message}"
        );
    }

    #[test]
    fn mistakes_are_named_with_what_is_allowed() {
        for (overrides, parts) in [
            (
                &["belt.frction=0.4"][..],
                &[
                    "belt.frction",
                    "did you mean 'friction'?",
                    "friction, profile",
                ][..],
            ),
            (&["arm_model.lenght_m=0.2"], &["arm_model.lenght_m"]),
            (
                &["controller.law.pid.integral_gain=1"],
                &["controller.law is hybrid", "first with controller.law=pid"],
            ),
            (
                &["controller.law=off", "controller.law.pid.integral_gain=1"],
                &["controller.law is off", "first with controller.law=pid"],
            ),
            (
                &["controller.law=pid", "controller.law.pid.integral_gain=1"],
                &["integral_gain", "known: ", "proportional_nm_rad"],
            ),
            (
                &["controller.law.pdi.x=1"],
                &["unknown key 'pdi'", "known: off, pid, hybrid"],
            ),
            (&["belt.profile=sine"], &["belt.profile", "mean_m_s"]),
            (&["belt.friction=nan"], &["belt.friction = NaN", "0 to 10"]),
            (&["belt.friction=inf"], &["belt.friction = inf", "0 to 10"]),
            (&["belt.friction=-1"], &["belt.friction = -1", "0 to 10"]),
            (&["arm.height_m=0.42"], &["arm.height_m = 0.42", "0.41958"]),
            (&["belt.friction"], &["belt.friction", "key=value"]),
            (&["run.tick_hz=0"], &["run.tick_hz = 0", "10 to"]),
            (&["run.seed=-1"], &["run.seed"]),
            (
                &["impact.law=newton"],
                &["impact.law", "poisson", "energetic"],
            ),
            (
                &["initial.theta1_deg=0"],
                &[
                    "initial.theta1_deg = 0 and initial.theta2_deg = -35.1 put the tip 4.3 mm inside the belt",
                    "initial.tip_m",
                ],
            ),
            (
                &["arm.height_m=0.36"],
                &["initial.theta1_deg = -11.4 and", "17.7 mm inside"],
            ),
            (
                &["controller.law.hybrid.friction.observed.time_constant_s=11"],
                &[
                    "controller.law.hybrid.friction.observed.time_constant_s = 11",
                    "0 to 10",
                ],
            ),
            (
                &["controller.estimator.bandwidth_rad_s=3001"],
                &["controller.estimator.bandwidth_rad_s = 3001", "1 to 3000"],
            ),
            (
                &["controller.reference.0.minimum-jerk.target_m=0.5"],
                &["controller.reference.0.minimum-jerk.target_m", "0.42"],
            ),
        ] {
            let message = message(overrides);
            for part in parts {
                assert!(message.contains(part), "'{part}' is not in: {message}");
            }
            assert!(!message.contains('\n'), "{message}");
        }
    }

    #[test]
    fn files_may_be_partial_but_not_empty_and_not_misspelt() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("slow.toml");
        let load = |text: &str| {
            std::fs::write(&path, text).unwrap();
            Scenario::load(path.to_str().unwrap(), &[])
        };
        let scenario = load("[belt]\nfriction = 0.5\n").unwrap();
        assert_eq!(
            (scenario.belt.friction, scenario.name.as_str()),
            (0.5, "slow")
        );
        let message = |text| load(text).unwrap_err().to_string();
        assert!(message("").contains("is empty"));
        assert!(message("[belt\n").contains("line 1"));
        assert!(message("[belt]\nfriction = 0.5\nfriction = 0.6\n").contains("line 3"));
        assert!(message("[belt]\nspeed = 1\n").contains("speed"));
        assert!(message("[belt]\nfriction = \"high\"\n").contains("belt.friction"));
        let missing = |name| Scenario::load(name, &[]).unwrap_err().to_string();
        assert!(missing("no-such-scenario").contains("'; known: hybrid-elbow-down"));
        assert!(missing("edgee").contains("did you mean 'edge'?"));
        assert!(Scenario::load(folder.path().to_str().unwrap(), &[]).is_err());
    }

    #[test]
    fn a_file_of_another_kind_is_named_with_the_command_that_reads_it() {
        let folder = tempfile::tempdir().unwrap();
        for (name, start, kind) in [
            (
                "run.mcap",
                &b"\x89MCAP0\r\n\xff"[..],
                "a record: `painleve export`, `compare` and `diff` read it",
            ),
            (
                "run.csv",
                b"time_s,plant.tip_t_m\n0,0.1\n",
                "a table of ticks: `painleve compare`",
            ),
            (
                "run.ros2.mcap",
                b"\x89MCAP0\r\n\x01\x1c\0\0\0\0\0\0\0\x04\0\0\0ros2",
                "a ROS 2 bag",
            ),
            ("run.svg", b"<svg xmlns=\"\">", "a figure"),
            (
                "arm.urdf",
                b"<robot name=\"arm\">",
                "a URDF file: `painleve arm` reads its arm",
            ),
        ] {
            let path = folder.path().join(name);
            std::fs::write(&path, start).unwrap();
            let path = path.to_str().unwrap();
            let message = Scenario::load(path, &[]).unwrap_err().to_string();
            assert!(
                message.starts_with(&format!("{path} is no scenario but {kind}")),
                "{message}"
            );
        }
    }

    #[test]
    fn mistakes_on_standard_input_do_not_name_its_copy() {
        let copy = tempfile::NamedTempFile::new().unwrap();
        for (text, expected) in [
            ("", "cannot read standard input: it is empty"),
            ("# nothing", "standard input is empty"),
            ("[belt", "standard input is not TOML"),
            ("belt.frction = 1", "standard input: belt"),
            ("belt.friction = 99", "standard input: belt.friction = 99"),
            (
                "initial.theta1_deg = 0",
                "standard input: initial.theta1_deg = 0 and",
            ),
            (
                "effects.gear.elastic = true",
                "standard input: effects.gear",
            ),
        ] {
            std::fs::write(copy.path(), text).unwrap();
            let error = Scenario::load_standard_input(copy.path(), &[]).unwrap_err();
            let message = error.to_string();
            assert!(message.starts_with(expected), "{message}");
        }
        std::fs::write(copy.path(), "belt.friction = 0.5").unwrap();
        let scenario = Scenario::load_standard_input(copy.path(), &[]).unwrap();
        assert_eq!(scenario.name, "standard-input");
    }

    #[test]
    fn the_scenario_of_a_record_needs_no_file() {
        let of_record = |text: &str| Scenario::of_record(Path::new("r.mcap"), text);
        let text = "belt.profile = { kind = \"file\", path = \"/nowhere/belt.csv\" }
            contact.kind = \"compliant\"
            effects.friction = { kind = \"file\", path = \"/nowhere/friction.csv\" }";
        let scenario = of_record(text).unwrap();
        let brief = scenario.to_brief_toml();
        for path in ["/nowhere/belt.csv", "/nowhere/friction.csv"] {
            assert!(brief.contains(path), "{brief}");
        }
        assert!(scenario.differences(&of_record(text).unwrap()).is_empty());
        let other = of_record(&text.replace("belt.csv", "other.csv")).unwrap();
        assert_eq!(scenario.differences(&other).len(), 1);
        // Elsewhere files are read as before.
        let message = Scenario::from_toml(text).unwrap_err().to_string();
        assert!(
            message.contains("cannot read /nowhere/belt.csv"),
            "{message}"
        );
        let message = of_record("belt.friction = 99").unwrap_err().to_string();
        assert!(
            message.starts_with("record r.mcap: belt.friction = 99"),
            "{message}"
        );
    }
}
