//! Why a scenario cannot be loaded, in one sentence for the user.

use std::path::PathBuf;

use painleve_shared::range::OutOfRange;

use super::built_in;

/// Upper limit of the levels of a key; no scenario key has as many.
pub(super) const MOST_LEVELS: usize = 16;

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
