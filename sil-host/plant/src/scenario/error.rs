//! Why a scenario cannot be loaded, in one sentence for the user.

use painleve_shared::range::OutOfRange;
use painleve_shared::settings::Field;

use super::words::{TomlError, in_words, known_names};
use super::{InitialState, built_in};
use crate::mechanics::motion::INITIAL_HEIGHT;

/// Upper limit of the levels of a key; no scenario key has as many.
pub(super) const MOST_LEVELS: usize = 16;

/// Why a scenario cannot be loaded.
#[derive(Debug, thiserror::Error)]
pub enum ScenarioError {
    /// The name is neither a built-in scenario nor a file.
    #[error(
        "no built-in scenario and no file is called '{name}'; {}",
        known_names(name, &built_in::names().collect::<Vec<_>>())
    )]
    Unknown {
        /// The requested name.
        name: String,
    },
    /// The file cannot be read.
    #[error("cannot read {origin}: {source}")]
    Unreadable {
        /// The file.
        origin: String,
        /// Reason.
        source: std::io::Error,
    },
    /// The file is something else.
    #[error("{} is no scenario but {kind}", origin.trim_start_matches("scenario file "))]
    Other {
        /// The file.
        origin: String,
        /// What it is, and which command reads it.
        kind: &'static str,
    },
    /// The file is empty.
    #[error("{origin} is empty")]
    Empty {
        /// The file.
        origin: String,
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
    #[error("{}{key}: {source}", origin.as_ref().map_or(String::new(), |origin| format!("{origin}: ")))]
    Key {
        /// File or scenario; absent for an override.
        origin: Option<String>,
        /// Path of the key.
        key: String,
        /// What is wrong, and what is allowed.
        source: KeyError,
    },
    /// An override is not of the form key=value.
    #[error("'{text}' is not of the form key=value; example: belt.friction=0.4")]
    Override {
        /// The given text.
        text: String,
    },
    /// An override's key has more levels than any key of a scenario.
    #[error("a key has at most {MOST_LEVELS} levels (belt.friction has two)")]
    TooDeep,
    /// An effect is on that a rigid contact does not support.
    #[error("{origin}: {key} needs contact.kind = \"compliant\"")]
    NeedsCompliant {
        /// File or scenario.
        origin: String,
        /// The effect's key.
        key: &'static str,
    },
    /// The arm would start inside the belt.
    #[error(
        "{origin}: initial.theta1_deg = {} and initial.theta2_deg = {} put the tip {:.1} mm inside the belt of this arm; \
         initial.tip_m puts it on the belt of any arm",
        theta_deg[0],
        theta_deg[1],
        -1e3 * height_m
    )]
    InsideBelt {
        /// File or scenario.
        origin: String,
        /// The link angles, degrees.
        theta_deg: [f64; 2],
        /// Height of the tip over the belt, m.
        height_m: f64,
    },
    /// A value is out of range.
    #[error("{origin}: {source}")]
    Range {
        /// File or scenario.
        origin: String,
        /// The value and the allowed range.
        source: OutOfRange,
    },
}

impl ScenarioError {
    /// A value of a scenario that is out of range.
    pub fn range(scenario: &str, source: OutOfRange) -> Self {
        Self::Range {
            origin: scenario.into(),
            source,
        }
    }

    /// A start of a scenario's arm from which it cannot run.
    pub fn start(scenario: &str, initial: &InitialState, source: OutOfRange) -> Self {
        if source.key != INITIAL_HEIGHT || initial.tip_m.is_some() {
            return Self::range(scenario, source);
        }
        let [theta_1, theta_2] = InitialState::X0_D_DEG;
        Self::InsideBelt {
            origin: scenario.into(),
            theta_deg: [
                initial.theta1_deg.unwrap_or(theta_1),
                initial.theta2_deg.unwrap_or(theta_2),
            ],
            height_m: source.value,
        }
    }
}

/// What is wrong with a key.
#[derive(Debug, thiserror::Error)]
pub enum KeyError {
    /// The key is unknown or its value has the wrong type.
    #[error("{}", in_words(&source.to_string(), setting.as_ref()))]
    Value {
        /// What the deserializer says.
        source: Box<toml::de::Error>,
        /// The setting with its range, if there is one with this key.
        setting: Option<Field>,
    },
    /// The scenario cannot be written as a table.
    #[error(transparent)]
    Table(#[from] toml::ser::Error),
    /// A part of the key is unknown.
    #[error("unknown key '{part}'; {}", known_names(part, known))]
    Unknown {
        /// The part.
        part: String,
        /// The keys at its level.
        known: Vec<String>,
    },
    /// A part of the key names a variant that is not the chosen one.
    #[error("{key} is {chosen}, which has no '{part}'; choose it first with {key}={part}")]
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
    /// Another key says the same.
    #[error("it cannot be combined with {other}; give one of the two")]
    Excludes {
        /// The other key.
        other: String,
    },
    /// The key means nothing without another.
    #[error("{other} is missing; give that first")]
    Needs {
        /// The other key.
        other: String,
    },
    /// A file named by the key cannot be used.
    #[error("{0}")]
    File(String),
    /// A part of the key lies inside a number, a text or a switch.
    #[error("'{0}' would be inside a single value")]
    InsideValue(String),
}
