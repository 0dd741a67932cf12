//! Runs other programs and prints every command line.

use std::env;
use std::fmt;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Why a chore failed.
#[derive(Debug)]
pub struct ChoreError(pub String);

impl fmt::Display for ChoreError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// Writes a line to standard output.
///
/// # Errors
/// If standard output is closed.
pub fn say(line: &str) -> Result<(), ChoreError> {
    writeln!(std::io::stdout(), "{line}")
        .map_err(|cause| ChoreError(format!("cannot write to stdout: {cause}")))
}

/// Returns the workspace's folder.
pub fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .map_or_else(|| PathBuf::from("."), Path::to_path_buf)
}

/// Returns the cargo that runs this program.
pub fn cargo() -> String {
    env::var("CARGO").unwrap_or_else(|_| "cargo".into())
}

/// Returns whether a program can be started.
pub fn starts(program: &str) -> bool {
    Command::new(program)
        .arg("--version")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

/// Runs a program in the workspace's folder.
///
/// # Errors
/// If it cannot be started or does not succeed.
pub fn run(program: &str, arguments: &[&str]) -> Result<(), ChoreError> {
    run_with(program, arguments, &[])
}

/// Runs a program in the workspace's folder with additional environment
/// variables.
///
/// # Errors
/// As [`run`].
pub fn run_with(
    program: &str,
    arguments: &[&str],
    environment: &[(&str, &str)],
) -> Result<(), ChoreError> {
    let line = format!("{program} {}", arguments.join(" "));
    eprintln!("$ {line}");
    let status = Command::new(program)
        .args(arguments)
        .envs(environment.iter().copied())
        .current_dir(workspace())
        .status()
        .map_err(|error| ChoreError(format!("cannot start `{line}`: {error}")))?;
    if status.success() {
        Ok(())
    } else {
        Err(ChoreError(format!("`{line}` failed ({status})")))
    }
}

/// Runs a program, which must succeed, and returns what it prints.
///
/// # Errors
/// If it cannot be started or does not succeed.
pub fn output(command: &mut Command) -> Result<String, ChoreError> {
    let output = command.output();
    let program = Path::new(command.get_program());
    let name = program.file_name().unwrap_or(program.as_os_str()).display();
    let output = output.map_err(|cause| ChoreError(format!("cannot start {name}: {cause}")))?;
    if !output.status.success() {
        let reason = String::from_utf8_lossy(&output.stderr);
        let status = output.status;
        return Err(ChoreError(match reason.trim() {
            // The program has printed it itself, or has none.
            "" => format!("{name} fails ({status})"),
            reason => format!("{name} fails ({status}): {reason}"),
        }));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Runs a program in the workspace's folder, and returns what it prints without the spaces around it.
///
/// # Errors
/// As [`output`].
pub fn answer(program: &str, arguments: &[&str]) -> Result<String, ChoreError> {
    let mut command = Command::new(program);
    let printed = output(command.args(arguments).current_dir(workspace()))?;
    Ok(printed.trim().to_owned())
}

/// Runs cargo in the workspace's folder.
///
/// # Errors
/// As [`run`].
pub fn run_cargo(arguments: &[&str]) -> Result<(), ChoreError> {
    run(&cargo(), arguments)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failure_gives_the_reason_that_the_program_prints() {
        let failure = |script: &str| {
            let failure = output(Command::new("sh").args(["-c", script])).unwrap_err();
            failure.to_string()
        };
        let failed = "sh fails (exit status: 3)";
        assert_eq!(failure("echo why >&2; exit 3"), format!("{failed}: why"));
        assert_eq!(failure("exit 3"), failed);
    }
}
