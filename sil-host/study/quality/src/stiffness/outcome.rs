//! The rows as a table.

use comfy_table::Table;
use painleve_study_core::outcome::{self, Outcome};
use serde::Serialize;

use super::Row;

/// Outcome of the study.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StiffnessOutcome {
    /// All stiffnesses, the rigid plant last.
    pub rows: Vec<Row>,
}

impl Outcome for StiffnessOutcome {
    fn lines(&self) -> impl IntoIterator<Item: Serialize> {
        &self.rows
    }

    fn table(&self) -> Table {
        let mut table = outcome::table([
            "contact",
            "x0,a: impulse (mN·s)",
            "contact (ms)",
            "peak force (N)",
            "throw (mm/s)",
            "slip then (mm/s)",
            "sliding deviates by (rad)",
            "p > 0 to, elbow up (m)",
            "elbow down (m)",
            "bounces from (m/s)",
            "to (m/s)",
        ]);
        let ended = |value: Option<f64>| value.map_or("–".into(), |value| value.to_string());
        for row in &self.rows {
            let stiffness = row.stiffness_n_m;
            table.add_row([
                stiffness.map_or("rigid".into(), |stiffness| format!("{stiffness:e} N/m")),
                format!("{:.3}", 1e3 * row.impulse_ns),
                format!("{:.3}", 1e3 * row.contact_s),
                row.peak_force_n
                    .map_or("∞".into(), |force| format!("{force:.1}")),
                format!("{:.2}", 1e3 * row.throw_m_s),
                format!("{:.2}", 1e3 * row.slip_m_s),
                format!("{:.1e}", row.deviation_rad),
                format!("{:.5}", row.edge_up_m),
                format!("{:.5}", row.edge_down_m),
                ended(row.bounces_from_m_s),
                ended(row.bounces_to_m_s),
            ]);
        }
        table
    }
}
