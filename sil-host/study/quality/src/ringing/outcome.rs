//! The rows as a table.

use comfy_table::Table;
use painleve_study_core::outcome::{self, Outcome};
use serde::Serialize;

use super::Row;

/// Outcome of the study.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RingingOutcome {
    /// Stiffness of the contact, N/m.
    pub stiffness_n_m: f64,
    /// All dampings and rates.
    pub rows: Vec<Row>,
}

impl Outcome for RingingOutcome {
    fn lines(&self) -> impl IntoIterator<Item: Serialize> {
        &self.rows
    }

    fn table(&self) -> Table {
        let mut table = outcome::table([
            "damping (N·s/m)",
            "rate λ (1/s)",
            "rings below p/Q₂₂",
            "stability limit",
        ]);
        let ratio = |value: Option<f64>| value.map_or("–".into(), |value| format!("{value:.3}"));
        for row in &self.rows {
            table.add_row([
                row.damping_ns_m.to_string(),
                row.rate_per_s.to_string(),
                ratio(row.onset_p_ratio),
                ratio(row.limit_p_ratio),
            ]);
        }
        table
    }
}
