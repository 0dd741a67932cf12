//! `painleve accept`: tests a bare board, and writes a report.

use std::ops::ControlFlow;
use std::path::PathBuf;

use clap::Args;
use painleve_accept::{AcceptError, StepReport, Verdict, accept};
use painleve_board::Serial;
use painleve_files::atomic_file::{commit_all, prepare};
use painleve_process::interrupt::Interrupt;
use painleve_process::terminal::warn;

use super::output::warn_of_earlier;
use super::output_error::output;
use super::{CommandError, distinct_files, say};

/// Options of `painleve accept`.
#[derive(Debug, Args)]
pub struct AcceptArguments {
    /// Serial port of the board, for example /dev/ttyUSB0.
    #[arg(long, value_name = "PATH")]
    port: PathBuf,
    /// File for the report, a page; a JSON file of the same name is written beside it.
    #[arg(long, value_name = "PATH", default_value = "out/accept.html")]
    output: PathBuf,
    /// Print one JSON object on stdout instead of the text.
    #[arg(long)]
    json: bool,
}

/// Accepts the board behind a port; the report is written whatever it says. Ctrl-C ends it after the present step.
///
/// # Errors
/// [`CommandError`] if the board cannot be tested or is not accepted, or a file cannot be written.
pub fn run(arguments: &AcceptArguments) -> Result<(), CommandError> {
    let page = &arguments.output;
    let object = page.with_extension("json");
    distinct_files::check(&[("--output", page), ("the JSON report", &object)])?;
    let warn_of_earlier = || warn_of_earlier(&[page, &object]);
    let interrupt = Interrupt::catch()?;
    let board = Serial::connect(&arguments.port).inspect_err(|_| warn_of_earlier())?;
    // A step that is under way may have stored a configuration.
    let accepted = accept(board, |step| {
        tell(step);
        match interrupt.is_requested() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    })
    .inspect_err(|_| warn_of_earlier());
    let acceptance = accepted.map_err(|error| match error {
        AcceptError::Board(error) => CommandError::Board(error),
        AcceptError::Stored => CommandError::Accept(error),
        AcceptError::Interrupted => CommandError::Interrupted,
    })?;
    let json = serde_json::to_string_pretty(&acceptance).map_err(output)?;
    commit_all(vec![
        prepare(page, acceptance.html().as_bytes()).map_err(output)?,
        prepare(&object, json.as_bytes()).map_err(output)?,
    ])
    .map_err(output)?;
    if arguments.json {
        say(json)?;
    } else {
        say(format_args!(
            "written: {}, {}",
            page.display(),
            object.display()
        ))?;
    }
    let failed = acceptance.failed();
    if failed.is_empty() {
        Ok(())
    } else {
        Err(CommandError::NotAccepted(failed))
    }
}

/// Shows a step that has been carried out, and what has failed in it.
fn tell(step: &StepReport) {
    warn(format_args!("{}: {}", step.name, step.verdict.word()));
    for check in &step.checks {
        if check.verdict == Verdict::Failed {
            warn(format_args!(
                "  {}: {}; expected {}",
                check.what, check.measured, check.expected
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_does_not_take_the_name_of_the_json_report() {
        let arguments = AcceptArguments {
            port: "/dev/null".into(),
            output: "no-such-folder/a.json".into(),
            json: false,
        };
        let error = run(&arguments).unwrap_err();
        assert_eq!(
            error.to_string(),
            "--output and the JSON report both name `no-such-folder/a.json`: choose different files"
        );
    }
}
