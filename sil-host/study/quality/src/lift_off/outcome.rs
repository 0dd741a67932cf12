//! Lift-offs as a table and as histograms, with the limits.

use comfy_table::Table;
use painleve_firmware::estimate::contact::Evidence;
use painleve_study_core::outcome::{self, Outcome};
use serde::Serialize;

use super::{LiftOff, Row, bar_s};
use crate::distribution::Percentiles;

/// Outcome with one kind of evidence.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OfEvidence {
    /// Sensors from which the controller decides contact.
    pub evidence: Evidence,
    /// Time limit for the detection of a lift-off, s.
    pub bar_s: f64,
    /// Number of runs in which the tip left the belt.
    pub lift_offs: usize,
    /// Number of flights longer than the limit.
    pub long_flights: usize,
    /// Number of flights longer than the limit that were detected in time.
    pub in_time: usize,
    /// Number of flights longer than the limit that were never detected.
    pub missed: usize,
    /// Number of runs whose plant could not be solved; only their false alarms and sliding time count.
    pub unsolved: usize,
    /// Detection times of long flights, s.
    pub noticed_s: Option<Percentiles>,
    /// Durations of all flights, s.
    pub flight_s: Option<Percentiles>,
    /// Number of false alarms.
    pub false_alarms: u32,
    /// Sliding time, h.
    pub slid_h: f64,
}

/// Outcome of the study.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LiftOffs {
    /// With the force cell, and without it.
    pub evidence: Vec<OfEvidence>,
    /// All runs.
    pub rows: Vec<Row>,
}

impl Row {
    pub(super) fn is_long(&self, bar_s: f64) -> bool {
        self.solved
            && self.lift_off_s.is_some()
            && self.flight_s.is_none_or(|flight_s| flight_s > bar_s)
    }
}

impl LiftOffs {
    /// Collects all rows.
    pub fn new(rows: Vec<Row>) -> Self {
        let evidence = LiftOff::EVIDENCE.map(|evidence| {
            let bar_s = bar_s(evidence);
            let of: Vec<&Row> = rows.iter().filter(|row| row.evidence == evidence).collect();
            let solved = || of.iter().filter(|row| row.solved);
            let long: Vec<&&Row> = of.iter().filter(|row| row.is_long(bar_s)).collect();
            let noticed: Vec<f64> = long.iter().filter_map(|row| row.noticed_s).collect();
            OfEvidence {
                evidence,
                bar_s,
                lift_offs: solved().filter(|row| row.lift_off_s.is_some()).count(),
                long_flights: long.len(),
                in_time: noticed.iter().filter(|time_s| **time_s <= bar_s).count(),
                missed: long.len() - noticed.len(),
                unsolved: of.len() - solved().count(),
                noticed_s: Percentiles::of(noticed),
                flight_s: Percentiles::of(solved().filter_map(|row| row.flight_s).collect()),
                false_alarms: of.iter().map(|row| row.false_alarms).sum(),
                slid_h: of.iter().map(|row| row.slid_s).sum::<f64>() / 3600.0 + 0.0,
            }
        });
        Self {
            evidence: evidence.into(),
            rows,
        }
    }
}

impl Outcome for LiftOffs {
    fn lines(&self) -> impl IntoIterator<Item: Serialize> {
        &self.rows
    }

    fn table(&self) -> Table {
        let mut table = outcome::table([
            "evidence",
            "limit (ms)",
            "lift-offs",
            "longer than the limit",
            "in time",
            "missed",
            "unsolved",
            "median, 90, 99 %, max (ms)",
            "false alarms",
        ]);
        for of in &self.evidence {
            let times = of.noticed_s.map_or("–".into(), |times| {
                let of = [times.median, times.p90, times.p99, times.max];
                of.map(|time_s| format!("{:.2}", 1e3 * time_s)).join(", ")
            });
            table.add_row([
                outcome::name(&of.evidence),
                format!("{}", 1e3 * of.bar_s),
                of.lift_offs.to_string(),
                of.long_flights.to_string(),
                of.in_time.to_string(),
                of.missed.to_string(),
                of.unsolved.to_string(),
                times,
                format!("{} in {:.2} h", of.false_alarms, of.slid_h),
            ]);
        }
        table
    }
}
