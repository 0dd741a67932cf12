//! `painleve export`: the ticks of a record as a table.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use clap::Args;
use painleve_record::export::ticks_to_csv;
use painleve_system::atomic_file;
use painleve_system::terminal::warn;

use super::CommandError;
use super::output_error::{InputError, RecordFileError, output};

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
}

/// Writes one row per control tick and one column per quantity.
pub fn run(arguments: &ExportArguments) -> Result<(), CommandError> {
    let record = &arguments.record;
    let table = read(record).map_err(|source| InputError::Record {
        path: record.clone(),
        source,
    })?;
    if let Some(path) = &arguments.csv {
        write(&beside(record, path.as_deref(), "csv"), &table)?;
    }
    if let Some(path) = &arguments.parquet {
        let columns = parquet(&table)?;
        write(&beside(record, path.as_deref(), "parquet"), &columns)?;
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

fn write(path: &Path, contents: &[u8]) -> Result<(), CommandError> {
    atomic_file::write(path, contents).map_err(output)?;
    warn(format_args!("wrote {}", path.display()));
    Ok(())
}

#[cfg(feature = "parquet")]
fn parquet(table: &[u8]) -> Result<Vec<u8>, CommandError> {
    painleve_study::sweep::parquet::from_csv(table).map_err(output)
}

#[cfg(not(feature = "parquet"))]
fn parquet(_: &[u8]) -> Result<Vec<u8>, CommandError> {
    Err(InputError::NoParquet.into())
}
