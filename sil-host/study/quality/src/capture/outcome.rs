//! Captures as a table and as a histogram, with the limit.

use comfy_table::Table;
use painleve_study_core::outcome::{self, Outcome};
use serde::Serialize;

use super::Row;
use crate::distribution::Percentiles;
use crate::proportion::Proportion;

/// Outcome of the study.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Captures {
    /// Success rate.
    pub success: Proportion,
    /// Number of runs whose plant could not be solved; the distributions are of the other runs.
    pub unsolved: usize,
    /// Times to capture, s.
    pub capture_s: Option<Percentiles>,
    /// Distances from the reference at the end, m.
    pub error_m: Option<Percentiles>,
    /// All runs.
    pub rows: Vec<Row>,
}

impl Captures {
    /// Collects all rows.
    pub fn new(rows: Vec<Row>) -> Self {
        let solved: Vec<&Row> = rows.iter().filter(|row| row.solved).collect();
        let of = |value: fn(&Row) -> f64| {
            let values = solved.iter().map(|row| value(row));
            Percentiles::of(values.collect())
        };
        let successes = rows.iter().filter(|row| row.success).count();
        Self {
            success: Proportion::new(successes, rows.len()),
            unsolved: rows.len() - solved.len(),
            capture_s: of(|row| row.capture_s),
            error_m: of(|row| row.error_m),
            rows,
        }
    }
}

impl Outcome for Captures {
    fn lines(&self) -> impl IntoIterator<Item: Serialize> {
        &self.rows
    }

    fn table(&self) -> Table {
        let mut table = outcome::table(["quantity", "median", "90 %", "99 %", "max"]);
        table.add_row(["success (95 %)", &self.success.to_string(), "", "", ""]);
        if self.unsolved > 0 {
            table.add_row(["unsolved", &self.unsolved.to_string(), "", "", ""]);
        }
        let lines = [
            ("time to capture (ms)", self.capture_s),
            ("error at the end (mm)", self.error_m),
        ];
        for (what, values) in lines {
            if let Some(values) = values {
                let of = [values.median, values.p90, values.p99, values.max];
                let mut line = vec![what.to_string()];
                line.extend(of.map(|value| format!("{:.3}", 1e3 * value)));
                table.add_row(line);
            }
        }
        for row in self.rows.iter().filter(|row| !row.success) {
            let ending = if row.solved { "failed" } else { "unsolved" };
            table.add_row([
                format!("run {} {ending}", row.index),
                format!("on at {} s", row.enabled_s),
                format!("noise {}", row.noise_seed),
                format!("{:.0} ms", 1e3 * row.capture_s),
                format!("{:.2} mm", 1e3 * row.error_m),
            ]);
        }
        table
    }
}
