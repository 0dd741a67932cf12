//! Histogram of the capture time, with its limit.

use painleve_chart::Chart;
use painleve_chart::style::BLUE_INK;
use painleve_study_core::outcome::Figure;

use super::outcome::Captures;
use super::{LIMIT_S, WITHIN_M};
use crate::distribution::histogram;

impl Figure for Captures {
    fn svg(&self) -> String {
        let solved = self.rows.iter().filter(|row| row.solved);
        let times: Vec<f64> = solved.map(|row| row.capture_s).collect();
        let note = "the last bar includes all longer times".to_string();
        Chart {
            title: "Capture of the bouncing arm".into(),
            subtitle: format!(
                "{}: last landing within {LIMIT_S} s,\nat the end within {} mm of the reference, without a fault",
                self.success,
                1e3 * WITHIN_M
            ),
            x_title: "Time from enabling to the last landing (s)".into(),
            x: Some(0.0..0.6),
            panels: vec![histogram(
                "Number of runs",
                note,
                BLUE_INK,
                0.6,
                LIMIT_S,
                &times,
            )],
            ..Chart::default()
        }
        .svg()
    }
}
