//! Table of the maps.

use comfy_table::Table;
use painleve_study_core::outcome::{self, Outcome};
use serde::Serialize;

use super::{Regions, Theta2};

impl Outcome for Regions {
    fn lines(&self) -> impl IntoIterator<Item: Serialize> {
        self.maps.iter().flat_map(|map| &map.cells)
    }

    fn table(&self) -> Table {
        let mut table = outcome::table([
            format!("μ = {}", self.mu),
            "slip".into(),
            "p = 0 at θ₁ (°)".into(),
            "sliding".into(),
            "flight".into(),
            "indeterminate".into(),
            "inconsistent".into(),
        ]);
        for map in &self.maps {
            let zeros: Vec<String> = map
                .p_zero_theta1_deg
                .iter()
                .map(|theta1| format!("{theta1:.3}"))
                .collect();
            let percent = |part: f64| format!("{:.2} %", 100.0 * part);
            table.add_row([
                format!(
                    "θ₂ {}",
                    if map.theta2 == Theta2::Positive {
                        "> 0"
                    } else {
                        "< 0"
                    }
                ),
                outcome::name(&map.slip),
                if zeros.is_empty() {
                    "nowhere".into()
                } else {
                    zeros.join(", ")
                },
                percent(map.sliding),
                percent(map.flight),
                percent(map.indeterminate),
                percent(map.inconsistent),
            ]);
        }
        table
    }
}
