//! Where buses live: a private folder for each user, and names in shared memory that
//! nobody can foresee.

use std::fs::{self, DirBuilder, Metadata};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

use nix::unistd::getuid;

use super::LinkError;

/// Where Linux keeps POSIX shared memory.
pub(super) const SHARED_MEMORY: &str = "/dev/shm";

/// Only the owner may enter.
const PRIVATE: u32 = 0o700;
/// Write permission of others than the owner.
const WRITABLE_BY_OTHERS: u32 = 0o022;

/// Where the buses of one user live.
#[derive(Clone, Debug)]
pub(super) struct Place {
    /// One folder for each bus is made in it.
    pub(super) folder: PathBuf,
    /// First part of the names of this user's shared memory.
    pub(super) prefix: String,
}

impl Place {
    /// The place of the user who runs this process: `painleve` in `$XDG_RUNTIME_DIR`, or in
    /// `/run/user/<uid>`, or else `/tmp/painleve-<uid>`. The first two belong to the user by
    /// the system's own hand. Anybody can make the last one first, so it is checked.
    ///
    /// # Errors
    /// [`LinkError::Folder`] if there is no folder that belongs to this user alone.
    pub(super) fn of_user() -> Result<Self, LinkError> {
        let user = getuid();
        let folder = std::env::var_os("XDG_RUNTIME_DIR")
            .map(PathBuf::from)
            .into_iter()
            .chain([format!("/run/user/{user}").into()])
            .find(|folder| folder.is_absolute() && is_trusted(folder))
            .map_or_else(
                || format!("/tmp/painleve-{user}").into(),
                |folder| folder.join("painleve"),
            );
        make_private(&folder)?;
        Ok(Self {
            folder,
            prefix: format!("painleve_{user}_"),
        })
    }
}

/// Whether a folder is this user's, and nobody else may put files into it.
fn is_trusted(folder: &Path) -> bool {
    fs::metadata(folder).is_ok_and(|metadata| {
        metadata.is_dir() && is_own(&metadata) && metadata.mode() & WRITABLE_BY_OTHERS == 0
    })
}

fn is_own(metadata: &Metadata) -> bool {
    metadata.uid() == getuid().as_raw()
}

/// Makes a folder that only this user may enter, or checks that it is one.
///
/// # Errors
/// [`LinkError::Folder`] if it is somebody else's, no folder, or cannot be made.
pub(super) fn make_private(folder: &Path) -> Result<(), LinkError> {
    let refuse = |reason: String| LinkError::Folder {
        folder: folder.to_path_buf(),
        reason,
    };
    match DirBuilder::new().mode(PRIVATE).create(folder) {
        Ok(()) => return Ok(()),
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
        Err(error) => return Err(refuse(error.to_string())),
    }
    // Not through a symbolic link, which somebody else may have put there.
    let found = fs::symlink_metadata(folder).map_err(|error| refuse(error.to_string()))?;
    if !found.is_dir() {
        return Err(refuse("it is no folder".into()));
    }
    if !is_own(&found) {
        return Err(refuse(format!("it belongs to user {}", found.uid())));
    }
    if found.mode() & 0o777 != PRIVATE {
        fs::set_permissions(folder, fs::Permissions::from_mode(PRIVATE))
            .map_err(|error| refuse(error.to_string()))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_own_folder_is_made_private() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("painleve");
        fs::create_dir(&folder).unwrap();
        fs::set_permissions(&folder, fs::Permissions::from_mode(0o777)).unwrap();
        make_private(&folder).unwrap();
        let mode = fs::metadata(&folder).unwrap().mode();
        assert_eq!(mode & 0o777, PRIVATE);
    }

    #[test]
    fn what_is_no_folder_of_ones_own_is_refused_by_name() {
        let parent = tempfile::tempdir().unwrap();
        let file = parent.path().join("file");
        fs::write(&file, "").unwrap();
        let link = parent.path().join("link");
        std::os::unix::fs::symlink(parent.path(), &link).unwrap();
        // Root may give a folder away; for anybody else the root folder is foreign.
        let foreign = parent.path().join("foreign");
        fs::create_dir(&foreign).unwrap();
        let given = std::os::unix::fs::chown(&foreign, Some(4_242_424), None);
        let foreign = if given.is_ok() { foreign } else { "/".into() };
        for (folder, reason) in [
            (&file, "no folder"),
            (&link, "no folder"),
            (&foreign, "belongs to user"),
        ] {
            let error = make_private(folder).unwrap_err().to_string();
            assert!(error.contains(reason), "{error}");
            assert!(error.contains(&folder.display().to_string()), "{error}");
        }
        assert!(!is_trusted(&foreign));
    }
}
