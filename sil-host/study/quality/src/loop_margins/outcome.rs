//! The rows as a table of margins along the belt.

use comfy_table::Table;
use serde::Serialize;

use super::{LoopMargins, Row};
use painleve_study_core::outcome::{self, Outcome};
use painleve_study_core::tabular::Tabular;

/// Outcome of the study.
#[derive(Clone, Debug, Serialize)]
pub struct LoopOutcome {
    /// All controllers and places.
    pub rows: Vec<Row>,
}

/// Largest differences between linearised and measured loops.
#[derive(Clone, Copy, Debug)]
pub struct Difference {
    /// Of the gain, as a part of it.
    pub gain_share: f64,
    /// Of the phase, degrees.
    pub phase_deg: f64,
}

impl LoopOutcome {
    /// Returns the largest differences; `None` without any loop.
    pub fn largest_difference(&self) -> Option<Difference> {
        let loops = self.rows.iter().flat_map(|row| &row.loops);
        let points = loops.flat_map(|one| &one.points);
        points
            .map(|point| {
                let decibels = (point.measured_gain_db - point.gain_db).abs();
                let degrees = (point.measured_phase_deg - point.phase_deg).abs();
                Difference {
                    gain_share: 10_f64.powf(decibels / 20.0) - 1.0,
                    phase_deg: degrees,
                }
            })
            .reduce(|one, other| Difference {
                gain_share: one.gain_share.max(other.gain_share),
                phase_deg: one.phase_deg.max(other.phase_deg),
            })
    }
}

impl Outcome for LoopOutcome {
    fn lines(&self) -> impl IntoIterator<Item: Serialize> {
        self.rows.iter().flat_map(LoopMargins::lines)
    }

    fn table(&self) -> Table {
        let mut table = outcome::table([
            "controller",
            "zₜ (m)",
            "p/Q₂₂",
            "loop",
            "crossover (Hz)",
            "phase margin (°)",
            "delay margin (ms)",
            "gain margins (dB)",
            "1/max|S|",
            "with μ ∓ 10 %",
            "with fₙ* ∓ 10 %",
        ]);
        for row in &self.rows {
            let place = [
                row.controller.to_string(),
                format!("{:.4}", row.tip_m).replace('-', "−"),
                format!("{:.3}", row.p_ratio).replace('-', "−"),
            ];
            if let Some(reason) = &row.not_held {
                let mut cells = place.to_vec();
                cells.push(format!("not held: {}", outcome::name(reason)));
                table.add_row(cells);
            }
            for one in &row.loops {
                let (margins, sensitivity) = (&one.margins, &one.sensitivity);
                let mut cells = place.to_vec();
                cells.extend([
                    one.name.into(),
                    number(margins.crossover_hz, 1),
                    number(margins.phase_deg, 1),
                    number(margins.delay_ms, 2),
                    format!(
                        "{}, {}",
                        margin('+', margins.gain_db),
                        margin('−', margins.reduction_db)
                    ),
                    number(Some(margins.modulus), 3),
                    pair(sensitivity.less_friction, sensitivity.more_friction),
                    pair(sensitivity.less_force, sensitivity.more_force),
                ]);
                table.add_row(cells);
            }
        }
        table
    }
}

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or("–".into(), |value| format!("{value:.digits$}"))
}

fn margin(sign: char, decibels: Option<f64>) -> String {
    decibels.map_or("none".into(), |value| format!("{sign}{value:.1}"))
}

fn pair(less: Option<f64>, more: Option<f64>) -> String {
    let change = |value: Option<f64>| {
        value.map_or("–".into(), |value| {
            format!("{value:+.3}").replace('-', "−")
        })
    };
    format!("{} {}", change(less), change(more))
}
