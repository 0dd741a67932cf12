//! The contribution of each part as a table.

use comfy_table::Table;
use painleve_study_core::outcome::{self, Outcome};
use serde::Serialize;

use super::AblationStudy;
use crate::paired_difference::PairedDifference;
use crate::proportion::Proportion;
use crate::robustness::{Criterion, Ending, Part, Robustness, RobustnessOutcome, Row};

/// Result of the campaign without one part.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ablated {
    /// The part that is switched off; `None` for the whole controller.
    pub without: Option<Part>,
    /// The configuration keys that switch it off.
    pub keys: String,
    /// Number of runs.
    pub runs: usize,
    /// Number of runs that succeeded.
    pub successes: usize,
    /// Success rate, 0 … 1.
    pub rate: f64,
    /// Lower bound of its 95 % confidence interval.
    pub lower: f64,
    /// Upper bound of its 95 % confidence interval.
    pub upper: f64,
    /// Runs that succeed with the part and fail without it.
    pub lost: usize,
    /// Runs that fail with the part and succeed without it.
    pub gained: usize,
    /// Runs with a lift-off after capture.
    pub lift_offs: usize,
    /// Runs that ended elsewhere, or at a wrongly estimated edge.
    pub not_reached: usize,
    /// Runs without capture.
    pub not_captured: usize,
    /// Runs with a fault, or whose plant could not be solved.
    pub faults: usize,
    /// Mean distance from the governed reference at the end, mm.
    pub mean_error_mm: f64,
}

/// The contribution of each part.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ablation {
    /// What counts as a success.
    pub criterion: Criterion,
    /// The whole controller first, then one line per part.
    pub rows: Vec<Ablated>,
}

impl Ablation {
    /// Collects all rows of a study.
    pub fn new(study: &AblationStudy, rows: Vec<Row>) -> Self {
        let runs = study.campaign.runs.max(1);
        let without = std::iter::once(None).chain(study.parts.iter().copied().map(Some));
        let whole = &rows[..runs.min(rows.len())];
        let Robustness {
            arms,
            seed,
            criterion,
            ..
        } = study.campaign;
        let rows = without
            .zip(rows.chunks(runs))
            .map(|(without, rows)| {
                let campaign = RobustnessOutcome::new(arms, seed, criterion, rows.to_vec());
                let differing = |with: bool| {
                    let pairs = whole.iter().zip(rows);
                    let succeed = |(one, other): &(&Row, &Row)| {
                        (criterion.holds(one.ending), criterion.holds(other.ending))
                            == (with, !with)
                    };
                    pairs.filter(succeed).count()
                };
                let errors: f64 = rows.iter().map(|row| row.error_m).sum();
                Ablated {
                    without,
                    keys: without.map_or(String::new(), |part| part.without().join(" ")),
                    runs: campaign.success.runs,
                    successes: campaign.success.successes,
                    rate: campaign.success.rate,
                    lower: campaign.success.lower,
                    upper: campaign.success.upper,
                    lost: differing(true),
                    gained: differing(false),
                    lift_offs: campaign.count(Ending::LiftOff),
                    not_reached: campaign.count(Ending::NotReached)
                        + campaign.count(Ending::StoppedEarly),
                    not_captured: campaign.count(Ending::NotCaptured),
                    faults: campaign.count(Ending::Fault) + campaign.count(Ending::Unsolved),
                    mean_error_mm: 1e3 * errors / rows.len() as f64,
                }
            })
            .collect();
        Self { criterion, rows }
    }
}

impl Ablated {
    /// Returns the change of the success rate when the part is switched off, in the same runs.
    pub(super) fn difference(&self) -> PairedDifference {
        PairedDifference::new(self.gained, self.lost, self.runs)
    }

    pub(super) fn name(&self) -> String {
        match &self.without {
            Some(_) => format!("without {}", self.part()),
            None => "everything".into(),
        }
    }

    /// Returns the part that is switched off; empty if none is.
    pub(super) fn part(&self) -> String {
        self.without.as_ref().map_or(String::new(), outcome::name)
    }
}

impl Outcome for Ablation {
    fn lines(&self) -> impl IntoIterator<Item: Serialize> {
        &self.rows
    }

    fn table(&self) -> Table {
        let mut table = outcome::table([
            "controller",
            &format!("{} (95 %)", self.criterion.words()),
            "paired difference (95 %)",
            "lift-off",
            "not reached",
            "not captured",
            "fault or unsolved",
            "mean error (mm)",
        ]);
        for row in &self.rows {
            table.add_row([
                row.name(),
                Proportion::new(row.successes, row.runs).to_string(),
                row.without
                    .map_or("–".into(), |_| row.difference().to_string()),
                row.lift_offs.to_string(),
                row.not_reached.to_string(),
                row.not_captured.to_string(),
                row.faults.to_string(),
                format!("{:.2}", row.mean_error_mm),
            ]);
        }
        table
    }
}
