//! The `painleve` command: its subcommands, their options, their errors.

mod bridge;
mod controller;
mod fail_on;
mod figures;
mod output;
mod plant;
mod run;
mod scenarios;
mod study;
mod sweep;
mod timing;

use std::panic::{self, AssertUnwindSafe, PanicHookInfo};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use painleve_shared::status::Fault;

use clap::{Parser, Subcommand};
use painleve_board::BoardError;
use painleve_bound::BoundError;
use painleve_link::LinkError;
use painleve_plant::closed_loop::LoopError;
use painleve_plant::law_choice::{self, ScenarioLaws};
use painleve_plant::scenario::ScenarioError;
use painleve_study::StudyError;
use painleve_study::sweep::SweepError;
use painleve_system::interrupt::{Interrupt, exit_when_requested, ignore_file_size_limit};
use painleve_system::terminal::{self, warn};

/// Real-time control of a robot arm pressing on a moving belt, with its simulated plant.
///
/// Without a subcommand, `run` is run.
#[derive(Debug, Parser)]
#[command(name = "painleve", version, args_conflicts_with_subcommands = true)]
pub struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    run: run::RunArguments,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Start plant and controller as two processes and report what happened.
    Run(run::RunArguments),
    /// Simulate belt and arm, and wait for a controller on the bus.
    Plant(plant::PlantArguments),
    /// Run the controller for the plant on the bus.
    Controller(controller::ControllerArguments),
    /// Run the controller's image on a board for the plant on the bus.
    Bridge(bridge::BridgeArguments),
    /// What control ticks cost: instructions, cycles, or lateness, with the worst of all.
    Timing(timing::TimingArguments),
    /// List the built-in scenarios, or print one as TOML with every key.
    Scenarios(scenarios::ScenariosArguments),
    /// Compute one of the paper's studies as numbers, data files and figures.
    Study(study::StudyArguments),
    /// Compute a study in shards, on many machines.
    Sweep(sweep::SweepArguments),
    /// Make all of the paper's studies, with one page that sets them beside the paper.
    Figures(figures::FiguresArguments),
}

/// Exit code of a process whose peer is missing or has died.
const PEER_FAILED: u8 = 3;

/// Exit code after a panic that is our own.
const INTERNAL_ERROR: u8 = 70;

/// Exit code after Ctrl-C or a request to end.
const INTERRUPTED: u8 = 130;
/// Exit code of a run by the clock whose controller was too late too often.
const DEADLINES_MISSED: u8 = 5;

/// Exit code of a run in which something happened that it was asked to fail for.
const FAILED_ON: u8 = 6;

/// Why a command failed. Every message is one sentence for the user.
#[derive(Debug, thiserror::Error)]
pub enum CommandError {
    /// The scenario is wrong.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The run ended early.
    #[error(transparent)]
    Loop(#[from] LoopError),
    /// The peer is missing, gone or wrong.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The board that runs the controller is missing, gone or wrong.
    #[error(transparent)]
    Board(#[from] BoardError),
    /// An image that has no bound.
    #[error(transparent)]
    Bound(#[from] BoundError),
    /// A file cannot be written.
    #[error("{0}")]
    Output(String),
    /// Record and figure would replace each other.
    #[error("--record and --plot both name `{}`: give each a file of its own", .0.display())]
    SameFile(PathBuf),
    /// A study has no outcome.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// There is no sweep, or not all of one.
    #[error(transparent)]
    Sweep(#[from] SweepError),
    /// A process of the run cannot be started or has died.
    #[error("{0}")]
    Process(String),
    /// A process of the run has failed and said why.
    #[error("")]
    Told {
        /// Its exit code.
        code: u8,
    },
    /// Something happened that the run was asked to fail for.
    #[error("--fail-on: {0}")]
    FailedOn(String),
    /// By the clock, ticks were late or lost too often in a row.
    #[error("the controller missed its deadlines and took the torque off: {}", .0.description())]
    DeadlinesMissed(Fault),
    /// Ctrl-C or a request to end.
    #[error("interrupted")]
    Interrupted,
    /// Whoever reads standard output has had enough.
    #[error("")]
    Unread,
}

impl CommandError {
    /// 1: the plant failed, or a sweep is incomplete; 2: bad input; 3: a peer is missing or has died;
    /// 4: an output cannot be written; 5: deadlines missed; 130: interrupted.
    fn exit_code(&self) -> u8 {
        match self {
            Self::Scenario(_) | Self::SameFile(_) | Self::Bound(_) => 2,
            Self::Study(error) | Self::Sweep(SweepError::Study(error)) => match error {
                StudyError::Scenario(_)
                | StudyError::Option(_)
                | StudyError::Range(_)
                | StudyError::TooManyRows(_) => 2,
                StudyError::Plant { .. } | StudyError::Loop { .. } => 1,
                StudyError::Plot(_) => 4,
            },
            Self::Sweep(SweepError::Incomplete(_)) => 1,
            Self::Sweep(SweepError::Output(_)) => 4,
            Self::Sweep(_) => 2,
            Self::Loop(LoopError::Plant(_)) => 1,
            Self::Link(LinkError::Interrupted) => INTERRUPTED,
            Self::Loop(LoopError::Host(_) | LoopError::NotUnderstood { .. })
            | Self::Link(_)
            | Self::Board(_)
            | Self::Process(_) => PEER_FAILED,
            Self::Loop(LoopError::Monitor(_)) | Self::Output(_) => 4,
            Self::Loop(LoopError::Interrupted) | Self::Interrupted => INTERRUPTED,
            Self::DeadlinesMissed(_) => DEADLINES_MISSED,
            Self::FailedOn(_) => FAILED_ON,
            Self::Told { code } => *code,
            Self::Unread => 0,
        }
    }
}

impl From<std::io::Error> for CommandError {
    /// What the system refuses a process, outside files and links.
    fn from(error: std::io::Error) -> Self {
        Self::Process(error.to_string())
    }
}

/// Writes a line to standard output.
fn say(line: impl std::fmt::Display) -> Result<(), CommandError> {
    terminal::say(line).map_err(|error| match error.kind() {
        std::io::ErrorKind::BrokenPipe => CommandError::Unread,
        _ => CommandError::Output(format!("cannot write to stdout: {error}")),
    })
}

/// How long Ctrl-C may take from one process of a terminal to the next.
const CTRL_C_SPREAD: Duration = Duration::from_millis(50);

/// A failure of a process whose peer is on the same terminal: Ctrl-C may have ended the peer
/// before it was heard here.
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

/// A time in seconds on the command line.
fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (0.0..=86_400.0).contains(&seconds) => Ok(seconds),
        _ => Err("give a number of seconds from 0 to 86400".into()),
    }
}

/// Runs the command line with laws of one's own; see [`main`].
pub fn main_with<L: ScenarioLaws>() -> ExitCode {
    law_choice::install::<L>();
    main()
}

/// Runs the command line; the exit code is the process's.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    panic::set_hook(Box::new(tell_panic));
    // Nothing of what a panic may leave half-done is used afterwards.
    let result = panic::catch_unwind(AssertUnwindSafe(|| {
        ignore_file_size_limit()?;
        execute(cli.command.unwrap_or(Command::Run(cli.run)))
    }));
    // A panic has been told where it happened.
    let result = result.unwrap_or(Err(CommandError::Told {
        code: if PANIC_IN_ICEORYX2.load(Ordering::Relaxed) {
            PEER_FAILED
        } else {
            INTERNAL_ERROR
        },
    }));
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            if !matches!(error, CommandError::Told { .. } | CommandError::Unread) {
                warn(format_args!("error: {error}"));
            }
            ExitCode::from(error.exit_code())
        }
    }
}

/// A panic has come from iceoryx2: 0.9.3 does so when the system refuses what it does not expect
/// to be refused, a file descriptor, say.
static PANIC_IN_ICEORYX2: AtomicBool = AtomicBool::new(false);

/// One line instead of a trace of calls.
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
        warn(format_args!("error: iceoryx2 cannot go on: {message}"));
    } else {
        let line = panic.location().map_or(0, |location| location.line());
        warn(format_args!(
            "error: this is a fault of painleve, please report it: {message} ({place}:{line})"
        ));
    }
}

fn execute(command: Command) -> Result<(), CommandError> {
    match &command {
        // These have peers, files or boards to put in order.
        Command::Run(_)
        | Command::Plant(_)
        | Command::Controller(_)
        | Command::Bridge(_)
        | Command::Timing(_) => {}
        Command::Scenarios(_) | Command::Study(_) | Command::Sweep(_) | Command::Figures(_) => {
            exit_when_requested(INTERRUPTED)?;
        }
    }
    match command {
        Command::Run(arguments) => run::run(&arguments),
        Command::Plant(arguments) => plant::run(&arguments),
        Command::Controller(arguments) => controller::run(&arguments),
        Command::Bridge(arguments) => bridge::run(&arguments),
        Command::Timing(arguments) => timing::run(&arguments),
        Command::Scenarios(arguments) => scenarios::run(&arguments),
        Command::Study(arguments) => study::run(&arguments),
        Command::Sweep(arguments) => sweep::run(&arguments),
        Command::Figures(arguments) => figures::run(&arguments),
    }
}
