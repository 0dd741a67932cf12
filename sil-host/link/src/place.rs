//! Locations of buses: a private folder for each user, and unpredictable names in shared memory.

use std::fs::{self, DirBuilder, Metadata};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

use nix::unistd::getuid;

use super::{FolderError, LinkError};

/// Folder in which Linux keeps POSIX shared memory.
pub(super) const SHARED_MEMORY: &str = "/dev/shm";

/// Mode: only the owner may enter.
const PRIVATE: u32 = 0o700;
/// Write permission for users other than the owner.
const WRITABLE_BY_OTHERS: u32 = 0o022;

/// Location of one user's buses.
#[derive(Clone, Debug)]
pub(super) struct Place {
    /// Holds one folder for each bus.
    pub(super) folder: PathBuf,
    /// Prefix of the names of this user's shared memory.
    pub(super) prefix: String,
}

impl Place {
    /// Returns the place of the user who runs this process: `painleve` in `$XDG_RUNTIME_DIR`,
    /// otherwise in `/run/user/<uid>`, otherwise `/tmp/painleve-<uid>`. The system guarantees that
    /// the first two belong to the user. Any user could have created the last one, so its ownership
    /// is checked.
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

/// Returns whether a folder belongs to this user and no other user may write to it.
fn is_trusted(folder: &Path) -> bool {
    fs::metadata(folder).is_ok_and(|metadata| {
        metadata.is_dir() && is_own(&metadata) && metadata.mode() & WRITABLE_BY_OTHERS == 0
    })
}

fn is_own(metadata: &Metadata) -> bool {
    metadata.uid() == getuid().as_raw()
}

/// Creates a folder that only this user may enter, or checks that an existing one is private.
///
/// # Errors
/// [`LinkError::Folder`] if it belongs to another user, is not a folder, or cannot be created.
pub(super) fn make_private(folder: &Path) -> Result<(), LinkError> {
    let refuse = |source: FolderError| LinkError::Folder {
        folder: folder.to_path_buf(),
        source,
    };
    match DirBuilder::new().mode(PRIVATE).create(folder) {
        Ok(()) => return Ok(()),
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
        Err(error) => return Err(refuse(error.into())),
    }
    // Does not follow a symbolic link, which another user may have placed there.
    let found = fs::symlink_metadata(folder).map_err(|error| refuse(error.into()))?;
    if !found.is_dir() {
        return Err(refuse(FolderError::NotAFolder));
    }
    if !is_own(&found) {
        return Err(refuse(FolderError::Foreign(found.uid())));
    }
    if found.mode() & 0o777 != PRIVATE {
        fs::set_permissions(folder, fs::Permissions::from_mode(PRIVATE))
            .map_err(|error| refuse(error.into()))?;
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
    fn a_path_that_is_not_a_private_folder_of_the_user_is_refused() {
        let parent = tempfile::tempdir().unwrap();
        let file = parent.path().join("file");
        fs::write(&file, "").unwrap();
        let link = parent.path().join("link");
        std::os::unix::fs::symlink(parent.path(), &link).unwrap();
        // Root can give a folder to another user; for other users the root folder is foreign.
        let foreign = parent.path().join("foreign");
        fs::create_dir(&foreign).unwrap();
        let given = std::os::unix::fs::chown(&foreign, Some(4_242_424), None);
        let foreign = if given.is_ok() { foreign } else { "/".into() };
        for (folder, reason) in [
            (&file, "not a folder"),
            (&link, "not a folder"),
            (&foreign, "belongs to user"),
        ] {
            let error = make_private(folder).unwrap_err().to_string();
            assert!(error.contains(reason), "{error}");
            assert!(error.contains(&folder.display().to_string()), "{error}");
        }
        assert!(!is_trusted(&foreign));
    }
}
