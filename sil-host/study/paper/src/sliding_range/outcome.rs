//! Sliding ranges as a table and as bars, with the paper's values and the limit.

use comfy_table::Table;
use painleve_study_core::outcome::{self, Outcome};
use serde::Serialize;

use super::SlidingRanges;

impl Outcome for SlidingRanges {
    fn lines(&self) -> impl IntoIterator<Item: Serialize> {
        &self.rows
    }

    fn table(&self) -> Table {
        let mut table = outcome::table([
            "controller",
            "converters",
            "posture",
            "μ",
            "reference",
            "reaches target (m)",
            "tip there (m)",
            "fails by",
            "the paper (m)",
            "limit (m)",
        ]);
        for row in &self.rows {
            let slides = row
                .z_sliding_m
                .map_or("–".into(), |metres| format!("{metres:.4}"));
            let beyond = row
                .reached_beyond_m
                .map_or(String::new(), |metres| format!(" (beyond it: {metres:.3})"));
            table.add_row([
                row.controller.to_string(),
                outcome::name(&row.converters),
                outcome::name(&row.posture),
                row.mu.to_string(),
                row.reference.to_string(),
                slides + &beyond,
                row.tip_t_m
                    .map_or("–".into(), |metres| format!("{metres:.4}")),
                row.ends_by.name().into(),
                row.paper_m.map_or("–".into(), |metres| metres.to_string()),
                format!("{:.4}", row.limit_m),
            ]);
        }
        table
    }
}
