//! The manifest of a sweep: the exact computation, and the program that performs it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use painleve_files::atomic_file::{self, AtomicFileError};
use painleve_files::input_file::{self, MOST_BYTES};
use painleve_plant::scenario::TomlError;
use painleve_study_core::{MOST_ROWS, StudyError};
use serde::{Deserialize, Serialize};
use toml::Table;
use xxhash_rust::xxh3::xxh3_128;

use super::campaign::{Campaign, CampaignError, Files, Understood};
use super::share::MOST_SHARDS;
use super::{ShardError, SweepError};

/// Format version of the manifest file.
const FORMAT: u32 = 1;

/// Version of this program.
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Git revision of this build; `…-changed` if it has uncommitted
/// changes, `unknown` outside a repository.
const REVISION: &str = env!("PAINLEVE_REVISION");

/// What is wrong with a manifest, and how to correct it.
#[derive(Debug, thiserror::Error)]
pub enum ManifestError {
    /// The folder holds the manifest of another sweep.
    #[error("another sweep is planned here; choose another --folder, or delete the folder {}", .0.display())]
    OtherSweep(PathBuf),
    /// There is no manifest.
    #[error(
        "the file does not exist; plan the sweep first, with `painleve sweep plan`, or give its --folder"
    )]
    Missing,
    /// The file is not a manifest.
    #[error("is not a manifest: {0}")]
    Syntax(TomlError),
    /// Another version of the program wrote it.
    #[error(
        "is of another version: {key} is {}, this program's is {ours}; \
         use the program that planned the sweep, or plan it again elsewhere",
        found.as_deref().unwrap_or("nothing")
    )]
    OtherVersion {
        /// The key that differs.
        key: &'static str,
        /// Its value in the manifest.
        found: Option<String>,
        /// Its value of this program.
        ours: String,
    },
    /// The number of shards does not suit the rows.
    #[error(
        "has been changed: it has no shards, more shards than rows, or more of either than a sweep can have"
    )]
    ShardCount,
    /// The campaign or a file has been changed.
    #[error("it {}has been changed since the sweep was planned; plan it again elsewhere", or_files(.0))]
    Changed(Vec<PathBuf>),
    /// The campaign is invalid.
    #[error(transparent)]
    Campaign(#[from] CampaignError),
}

/// Names the files that a campaign reads, as an alternative to its manifest; empty without any.
fn or_files(files: &[PathBuf]) -> String {
    let names: Vec<String> = files.iter().map(|it| it.display().to_string()).collect();
    match names.as_slice() {
        [] => String::new(),
        names => format!("or a file that it reads ({}) ", names.join(", ")),
    }
}

/// Everything that the rows of a sweep depend on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Format version of the manifest.
    format: u32,
    /// Version of the program.
    version: String,
    /// Git revision of the program.
    git_revision: String,
    /// Hash of the campaign and the files that it reads.
    campaign_hash: String,
    /// Number of rows.
    pub rows: usize,
    /// Number of shards, numbered from 0.
    pub shards: usize,
    /// Every seed, by its purpose.
    seeds: BTreeMap<String, u64>,
    /// The campaign.
    pub campaign: Campaign,
}

impl Manifest {
    /// Name of the manifest file in the sweep's folder.
    pub fn path(folder: &Path) -> PathBuf {
        folder.join("manifest.toml")
    }

    /// Plans a campaign.
    ///
    /// # Errors
    /// [`SweepError`] if the number of shards is out of range.
    pub fn new(
        campaign: Campaign,
        understood: &Understood,
        shards: usize,
    ) -> Result<Self, SweepError> {
        let rows = understood.table.len();
        if rows > MOST_ROWS {
            return Err(StudyError::TooManyRows(rows).into());
        }
        if !(1..=rows.min(MOST_SHARDS)).contains(&shards) {
            let most = rows.min(MOST_SHARDS);
            return Err(ShardError::Count { shards, most, rows }.into());
        }
        Ok(Self {
            format: FORMAT,
            version: VERSION.into(),
            git_revision: REVISION.into(),
            campaign_hash: campaign.hash(&understood.files),
            rows,
            shards,
            seeds: understood.table.seeds()?,
            campaign,
        })
    }

    /// Returns the hash of the whole manifest, which identifies the sweep of a shard.
    pub fn hash(&self) -> String {
        let text = serde_json::json!(self).to_string();
        format!("{:032x}", xxh3_128(text.as_bytes()))
    }

    /// Returns the hash of the campaign and the files that it reads.
    pub fn campaign_hash(&self) -> &str {
        &self.campaign_hash
    }

    /// Writes the manifest into its folder. If the same manifest exists already, leaves it
    /// unchanged and returns `false`.
    ///
    /// # Errors
    /// [`SweepError`] if a different manifest exists, or the file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<bool, SweepError> {
        let path = Self::path(folder);
        // Of several sweeps planned at once, the first to create the file wins.
        match atomic_file::write_new(&path, self.text().as_bytes()) {
            Err(AtomicFileError::Exists { .. }) => {}
            written => return Ok(written.map(|()| true)?),
        }
        if input_file::read(&path).is_ok_and(|text| text == self.text()) {
            return Ok(false);
        }
        Err(SweepError::Manifest {
            path,
            source: ManifestError::OtherSweep(folder.into()),
        })
    }

    fn text(&self) -> String {
        toml::to_string(self).unwrap_or_default()
    }

    /// Reads the manifest of a sweep that this program planned.
    ///
    /// # Errors
    /// [`SweepError`] if the file does not exist, or another program wrote it.
    pub fn load(folder: &Path) -> Result<Self, SweepError> {
        let path = Self::path(folder);
        let text = match input_file::read(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return Err(SweepError::Manifest {
                    path,
                    source: ManifestError::Missing,
                });
            }
            Err(source) => return Err(SweepError::unreadable("manifest", path, source)),
        };
        Self::parse(&text).map_err(|source| SweepError::Manifest { path, source })
    }

    fn parse(text: &str) -> Result<Self, ManifestError> {
        let syntax = |source| ManifestError::Syntax(TomlError::new(source, text));
        let table: Table = text.parse().map_err(syntax)?;
        // Checked first, because the other fields may differ between versions.
        let of = |key: &str| table.get(key).map(|value| value.to_string());
        for (key, ours) in [
            ("format", FORMAT.to_string()),
            ("version", format!("{VERSION:?}")),
            ("git_revision", format!("{REVISION:?}")),
        ] {
            let found = of(key);
            if found.as_ref() != Some(&ours) {
                return Err(ManifestError::OtherVersion { key, found, ours });
            }
        }
        let manifest: Self = table.try_into().map_err(syntax)?;
        let most = manifest.rows.min(MOST_SHARDS);
        if manifest.rows > MOST_ROWS || !(1..=most).contains(&manifest.shards) {
            return Err(ManifestError::ShardCount);
        }
        Ok(manifest)
    }

    /// Checks that the campaign, parsed again, is still the planned one, with the same files.
    ///
    /// # Errors
    /// [`SweepError::Manifest`] if it has changed.
    pub fn check(&self, folder: &Path, understood: &Understood) -> Result<(), SweepError> {
        if self.campaign.hash(&understood.files) == self.campaign_hash
            && understood.table.len() == self.rows
        {
            return Ok(());
        }
        Err(Self::changed(folder, &understood.files))
    }

    /// Checks that no file has changed while rows were computed, which may read one again.
    ///
    /// # Errors
    /// [`SweepError::Manifest`] if one has.
    pub fn check_files(folder: &Path, files: &Files) -> Result<(), SweepError> {
        let is_same = |(path, content): (&PathBuf, &Vec<u8>)| {
            input_file::bytes(path, MOST_BYTES).is_ok_and(|now| now == *content)
        };
        match files.iter().all(is_same) {
            true => Ok(()),
            false => Err(Self::changed(folder, files)),
        }
    }

    fn changed(folder: &Path, files: &Files) -> SweepError {
        SweepError::Manifest {
            path: Self::path(folder),
            source: ManifestError::Changed(files.keys().cloned().collect()),
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use proptest::prelude::*;
    use proptest::sample::Index;

    /// Creates a manifest with this many rows and no content.
    pub fn manifest(rows: usize, shards: usize) -> Manifest {
        Manifest {
            format: FORMAT,
            version: VERSION.into(),
            git_revision: REVISION.into(),
            campaign_hash: "0".into(),
            rows,
            shards,
            seeds: BTreeMap::from([("initial".into(), 1)]),
            campaign: Campaign {
                study: "none".into(),
                options: BTreeMap::from([("mu".into(), vec!["0.6".into()])]),
            },
        }
    }

    #[test]
    fn a_file_that_changes_while_rows_are_computed_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("friction.csv");
        let files = Files::from([(path.clone(), b"0,1".to_vec())]);
        std::fs::write(&path, "0,1").unwrap();
        Manifest::check_files(folder.path(), &files).unwrap();
        std::fs::write(&path, "0,2").unwrap();
        let error = Manifest::check_files(folder.path(), &files).unwrap_err();
        assert!(error.to_string().contains("friction.csv"), "{error}");
    }

    proptest! {
        #[test]
        fn damaged_manifests_are_refused_or_within_bounds(
            edits in prop::collection::vec((any::<Index>(), 0..4_usize, "\\PC{0,12}"), 1..6),
        ) {
            let mut text: Vec<char> = manifest(10, 3).text().chars().collect();
            for (at, removed, inserted) in edits {
                let at = at.index(text.len().max(1));
                let end = (at + removed).min(text.len());
                text.splice(at.min(end)..end, inserted.chars());
            }
            match Manifest::parse(&text.into_iter().collect::<String>()) {
                Ok(read) => prop_assert!(
                    read.rows <= MOST_ROWS && (1..=MOST_SHARDS).contains(&read.shards)
                ),
                Err(error) => prop_assert!(!error.to_string().is_empty()),
            }
        }
    }

    #[test]
    fn a_manifest_is_read_back_unchanged_and_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let ours = manifest(10, 3);
        assert!(ours.write(folder.path()).unwrap());
        assert!(!ours.write(folder.path()).unwrap());
        assert_eq!(Manifest::load(folder.path()).unwrap(), ours);
        let error = manifest(10, 4).write(folder.path()).unwrap_err();
        assert!(error.to_string().contains("another sweep"), "{error}");
        assert_eq!(Manifest::load(folder.path()).unwrap(), ours);
        assert_ne!(manifest(10, 4).hash(), ours.hash());
    }

    #[test]
    fn other_versions_and_changed_files_are_refused() {
        let text = manifest(10, 3).text();
        let parse = |from: &str, to: &str| {
            assert!(text.contains(from), "{text}");
            Manifest::parse(&text.replace(from, to))
                .unwrap_err()
                .to_string()
        };
        let version = format!("\"{VERSION}\"");
        assert!(parse(&version, "\"9.9.9\"").contains("version is \"9.9.9\""));
        assert!(parse("format = 1", "format = 2").contains("format is 2"));
        assert!(parse("format = 1", "").contains("format is nothing"));
        assert!(parse(REVISION, "feed").contains("git_revision is \"feed\""));
        assert!(parse("shards = 3", "shards = 11").contains("more shards"));
        assert!(parse("shards = 3", "shard = 3").contains("not a manifest"));
        let error = Manifest::parse("").unwrap_err().to_string();
        assert!(error.contains("another version"));
    }
}
