//! Conditions under which a finished run counts as failed: `painleve run --fail-on
//! fault,lift-off,missed-deadline`.

use clap::ValueEnum;
use painleve_record::report::RunReport;
use painleve_shared::status::Fault;

use super::CommandError;

/// A reported event that can fail a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum FailOn {
    /// The controller latched a fault.
    Fault,
    /// The tip lifted off, even at the start.
    LiftOff,
    /// In real time, a wake-up came later than a whole tick.
    MissedDeadline,
}

impl FailOn {
    /// Returns the event in words, if it happened.
    fn found(self, report: &RunReport) -> Option<String> {
        match self {
            Self::Fault => report.fault.map(|number| {
                let description = Fault::from_code(number).map_or("", Fault::description);
                format!("fault {number} ({description})")
            }),
            Self::LiftOff => {
                let count = report.lift_offs;
                (count > 0).then(|| format!("lift-offs: {count}"))
            }
            Self::MissedDeadline => {
                let count = report.missed_deadlines.unwrap_or(0);
                (count > 0).then(|| format!("missed deadlines: {count}"))
            }
        }
    }
}

/// Fails a run in which any of the `asked` events happened.
///
/// # Errors
/// [`CommandError::FailedOn`], naming all of them.
pub fn check(asked: &[FailOn], report: &RunReport) -> Result<(), CommandError> {
    let found: Vec<String> = asked.iter().filter_map(|one| one.found(report)).collect();
    if found.is_empty() {
        Ok(())
    } else {
        Err(CommandError::FailedOn(found))
    }
}
