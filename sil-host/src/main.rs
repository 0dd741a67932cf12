//! The `painleve` command; see [`painleve_sil_host::commands`].

use std::process::ExitCode;

fn main() -> ExitCode {
    painleve_sil_host::commands::main()
}
