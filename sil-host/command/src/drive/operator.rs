//! The operator's commands: lines on standard input.

use std::io::{self, BufRead};
use std::sync::mpsc::{Receiver, sync_channel};

/// Most commands that wait; further input is not read until then.
const MOST_WAITING: usize = 16;

/// A command to the drive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum OperatorCommand {
    /// Permit the drive to arm.
    Arm,
    /// Withdraw the permission; the torque goes off.
    Disarm,
    /// Stop the drive and end.
    Stop,
    /// The return key alone: confirms a task.
    Confirm,
    /// Anything else.
    Unknown(String),
}

impl OperatorCommand {
    fn of(line: &str) -> Self {
        match line.trim() {
            "" => Self::Confirm,
            "arm" => Self::Arm,
            "disarm" => Self::Disarm,
            "stop" => Self::Stop,
            other => Self::Unknown(other.to_owned()),
        }
    }
}

/// Reads commands without blocking the drive.
pub struct Operator(Receiver<OperatorCommand>);

impl Operator {
    /// Starts reading standard input. Its end is not a command: the drive continues.
    ///
    /// # Errors
    /// If the thread cannot be started.
    pub fn listen() -> io::Result<Self> {
        let (sender, receiver) = sync_channel(MOST_WAITING);
        std::thread::Builder::new().spawn(move || {
            for line in io::stdin().lock().lines() {
                let Ok(line) = line else { return };
                if sender.send(OperatorCommand::of(&line)).is_err() {
                    return;
                }
            }
        })?;
        Ok(Self(receiver))
    }

    /// Returns the next command, if there is one.
    pub fn order(&self) -> Option<OperatorCommand> {
        self.0.try_recv().ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_whole_word_is_an_order() {
        assert_eq!(OperatorCommand::of("arm\n"), OperatorCommand::Arm);
        assert_eq!(OperatorCommand::of(" stop "), OperatorCommand::Stop);
        assert_eq!(OperatorCommand::of("\n"), OperatorCommand::Confirm);
        for other in ["armed", "ARM"] {
            let unknown = OperatorCommand::Unknown(other.into());
            assert_eq!(OperatorCommand::of(other), unknown);
        }
    }
}
