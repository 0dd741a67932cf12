//! The report of an acceptance. The names of its fields are an interface: add fields, never rename them.

use core::fmt::Display;

use serde::Serialize;

use crate::chip::Chip;

/// Result of a check, of a step or of the acceptance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// As expected.
    Passed,
    /// For the reader: nothing is expected.
    Noted,
    /// Not as expected.
    Failed,
}

impl Verdict {
    /// Returns the verdict of several checks: that of the worst.
    pub fn of(checks: &[Check]) -> Self {
        let failed = checks.iter().any(|it| it.verdict == Self::Failed);
        if failed { Self::Failed } else { Self::Passed }
    }

    /// Returns the word for readers.
    pub fn word(self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::Noted => "noted",
            Self::Failed => "FAILED",
        }
    }
}

/// One measurement and what is expected.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Check {
    /// What was measured.
    pub what: String,
    /// The result, with its unit.
    pub measured: String,
    /// What is expected, and why.
    pub expected: String,
    /// Whether they agree.
    pub verdict: Verdict,
}

impl Check {
    /// Compares a result with what is expected.
    pub fn new(
        what: impl Display,
        measured: impl Display,
        expected: impl Display,
        agrees: bool,
    ) -> Self {
        Self {
            what: what.to_string(),
            measured: measured.to_string(),
            expected: expected.to_string(),
            verdict: if agrees {
                Verdict::Passed
            } else {
                Verdict::Failed
            },
        }
    }

    /// Notes a result for the reader.
    pub fn note(what: impl Display, measured: impl Display) -> Self {
        Self {
            what: what.to_string(),
            measured: measured.to_string(),
            expected: String::new(),
            verdict: Verdict::Noted,
        }
    }

    /// A step that could not be carried out.
    pub fn failure(error: &impl Display) -> Self {
        Self::new("the step", error, "is carried out", false)
    }
}

/// What one step has found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StepReport {
    /// Name of the step.
    pub name: &'static str,
    /// What it asks.
    pub question: &'static str,
    /// Whether every check has passed.
    pub verdict: Verdict,
    /// Its duration, s.
    pub duration_s: f64,
    /// The measurements.
    pub checks: Vec<Check>,
}

/// What the acceptance of a board has found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Acceptance {
    /// Whether every step has passed.
    pub verdict: Verdict,
    /// The chip; null if it is none that has an image.
    pub chip: Option<&'static str>,
    /// Version of this program.
    pub version: &'static str,
    /// Hash of the sources of this program's controller.
    pub sources: String,
    /// The steps, in their order.
    pub steps: Vec<StepReport>,
}

impl Acceptance {
    /// Assembles the report.
    pub(crate) fn new(chip: Option<&Chip>, steps: Vec<StepReport>) -> Self {
        let failed = steps.iter().any(|it| it.verdict == Verdict::Failed);
        Self {
            verdict: if failed {
                Verdict::Failed
            } else {
                Verdict::Passed
            },
            chip: chip.map(|it| it.name),
            version: env!("CARGO_PKG_VERSION"),
            sources: format!("{:016x}", painleve_firmware::SOURCES),
            steps,
        }
    }

    /// Returns the names of the steps that have failed.
    pub fn failed(&self) -> Vec<&'static str> {
        let failed = self.steps.iter();
        failed
            .filter(|it| it.verdict == Verdict::Failed)
            .map(|it| it.name)
            .collect()
    }
}
