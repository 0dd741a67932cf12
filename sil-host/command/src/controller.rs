//! `painleve controller`: the firmware's controller in its own process.

use std::time::Duration;

use clap::Args;
use painleve_firmware::drive::ControlTask;
use painleve_link::{BusDrive, BusName, ControllerEnd, Pacing};
use painleve_plant::Configuration;
use painleve_plant::law_choice::LawChoice;
use painleve_system::interrupt::Interrupt;
use painleve_system::realtime::request_realtime;
use painleve_system::terminal::warn;

use super::patience::{PatienceArguments, WAIT_S};
use super::process_error::ProcessError;
use super::{CommandError, or_interrupted};

/// Options of `painleve controller`.
#[derive(Debug, Args)]
pub struct ControllerArguments {
    /// Bus of the plant.
    #[arg(long)]
    bus: BusName,
    /// Longest wait for the plant, s.
    #[arg(long, value_name = "SECONDS", default_value_t = WAIT_S, value_parser = super::seconds)]
    wait_s: f64,
    #[command(flatten)]
    patience: PatienceArguments,
}

/// Answers the plant's frames until its session ends.
pub fn run(arguments: &ControllerArguments) -> Result<(), CommandError> {
    let interrupt = Interrupt::catch()?;
    or_interrupted(answer_until(arguments, &interrupt), &interrupt)
}

fn answer_until(
    arguments: &ControllerArguments,
    interrupt: &Interrupt,
) -> Result<(), CommandError> {
    let wait = Duration::from_secs_f64(arguments.wait_s);
    let (mut end, session) = ControllerEnd::open(&arguments.bus, wait, interrupt)?;
    end.set_silence_limit(arguments.patience.peer());
    let configuration: Configuration =
        postcard::from_bytes(&session.configuration).map_err(|source| {
            ProcessError::Unreadable {
                bus: arguments.bus.clone(),
                source,
            }
        })?;
    if session.pacing == Pacing::Realtime {
        warn(format_args!("controller: {}", request_realtime()));
    }
    let drive = BusDrive::new(end, &session);
    let source = drive.source();
    let mut task: ControlTask<BusDrive, LawChoice> = ControlTask::new(drive);
    task.configure(&configuration, source)
        .map_err(|source| ProcessError::Refused {
            bus: arguments.bus.clone(),
            source,
        })?;
    loop {
        task.tick();
        if let Some(outcome) = task.drive_mut().take_outcome() {
            return Ok(outcome?);
        }
        if interrupt.is_requested() {
            return Err(CommandError::Interrupted);
        }
    }
}
