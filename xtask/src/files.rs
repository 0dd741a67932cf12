//! Files that chores write.

use std::path::Path;

use crate::command::ChoreError;

/// Copies a file, and makes the folder for it.
///
/// # Errors
/// [`ChoreError`] that names the file or the folder.
pub fn copy(from: &Path, to: &Path) -> Result<(), ChoreError> {
    let error = |cause: std::io::Error| unwritable(to, &cause);
    if let Some(folder) = to.parent() {
        std::fs::create_dir_all(folder).map_err(error)?;
    }
    std::fs::copy(from, to).map(|_| ()).map_err(error)
}

/// Says which path cannot be written.
pub fn unwritable(path: &Path, cause: &std::io::Error) -> ChoreError {
    ChoreError(format!("cannot write {}: {cause}", path.display()))
}
