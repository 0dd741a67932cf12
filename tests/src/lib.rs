//! Starts the `painleve` program in end-to-end tests and inspects its results and leftovers.
//!
//! - [`live`]: a live run and requests to it
//! - [`mod@line`]: a serial line that can be disturbed, with the image at its end
//! - [`python`]: virtual environments
//! - [`printed`]: figures in the documentation against measured ones

pub mod line;
pub mod live;
pub mod printed;
pub mod python;

use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use painleve_process::interrupt::restore_default_actions;
use serde_json::Value;

/// Says that a test does nothing, and why. Written to standard error past the test harness, and to the file named by
/// `PAINLEVE_SKIPPED`, whose lines `cargo xtask test` prints at its end.
pub fn skipped(reason: &str) {
    // A notice that cannot be written must not fail the test.
    let _ = writeln!(std::io::stderr(), "SKIPPED: {reason}");
    if let Some(path) = std::env::var_os("PAINLEVE_SKIPPED") {
        let notices = std::fs::OpenOptions::new().append(true).open(path);
        let _ = notices.and_then(|mut file| writeln!(file, "{reason}"));
    }
}

/// Returns the path of the program: the one named by `PAINLEVE_PROGRAM`, else that of the profile `verify`, which is
/// built if missing or out of date.
///
/// # Panics
/// If it cannot be built.
pub fn program() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        if let Some(program) = std::env::var_os("PAINLEVE_PROGRAM") {
            return program.into();
        }
        let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
        let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let built = Command::new(cargo)
            .args([
                "build",
                "--profile",
                "verify",
                "--package",
                "painleve-command",
            ])
            .args(["--message-format", "json"])
            .current_dir(&workspace)
            .stderr(Stdio::inherit())
            .output()
            .unwrap_or_else(|error| panic!("cannot start cargo: {error}"));
        assert!(built.status.success(), "the program does not build");
        String::from_utf8_lossy(&built.stdout)
            .lines()
            .filter_map(|line| serde_json::from_str::<Value>(line).ok())
            .filter_map(|message| message["executable"].as_str().map(PathBuf::from))
            .find(|path| path.file_stem().is_some_and(|stem| stem == "painleve"))
            .unwrap_or_else(|| panic!("cargo did not say where the program is"))
    })
}

/// Returns the path of the image of the STM32F405, which is flashed and which the emulator runs.
///
/// # Panics
/// As [`built_image`].
pub fn image() -> &'static Path {
    static IMAGE: OnceLock<PathBuf> = OnceLock::new();
    IMAGE.get_or_init(|| built_image("painleve-f405"))
}

/// Returns the path of an image: in the folder named by `PAINLEVE_IMAGES`, else built if out of date.
///
/// # Panics
/// If the images cannot be built.
pub fn built_image(name: &str) -> PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(images).join(name)
}

fn images() -> PathBuf {
    if let Some(folder) = std::env::var_os("PAINLEVE_IMAGES") {
        return folder.into();
    }
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let built = Command::new(cargo)
        .args(["xtask", "build-fw"])
        .current_dir(&workspace)
        .status();
    assert!(
        built.is_ok_and(|status| status.success()),
        "`cargo xtask build-fw` fails: run `cargo xtask setup` first"
    );
    workspace.join("target/thumbv7em-none-eabihf/firmware")
}

/// A working folder for the program, with its bus.
pub struct Bench {
    folder: tempfile::TempDir,
    /// Name of a bus that no other test uses.
    pub bus: String,
}

impl Bench {
    /// Creates an empty folder and a new bus.
    ///
    /// # Panics
    /// If the folder cannot be created.
    pub fn new(name: &str) -> Self {
        let folder = tempfile::tempdir().unwrap_or_else(|error| panic!("no folder: {error}"));
        let bus = format!("test-{name}-{}", std::process::id());
        Self { folder, bus }
    }

    /// Returns a path inside the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Returns all files below the folder, relative to it.
    pub fn files(&self) -> Vec<String> {
        let mut found = Vec::new();
        let mut folders = vec![self.folder.path().to_path_buf()];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
                let path = entry.path();
                if path.is_dir() {
                    folders.push(path);
                } else if let Ok(relative) = path.strip_prefix(self.folder.path()) {
                    found.push(relative.display().to_string());
                }
            }
        }
        found.sort();
        found
    }

    /// Returns a command that runs the program with arguments in the folder. The program reacts to
    /// signals even if the tests were started in the background, where SIGINT is ignored.
    ///
    /// # Panics
    /// If the system refuses to reset the signals.
    pub fn command(&self, arguments: &[&str]) -> Command {
        restore_default_actions()
            .unwrap_or_else(|error| panic!("cannot reset the signals: {error}"));
        let mut command = Command::new(program());
        command.args(arguments).current_dir(self.folder.path());
        command
    }

    /// Runs the program to its end.
    ///
    /// # Panics
    /// If it cannot be started.
    pub fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments)
            .output()
            .unwrap_or_else(|error| panic!("cannot start painleve: {error}"))
    }

    /// Runs a line of bash in the folder, in which `$P` is the program.
    ///
    /// # Panics
    /// If bash cannot be started.
    pub fn shell(&self, line: &str) -> Output {
        let mut shell = Command::new("bash");
        shell.args(["-c", line]).env("P", program());
        let output = shell.current_dir(self.folder.path()).output();
        output.unwrap_or_else(|error| panic!("cannot start bash: {error}"))
    }

    /// Runs the program and parses its standard output, which must be one JSON object.
    ///
    /// # Panics
    /// If it fails or prints anything else.
    pub fn report(&self, arguments: &[&str]) -> Value {
        let output = self.run(arguments);
        assert!(output.status.success(), "{output:?}");
        let text = String::from_utf8_lossy(&output.stdout);
        assert_eq!(text.trim().lines().count(), 1, "{text}");
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error} in {text}"))
    }

    /// Starts the program without waiting for its end.
    ///
    /// # Panics
    /// If it cannot be started.
    pub fn start(&self, arguments: &[&str]) -> Running {
        let child = self
            .command(arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap_or_else(|error| panic!("cannot start painleve: {error}"));
        Running(Some(child))
    }

    /// Returns the program's shared memory that remains, whichever process left it. Shared memory
    /// of other running tests gets time to disappear.
    pub fn leftovers(&self) -> Vec<String> {
        let mut names = shared_memory();
        let start = Instant::now();
        while !names.is_empty() && start.elapsed() < Duration::from_secs(20) {
            std::thread::sleep(Duration::from_millis(20));
            let now = shared_memory();
            names.retain(|name| now.contains(name));
        }
        names
    }
}

/// Returns the names of the program's files in shared memory. iceoryx2 keeps one of 16 bytes for
/// each user, its node counter.
fn shared_memory() -> Vec<String> {
    let entries = std::fs::read_dir("/dev/shm")
        .into_iter()
        .flatten()
        .flatten();
    entries
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .filter(|name| name.starts_with("painleve_") && !name.ends_with(".global_mgmt"))
        .collect()
}

/// A running program; killed when dropped.
pub struct Running(Option<Child>);

impl Running {
    /// Returns the process id.
    ///
    /// # Panics
    /// After [`Running::end`].
    pub fn id(&self) -> i32 {
        let id = self.0.as_ref().map(Child::id);
        id.and_then(|id| i32::try_from(id).ok())
            .unwrap_or_else(|| panic!("the program has ended"))
    }

    /// Waits up to `limit` for the end; returns the output and the time taken.
    ///
    /// # Panics
    /// If the program is still running after `limit`.
    pub fn end(mut self, limit: Duration) -> (Output, Duration) {
        let start = Instant::now();
        while start.elapsed() < limit {
            let child = self.0.as_mut().unwrap_or_else(|| panic!("ended twice"));
            if !matches!(child.try_wait(), Ok(None))
                && let Some(child) = self.0.take()
            {
                let took = start.elapsed();
                let output = child.wait_with_output();
                return (output.unwrap_or_else(|error| panic!("{error}")), took);
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        panic!("still running after {limit:?}");
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if let Some(child) = &mut self.0 {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// Sends a signal to a process.
///
/// # Panics
/// If there is no such process.
pub fn signal(id: i32, signal: Signal) {
    kill(Pid::from_raw(id), signal).unwrap_or_else(|error| panic!("signal to {id}: {error}"));
}

/// Returns the id of the child process of `parent` whose first argument is `subcommand`; waits for
/// it to appear.
pub fn child_of(parent: i32, subcommand: &str) -> i32 {
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(5) {
        for entry in std::fs::read_dir("/proc").into_iter().flatten().flatten() {
            let Ok(id) = entry.file_name().to_string_lossy().parse::<i32>() else {
                continue;
            };
            let read = |name: &str| std::fs::read_to_string(entry.path().join(name));
            let (Ok(status), Ok(line)) = (read("status"), read("cmdline")) else {
                continue;
            };
            let is_child = status
                .lines()
                .any(|line| line == format!("PPid:\t{parent}"));
            if is_child && line.split('\0').nth(1) == Some(subcommand) {
                return id;
            }
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    panic!("{parent} has no child '{subcommand}'");
}

/// Returns whether a process is running; a zombie is not.
pub fn is_running(id: i32) -> bool {
    std::fs::read_to_string(format!("/proc/{id}/stat")).is_ok_and(|stat| {
        !stat
            .rsplit(')')
            .next()
            .is_some_and(|rest| rest.starts_with(" Z"))
    })
}

/// Runs a command in namespaces of its own, as `unshare` makes them; `None`, with a notice, where
/// that is not permitted.
///
/// # Panics
/// If the command cannot be started.
pub fn unshared(namespaces: &[&str], command: &mut Command) -> Option<Output> {
    let unshare = |program: &OsStr| {
        let mut unshare = Command::new("unshare");
        unshare.args(namespaces).arg(program);
        unshare
    };
    let permitted = unshare(OsStr::new("true")).output();
    if !permitted.is_ok_and(|output| output.status.success()) {
        skipped(&format!(
            "unshare {} is not permitted",
            namespaces.join(" ")
        ));
        return None;
    }
    let mut unshare = unshare(command.get_program());
    unshare.args(command.get_args());
    for (name, value) in command.get_envs() {
        match value {
            Some(value) => unshare.env(name, value),
            None => unshare.env_remove(name),
        };
    }
    if let Some(folder) = command.get_current_dir() {
        unshare.current_dir(folder);
    }
    let output = unshare.output();
    Some(output.unwrap_or_else(|error| panic!("cannot start unshare: {error}")))
}

/// Standard error as text.
pub fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Returns the exit code of a status; −1 after a signal.
pub fn code(status: ExitStatus) -> i32 {
    status.code().unwrap_or(-1)
}
