//! The `painleve` command; see [`painleve_command`].

use std::process::ExitCode;

fn main() -> ExitCode {
    painleve_command::main()
}
