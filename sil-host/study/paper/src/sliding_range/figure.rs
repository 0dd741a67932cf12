//! Bar chart of the sliding ranges in groups, with the paper's values and the limit.

use painleve_chart::style::{BLACK_INK, BLUE_INK, GREEN, ORANGE, VERMILLION};
use painleve_chart::{Chart, Mark, Panel};
use painleve_study_core::case::ControllerChoice;
use painleve_study_core::outcome::{self, Figure};

use super::{Row, SlidingRanges};

/// Height of a row, drawn units: a label and its bar.
const ROW: i32 = 84;

impl Figure for SlidingRanges {
    fn svg(&self) -> String {
        let far = self
            .rows
            .iter()
            .fold(0.19, |far: f64, row| far.max(row.limit_m.abs() + 0.005));
        let varies: Vec<bool> = (0..Row::PARTS)
            .map(|part| {
                let pairs = self.rows.windows(2);
                let mut differ = pairs.map(|two| two[0].parts()[part] != two[1].parts()[part]);
                differ.any(|differs| differs)
            })
            .collect();
        let mut groups: Vec<(String, Vec<&Row>)> = Vec::new();
        for row in &self.rows {
            let group = row.group(&varies);
            match groups.iter_mut().find(|(name, _)| *name == group) {
                Some((_, rows)) => rows.push(row),
                None => groups.push((group, vec![row])),
            }
        }
        let panels = groups
            .iter()
            .map(|(name, rows)| panel(name, rows, &varies, far));
        Chart {
            title: "Sliding range".into(),
            subtitle: "from the start to the farthest reference reached without lift-off".into(),
            x_title: "Tip position zₜ (m)".into(),
            x: Some(-far..far),
            panels: panels.collect(),
            one_legend: true,
            ..Chart::default()
        }
        .svg()
    }
}

impl Row {
    /// Number of [`parts`](Self::parts).
    const PARTS: usize = 4;

    /// Returns what a row is about besides its posture.
    fn parts(&self) -> [String; Self::PARTS] {
        [
            self.controller.to_string(),
            outcome::name(&self.converters),
            format!("μ = {}", self.mu),
            self.reference.to_string(),
        ]
    }

    /// Returns the parts that vary, or those that do not.
    fn parts_that(&self, vary: bool, varies: &[bool]) -> Vec<String> {
        let parts = self.parts().into_iter().zip(varies);
        parts
            .filter(|(_, varies)| **varies == vary)
            .map(|(part, _)| part)
            .collect()
    }

    /// Returns what the rows of a panel have in common: their posture, and what never varies.
    fn group(&self, varies: &[bool]) -> String {
        let mut words = vec![outcome::name(&self.posture)];
        words.extend(self.parts_that(false, varies));
        words.join(", ")
    }

    /// Returns what distinguishes the row from others of its panel, and the result.
    fn label(&self, varies: &[bool]) -> String {
        let mut words = self.parts_that(true, varies);
        words.push(match self.z_sliding_m {
            Some(reached) => format!("{reached:.4} m").replace('-', "−"),
            None => "none".into(),
        });
        words.join(", ")
    }
}

fn panel(name: &str, rows: &[&Row], varies: &[bool], far: f64) -> Panel {
    let mut marks = Vec::new();
    for (index, row) in rows.iter().enumerate() {
        let top = (rows.len() - index) as f64;
        marks.push(Mark::Label {
            at: (-0.98 * far, top - 0.32),
            centred: false,
            text: row.label(varies),
        });
        let (name, colour) = match row.controller {
            ControllerChoice::Pid => ("PID", ORANGE),
            ControllerChoice::HybridPaper | ControllerChoice::HybridPaperModel => {
                ("paper's hybrid law", BLUE_INK)
            }
            ControllerChoice::Hybrid | ControllerChoice::Scenario(_) => ("hybrid law here", GREEN),
        };
        let at = top - 0.76;
        let line = |name: &str, colour, width, points| Mark::Line {
            name: name.into(),
            colour,
            width,
            dashed: false,
            points,
        };
        if let Some(reached) = row.z_sliding_m {
            marks.push(line(
                name,
                colour,
                20,
                vec![(row.start_m, at), (reached, at)],
            ));
        }
        let tick = |x: f64| vec![(x, at - 0.19), (x, at + 0.19)];
        if let Some(paper) = row.paper_m {
            marks.push(line("the paper", VERMILLION, 8, tick(paper)));
        }
        marks.push(line("p = 0", BLACK_INK, 4, tick(row.limit_m)));
    }
    let count = rows.len().max(1);
    Panel {
        title: name.into(),
        y: Some(0.0..count as f64),
        y_ticks: 0,
        height: ROW * count as i32,
        marks,
        ..Panel::default()
    }
}
