//! The campaign once more without one part of the controller after the other, as a table and bars.

use comfy_table::Table;
use painleve_chart::style::{BLACK_INK, GREEN};
use painleve_chart::{Chart, Mark, Panel, PlotError};
use serde::Serialize;

use super::{Campaign, Ending, Part, Robustness, Row};
use crate::outcome::{self, Outcome};
use crate::proportion::Proportion;
use crate::{Study, StudyError};

/// The same campaign with one part of the controller after the other switched off.
#[derive(Clone, Debug)]
pub struct AblationStudy {
    /// The campaign.
    pub campaign: Robustness,
    /// The parts; the whole controller comes first.
    pub parts: Vec<Part>,
}

impl Study for AblationStudy {
    type Row = Row;

    fn len(&self) -> usize {
        crate::combinations(&[self.parts.len() + 1, self.campaign.runs])
    }

    fn row(&self, index: usize) -> Result<Row, StudyError> {
        let mut campaign = self.campaign.clone();
        let part = index / campaign.runs;
        if let Some(part) = part.checked_sub(1).and_then(|part| self.parts.get(part)) {
            let keys = part.without().iter().map(ToString::to_string);
            campaign.overrides.extend(keys);
        }
        campaign.row(index % campaign.runs)
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
    /// Runs with a fault, or whose plant could not be solved.
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
                let campaign =
                    Campaign::new(study.campaign.arms, study.campaign.seed, rows.to_vec());
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
            "fault or unsolved",
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
