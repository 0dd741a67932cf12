//! Dot plots of the runs over belt speed, friction, control rate and encoder resolution.

use painleve_chart::style::{BLUE_INK, VERMILLION};
use painleve_chart::{Chart, Mark, Panel, PlotError};

use super::Row;
use super::outcome::RobustnessOutcome;
use crate::outcome::Figure;

impl Figure for RobustnessOutcome {
    fn svg(&self) -> Result<String, PlotError> {
        // Thousands of large dots would hide each other, and a hundred small ones are hard to see.
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
