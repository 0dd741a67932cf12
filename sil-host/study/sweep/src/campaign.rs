//! The campaign file: a study and its options, with the names of the command line.
//!
//! ```toml
//! study = "bifurcation"
//! mu = "0.1:1:0.1"
//! initial = ["a", "d", "random:8"]
//! set = ["arm.damping_nms_rad.0=0.006"]
//! ```

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::error::{ContextKind, ContextValue};
use painleve_files::input_file;
use painleve_plant::scenario::{TomlError, known_names};
use painleve_study_core::StudyError;
use painleve_study_core::tabular;
use serde::{Deserialize, Serialize};
use toml::{Table, Value};
use xxhash_rust::xxh3::xxh3_128;

use super::SweepError;

/// What is wrong with a campaign.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    /// The text is not TOML.
    #[error("is not TOML: {0}")]
    Syntax(TomlError),
    /// The study is not given as a text.
    #[error("study: the value must be a name in quotes")]
    StudyName,
    /// An option's value cannot appear on a command line.
    #[error("{key}: the value must be a text, a number or a list of these, as on the command line")]
    Value {
        /// The option.
        key: String,
    },
    /// No study is given.
    #[error("no study is given; add one, for example study = \"bifurcation\"")]
    NoStudy,
    /// The study does not exist or has no rows to share.
    #[error("study = \"{study}\" cannot be computed in shards; these can: {}", shardable.join(", "))]
    NotShardable {
        /// The given study.
        study: String,
        /// The studies that can be computed in shards.
        shardable: Vec<&'static str>,
    },
    /// The study has no such option.
    #[error(
        "unknown option '{key}' in a campaign of the study {study}; {}",
        known_names(key, known)
    )]
    UnknownOption {
        /// The given option.
        key: String,
        /// The study.
        study: String,
        /// The study's options.
        known: Vec<String>,
    },
    /// An option's value is invalid.
    #[error("{}", first_sentence(.0))]
    Option(#[from] clap::Error),
    /// The study is invalid.
    #[error(transparent)]
    Study(#[from] StudyError),
}

/// Returns clap's message with the allowed values, if they have names, but without its hints for the command line.
fn first_sentence(error: &clap::Error) -> String {
    let text = error.to_string();
    let sentence = text.lines().next().unwrap_or_default();
    let sentence = sentence.trim_start_matches("error: ");
    match (
        error.get(ContextKind::InvalidValue),
        error.get(ContextKind::ValidValue),
    ) {
        (Some(ContextValue::String(value)), Some(ContextValue::Strings(known)))
            if !known.is_empty() =>
        {
            format!("{sentence}; {}", known_names(value, known))
        }
        _ => sentence.to_owned(),
    }
}

/// A study and its options.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Campaign {
    /// Name of the study.
    pub study: String,
    /// Values of its options, by their names without leading dashes.
    pub options: BTreeMap<String, Vec<String>>,
}

/// Files with their contents.
pub type Files = BTreeMap<PathBuf, Vec<u8>>;

/// A campaign as parsed by its study.
pub struct Understood {
    /// The study.
    pub table: Box<dyn tabular::Table>,
    /// The content of every file that it reads: scenarios, and the tables that these or its options name.
    pub files: Files,
}

impl Campaign {
    /// Reads a campaign file. Does not check whether the study has these options.
    ///
    /// # Errors
    /// [`SweepError`] if the file does not exist or is not a campaign.
    pub fn load(path: &Path) -> Result<Self, SweepError> {
        let text = input_file::read(path)
            .map_err(|source| SweepError::unreadable("campaign file", path, source))?;
        Self::parse(&text).map_err(|source| SweepError::Campaign {
            path: path.into(),
            source,
        })
    }

    fn parse(text: &str) -> Result<Self, CampaignError> {
        let table: Table = text
            .parse()
            .map_err(|source| CampaignError::Syntax(TomlError::new(source, text)))?;
        let mut campaign = Self::default();
        for (key, value) in table {
            match (key.as_str(), value) {
                ("study", Value::String(study)) => campaign.study = study,
                ("study", _) => return Err(CampaignError::StudyName),
                (_, value) => {
                    let Some(values) = texts(&value) else {
                        return Err(CampaignError::Value { key });
                    };
                    campaign.options.insert(key, values);
                }
            }
        }
        if campaign.study.is_empty() {
            return Err(CampaignError::NoStudy);
        }
        Ok(campaign)
    }

    /// Returns the hash of everything that the rows depend on besides the program.
    pub fn hash(&self, files: &Files) -> String {
        let content = |(path, content): (&PathBuf, &Vec<u8>)| {
            let hash = format!("{:032x}", xxh3_128(content));
            (path.display().to_string(), hash)
        };
        let files: BTreeMap<String, String> = files.iter().map(content).collect();
        // Unlike plain concatenation, JSON keeps adjacent texts separate.
        let text = serde_json::json!([self.study, self.options, files]).to_string();
        format!("{:032x}", xxh3_128(text.as_bytes()))
    }
}

/// Returns the values of an option, if they can appear on a command line.
fn texts(value: &Value) -> Option<Vec<String>> {
    let one = |value: &Value| match value {
        Value::String(text) => Some(text.clone()),
        Value::Integer(number) => Some(number.to_string()),
        Value::Float(number) => Some(number.to_string()),
        _ => None,
    };
    match value {
        Value::Array(values) if values.is_empty() => None,
        Value::Array(values) => values.iter().map(one).collect(),
        value => one(value).map(|text| vec![text]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_depends_on_the_content_of_a_campaign_not_on_its_format() {
        let one = "study = 'bifurcation'\nmu = [0.4, 0.6]\nseed = 7\n";
        let other = "# a comment\nseed=7\nmu=[0.40,0.6]\nstudy=\"bifurcation\"";
        let (one, other) = (
            Campaign::parse(one).unwrap(),
            Campaign::parse(other).unwrap(),
        );
        assert_eq!(one, other);
        assert_eq!(one.options["mu"], ["0.4", "0.6"]);
        let none = BTreeMap::new();
        assert_eq!(one.hash(&none), other.hash(&none));
        let file = |content: &str| BTreeMap::from([("mine.toml".into(), content.into())]);
        assert_ne!(one.hash(&none), one.hash(&file("text")));
        assert_ne!(one.hash(&file("texts")), one.hash(&file("text")));
        let mut seed = one.clone();
        seed.options.insert("seed".into(), vec!["8".into()]);
        assert_ne!(one.hash(&none), seed.hash(&none));
    }

    #[test]
    fn mistakes_are_named() {
        for (text, part) in [
            ("", "no study"),
            ("mu = 0.6", "no study"),
            ("study = 3", "study: the value must be a name"),
            ("study = 'a'\nmu = true", "mu: the value must be"),
            ("study = 'a'\nmu = []", "mu: the value must be"),
            ("study = 'a'\n[mu]\nx = 1", "mu: the value must be"),
            ("study = 'a'\nmu = [[1]]", "mu: the value must be"),
            ("study = 'a'\nmu = = 1", "line 2"),
        ] {
            let message = Campaign::parse(text).unwrap_err().to_string();
            assert!(message.contains(part), "{message}");
        }
    }
}
