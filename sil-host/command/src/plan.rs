//! What a process of a run is to do, as `painleve run` hands it over: the options of its subcommand, serialised.
//!
//! The process is started as `painleve NAME --plan PLAN PARENT`, an option that the parser of the command line does not know;
//! PARENT is the id of the process that starts it.

use std::path::Path;
use std::process::Command;

use clap::Subcommand;
use nix::unistd::Pid;
use painleve_process::lifetime::{Signal, end_this_with, end_with_parent};
use serde::{Deserialize, Serialize};

use super::bridge::BridgeArguments;
use super::controller::ControllerArguments;
use super::plant::PlantArguments;

const OPTION: &str = "--plan";

/// What a process of a run receives when the run ends without it.
const END: Signal = Signal::SIGTERM;

/// A process of a run: its subcommand and options.
#[derive(Debug, Subcommand, Serialize, Deserialize)]
pub enum Plan {
    /// Simulate belt and arm, and wait for a controller on the bus.
    Plant(PlantArguments),
    /// Run the controller for the plant on the bus.
    Controller(ControllerArguments),
    /// Connect the controller's image on a board to the plant's bus.
    Bridge(BridgeArguments),
}

impl Plan {
    /// Returns the command that starts the process, which ends with this one.
    ///
    /// # Errors
    /// If the plan cannot be serialised, which plain structs can.
    pub fn command(&self, program: &Path) -> serde_json::Result<Command> {
        let name = match self {
            Self::Plant(_) => "plant",
            Self::Controller(_) => "controller",
            Self::Bridge(_) => "bridge",
        };
        let mut command = Command::new(program);
        command.args([name, OPTION, &serde_json::to_string(self)?]);
        command.arg(std::process::id().to_string());
        end_with_parent(&mut command, END);
        Ok(command)
    }

    /// Returns the plan of this process, if a `run` has started it that still runs.
    pub fn of_this_process() -> Option<Self> {
        let arguments: Vec<_> = std::env::args_os().skip(2).collect();
        match arguments.as_slice() {
            [option, plan, parent] if option == OPTION => {
                let parent = Pid::from_raw(parent.to_str()?.parse().ok()?);
                end_this_with(parent, END).ok()?;
                serde_json::from_str(plan.to_str()?).ok()
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::bridge::SensorLineArguments;

    #[test]
    fn numbers_reach_the_process_to_the_last_bit() {
        for bit_errors in (1..1000).map(|i| 0.1 / f64::from(i)) {
            let json = serde_json::to_string(&SensorLineArguments { bit_errors }).unwrap();
            let read: SensorLineArguments = serde_json::from_str(&json).unwrap();
            assert_eq!(read.bit_errors, bit_errors, "{json}");
        }
    }
}
