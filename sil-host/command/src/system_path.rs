//! Paths in plans of processes.

use std::ffi::OsString;
use std::ops::Deref;
use std::path::Path;

use serde::{Deserialize, Serialize};

/// A path as the system has it. It need not be text, as a path of serde must be.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct SystemPath(OsString);

impl From<OsString> for SystemPath {
    fn from(path: OsString) -> Self {
        Self(path)
    }
}

impl Deref for SystemPath {
    type Target = Path;

    fn deref(&self) -> &Path {
        Path::new(&self.0)
    }
}
