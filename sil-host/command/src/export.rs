//! `painleve export`: the ticks of a record as a table.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use clap::Args;
use painleve_record::export::ticks_to_csv;
use painleve_system::atomic_file;
use painleve_system::terminal::warn;
use serde_json::json;

use super::output_error::{InputError, RecordFileError, output};
use super::{CommandError, say};

/// Options of `painleve export`.
#[derive(Debug, Args)]
pub struct ExportArguments {
    /// Record of a run, for example out/run.mcap.
    record: PathBuf,
    /// Write CSV, by default beside the record.
    #[arg(long, value_name = "PATH", num_args = 0..=1, required_unless_present = "parquet")]
    csv: Option<Option<PathBuf>>,
    /// Write Parquet, by default beside the record; requires the cargo feature parquet.
    #[arg(long, value_name = "PATH", num_args = 0..=1)]
    parquet: Option<Option<PathBuf>>,
    /// Print one JSON object on stdout.
    #[arg(long)]
    json: bool,
}

/// Writes one row per control tick and one column per quantity.
///
/// # Errors
/// [`CommandError`] if the recording cannot be read, or the table cannot be written.
pub fn run(arguments: &ExportArguments) -> Result<(), CommandError> {
    let record = &arguments.record;
    let table = read(record).map_err(|source| InputError::Record {
        path: record.clone(),
        source,
    })?;
    let mut files = Vec::new();
    if let Some(path) = &arguments.csv {
        files.push(write(beside(record, path.as_deref(), "csv"), &table)?);
    }
    if let Some(path) = &arguments.parquet {
        let columns = parquet(&table)?;
        files.push(write(beside(record, path.as_deref(), "parquet"), &columns)?);
    }
    if arguments.json {
        let lines = table.iter().filter(|byte| **byte == b'\n').count();
        // The first line is the header; no value contains a line break.
        let rows = lines.saturating_sub(1);
        return say(json!({ "record": record, "rows": rows, "files": files }));
    }
    for file in files {
        warn(format_args!("wrote {}", file.display()));
    }
    Ok(())
}

/// Returns the ticks of a record as CSV.
fn read(record: &Path) -> Result<Vec<u8>, RecordFileError> {
    let mut table = Vec::new();
    ticks_to_csv(&std::fs::read(record)?, &mut table)?;
    Ok(table)
}

/// Returns the given path, or the record's with another extension.
fn beside(record: &Path, path: Option<&Path>, extension: impl AsRef<OsStr>) -> PathBuf {
    path.map_or_else(|| record.with_extension(extension), Path::to_path_buf)
}

/// Writes a file and returns its path.
fn write(path: PathBuf, contents: &[u8]) -> Result<PathBuf, CommandError> {
    atomic_file::write(&path, contents).map_err(output)?;
    Ok(path)
}

#[cfg(feature = "parquet")]
fn parquet(table: &[u8]) -> Result<Vec<u8>, CommandError> {
    painleve_study::sweep::parquet::from_csv(table).map_err(output)
}

#[cfg(not(feature = "parquet"))]
fn parquet(_: &[u8]) -> Result<Vec<u8>, CommandError> {
    Err(InputError::NoParquet.into())
}
