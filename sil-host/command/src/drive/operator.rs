//! The operator's commands: lines on standard input.

use std::io::{self, BufRead, Read as _};
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};

use painleve_process::terminal::warn;

/// Most commands that wait; further input is not read until then.
const MOST_WAITING: usize = 16;

/// Longest line that is held, bytes.
const LONGEST: u64 = 256;

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
    /// Standard input has ended: nobody confirms a task.
    End,
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

    /// Returns whether this confirms a task of a procedure, and tells the operator what the procedure does not understand.
    fn confirms(self) -> Result<bool, Ended> {
        let unknown = match self {
            Self::Confirm => return Ok(true),
            Self::Stop | Self::Disarm => return Err(Ended::ByOperator),
            Self::End => return Err(Ended::NoInput),
            Self::Arm => "arm".to_owned(),
            Self::Unknown(text) => text,
        };
        warn(format_args!(
            "unknown command {unknown:?}: press Return, or type stop"
        ));
        Ok(false)
    }
}

/// Why a procedure has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// The operator has ended it.
    ByOperator,
    /// Standard input has ended: nobody can confirm a task.
    NoInput,
}

/// Reads commands without blocking the drive.
pub struct Operator(Receiver<OperatorCommand>);

impl Operator {
    /// Starts reading standard input.
    ///
    /// # Errors
    /// If the thread cannot be started.
    pub fn listen() -> io::Result<Self> {
        let (sender, receiver) = sync_channel(MOST_WAITING);
        std::thread::Builder::new().spawn(move || pass_on(io::stdin().lock(), &sender))?;
        Ok(Self(receiver))
    }

    /// Returns the next command, if there is one; after the last one always [`OperatorCommand::End`].
    pub fn order(&self) -> Option<OperatorCommand> {
        match self.0.try_recv() {
            Ok(command) => Some(command),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(OperatorCommand::End),
        }
    }

    /// Returns whether the operator has confirmed a task.
    ///
    /// # Errors
    /// [`Ended`] if the operator ends the procedure, or can no longer confirm anything.
    pub fn confirms(&self) -> Result<bool, Ended> {
        self.order().map_or(Ok(false), OperatorCommand::confirms)
    }

    /// Takes what the operator has said while no task waits: only an end counts. The end of standard input is none.
    ///
    /// # Errors
    /// [`Ended`] if the operator ends the procedure.
    pub fn attend(&self) -> Result<(), Ended> {
        while let Some(order) = self.order().filter(|it| *it != OperatorCommand::End) {
            order.confirms()?;
        }
        Ok(())
    }
}

/// Passes on the lines of an input until it ends. A line may be in any character set.
fn pass_on(mut input: impl BufRead, commands: &SyncSender<OperatorCommand>) {
    let mut line = Vec::new();
    while input
        .by_ref()
        .take(LONGEST)
        .read_until(b'\n', &mut line)
        .is_ok_and(|read| read > 0)
    {
        let text = String::from_utf8_lossy(&line);
        // A part of a longer line could read like a command.
        let is_part = !line.ends_with(b"\n") && input.skip_until(b'\n').is_ok_and(|rest| rest > 0);
        let command = if is_part {
            OperatorCommand::Unknown(text.into_owned())
        } else {
            OperatorCommand::of(&text)
        };
        if commands.send(command).is_err() {
            return;
        }
        line.clear();
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

    /// Returns an operator who has typed this and has left.
    fn typed(input: &[u8]) -> Operator {
        let (sender, receiver) = sync_channel(MOST_WAITING);
        pass_on(input, &sender);
        Operator(receiver)
    }

    #[test]
    fn after_a_line_that_is_no_text_the_operator_is_still_heard() {
        let operator = typed(b"\xff\nstop\n");
        let unknown = OperatorCommand::Unknown("\u{fffd}".into());
        assert_eq!(operator.order(), Some(unknown));
        assert_eq!(operator.order(), Some(OperatorCommand::Stop));
        for _ in 0..2 {
            assert_eq!(operator.order(), Some(OperatorCommand::End));
        }
    }

    #[test]
    fn no_part_of_a_long_line_is_a_command() {
        let longest = LONGEST as usize;
        for line in [
            format!("{}arm\n", "x".repeat(longest)),
            format!("arm{}ed", " ".repeat(longest)),
            format!("{}\n", " ".repeat(longest)),
        ] {
            let operator = typed(line.as_bytes());
            let held = line[..longest].to_owned();
            assert_eq!(operator.order(), Some(OperatorCommand::Unknown(held)));
            assert_eq!(operator.order(), Some(OperatorCommand::End));
        }
    }

    #[test]
    fn a_task_ends_with_the_operator_but_not_what_needs_none() {
        let left = typed(b"");
        assert_eq!(left.confirms(), Err(Ended::NoInput));
        assert_eq!(left.attend(), Ok(()));
        for end in ["stop\n", "disarm\n"] {
            assert_eq!(typed(end.as_bytes()).confirms(), Err(Ended::ByOperator));
        }
    }

    #[test]
    fn what_was_typed_before_a_task_does_not_confirm_it() {
        let (sender, receiver) = sync_channel(MOST_WAITING);
        let operator = Operator(receiver);
        pass_on(&b"\narm\nwhat?\n\n"[..], &sender);
        assert_eq!(operator.attend(), Ok(()));
        assert_eq!(operator.confirms(), Ok(false));
        pass_on(&b"\n"[..], &sender);
        assert_eq!(operator.confirms(), Ok(true));
        pass_on(&b"\n\nstop\n\n"[..], &sender);
        assert_eq!(operator.attend(), Err(Ended::ByOperator));
    }
}
