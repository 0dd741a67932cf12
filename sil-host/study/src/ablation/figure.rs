//! Bar chart of the success rate without each part.

use painleve_chart::style::{BLACK_INK, GREEN};
use painleve_chart::{Chart, Mark, Panel, PlotError};

use super::outcome::Ablation;
use crate::outcome::Figure;

impl Figure for Ablation {
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
            title: "Contribution of each part".into(),
            subtitle: format!("the same {runs} runs of the robustness campaign for every bar"),
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
