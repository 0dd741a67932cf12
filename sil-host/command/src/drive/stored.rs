//! `painleve drive --store`, `--stored`, `--forget`: the configuration that the board keeps in its flash.

use painleve_board::Serial;
use painleve_plant::scenario::Scenario;
use painleve_shared::stored::StoredState;

use super::DriveArguments;
use crate::output_error::output;
use crate::{CommandError, say};

/// Asks the board for its own configuration, or changes it.
///
/// # Errors
/// [`CommandError`] if the board does not answer, refuses the configuration or does not store it.
pub fn run(arguments: &DriveArguments, scenario: &Scenario) -> Result<(), CommandError> {
    if arguments.store {
        super::check_commissioned(scenario)?;
    }
    let mut board = Serial::connect(&arguments.port)?;
    board.identify()?;
    let stored = if arguments.store {
        super::warn_of_single_sensors(scenario);
        board.store(&scenario.controller_configuration())?
    } else if arguments.forget {
        board.forget()?
    } else {
        board.stored()?
    };
    if arguments.json {
        return say(serde_json::to_string(&stored).map_err(output)?);
    }
    say(format!(
        "stored state {}: {}",
        stored.state.code(),
        stored.state.text()
    ))?;
    if stored.state == StoredState::Intact {
        say(format!(
            "version {}; to arm the drive: press RESET for a second with ENABLE open, then close ENABLE",
            stored.version
        ))?;
    }
    Ok(())
}
