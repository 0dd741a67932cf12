//! Campaigns and ablations as tables and figures.

use std::collections::BTreeMap;

use comfy_table::Table;
use serde::Serialize;

use super::{AblationStudy, Ending, Part, Row};
use crate::plot::PlotError;
use crate::plot::chart::{Chart, Mark, Panel};
use crate::plot::style::{BLACK_INK, BLUE_INK, GREEN, VERMILLION};
use crate::study::outcome::{self, Outcome};
use crate::study::proportion::Proportion;

/// How many of the worst runs are listed.
const WORST: usize = 20;

/// A campaign's outcome.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Campaign {
    /// Its seed.
    pub seed: u64,
    /// Runs that succeeded.
    pub success: Proportion,
    /// How many runs ended in which way.
    pub endings: BTreeMap<Ending, usize>,
    /// Times that contact was taken for flight, before any lift-off.
    pub false_alarms: u32,
    /// Simulated time after captures, h.
    pub slid_h: f64,
    /// Numbers of the worst runs: gravest ending first, then the largest error.
    pub worst: Vec<usize>,
    /// All runs.
    pub rows: Vec<Row>,
}

impl Campaign {
    /// Of all rows.
    pub fn new(seed: u64, rows: Vec<Row>) -> Self {
        let mut endings = BTreeMap::new();
        for row in &rows {
            *endings.entry(row.ending).or_insert(0) += 1;
        }
        let successes = rows.iter().filter(|row| row.ending.is_success()).count();
        let mut failed: Vec<&Row> = rows.iter().filter(|row| !row.ending.is_success()).collect();
        failed.sort_by(|one, other| {
            let errors = other.error_m.total_cmp(&one.error_m);
            other.ending.cmp(&one.ending).then(errors)
        });
        Self {
            seed,
            success: Proportion::new(successes, rows.len()),
            endings,
            false_alarms: rows.iter().map(|row| row.false_alarms).sum(),
            slid_h: rows.iter().map(|row| row.slid_s).sum::<f64>() / 3600.0,
            worst: failed.iter().take(WORST).map(|row| row.index).collect(),
            rows,
        }
    }

    fn count(&self, ending: Ending) -> usize {
        self.endings.get(&ending).copied().unwrap_or(0)
    }
}

impl Outcome for Campaign {
    type Line = Row;

    fn lines(&self) -> Vec<Row> {
        self.rows.clone()
    }

    fn table(&self) -> Table {
        let mut table =
            outcome::table(["what", "runs", "μ", "belt (m/s)", "rate (Hz)", "error (mm)"]);
        table.add_row(["success (95 %)", &self.success.to_string(), "", "", "", ""]);
        for (ending, count) in &self.endings {
            table.add_row([&outcome::name(ending), &count.to_string(), "", "", "", ""]);
        }
        let alarms = format!("{} in {:.2} h", self.false_alarms, self.slid_h);
        table.add_row(["false alarms", &alarms, "", "", "", ""]);
        for row in self.worst.iter().filter_map(|&index| self.rows.get(index)) {
            table.add_row([
                outcome::name(&row.ending),
                format!("--replay {}:{}", self.seed, row.index),
                format!("{:.2}", row.mu),
                format!("{:.2}", row.v_belt_m_s),
                row.tick_hz.to_string(),
                format!("{:.2}", 1e3 * row.error_m),
            ]);
        }
        table
    }

    fn svg(&self) -> Result<String, PlotError> {
        // Thousands of dots would hide each other, and a hundred small ones are hard to see.
        let size = if self.rows.len() > 2000 { 4 } else { 9 };
        let dots = |name: &str, colour, size, success, y: fn(&Row) -> f64| {
            let rows = self.rows.iter();
            let points = rows
                .filter(|row| row.ending.is_success() == success)
                .map(|row| (row.v_belt_m_s, y(row)));
            let points: Vec<_> = points.collect();
            Mark::Dots {
                name: format!("{name}: {} runs", points.len()),
                colour,
                size,
                points,
            }
        };
        let panel = |title: &str, y: fn(&Row) -> f64, range| Panel {
            title: title.into(),
            y: Some(range),
            marks: vec![
                dots("success", BLUE_INK, size, true, y),
                dots("failure", VERMILLION, 14, false, y),
            ],
            ..Panel::default()
        };
        Chart {
            title: "Robustness".into(),
            subtitle: format!("success, with its 95 % interval: {}", self.success),
            x_title: "Belt speed (m/s)".into(),
            x: Some(-1.05..1.05),
            panels: vec![
                panel("Friction μ (–)", |row| row.mu, 0.15..1.05),
                panel(
                    "Control rate (kHz)",
                    |row| 1e-3 * f64::from(row.tick_hz),
                    0.0..5.1,
                ),
                panel(
                    "Encoder (bits)",
                    |row| f64::from(row.encoder_bits),
                    11.5..18.5,
                ),
            ],
        }
        .svg()
    }
}

/// What the campaign comes to without a part.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ablated {
    /// The part that is switched off; none for the whole controller.
    pub without: Option<Part>,
    /// The keys that do it.
    pub keys: String,
    /// Runs.
    pub runs: usize,
    /// Runs that succeeded.
    pub successes: usize,
    /// Part of them.
    pub rate: f64,
    /// Lower end of its 95 % interval.
    pub lower: f64,
    /// Upper end of its 95 % interval.
    pub upper: f64,
    /// Runs with a lift-off after capture.
    pub lift_offs: usize,
    /// Runs that ended elsewhere, or at an edge that is none.
    pub not_reached: usize,
    /// Runs without capture.
    pub not_captured: usize,
    /// Runs with a fault.
    pub faults: usize,
    /// Mean distance from target or governed edge at the end, mm.
    pub mean_error_mm: f64,
}

/// What each part contributes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ablation {
    /// The whole controller, then one line per part.
    pub rows: Vec<Ablated>,
}

impl Ablation {
    /// Of all rows of a study.
    pub fn new(study: &AblationStudy, rows: Vec<Row>) -> Self {
        let runs = study.campaign.runs.max(1);
        let without = std::iter::once(None).chain(study.parts.iter().copied().map(Some));
        let rows = without
            .zip(rows.chunks(runs))
            .map(|(without, rows)| {
                let campaign = Campaign::new(study.campaign.seed, rows.to_vec());
                let errors: f64 = rows.iter().map(|row| row.error_m).sum();
                Ablated {
                    without,
                    keys: without.map_or(String::new(), |part| part.without().join(" ")),
                    runs: campaign.success.runs,
                    successes: campaign.success.successes,
                    rate: campaign.success.rate,
                    lower: campaign.success.lower,
                    upper: campaign.success.upper,
                    lift_offs: campaign.count(Ending::LiftOff),
                    not_reached: campaign.count(Ending::NotReached)
                        + campaign.count(Ending::StoppedEarly),
                    not_captured: campaign.count(Ending::NotCaptured),
                    faults: campaign.count(Ending::Fault) + campaign.count(Ending::Unsolved),
                    mean_error_mm: 1e3 * errors / rows.len() as f64,
                }
            })
            .collect();
        Self { rows }
    }
}

impl Ablated {
    fn name(&self) -> String {
        let part = |part: &Part| format!("without {}", outcome::name(part));
        self.without.as_ref().map_or("everything".into(), part)
    }
}

impl Outcome for Ablation {
    type Line = Ablated;

    fn lines(&self) -> Vec<Ablated> {
        self.rows.clone()
    }

    fn table(&self) -> Table {
        let mut table = outcome::table([
            "controller",
            "success (95 %)",
            "lift-off",
            "not reached",
            "not captured",
            "fault",
            "mean error (mm)",
        ]);
        for row in &self.rows {
            table.add_row([
                row.name(),
                Proportion::new(row.successes, row.runs).to_string(),
                row.lift_offs.to_string(),
                row.not_reached.to_string(),
                row.not_captured.to_string(),
                row.faults.to_string(),
                format!("{:.2}", row.mean_error_mm),
            ]);
        }
        table
    }

    fn svg(&self) -> Result<String, PlotError> {
        let count = self.rows.len();
        let runs = self.rows.first().map_or(0, |row| row.runs);
        let mut marks = Vec::new();
        for (index, row) in self.rows.iter().enumerate() {
            let top = (count - index) as f64;
            marks.push(Mark::Label {
                at: (1.0, top - 0.3),
                centred: false,
                text: format!("{}: {:.1} %", row.name(), 100.0 * row.rate),
            });
            let mut bar = |name: &str, colour, width, from: f64, to: f64| {
                marks.push(Mark::Line {
                    name: if index == 0 {
                        name.into()
                    } else {
                        String::new()
                    },
                    colour,
                    width,
                    dashed: false,
                    points: vec![(100.0 * from, top - 0.7), (100.0 * to, top - 0.7)],
                });
            };
            bar("success", GREEN, 16, 0.0, row.rate);
            bar("95 % interval", BLACK_INK, 4, row.lower, row.upper);
        }
        Chart {
            title: "What each part contributes".into(),
            subtitle: format!("the same {runs} runs of the robustness campaign each time"),
            x_title: "Success (%)".into(),
            x: Some(0.0..101.0),
            panels: vec![Panel {
                title: "With one part of the controller switched off".into(),
                y: Some(0.0..count.max(1) as f64),
                y_ticks: 0,
                height: 80 * count.max(1) as i32,
                marks,
                ..Panel::default()
            }],
        }
        .svg()
    }
}
