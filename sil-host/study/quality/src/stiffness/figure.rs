//! The inconsistent start over time: normal force, slip and height of the tip.

use painleve_chart::style::{BLACK_INK, BLUE_INK, GREEN, ORANGE, SKY, VERMILLION};
use painleve_chart::{Chart, Mark, Panel};
use painleve_study_core::outcome::Figure;

use super::{Row, StiffnessOutcome, Trace};

/// End of the time axis, ms.
const END_MS: f64 = 8.0;

impl Figure for StiffnessOutcome {
    fn svg(&self) -> String {
        let colours = [SKY, BLUE_INK, GREEN, ORANGE, VERMILLION];
        let panel = |title: &str, note: &str, named: bool, value: fn(&Trace, usize) -> f64| {
            let curves = self.rows.iter().enumerate().map(|(index, row)| {
                let points = row.trace.time_s.iter().enumerate();
                Mark::Line {
                    name: if named { name(row) } else { String::new() },
                    colour: match row.stiffness_n_m {
                        None => BLACK_INK,
                        Some(_) => colours[index % colours.len()],
                    },
                    width: 3,
                    dashed: row.stiffness_n_m.is_none(),
                    points: points
                        .map(|(point, time_s)| (1e3 * time_s, value(&row.trace, point)))
                        .collect(),
                }
            });
            Panel {
                title: title.into(),
                note: note.into(),
                marks: curves.collect(),
                height: 420,
                ..Panel::default()
            }
        };
        let force_n = panel(
            "Normal force (N)",
            "clipped at 100 N; an impulse at time zero if rigid",
            true,
            |trace, point| trace.force_n[point].min(100.0),
        );
        let slip_m_s = panel("Slip (m/s)", "", false, |trace, point| {
            trace.slip_m_s[point]
        });
        let gap_mm = panel("Height of the tip (mm)", "", false, |trace, point| {
            1e3 * trace.gap_m[point]
        });
        Chart {
            title: "The paradox resolved: the inconsistent start on ever stiffer contacts".into(),
            subtitle: "x0,a at rest; the rigid plant resolves it by an impact without collision"
                .into(),
            x_title: "Time (ms)".into(),
            x: Some(0.0..END_MS),
            panels: vec![force_n, slip_m_s, gap_mm],
            ..Chart::default()
        }
        .svg()
    }
}

fn name(row: &Row) -> String {
    row.stiffness_n_m
        .map_or("rigid".into(), |stiffness| format!("{stiffness:e} N/m"))
}
