//! What a finished run may be failed for: `painleve run --fail-on fault,lift-off,missed-deadline`.

use clap::ValueEnum;
use painleve_record::report::RunReport;

use super::CommandError;

/// Something that a run reports and that a test may not want.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum FailOn {
    /// The controller latched a fault.
    Fault,
    /// The tip lifted off, be it at the start.
    LiftOff,
    /// By the clock, a wake-up came later than a whole tick.
    MissedDeadline,
}

impl FailOn {
    /// What the report says of it, if it happened.
    fn found(self, report: &RunReport) -> Option<String> {
        match self {
            Self::Fault => report.fault.map(|fault| {
                let description = report.fault_description.as_deref().unwrap_or_default();
                format!("fault {fault} ({description})")
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

/// Fails a run for what it was asked to.
///
/// # Errors
/// [`CommandError::FailedOn`] naming everything that happened.
pub fn check(asked: &[FailOn], report: &RunReport) -> Result<(), CommandError> {
    let found: Vec<String> = asked.iter().filter_map(|one| one.found(report)).collect();
    if found.is_empty() {
        Ok(())
    } else {
        Err(CommandError::FailedOn(found.join(", ")))
    }
}
