//! The campaign file: a study and its options, with the names of the command line.
//!
//! ```toml
//! study = "bifurcation"
//! mu = "0.1:1:0.1"
//! initial = ["a", "d", "random:8"]
//! set = ["arm.damping_nms_rad.0=0.006"]
//! ```

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use toml::{Table, Value};
use xxhash_rust::xxh3::xxh3_128;

use painleve_system::input_file;

use super::SweepError;

/// A study and its options.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Campaign {
    /// Name of the study.
    pub study: String,
    /// Values of its options, by their names without leading dashes.
    pub options: BTreeMap<String, Vec<String>>,
}

/// A campaign as parsed by its study.
pub struct Understood {
    /// The study.
    pub table: Box<dyn crate::tabular::Table>,
    /// The complete text of every scenario that it starts from, by name.
    pub scenarios: BTreeMap<String, String>,
}

impl Campaign {
    /// Reads a campaign file. Does not check whether the study has these options.
    ///
    /// # Errors
    /// [`SweepError`] if the file does not exist or is not a campaign.
    pub fn load(path: &Path) -> Result<Self, SweepError> {
        let text = input_file::read(path)
            .map_err(|source| SweepError::unreadable("campaign file", path, source))?;
        Self::parse(&text).map_err(|message| SweepError::Campaign {
            path: path.into(),
            message,
        })
    }

    fn parse(text: &str) -> Result<Self, String> {
        let table: Table = text.parse().map_err(|error: toml::de::Error| {
            let line = error.span().map_or(1, |span| {
                1 + text
                    .bytes()
                    .take(span.start)
                    .filter(|&byte| byte == b'\n')
                    .count()
            });
            format!("line {line} is not TOML: {}", error.message())
        })?;
        let mut campaign = Self::default();
        for (key, value) in table {
            match (key.as_str(), value) {
                ("study", Value::String(study)) => campaign.study = study,
                ("study", _) => return Err("study: the value must be a name in quotes".into()),
                (_, value) => {
                    let values = texts(&value).ok_or(format!(
                        "{key}: the value must be a text, a number or a list of these, as on the command line"
                    ))?;
                    campaign.options.insert(key, values);
                }
            }
        }
        if campaign.study.is_empty() {
            return Err("no study is given; add one, for example study = \"bifurcation\"".into());
        }
        Ok(campaign)
    }

    /// Returns the hash of everything that the rows depend on besides the program.
    pub fn hash(&self, scenarios: &BTreeMap<String, String>) -> String {
        // Unlike plain concatenation, JSON keeps adjacent texts separate.
        let text = serde_json::json!([self.study, self.options, scenarios]).to_string();
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
        let scenarios = BTreeMap::from([("mine.toml".to_owned(), "text".to_owned())]);
        assert_ne!(one.hash(&none), one.hash(&scenarios));
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
            let message = Campaign::parse(text).unwrap_err();
            assert!(message.contains(part), "{message}");
        }
    }
}
