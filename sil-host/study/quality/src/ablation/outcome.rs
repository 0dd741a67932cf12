//! The contribution of each part as a table.

use comfy_table::Table;
use painleve_study_core::outcome::{self, Outcome};
use serde::Serialize;

use super::{AblationStudy, Condition};
use crate::paired_difference::PairedDifference;
use crate::proportion::Proportion;
use crate::robustness::{Ending, Part, Row};

/// Result without one part under one condition.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ablated {
    /// The condition.
    pub condition: Condition,
    /// The part that is switched off; `None` for the whole controller.
    pub without: Option<Part>,
    /// The configuration keys that switch it off.
    pub keys: String,
    /// Number of runs.
    pub runs: usize,
    /// Number of runs in which the tip was kept.
    pub successes: usize,
    /// Their share, 0 … 1.
    pub rate: f64,
    /// Lower bound of its 95 % confidence interval.
    pub lower: f64,
    /// Upper bound of its 95 % confidence interval.
    pub upper: f64,
    /// Runs in which the tip is kept with the part, and not without it.
    pub lost: usize,
    /// Runs in which the tip is kept without the part, and not with it.
    pub gained: usize,
    /// Runs with a lift-off after capture.
    pub lift_offs: usize,
    /// Runs without capture.
    pub not_captured: usize,
    /// Runs with a fault, or whose plant could not be solved.
    pub faults: usize,
    /// What the table shows: the share of the whole controller or the change without the part, in percent. A change that
    /// may be chance is in parentheses.
    pub shown: String,
}

/// The contribution of each part.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ablation {
    /// For each condition the whole controller first, then without each part.
    pub rows: Vec<Ablated>,
}

impl Ablation {
    /// Collects all rows of a study.
    pub fn new(study: &AblationStudy, rows: &[Row]) -> Self {
        let runs = study.runs.max(1);
        let mut whole: &[Row] = &[];
        let cells = study.cells().into_iter().zip(rows.chunks(runs));
        let rows = cells.map(|((condition, without), rows)| {
            if without.is_none() {
                whole = rows;
            }
            Ablated::new(condition, without, whole, rows)
        });
        Self {
            rows: rows.collect(),
        }
    }

    /// Returns the results under each condition, the whole controller first.
    pub(super) fn by_condition(&self) -> impl Iterator<Item = &[Ablated]> {
        self.rows
            .chunk_by(|one, other| one.condition == other.condition)
    }
}

impl Ablated {
    fn new(condition: Condition, without: Option<Part>, whole: &[Row], rows: &[Row]) -> Self {
        let count = |is: fn(Ending) -> bool| rows.iter().filter(|row| is(row.ending)).count();
        let differing = |with: bool| {
            let pairs = whole.iter().zip(rows);
            let differ = |(one, other): &(&Row, &Row)| {
                (one.ending.is_kept(), other.ending.is_kept()) == (with, !with)
            };
            pairs.filter(differ).count()
        };
        let Proportion {
            successes,
            runs,
            rate,
            lower,
            upper,
        } = Proportion::new(count(Ending::is_kept), rows.len());
        let (lost, gained) = (differing(true), differing(false));
        let shown = match without {
            None => format!("{:.1} %", 100.0 * rate),
            Some(_) => shown(PairedDifference::new(gained, lost, runs)),
        };
        Self {
            condition,
            without,
            keys: without.map_or(String::new(), |part| part.without().join(" ")),
            runs,
            successes,
            rate,
            lower,
            upper,
            lost,
            gained,
            lift_offs: count(|ending| ending == Ending::LiftOff),
            not_captured: count(|ending| ending == Ending::NotCaptured),
            faults: count(|ending| matches!(ending, Ending::Fault | Ending::Unsolved)),
            shown,
        }
    }

    /// Returns the change of the share when the part is switched off, in the same runs.
    pub(super) fn difference(&self) -> PairedDifference {
        PairedDifference::new(self.gained, self.lost, self.runs)
    }

    /// Returns the part that is switched off; `none` for the whole controller.
    pub(super) fn part(&self) -> String {
        self.without.as_ref().map_or("none".into(), outcome::name)
    }
}

/// Returns a change as the table shows it.
fn shown(change: PairedDifference) -> String {
    let text = format!("{:+.1}", 100.0 * change.difference).replace('-', "−");
    if change.lower > 0.0 || change.upper < 0.0 {
        text
    } else {
        format!("({text})")
    }
}

impl Outcome for Ablation {
    fn lines(&self) -> impl IntoIterator<Item: Serialize> {
        &self.rows
    }

    fn table(&self) -> Table {
        let columns: Vec<&[Ablated]> = self.by_condition().collect();
        let names = columns.iter().map(|rows| outcome::name(&rows[0].condition));
        let mut table = outcome::table(std::iter::once("without".to_owned()).chain(names));
        for place in 0..columns.first().map_or(0, |rows| rows.len()) {
            let cells = columns.iter().map(|rows| rows[place].shown.clone());
            table.add_row(std::iter::once(columns[0][place].part()).chain(cells));
        }
        table
    }
}
