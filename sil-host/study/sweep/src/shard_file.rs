//! A finished shard: CSV whose first field is the row's number in the whole study. Its last
//! line identifies the shard and ends with a checksum of everything before it.
//!
//! ```text
//! row,mu,v_belt_m_s,…
//! 1,0.1,-0.995,…
//! # shard 1/5 of sweep 4f0c…, 724 rows, xxh3 93ab…
//! ```
//!
//! The file is written under a temporary name and renamed once it is on the disk: it is
//! either complete or absent. The checksum detects a truncated file.

use std::path::{Path, PathBuf};

use csv::ByteRecord;
use painleve_files::{atomic_file, input_file};
use painleve_study_core::tabular::Records;
use xxhash_rust::xxh3::xxh3_128;

use super::SweepError;
use super::manifest::Manifest;
use super::share::rows_of;

const CHECKSUM: &str = ", xxh3 ";

/// Largest size of a shard, bytes. Real ones have a few million.
const MOST_BYTES: u64 = 1 << 30;

/// Why a file is not a shard of a sweep, in words that follow the file's name.
#[derive(Debug, thiserror::Error)]
pub enum ShardFileError {
    /// The file cannot be read.
    #[error("cannot be read: {0}")]
    Unreadable(#[from] std::io::Error),
    /// The end is missing.
    #[error("is truncated")]
    Truncated,
    /// The content has been changed.
    #[error("does not match its checksum")]
    Checksum,
    /// The last line names no shard of the sweep.
    #[error("is not a shard of this sweep")]
    NotAShard,
    /// The last line names another sweep.
    #[error("belongs to another sweep")]
    OtherSweep,
    /// The rows are not CSV.
    #[error("is not a table: {0}")]
    Table(#[from] csv::Error),
    /// A line does not begin with a row's number.
    #[error("is not a table: a line has no row number")]
    NoRowNumber,
    /// A row is missing or present twice.
    #[error("does not hold every row of shard {0} exactly once")]
    Rows(usize),
}

/// Contents of a finished shard.
#[derive(Debug, PartialEq)]
pub struct Shard {
    /// Number of the shard.
    pub shard: usize,
    /// Names of the fields.
    pub header: ByteRecord,
    /// Row numbers in ascending order, and the lines of each row.
    pub rows: Vec<(usize, Vec<ByteRecord>)>,
}

/// Returns the name of its file in the sweep's folder.
pub fn path(folder: &Path, shard: usize) -> PathBuf {
    folder.join(format!("shard-{shard}.csv"))
}

fn footer(manifest: &Manifest, shard: usize, rows: usize) -> String {
    let (shards, hash) = (manifest.shards, manifest.hash());
    format!("# shard {shard}/{shards} of sweep {hash}, {rows} rows{CHECKSUM}")
}

/// Writes the computed rows of a shard.
///
/// # Errors
/// [`SweepError::Output`] if the file cannot be written; no file is left then.
pub fn write(
    folder: &Path,
    manifest: &Manifest,
    shard: usize,
    rows: &[usize],
    records: &[Records],
) -> Result<(), SweepError> {
    let path = path(folder, shard);
    let text = text(manifest, shard, rows, records).map_err(|source| {
        atomic_file::AtomicFileError::Write {
            path: path.clone(),
            source: source.into(),
        }
    })?;
    Ok(atomic_file::write(path, &text)?)
}

fn text(
    manifest: &Manifest,
    shard: usize,
    rows: &[usize],
    records: &[Records],
) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    if let Some(first) = records.first() {
        writer.write_record(std::iter::once(&b"row"[..]).chain(&first.header))?;
    }
    for (row, records) in rows.iter().zip(records) {
        let row = row.to_string();
        for line in &records.lines {
            writer.write_record(std::iter::once(row.as_bytes()).chain(line))?;
        }
    }
    let mut text = writer.into_inner().map_err(|error| error.into_error())?;
    text.extend(footer(manifest, shard, rows.len()).into_bytes());
    let checksum = xxh3_128(&text);
    text.extend(format!("{checksum:032x}\n").into_bytes());
    Ok(text)
}

/// Reads a shard and checks it against the manifest.
///
/// # Errors
/// [`ShardFileError`] if the file is not a shard of this sweep.
pub fn read(path: &Path, manifest: &Manifest) -> Result<Shard, ShardFileError> {
    let text = input_file::bytes(path, MOST_BYTES)?;
    let whole = text.strip_suffix(b"\n").ok_or(ShardFileError::Truncated)?;
    let start = whole
        .iter()
        .rposition(|&byte| byte == b'\n')
        .map_or(0, |at| at + 1);
    let (body, line) = whole.split_at(start);
    let line = std::str::from_utf8(line).map_err(|_| ShardFileError::Truncated)?;
    let (claim, checksum) = line.split_once(CHECKSUM).ok_or(ShardFileError::Truncated)?;
    let covered = &text[..start + claim.len() + CHECKSUM.len()];
    if format!("{:032x}", xxh3_128(covered)) != checksum {
        return Err(ShardFileError::Checksum);
    }
    let shard = claim
        .strip_prefix("# shard ")
        .and_then(|rest| rest.split_once('/'))
        .and_then(|(shard, _)| shard.parse::<usize>().ok())
        .filter(|&shard| shard < manifest.shards)
        .ok_or(ShardFileError::NotAShard)?;
    let numbers: Vec<usize> = rows_of(shard, manifest.shards, manifest.rows).collect();
    if format!("{claim}{CHECKSUM}") != footer(manifest, shard, numbers.len()) {
        return Err(ShardFileError::OtherSweep);
    }
    let (header, rows) = parse(body)?;
    if rows.iter().map(|(row, _)| row).ne(&numbers) {
        return Err(ShardFileError::Rows(shard));
    }
    Ok(Shard {
        shard,
        header,
        rows,
    })
}

type Rows = Vec<(usize, Vec<ByteRecord>)>;

fn parse(body: &[u8]) -> Result<(ByteRecord, Rows), ShardFileError> {
    let mut reader = csv::Reader::from_reader(body);
    let rest = |record: &ByteRecord| -> ByteRecord { record.iter().skip(1).collect() };
    let header = reader.byte_headers()?;
    let header = rest(header);
    let mut rows: Rows = Vec::new();
    for record in reader.byte_records() {
        let record = record?;
        let row = record
            .get(0)
            .and_then(|field| std::str::from_utf8(field).ok())
            .and_then(|field| field.parse().ok())
            .ok_or(ShardFileError::NoRowNumber)?;
        match rows.last_mut() {
            Some((last, lines)) if *last == row => lines.push(rest(&record)),
            _ => rows.push((row, vec![rest(&record)])),
        }
    }
    Ok((header, rows))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifest::tests::manifest;
    use proptest::prelude::*;
    use proptest::sample::Index;
    use std::fs;

    /// Returns bytes with some of them changed, removed or added.
    fn damaged(mut bytes: Vec<u8>, edits: &[(Index, u8, u8)]) -> Vec<u8> {
        for (at, kind, value) in edits {
            let at = at.index(bytes.len().max(1));
            match kind {
                0 => bytes.insert(at, *value),
                1 => bytes.truncate(at),
                _ if at >= bytes.len() => {}
                2 => drop(bytes.remove(at)),
                _ => bytes[at] = *value,
            }
        }
        bytes
    }

    proptest! {
        /// With a correct checksum behind them, damaged tables reach the parser as well.
        #[test]
        fn damaged_shards_are_refused_or_hold_every_row(
            edits in prop::collection::vec((any::<Index>(), 0..12_u8, any::<u8>()), 1..8),
            has_correct_checksum in any::<bool>(),
        ) {
            let folder = tempfile::tempdir().unwrap();
            let manifest = manifest(10, 3);
            let text = written(folder.path(), &manifest, 1);
            let text = if has_correct_checksum {
                let footer = text.windows(2).rposition(|pair| pair == b"\n#").unwrap() + 1;
                let mut text = damaged(text[..footer].to_vec(), &edits);
                text.extend(super::footer(&manifest, 1, 3).into_bytes());
                let checksum = xxh3_128(&text);
                text.extend(format!("{checksum:032x}\n").into_bytes());
                text
            } else {
                damaged(text, &edits)
            };
            let path = folder.path().join("damaged");
            fs::write(&path, &text).unwrap();
            match read(&path, &manifest) {
                Ok(shard) => {
                    let rows: Vec<_> = shard.rows.iter().map(|(row, _)| *row).collect();
                    prop_assert_eq!(rows, rows_of(1, 3, 10).collect::<Vec<_>>());
                }
                Err(error) => prop_assert!(!error.to_string().is_empty()),
            }
        }
    }

    fn records(row: usize) -> Records {
        Records {
            header: ByteRecord::from(vec!["name", "x"]),
            // As many lines as a Poincaré row may have.
            lines: (0..=row % 3)
                .map(|line| {
                    ByteRecord::from(vec![format!("a,\"{row}\"\n# shard"), line.to_string()])
                })
                .collect(),
        }
    }

    fn written(folder: &Path, manifest: &Manifest, shard: usize) -> Vec<u8> {
        let rows: Vec<usize> = rows_of(shard, manifest.shards, manifest.rows).collect();
        let records: Vec<Records> = rows.iter().map(|&row| records(row)).collect();
        write(folder, manifest, shard, &rows, &records).unwrap();
        fs::read(path(folder, shard)).unwrap()
    }

    #[test]
    fn a_shard_round_trips_through_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let manifest = manifest(10, 3);
        for shard in 0..3 {
            written(folder.path(), &manifest, shard);
            let read = read(&path(folder.path(), shard), &manifest).unwrap();
            assert_eq!(read.shard, shard);
            assert_eq!(read.header, vec!["name", "x"]);
            for (row, lines) in read.rows {
                assert_eq!(lines, records(row).lines);
            }
        }
    }

    #[test]
    fn every_truncation_and_every_changed_byte_is_detected() {
        let folder = tempfile::tempdir().unwrap();
        let manifest = manifest(4, 2);
        let text = written(folder.path(), &manifest, 1);
        let path = folder.path().join("broken");
        for length in 0..text.len() {
            fs::write(&path, &text[..length]).unwrap();
            assert!(read(&path, &manifest).is_err(), "{length}");
            let mut changed = text.clone();
            changed[length] ^= 1;
            fs::write(&path, &changed).unwrap();
            assert!(read(&path, &manifest).is_err(), "{length}");
        }
        fs::write(&path, &text).unwrap();
        assert!(read(&path, &manifest).is_ok());
    }

    #[test]
    fn shards_of_other_sweeps_are_rejected() {
        let folder = tempfile::tempdir().unwrap();
        let (ours, other) = (manifest(10, 3), manifest(11, 3));
        written(folder.path(), &other, 0);
        let error = read(&path(folder.path(), 0), &ours).unwrap_err();
        assert!(matches!(error, ShardFileError::OtherSweep), "{error}");
        let few: Vec<usize> = rows_of(1, 3, 10).skip(1).collect();
        let records: Vec<Records> = few.iter().map(|&row| records(row)).collect();
        write(folder.path(), &ours, 1, &few, &records).unwrap();
        assert!(read(&path(folder.path(), 1), &ours).is_err());
    }
}
