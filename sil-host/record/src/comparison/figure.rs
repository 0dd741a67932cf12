//! The figure of a comparison: each quantity over time after the event, and how far the tips are apart.

use painleve_chart::decimate::Decimator;
use painleve_chart::style::{BLACK_INK, BLUE_INK, Colour, GREEN, ORANGE, PURPLE, SKY, VERMILLION};
use painleve_chart::{Chart, Mark, Panel};

use super::quantity::QUANTITIES;
use super::{Comparison, MOST_RUNS};
use crate::plot::points;

/// Colours of the runs, in their order.
const COLOURS: [Colour; MOST_RUNS] = [BLACK_INK, ORANGE, BLUE_INK, GREEN, PURPLE, SKY, VERMILLION];

impl Comparison<'_> {
    /// Returns the runs over time after the event as SVG text.
    pub fn svg(&self) -> String {
        let curves: Vec<_> = (0..self.runs.len())
            .map(|run| self.decimated(run))
            .collect();
        let mut panels: Vec<Panel> = (0..QUANTITIES.len())
            .map(|quantity| {
                let lines = curves
                    .iter()
                    .enumerate()
                    .map(|(run, bins)| self.line(run, points(bins.bins(), quantity)));
                self.panel(QUANTITIES[quantity].label(), lines.collect())
            })
            .filter(has_points)
            .collect();
        let differences = (1..self.runs.len()).map(|run| {
            let mut bins = Decimator::<1>::default();
            for (time_s, difference) in self.curve_of_difference(run, 0) {
                bins.push(time_s, [difference], 0);
            }
            self.line(run, points(bins.bins(), 0))
        });
        let title = format!("Tip: difference from {} (mm)", self.runs[0].label);
        panels.insert(
            panels.len().min(1),
            self.panel(title, differences.collect()),
        );
        Chart {
            title: "Comparison of runs".into(),
            subtitle: format!("Time zero is {}", self.alignment),
            x_title: format!("Time after {} (s)", self.alignment),
            panels,
            one_legend: true,
            ..Chart::default()
        }
        .svg()
    }

    fn decimated(&self, run: usize) -> Decimator<{ QUANTITIES.len() }> {
        let mut bins = Decimator::default();
        for (tick, time_s) in self.runs[run].table.time_s.iter().enumerate() {
            let values = self.values[run]
                .each_ref()
                .map(|values| values.get(tick).copied().unwrap_or(f64::NAN));
            bins.push(time_s - self.zero_s[run], values, 0);
        }
        bins
    }

    fn line(&self, run: usize, points: Vec<(f64, f64)>) -> Mark {
        Mark::Line {
            name: self.runs[run].label.clone(),
            colour: COLOURS[run % MOST_RUNS],
            // The first run lies below the others, and shows beside them.
            width: if run == 0 { 6 } else { 4 },
            dashed: false,
            points,
        }
    }

    fn panel(&self, title: String, marks: Vec<Mark>) -> Panel {
        Panel {
            title,
            height: 170,
            y_ticks: 5,
            minimum_span: 0.01,
            marks,
            ..Panel::default()
        }
    }
}

fn has_points(panel: &Panel) -> bool {
    panel.marks.iter().any(|mark| match mark {
        Mark::Line { points, .. } => points.iter().any(|point| point.1.is_finite()),
        _ => false,
    })
}
