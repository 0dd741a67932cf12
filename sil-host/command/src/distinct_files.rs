//! No output of a command replaces a file that the command reads, or another output.
//!
//! Files are compared by device and inode, so that other spellings, links and hard links are found as well. The inputs
//! are those that [`input_file`] has opened: call these functions when everything is read and nothing is computed.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Component, Path, PathBuf};

use painleve_files::atomic_file::AtomicFile;
use painleve_files::input_file;

use super::CommandError;
use super::output_error::{InputError, output};

/// An output, with the option that names it.
pub type Output<'a> = (&'a str, &'a Path);

/// What a path leads to.
#[derive(PartialEq, Eq)]
enum Identity {
    /// Device and inode of a file.
    File(u64, u64),
    /// Device and inode of the last folder that exists, and the names that will be in it.
    New(u64, u64, PathBuf),
}

/// Checks that the outputs are different files, and none of them an input.
///
/// # Errors
/// [`InputError::SameFile`] or [`InputError::ReplacesInput`].
pub fn check_distinct(outputs: &[Output<'_>]) -> Result<(), CommandError> {
    let mut seen: Vec<(Identity, &str)> = Vec::new();
    for (option, path) in outputs {
        if let Some(input) = fs::metadata(path)
            .ok()
            .as_ref()
            .and_then(input_file::opened_as)
        {
            return Err(InputError::ReplacesInput {
                option: (*option).to_owned(),
                path: path.to_path_buf(),
                input,
            }
            .into());
        }
        let Some(identity) = identity(path) else {
            continue;
        };
        if let Some((_, first)) = seen.iter().find(|(other, _)| *other == identity) {
            return Err(InputError::SameFile {
                options: [first, option].map(|option| (*option).to_owned()),
                path: path.to_path_buf(),
            }
            .into());
        }
        seen.push((identity, option));
    }
    Ok(())
}

/// Checks that the outputs are different files, none of them an input, and that each can be written.
///
/// # Errors
/// As [`check_distinct`], and [`CommandError::Output`].
pub fn check(outputs: &[Output<'_>]) -> Result<(), CommandError> {
    check_distinct(outputs)?;
    for (_, path) in outputs {
        try_out(path)?;
    }
    Ok(())
}

/// New folders. Those that are empty are removed when this is dropped: a command that fails leaves nothing.
pub struct NewFolders(Vec<PathBuf>);

impl Drop for NewFolders {
    fn drop(&mut self) {
        for folder in &self.0 {
            let _ = fs::remove_dir(folder);
        }
    }
}

/// Checks that an output can be written, and makes the folders that it lacks.
///
/// # Errors
/// [`CommandError::Output`].
pub fn try_out(path: &Path) -> Result<NewFolders, CommandError> {
    let folders = path.ancestors().skip(1);
    let missing = folders.take_while(|folder| !folder.exists());
    let new = NewFolders(missing.map(Path::to_path_buf).collect());
    drop(AtomicFile::create(path).map_err(output)?);
    Ok(new)
}

/// `None` if the path has no place; its use will say why.
fn identity(path: &Path) -> Option<Identity> {
    if let Ok(file) = fs::metadata(path) {
        return Some(Identity::File(file.dev(), file.ino()));
    }
    let path = std::path::absolute(path).ok()?;
    let existing = path.ancestors().find_map(|folder| {
        let metadata = fs::metadata(folder).ok()?;
        Some((folder, metadata.dev(), metadata.ino()))
    });
    let (folder, device, inode) = existing?;
    let mut names = PathBuf::new();
    for component in path.strip_prefix(folder).ok()?.components() {
        // What does not exist is no link.
        if component == Component::ParentDir {
            names.pop();
        } else {
            names.push(component);
        }
    }
    Some(Identity::New(device, inode, names))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    #[test]
    fn other_spellings_of_a_file_are_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::write(path("input"), "x").unwrap();
        fs::create_dir(path("there")).unwrap();
        symlink(path("input"), path("link")).unwrap();
        symlink("../there", path("there/again")).unwrap();
        fs::hard_link(path("input"), path("hard")).unwrap();
        let message = |outputs: [&str; 2]| {
            let outputs = outputs.map(path);
            let outputs = [("--csv", &*outputs[0]), ("--plot", &*outputs[1])];
            check_distinct(&outputs).err().map(|error| {
                assert_eq!(error.exit_code(), 2);
                error.to_string()
            })
        };
        for same in [
            ["new", "new"],
            ["new", "there/../new"],
            ["there/new", "there/again/again/new"],
            ["new/a", "new/b/../a"],
            ["input", "link"],
            ["link", "hard"],
        ] {
            let message = message(same).unwrap();
            assert!(
                message.starts_with("--csv and --plot both name"),
                "{message}"
            );
        }
        check(&[("--csv", &path("new/deeper/a"))]).unwrap();
        assert!(!path("new").exists());
        for different in [["new", "new/new"], ["new", "there/new"], ["input", "new"]] {
            assert_eq!(message(different), None);
        }
        input_file::open(&path("input")).unwrap();
        for input in ["input", "link", "hard", "there/../input"] {
            let message = message(["new", input]).unwrap();
            assert!(message.starts_with("--plot would replace"), "{message}");
            assert!(message.contains("/input`"), "{message}");
        }
    }
}
