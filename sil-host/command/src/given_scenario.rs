//! A scenario that a command line gives: by name, as a file, or as the record of a run.

use std::collections::BTreeMap;
use std::io::BufReader;
use std::path::Path;

use painleve_files::input_file;
use painleve_plant::scenario::Scenario;
use painleve_record::export::ExportError;
use painleve_record::record_file;

use super::CommandError;
use super::output_error::{InputError, RecordFileError};

/// Extension of records.
const RECORD: &str = "mcap";

/// Whether a path names a record.
pub fn is_record(path: &Path) -> bool {
    path.extension()
        .is_some_and(|extension| extension == RECORD)
}

/// Returns the scenario called `name`: that of a record, of a file, or a built-in one.
///
/// # Errors
/// [`CommandError`] if there is none or it is invalid.
pub fn load(name: &str) -> Result<Scenario, CommandError> {
    let path = Path::new(name);
    if is_record(path) {
        of_record(path)
    } else {
        Ok(Scenario::load(name, &[])?)
    }
}

/// Returns the scenario that a record contains.
///
/// # Errors
/// [`CommandError`] if the file is not a record of a run.
pub fn of_record(path: &Path) -> Result<Scenario, CommandError> {
    let settings = notes_of_record(path)?.remove("configuration");
    let settings = settings.ok_or_else(|| InputError::record(path, RecordFileError::NoSettings))?;
    Ok(Scenario::of_record(path, &settings)?)
}

/// Returns what a record says of its run.
///
/// # Errors
/// [`InputError::Record`] if the file cannot be read.
pub fn notes_of_record(path: &Path) -> Result<BTreeMap<String, String>, InputError> {
    let file = input_file::open(path).map_err(|error| InputError::record(path, error))?;
    let notes = record_file::notes(BufReader::new(file))
        .map_err(|damage| InputError::record(path, ExportError::from(damage)))?;
    Ok(notes.unwrap_or_default())
}
