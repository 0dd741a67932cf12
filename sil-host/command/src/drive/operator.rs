//! The operator's commands: lines on standard input.

use std::io::{self, BufRead};
use std::sync::mpsc::{Receiver, channel};

/// A command to the drive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum OperatorCommand {
    /// Permit the drive to arm.
    Arm,
    /// Withdraw the permission; the torque goes off.
    Disarm,
    /// Stop the drive and end.
    Stop,
    /// Anything else.
    Unknown(String),
}

impl OperatorCommand {
    fn of(line: &str) -> Option<Self> {
        match line.trim() {
            "" => None,
            "arm" => Some(Self::Arm),
            "disarm" => Some(Self::Disarm),
            "stop" => Some(Self::Stop),
            other => Some(Self::Unknown(other.to_owned())),
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
        let (sender, receiver) = channel();
        std::thread::Builder::new().spawn(move || {
            for line in io::stdin().lock().lines() {
                let Ok(line) = line else { return };
                if let Some(order) = OperatorCommand::of(&line)
                    && sender.send(order).is_err()
                {
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
        assert_eq!(OperatorCommand::of("arm\n"), Some(OperatorCommand::Arm));
        assert_eq!(OperatorCommand::of(" stop "), Some(OperatorCommand::Stop));
        assert_eq!(OperatorCommand::of("\n"), None);
        assert_eq!(
            OperatorCommand::of("armed"),
            Some(OperatorCommand::Unknown("armed".into()))
        );
        assert_eq!(
            OperatorCommand::of("ARM"),
            Some(OperatorCommand::Unknown("ARM".into()))
        );
    }
}
