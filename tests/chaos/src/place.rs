//! The folders of a trial, and what remains in them.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::host::ChaosController;

/// Environment variable that marks every process of a chaos run with the name of its place.
const MARK: &str = "PAINLEVE_CHAOS";
const SHARED_MEMORY: &str = "/dev/shm";

/// A working folder, and one for the buses.
pub struct ChaosFolder {
    program: PathBuf,
    mark: String,
    work: tempfile::TempDir,
    runtime: PathBuf,
    /// What runs the controller.
    pub host: ChaosController,
    /// Longest silence of a peer, and longest wait for one, s.
    pub patience_s: [String; 2],
}

impl ChaosFolder {
    /// Creates the folders; `runtime` may be shared with other places.
    pub fn new(
        program: &Path,
        mark: String,
        runtime: &Path,
        host: ChaosController,
        patience_s: [String; 2],
    ) -> std::io::Result<Self> {
        Ok(Self {
            program: program.to_path_buf(),
            mark,
            work: tempfile::tempdir()?,
            runtime: runtime.to_path_buf(),
            host,
            patience_s,
        })
    }

    /// Returns a command that runs the program with arguments.
    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(&self.program);
        command.args(arguments);
        self.equip(&mut command);
        command
    }

    /// Makes any command run in these folders.
    pub fn equip<'a>(&self, command: &'a mut Command) -> &'a mut Command {
        command
            .current_dir(self.work.path())
            .env("XDG_RUNTIME_DIR", &self.runtime)
            .env(MARK, &self.mark)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
    }

    /// Returns a path in the working folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.work.path().join(name)
    }

    /// Returns the running processes of this place.
    pub fn processes(&self) -> Vec<i32> {
        let mark = format!("{MARK}={}", self.mark);
        let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
        entries
            .filter_map(|entry| entry.file_name().to_str()?.parse().ok())
            .filter(|id: &i32| {
                let environment = fs::read(format!("/proc/{id}/environ")).unwrap_or_default();
                environment
                    .split(|&byte| byte == 0)
                    .any(|variable| variable == mark.as_bytes())
            })
            .collect()
    }

    /// Returns the remaining files, except the outputs of successful runs.
    pub fn left(&self, bus: &str) -> Vec<PathBuf> {
        let mut left = Vec::new();
        list(self.work.path(), &mut left);
        left.retain(|path| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            name.starts_with('.') || name.ends_with(".part")
        });
        list(&self.runtime.join("painleve").join(bus), &mut left);
        left
    }
}

fn list(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            list(&path, found);
        } else {
            found.push(path);
        }
    }
}

/// Returns the names of painleve's shared memory that no process uses.
///
/// # Errors
/// If shared memory cannot be listed.
pub fn unused_segments() -> std::io::Result<BTreeSet<String>> {
    let listed = fs::read_dir(SHARED_MEMORY)?;
    let mut names: BTreeSet<String> = listed
        .flatten()
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .filter(|name| name.starts_with("painleve_"))
        .collect();
    for entry in fs::read_dir("/proc").into_iter().flatten().flatten() {
        let maps = fs::read_to_string(entry.path().join("maps")).unwrap_or_default();
        for line in maps
            .lines()
            .filter(|line| line.contains("/dev/shm/painleve_"))
        {
            let path = line.rsplit('/').next().unwrap_or_default();
            names.remove(path);
        }
    }
    Ok(names)
}
