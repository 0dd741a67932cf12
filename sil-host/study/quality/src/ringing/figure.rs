//! Measured onsets of the ringing over the rate of the observer, on the stability limit.

use painleve_chart::style::{BLUE_INK, GREEN, ORANGE, PURPLE, VERMILLION};
use painleve_chart::{Chart, Mark, Panel};
use painleve_study_core::outcome::Figure;

use super::{RingingOutcome, Row};

impl Figure for RingingOutcome {
    fn svg(&self) -> String {
        let colours = [BLUE_INK, GREEN, ORANGE, VERMILLION, PURPLE];
        let mut dampings: Vec<f64> = self.rows.iter().map(|row| row.damping_ns_m).collect();
        dampings.dedup();
        let points = |damping: f64, value: fn(&Row) -> Option<f64>| {
            let rows = self.rows.iter().filter(|row| row.damping_ns_m == damping);
            let mut points: Vec<_> = rows
                .filter_map(|row| Some((row.rate_per_s, value(row)?)))
                .collect();
            points.sort_by(|one, other| one.0.total_cmp(&other.0));
            points
        };
        let marks = dampings.iter().enumerate().flat_map(|(index, &damping)| {
            let colour = colours[index % colours.len()];
            [
                Mark::Line {
                    name: format!("limit, c = {damping} N·s/m"),
                    colour,
                    width: 3,
                    dashed: false,
                    points: points(damping, |row| row.limit_p_ratio),
                },
                Mark::Dots {
                    name: "measured".into(),
                    colour,
                    size: 14,
                    points: points(damping, |row| row.onset_p_ratio),
                },
            ]
        });
        let farthest = self
            .rows
            .iter()
            .map(|row| row.rate_per_s)
            .fold(1.0, f64::max);
        Chart {
            title: "Where the friction observer makes the contact ring".into(),
            subtitle: format!(
                "contact of {:e} N/m; below each line it rings",
                self.stiffness_n_m
            ),
            x_title: "Rate λ of the observer (1/s)".into(),
            x: Some(0.0..1.05 * farthest),
            panels: vec![Panel {
                title: "p/Q₂₂".into(),
                height: 640,
                marks: marks.collect(),
                ..Panel::default()
            }],
            ..Chart::default()
        }
        .svg()
    }
}
