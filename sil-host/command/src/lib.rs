//! The `painleve` command: subcommands, options and errors.

mod accept;
mod arm;
mod bridge;
mod commission;
mod compare;
mod completions;
mod controller;
mod diff;
mod distinct_files;
mod doctor;
#[cfg(test)]
mod documentation;
mod drive;
mod export;
mod fail_on;
mod figures;
mod given_scenario;
mod identify;
mod join;
mod json;
mod live;
mod output;
mod output_error;
mod patience;
mod plan;
mod plant;
mod process_error;
mod progress;
mod run;
mod run_process;
mod scenario;
mod scenarios;
mod study;
mod sweep;
mod system_path;
mod timing;
mod tune;

use std::ffi::OsStr;
use std::io::Write;
use std::num::NonZeroUsize;
use std::panic::{self, AssertUnwindSafe, PanicHookInfo};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use painleve_shared::status::Fault;

use clap::builder::{PathBufValueParser, TypedValueParser};
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{CommandFactory, Parser, Subcommand};
use painleve_accept::AcceptError;
use painleve_board::BoardError;
use painleve_board::timing::CyclictestError;
use painleve_chart::picture;
use painleve_commission::Mistake;
use painleve_identify::Refusal;
use painleve_link::LinkError;
use painleve_plant::closed_loop::LoopError;
use painleve_plant::law_choice::{self, ScenarioLaws};
use painleve_plant::scenario::{ScenarioError, built_in, known_names};
use painleve_process::interrupt::{self, Interrupt, exit_when_requested, ignore_file_size_limit};
use painleve_process::memory_full::exit_when_shared_memory_is_full;
use painleve_process::terminal::{self, warn};
use painleve_study_core::StudyError;
use painleve_study_core::options::number;
use painleve_study_sweep::SweepError;

use commission::{BoardRigError, CommissionArguments};
use identify::IdentifyArguments;
use output_error::{InputError, OutputError, output};
use plan::Plan;
use process_error::ProcessError;

/// Real-time control of a robot arm pressing on a moving belt, with its simulated plant.
///
/// Without a subcommand, `run` is used.
#[derive(Debug, Parser)]
#[command(name = "painleve", version, args_conflicts_with_subcommands = true)]
#[command(defer(with_negative_numbers))]
pub struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    run: run::RunArguments,
}

/// Lets `-1` be the value of every option: what is wrong with it is then told by the option.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    let command = command.mut_args(|option| match option.get_action().takes_values() {
        true => option.allow_negative_numbers(true),
        false => option,
    });
    command.mut_subcommands(with_negative_numbers)
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run plant and controller as two processes and print a report.
    Run(run::RunArguments),
    #[command(flatten)]
    Process(Plan),
    /// Test a bare board, without an arm: chip, clock, watchdogs, flash, line and pins; writes a report.
    Accept(accept::AcceptArguments),
    /// Measure how the sensors and torque stages of an arm are mounted, and correct its scenario.
    Commission(commission::CommissionArguments),
    /// Measure geometry, joint friction and springs of an arm by slides along its belt, and how well they are known.
    Identify(identify::IdentifyArguments),
    /// Drive a real arm through its board: watch, permit arming, record, stop.
    Drive(drive::DriveArguments),
    /// Report the cost of control ticks: instructions, cycles or wake-up latency, and the worst
    /// tick.
    Timing(timing::TimingArguments),
    /// Show what earlier runs have left on this machine, and what this machine supports.
    Doctor(doctor::DoctorArguments),
    /// Write the ticks of a record as a table.
    Export(export::ExportArguments),
    /// Overlay runs in one page and one figure, and report how much they differ.
    Compare(compare::CompareArguments),
    /// Search keys of a scenario for a smaller error, ripple and change of torque.
    Tune(tune::TuneArguments),
    /// List the keys in which two scenarios or records differ.
    Diff(diff::DiffArguments),
    /// Print a completion script for a shell.
    Completions(completions::CompletionsArguments),
    /// Write a manual page for every command.
    Man(completions::ManArguments),
    /// Read a planar two-link arm from a URDF or an MJCF file, and print it as a scenario.
    Arm(arm::ArmArguments),
    /// List the built-in scenarios, or print one as TOML with every key.
    Scenarios(scenarios::ScenariosArguments),
    /// Compute a study, of the paper or of the controller, as numbers, data files and figures.
    Study(study::StudyArguments),
    /// Compute a study in shards, on several machines.
    Sweep(sweep::SweepArguments),
    /// Compute all of the paper's studies, with one page that compares them with the paper.
    Figures(figures::FiguresArguments),
}

/// Exit code of a process whose peer is missing or has died.
const PEER_FAILED: u8 = 3;

/// Exit code if an output cannot be written.
const UNWRITABLE: u8 = 4;

/// Exit code after a panic of this program.
const INTERNAL_ERROR: u8 = 70;

/// Exit code after Ctrl-C or a request to end.
const INTERRUPTED: u8 = 130;
/// Exit code of a real-time run whose controller missed its deadlines too often.
const DEADLINES_MISSED: u8 = 5;

/// Exit code of a run that met a condition of --fail-on.
const FAILED_ON: u8 = 6;

/// Failure of a command. Every message is one sentence for the user.
#[derive(Debug, thiserror::Error)]
pub enum CommandError {
    /// The scenario is invalid.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The run ended early.
    #[error(transparent)]
    Loop(#[from] LoopError),
    /// The peer is missing, gone or incompatible.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The board that runs the controller is missing, gone or incompatible.
    #[error(transparent)]
    Board(#[from] BoardError),
    /// There is no comparison with another program's wake-ups.
    #[error(transparent)]
    Cyclictest(#[from] CyclictestError),
    /// The arm has a mistake that no setting can describe.
    #[error("{0}")]
    Mounting(Mistake),
    /// The slides of an arm do not give its geometry.
    #[error("{0}")]
    Geometry(Refusal),
    /// A real arm cannot be commissioned: its torque stages do not come on or stay on.
    #[error(transparent)]
    Rig(BoardRigError),
    /// A board cannot be tested.
    #[error(transparent)]
    Accept(AcceptError),
    /// Steps of a board's acceptance have failed.
    #[error("the board is not accepted: {}", .0.join(", "))]
    NotAccepted(Vec<&'static str>),
    /// A file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// A file or option cannot be used.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The study failed.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// The sweep does not exist or is incomplete.
    #[error(transparent)]
    Sweep(#[from] SweepError),
    /// A process of the run could not be started or has died.
    #[error(transparent)]
    Process(#[from] ProcessError),
    /// A process of the run failed with an error that is this command's as well.
    #[error("{message}")]
    Reported {
        /// Its exit code.
        code: u8,
        /// Its error.
        message: String,
    },
    /// A process of the run failed and has already printed its error.
    #[error("")]
    Told {
        /// Its exit code.
        code: u8,
    },
    /// The arm's drive ended with a fault.
    #[error("the drive has latched fault {}: {}", *.0 as u8, .0.description())]
    Faulted(Fault),
    /// The run met a condition of --fail-on.
    #[error("--fail-on: {}", .0.join(", "))]
    FailedOn(Vec<String>),
    /// In real time, too many consecutive ticks were late or lost.
    #[error("the controller missed its deadlines and removed the torque: {}", .0.description())]
    DeadlinesMissed(Fault),
    /// Ctrl-C or a request to end.
    #[error("interrupted")]
    Interrupted,
}

impl CommandError {
    /// 1: the plant failed, a drive ended with a fault, an arm or board was refused, or a sweep is incomplete;
    /// 2: bad input; 3: a peer is missing or has died; 4: an output cannot be written; 5: deadlines missed;
    /// 6: a condition of --fail-on is met; 70: a bug; 130: interrupted.
    fn exit_code(&self) -> u8 {
        match self {
            Self::Scenario(_)
            | Self::Input(_)
            | Self::Cyclictest(CyclictestError::OtherHost)
            | Self::Accept(_) => 2,
            Self::Study(error) | Self::Sweep(SweepError::Study(error)) => match error {
                StudyError::Plant { .. } | StudyError::Loop { .. } => 1,
                StudyError::Unwritable { .. } => UNWRITABLE,
                StudyError::Scenario(_)
                | StudyError::Grid(_)
                | StudyError::Taken { .. }
                | StudyError::Law { .. }
                | StudyError::Ignored { .. }
                | StudyError::OutOfReach { .. }
                | StudyError::OffTheBelt { .. }
                | StudyError::NothingAdmissible
                | StudyError::Range(_)
                | StudyError::LevelsOfSeveralEffects
                | StudyError::NotFractional(_)
                | StudyError::SeveralFrictions { .. }
                | StudyError::TooManyRows(_) => 2,
            },
            Self::Sweep(SweepError::Incomplete { .. } | SweepError::Mismatch(_)) => 1,
            Self::Sweep(SweepError::Output(_)) => UNWRITABLE,
            Self::Sweep(_) => 2,
            Self::Board(
                BoardError::NotAnImage(_) | BoardError::Parts { .. } | BoardError::RateRefused(_),
            ) => 2,
            Self::Loop(LoopError::Plant(_))
            | Self::Faulted(_)
            | Self::Mounting(_)
            | Self::Geometry(_)
            | Self::NotAccepted(_) => 1,
            Self::Link(LinkError::Interrupted) => INTERRUPTED,
            Self::Loop(LoopError::Host(_) | LoopError::NotUnderstood { .. })
            | Self::Link(_)
            | Self::Board(_)
            | Self::Cyclictest(_)
            | Self::Rig(_)
            | Self::Process(_) => PEER_FAILED,
            Self::Loop(LoopError::Monitor(_)) | Self::Output(_) => UNWRITABLE,
            Self::Loop(LoopError::Interrupted) | Self::Interrupted => INTERRUPTED,
            Self::DeadlinesMissed(_) => DEADLINES_MISSED,
            Self::FailedOn(_) => FAILED_ON,
            Self::Reported { code, .. } | Self::Told { code } => *code,
        }
    }
}

impl From<std::io::Error> for CommandError {
    /// Converts an error of the operating system outside files and links.
    fn from(error: std::io::Error) -> Self {
        Self::Process(error.into())
    }
}

/// Writes a line to standard output.
fn say(line: impl std::fmt::Display) -> Result<(), CommandError> {
    said(terminal::say(line))
}

/// Returns the outcome of a write to standard output. A reader who has closed it wants no more; the command's own outcome
/// counts all the same.
fn said(written: std::io::Result<()>) -> Result<(), CommandError> {
    match written {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(output(OutputError::StandardOutput(error)))
        }
        _ => Ok(()),
    }
}

/// Prints the help, the version or a usage error, and returns the exit code of the process.
fn tell_usage(usage: &clap::Error) -> ExitCode {
    if usage.kind() == clap::error::ErrorKind::InvalidUtf8 {
        // clap does not say which one.
        let unreadable: Vec<String> = std::env::args_os()
            .filter(|argument| argument.to_str().is_none())
            .map(|argument| format!("{argument:?}"))
            .collect();
        let arguments = unreadable.join(", ");
        warn(format_args!(
            "error: {arguments}: not UTF-8, as the names of scenarios and the values of settings must be"
        ));
        return ExitCode::from(2);
    }
    let first = std::env::args_os().nth(1);
    if let Some(mistake) = mistaken_command(usage, first.as_deref().and_then(OsStr::to_str)) {
        warn(format_args!("error: {mistake}"));
        return ExitCode::from(2);
    }
    let written = if terminal::is_ascii_only() {
        let text = usage.render().to_string();
        if usage.use_stderr() {
            warn(text.trim_end());
            Ok(())
        } else {
            terminal::say(terminal::readable(text.trim_end()))
        }
    } else {
        usage.print().and_then(|()| std::io::stdout().flush())
    };
    match said(written) {
        Err(error) if !usage.use_stderr() => exit_code_of(&error),
        _ => u8::try_from(usage.exit_code()).unwrap_or(2).into(),
    }
}

/// Says what is wrong with a command that was taken for the name of a scenario: clap then blames the word after it.
/// `first` is the first word of the command line.
fn mistaken_command(usage: &clap::Error, first: Option<&str>) -> Option<String> {
    let first = first.filter(|word| !word.starts_with('-'))?;
    let Some(ContextValue::String(word)) = usage.get(ContextKind::InvalidSubcommand) else {
        return None;
    };
    let cli = Cli::command();
    let commands: Vec<&str> = cli.get_subcommands().map(clap::Command::get_name).collect();
    if usage.kind() != ErrorKind::ArgumentConflict || commands.contains(&first) {
        return None;
    }
    let is_scenario = built_in::text(first).is_some() || Path::new(first).exists();
    Some(match is_scenario {
        true => format!("unexpected '{word}' after the scenario '{first}'"),
        false => format!("no command '{first}'; {}", known_names(first, &commands)),
    })
}

/// Prints an error, unless it has been printed, and returns the exit code of the process.
fn exit_code_of(error: &CommandError) -> ExitCode {
    if !matches!(error, CommandError::Told { .. }) {
        warn(format_args!("error: {error}"));
    }
    ExitCode::from(error.exit_code())
}

/// Longest delay of Ctrl-C between two processes of a terminal.
const CTRL_C_SPREAD: Duration = Duration::from_millis(50);

/// Replaces the failure of a process by [`CommandError::Interrupted`] if Ctrl-C arrives shortly
/// after it: Ctrl-C may have ended the peer before it reached this process.
fn or_interrupted<T>(
    result: Result<T, CommandError>,
    interrupt: &Interrupt,
) -> Result<T, CommandError> {
    if matches!(
        result,
        Err(CommandError::Link(_) | CommandError::Loop(LoopError::Host(_)))
    ) {
        std::thread::sleep(CTRL_C_SPREAD);
        if interrupt.is_requested() {
            return Err(CommandError::Interrupted);
        }
    }
    result
}

/// Parses a time in seconds.
fn seconds(text: &str) -> Result<f64, String> {
    number(text, 0.0..=86_400.0, "seconds")
}

/// Parses a port of this machine.
fn port(text: &str) -> Result<u16, String> {
    number(text, 0..=u16::MAX, "a port")
}

/// Parses a number of things.
fn count(text: &str) -> Result<NonZeroUsize, String> {
    let count = number(text, 1..=1_000_000, "a whole number")?;
    Ok(NonZeroUsize::MIN.saturating_add(count - 1))
}

/// Checks the origin of a web page, as browsers send it.
fn origin(text: &str) -> Result<String, String> {
    let is_origin = text
        .split_once("://")
        .is_some_and(|(scheme, host)| match scheme {
            "file" => host.is_empty(),
            "http" | "https" => !host.is_empty() && !host.contains(['/', '?', '#', '@', ' ']),
            _ => false,
        });
    match is_origin {
        true => Ok(text.into()),
        false => {
            Err("expected http://HOST, http://HOST:PORT, the same with https, or file://".into())
        }
    }
}

/// Reads the path of a figure.
fn figure_path() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(picture::path)
}

/// Runs the command line with user-defined laws; see [`main`].
pub fn main_with<L: ScenarioLaws>() -> ExitCode {
    law_choice::install::<L>();
    main()
}

/// Runs the command line and returns the exit code of the process.
pub fn main() -> ExitCode {
    let command = match (Plan::of_this_process(), Cli::try_parse()) {
        (Some(plan), _) => Command::Process(plan),
        (None, Ok(cli)) => cli.command.unwrap_or(Command::Run(cli.run)),
        (None, Err(usage)) => return tell_usage(&usage),
    };
    panic::set_hook(Box::new(tell_panic));
    // Values that a panic may have left inconsistent are not used afterwards.
    let result = panic::catch_unwind(AssertUnwindSafe(|| {
        ignore_file_size_limit()?;
        execute(command)
    }));
    // The panic hook has already reported the panic.
    let result = result.unwrap_or(Err(CommandError::Told {
        code: if PANIC_IN_ICEORYX2.load(Ordering::Relaxed) {
            PEER_FAILED
        } else {
            INTERNAL_ERROR
        },
    }));
    match result {
        // Told by the panic hook.
        Err(_) if THREAD_REFUSED.load(Ordering::Relaxed) => ExitCode::from(PEER_FAILED),
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => exit_code_of(&error),
    }
}

/// Set by a panic in iceoryx2: version 0.9.3 panics when the system unexpectedly refuses a
/// resource, for example a file descriptor.
static PANIC_IN_ICEORYX2: AtomicBool = AtomicBool::new(false);

/// Where the standard library panics if the system refuses memory to a thread that has just started.
/// Nothing can catch this panic.
const THREAD_START: &str = "library/std/src/sys/pal/unix/";

/// Time for the first thread to end after that; it leaves a child a second.
const REFUSED_END: Duration = Duration::from_millis(1500);

/// Set by the first thread that the system refuses.
static THREAD_REFUSED: AtomicBool = AtomicBool::new(false);

/// Reports a panic in one line instead of a backtrace.
fn tell_panic(panic: &PanicHookInfo) {
    let place = panic.location().map_or("", |location| location.file());
    let payload = panic.payload();
    let message = payload
        .downcast_ref::<&str>()
        .copied()
        .or_else(|| payload.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("no reason given");
    let message = message.split_whitespace().collect::<Vec<_>>().join(" ");
    if place.contains("iceoryx2") {
        PANIC_IN_ICEORYX2.store(true, Ordering::Relaxed);
        warn(format_args!("error: iceoryx2 has failed: {message}"));
    } else if place.contains(THREAD_START) {
        // Several threads may be refused at once: the first reports it and ends the process.
        while THREAD_REFUSED.swap(true, Ordering::Relaxed) {
            std::thread::park();
        }
        warn(format_args!(
            "error: the system refuses a thread: {message}"
        ));
        // The first thread ends its children and tidies up, unless it waits for this one.
        interrupt::request();
        std::thread::sleep(REFUSED_END);
        std::process::exit(i32::from(PEER_FAILED));
    } else {
        let line = panic.location().map_or(0, |location| location.line());
        warn(format_args!(
            "error: this is a bug in painleve, please report it: {message} ({place}:{line})"
        ));
    }
}

fn execute(command: Command) -> Result<(), CommandError> {
    match &command {
        // These commands clean up peers, files or boards themselves.
        Command::Process(_) => {
            exit_when_shared_memory_is_full(PEER_FAILED)?;
        }
        Command::Run(_)
        | Command::Commission(CommissionArguments { port: Some(_), .. })
        | Command::Identify(IdentifyArguments { port: Some(_), .. })
        | Command::Drive(_)
        | Command::Tune(_)
        | Command::Export(_)
        | Command::Timing(_)
        | Command::Doctor(_) => {}
        Command::Accept(_)
        | Command::Commission(_)
        | Command::Identify(_)
        | Command::Completions(_)
        | Command::Man(_)
        | Command::Compare(_)
        | Command::Arm(_)
        | Command::Diff(_)
        | Command::Scenarios(_)
        | Command::Study(_)
        | Command::Sweep(_)
        | Command::Figures(_) => {
            exit_when_requested(INTERRUPTED)?;
        }
    }
    match command {
        Command::Run(arguments) => run::run(&arguments),
        Command::Process(Plan::Plant(arguments)) => plant::run(&arguments),
        Command::Process(Plan::Controller(arguments)) => controller::run(&arguments),
        Command::Process(Plan::Bridge(arguments)) => bridge::run(&arguments),
        Command::Accept(arguments) => accept::run(&arguments),
        Command::Commission(arguments) => commission::run(&arguments),
        Command::Identify(arguments) => identify::run(&arguments),
        Command::Drive(arguments) => drive::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Arm(arguments) => arm::run(&arguments),
        Command::Diff(arguments) => diff::run(&arguments),
        Command::Tune(arguments) => tune::run(&arguments),
        Command::Timing(arguments) => timing::run(&arguments),
        Command::Doctor(arguments) => doctor::run(&arguments),
        Command::Export(arguments) => export::run(&arguments),
        Command::Completions(arguments) => completions::print(&arguments),
        Command::Man(arguments) => completions::write_manual(&arguments),
        Command::Scenarios(arguments) => scenarios::run(&arguments),
        Command::Study(arguments) => study::run(&arguments),
        Command::Sweep(arguments) => sweep::run(&arguments),
        Command::Figures(arguments) => figures::run(&arguments),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_misspelt_command_is_not_taken_for_a_scenario() {
        let said = |line: &[&str]| {
            let words = ["painleve"].iter().chain(line);
            let usage = Cli::try_parse_from(words).unwrap_err();
            mistaken_command(&usage, line.first().copied())
        };
        for (line, start) in [
            (
                &["stduy", "admissible"][..],
                "no command 'stduy'; did you mean 'study'? known: run,",
            ),
            (
                &["exprt", "out/run.mcap", "--csv"],
                "no command 'exprt'; did you mean 'export'? ",
            ),
            (
                &["edge", "study"],
                "unexpected 'study' after the scenario 'edge'",
            ),
        ] {
            let message = said(line).unwrap();
            assert!(message.starts_with(start), "{message}");
        }
        for told_by_clap in [
            &["--no-record", "edge", "run"][..],
            &["study", "nothing"],
            &["edge", "--nothing"],
        ] {
            assert_eq!(said(told_by_clap), None, "{told_by_clap:?}");
        }
    }
}
