//! Histograms of the detection time of a lift-off, with its limit.

use painleve_chart::Chart;
use painleve_chart::style::{BLUE_INK, ORANGE};
use painleve_firmware::estimate::contact::Evidence;
use painleve_study_core::outcome::Figure;

use super::outcome::LiftOffs;
use super::{Row, bar_s};
use crate::distribution::histogram;

/// End of the axis, ms.
const FARTHEST_MS: f64 = 20.0;

impl Figure for LiftOffs {
    fn svg(&self) -> String {
        let panel = |title: &str, evidence, colour| {
            let bar_s = bar_s(evidence);
            let is_long = |row: &&Row| row.evidence == evidence && row.is_long(bar_s);
            let long = self.rows.iter().filter(is_long);
            let times = long.clone().filter_map(|row| Some(1e3 * row.noticed_s?));
            let times: Vec<f64> = times.collect();
            let limit_ms = 1e3 * bar_s;
            let within = times.iter().filter(|time_ms| **time_ms <= limit_ms).count();
            let flights = long.count();
            let note = format!(
                "of {flights} flights longer than {limit_ms} ms, {within} are detected within \
                 {limit_ms} ms, {} later, {} never; the last bar includes all longer delays",
                times.len() - within,
                flights - times.len(),
            );
            histogram(title, note, colour, FARTHEST_MS, limit_ms, &times)
        };
        Chart {
            title: "Delay in detecting a lift-off".into(),
            subtitle:
                "the governor is switched off, so that the reference leads the tip beyond p = 0"
                    .into(),
            x_title: "Time from lift-off to its detection (ms)".into(),
            x: Some(0.0..FARTHEST_MS),
            panels: vec![
                panel(
                    "Flights detected with the force cell",
                    Evidence::ForceCell,
                    BLUE_INK,
                ),
                panel(
                    "Flights detected with the encoders",
                    Evidence::Encoders,
                    ORANGE,
                ),
            ],
            ..Chart::default()
        }
        .svg()
    }
}
