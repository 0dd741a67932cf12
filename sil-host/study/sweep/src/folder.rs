//! The folder of a sweep: its finished shards and their merge.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use serde::{Serialize, Serializer};

use super::manifest::Manifest;
use super::shard_file::{self, Shard, ShardFileError};
use super::{MismatchError, SweepError, array};

/// State of the folder, shard by shard.
#[derive(Debug, Default, Serialize)]
pub struct SweepStatus {
    /// Number of shards.
    pub shards: usize,
    /// Number of rows.
    pub rows: usize,
    /// Number of finished shards.
    pub finished: usize,
    /// Missing shards, for example `3,7,9-12`.
    pub missing: String,
    /// Files that are not shards of this sweep, with the reason.
    pub unusable: Vec<Unusable>,
    /// Shards with more than one file.
    pub duplicates: Vec<Duplicate>,
}

/// A file that is not a shard of this sweep.
#[derive(Debug, Serialize)]
pub struct Unusable {
    /// The file.
    #[serde(serialize_with = "path_as_text")]
    pub file: PathBuf,
    /// The reason.
    #[serde(serialize_with = "as_text")]
    pub reason: ShardFileError,
}

fn as_text<S: Serializer>(reason: &ShardFileError, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(reason)
}

/// Serializes a path as text, in which bytes that are not UTF-8 are replaced: JSON has no others.
///
/// # Errors
/// Those of the serializer.
pub fn path_as_text<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(&path.display())
}

fn paths_as_text<S: Serializer>(paths: &[PathBuf], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(paths.iter().map(|path| path.display().to_string()))
}

/// A shard with more than one file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Duplicate {
    /// Number of the shard.
    pub shard: usize,
    /// Its files.
    #[serde(serialize_with = "paths_as_text")]
    pub files: Vec<PathBuf>,
}

/// Returns all files of the folder that are named like shards, in the order of their names.
struct Contents {
    whole: Vec<(PathBuf, Shard)>,
    unusable: Vec<Unusable>,
}

impl Contents {
    fn read(folder: &Path, manifest: &Manifest) -> Result<Self, SweepError> {
        let unreadable = |source| SweepError::unreadable("folder", folder, source);
        let entries = fs::read_dir(folder).map_err(unreadable)?;
        let mut paths = Vec::new();
        for entry in entries {
            let name = entry.map_err(unreadable)?.file_name();
            let text = name.to_string_lossy();
            if text.starts_with("shard-") && text.ends_with(".csv") {
                paths.push(folder.join(name));
            }
        }
        paths.sort();
        let (mut whole, mut unusable) = (Vec::new(), Vec::new());
        for file in paths {
            match shard_file::read(&file, manifest) {
                Ok(shard) => whole.push((file, shard)),
                Err(reason) => unusable.push(Unusable { file, reason }),
            }
        }
        Ok(Self { whole, unusable })
    }

    /// Returns the files of a shard, normally one.
    fn files_of(&self, shard: usize) -> Vec<PathBuf> {
        let files = self.whole.iter().filter(|(_, whole)| whole.shard == shard);
        files.map(|(file, _)| file.clone()).collect()
    }
}

/// Returns the shards that are not finished.
///
/// # Errors
/// [`SweepError::Unreadable`] if the folder cannot be listed.
pub fn missing(folder: &Path, manifest: &Manifest) -> Result<Vec<usize>, SweepError> {
    Ok(missing_in(&Contents::read(folder, manifest)?, manifest))
}

fn missing_in(contents: &Contents, manifest: &Manifest) -> Vec<usize> {
    let mut there = vec![false; manifest.shards];
    for (_, whole) in &contents.whole {
        there[whole.shard] = true;
    }
    (0..manifest.shards)
        .filter(|&shard| !there[shard])
        .collect()
}

/// Returns the progress of the sweep.
///
/// # Errors
/// [`SweepError::Unreadable`] if the folder cannot be listed.
pub fn status(folder: &Path, manifest: &Manifest) -> Result<SweepStatus, SweepError> {
    Ok(status_of(Contents::read(folder, manifest)?, manifest).0)
}

/// Returns the progress, and the usable shards.
fn status_of(contents: Contents, manifest: &Manifest) -> (SweepStatus, Vec<Shard>) {
    let missing = missing_in(&contents, manifest);
    let mut shards: Vec<usize> = contents
        .whole
        .iter()
        .map(|(_, whole)| whole.shard)
        .collect();
    shards.sort_unstable();
    let duplicates: Vec<Duplicate> = shards
        .chunk_by(|one, next| one == next)
        .filter(|same| same.len() > 1)
        .map(|same| Duplicate {
            shard: same[0],
            files: contents.files_of(same[0]),
        })
        .collect();
    let status = SweepStatus {
        shards: manifest.shards,
        rows: manifest.rows,
        finished: manifest.shards - missing.len(),
        missing: array::syntax(&missing),
        duplicates,
        unusable: contents.unusable,
    };
    let whole = contents.whole.into_iter();
    (status, whole.map(|(_, shard)| shard).collect())
}

/// Returns the CSV file of the whole study, byte for byte as the study itself writes it.
///
/// # Errors
/// [`SweepError::Incomplete`] unless every shard is present exactly once.
pub fn merge(folder: &Path, manifest: &Manifest) -> Result<Vec<u8>, SweepError> {
    let (status, shards) = status_of(Contents::read(folder, manifest)?, manifest);
    if !status.is_complete() {
        return Err(SweepError::Incomplete {
            folder: folder.to_path_buf(),
            status: Box::new(status),
        });
    }
    Ok(together(shards, manifest.rows)?)
}

impl SweepStatus {
    /// Whether every shard is present exactly once, and nothing else.
    pub fn is_complete(&self) -> bool {
        self.missing.is_empty() && self.duplicates.is_empty() && self.unusable.is_empty()
    }

    /// Returns a sentence for everything that is missing, duplicated or broken.
    pub fn defects(&self) -> Vec<String> {
        let missing = (!self.missing.is_empty())
            .then(|| format!("missing of {} shards: {}", self.shards, self.missing));
        let duplicates = self.duplicates.iter().map(|Duplicate { shard, files }| {
            let names: Vec<_> = files
                .iter()
                .map(|file| file.display().to_string())
                .collect();
            format!("shard {shard} is present twice, as {}", names.join(" and "))
        });
        let unusable = self.unusable.iter();
        let unusable =
            unusable.map(|Unusable { file, reason }| format!("{} {reason}", file.display()));
        missing
            .into_iter()
            .chain(duplicates)
            .chain(unusable)
            .collect()
    }
}

fn together(shards: Vec<Shard>, rows: usize) -> Result<Vec<u8>, MismatchError> {
    let header = shards.first().map(|shard| shard.header.clone());
    let header = header.ok_or(MismatchError::None)?;
    if shards.iter().any(|shard| shard.header != header) {
        return Err(MismatchError::Headers);
    }
    let mut all: Vec<_> = shards.into_iter().flat_map(|shard| shard.rows).collect();
    all.sort_by_key(|(row, _)| *row);
    if all.iter().map(|(row, _)| *row).ne(0..rows) {
        return Err(MismatchError::Rows);
    }
    let mut writer = csv::Writer::from_writer(Vec::new());
    let written = writer.write_byte_record(&header).and_then(|()| {
        let mut lines = all.iter().flat_map(|(_, lines)| lines);
        lines.try_for_each(|line| writer.write_byte_record(line))
    });
    written?;
    let text = writer.into_inner();
    text.map_err(|error| csv::Error::from(error.into_error()).into())
}

/// Removes the temporary files of processes that were killed while writing a shard.
pub fn tidy(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
        // One that is locked is being written, by a process that computes a shard twice.
        let is_dead = || File::open(entry.path()).is_ok_and(|file| file.try_lock().is_ok());
        if name.starts_with(".shard-") && name.ends_with(".part") && is_file && is_dead() {
            // A file that cannot be removed is harmless.
            let _ = fs::remove_file(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifest::tests::manifest;
    use crate::share::rows_of;
    use csv::ByteRecord;
    use painleve_study_core::tabular::Records;

    const ROWS: usize = 11;

    fn finish(folder: &Path, shards: usize, shard: usize) {
        let rows: Vec<usize> = rows_of(shard, shards, ROWS).collect();
        let records: Vec<Records> = rows
            .iter()
            .map(|row| Records {
                header: ByteRecord::from(vec!["row", "text"]),
                lines: vec![ByteRecord::from(vec![row.to_string(), "a,b".into()])],
            })
            .collect();
        shard_file::write(folder, &manifest(ROWS, shards), shard, &rows, &records).unwrap();
    }

    #[test]
    fn any_number_of_shards_merges_to_the_same_bytes() {
        let expected: String = (0..ROWS).map(|row| format!("{row},\"a,b\"\n")).collect();
        for shards in [1, 2, 5, 11] {
            let folder = tempfile::tempdir().unwrap();
            let manifest = manifest(ROWS, shards);
            for shard in (0..shards).rev() {
                finish(folder.path(), shards, shard);
            }
            let merged = merge(folder.path(), &manifest).unwrap();
            assert_eq!(
                String::from_utf8(merged).unwrap(),
                format!("row,text\n{expected}")
            );
        }
    }

    #[test]
    fn gaps_duplicates_and_broken_files_are_refused_and_named() {
        let folder = tempfile::tempdir().unwrap();
        let manifest = manifest(ROWS, 5);
        let path = |name: &str| folder.path().join(name);
        for shard in [0, 2, 3] {
            finish(folder.path(), 5, shard);
        }
        assert_eq!(missing(folder.path(), &manifest).unwrap(), [1, 4]);
        let message = || merge(folder.path(), &manifest).unwrap_err().to_string();
        assert!(
            message().contains("missing of 5 shards: 1,4"),
            "{}",
            message()
        );
        // Another shard under the name of a missing shard.
        fs::copy(path("shard-0.csv"), path("shard-1.csv")).unwrap();
        assert_eq!(missing(folder.path(), &manifest).unwrap(), [1, 4]);
        assert!(
            message().contains("shard 0 is present twice"),
            "{}",
            message()
        );
        for shard in [1, 4] {
            finish(folder.path(), 5, shard);
        }
        assert!(merge(folder.path(), &manifest).is_ok());
        fs::copy(path("shard-0.csv"), path("shard-0 (copy).csv")).unwrap();
        assert!(message().contains("shard-0 (copy).csv"), "{}", message());
        fs::remove_file(path("shard-0 (copy).csv")).unwrap();
        fs::write(path("shard-4.csv"), "row\n").unwrap();
        let status = status(folder.path(), &manifest).unwrap();
        assert_eq!((status.finished, status.missing.as_str()), (4, "4"));
        assert!(matches!(
            status.unusable[0].reason,
            ShardFileError::Truncated
        ));
        assert!(
            message().contains("shard-4.csv is truncated"),
            "{}",
            message()
        );
    }

    #[test]
    fn only_stale_temporary_files_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        for name in [".shard-1.csv.x.part", "shard-1.csv", "mine.part"] {
            fs::write(folder.path().join(name), "").unwrap();
        }
        let written = File::create(folder.path().join(".shard-2.csv.y.part")).unwrap();
        written.lock().unwrap();
        tidy(folder.path());
        let mut left: Vec<_> = fs::read_dir(folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        left.sort();
        assert_eq!(left, [".shard-2.csv.y.part", "mine.part", "shard-1.csv"]);
    }
}
