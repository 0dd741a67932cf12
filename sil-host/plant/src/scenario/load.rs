//! Scenarios from names, files and overrides.

use std::path::PathBuf;

use painleve_shared::range::OutOfRange;
use painleve_shared::settings::Settings;
use painleve_system::input_file;
use toml::{Table, Value};

use super::override_key::{MOST_LEVELS, with_override};
use super::{Scenario, built_in, reference_file};
use crate::mechanics::{BuiltInPlant, without_files};

/// Why a scenario cannot be loaded.
#[derive(Debug, thiserror::Error)]
pub enum ScenarioError {
    /// The name is neither a built-in scenario nor a file.
    #[error(
        "no built-in scenario and no file is called '{name}'; built in are: {}",
        built_in::names().collect::<Vec<_>>().join(", ")
    )]
    Unknown {
        /// The requested name.
        name: String,
    },
    /// The file cannot be read.
    #[error("cannot read scenario file {}: {source}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Reason.
        source: std::io::Error,
    },
    /// The file is empty.
    #[error("scenario file {} is empty", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// The text is not TOML.
    #[error("{origin} is not TOML: {source}")]
    Syntax {
        /// File or scenario.
        origin: String,
        /// What is wrong, and where.
        source: TomlError,
    },
    /// A key is unknown or has the wrong type.
    #[error("{origin}: {key}: {source}")]
    Key {
        /// File, scenario or option.
        origin: String,
        /// Path of the key.
        key: String,
        /// What is wrong, and what is allowed.
        source: KeyError,
    },
    /// An override is not of the form key=value.
    #[error("--set '{text}' is not of the form key=value; example: --set belt.friction=0.4")]
    Override {
        /// The given text.
        text: String,
    },
    /// An override's key has more levels than any key of a scenario.
    #[error("--set: a key has at most {MOST_LEVELS} levels (belt.friction has two)")]
    TooDeep,
    /// A value is out of range.
    #[error("{origin}: {source}")]
    Range {
        /// File or scenario.
        origin: String,
        /// The value and the allowed range.
        source: OutOfRange,
    },
}

/// What is wrong with a TOML text, and in which line.
#[derive(Debug, thiserror::Error)]
#[error("{}{}", .line.map_or(String::new(), |line| format!("line {line}: ")), source.message())]
pub struct TomlError {
    line: Option<usize>,
    source: toml::de::Error,
}

impl TomlError {
    /// Returns the error of a parser in a text.
    pub fn new(source: toml::de::Error, text: &str) -> Self {
        let line = source
            .span()
            .map(|span| text[..span.start.min(text.len())].lines().count().max(1));
        Self { line, source }
    }
}

/// Returns a message of serde on one line, with words instead of Rust's names of types.
fn in_words(message: &str) -> String {
    let mut words = message.trim().replace('\n', " ");
    for (names, meaning) in [
        (&["f32", "f64"][..], "a number"),
        (&["i32", "i64"], "a whole number"),
        (
            &["u8", "u16", "u32", "u64", "usize"],
            "a whole number from 0",
        ),
    ] {
        for name in names {
            words = words.replace(&format!("expected {name}"), &format!("expected {meaning}"));
        }
    }
    words = words
        .replace("missing field", "missing key")
        .replace('`', "'");
    // A type's name follows these to the end of the message.
    for (kind, meaning) in [
        ("struct ", "a table of keys"),
        ("internally tagged enum ", "a table with the key 'kind'"),
        ("enum ", "one of its kinds"),
    ] {
        let start = format!("expected {kind}");
        if let Some((before, _)) = words.split_once(&start) {
            words = format!("{before}expected {meaning}");
        }
    }
    words
}

/// What is wrong with a key.
#[derive(Debug, thiserror::Error)]
pub enum KeyError {
    /// The key is unknown or its value has the wrong type.
    #[error("{}", in_words(.0.message()))]
    Value(toml::de::Error),
    /// The scenario cannot be written as a table.
    #[error(transparent)]
    Table(#[from] toml::ser::Error),
    /// A part of the key is unknown.
    #[error("unknown key '{part}'; {}known: {}", meant(part, known), known.join(", "))]
    Unknown {
        /// The part.
        part: String,
        /// The keys at its level.
        known: Vec<String>,
    },
    /// A part of the key names a variant that is not the chosen one.
    #[error("{key} is {chosen}, which has no '{part}'; choose it first with --set {key}={part}")]
    NotChosen {
        /// The choice.
        key: String,
        /// The chosen variant.
        chosen: String,
        /// The part.
        part: String,
    },
    /// A part of the key is not a number of a list's items.
    #[error("'{part}' is not one of its {count} items, from 0")]
    NoItem {
        /// The part.
        part: String,
        /// Number of items.
        count: usize,
    },
    /// A file named by the key cannot be used.
    #[error("{0}")]
    File(String),
    /// A part of the key lies inside a number, a text or a switch.
    #[error("'{0}' would be inside a single value")]
    InsideValue(String),
}

/// Smallest similarity of a key that may have been meant, from 0 to 1.
const SIMILAR: f64 = 0.75;

/// Returns a question about the known key that is most similar to an unknown one; empty if none is.
fn meant(part: &str, known: &[String]) -> String {
    let similarity = |key: &&String| strsim::normalized_damerau_levenshtein(part, key);
    let similar = known.iter().filter(|key| similarity(key) >= SIMILAR);
    similar
        .max_by(|one, other| similarity(one).total_cmp(&similarity(other)))
        .map_or(String::new(), |key| format!("did you mean '{key}'? "))
}

impl Scenario {
    /// Loads the built-in scenario or file called `name`, applies the overrides `key=value` in
    /// order and validates the result as a whole.
    ///
    /// # Errors
    /// [`ScenarioError`] in one sentence for the user.
    pub fn load(name: &str, overrides: &[String]) -> Result<Self, ScenarioError> {
        let scenario = Self::load_unplaced(name, overrides)?;
        let plant = BuiltInPlant::new(&scenario);
        plant.map_err(|source| ScenarioError::Range {
            origin: origin(name),
            source,
        })?;
        Ok(scenario)
    }

    /// Loads a scenario like [`load`](Self::load), but without checking the start against the belt,
    /// for studies that place the arm themselves.
    ///
    /// # Errors
    /// [`ScenarioError`] in one sentence for the user.
    pub fn load_unplaced(name: &str, overrides: &[String]) -> Result<Self, ScenarioError> {
        from_table(&origin(name), read(name)?)?.with_overrides(&origin(name), overrides)
    }

    /// Reads a scenario from TOML text and validates it as a whole, except for the start of the
    /// arm.
    ///
    /// # Errors
    /// [`ScenarioError`] in one sentence for the user.
    pub fn from_toml(text: &str) -> Result<Self, ScenarioError> {
        let origin = "scenario";
        from_table(origin, parse(origin, text)?)?.with_overrides(origin, &[])
    }

    /// Returns this scenario with overrides `key=value` applied in order and its numbers validated.
    /// Messages name `origin` as the scenario that was overridden.
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
        Ok(self)
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
    let text = input_file::read(&path).map_err(|source| ScenarioError::Unreadable {
        path: path.clone(),
        source,
    })?;
    let mut table = parse(&origin, &text)?;
    if table.is_empty() {
        return Err(ScenarioError::Empty { path });
    }
    if let (false, Some(stem)) = (table.contains_key("name"), path.file_stem()) {
        table.insert("name".into(), Value::String(stem.to_string_lossy().into()));
    }
    Ok(table)
}

fn parse(origin: &str, text: &str) -> Result<Table, ScenarioError> {
    text.parse().map_err(|error| ScenarioError::Syntax {
        origin: origin.into(),
        source: TomlError::new(error, text),
    })
}

pub(super) fn from_table(origin: &str, mut table: Table) -> Result<Scenario, ScenarioError> {
    reference_file::expand(&mut table).map_err(|reason| ScenarioError::Key {
        origin: origin.into(),
        key: "controller.reference".into(),
        source: KeyError::File(reason),
    })?;
    serde_path_to_error::deserialize(Value::Table(table)).map_err(|error| ScenarioError::Key {
        origin: origin.into(),
        key: error.path().to_string(),
        source: KeyError::Value(error.into_inner()),
    })
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
    fn messages_name_no_types_of_the_program() {
        for (wrong, expected) in [
            ("converters.encoder=3", "expected a table of keys"),
            (
                "effects.friction=rising",
                "expected a table with the key 'kind'",
            ),
            ("effects.friction=step", "missing key 'change'"),
            ("contact=rigid", "expected a table of keys"),
            ("run.tick_hz=fast", "expected a whole number from 0"),
        ] {
            let message = message(&[wrong]);
            assert!(message.ends_with(expected), "{message}");
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
            message.ends_with("given_m_s: invalid type: string \"fast\", expected a number"),
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
                &["controller.law is hybrid", "--set controller.law=pid"],
            ),
            (
                &["controller.law=off", "controller.law.pid.integral_gain=1"],
                &["controller.law is off", "--set controller.law=pid"],
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
            (&["initial.theta1_deg=0"], &["initial tip height"]),
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
        assert!(message("[belt]\nspeed = 1\n").contains("speed"));
        assert!(message("[belt]\nfriction = \"high\"\n").contains("belt.friction"));
        let missing = Scenario::load("no-such-scenario", &[]).unwrap_err();
        assert!(missing.to_string().contains("hybrid-elbow-down"));
        assert!(Scenario::load(folder.path().to_str().unwrap(), &[]).is_err());
    }
}
