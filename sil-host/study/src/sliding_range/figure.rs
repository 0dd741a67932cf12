//! Bar chart of the sliding ranges, with the paper's values and the limit.

use painleve_chart::style::{BLACK_INK, BLUE_INK, GREEN, ORANGE, VERMILLION};
use painleve_chart::{Chart, Mark, Panel, PlotError};

use super::SlidingRanges;
use crate::case::ControllerChoice;
use crate::outcome::Figure;

impl Figure for SlidingRanges {
    fn svg(&self) -> Result<String, PlotError> {
        let far = self
            .rows
            .iter()
            .fold(0.19, |far: f64, row| far.max(row.limit_m + 0.005));
        let mut marks = Vec::new();
        let mut named = Vec::new();
        for (index, row) in self.rows.iter().enumerate() {
            let top = (self.rows.len() - index) as f64;
            marks.push(Mark::Label {
                at: (-0.98 * far, top - 0.3),
                centred: false,
                text: row.title(),
            });
            let colour = match row.controller {
                ControllerChoice::Pid => ORANGE,
                ControllerChoice::HybridPaper | ControllerChoice::HybridPaperModel => BLUE_INK,
                ControllerChoice::Hybrid | ControllerChoice::Scenario(_) => GREEN,
            };
            let name = match row.controller {
                ControllerChoice::Pid => "PID",
                ControllerChoice::HybridPaper | ControllerChoice::HybridPaperModel => {
                    "paper's hybrid law"
                }
                ControllerChoice::Hybrid | ControllerChoice::Scenario(_) => "hybrid law here",
            };
            let mut line = |name: &'static str, colour, width, points| {
                let name = if named.contains(&name) { "" } else { name };
                named.push(name);
                marks.push(Mark::Line {
                    name: name.into(),
                    colour,
                    width,
                    dashed: false,
                    points,
                });
            };
            let at = top - 0.75;
            if let Some(reached) = row.z_sliding_m {
                line(name, colour, 18, vec![(row.start_m, at), (reached, at)]);
            }
            let tick = |x: f64| vec![(x, at - 0.2), (x, at + 0.2)];
            if let Some(paper) = row.paper_m {
                line("the paper", VERMILLION, 8, tick(paper));
            }
            line("p = 0", BLACK_INK, 4, tick(row.limit_m));
        }
        let rows = self.rows.len();
        Chart {
            title: "Sliding range".into(),
            subtitle: "farthest reference reached without lift-off".into(),
            x_title: "Tip position zₜ (m)".into(),
            x: Some(-far..far),
            panels: vec![Panel {
                title: "From the start to Zₜ,sliding".into(),
                y: Some(0.0..rows.max(1) as f64),
                y_ticks: 0,
                height: 76 * rows.max(1) as i32,
                marks,
                ..Panel::default()
            }],
        }
        .svg()
    }
}
