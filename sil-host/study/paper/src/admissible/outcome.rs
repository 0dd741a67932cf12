//! Table of the intervals, with the paper's for comparison.

use comfy_table::Table;
use painleve_shared::{Posture, Slip};
use painleve_study_core::outcome::{self, Outcome};
use serde::Serialize;

use super::{Admissible, Intervals};
use crate::printed;

/// One interval, as a line of the CSV file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct IntervalLine {
    mu: f64,
    posture: Posture,
    from_m: f64,
    to_m: f64,
    paper_from_m: Option<f64>,
    paper_to_m: Option<f64>,
    difference_m: Option<f64>,
    critical_friction: f64,
    slip: Slip,
}

impl Admissible {
    /// Returns the direction of slip, as the paper writes it.
    pub(super) fn direction(&self) -> &'static str {
        match self.slip {
            Slip::Positive => "żᵣ > 0",
            Slip::Negative => "żᵣ < 0",
        }
    }

    pub(super) fn postures(&self) -> [(Posture, &'static str, &Intervals); 2] {
        [
            (Posture::ElbowUp, "elbow up", &self.elbow_up),
            (Posture::ElbowDown, "elbow down", &self.elbow_down),
        ]
    }
}

impl Outcome for Admissible {
    fn lines(&self) -> impl IntoIterator<Item: Serialize> {
        let mut lines = Vec::new();
        for (posture, _, intervals) in self.postures() {
            for &[from_m, to_m] in &intervals.intervals_m {
                lines.push(IntervalLine {
                    mu: self.mu,
                    posture,
                    from_m,
                    to_m,
                    paper_from_m: intervals.paper_m.map(|paper| paper[0]),
                    paper_to_m: intervals.paper_m.map(|paper| paper[1]),
                    difference_m: intervals.difference_m,
                    critical_friction: self.critical_friction,
                    slip: self.slip,
                });
            }
        }
        lines
    }

    fn table(&self) -> Table {
        let mut table = outcome::table([
            format!("μ = {}, {}", self.mu, self.direction()),
            "p > 0 for zₜ (m)".into(),
            "the paper".into(),
            "upper end, ours − paper".into(),
            "the paper's upper end fits".into(),
        ]);
        let dash = || "–".to_owned();
        for (_, name, intervals) in self.postures() {
            let ours: Vec<String> = intervals
                .intervals_m
                .iter()
                .map(|[from, to]| format!("{from:.5} … {to:.5}"))
                .collect();
            table.add_row([
                name.into(),
                if ours.is_empty() {
                    "nowhere".into()
                } else {
                    ours.join(", ")
                },
                intervals
                    .paper_m
                    .map_or_else(dash, |[from, to]| format!("{from} … {to}")),
                intervals
                    .difference_m
                    .map_or_else(dash, |metres| format!("{:+.2} mm", 1e3 * metres)),
                intervals
                    .paper_fits
                    .map_or_else(dash, |fits| format!("μ = {}: {:.5}", fits.mu, fits.to_m)),
            ]);
        }
        let posture = match self.critical_posture {
            Posture::ElbowUp => "elbow up",
            Posture::ElbowDown => "elbow down",
        };
        table.add_row([
            "critical friction".into(),
            format!(
                "{:.6}, {posture} at zₜ = {:.4} m",
                self.critical_friction, self.critical_tip_t_m
            ),
            printed::critical_friction(&self.arm)
                .map_or_else(dash, |mu| format!("{mu} (steps of 0.1)")),
            dash(),
            dash(),
        ]);
        table
    }
}
