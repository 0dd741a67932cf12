//! `painleve controller`: the firmware's controller in its own process.

use clap::Args;
use painleve_firmware::drive::ControlTask;
use painleve_link::{BusDrive, Pacing};
use painleve_plant::law_choice::LawChoice;
use painleve_process::interrupt::Interrupt;
use painleve_process::realtime::request_realtime;
use serde::{Deserialize, Serialize};

use super::join::JoinArguments;
use super::process_error::ProcessError;
use super::{CommandError, or_interrupted};

/// Options of `painleve controller`.
#[derive(Debug, Args, Serialize, Deserialize)]
pub struct ControllerArguments {
    #[command(flatten)]
    pub plant: JoinArguments,
}

/// Answers the plant's frames until its session ends.
///
/// # Errors
/// [`CommandError`] if the plant is missing, gone or incompatible, or the user interrupts.
pub fn run(arguments: &ControllerArguments) -> Result<(), CommandError> {
    let interrupt = Interrupt::catch()?;
    or_interrupted(answer_until(arguments, &interrupt), &interrupt)
}

fn answer_until(
    arguments: &ControllerArguments,
    interrupt: &Interrupt,
) -> Result<(), CommandError> {
    let (end, session, configuration) = arguments.plant.join(interrupt)?;
    if session.pacing == Pacing::Realtime {
        request_realtime().tell("controller", arguments.plant.quiet);
    }
    let drive = BusDrive::new(end, &session);
    let source = drive.source();
    let mut task: ControlTask<BusDrive, LawChoice> = ControlTask::new(drive);
    task.configure(&configuration, source)
        .map_err(|source| ProcessError::Refused {
            bus: arguments.plant.bus.clone(),
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
